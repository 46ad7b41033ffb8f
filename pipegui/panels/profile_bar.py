"""The profiles of a stack one by one: a bar below the 3D view while a stack is shown."""

import numpy as np
from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QHBoxLayout, QLabel, QSlider, QToolButton, QWidget

from pipegui.i18n.texts import tr
from pipegui.panels.widgets import Applying
from pipegui.states.view_state import ProfileBarState
from pipegui.style import theme


class ProfileBar(QWidget):
    """A slider over the profiles, and a button for all of them."""

    chosen = Signal(object)
    """`profile_index`, or None for all."""
    stepped = Signal(int)
    """+1 or -1."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._applying = Applying()
        self._indices = np.empty(0, np.int32)
        row = QHBoxLayout(self)
        row.setContentsMargins(theme.SPACING, 2, theme.SPACING, 2)
        row.setSpacing(theme.SPACING)
        self.stack = QLabel()
        row.addWidget(self.stack)
        self.previous = self._button("‹", tr("Previous profile (,)"), -1)
        row.addWidget(self.previous)
        self.slider = QSlider(Qt.Orientation.Horizontal)
        self.slider.setAccessibleName(tr("Profile of the stack"))
        self.slider.setToolTip(tr("Which profile of the stack is shown"))
        self.slider.valueChanged.connect(self._tell)
        row.addWidget(self.slider, 1)
        self.next = self._button("›", tr("Next profile (.)"), 1)
        row.addWidget(self.next)
        self.place = QLabel()
        row.addWidget(self.place)
        self.all = QToolButton()
        self.all.setText(tr("All profiles"))
        self.all.setToolTip(tr("Show all profiles of the stack"))
        self.all.setCheckable(True)
        self.all.clicked.connect(lambda: self.chosen.emit(None))
        row.addWidget(self.all)
        self.hide()

    def apply(self, state: ProfileBarState) -> None:
        """Show a state."""
        self._indices = state.indices
        self.setVisible(len(state.indices) > 0)
        if not len(state.indices):
            return
        self.stack.setText(state.name)
        with self._applying:
            self.slider.setRange(0, len(state.indices) - 1)
            self.slider.setPageStep(max(1, len(state.indices) // 20))
            if state.shown is not None:
                self.slider.setValue(int(np.searchsorted(state.indices, state.shown)))
        self.all.setChecked(state.shown is None)
        n = len(state.indices)
        at = "" if state.shown is None else tr("{n} of ").format(n=self.slider.value() + 1)
        # As wide as it can get: what stands beside it should not move.
        self.place.setMinimumWidth(
            self.place.fontMetrics().horizontalAdvance(tr("{n} of {n}").format(n=n))
        )
        self.place.setText(f"{at}{n}")

    def _button(self, text: str, tip: str, by: int) -> QToolButton:
        button = QToolButton()
        button.setText(text)
        button.setToolTip(tip)
        button.setAccessibleName(tip)
        button.setAutoRaise(True)
        button.setAutoRepeat(True)
        button.clicked.connect(lambda: self.stepped.emit(by))
        return button

    def _tell(self, place: int) -> None:
        if not self._applying and place < len(self._indices):
            self.chosen.emit(int(self._indices[place]))
