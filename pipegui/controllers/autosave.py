"""Autosaving, and recovering the unsaved work of a session that did not end properly.

Each session has a copy of its own beside a lock that names its process: a copy whose
lock can be taken belongs to a session whose process is gone.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from secrets import token_hex
from typing import Any

from PySide6.QtCore import QLockFile, QObject, QTimer, Signal

from pipegui.controllers.session import Session
from pipegui.i18n.texts import tr
from pipegui.model.document import Document
from pipegui.project.project_file import SUFFIX, Camera, work_of, write_project
from pipegui.work.job_queue import JobQueue
from pipegui.work.worker import JobProgress

INTERVAL_MS = 120_000


@dataclass(frozen=True, eq=False)
class Snapshot:
    """What a copy is made of."""

    document: Document
    camera: Camera
    path: Path | None
    """Where the project is saved, None if nowhere yet."""


class Autosave(QObject):
    """Copies unsaved work into a folder now and then, and offers copies that were left there.

    Parameters
    ----------
    session : Session
        Shows the offer of a recovery.
    folder : Path
        Where the copies are; it is made if it is not there.
    saving : JobQueue
        Writes the copies.
    snapshot : callable
        Returns the present state of the work.
    has_unsaved : callable
        Returns whether anything would be lost.
    """

    recovery_requested = Signal(object)
    """Path of a copy to be opened."""

    def __init__(
        self,
        session: Session,
        folder: Path,
        saving: JobQueue,
        snapshot: Callable[[], Snapshot],
        has_unsaved: Callable[[], bool],
    ) -> None:
        super().__init__(session)
        self._session, self._folder, self._saving = session, folder, saving
        self._snapshot, self._has_unsaved = snapshot, has_unsaved
        folder.mkdir(parents=True, exist_ok=True)
        self.path = folder / f"{token_hex(6)}{SUFFIX}"
        self._lock = _lock_of(self.path)
        self._lock.tryLock(0)
        self._copied: tuple[Any, ...] = ()
        self._offered: tuple[Path, QLockFile] | None = None
        self._timer = QTimer(self)
        self._timer.setInterval(INTERVAL_MS)
        self._timer.timeout.connect(self.save_copy)
        self._timer.start()

    def save_copy(self, then: Callable[[], object] = lambda: None) -> None:
        """Copy unsaved work in the background; scans without a file cannot be copied."""
        snapshot = self._snapshot()
        document, work = snapshot.document, work_of(snapshot.document)
        has_files = all(scan.cloud.source is not None for scan in document.scans)
        if not self._has_unsaved() or work == self._copied or not has_files:
            return

        def write(progress: JobProgress) -> None:
            write_project(
                self.path,
                document,
                snapshot.camera,
                recovered_from=snapshot.path,
                progress=progress,
            )

        def done(_: None) -> None:
            self._copied = work
            then()

        self._saving.run(tr("Keeping a copy"), write, done)

    def on_saved(self) -> None:
        """Delete the copy if all the work is saved."""
        if not self._has_unsaved():
            self._delete_copy()

    def _delete_copy(self) -> None:
        self._copied = ()
        self.path.unlink(missing_ok=True)

    def close(self) -> None:
        """Delete the copy and its lock at a proper end."""
        self._timer.stop()
        self._delete_copy()
        self._lock.unlock()
        if self._offered is not None:
            self._offered[1].unlock()

    # Recovery

    def offer_recovery(self) -> None:
        """Offer the newest copy of a session that did not end properly, if there is one."""
        copies = sorted(self._folder.glob(f"*{SUFFIX}"), key=lambda p: -p.stat().st_mtime)
        for path in copies:
            lock = _lock_of(path)
            if path == self.path or not lock.tryLock(0):
                continue
            self._offered = path, lock
            self._session.show_message(
                tr("PipeGUI did not end properly last time. Unsaved work can be restored."),
                "warning",
                answers={tr("Restore"): self.recover, tr("Delete it"): self.discard},
            )
            return

    def recover(self) -> None:
        """Have the offered copy opened."""
        if self._offered is not None:
            self.recovery_requested.emit(self._offered[0])

    def adopt(self) -> None:
        """Copy the recovered work as this session's own, then discard the offered copy."""
        self.save_copy(then=self.discard)

    def discard(self) -> None:
        """Delete the offered copy."""
        if self._offered is not None:
            path, lock = self._offered
            path.unlink(missing_ok=True)
            lock.unlock()
        self._offered = None


def _lock_of(path: Path) -> QLockFile:
    lock = QLockFile(str(path.with_suffix(".lock")))
    # A lock is stale when its process is gone, however old it is.
    lock.setStaleLockTime(0)
    return lock
