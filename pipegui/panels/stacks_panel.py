"""The stacks panel: in which directions profiles are cut, and which stack is shown."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from PySide6.QtCore import QSize, Qt, QTimer, Signal
from PySide6.QtGui import QHideEvent, QShowEvent
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
from pipegui.i18n.texts import mark, tr
from pipegui.panels.cutting_fields import CuttingFields
from pipegui.panels.stack_editor import StackEditor
from pipegui.panels.widgets import Applying, EmptyHint, QuietComboBox, items_of
from pipegui.states.preview_state import PlanState
from pipegui.states.view_state import StacksState
from pipegui.style import theme

PRESET_TEXT = {
    DirectionPreset.AUTOMATIC: mark("Automatic"),
    DirectionPreset.AXES: mark("X, Y and Z"),
    DirectionPreset.AXES_AND_DIAGONALS: mark("Axes and diagonals"),
    DirectionPreset.NONE: mark("Only my own"),
}
NAME, WIDTH, PROFILES, SHARE = range(4)
HINTS = (
    mark("Tick a stack that was cut to show its profiles in colour"),
    mark("Thickness of a profile"),
    mark("Before a detection: how many profiles would be cut. After it: how many show an ellipse."),
    mark("Share of the surface that the stack cuts steeply enough to use, judged on a sample"),
)
CHECKED = Qt.CheckState.Checked
OWN_INDEX = Qt.ItemDataRole.UserRole
STACK_ID = int(Qt.ItemDataRole.UserRole) + 1
PLAN_ROW = int(Qt.ItemDataRole.UserRole) + 2
SAME_DIRECTION = np.cos(np.deg2rad(0.1))
ALIKE_DIRECTION, ALIKE_WIDTH = np.cos(np.deg2rad(5.0)), 0.2
"""A planned stack stands for a cut one within these: the sample's directions differ a little."""


class StacksPanel(QWidget):
    """Lists the stacks: cut ones can be shown in 3D, own ones can be edited."""

    preset_chosen = Signal(object)
    added = Signal(tuple)
    edited = Signal(int, tuple)
    removed = Signal(int)
    shown = Signal(int)
    """Id of the stack whose profiles are to be shown in colour, or `NO_ID`."""
    setting_changed = Signal(str, object)
    """Dotted key and new value."""
    preview_wanted = Signal(int)
    """Row of a stack in the plan."""
    points_wanted = Signal()
    """Two points are to be picked in the 3D view."""
    points_taken = Signal()
    seen = Signal(bool)
    """Whether anybody looks: what nobody sees need not be planned."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._applying = Applying()
        self._own_directions: tuple[tuple[float, ...], ...] = ()
        self.preset = QuietComboBox()
        self.preset.setAccessibleName(tr("Directions"))
        self.preset.setToolTip(tr("Directions in which stacks are cut besides your own"))
        for preset, text in PRESET_TEXT.items():
            self.preset.addItem(tr(text), preset)
        self.preset.setSizeAdjustPolicy(
            QuietComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon
        )
        self.preset.setMinimumContentsLength(8)
        self.preset.currentIndexChanged.connect(self._tell_preset)
        self.cutting = CuttingFields()
        self.cutting.changed.connect(self.setting_changed)
        self.list = QTreeWidget()
        self.list.setAccessibleName(tr("Stacks"))
        self.list.setHeaderLabels([tr("Stack"), tr("Width"), tr("Profiles"), tr("Cut")])
        for column, hint in enumerate(HINTS):
            self.list.headerItem().setToolTip(column, tr(hint))
        self.list.setRootIsDecorated(False)
        self.list.setIndentation(0)
        self.list.setSelectionMode(QAbstractItemView.SelectionMode.SingleSelection)
        header = self.list.header()
        header.setStretchLastSection(False)
        header.setSectionResizeMode(NAME, QHeaderView.ResizeMode.Stretch)
        header.setSectionResizeMode(WIDTH, QHeaderView.ResizeMode.ResizeToContents)
        header.setSectionResizeMode(PROFILES, QHeaderView.ResizeMode.ResizeToContents)
        header.setSectionResizeMode(SHARE, QHeaderView.ResizeMode.ResizeToContents)
        self.list.itemChanged.connect(self._tell_shown)
        self.list.currentItemChanged.connect(self._enable)
        self.list.itemActivated.connect(lambda *_: self._activate())
        self.add_button = self._button("plus", tr("Add a stack"), self.add)
        self.remove_button = self._button("minus", tr("Remove the selected own stack"), self.remove)
        self.edit_button = self._button(
            "pencil-outline", tr("Edit the selected own stack"), self.edit
        )
        tip = tr("Preview a profile of the selected stack with its curves")
        self.preview_button = self._button("eye-outline", tip, self.preview)
        self.editor = StackEditor()
        self.editor.accepted.connect(self._accept)
        self.editor.points_wanted.connect(self._want_points)
        self._waits_for_points = False
        self._plan = PlanState()
        self.editor.hide()
        self._edited: int | None = None
        self._empty = EmptyHint(
            tr("Open a scan to see in which directions it would be cut, and how well.")
        )
        self.note = QLabel()
        self.note.setProperty("muted", True)
        self.note.setContentsMargins(theme.SPACING, 0, theme.SPACING, theme.SPACING // 2)
        self.note.hide()
        self._lay_out()
        self._state = StacksState()
        self._list(self._state)

    def _button(self, icon: str, tip: str, act: Callable[[], None]) -> QToolButton:
        button = QToolButton()
        theme.set_icon(button, icon)
        button.setAutoRaise(True)
        button.setToolTip(tip)
        button.setAccessibleName(tip)
        button.clicked.connect(act)
        return button

    def _lay_out(self) -> None:
        top = QHBoxLayout()
        label = QLabel(tr("Directions"))
        label.setBuddy(self.preset)
        top.addWidget(label)
        top.addWidget(self.preset, 1)
        buttons = (self.preview_button, self.add_button, self.remove_button, self.edit_button)
        for button in buttons:
            top.addWidget(button)
        top.setContentsMargins(theme.SPACING, theme.SPACING, theme.SPACING, 0)
        top.setSpacing(theme.SPACING // 2)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(theme.SPACING // 2)
        column.addLayout(top)
        column.addWidget(self.cutting)
        column.addWidget(self.editor)
        column.addWidget(self.list, 1)
        column.addWidget(self._empty, 1)
        column.addWidget(self.note)

    def apply(self, state: StacksState) -> None:
        """Show a state."""
        before, self._state = self._state, state
        self.cutting.apply(state)
        if self._waits_for_points and state.measured not in (None, before.measured):
            self._take_points(state)
        as_before = replace(
            state,
            profiles=before.profiles,
            shown_stack=before.shown_stack,
            measured=before.measured,
        )
        if as_before == before:
            # A tick is answered in place: its item must outlive the signal that it sends.
            self._show_ticks(state.shown_stack)
        else:
            self._list(state)

    def show_plan(self, plan: PlanState) -> None:
        """Show what a detection would cut."""
        self._plan = plan
        self._list(self._state)

    def _show_ticks(self, shown_stack: int) -> None:
        with self._applying:
            for item in items_of(self.list):
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
            if not state.stacks and self._plan.plan is not None:
                self._add_plan(own)
            default = state.settings.width_mm
            for index, direction in own.items():
                self._add_planned(index, direction, default)
            for item in items_of(self.list):
                if selected is not None and item.data(NAME, OWN_INDEX) == selected:
                    self.list.setCurrentItem(item)
        has_stacks = self.list.topLevelItemCount() > 0
        self.list.setVisible(has_stacks)
        self._empty.setVisible(not has_stacks)
        self.note.setText(self._plan.message or self._share_text())
        self.note.setVisible(bool(self.note.text()))
        self._enable()

    def _share_text(self) -> str:
        plan = self._plan.plan
        if plan is None or not np.isfinite(plan.share):
            return ""
        return tr("Together they cut {share:.0f} % of the surface well.").format(
            share=100 * plan.share
        )

    def _add_plan(self, own: dict[int, tuple[float, ...]]) -> None:
        """List the stacks of the plan; own ones are taken out of `own`."""
        assert self._plan.plan is not None
        for row, planned in enumerate(self._plan.plan.stacks):
            match = next((i for i, d in own.items() if _is_of(planned.stack, d)), None)
            if match is not None:
                del own[match]
            item = self._add_item(planned.stack, f"{planned.n_profiles:,}", match, row)
            font = item.font(NAME)
            font.setItalic(True)
            item.setFont(NAME, font)
            direction = ", ".join(f"{c:.3f}" for c in planned.stack.direction)
            item.setToolTip(
                NAME,
                tr("Direction {direction}\nWill be cut at the next detection.").format(
                    direction=direction
                ),
            )

    def _row_of_plan(self, stack: Stack) -> int | None:
        """Row of the planned stack that is like a cut one."""
        rows = () if self._plan.plan is None else enumerate(self._plan.plan.stacks)
        for row, planned in rows:
            is_parallel = abs(float(planned.stack.direction @ stack.direction)) > ALIKE_DIRECTION
            ratio = planned.stack.width / stack.width
            if is_parallel and abs(ratio - 1) < ALIKE_WIDTH:
                return row
        return None

    def _add_item(
        self, stack: Stack, n_profiles: str, own: int | None, row: int | None
    ) -> QTreeWidgetItem:
        item = QTreeWidgetItem(self.list)
        item.setText(NAME, stack.name or tr("Stack {stack_id}").format(stack_id=stack.stack_id))
        item.setText(WIDTH, f"{1000 * stack.width:.0f} mm")
        item.setText(PROFILES, n_profiles)
        item.setData(NAME, OWN_INDEX, own)
        item.setData(NAME, PLAN_ROW, row)
        if row is not None and self._plan.plan is not None:
            share = self._plan.plan.stacks[row].share
            item.setText(SHARE, f"{100 * share:.0f} %" if np.isfinite(share) else "–")
        for column in (PROFILES, SHARE):
            item.setTextAlignment(column, Qt.AlignmentFlag.AlignRight)
        return item

    def _add_cut(self, stack: Stack, n_profiles: int, own: int | None, is_shown: bool) -> None:
        item = self._add_item(stack, f"{n_profiles:,}", own, self._row_of_plan(stack))
        item.setCheckState(NAME, CHECKED if is_shown else Qt.CheckState.Unchecked)
        item.setData(NAME, STACK_ID, stack.stack_id)
        direction = ", ".join(f"{c:.3f}" for c in stack.direction)
        item.setToolTip(
            NAME,
            tr("Direction {direction}\nTick to show its profiles in colour.").format(
                direction=direction
            ),
        )

    def _add_planned(self, index: int, direction: tuple[float, ...], default_mm: float) -> None:
        item = QTreeWidgetItem(self.list)
        item.setText(NAME, tr("Own: ") + ", ".join(f"{c:g}" for c in direction[:3]))
        width_mm = direction[3] if len(direction) > 3 else default_mm
        item.setText(WIDTH, f"{width_mm:g} mm" if width_mm else tr("auto"))
        item.setText(PROFILES, "–")
        item.setTextAlignment(PROFILES, Qt.AlignmentFlag.AlignRight)
        item.setData(NAME, OWN_INDEX, index)
        item.setToolTip(NAME, tr("Will be cut at the next detection."))
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
        self.preview_button.setEnabled(self._plan.plan is not None)

    def _tell_preset(self) -> None:
        if not self._applying:
            self.preset_chosen.emit(DirectionPreset(self.preset.currentData()))

    def _tell_shown(self, item: QTreeWidgetItem, column: int) -> None:
        if self._applying or column != NAME:
            return
        is_checked = item.checkState(NAME) == CHECKED
        self.shown.emit(item.data(NAME, STACK_ID) if is_checked else NO_ID)

    def preview(self) -> None:
        """Ask to see a profile of the selected stack, or of the first."""
        item = self.list.currentItem()
        row = None if item is None else item.data(NAME, PLAN_ROW)
        self.preview_wanted.emit(row or 0)

    def _activate(self) -> None:
        if self._own_index() is not None:
            self.edit()
        elif self.preview_button.isEnabled():
            self.preview()

    def _want_points(self) -> None:
        self._waits_for_points = True
        self.points_wanted.emit()

    def _take_points(self, state: StacksState) -> None:
        """Make the direction of two points that were picked that of the stack."""
        assert state.measured is not None
        self._waits_for_points = False
        self.editor.take_points(state.measured.start, state.measured.end)
        # The state that brought the points is still being shown to the others.
        QTimer.singleShot(0, self, self.points_taken.emit)

    def showEvent(self, event: QShowEvent) -> None:  # noqa: N802
        """Signal that the panel is seen."""
        super().showEvent(event)
        self.seen.emit(True)

    def hideEvent(self, event: QHideEvent) -> None:  # noqa: N802
        """Signal that the panel is hidden."""
        super().hideEvent(event)
        self.seen.emit(False)

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
    """Return whether a cut stack is that of an own direction, which counts either way round."""
    own = np.array(direction[:3]) / np.linalg.norm(direction[:3])
    is_parallel = abs(float(own @ stack.direction)) > SAME_DIRECTION
    return is_parallel and (len(direction) < 4 or abs(1000 * stack.width - direction[3]) < 0.01)
