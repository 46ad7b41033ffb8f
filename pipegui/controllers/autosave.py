"""Autosaving, and what is left of a session that did not end properly.

Each session has a file of its own beside a lock that names its process: a file whose
lock can be taken belongs to a session that is no more.
"""

from collections.abc import Callable
from pathlib import Path
from secrets import token_hex
from typing import TYPE_CHECKING, Any

from PySide6.QtCore import QLockFile, QObject, QTimer

from pipegui.i18n.texts import tr
from pipegui.project.project_file import SUFFIX, work_of, write_project
from pipegui.work.worker import JobProgress

if TYPE_CHECKING:
    from pipegui.controllers.project_session import Projects

INTERVAL_MS = 120_000


class Rescue(QObject):
    """Saves unsaved work beside the project now and then, and offers what was left behind."""

    def __init__(self, projects: "Projects", folder: Path) -> None:
        super().__init__(projects)
        self._projects, self._folder = projects, folder
        folder.mkdir(parents=True, exist_ok=True)
        self.path = folder / f"{token_hex(6)}{SUFFIX}"
        self._lock = _lock_of(self.path)
        self._lock.tryLock(0)
        self._kept: tuple[Any, ...] = ()
        self._offered: tuple[Path, QLockFile] | None = None
        self._restoring: Path | None = None
        self._timer = QTimer(self)
        self._timer.setInterval(INTERVAL_MS)
        self._timer.timeout.connect(self.keep)
        self._timer.start()

    def keep(self, then: Callable[[], object] = lambda: None) -> None:
        """Save what is not saved, in the background; what has no file cannot be."""
        projects = self._projects
        document, camera = projects.document, projects.camera()
        work, own = work_of(document), projects.path
        can_be = all(scan.cloud.source is not None for scan in document.scans)
        if not projects.has_unsaved_work or work == self._kept or not can_be:
            return

        def write(progress: JobProgress) -> None:
            write_project(self.path, document, camera, rescued_from=own, progress=progress)

        def done(_: None) -> None:
            self._kept = work
            then()

        projects.saving.run(tr("Keeping a copy"), write, done)

    def forget(self) -> None:
        """Delete the copy: the work is saved."""
        self._kept = ()
        self.path.unlink(missing_ok=True)

    def close(self) -> None:
        """Delete the copy and its lock at a proper end."""
        self._timer.stop()
        self.forget()
        self._lock.unlock()
        if self._offered is not None:
            self._offered[1].unlock()

    # What was left behind

    def offer(self) -> None:
        """Say if a session did not end properly and left something."""
        left = sorted(self._folder.glob(f"*{SUFFIX}"), key=lambda p: -p.stat().st_mtime)
        for path in left:
            lock = _lock_of(path)
            if path == self.path or not lock.tryLock(0):
                continue
            self._offered = path, lock
            self._projects.tell(
                tr("PipeGUI did not end properly last time. Unsaved work can be restored."),
                "warning",
                answers={tr("Restore"): self.restore, tr("Delete it"): self.drop},
            )
            return

    def restore(self) -> None:
        """Open what was left behind."""
        if self._offered is not None:
            self._restoring = self._offered[0]
            self._projects.open(self._restoring)

    def is_restoring(self, path: Path) -> bool:
        """Whether a project that was opened is what was left behind."""
        return self._restoring is not None and path == self._restoring.resolve()

    def take_over(self) -> None:
        """Keep what was restored as this session's own, and delete what was left behind."""
        self.keep(then=self.drop)

    def drop(self) -> None:
        """Delete what was left behind."""
        if self._offered is not None:
            path, lock = self._offered
            path.unlink(missing_ok=True)
            lock.unlock()
        self._offered = self._restoring = None


def _lock_of(path: Path) -> QLockFile:
    lock = QLockFile(str(path.with_suffix(".lock")))
    # A lock is stale when its process is gone, however old it is.
    lock.setStaleLockTime(0)
    return lock
