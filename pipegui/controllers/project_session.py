"""The project that the window works on: opening, saving, asking before work is lost."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from PySide6.QtCore import QObject, Signal
from PySide6.QtWidgets import QAbstractButton, QMessageBox, QWidget

from pipecore.errors import CancelledError, ReadError
from pipecore.io import is_text
from pipegui.controllers import file_dialogs
from pipegui.controllers.autosave import Snapshot
from pipegui.controllers.session import Session
from pipegui.i18n.texts import error_text, tr
from pipegui.model.document import Document, Scan
from pipegui.model.fingerprint import Fingerprint
from pipegui.project.cloud_reference import CloudState
from pipegui.project.project_file import (
    SUFFIX,
    Camera,
    ProjectError,
    SavedProject,
    read_project,
    work_of,
    write_project,
)
from pipegui.work.job_queue import JobQueue
from pipegui.work.worker import JobProgress

Button = QMessageBox.StandardButton
Role = QMessageBox.ButtonRole
Places = dict[int, Path]
"""Where the clouds are, by the number of their scan in the project."""


class ProjectSession(QObject):
    """Knows where the project is saved and what of it is not.

    Saving has a thread of its own, so that it need not wait for a detection.

    Parameters
    ----------
    session : Session
        Its document is the project.
    window : QWidget
        Questions open over it; it closes once they are answered.
    camera : callable
        Returns where the 3D view looks from.
    """

    title_changed = Signal(str, bool)
    """Name of the project, "" for none, and whether it has unsaved work."""
    saved = Signal()
    recovered = Signal()
    """The copy of an earlier session was opened."""
    camera_read = Signal(object)
    """Where the 3D view looked from when the project was saved."""
    recent_files_changed = Signal()

    def __init__(self, session: Session, window: QWidget, camera: Callable[[], Camera]) -> None:
        super().__init__(session)
        self._session, self._window, self._camera = session, window, camera
        self.path: Path | None = None
        self._saved: tuple[Any, ...] = work_of(Document())
        self._may_lose = False
        self.saving = JobQueue(parent=self)
        self.saving.failed.connect(
            lambda message, details: session.show_message(message, "error", details)
        )

    # What is saved

    @property
    def has_unsaved_work(self) -> bool:
        """Whether something would be lost: a scan that is only looked at would not."""
        document = self._session.document
        if work_of(document) == self._saved:
            return False
        return self.path is not None or any(scan.result for scan in document.scans)

    @property
    def name(self) -> str:
        """What the project is called: its file's name, else that of the scan, else ""."""
        if self.path is not None:
            return self.path.stem
        scan = self._session.document.scan
        return scan.name if scan is not None else ""

    def snapshot(self) -> Snapshot:
        """Return the present state of the work."""
        return Snapshot(self._session.document, self._camera(), self.path)

    def show_title(self) -> None:
        """Bring the window's title up to date."""
        self.title_changed.emit(self.name, self.has_unsaved_work)

    # Saving

    def save(self, then: Callable[[], object] = lambda: None) -> None:
        """Save where the project is; ask where to if it is nowhere yet."""
        if self.path is None:
            self.save_as(then)
        else:
            self._write(self.path, then)

    def save_as(self, then: Callable[[], object] = lambda: None) -> None:
        """Ask where to save, and save there."""
        name = (self.path or Path(self.name or "pipes")).stem + SUFFIX
        path = file_dialogs.ask_target(
            self._window,
            self._session.stored,
            tr("Save project"),
            name,
            tr("Projects (*{suffix})").format(suffix=SUFFIX),
        )
        if path is not None:
            self._write(path, then)

    def _write(self, path: Path, then: Callable[[], object]) -> None:
        document, camera = self._session.document, self._camera()

        def write(progress: JobProgress) -> None:
            write_project(path, document, camera, progress=progress)

        def done(_: None) -> None:
            self.path, self._saved = path, work_of(document)
            self._remember(path)
            self.show_title()
            self._session.show_message(tr("Saved “{path}”.").format(path=path))
            self.saved.emit()
            then()

        self.saving.run(tr("Saving {name}").format(name=path.name), write, done)

    def _remember(self, path: Path) -> None:
        file_dialogs.remember(self._session.stored, path)
        self.recent_files_changed.emit()

    # Asking before work is lost

    def ask_before(self, go_on: Callable[[], object]) -> None:
        """Do something that loses unsaved work, once the user has saved or given it up."""
        if not self.has_unsaved_work:
            go_on()
            return
        box = self._question(
            tr("Save the work on “{name}”?").format(name=self.name),
            tr("What was detected, edited and reviewed since the last save would be lost."),
        )
        box.setStandardButtons(Button.Save | Button.Discard | Button.Cancel)
        box.setDefaultButton(Button.Save)

        def answer(button: QAbstractButton) -> None:
            match box.standardButton(button):
                case Button.Save:
                    self.save(go_on)
                case Button.Discard:
                    go_on()

        box.buttonClicked.connect(answer)
        box.open()

    def may_close(self) -> bool:
        """Whether the window may close now; else the user is asked and it closes later."""
        if self._may_lose or not self.has_unsaved_work:
            return True
        self.ask_before(self._close_without)
        return False

    def _close_without(self) -> None:
        self.discard_changes()
        self._window.close()

    def discard_changes(self) -> None:
        """Let the window close without asking."""
        self._may_lose = True

    def close(self) -> None:
        """End the thread that saves."""
        self.saving.close()

    def _question(self, text: str, more: str) -> QMessageBox:
        box = QMessageBox(self._window)
        box.setObjectName("question")
        box.setIcon(QMessageBox.Icon.Question)
        box.setText(text)
        box.setInformativeText(more)
        return box

    # Opening

    def ask_open(self) -> None:
        """Ask for a project and open it."""
        path = file_dialogs.ask_project(self._window, self._session.stored)
        if path is not None:
            self.open(path)

    def open(self, path: Path) -> None:
        """Open a project in the place of what is open."""
        self._open_after_asking(path, self._show)

    def recover(self, path: Path) -> None:
        """Open the copy that an earlier session left."""
        self._open_after_asking(path, self._show_recovered)

    def _open_after_asking(self, path: Path, show: "Show") -> None:
        def work(progress: JobProgress) -> SavedProject:
            return read_project(path, progress)

        def located(saved: SavedProject, places: Places) -> None:
            self._read_clouds(saved, places, show)

        def read() -> None:
            self._session.jobs.run(
                tr("Opening {name}").format(name=path.name),
                work,
                lambda saved: self._locate(saved, located),
            )

        self.ask_before(lambda: self._ask_to_stop(path, read))

    def _ask_to_stop(self, path: Path, go_on: Callable[[], object]) -> None:
        """Ask before work is stopped whose scans go; nobody should have to wait for it."""
        jobs = self._session.jobs
        if not jobs.is_busy:
            go_on()
            return
        box = self._question(
            tr("Stop “{title}” and open {name}?").format(title=jobs.title, name=path.name),
            tr("The project takes the place of what is open."),
        )
        stop = box.addButton(tr("Stop and open"), Role.AcceptRole)
        box.addButton(Button.Cancel)
        box.setDefaultButton(stop)

        def answer(button: QAbstractButton) -> None:
            if button is stop:
                jobs.cancel()
                go_on()

        box.buttonClicked.connect(answer)
        box.open()

    def _locate(self, saved: SavedProject, located: Callable[[SavedProject, Places], None]) -> None:
        """Have the user find the clouds that are not where they were, one after the other."""
        places: Places = {}
        doubtful = []
        for i, (path, state) in enumerate(saved.located()):
            if state is CloudState.FOUND:
                places[i] = path
            else:
                doubtful.append((i, path, state))

        def next_one() -> None:
            if doubtful:
                self._ask_place(saved, *doubtful.pop(0), places, next_one)
            else:
                located(saved, places)

        next_one()

    def _ask_place(
        self,
        saved: SavedProject,
        number: int,
        path: Path,
        state: CloudState,
        places: Places,
        go_on: Callable[[], object],
    ) -> None:
        name, is_changed = saved.scans[number].name, state is CloudState.CHANGED
        what = tr("has changed since the project was saved") if is_changed else tr("is not there")
        box = self._question(
            tr("The scan “{name}” {what}.").format(name=name, what=what),
            tr("Looked for at {path}").format(path=path),
        )
        locate = box.addButton(tr("Locate…"), Role.AcceptRole)
        use = box.addButton(tr("Use it all the same"), Role.AcceptRole) if is_changed else None
        leave_out = box.addButton(tr("Leave it out"), Role.DestructiveRole)
        box.addButton(Button.Cancel)
        box.setDefaultButton(locate)

        def answer(button: QAbstractButton) -> None:
            if button is locate:
                chosen = file_dialogs.ask_scan(self._window, self._session.stored, name)
                if chosen is None:
                    self._ask_place(saved, number, path, state, places, go_on)
                    return
                places[number] = chosen
            elif use is not None and button is use:
                places[number] = path
            elif button is not leave_out:
                return
            go_on()

        box.buttonClicked.connect(answer)
        box.open()

    def _read_clouds(self, saved: SavedProject, places: Places, show: "Show") -> None:
        read = self._session.jobs.read

        def work(progress: JobProgress) -> tuple[Scan, ...]:
            scans = []
            for number, path in sorted(places.items()):
                scan, fingerprint = saved.scans[number], Fingerprint.if_there(path)
                reading = scan.cloud.how_read(saved.settings)
                try:
                    others = saved.other_files(number, path)
                    cloud = read((path, *others), reading, progress)
                except CancelledError:
                    raise
                except (ReadError, ProjectError) as error:
                    raise ReadError(
                        tr("The project was not opened: {error}").format(error=error_text(error))
                    ) from error
                cloud = replace(cloud, source=path)
                scan_read = scan.with_cloud(cloud, reading, fingerprint, others)
                scans.append(replace(scan_read, is_text=is_text(path)))
            return tuple(scans)

        self._session.jobs.run(
            tr("Reading the scans of {name}").format(name=saved.path.name),
            work,
            lambda scans: show(saved, scans),
        )

    def _show(self, saved: SavedProject, scans: tuple[Scan, ...]) -> None:
        """Show a project that was opened."""
        is_whole = len(scans) == len(saved.scans)
        document = saved.document(scans)
        # What is not as in the file is not saved, and does not take the file's place unasked.
        self.path = saved.path if is_whole else None
        self._replace_document(document, saved.camera, is_saved=is_whole)
        self._remember(saved.path)
        if is_whole:
            self._session.show_message(tr("Opened “{path}”.").format(path=saved.path))
        else:
            self._session.show_message(
                tr("Some scans were left out; “Save” will ask for another file."), "warning"
            )

    def _show_recovered(self, saved: SavedProject, scans: tuple[Scan, ...]) -> None:
        """Show the unsaved work of an earlier session; it belongs to the project it was of."""
        self.path = saved.recovered_from
        self._replace_document(saved.document(scans), saved.camera, is_saved=False)
        self.recovered.emit()
        self._session.show_message(tr("The unsaved work was restored. Save it now."), "warning")

    def _replace_document(self, document: Document, camera: Camera, *, is_saved: bool) -> None:
        self._saved = work_of(document) if is_saved else ()
        self._session.history.reset(document)
        if camera:
            self.camera_read.emit(camera)
        self.show_title()


Show = Callable[[SavedProject, tuple[Scan, ...]], None]
"""Shows a project with its scans, those left out excepted."""
