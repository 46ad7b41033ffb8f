"""Scans and detections: opening files, detecting, and what comes of both."""

from pathlib import Path

from PySide6.QtCore import QObject, Signal
from PySide6.QtWidgets import QWidget

from pipecore.resources import resource
from pipecore.types import PointCloud, Result
from pipegui.controllers import file_dialogs
from pipegui.controllers.session import Session
from pipegui.i18n.reason_texts import reason_text
from pipegui.i18n.texts import tr
from pipegui.model import commands
from pipegui.model.document import Scan
from pipegui.project.project_file import SUFFIX
from pipegui.states import descriptions


class Scans(QObject):
    """Reads scans and detects in the background, and takes what was read and detected."""

    project_chosen = Signal(object)
    """Path of a project among the files to open."""
    recent_files_changed = Signal()

    def __init__(self, session: Session, window: QWidget) -> None:
        super().__init__(session)
        self._session, self._window = session, window

    # Opening

    def ask_open(self) -> None:
        """Ask for scans and open them."""
        self.open_files(file_dialogs.ask_scans(self._window, self._session.stored))

    def open_demo(self) -> None:
        """Open the scan that comes with the program."""
        self.open_files([resource("demo", "demo.laz")])

    def open_files(self, paths: list[Path]) -> None:
        """Read scans in the background; of projects only the first is opened."""
        projects = [path for path in paths if path.suffix == SUFFIX]
        if projects:
            self.project_chosen.emit(projects[0])
        scans = [path for path in paths if path not in projects]
        self._session.jobs.open_files(scans, self._session.document.settings)

    def on_scan_read(self, scan: Scan) -> None:
        """Add a scan that was read; what was left out or guessed of it is said."""
        self._session.hide_message()
        self._session.do(commands.open_scan, scan)
        if scan.cloud.notes:
            notes = " ".join(reason_text(note) for note in scan.cloud.notes)
            self._session.show_message(f"{scan.name}: {notes}", "warning")
        if scan.cloud.source is not None:
            file_dialogs.remember(self._session.stored, scan.cloud.source)
            self.recent_files_changed.emit()

    def close_active(self) -> None:
        """Close the active scan."""
        self._session.do(commands.close_scan, self._session.document.active)

    # Detecting

    def detect(self) -> None:
        """Detect on the active scan in the background."""
        # A number still being typed counts: it becomes a setting when its field is left.
        if (field := self._window.focusWidget()) is not None:
            field.clearFocus()
        document = self._session.document
        if document.scan is not None:
            self._session.jobs.detect(document.scan.cloud, document.settings)

    def on_detected(self, cloud: PointCloud, result: Result) -> None:
        """Take the result of a detection, and sum it up in a message."""
        session = self._session
        session.do(commands.set_result, cloud, result)
        hint = "" if result.elements else tr(". Check the length unit and the smallest radius")
        seconds = sum(result.seconds.values())
        took = tr(" Detected in {seconds:.0f} s.").format(seconds=seconds) if seconds >= 1 else ""
        severity = "info" if result.elements else "warning"
        # Another scan may be looked at meanwhile.
        active = session.document.scan
        scan = next((s for s in session.document.scans if s.cloud is cloud), None)
        whose = f"{scan.name}: " if scan is not None and scan is not active else ""
        session.show_message(f"{whose}{descriptions.summary(result)}{hint}.{took}", severity)
