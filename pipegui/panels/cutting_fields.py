"""How profiles are cut and joined: width, gap and method, in the stacks panel."""

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QGridLayout, QLabel, QWidget

from pipecore.settings import ProfileMethod
from pipegui.i18n.texts import first_capital, tr
from pipegui.panels.widgets import Applying, QuietComboBox, QuietSpinBox
from pipegui.states.view_state import StacksState
from pipegui.style import theme


class CuttingFields(QWidget):
    """Three settings that one changes while looking at a profile."""

    changed = Signal(str, object)
    """Dotted key and new value."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._applying = Applying()
        self.width_mm = self._length(tr("Profile width"), "stacks.width_mm")
        self.width_mm.setToolTip(tr("Thickness of a profile; 0 follows the spacing of the points"))
        self.gap_mm = self._length(tr("Largest gap"), "profiles.gap_mm")
        self.gap_mm.setToolTip(
            tr(
                "Points of one curve are at most this far apart; 0 follows the spacing of "
                "the points"
            )
        )
        self.method = QuietComboBox()
        self.method.setAccessibleName(tr("Method"))
        self.method.setToolTip(
            tr("Proximity alone, or proximity and splitting where the curvature changes sharply")
        )
        for method in ProfileMethod:
            self.method.addItem(first_capital(tr(method)), method)
        self.method.currentIndexChanged.connect(
            lambda _: self._tell("profiles.method", ProfileMethod(self.method.currentData()))
        )
        grid = QGridLayout(self)
        grid.setContentsMargins(theme.SPACING, 0, theme.SPACING, 0)
        grid.setSpacing(theme.SPACING // 2)
        for place, (text, field, span) in enumerate(
            (
                (tr("Width"), self.width_mm, 1),
                (tr("Gap"), self.gap_mm, 1),
                (tr("Method"), self.method, 3),
            )
        ):
            label = QLabel(text)
            label.setBuddy(field)
            row, column = divmod(place, 2)
            grid.addWidget(label, row, 2 * column)
            grid.addWidget(field, row, 2 * column + 1, 1, span)
        for column in (1, 3):
            grid.setColumnStretch(column, 1)

    def _length(self, name: str, key: str) -> QuietSpinBox:
        field = QuietSpinBox()
        field.setAccessibleName(name)
        field.setRange(0, 1000)
        field.setSuffix(" mm")
        field.setSpecialValueText(tr("automatic"))
        field.setMinimumWidth(8 * theme.SPACING)
        field.valueChanged.connect(lambda value: self._tell(key, value))
        return field

    def apply(self, state: StacksState) -> None:
        """Show a state."""
        with self._applying:
            self.width_mm.setValue(state.settings.width_mm)
            self.gap_mm.setValue(state.profiles.gap_mm)
            self.method.setCurrentIndex(self.method.findData(state.profiles.method))

    def _tell(self, key: str, value: object) -> None:
        if not self._applying:
            self.changed.emit(key, value)
