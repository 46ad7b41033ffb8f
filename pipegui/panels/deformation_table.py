"""The deformation panel: table, filters, copying."""

from collections import Counter

from PySide6.QtCore import QItemSelectionModel, QModelIndex, Qt, Signal
from PySide6.QtGui import QAction, QGuiApplication, QKeySequence
from PySide6.QtWidgets import (
    QAbstractItemView,
    QHBoxLayout,
    QLabel,
    QStackedLayout,
    QTableView,
    QVBoxLayout,
    QWidget,
)

from pipecore.types import DeformationKind, Verdict
from pipegui import theme
from pipegui.panels.deformation_model import COLUMNS, DeformationFilter, DeformationModel
from pipegui.panels.widgets import Applying, EmptyHint, QuietComboBox, QuietSpinBox
from pipegui.view_state import TableState


class DeformationTable(QWidget):
    """Shows the deformations; choosing a row is told as a signal."""

    chosen = Signal(int)
    """Id of the deformation that the user selected."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._state = TableState()
        self._applying = Applying()
        self.model = DeformationModel(self)
        self.proxy = DeformationFilter(self)
        self.proxy.setSourceModel(self.model)
        self.view = self._make_view()
        self.kind = QuietComboBox()
        self.kind.setAccessibleName("Filter by kind")
        self.kind.addItem("All kinds", None)
        for kind in DeformationKind:
            self.kind.addItem(str(kind), kind)
        self.verdict = QuietComboBox()
        self.verdict.setAccessibleName("Filter by verdict")
        self.verdict.addItem("All verdicts", None)
        for verdict in Verdict:
            self.verdict.addItem(theme.verdict_icon(verdict), str(verdict), verdict)
        self.min_depth = QuietSpinBox()
        self.min_depth.setAccessibleName("Filter by depth")
        self.min_depth.setRange(0, 1000)
        self.min_depth.setPrefix("≥ ")
        self.min_depth.setSuffix(" mm")
        self.min_depth.setSpecialValueText("any depth")
        self.counts = QLabel()
        self.counts.setProperty("muted", True)
        for combo in (self.kind, self.verdict):
            combo.currentIndexChanged.connect(self._filter)
        self.min_depth.valueChanged.connect(self._filter)
        self._empty = EmptyHint("Deformations appear here once a scan has been detected.")
        self._lay_out()
        self.apply(self._state)

    def _make_view(self) -> QTableView:
        view = QTableView()
        view.setAccessibleName("Deformations")
        view.setModel(self.proxy)
        view.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        view.setSelectionMode(QAbstractItemView.SelectionMode.ExtendedSelection)
        view.setShowGrid(False)
        view.setAlternatingRowColors(True)
        view.setWordWrap(False)
        view.setIconSize(theme.icon_size(2))
        view.verticalHeader().hide()
        view.verticalHeader().setDefaultSectionSize(round(3.5 * theme.SPACING))
        view.horizontalHeader().setHighlightSections(False)
        view.horizontalHeader().setStretchLastSection(True)
        # No column: the model's own order, which is by verdict, the deepest first.
        view.horizontalHeader().setSortIndicator(-1, Qt.SortOrder.AscendingOrder)
        view.horizontalHeader().setSortIndicatorClearable(True)
        view.setSortingEnabled(True)
        view.selectionModel().currentRowChanged.connect(self._tell)
        copy = QAction(theme.icon("content-copy"), "Copy rows", view)
        copy.setShortcut(QKeySequence(QKeySequence.StandardKey.Copy))
        copy.setShortcutContext(Qt.ShortcutContext.WidgetShortcut)
        copy.triggered.connect(self.copy)
        view.addAction(copy)
        view.setContextMenuPolicy(Qt.ContextMenuPolicy.ActionsContextMenu)
        return view

    def _lay_out(self) -> None:
        filters = QHBoxLayout()
        filters.setContentsMargins(theme.SPACING, theme.SPACING // 2, theme.SPACING, 4)
        filters.setSpacing(theme.SPACING)
        for widget in (self.kind, self.verdict, self.min_depth):
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
                self.model.set_result(state.result)
                self.view.resizeColumnsToContents()
            if is_new or state.selected != before.selected:
                self._show_selected()
        self._stack.setCurrentWidget(self._table if self.model.rowCount() else self._empty)
        if state.result is not None:
            self._empty.setText("No deformations found: every pipe keeps its shape.")
        else:
            self._empty.setText("Deformations appear here once a scan has been detected.")
        self._count()

    def _show_selected(self) -> None:
        row = self.model.row_of(self._state.selected)
        index = self.proxy.mapFromSource(self.model.index(row, 0)) if row >= 0 else QModelIndex()
        selection = self.view.selectionModel()
        flags = QItemSelectionModel.SelectionFlag
        if index.isValid():
            selection.setCurrentIndex(index, flags.ClearAndSelect | flags.Rows)
            self.view.scrollTo(index)
        else:
            selection.clear()

    def _filter(self) -> None:
        with self._applying:
            self.proxy.set_filter(
                self.kind.currentData(), self.verdict.currentData(), self.min_depth.value()
            )
            self._show_selected()
        self._count()

    def _count(self) -> None:
        rows = [
            self.proxy.mapToSource(self.proxy.index(r, 0)).row()
            for r in range(self.proxy.rowCount())
        ]
        verdicts = Counter(self.model.deformation(r).verdict for r in rows)
        parts = [f"{len(rows)} shown"]
        urgent = (Verdict.REJECT, Verdict.REVIEW)
        parts += [f"{verdicts[verdict]} to {verdict}" for verdict in urgent if verdicts[verdict]]
        self.counts.setText(" · ".join(parts))

    def _tell(self, current: QModelIndex, previous: QModelIndex) -> None:
        if current.isValid() and not self._applying:
            row = self.proxy.mapToSource(current).row()
            self.chosen.emit(self.model.deformation(row).deformation_id)

    def copy(self) -> None:
        """Copy the selected rows (all, if none is) as plain numbers with a header."""
        selected = [i.row() for i in self.view.selectionModel().selectedRows()]
        rows = sorted(selected) or range(self.proxy.rowCount())
        lines = ["\t".join(c.copied_title for c in COLUMNS)]
        for row in rows:
            source = self.proxy.mapToSource(self.proxy.index(row, 0)).row()
            lines.append("\t".join(self.model.plain(source, c) for c in range(len(COLUMNS))))
        QGuiApplication.clipboard().setText("\n".join(lines) + "\n")
