"""Scans and detections: opening files, detecting, and what comes of both."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from PySide6.QtCore import QObject, Signal
from PySide6.QtWidgets import QWidget

from pipecore.io.left_out import NO_RETURN, left_out_notes
from pipecore.resources import resource
from pipecore.settings import InputSettings
from pipecore.types import PointCloud, Result
from pipegui.controllers import file_dialogs
from pipegui.controllers.rereading import Rereading
from pipegui.controllers.session import Session
from pipegui.controllers.text_columns import TextColumns
from pipegui.i18n.reason_texts import reason_text
from pipegui.i18n.texts import count, tr
from pipegui.model import commands
from pipegui.model.document import Scan
from pipegui.project.project_file import SUFFIX
from pipegui.states import descriptions
from pipegui.states.text_roles import columns_text
from pipegui.states.unit_texts import doubts_unit, other_units, units_in_doubt

HARMLESS = {note.template for note in left_out_notes("", {NO_RETURN: 1})}
"""Notes on what is as it should be."""


MOST_LINES = 3
"""Of a message about what was read; all are among the properties of the scan."""


class Scans(QObject):
    """Reads scans and detects in the background, and takes what was read and detected."""

    project_chosen = Signal(object)
    """Path of a project among the files to open."""
    recent_files_changed = Signal()

    def __init__(
        self, session: Session, window: QWidget, rereading: Rereading, columns: TextColumns
    ) -> None:
        super().__init__(session)
        self._session, self._window, self._rereading = session, window, rereading
        self._columns = columns
        self._together: list[Scan] = []
        """Scans that were opened together."""
        self._failed: list[str] = []
        """Why some of them could not be read."""

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
        self.read(scans, self._session.document.settings.input)

    def read(self, paths: Sequence[Path], reading: InputSettings) -> None:
        """Read scans in the background, with other settings than those of the document."""
        self._together, self._failed = [], []
        self._session.jobs.open_files(paths, reading)

    def on_read_failed(self, paths: Sequence[Path], message: str, details: str) -> None:
        """Say why files could not be read; what is read after them does not hide it."""
        self._failed.append(message)
        self._columns.on_read_failed(paths, "\n".join(self._failed), details)

    def on_scan_read(self, scan: Scan) -> None:
        """Add a scan that was read; what was left out or guessed of it is said."""
        self._session.do(commands.open_scan, scan)
        self._together.append(scan)
        self._tell(self._together)
        if scan.cloud.source is not None:
            file_dialogs.remember(self._session.stored, scan.cloud.source)
            self.recent_files_changed.emit()

    def on_scan_read_again(self, clouds: Sequence[PointCloud], scan: Scan) -> None:
        """Put a scan in the place of those that it was read from anew."""
        self._together, self._failed = [], []
        gone = {id(cloud) for cloud in clouds}
        had_results = any(s.result for s in self._session.document.scans if id(s.cloud) in gone)
        self._rereading.on_read_again(clouds, scan)
        self._tell([scan], tr("Undo brings back what was detected.") if had_results else "")

    def _tell(self, scans: Sequence[Scan], more: str = "") -> None:
        """Say what was left out or guessed of scans, with what can be done about it.

        `more` is said besides.
        """
        self._session.hide_message()
        notes = [note for scan in scans for note in scan.cloud.notes]
        if len(scans) > 1:
            notes = [note for note in notes if note.template not in HARMLESS]
        notes.sort(key=lambda note: not doubts_unit(note))
        lines = [*map(reason_text, notes), *([more] if more else [])]
        answers: dict[str, Callable[[], object]] = {}
        if len(scans) > 1:
            lines.insert(0, tr("{n} scans were opened.").format(n=len(scans)))
            opened = tuple(scans)
            answers[tr("Join to one cloud")] = lambda: self._rereading.join(opened)
        else:
            [scan] = scans
            answers |= self._rereading.offers(scan, units_in_doubt(scan, notes))
        guessed = [scan for scan in scans if scan.guessed_columns]
        if guessed:
            guess = columns_text(guessed[0].guessed_columns)
            lines.append(tr("Columns guessed: {columns}.").format(columns=guess))
            alike = [s for s in guessed if s.guessed_columns == guessed[0].guessed_columns]
            answers[tr("Change columns…")] = lambda: self._columns.change(alike)
        lines[:0] = self._failed
        is_warning = any(note.template not in HARMLESS for note in notes)
        if lines:
            severity = "error" if self._failed else "warning" if is_warning else "info"
            text = "\n".join(lines)
            if (n_more := len(lines) - MOST_LINES) > 0:
                more = count("One more note: Details", "{n} more notes: Details", n_more)
                short = "\n".join([*lines[:MOST_LINES], more])
                self._session.show_message(short, severity, text, answers)
            else:
                self._session.show_message(text, severity, answers=answers)

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
            self._session.jobs.detect(document.scan.cloud, document.detection_settings)

    def on_detected(self, cloud: PointCloud, result: Result) -> None:
        """Take the result of a detection, and sum it up in a message."""
        session = self._session
        session.do(commands.set_result, cloud, result)
        n_candidates = len(result.candidates) + result.n_more_candidates
        candidates = tr(", {n} not accepted").format(n=n_candidates) if n_candidates else ""
        seconds = sum(result.seconds.values())
        took = tr(" Detected in {seconds:.0f} s.").format(seconds=seconds) if seconds >= 1 else ""
        severity = "info" if result.elements else "warning"
        # Another scan may be looked at meanwhile.
        active = session.document.scan
        scan = next((s for s in session.document.scans if s.cloud is cloud), None)
        whose = f"{scan.name}: " if scan is not None and scan is not active else ""
        text = f"{whose}{descriptions.summary(result)}{candidates}.{took}"
        answers: Mapping[str, Callable[[], object]] = {}
        # The notes on the cloud were said when it was read.
        if notes := [note for note in result.notes if note not in cloud.notes]:
            text, severity = "\n".join([text, *map(reason_text, notes)]), "warning"
        if scan is not None:
            units = units_in_doubt(scan, notes) if result.elements else other_units(scan)
            answers = self._rereading.offers(scan, units)
        session.show_message(text, severity, answers=answers)
