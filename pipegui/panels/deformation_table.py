"""The deformation panel: table, filters, columns, reviewing, copying."""

from collections import Counter
from collections.abc import Callable
from typing import Any

from PySide6.QtCore import QEvent, QItemSelectionModel, QModelIndex, Qt, Signal
from PySide6.QtGui import QAction, QGuiApplication, QKeyEvent, QKeySequence
from PySide6.QtWidgets import (
    QAbstractItemView,
    QMenu,
    QStackedLayout,
    QStyledItemDelegate,
    QTableView,
    QVBoxLayout,
    QWidget,
)

from pipecore.types import Result, ReviewState
from pipegui.i18n.texts import mark, tr
from pipegui.panels.deformation_columns import COLUMNS, INDEX
from pipegui.panels.deformation_filters import FilterBar
from pipegui.panels.deformation_model import (
    REVIEW_COLUMN,
    REVIEW_ICON,
    DeformationFilter,
    DeformationModel,
)
from pipegui.panels.table_columns import TableColumns
from pipegui.panels.widgets import Applying, EmptyHint, QuietComboBox
from pipegui.states import descriptions
from pipegui.states.view_state import TableState
from pipegui.style import theme

WAITING = mark(
    "Dents, bulges and other deformations appear here once pipes are detected.\n"
    "Open a scan and press Detect (Ctrl+D)."
)
DECISIONS = {
    ReviewState.ACCEPTED: mark("Accept"),
    ReviewState.REJECTED: mark("Reject"),
    ReviewState.OPEN: mark("Leave open"),
}


class DeformationTable(QWidget):
    """Shows the deformations; signals what is chosen, reviewed and commented."""

    chosen = Signal(int)
    """Id of the deformation that the user selected."""
    reviewed = Signal(list, object)
    """Ids of deformations and what was decided, a `ReviewState`."""
    commented = Signal(int, str)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._state = TableState()
        self._applying = Applying()
        self.model = DeformationModel(self)
        self.model.reviewed.connect(lambda i, state: self.reviewed.emit([i], state))
        self.model.commented.connect(self.commented)
        self.proxy = DeformationFilter(self.model, self)
        self.view = self._make_view()
        self.columns = TableColumns(self.view)
        self.menu = self._make_menu()
        self.filters = FilterBar()
        self.filters.choices_changed.connect(self._filter)
        self._empty = EmptyHint(tr(WAITING))
        self._lay_out()
        self.apply(self._state)

    def _make_view(self) -> QTableView:
        view = _Table()
        view.setAccessibleName(tr("Deformations"))
        view.setModel(self.proxy)
        view.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        view.setSelectionMode(QAbstractItemView.SelectionMode.ExtendedSelection)
        triggers = QAbstractItemView.EditTrigger
        view.setEditTriggers(triggers.DoubleClicked | triggers.EditKeyPressed)
        view.setItemDelegateForColumn(REVIEW_COLUMN, _ReviewChoice(view))
        view.setShowGrid(False)
        view.setAlternatingRowColors(True)
        view.setWordWrap(False)
        view.setTabKeyNavigation(False)  # Tab leaves the table; the arrows move in it
        view.setIconSize(theme.icon_size(2))
        view.verticalHeader().hide()
        view.verticalHeader().setDefaultSectionSize(round(3.5 * theme.SPACING))
        view.horizontalHeader().setToolTip(
            tr("Click: sort. Drag: move. Right click: choose columns")
        )
        view.selectionModel().currentRowChanged.connect(self._tell)
        view.setContextMenuPolicy(Qt.ContextMenuPolicy.CustomContextMenu)
        view.customContextMenuRequested.connect(
            lambda at: self.menu.popup(view.viewport().mapToGlobal(at))
        )
        return view

    def _make_menu(self) -> QMenu:
        menu = QMenu(self)
        self.decisions: dict[ReviewState, QAction] = {}
        for state, text in DECISIONS.items():
            action = self.decisions[state] = menu.addAction(tr(text))
            theme.set_icon(action, REVIEW_ICON[state])
            action.triggered.connect(lambda _=False, state=state: self._decide(state))
        menu.addSeparator()
        self._add_keyed(menu, tr("Copy rows"), QKeySequence.StandardKey.Copy, self.copy)
        every = QKeySequence.StandardKey.SelectAll
        self._add_keyed(menu, tr("Select all"), every, self.view.selectAll)
        menu.addSeparator()
        menu.addMenu(self.columns.menu)
        return menu

    def _add_keyed(
        self, menu: QMenu, text: str, key: QKeySequence.StandardKey, act: Callable[[], object]
    ) -> None:
        action = QAction(text, self.view)
        action.setShortcut(QKeySequence(key))
        action.setShortcutContext(Qt.ShortcutContext.WidgetShortcut)
        action.triggered.connect(lambda _=False: act())
        self.view.addAction(action)
        menu.addAction(action)

    def _lay_out(self) -> None:
        table = QWidget()
        column = QVBoxLayout(table)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        column.addWidget(self.filters)
        column.addWidget(self.view)
        self._stack = QStackedLayout(self)
        self._stack.addWidget(self._empty)
        self._stack.addWidget(table)
        self._table = table

    def apply(self, state: TableState) -> None:
        """Show a state."""
        before, self._state = self._state, state
        with self._applying:
            is_new = state.result is not before.result
            if is_new:
                self.model.set_result(state.result, state.reviews)
                self.columns.fit()
            elif state.reviews != before.reviews:
                self.model.set_reviews(state.reviews)
            if is_new or state.selected != before.selected:
                self._show_selected()
        self._stack.setCurrentWidget(self._table if self.model.rowCount() else self._empty)
        self._empty.setText(_why_empty(state.result))
        self._count()

    def _show_selected(self) -> None:
        row = self.model.row_of(self._state.selected)
        index = self.proxy.mapFromSource(self.model.index(row, 0)) if row >= 0 else QModelIndex()
        selection = self.view.selectionModel()
        flags = QItemSelectionModel.SelectionFlag
        current = self.view.currentIndex()
        if index.isValid():
            if current.row() == index.row() and selection.isRowSelected(index.row()):
                return  # the cell that the user is in stays current, and others selected
            index = index.siblingAtColumn(max(current.column(), self.columns.first))
            selection.setCurrentIndex(index, flags.ClearAndSelect | flags.Rows)
            self.view.scrollTo(index)
        else:
            selection.clear()

    # Filtering

    def _filter(self) -> None:
        with self._applying:
            self.proxy.set_filter(
                self.filters.kind.currentData(),
                self.filters.verdict.currentData(),
                self.filters.min_depth.value(),
                self.filters.review.currentData(),
            )
            self._show_selected()
        self._count()

    def _shown_rows(self) -> list[int]:
        return [self._source_row(row) for row in range(self.proxy.rowCount())]

    def _source_row(self, row: int) -> int:
        return self.proxy.mapToSource(self.proxy.index(row, 0)).row()

    def _count(self) -> None:
        rows = self._shown_rows()
        verdicts = Counter(self.model.deformation(r).verdict for r in rows)
        n_rows = self.model.rowCount()
        parts = [
            tr("{n} shown").format(n=len(rows))
            if len(rows) == n_rows
            else tr("{n} of {total} shown").format(n=len(rows), total=n_rows)
        ]
        parts += descriptions.to_do(verdicts)
        n_open = sum(self.model.review(r).state is ReviewState.OPEN for r in rows)
        if n_open < len(rows):
            parts.append(tr("{n} open").format(n=n_open))
        self.filters.counts.setText(" · ".join(parts))

    # What the user does

    def _tell(self, current: QModelIndex, previous: QModelIndex) -> None:
        if current.isValid() and not self._applying:
            row = self.proxy.mapToSource(current).row()
            self.chosen.emit(self.model.deformation(row).deformation_id)

    def _selected_rows(self) -> list[int]:
        selection = self.view.selectionModel()
        rows = sorted({index.row() for index in selection.selectedIndexes()})
        return [self._source_row(row) for row in rows]

    def _decide(self, state: ReviewState) -> None:
        ids = [self.model.deformation(row).deformation_id for row in self._selected_rows()]
        if ids:
            self.reviewed.emit(ids, state)

    def copy(self) -> None:
        """Copy the selected rows (all, if none is) as plain numbers with a header."""
        keys = self.columns.shown
        lines = ["\t".join(COLUMNS[INDEX[key]].copied_title for key in keys)]
        for row in self._selected_rows() or self._shown_rows():
            cells = [self.model.plain(row, INDEX[key]) for key in keys]
            lines.append("\t".join(" ".join(text.split()) for text in cells))
        QGuiApplication.clipboard().setText("\n".join(lines) + "\n")


class _Table(QTableView):
    """Keeps the key that edits a cell to itself where there is a cell to edit."""

    def event(self, event: QEvent) -> bool:
        """Take F2 before it becomes the window's shortcut."""
        is_key = isinstance(event, QKeyEvent) and event.type() == QEvent.Type.ShortcutOverride
        is_editable = bool(self.currentIndex().flags() & Qt.ItemFlag.ItemIsEditable)
        if is_key and event.key() == Qt.Key.Key_F2 and is_editable:  # type: ignore[attr-defined]
            event.accept()
            return True
        return super().event(event)


class _ReviewChoice(QStyledItemDelegate):
    """Edits the review of a row by a choice of its states."""

    def createEditor(self, parent: QWidget, option: Any, index: Any) -> QWidget:  # noqa: N802
        """Return a choice that opens at once and is done when something is chosen."""
        combo = QuietComboBox(parent)
        for state in ReviewState:
            combo.addItem(theme.icon(REVIEW_ICON[state]), tr(state), state)
        combo.activated.connect(lambda _: self.commitData.emit(combo))
        combo.activated.connect(lambda _: self.closeEditor.emit(combo))
        return combo

    def setEditorData(self, editor: QWidget, index: Any) -> None:  # noqa: N802
        """Show the state that the row has."""
        assert isinstance(editor, QuietComboBox)
        editor.setCurrentIndex(editor.findText(index.data()))
        editor.showPopup()

    def setModelData(self, editor: QWidget, model: Any, index: Any) -> None:  # noqa: N802
        """Hand over what was chosen."""
        assert isinstance(editor, QuietComboBox)
        model.setData(index, editor.currentData())


def _why_empty(result: Result | None) -> str:
    if result is None:
        return tr(WAITING)
    if not result.elements:
        return tr("No pipes found, so there is nothing that could be deformed.")
    return tr("No deformations found: every pipe keeps its shape.")
