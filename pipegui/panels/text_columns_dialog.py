"""The dialog in which a person says what the columns of a text file hold."""

from collections.abc import Mapping
from dataclasses import replace

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QIcon
from PySide6.QtWidgets import (
    QComboBox,
    QDialog,
    QDialogButtonBox,
    QFormLayout,
    QHBoxLayout,
    QLabel,
    QPushButton,
    QSpinBox,
    QVBoxLayout,
    QWidget,
)

from pipecore.io import DecimalSign, Separator, TextFormat, TextPreview
from pipegui.i18n.texts import error_text, inside, tr
from pipegui.panels.points_sketch import PointsSketch
from pipegui.panels.role_table import RoleChip, RoleTable
from pipegui.panels.widgets import Applying, QuietComboBox
from pipegui.states.text_roles import DECIMAL_SIGNS, ROLES, SEPARATORS, SKIP, outcome
from pipegui.style import theme

Button = QDialogButtonBox.StandardButton
Texts = Mapping[Separator, str] | Mapping[DecimalSign, str]
MOST_SKIPPED = 999_999


class TextColumnsDialog(QDialog):
    """Shows how a text file is read, and takes how else it is to be read.

    Parameters
    ----------
    name : str
        Of the file.
    text_format : TextFormat
        What is said of it already.
    parent : QWidget, optional
        It opens over this one.
    """

    changed = Signal(object)
    """The `TextFormat` that was chosen: a new preview is wanted."""
    chosen = Signal(object)
    """The `TextFormat` to read the file with."""

    def __init__(self, name: str, text_format: TextFormat, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("textColumns")
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self.setWindowTitle(tr("Columns of {name}").format(name=name))
        self.resize(110 * theme.SPACING, 80 * theme.SPACING)
        self._applying = Applying()
        self.format = text_format
        self._columns: tuple[str, ...] = ()
        self.table = RoleTable()
        self.table.role_chosen.connect(self._choose_role)
        self.separator = self._choice(tr("Separator"), SEPARATORS)
        self.decimal = self._choice(tr("Decimal sign"), DECIMAL_SIGNS)
        self.skip = QSpinBox()
        self.skip.setRange(0, MOST_SKIPPED)
        self.skip.setAccessibleName(tr("Lines to skip"))
        self.skip.setValue(text_format.skip)
        self.skip.valueChanged.connect(lambda n: self._change(replace(self.format, skip=n)))
        self.guess = QPushButton(tr("Guess again"))
        self.guess.setToolTip(tr("Back to what the file itself suggests"))
        self.guess.clicked.connect(self._guess_again)
        self.sketch = PointsSketch()
        self._icon, self.said = QLabel(), QLabel()
        self.said.setWordWrap(True)
        self._facts = QFormLayout()
        self.buttons = QDialogButtonBox(Button.Open | Button.Cancel)
        for button in self.buttons.buttons():
            button.setIcon(QIcon())
        self.buttons.accepted.connect(self._accept)
        self.buttons.rejected.connect(self.reject)
        self._arrange()

    def _choice(self, name: str, texts: Texts) -> QComboBox:
        choice = QuietComboBox()
        choice.setAccessibleName(name)
        for value, text in texts.items():
            choice.addItem(tr(text), str(value))
        choice.currentIndexChanged.connect(lambda _: self._change_separation())
        return choice

    def _arrange(self) -> None:
        hint = QLabel(tr("Say what each column holds: in its head, or drag a name onto it."))
        hint.setProperty("muted", True)
        chips = QHBoxLayout()
        chips.setSpacing(theme.SPACING // 2)
        for role in ROLES:
            chips.addWidget(RoleChip(role))
        chips.addStretch()
        options = QHBoxLayout()
        options.setSpacing(theme.SPACING)
        for text, field in (
            (tr("Separator"), self.separator),
            (tr("Decimal sign"), self.decimal),
            (tr("Lines to skip"), self.skip),
        ):
            label = QLabel(text)
            label.setBuddy(field)
            options.addWidget(label)
            options.addWidget(field)
            options.addSpacing(theme.SPACING)
        options.addStretch()
        options.addWidget(self.guess)
        sentence = QHBoxLayout()
        sentence.addWidget(self._icon, 0, Qt.AlignmentFlag.AlignTop)
        sentence.addWidget(self.said, 1)
        self._facts.setVerticalSpacing(theme.SPACING // 2)
        self._facts.setHorizontalSpacing(2 * theme.SPACING)
        words = QVBoxLayout()
        words.addLayout(sentence)
        words.addLayout(self._facts)
        words.addStretch()
        result = QHBoxLayout()
        result.setSpacing(2 * theme.SPACING)
        result.addWidget(self.sketch, 0, Qt.AlignmentFlag.AlignTop)
        result.addLayout(words, 1)
        column = QVBoxLayout(self)
        column.setContentsMargins(*[2 * theme.SPACING] * 4)
        column.setSpacing(theme.SPACING)
        column.addWidget(hint)
        column.addLayout(chips)
        column.addWidget(self.table, 1)
        column.addLayout(options)
        column.addSpacing(theme.SPACING)
        column.addLayout(result)
        column.addWidget(self.buttons)

    # What it is given to show

    def show_preview(self, preview: TextPreview) -> None:
        """Show what comes of the format that was chosen last."""
        self._columns = preview.columns
        self.table.apply(preview)
        with self._applying:
            self._show_choice(self.separator, self.format.separator, SEPARATORS, preview.separator)
            self._show_choice(self.decimal, self.format.decimal, DECIMAL_SIGNS, preview.decimal)
            self.skip.setValue(self.format.skip)
        self.sketch.apply(preview.points)
        is_read = preview.error is None
        self.buttons.button(Button.Open).setEnabled(is_read)
        icon, tint = ("check-circle-outline", "accent") if is_read else ("alert", "#e69f00")
        self._icon.setPixmap(theme.icon(icon, tint).pixmap(theme.icon_size()))
        text = tr("This is what is read:") if preview.error is None else error_text(preview.error)
        self.said.setText(text)
        while self._facts.rowCount():
            self._facts.removeRow(0)
        for label, fact in outcome(preview):
            name = QLabel(label)
            name.setProperty("muted", True)
            value = QLabel(fact)
            value.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
            self._facts.addRow(name, value)

    def _show_choice(
        self,
        choice: QComboBox,
        chosen: Separator | DecimalSign,
        texts: Texts,
        found: Separator | DecimalSign,
    ) -> None:
        """Show what is chosen; beside “automatic” what was found."""
        names = {str(value): tr(text) for value, text in texts.items()}
        choice.setItemText(0, f"{names['auto']} ({inside(names[str(found)])})")
        choice.setCurrentIndex(choice.findData(str(chosen)))

    # What the user does

    def _choose_role(self, column: int, role: str) -> None:
        """Give a column a role; another one that had it is skipped from now on."""
        columns = [name if name in ROLES else SKIP for name in self._columns]
        if role != SKIP:
            columns = [SKIP if name == role else name for name in columns]
        columns[column] = role
        self._change(replace(self.format, columns=tuple(columns)))

    def _change_separation(self) -> None:
        # Other columns come of it, of which nothing is known yet.
        if not self._applying:
            separator = Separator(str(self.separator.currentData()))
            decimal = DecimalSign(str(self.decimal.currentData()))
            self._change(TextFormat((), separator, decimal, self.format.skip))

    def _guess_again(self) -> None:
        self._change(TextFormat())

    def _change(self, text_format: TextFormat) -> None:
        if not self._applying and text_format != self.format:
            self.format = text_format
            self.changed.emit(text_format)

    def _accept(self) -> None:
        # What is shown is what is read, whoever chose it.
        columns = tuple(name if name in ROLES else SKIP for name in self._columns)
        self.chosen.emit(replace(self.format, columns=columns))
        self.accept()
