"""The project panel: a tree of scans, runs, elements and deformations."""

from PySide6.QtCore import (
    QItemSelection,
    QItemSelectionModel,
    QModelIndex,
    QPoint,
    Qt,
    QTimer,
    Signal,
)
from PySide6.QtWidgets import (
    QAbstractItemView,
    QHeaderView,
    QLineEdit,
    QStackedLayout,
    QTreeView,
    QVBoxLayout,
    QWidget,
)

from pipegui.i18n.texts import tr
from pipegui.model.document import Selection
from pipegui.panels.project_model import BADGE, NAME, RADIUS, NodeKind, ProjectModel
from pipegui.panels.widgets import Applying, EmptyHint
from pipegui.states.view_state import TreeState
from pipegui.style import theme

__all__ = ["NodeKind", "ProjectTree"]


class ProjectTree(QWidget):
    """Shows the project; signals what is selected, shown and hidden."""

    chosen = Signal(int, object, int)
    """Scan, `NodeKind` and id of what the user selected."""
    marked = Signal(object)
    """Ids of all elements that are selected, where there are several."""
    renamed = Signal(int, object, int, str)
    """Scan, `NodeKind` and id of what the user named, and the name."""
    menu_requested = Signal(object, QPoint)
    """`NodeKind` of the row under the cursor, and where on the screen."""
    visibility_changed = Signal(object, bool)
    """Ids of elements, and whether they are to be hidden."""

    stations_hidden = Signal(object, bool)
    """Ids of stations, and whether they are to be hidden."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._state = TreeState()
        self._applying = Applying()
        self.model = ProjectModel(self)
        self.model.visibility_changed.connect(self.visibility_changed)
        self.model.stations_hidden.connect(self.stations_hidden)
        self.model.renamed.connect(self.renamed)
        self.view = QTreeView()
        self.view.setAccessibleName(tr("Project"))
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
        self.view.setSelectionMode(QAbstractItemView.SelectionMode.ExtendedSelection)
        self.view.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
        self.view.setContextMenuPolicy(Qt.ContextMenuPolicy.CustomContextMenu)
        self.view.customContextMenuRequested.connect(self._request_menu)
        self.view.selectionModel().selectionChanged.connect(self._tell)
        self.filter = QLineEdit()
        self.filter.setObjectName("treeFilter")
        self.filter.setPlaceholderText(tr("Filter by name"))
        self.filter.setAccessibleName(tr("Filter the project by name"))
        self.filter.setClearButtonEnabled(True)
        self.filter.textChanged.connect(self._filter)
        self._full = QWidget()
        full = QVBoxLayout(self._full)
        full.setContentsMargins(0, 0, 0, 0)
        full.setSpacing(theme.SPACING // 2)
        top = QVBoxLayout()
        top.setContentsMargins(theme.SPACING, theme.SPACING // 2, theme.SPACING, 0)
        top.addWidget(self.filter)
        full.addLayout(top)
        full.addWidget(self.view)
        self._empty = EmptyHint(tr("Scans, pipe runs and deformations appear here."))
        self._layout = QStackedLayout(self)
        self._layout.addWidget(self._empty)
        self._layout.addWidget(self._full)

    def apply(self, state: TreeState) -> None:
        """Show a state."""
        before, self._state = self._state, state
        with self._applying:
            closed, opened = self._closed(), self._opened()
            is_new = self.model.apply(state)
            if is_new:
                self.view.expandToDepth(2)
                for index in self.model.branches():
                    if self.model.what(index) in closed:
                        self.view.collapse(index)
                for index in self.model.folded():
                    self.view.setExpanded(index, self.model.what(index) in opened)
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

    def _closed(self) -> set[tuple[int, NodeKind, int]]:
        """Return the branches that the user has closed."""
        view, branches = self.view, self.model.branches()
        return {self.model.what(index) for index in branches if not view.isExpanded(index)}

    def _opened(self) -> set[tuple[int, NodeKind, int]]:
        """Return the branches, closed by themselves, that the user has opened."""
        view, model = self.view, self.model
        return {model.what(index) for index in model.folded() if view.isExpanded(index)}

    def _show_selection(self) -> None:
        index = self.model.index_of(self._state.active, self._state.selection)
        selection = self.view.selectionModel()
        flags = QItemSelectionModel.SelectionFlag
        if not index.isValid():
            # Nothing of a scan is selected: then its own row may be.
            current = self.view.currentIndex()
            kinds = (self._state.active, NodeKind.SCAN)
            if not current.isValid() or self.model.what(current)[:2] != kinds:
                selection.clear()
            return
        wanted = QItemSelection(index, index)
        for element_id in self._state.selection.others:
            other = self.model.index_of(self._state.active, Selection(element_id=element_id))
            wanted.select(other, other)
        selection.select(wanted, flags.ClearAndSelect | flags.Rows)
        selection.setCurrentIndex(index, flags.NoUpdate)
        self.view.scrollTo(index)

    def _tell(self) -> None:
        """Signal what was selected; of several elements the current one comes first."""
        if self._applying:
            return
        rows = self.view.selectionModel().selectedRows(NAME)
        if not rows:
            return
        current = self.view.currentIndex().siblingAtColumn(NAME)
        lead = current if current in rows else rows[-1]
        selected = [self.model.what(row) for row in rows]
        what = self.model.what(lead)
        self.chosen.emit(*what)
        scan, kind, _ = what
        if len(rows) > 1 and kind is NodeKind.ELEMENT:
            self.marked.emit([i for s, k, i in selected if k is kind and s == scan])
        elif len(rows) > 1:
            # Only elements can be selected together. Qt is still in the midst of selecting.
            QTimer.singleShot(0, self, self._reselect)

    def _reselect(self) -> None:
        with self._applying:
            self._show_selection()

    def _request_menu(self, position: QPoint) -> None:
        index = self.view.indexAt(position)
        if index.isValid():
            _, kind, _ = self.model.what(index)
            self.menu_requested.emit(kind, self.view.viewport().mapToGlobal(position))

    def rename(self) -> None:
        """Let the user type another name for the selected row."""
        index = self.view.currentIndex().siblingAtColumn(NAME)
        if index.isValid() and self.model.flags(index) & Qt.ItemFlag.ItemIsEditable:
            self.view.setFocus()
            self.view.edit(index)
