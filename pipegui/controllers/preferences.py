"""Appearance and language: chosen by the user, kept from one start to the next."""

from PySide6.QtCore import QObject, Signal
from PySide6.QtWidgets import QApplication

from pipegui.controllers.session import Session
from pipegui.i18n.texts import LANGUAGES, tr
from pipegui.style import theme


class Preferences(QObject):
    """Stores what was chosen, and puts the appearance to use."""

    colours_changed = Signal()
    """Everything has to be drawn anew in the theme's colours."""
    checked = Signal(str, bool)
    """Name of an action, and whether it is what was chosen."""

    def __init__(self, session: Session) -> None:
        super().__init__(session)
        self._session = session
        QApplication.styleHints().colorSchemeChanged.connect(self.apply_theme)

    def choose_appearance(self, appearance: theme.Appearance) -> None:
        """Use light or dark colours, now and at the next start."""
        self._session.stored.setValue("appearance", appearance.name)
        self.restore_appearance()

    def restore_appearance(self) -> None:
        """Use the colours chosen last."""
        name = str(self._session.stored.value("appearance", ""))
        chosen = theme.Appearance.__members__.get(name, theme.Appearance.SYSTEM)
        was_dark = theme.is_dark()
        theme.choose(chosen)
        if theme.is_dark() != was_dark:
            self.apply_theme()
        for appearance in theme.Appearance:
            self.checked.emit(f"appearance_{appearance.name.lower()}", appearance is chosen)

    def apply_theme(self) -> None:
        """Give the application the theme's colours."""
        app = QApplication.instance()
        if isinstance(app, QApplication):
            theme.apply_theme(app)
        self.colours_changed.emit()

    def choose_language(self, code: str) -> None:
        """Use another language from the next start on; "" is the system's."""
        self._session.stored.setValue("language", code)
        self.show_language()
        self._session.show_message(tr("The language changes at the next start."))

    def show_language(self) -> None:
        """Check the language chosen last."""
        chosen = str(self._session.stored.value("language", ""))
        for code in LANGUAGES:
            self.checked.emit(f"language_{code or 'system'}", code == chosen)

    def close(self) -> None:
        """Take no more notice of the system's colours."""
        QApplication.styleHints().colorSchemeChanged.disconnect(self.apply_theme)
