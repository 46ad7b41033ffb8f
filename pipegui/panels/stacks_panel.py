"""The stacks panel: in which directions profiles are cut, and which stack is shown."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from PySide6.QtCore import QSize, Qt, Signal
from PySide6.QtWidgets import (
    QAbstractItemView,
    QHBoxLayout,
    QHeaderView,
    QLabel,
    QToolButton,
    QTreeWidget,
    QTreeWidgetItem,
    QVBoxLayout,
    QWidget,
)

from pipecore.settings import DirectionPreset
from pipecore.types import NO_ID, Stack
from pipegui import theme
from pipegui.panels.stack_editor import StackEditor
from pipegui.panels.widgets import Applying, EmptyHint, QuietComboBox
from pipegui.view_state import StacksState

PRESET_TEXT = {
    DirectionPreset.AUTOMATIC: "Automatic",
    DirectionPreset.AXES: "X, Y and Z",
    DirectionPreset.AXES_AND_DIAGONALS: "Axes and diagonals",
    DirectionPreset.NONE: "Only my own",
}
NAME, WIDTH, PROFILES = range(3)
CHECKED = Qt.CheckState.Checked
OWN_INDEX = Qt.ItemDataRole.UserRole
STACK_ID = int(Qt.ItemDataRole.UserRole) + 1
SAME_DIRECTION = np.cos(np.deg2rad(0.1))


class StacksPanel(QWidget):
    """Lists the stacks: cut ones can be shown in 3D, own ones can be edited."""

    preset_chosen = Signal(object)
    added = Signal(tuple)
    edited = Signal(int, tuple)
    removed = Signal(int)
    shown = Signal(int)
    """Id of the stack whose profiles are to be shown in colour, or `NO_ID`."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._applying = Applying()
        self._own_directions: tuple[tuple[float, ...], ...] = ()
        self.preset = QuietComboBox()
        self.preset.setAccessibleName("Directions")
        self.preset.setToolTip("Directions in which stacks are cut besides your own")
        for preset, text in PRESET_TEXT.items():
            self.preset.addItem(text, preset)
        self.preset.setSizeAdjustPolicy(
            QuietComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon
        )
        self.preset.setMinimumContentsLength(8)
        self.preset.currentIndexChanged.connect(self._tell_preset)
        self.list = QTreeWidget()
        self.list.setAccessibleName("Stacks")
        self.list.setHeaderLabels(["Stack", "Width", "Profiles"])
        self.list.setRootIsDecorated(False)
        self.list.setIndentation(0)
        self.list.setSelectionMode(QAbstractItemView.SelectionMode.SingleSelection)
        header = self.list.header()
        header.setStretchLastSection(False)
        header.setSectionResizeMode(NAME, QHeaderView.ResizeMode.Stretch)
        header.setSectionResizeMode(WIDTH, QHeaderView.ResizeMode.ResizeToContents)
        header.setSectionResizeMode(PROFILES, QHeaderView.ResizeMode.ResizeToContents)
        self.list.itemChanged.connect(self._tell_shown)
        self.list.currentItemChanged.connect(self._enable)
        self.list.itemDoubleClicked.connect(lambda *_: self.edit())
        self.add_button = self._button("plus", "Add a stack", self.add)
        self.remove_button = self._button("minus", "Remove the selected own stack", self.remove)
        self.edit_button = self._button("pencil-outline", "Edit the selected own stack", self.edit)
        self.editor = StackEditor()
        self.editor.accepted.connect(self._accept)
        self.editor.hide()
        self._edited: int | None = None
        self._empty = EmptyHint("The stacks of profiles appear here once a scan has been detected.")
        self._lay_out()
        self._state = StacksState()
        self._list(self._state)

    def _button(self, icon: str, tip: str, act: Callable[[], None]) -> QToolButton:
        button = QToolButton()
        button.setIcon(theme.icon(icon))
        button.setAutoRaise(True)
        button.setToolTip(tip)
        button.setAccessibleName(tip)
        button.clicked.connect(act)
        return button

    def _lay_out(self) -> None:
        top = QHBoxLayout()
        label = QLabel("Directions")
        label.setBuddy(self.preset)
        top.addWidget(label)
        top.addWidget(self.preset, 1)
        for button in (self.add_button, self.remove_button, self.edit_button):
            top.addWidget(button)
        top.setContentsMargins(theme.SPACING, theme.SPACING, theme.SPACING, 0)
        top.setSpacing(theme.SPACING // 2)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(theme.SPACING // 2)
        column.addLayout(top)
        column.addWidget(self.editor)
        column.addWidget(self.list, 1)
        column.addWidget(self._empty, 1)

    def apply(self, state: StacksState) -> None:
        """Show a state."""
        before, self._state = self._state, state
        if replace(state, shown_stack=before.shown_stack) == before:
            # A tick is answered in place: its item must outlive the signal that it sends.
            self._show_ticks(state.shown_stack)
        else:
            self._list(state)

    def _show_ticks(self, shown_stack: int) -> None:
        with self._applying:
            for row in range(self.list.topLevelItemCount()):
                item = self.list.topLevelItem(row)
                stack_id = item.data(NAME, STACK_ID)
                if stack_id is not None:
                    ticked = stack_id == shown_stack
                    item.setCheckState(NAME, CHECKED if ticked else Qt.CheckState.Unchecked)

    def _list(self, state: StacksState) -> None:
        with self._applying:
            self.preset.setCurrentIndex(self.preset.findData(state.settings.preset))
            selected = self._own_index()
            self.list.clear()
            self._own_directions = state.settings.directions
            own = dict(enumerate(state.settings.directions))
            for stack, n_profiles in zip(state.stacks, state.n_profiles, strict=True):
                match = next((i for i, d in own.items() if _is_of(stack, d)), None)
                if match is not None:
                    del own[match]
                self._add_cut(stack, n_profiles, match, stack.stack_id == state.shown_stack)
            default = state.settings.width_mm
            for index, direction in own.items():
                self._add_planned(index, direction, default)
            for row in range(self.list.topLevelItemCount()):
                item = self.list.topLevelItem(row)
                if selected is not None and item.data(NAME, OWN_INDEX) == selected:
                    self.list.setCurrentItem(item)
        has_stacks = self.list.topLevelItemCount() > 0
        self.list.setVisible(has_stacks)
        self._empty.setVisible(not has_stacks)
        self._enable()

    def _add_cut(self, stack: Stack, n_profiles: int, own: int | None, is_shown: bool) -> None:
        item = QTreeWidgetItem(self.list)
        item.setText(NAME, stack.name or f"Stack {stack.stack_id}")
        item.setText(WIDTH, f"{1000 * stack.width:.0f} mm")
        item.setText(PROFILES, f"{n_profiles:,}")
        item.setTextAlignment(PROFILES, Qt.AlignmentFlag.AlignRight)
        item.setCheckState(NAME, CHECKED if is_shown else Qt.CheckState.Unchecked)
        item.setData(NAME, STACK_ID, stack.stack_id)
        item.setData(NAME, OWN_INDEX, own)
        direction = ", ".join(f"{c:.3f}" for c in stack.direction)
        item.setToolTip(NAME, f"Direction {direction}\nTick to show its profiles in colour.")

    def _add_planned(self, index: int, direction: tuple[float, ...], default_mm: float) -> None:
        item = QTreeWidgetItem(self.list)
        item.setText(NAME, "Own: " + ", ".join(f"{c:g}" for c in direction[:3]))
        width_mm = direction[3] if len(direction) > 3 else default_mm
        item.setText(WIDTH, f"{width_mm:g} mm" if width_mm else "auto")
        item.setText(PROFILES, "–")
        item.setTextAlignment(PROFILES, Qt.AlignmentFlag.AlignRight)
        item.setData(NAME, OWN_INDEX, index)
        item.setToolTip(NAME, "Will be cut at the next detection.")
        font = item.font(NAME)
        font.setItalic(True)
        item.setFont(NAME, font)

    def sizeHint(self) -> QSize:  # noqa: N802
        """Be content with a few rows."""
        return QSize(30 * theme.SPACING, 26 * theme.SPACING)

    def _own_index(self) -> int | None:
        item = self.list.currentItem()
        return None if item is None else item.data(NAME, OWN_INDEX)

    def _enable(self, *_: object) -> None:
        for button in (self.remove_button, self.edit_button):
            button.setEnabled(self._own_index() is not None)

    def _tell_preset(self) -> None:
        if not self._applying:
            self.preset_chosen.emit(DirectionPreset(self.preset.currentData()))

    def _tell_shown(self, item: QTreeWidgetItem, column: int) -> None:
        if self._applying or column != NAME:
            return
        is_checked = item.checkState(NAME) == CHECKED
        self.shown.emit(item.data(NAME, STACK_ID) if is_checked else NO_ID)

    def add(self) -> None:
        """Open the editor for a new stack."""
        self._edited = None
        self.editor.open((1.0, 0.0, 0.0), is_new=True)

    def edit(self) -> None:
        """Open the editor on the selected own stack."""
        self._edited = self._own_index()
        if self._edited is not None:
            self.editor.open(self._own_directions[self._edited], is_new=False)

    def remove(self) -> None:
        """Remove the selected own stack."""
        index = self._own_index()
        if index is not None:
            self.removed.emit(index)

    def _accept(self, direction: tuple[float, ...]) -> None:
        if self._edited is None:
            self.added.emit(direction)
        else:
            self.edited.emit(self._edited, direction)


def _is_of(stack: Stack, direction: tuple[float, ...]) -> bool:
    """Whether a cut stack is that of an own direction, which counts either way round."""
    own = np.array(direction[:3]) / np.linalg.norm(direction[:3])
    is_parallel = abs(float(own @ stack.direction)) > SAME_DIRECTION
    return is_parallel and (len(direction) < 4 or abs(1000 * stack.width - direction[3]) < 0.01)
