"""The project that the window works on: opening, saving, asking before work is lost."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from PySide6.QtCore import QObject
from PySide6.QtWidgets import QMessageBox

from pipecore.errors import CancelledError, ReadError
from pipegui.controllers import file_dialogs
from pipegui.controllers.autosave import Rescue
from pipegui.i18n.texts import error_text, tr
from pipegui.model.document import Document, Scan
from pipegui.model.fingerprint import Fingerprint
from pipegui.project.cloud_reference import CloudState
from pipegui.project.project_file import SUFFIX, SavedProject, read_project, work_of, write_project
from pipegui.work.job_queue import Jobs
from pipegui.work.worker import JobProgress

if TYPE_CHECKING:
    from pipegui.window.main_window import MainWindow

Button = QMessageBox.StandardButton
Role = QMessageBox.ButtonRole
Places = dict[int, Path]
"""Where the clouds are, by the number of their scan in the project."""


class Projects(QObject):
    """Knows where the project is saved and what of it is not.

    Saving has a thread of its own, so that it need not wait for a detection.
    """

    def __init__(self, window: "MainWindow", rescue_folder: Path | None) -> None:
        super().__init__(window)
        self._window = window
        self.path: Path | None = None
        self._saved: tuple[Any, ...] = work_of(Document())
        self._may_lose = False
        self.saving = Jobs(parent=self)
        self.saving.failed.connect(
            lambda message, details: window.panels.message.tell(message, "error", details)
        )
        self.rescue = Rescue(self, rescue_folder) if rescue_folder is not None else None

    # What is saved

    @property
    def document(self) -> Document:
        """What the window works on."""
        return self._window.document

    @property
    def has_unsaved_work(self) -> bool:
        """Whether something would be lost: a scan that is only looked at would not."""
        document = self.document
        if work_of(document) == self._saved:
            return False
        return self.path is not None or any(scan.result for scan in document.scans)

    def show_title(self) -> None:
        """Say in the window's title what is worked on, and whether it is saved."""
        scan = self.document.scan
        name = self.path.stem if self.path is not None else scan.name if scan is not None else ""
        self._window.setWindowTitle(f"{name}[*] – PipeGUI" if name else "PipeGUI")
        self._window.setWindowModified(bool(name) and self.has_unsaved_work)

    def camera(self) -> dict[str, list[float]]:
        """Where the 3D view looks from."""
        camera: dict[str, list[float]] = self._window.parts.scene.camera()
        return camera

    def tell(self, *args: Any, **kwargs: Any) -> None:
        """Say something above the 3D view."""
        self._window.panels.message.tell(*args, **kwargs)

    # Saving

    def save(self, then: Callable[[], object] = lambda: None) -> None:
        """Save where the project is; ask where to if it is nowhere yet."""
        if self.path is None:
            self.save_as(then)
        else:
            self._write(self.path, then)

    def save_as(self, then: Callable[[], object] = lambda: None) -> None:
        """Ask where to save, and save there."""
        window, scan = self._window, self.document.scan
        name = (self.path or Path(scan.name if scan is not None else "pipes")).stem + SUFFIX
        path = file_dialogs.ask_target(
            window,
            window.stored,
            tr("Save project"),
            name,
            tr("Projects (*{suffix})").format(suffix=SUFFIX),
        )
        if path is not None:
            self._write(path, then)

    def _write(self, path: Path, then: Callable[[], object]) -> None:
        document, camera = self.document, self.camera()

        def write(progress: JobProgress) -> None:
            write_project(path, document, camera, progress=progress)

        def done(_: None) -> None:
            self.path, self._saved = path, work_of(document)
            self._remember(path)
            self.show_title()
            self._window.panels.message.tell(tr("Saved “{path}”.").format(path=path))
            if self.rescue is not None and not self.has_unsaved_work:
                self.rescue.forget()
            then()

        self.saving.run(tr("Saving {name}").format(name=path.name), write, done)

    def _remember(self, path: Path) -> None:
        file_dialogs.remember(self._window.stored, path)
        self._window.menu_actions.list_recent()

    # Asking before work is lost

    def ask_before(self, go_on: Callable[[], object]) -> None:
        """Do something that loses unsaved work, once the user has saved or given it up."""
        if not self.has_unsaved_work:
            go_on()
            return
        scan = self.document.scan
        name = self.path.stem if self.path is not None else scan.name if scan is not None else ""
        box = self._question(
            tr("Save the work on “{name}”?").format(name=name),
            tr("What was detected, edited and reviewed since the last save would be lost."),
        )
        box.setStandardButtons(Button.Save | Button.Discard | Button.Cancel)
        box.setDefaultButton(Button.Save)

        def answer(button: Any) -> None:
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
        self.discard()
        self._window.close()

    def discard(self) -> None:
        """Let the window close without asking."""
        self._may_lose = True

    def close(self) -> None:
        """End the thread; what was autosaved is not needed after a proper end."""
        self.saving.close()
        if self.rescue is not None:
            self.rescue.close()

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
        path = file_dialogs.ask_project(self._window, self._window.stored)
        if path is not None:
            self.open(path)

    def open(self, path: Path) -> None:
        """Open a project in the place of what is open."""
        self.ask_before(lambda: self._ask_to_stop(path, lambda: self._open(path)))

    def _ask_to_stop(self, path: Path, go_on: Callable[[], object]) -> None:
        """Ask before work is stopped whose scans go; nobody should have to wait for it."""
        jobs = self._window.jobs
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

        def answer(button: Any) -> None:
            if button is stop:
                jobs.cancel()
                go_on()

        box.buttonClicked.connect(answer)
        box.open()

    def _open(self, path: Path) -> None:
        def work(progress: JobProgress) -> SavedProject:
            return read_project(path, progress)

        self._window.jobs.run(tr("Opening {name}").format(name=path.name), work, self._locate)

    def _locate(self, saved: SavedProject) -> None:
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
                self._read_clouds(saved, places)

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

        def answer(button: Any) -> None:
            if button is locate:
                chosen = file_dialogs.ask_scan(self._window, self._window.stored, name)
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

    def _read_clouds(self, saved: SavedProject, places: Places) -> None:
        read = self._window.jobs.read

        def work(progress: JobProgress) -> tuple[Scan, ...]:
            scans = []
            for number, path in sorted(places.items()):
                scan, fingerprint = saved.scans[number], Fingerprint.if_there(path)
                unit = {"input.length_unit": scan.cloud.length_unit}
                try:
                    cloud = read(path, saved.settings.replace(unit), progress)
                except CancelledError:
                    raise
                except ReadError as error:
                    raise ReadError(
                        tr("The project was not opened: {error}").format(error=error_text(error))
                    ) from error
                scans.append(scan.with_cloud(replace(cloud, source=path), fingerprint))
            return tuple(scans)

        self._window.jobs.run(
            tr("Reading the scans of {name}").format(name=saved.path.name),
            work,
            lambda scans: self._show(saved, scans),
        )

    def _show(self, saved: SavedProject, scans: tuple[Scan, ...]) -> None:
        window = self._window
        is_whole, is_rescued = len(scans) == len(saved.scans), self._is_rescued(saved)
        document = saved.document(scans)
        # What is not as in the file is not saved, and does not take the file's place unasked.
        self.path = saved.path if is_whole else None
        if is_rescued:
            self.path = saved.rescued_from
        self._saved = work_of(document) if is_whole and not is_rescued else ()
        window.history.reset(document)
        if saved.camera:
            window.parts.scene.set_camera(saved.camera)
        window.menu_actions.list_history()
        self.show_title()
        if is_rescued and self.rescue is not None:
            self.rescue.take_over()
            self.tell(tr("The unsaved work was restored. Save it now."), "warning")
            return
        self._remember(saved.path)
        if is_whole:
            window.panels.message.tell(tr("Opened “{path}”.").format(path=saved.path))
        else:
            window.panels.message.tell(
                tr("Some scans were left out; “Save” will ask for another file."), "warning"
            )

    def _is_rescued(self, saved: SavedProject) -> bool:
        return self.rescue is not None and self.rescue.is_restoring(saved.path)
