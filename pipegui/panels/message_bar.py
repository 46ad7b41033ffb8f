"""A line above the 3D view that says what happened, without being in the way."""

from collections.abc import Callable, Mapping
from types import MappingProxyType

from PySide6.QtCore import Qt
from PySide6.QtGui import QGuiApplication
from PySide6.QtWidgets import (
    QDialog,
    QDialogButtonBox,
    QFrame,
    QHBoxLayout,
    QLabel,
    QPlainTextEdit,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

from pipegui.i18n.texts import tr
from pipegui.style import theme

_ICONS = {
    "info": ("check-circle-outline", "accent"),
    "warning": ("alert", "#e69f00"),
    "error": ("alert-circle-outline", "#d55e00"),
}


class MessageBar(QFrame):
    """Shows one message at a time; an error's details can be looked at and copied."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("message")
        self._details = ""
        self._icon = QLabel()
        self.text = QLabel()
        self.text.setWordWrap(True)
        self.text.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self.details_button = QToolButton()
        self.details_button.setText(tr("Details…"))
        self.details_button.clicked.connect(self._show_details)
        self.close_button = QToolButton()
        self.close_button.setAccessibleName(tr("Close the message"))
        self.close_button.setToolTip(tr("Close the message"))
        self.close_button.clicked.connect(self.hide)
        self.answer_buttons: list[QToolButton] = []
        row = self._row = QHBoxLayout(self)
        row.setContentsMargins(12, theme.SPACING // 2, theme.SPACING // 2, theme.SPACING // 2)
        row.setSpacing(theme.SPACING)
        row.addWidget(self._icon)
        row.addWidget(self.text, 1)
        row.addWidget(self.details_button)
        row.addWidget(self.close_button)
        self.hide()

    def tell(
        self,
        text: str,
        severity: str = "info",
        details: str = "",
        answers: Mapping[str, Callable[[], object]] = MappingProxyType({}),
    ) -> None:
        """Show a message; `severity` is "info", "warning" or "error".

        `answers` are buttons with what they do; the message goes with the first of them.
        """
        self._details = details
        self._offer(answers)
        self.text.setText(text)
        icon, tint = _ICONS[severity]
        self._icon.setPixmap(theme.icon(icon, tint).pixmap(theme.icon_size()))
        theme.set_icon(self.close_button, "close", "muted")
        self.details_button.setVisible(bool(details))
        self.setProperty("severity", severity)
        self.style().unpolish(self)
        self.style().polish(self)
        self.show()

    def _offer(self, answers: Mapping[str, Callable[[], object]]) -> None:
        for button in self.answer_buttons:
            self._row.removeWidget(button)
            button.hide()
            button.deleteLater()
        self.answer_buttons = []
        for text, act in answers.items():
            button = QToolButton()
            button.setText(text)
            button.setProperty("answer", True)
            button.clicked.connect(self.hide)
            button.clicked.connect(lambda _=False, act=act: act())
            self._row.insertWidget(self._row.count() - 1, button)
            self.answer_buttons.append(button)

    def _show_details(self) -> None:
        dialog = QDialog(self.window())
        dialog.setObjectName("details")
        dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        dialog.setWindowTitle(tr("Details"))
        dialog.resize(80 * theme.SPACING, 48 * theme.SPACING)
        message = QLabel(self.text.text())
        message.setWordWrap(True)
        details = QPlainTextEdit(self._details)
        details.setReadOnly(True)
        details.setLineWrapMode(QPlainTextEdit.LineWrapMode.NoWrap)
        buttons = QDialogButtonBox(QDialogButtonBox.StandardButton.Close)
        copy = buttons.addButton(tr("Copy"), QDialogButtonBox.ButtonRole.ActionRole)
        whole = f"{self.text.text()}\n\n{self._details}"
        copy.clicked.connect(lambda: QGuiApplication.clipboard().setText(whole))
        buttons.rejected.connect(dialog.close)
        column = QVBoxLayout(dialog)
        for widget in (message, details, buttons):
            column.addWidget(widget)
        dialog.show()
