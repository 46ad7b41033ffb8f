"""Editing the direction and width of one stack, in place."""

from collections.abc import Callable

import numpy as np
from PySide6.QtCore import Signal
from PySide6.QtWidgets import QGridLayout, QHBoxLayout, QLabel, QPushButton, QWidget

from pipecore.geometry import Array
from pipegui.i18n.texts import tr
from pipegui.panels.widgets import QuietSpinBox
from pipegui.style import theme


class StackEditor(QWidget):
    """Direction and width of one stack, in place."""

    accepted = Signal(tuple)
    points_wanted = Signal()
    """Two points are to be picked in the 3D view."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.view_direction: Callable[[], Array] | None = None
        """Returns the direction in which the 3D view looks; set by the window."""
        self.components = [self._component(name) for name in "XYZ"]
        self.width_mm = QuietSpinBox()
        self.width_mm.setAccessibleName(tr("Profile width"))
        self.width_mm.setToolTip(
            tr("Thickness of this stack's profiles; 0 takes that of the settings")
        )
        self.width_mm.setRange(0, 1000)
        self.width_mm.setSuffix(" mm")
        self.width_mm.setSpecialValueText(tr("as in the settings"))
        self.title = QLabel()
        self.title.setObjectName("formTitle")
        self.accept_button = QPushButton(tr("Add"))
        self.accept_button.clicked.connect(self._accept)
        cancel = QPushButton(tr("Cancel"))
        cancel.clicked.connect(self.hide)
        grid = QGridLayout(self)
        grid.setContentsMargins(theme.SPACING, 0, theme.SPACING, 0)
        grid.setSpacing(theme.SPACING // 2)
        grid.addWidget(self.title, 0, 0, 1, 4)
        grid.addWidget(QLabel(tr("Direction")), 1, 0)
        grid.addWidget(QLabel(tr("Width")), 3, 0)
        for column, component in enumerate(self.components, start=1):
            grid.addWidget(component, 1, column)
            axis = np.eye(3)[column - 1]
            button = QPushButton("XYZ"[column - 1])
            button.setToolTip(tr("Along the {text} axis").format(text=button.text()))
            button.clicked.connect(lambda _=False, axis=axis: self._set(axis))
            grid.addWidget(button, 2, column)
            button.setMinimumWidth(5 * theme.SPACING)
        self.from_view = QPushButton(tr("View"))
        self.from_view.setMinimumWidth(7 * theme.SPACING)
        self.from_view.setToolTip(tr("The direction in which the 3D view looks"))
        self.from_view.clicked.connect(self._take_view)
        grid.addWidget(self.from_view, 2, 0)
        self.from_points = QPushButton(tr("From two points"))
        self.from_points.setToolTip(tr("Click two points in the 3D view, such as along a pipe"))
        self.from_points.clicked.connect(self._want_points)
        self.from_points.setMinimumWidth(1)
        grid.addWidget(self.from_points, 4, 1, 1, 3)
        grid.addWidget(self.width_mm, 3, 1, 1, 3)
        buttons = QHBoxLayout()
        buttons.addStretch()
        buttons.addWidget(cancel)
        buttons.addWidget(self.accept_button)
        grid.addLayout(buttons, 5, 0, 1, 4)

    def _component(self, name: str) -> QuietSpinBox:
        field = QuietSpinBox()
        field.setAccessibleName(tr("Direction {name}").format(name=name))
        field.setToolTip(
            tr("{name} of the direction along which profiles follow one another").format(name=name)
        )
        field.setRange(-1, 1)
        field.setDecimals(3)
        field.setSingleStep(0.1)
        field.setMinimumWidth(6 * theme.SPACING)
        field.setButtonSymbols(QuietSpinBox.ButtonSymbols.NoButtons)
        field.valueChanged.connect(self._enable)
        return field

    def open(self, direction: tuple[float, ...], *, is_new: bool) -> None:
        """Show a stack to be edited."""
        self.title.setText(tr("New stack") if is_new else tr("Edit stack"))
        self.accept_button.setText(tr("Add") if is_new else tr("Apply"))
        self._set(np.array(direction[:3]))
        self.width_mm.setValue(direction[3] if len(direction) > 3 else 0.0)
        self.from_view.setVisible(self.view_direction is not None)
        self.from_points.setText(tr("From two points"))
        self.show()
        self.components[0].setFocus()

    def _set(self, direction: Array) -> None:
        for component, value in zip(self.components, direction, strict=True):
            component.setValue(float(value))

    def _take_view(self) -> None:
        if self.view_direction is not None:
            self._set(np.round(self.view_direction(), 3))

    def _want_points(self) -> None:
        self.from_points.setText(tr("Click two points …"))
        self.points_wanted.emit()

    def take_points(self, start: tuple[float, ...], end: tuple[float, ...] | None) -> None:
        """Take the direction from one point to another."""
        self.from_points.setText(tr("From two points"))
        offset = np.subtract(end if end is not None else start, start)
        length = float(np.linalg.norm(offset))
        if length > 0:
            self._set(np.round(offset / length, 3))

    def _direction(self) -> tuple[float, ...]:
        return tuple(round(component.value(), 3) for component in self.components)

    def _enable(self) -> None:
        self.accept_button.setEnabled(any(self._direction()))

    def _accept(self) -> None:
        width = (self.width_mm.value(),) if self.width_mm.value() else ()
        self.hide()
        self.accepted.emit((*self._direction(), *width))
