"""Reading text files whose columns a person names."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from PySide6.QtCore import QObject, Signal
from PySide6.QtWidgets import QWidget

from pipecore.errors import ReadError
from pipecore.io import TextFormat, is_text, preview_text
from pipegui.controllers import file_dialogs
from pipegui.controllers.rereading import Rereading
from pipegui.controllers.session import Session
from pipegui.i18n.texts import error_text, tr
from pipegui.model.document import Scan
from pipegui.panels.text_columns_dialog import TextColumnsDialog


class TextColumns(QObject):
    """Asks what the columns of text files hold, and reads the files so."""

    chosen = Signal(object, object)
    """Paths of files to open, and the settings to read them with."""

    def __init__(self, session: Session, window: QWidget, rereading: Rereading) -> None:
        super().__init__(session)
        self._session, self._window, self._rereading = session, window, rereading

    def ask_open(self) -> None:
        """Ask for text files, then for their columns, and open them."""
        paths = file_dialogs.ask_text(self._window, self._session.stored)
        if paths:
            self.open(paths)

    def open(self, paths: Sequence[Path]) -> None:
        """Ask for the columns of files that have the same ones, and open them."""
        reading = self._session.document.settings.input

        def read(text_format: TextFormat) -> None:
            self.chosen.emit(paths, replace(reading, columns=str(text_format)))

        self._ask(paths[0], reading.columns, read)

    def change_active(self) -> None:
        """Ask for the columns of the active scan's file, and read it anew."""
        if (scan := self._session.document.scan) is not None and scan.files:
            self.change([scan])

    def change(self, scans: Sequence[Scan]) -> None:
        """Ask for the columns of scans whose files have the same ones, and read them anew."""

        def read(text_format: TextFormat) -> None:
            for scan in scans:
                self._rereading.with_columns(scan, str(text_format))

        self._ask(scans[0].files[0], scans[0].reading.columns, read)

    def on_read_failed(self, paths: Sequence[Path], message: str, details: str) -> None:
        """Say why files could not be read; of text its columns can be named."""
        answers = {}
        if is_text(paths[0]):
            answers[tr("Choose columns…")] = lambda: self.open(paths)
        self._session.show_message(message, "error", details, answers)

    def _ask(self, path: Path, said: str, read: Callable[[TextFormat], None]) -> None:
        try:
            text_format = TextFormat.parse(said)
            preview = preview_text(path, text_format)
        except ReadError as error:
            self._session.show_message(error_text(error), "error")
            return
        dialog = TextColumnsDialog(path.name, text_format, self._window)
        dialog.changed.connect(lambda chosen: dialog.show_preview(preview_text(path, chosen)))
        dialog.chosen.connect(read)
        dialog.show_preview(preview)
        dialog.open()
