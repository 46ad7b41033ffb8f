"""The deformation panel: table, filters, columns, reviewing, copying."""

from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any

from PySide6.QtCore import QEvent, QItemSelectionModel, QModelIndex, Qt, Signal
from PySide6.QtGui import QAction, QGuiApplication, QKeyEvent, QKeySequence
from PySide6.QtWidgets import (
    QAbstractItemView,
    QHBoxLayout,
    QLabel,
    QMenu,
    QStackedLayout,
    QStyledItemDelegate,
    QTableView,
    QVBoxLayout,
    QWidget,
)

from pipecore.types import DeformationKind, ReviewState, Verdict
from pipegui import describe, theme
from pipegui.panels.deformation_columns import COLUMNS, INDEX, SHOWN_FIRST
from pipegui.panels.deformation_model import (
    REVIEW_COLUMN,
    REVIEW_ICON,
    DeformationFilter,
    DeformationModel,
)
from pipegui.panels.widgets import Applying, EmptyHint, QuietComboBox, QuietSpinBox
from pipegui.texts import mark, tr
from pipegui.view_state import TableState

WAITING = mark(
    "Dents, bulges and other deformations appear here once pipes are detected.\n"
    "Open a scan and press Detect (Ctrl+D)."
)
ROOM = {"review": 12 * theme.SPACING, "comment": 24 * theme.SPACING}
"""Least widths of the columns that are still to be filled, in pixels."""
DECISIONS = {
    ReviewState.ACCEPTED: mark("Accept"),
    ReviewState.REJECTED: mark("Reject"),
    ReviewState.OPEN: mark("Leave open"),
}

FILTERS = {
    "kind": (mark("Show only deformations of one kind"), mark("All kinds")),
    "verdict": (mark("Show only deformations of one verdict"), mark("All verdicts")),
    "review": (mark("Show only deformations of one review"), mark("Any review")),
}
"""Tip of each filter by a choice, and what stands for everything."""
FILTER_NAMES = {
    "kind": mark("Filter by kind"),
    "verdict": mark("Filter by verdict"),
    "review": mark("Filter by review"),
}


class DeformationTable(QWidget):
    """Shows the deformations; choosing, reviewing and commenting are told as signals."""

    chosen = Signal(int)
    """Id of the deformation that the user selected."""
    reviewed = Signal(list, object)
    """Ids of deformations and what was decided, a `ReviewState`."""
    commented = Signal(int, str)
    columns_changed = Signal(list)
    """Keys of the columns that are shown, in their order."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._state = TableState()
        self._applying = Applying()
        self.model = DeformationModel(self)
        self.model.reviewed.connect(lambda i, state: self.reviewed.emit([i], state))
        self.model.commented.connect(self.commented)
        self.proxy = DeformationFilter(self)
        self.proxy.setSourceModel(self.model)
        self.view = self._make_view()
        self.menu = self._make_menu()
        self.show_columns(SHOWN_FIRST)
        self._make_filters()
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
        header = view.horizontalHeader()
        header.setHighlightSections(False)
        header.setStretchLastSection(True)
        header.setSectionsMovable(True)
        header.setToolTip(tr("Click: sort. Drag: move. Right click: choose columns"))
        # No column: the model's own order, which is by verdict, the deepest first.
        header.setSortIndicator(-1, Qt.SortOrder.AscendingOrder)
        header.setSortIndicatorClearable(True)
        header.setContextMenuPolicy(Qt.ContextMenuPolicy.CustomContextMenu)
        header.customContextMenuRequested.connect(
            lambda at: self.column_menu.popup(header.mapToGlobal(at))
        )
        header.sectionMoved.connect(self._tell_columns)
        view.setSortingEnabled(True)
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
            action = self.decisions[state] = menu.addAction(
                theme.icon(REVIEW_ICON[state]), tr(text)
            )
            action.triggered.connect(lambda _=False, state=state: self._decide(state))
        menu.addSeparator()
        self._add_keyed(menu, tr("Copy rows"), QKeySequence.StandardKey.Copy, self.copy)
        every = QKeySequence.StandardKey.SelectAll
        self._add_keyed(menu, tr("Select all"), every, self.view.selectAll)
        menu.addSeparator()
        self.column_menu = QMenu(tr("Columns"), self)
        self.column_actions: dict[str, QAction] = {}
        for column in COLUMNS:
            title = tr("Number") if column.title == "#" else tr(column.title)
            action = self.column_actions[column.key] = self.column_menu.addAction(title)
            action.setCheckable(True)
            action.toggled.connect(lambda on, key=column.key: self._show_column(key, on))
        self.column_menu.addSeparator()
        self.column_menu.addAction(tr("As at first"), self._reset_columns)
        menu.addMenu(self.column_menu)
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

    def _make_filters(self) -> None:
        self.kind = self._filter_choice("kind", [(tr(k), k, None) for k in DeformationKind])
        verdicts = [(tr(v), v, theme.verdict_icon(v)) for v in Verdict]
        self.verdict = self._filter_choice("verdict", verdicts)
        states = [(tr(s), s, theme.icon(REVIEW_ICON[s])) for s in ReviewState]
        self.state = self._filter_choice("review", states)
        self.min_depth = QuietSpinBox()
        self.min_depth.setAccessibleName(tr("Filter by depth"))
        self.min_depth.setToolTip(tr("Hide what is shallower"))
        self.min_depth.setRange(0, 1000)
        self.min_depth.setPrefix("≥ ")
        self.min_depth.setSuffix(" mm")
        self.min_depth.setSpecialValueText(tr("any depth"))
        self.min_depth.valueChanged.connect(self._filter)
        self.counts = QLabel()
        self.counts.setProperty("muted", True)

    def _filter_choice(self, what: str, choices: Sequence[tuple[str, Any, Any]]) -> QuietComboBox:
        tip, every = map(tr, FILTERS[what])
        combo = QuietComboBox()
        combo.setAccessibleName(tr(FILTER_NAMES[what]))
        combo.setToolTip(tip)
        combo.addItem(every, None)
        for text, value, icon in choices:
            if icon is None:
                combo.addItem(text, value)
            else:
                combo.addItem(icon, text, value)
        combo.currentIndexChanged.connect(self._filter)
        return combo

    def _lay_out(self) -> None:
        filters = QHBoxLayout()
        filters.setContentsMargins(theme.SPACING, theme.SPACING // 2, theme.SPACING, 4)
        filters.setSpacing(theme.SPACING)
        for widget in (self.kind, self.verdict, self.state, self.min_depth):
            filters.addWidget(widget)
        filters.addStretch()
        filters.addWidget(self.counts)
        table = QWidget()
        column = QVBoxLayout(table)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        column.addLayout(filters)
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
                self._fit_columns()
            elif state.reviews != before.reviews:
                self.model.set_reviews(state.reviews)
            if is_new or state.selected != before.selected:
                self._show_selected()
        self._stack.setCurrentWidget(self._table if self.model.rowCount() else self._empty)
        found = tr("No deformations found: every pipe keeps its shape.")
        self._empty.setText(found if state.result is not None else tr(WAITING))
        self._count()

    def changeEvent(self, event: QEvent) -> None:  # noqa: N802
        """Draw the icons in the colours of a new scheme."""
        if event.type() == QEvent.Type.PaletteChange:
            for state, action in self.decisions.items():
                action.setIcon(theme.icon(REVIEW_ICON[state]))
                row = self.state.findData(state)
                self.state.setItemIcon(row, theme.icon(REVIEW_ICON[state]))
        super().changeEvent(event)

    def _show_selected(self) -> None:
        row = self.model.row_of(self._state.selected)
        index = self.proxy.mapFromSource(self.model.index(row, 0)) if row >= 0 else QModelIndex()
        selection = self.view.selectionModel()
        flags = QItemSelectionModel.SelectionFlag
        current = self.view.currentIndex()
        if index.isValid():
            if current.row() == index.row() and selection.isRowSelected(index.row()):
                return  # the cell that the user is in stays current, and others selected
            index = index.siblingAtColumn(max(current.column(), self._first_column()))
            selection.setCurrentIndex(index, flags.ClearAndSelect | flags.Rows)
            self.view.scrollTo(index)
        else:
            selection.clear()

    # Columns

    @property
    def shown_columns(self) -> list[str]:
        """Keys of the columns that are shown, in their order."""
        header = self.view.horizontalHeader()
        order = [header.logicalIndex(i) for i in range(header.count())]
        return [COLUMNS[i].key for i in order if not header.isSectionHidden(i)]

    def show_columns(self, keys: Sequence[str]) -> None:
        """Show these columns in this order; unknown ones are passed over."""
        known = [key for key in dict.fromkeys(keys) if key in INDEX] or list(SHOWN_FIRST)
        header = self.view.horizontalHeader()
        order = list(known)
        for i, column in enumerate(COLUMNS):
            if column.key not in order:  # hidden ones wait beside their neighbours
                order.insert(order.index(COLUMNS[i - 1].key) + 1 if i else 0, column.key)
        with self._applying:
            for place, key in enumerate(order):
                header.moveSection(header.visualIndex(INDEX[key]), place)
            for key, column in INDEX.items():
                header.setSectionHidden(column, key not in known)
                self.column_actions[key].setChecked(key in known)
            self._fit_columns()

    def _show_column(self, key: str, shown: bool) -> None:
        if self._applying:
            return
        self.view.setColumnHidden(INDEX[key], not shown)
        if not self.shown_columns:  # a table without columns could not be mended
            self.column_actions[key].setChecked(True)
            return
        self.view.resizeColumnToContents(INDEX[key])
        self._tell_columns()

    def _reset_columns(self) -> None:
        self.show_columns(SHOWN_FIRST)
        self._tell_columns()

    def _tell_columns(self, *_: object) -> None:
        if not self._applying:
            self.columns_changed.emit(self.shown_columns)

    def _first_column(self) -> int:
        return INDEX[self.shown_columns[0]]

    def _fit_columns(self) -> None:
        self.view.resizeColumnsToContents()
        for key, width in ROOM.items():
            column = INDEX[key]
            self.view.setColumnWidth(column, max(self.view.columnWidth(column), width))

    # Filtering

    def _filter(self) -> None:
        with self._applying:
            self.proxy.set_filter(
                self.kind.currentData(),
                self.verdict.currentData(),
                self.min_depth.value(),
                self.state.currentData(),
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
        parts += describe.to_do(verdicts)
        n_open = sum(self.model.review(r).state is ReviewState.OPEN for r in rows)
        if n_open < len(rows):
            parts.append(tr("{n} open").format(n=n_open))
        self.counts.setText(" · ".join(parts))

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
        keys = self.shown_columns
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
