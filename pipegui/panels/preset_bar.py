"""Choosing settings by name, keeping the present ones under a name, deleting them."""

from PySide6.QtCore import QSignalBlocker, Qt, Signal
from PySide6.QtWidgets import (
    QHBoxLayout,
    QLabel,
    QLineEdit,
    QPushButton,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

from pipecore.errors import PipecoreError
from pipecore.settings import Settings
from pipegui.i18n.texts import error_text, mark, tr
from pipegui.model.presets import Preset, Presets
from pipegui.panels.widgets import QuietComboBox
from pipegui.style import theme

NONE_OF_THEM = mark("Own settings")
TOOL_TIP = Qt.ItemDataRole.ToolTipRole


class PresetBar(QWidget):
    """A choice of presets with buttons to save and delete."""

    chosen = Signal(object)
    """The `Settings` of a preset."""
    failed = Signal(str)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._presets: Presets | None = None
        self._settings = Settings()
        self._listed: list[Preset] = []
        self.choice = QuietComboBox()
        self.choice.setAccessibleName(tr("Preset"))
        self.choice.setSizeAdjustPolicy(
            QuietComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon
        )
        self.choice.setMinimumContentsLength(8)
        self.choice.activated.connect(self.choose)
        self.save_button = _button("content-save-outline", tr("Keep these settings under a name"))
        self.save_button.clicked.connect(self._open)
        self.delete_button = _button("trash-can-outline", tr("Delete this preset of your own"))
        self.delete_button.clicked.connect(self._delete)
        self.name = QLineEdit()
        self.name.setAccessibleName(tr("Name of the preset"))
        self.name.setPlaceholderText(tr("Name"))
        self.name.textChanged.connect(self._check)
        self.name.returnPressed.connect(self._save)
        self.accept = QPushButton(tr("Save"))
        self.accept.clicked.connect(self._save)
        cancel = QPushButton(tr("Cancel"))
        cancel.clicked.connect(self._close)
        self.objection = QLabel(wordWrap=True)
        self.objection.setProperty("muted", True)
        label = QLabel(tr("Preset"))
        label.setBuddy(self.choice)
        top = QHBoxLayout()
        for widget in (label, self.choice, self.save_button, self.delete_button):
            top.addWidget(widget, 1 if widget is self.choice else 0)
        self._editor = QWidget()
        below = QVBoxLayout(self._editor)
        below.setContentsMargins(0, 0, 0, 0)
        row = QHBoxLayout()
        row.addWidget(self.name, 1)
        row.addWidget(self.accept)
        row.addWidget(cancel)
        below.addLayout(row)
        below.addWidget(self.objection)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(theme.SPACING // 2)
        column.addLayout(top)
        column.addWidget(self._editor)
        self._editor.hide()

    def use(self, presets: Presets) -> None:
        """Offer these presets."""
        self._presets = presets
        self._list()

    def apply(self, settings: Settings) -> None:
        """Show which preset gives these settings."""
        if settings != self._settings or not self._listed:
            self._settings = settings
            self._list()

    def _list(self) -> None:
        if self._presets is None:
            return
        self._listed = self._presets.every()
        present = self._presets.matching(self._settings)
        with QSignalBlocker(self.choice):
            self.choice.clear()
            for preset in self._listed:
                self.choice.addItem(preset.shown_name)
                self.choice.setItemData(self.choice.count() - 1, tr(preset.description), TOOL_TIP)
            if present is None:
                self.choice.addItem(tr(NONE_OF_THEM))
            names = [preset.name for preset in self._listed]
            row = len(names) if present is None else names.index(present.name)
            self.choice.setCurrentIndex(row)
        tip = tr("Settings kept by name. Length unit and own stacks stay as they are.")
        described = tr(present.description) if present else ""
        self.choice.setToolTip(f"{described}\n{tip}".strip())
        self.delete_button.setEnabled(present is not None and present.is_own)

    def choose(self, row: int) -> None:
        """Take the preset in a row of the list."""
        if row >= len(self._listed):
            return
        try:
            self.chosen.emit(self._listed[row].load())
        except PipecoreError as error:
            self.failed.emit(error_text(error))
        self._list()

    def _open(self) -> None:
        self._editor.show()
        present = self.choice.currentText()
        own = {preset.name for preset in self._listed if preset.is_own}
        self.name.setText(present if present in own else "")
        self._check()
        self.name.setFocus()

    def _close(self) -> None:
        self._editor.hide()
        self.save_button.setFocus()

    def _check(self) -> None:
        if self._presets is None:
            return
        objection = self._presets.objection(self.name.text())
        self.accept.setEnabled(not objection)
        own = {preset.name for preset in self._listed if preset.is_own}
        self.accept.setText(tr("Replace") if self.name.text().strip() in own else tr("Save"))
        self.objection.setText(objection)

    def _save(self) -> None:
        if self._presets is None or not self.accept.isEnabled():
            return
        try:
            self._presets.save(self.name.text(), self._settings)
        except (PipecoreError, OSError) as error:
            self.failed.emit(error_text(error))
            return
        self._close()
        self._list()

    def _delete(self) -> None:
        preset = self._listed[self.choice.currentIndex()]
        assert self._presets is not None
        try:
            self._presets.delete(preset)
        except OSError as error:
            self.failed.emit(
                tr("“{name}” was not deleted: {error}").format(
                    name=preset.name, error=error_text(error)
                )
            )
        self._list()


def _button(icon: str, tip: str) -> QToolButton:
    button = QToolButton()
    theme.set_icon(button, icon)
    button.setAutoRaise(True)
    button.setToolTip(tip)
    button.setAccessibleName(tip)
    return button
