"""The clip box in numbers: a bar below the 3D view while there is one."""

from dataclasses import replace

import numpy as np
from PySide6.QtCore import QEvent, QSize, Qt, Signal, SignalInstance
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QHBoxLayout, QLabel, QLayout, QToolButton, QWidget

from pipegui.i18n.texts import mark, tr
from pipegui.model.document import ClipBox
from pipegui.panels.widgets import Applying, QuietSpinBox
from pipegui.states import descriptions
from pipegui.states.view_state import ClipState
from pipegui.style import theme

STEP = 0.05
FIELD_FRAME, BUTTON_FRAME, ICON_FRAME = 12, 18, 8
"""Pixels around the text of a field or a button, and around an icon."""

FIELD_NAMES = (mark("Clip box, lower {axis}"), mark("Clip box, upper {axis}"))
FIELD_TIPS = (mark("Lower end along {axis}, metres"), mark("Upper end along {axis}, metres"))


class ClipBar(QWidget):
    """World coordinates of the box's faces, and where else the box can go."""

    changed = Signal(object)
    """The `ClipBox` that was typed."""
    whole_requested = Signal()
    selection_requested = Signal()
    inverted = Signal()
    closed = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._applying = Applying()
        self._origin = np.zeros(3)
        self._box: ClipBox | None = None
        row = self._row = QHBoxLayout(self)
        row.setSizeConstraint(QLayout.SizeConstraint.SetNoConstraint)
        row.setContentsMargins(theme.SPACING, 2, theme.SPACING, 2)
        row.setSpacing(theme.SPACING // 2)
        self._names = [QLabel() for _ in range(3)]
        self.ends: list[list[QuietSpinBox]] = []
        for name in self._names:
            row.addWidget(name)
            self.ends.append([QuietSpinBox() for _ in range(2)])
            for side, field in enumerate(self.ends[-1]):
                field.setDecimals(2)
                field.setRange(-1e9, 1e9)
                field.setSingleStep(STEP)
                field.setButtonSymbols(QuietSpinBox.ButtonSymbols.NoButtons)
                axis = len(self.ends) - 1
                field.valueChanged.connect(
                    lambda value, axis=axis, side=side: self._tell(axis, side, value)
                )
                row.addWidget(field, 1)
        self._icons: dict[QToolButton, str] = {}
        self.whole = self._button(
            tr("All"), tr("Put the box around the whole scan"), "select-all", self.whole_requested
        )
        self.selection = self._button(
            tr("Selection"),
            tr("Put the box around the selection"),
            "crop",
            self.selection_requested,
        )
        self.invert = self._button(
            tr("Invert"),
            tr("Show what is outside the box instead of what is in it"),
            "select-inverse",
            self.inverted,
        )
        self.invert.setCheckable(True)
        self.close_ = self._button(tr("Off"), tr("Stop clipping"), "close", self.closed)
        for button in self._icons:
            row.addWidget(button)
        self._paint_icons()
        self.hide()

    def apply(self, state: ClipState) -> None:
        """Show a state."""
        self._box = state.box
        self.setVisible(state.box is not None)
        self.selection.setEnabled(state.has_selection)
        if state.box is None or state.cloud is None:
            return
        self._origin = state.cloud.origin
        self.invert.setChecked(state.box.is_inverted)
        with self._applying:
            for axis, name in enumerate(descriptions.axis_names(state.cloud)):
                self._names[axis].setText(name)
                for side, local in enumerate((state.box.low, state.box.high)):
                    field = self.ends[axis][side]
                    field.setAccessibleName(tr(FIELD_NAMES[side]).format(axis=name))
                    field.setToolTip(tr(FIELD_TIPS[side]).format(axis=name))
                    field.setValue(local[axis] + float(self._origin[axis]))
                    text = field.fontMetrics().horizontalAdvance(f"{field.value():.2f}")
                    field.setMinimumWidth(text + FIELD_FRAME)
        self._fit()

    def resizeEvent(self, event: QResizeEvent) -> None:  # noqa: N802
        """Show icons where there is no room for words."""
        super().resizeEvent(event)
        self._fit()

    def changeEvent(self, event: QEvent) -> None:  # noqa: N802
        """Follow light and dark."""
        super().changeEvent(event)
        if event.type() == QEvent.Type.PaletteChange:
            self._paint_icons()

    def _paint_icons(self) -> None:
        for button, icon in self._icons.items():
            button.setIcon(theme.icon(icon))

    def minimumSizeHint(self) -> QSize:  # noqa: N802
        """Return the size with icons: words must not make the window wider."""
        return QSize(self._needed(words=False), super().minimumSizeHint().height())

    def _needed(self, *, words: bool) -> int:
        """Width at which the numbers are whole, beside words or icons."""
        fields = [field.minimumWidth() for pair in self.ends for field in pair]
        names = [name.sizeHint().width() for name in self._names]
        buttons = [
            b.fontMetrics().horizontalAdvance(b.text()) + BUTTON_FRAME
            if words
            else b.iconSize().width() + ICON_FRAME
            for b in self._icons
        ]
        between = self._row.spacing() * self._row.count() + 2 * theme.SPACING
        return sum(fields) + sum(names) + sum(buttons) + between

    def _fit(self) -> None:
        """Choose words or icons for the buttons."""
        style = Qt.ToolButtonStyle.ToolButtonTextOnly
        if self.width() < self._needed(words=True):
            style = Qt.ToolButtonStyle.ToolButtonIconOnly
        for button in self._icons:
            button.setToolButtonStyle(style)

    def _button(self, text: str, tip: str, icon: str, signal: SignalInstance) -> QToolButton:
        button = QToolButton()
        button.setText(text)
        button.setToolTip(tip)
        button.setAccessibleName(tip)
        self._icons[button] = icon
        button.setAutoRaise(True)
        button.clicked.connect(signal)
        return button

    def _tell(self, axis: int, side: int, value: float) -> None:
        """Move one face; the others keep what the fields round."""
        if self._applying or self._box is None:
            return
        ends = [list(self._box.low), list(self._box.high)]
        ends[side][axis] = value - float(self._origin[axis])
        (x, y, z), (x_high, y_high, z_high) = ends
        self.changed.emit(replace(self._box, low=(x, y, z), high=(x_high, y_high, z_high)))
