"""Settings as files: loading and saving them."""

from pathlib import Path

from PySide6.QtWidgets import QWidget

import pipecore
from pipecore.errors import PipecoreError
from pipecore.notes import Note
from pipecore.settings import Settings
from pipegui.controllers import file_dialogs
from pipegui.controllers.session import Session
from pipegui.i18n.reason_texts import reason_text
from pipegui.i18n.texts import error_text, tr
from pipegui.model import commands


class SettingsFiles:
    """Loads the document's settings from TOML files, and saves them."""

    def __init__(self, session: Session, window: QWidget) -> None:
        self._session, self._window = session, window

    def load(self) -> None:
        """Ask for a settings file and use it."""
        path = file_dialogs.ask_settings(self._window, self._session.stored)
        if path is None:
            return
        try:
            notes: list[Note] = []
            self._session.do(commands.load_settings, Settings.from_toml(path, notes.append))
            for note in notes:
                self._session.show_message(reason_text(note), "warning")
        except PipecoreError as error:
            self._session.show_message(error_text(error), "error")

    def save(self) -> None:
        """Ask for a file, and write the settings to it."""
        settings = self._session.document.settings

        def write(path: Path) -> None:
            with pipecore.io.write_file(path) as temporary:
                temporary.write_text(settings.to_toml(), encoding="utf-8")

        file_dialogs.save_as(
            self._session,
            self._window,
            tr("Save settings"),
            "settings.toml",
            tr("Settings (*.toml)"),
            write,
        )
