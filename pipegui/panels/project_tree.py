"""The project panel: a tree of scans, runs, elements and deformations."""

from PySide6.QtCore import QItemSelectionModel, QModelIndex, Signal
from PySide6.QtWidgets import (
    QHeaderView,
    QLineEdit,
    QStackedLayout,
    QTreeView,
    QVBoxLayout,
    QWidget,
)

from pipegui import theme
from pipegui.panels.project_model import BADGE, NAME, RADIUS, NodeKind, ProjectModel
from pipegui.panels.widgets import Applying, EmptyHint
from pipegui.view_state import TreeState

__all__ = ["NodeKind", "ProjectTree"]


class ProjectTree(QWidget):
    """Shows the project; selecting and check boxes are told as signals."""

    chosen = Signal(int, object, int)
    """Scan, `NodeKind` and id of what the user selected."""
    visibility_changed = Signal(object, bool)
    """Ids of elements, and whether they are to be hidden."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._state = TreeState()
        self._applying = Applying()
        self.model = ProjectModel(self)
        self.model.visibility_changed.connect(self.visibility_changed)
        self.view = QTreeView()
        self.view.setAccessibleName("Project")
        self.view.setModel(self.model)
        self.view.setUniformRowHeights(True)
        self.view.setIconSize(theme.icon_size(2))
        self.view.setIndentation(2 * theme.SPACING)
        header = self.view.header()
        header.setStretchLastSection(False)
        header.setSectionResizeMode(NAME, QHeaderView.ResizeMode.Stretch)
        header.setSectionResizeMode(RADIUS, QHeaderView.ResizeMode.ResizeToContents)
        header.setSectionResizeMode(BADGE, QHeaderView.ResizeMode.ResizeToContents)
        header.setMinimumSectionSize(4 * theme.SPACING)
        self.view.selectionModel().currentChanged.connect(self._tell)
        self.filter = QLineEdit()
        self.filter.setPlaceholderText("Filter by name")
        self.filter.setAccessibleName("Filter the project by name")
        self.filter.setClearButtonEnabled(True)
        self.filter.textChanged.connect(self._filter)
        self._full = QWidget()
        full = QVBoxLayout(self._full)
        full.setContentsMargins(0, 0, 0, 0)
        full.setSpacing(theme.SPACING // 2)
        full.addWidget(self.filter)
        full.addWidget(self.view)
        self._empty = EmptyHint("Scans, pipe runs and deformations appear here.")
        self._layout = QStackedLayout(self)
        self._layout.addWidget(self._empty)
        self._layout.addWidget(self._full)

    def apply(self, state: TreeState) -> None:
        """Show a state."""
        before, self._state = self._state, state
        with self._applying:
            is_new = self.model.apply(state)
            if is_new:
                self.view.expandToDepth(2)
                for index in self.model.spanned():
                    self.view.setFirstColumnSpanned(index.row(), index.parent(), True)
                self._filter(self.filter.text())
            if is_new or state.selection != before.selection or state.active != before.active:
                self._show_selection()
        self._layout.setCurrentWidget(self._full if state.scans else self._empty)

    def _filter(self, typed: str) -> None:
        """Hide rows whose names, and those of what they hold, do not contain `typed`."""
        self._hide_others(QModelIndex(), typed.strip().lower())

    def _hide_others(self, parent: QModelIndex, wanted: str) -> bool:
        is_any_shown = False
        for row in range(self.model.rowCount(parent)):
            index = self.model.index(row, NAME, parent)
            is_named = wanted in str(index.data()).lower()
            # What a fitting row holds is shown with it.
            is_shown = self._hide_others(index, "" if is_named else wanted) or is_named
            self.view.setRowHidden(row, parent, not is_shown)
            is_any_shown = is_any_shown or is_shown
        return is_any_shown

    def _show_selection(self) -> None:
        index = self.model.index_of(self._state.active, self._state.selection)
        selection = self.view.selectionModel()
        flags = QItemSelectionModel.SelectionFlag
        if index.isValid():
            selection.setCurrentIndex(index, flags.ClearAndSelect | flags.Rows)
            self.view.scrollTo(index)
        else:
            selection.clear()

    def _tell(self, current: QModelIndex, previous: QModelIndex) -> None:
        if current.isValid() and not self._applying:
            self.chosen.emit(*self.model.what(current))
