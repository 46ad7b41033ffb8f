"""The deformations as a table model, and the proxy that sorts and filters it."""

from collections.abc import Mapping
from dataclasses import replace
from math import isnan
from typing import Any

from PySide6.QtCore import (
    QAbstractTableModel,
    QModelIndex,
    QObject,
    QPersistentModelIndex,
    QSortFilterProxyModel,
    Qt,
    Signal,
)

from pipecore.formatting import NOT_MEASURABLE
from pipecore.report.summary import by_verdict
from pipecore.types import Deformation, DeformationKind, Result, Review, ReviewState, Verdict
from pipegui.i18n.texts import tr
from pipegui.panels.deformation_columns import COLUMNS, INDEX, Row
from pipegui.states.verdict_texts import why_text
from pipegui.style import theme

Index = QModelIndex | QPersistentModelIndex
Role = Qt.ItemDataRole
VERDICT_COLUMN, REVIEW_COLUMN, COMMENT_COLUMN = (INDEX[k] for k in ("verdict", "review", "comment"))
REVIEW_ICON = {
    ReviewState.OPEN: "circle-outline",
    ReviewState.ACCEPTED: "check",
    ReviewState.REJECTED: "close-thick",
}


class DeformationModel(QAbstractTableModel):
    """The deformations of a result, the worst first; edits are signalled."""

    reviewed = Signal(int, object)
    """Id of the deformation and its `ReviewState`."""
    commented = Signal(int, str)

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._rows: list[Row] = []

    def set_result(self, result: Result | None, reviews: Mapping[int, Review] = {}) -> None:
        """Show the deformations of a result."""
        self.beginResetModel()
        self._rows = (
            [Row(d, result.element(d.element_id), result) for d in by_verdict(result)]
            if result
            else []
        )
        self._review(reviews)
        self.endResetModel()

    def set_reviews(self, reviews: Mapping[int, Review]) -> None:
        """Show what a person said of the deformations."""
        self._review(reviews)
        if self._rows:
            first = self.index(0, REVIEW_COLUMN)
            self.dataChanged.emit(first, self.index(len(self._rows) - 1, COMMENT_COLUMN))

    def _review(self, reviews: Mapping[int, Review]) -> None:
        self._rows = [
            replace(row, review=reviews.get(row.deformation.deformation_id, Review()))
            for row in self._rows
        ]

    def deformation(self, row: int) -> Deformation:
        """Return the deformation in a row."""
        return self._rows[row].deformation

    def review(self, row: int) -> Review:
        """Return what a person said of the deformation in a row."""
        return self._rows[row].review

    def row_of(self, deformation_id: int) -> int:
        """Return the row of a deformation, -1 if it has none."""
        rows = enumerate(self._rows)
        return next((i for i, r in rows if r.deformation.deformation_id == deformation_id), -1)

    def plain(self, row: int, column: int) -> str:
        """Return a cell as it is copied."""
        return COLUMNS[column].plain(self._rows[row])

    def rowCount(self, parent: Index = QModelIndex()) -> int:  # noqa: B008, N802
        """Return the number of deformations."""
        return 0 if parent.isValid() else len(self._rows)

    def columnCount(self, parent: Index = QModelIndex()) -> int:  # noqa: B008, N802
        """Return the number of columns."""
        return 0 if parent.isValid() else len(COLUMNS)

    def headerData(  # noqa: N802
        self, section: int, orientation: Qt.Orientation, role: int = Role.DisplayRole
    ) -> Any:
        """Return a column's title or explanation."""
        if orientation is not Qt.Orientation.Horizontal:
            return None
        match role:
            case Role.DisplayRole:
                return tr(COLUMNS[section].title)
            case Role.ToolTipRole:
                return tr(COLUMNS[section].hint) or None
            case Role.TextAlignmentRole:
                return self._alignment(section)
        return None

    def _alignment(self, column: int) -> Qt.AlignmentFlag:
        is_text = COLUMNS[column].is_text
        side = Qt.AlignmentFlag.AlignLeft if is_text else Qt.AlignmentFlag.AlignRight
        return side | Qt.AlignmentFlag.AlignVCenter

    def flags(self, index: Index) -> Qt.ItemFlag:
        """Let review and comment be edited."""
        flags = super().flags(index)
        if index.isValid() and index.column() in (REVIEW_COLUMN, COMMENT_COLUMN):
            flags |= Qt.ItemFlag.ItemIsEditable
        return flags

    def data(self, index: Index, role: int = Role.DisplayRole) -> Any:
        """Return what is shown of a cell."""
        if not index.isValid():
            return None
        row, column = self._rows[index.row()], COLUMNS[index.column()]
        text = column.text(row)
        value: Any = None
        match role:
            case Role.DisplayRole | Role.EditRole:
                value = text
            case Role.TextAlignmentRole:
                value = self._alignment(index.column())
            case Role.DecorationRole:
                value = self._icon(row, index.column())
            case Role.ForegroundRole if text == tr(NOT_MEASURABLE) or self._is_faint(row, index):
                value = theme.colour("muted")
            case Role.ToolTipRole:
                value = self._hint(row, index.column(), text)
        return value

    def _icon(self, row: Row, column: int) -> Any:
        if column == VERDICT_COLUMN:
            return theme.verdict_icon(row.deformation.verdict)
        if column == REVIEW_COLUMN:
            is_open = row.review.state is ReviewState.OPEN
            return theme.icon(REVIEW_ICON[row.review.state], "muted" if is_open else "")
        return None

    def _is_faint(self, row: Row, index: Index) -> bool:
        return index.column() == REVIEW_COLUMN and row.review.state is ReviewState.OPEN

    def _hint(self, row: Row, column: int, text: str) -> str | None:
        if text == tr(NOT_MEASURABLE):
            return COLUMNS[column].why_not(row)
        if column == VERDICT_COLUMN and row.deformation.rule:
            return why_text(row.deformation)
        return tr(COLUMNS[column].hint) or (text if column == COMMENT_COLUMN else None)

    def setData(self, index: Index, value: Any, role: int = Role.EditRole) -> bool:  # noqa: N802
        """Signal what a person decided or wrote; the cell shows it once the document holds it."""
        if role != Role.EditRole or not self.flags(index) & Qt.ItemFlag.ItemIsEditable:
            return False
        row = self._rows[index.row()]
        deformation_id = row.deformation.deformation_id
        if index.column() == COMMENT_COLUMN and str(value).strip() != row.review.comment:
            self.commented.emit(deformation_id, str(value))
        elif index.column() == REVIEW_COLUMN and ReviewState(value) is not row.review.state:
            self.reviewed.emit(deformation_id, ReviewState(value))
        return True

    def sort_key(self, row: int, column: int) -> Any:
        """Return what a cell is sorted by."""
        return COLUMNS[column].sort_key(self._rows[row])


class DeformationFilter(QSortFilterProxyModel):
    """Sorts by value and leaves out what the user does not want to see."""

    def __init__(self, model: DeformationModel, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._model = model
        self.setSourceModel(model)
        self.kind: DeformationKind | None = None
        self.verdict: Verdict | None = None
        self.min_depth_mm = 0.0
        self.state: ReviewState | None = None

    def set_filter(
        self,
        kind: DeformationKind | None,
        verdict: Verdict | None,
        min_depth_mm: float,
        state: ReviewState | None = None,
    ) -> None:
        """Show only what is of this kind, verdict and state (None: any), at least this deep."""
        self.kind, self.verdict, self.min_depth_mm = kind, verdict, min_depth_mm
        self.state = state
        self.invalidate()

    def filterAcceptsRow(self, source_row: int, source_parent: Index) -> bool:  # noqa: N802
        """Return whether a deformation is shown."""
        deformation = self._model.deformation(source_row)
        return (
            self.kind in (None, deformation.kind)
            and self.verdict in (None, deformation.verdict)
            and self.state in (None, self._model.review(source_row).state)
            # Without a depth a deformation is rather shown than overlooked.
            and not bool(1000 * deformation.depth < self.min_depth_mm)
        )

    def lessThan(self, left: Index, right: Index) -> bool:  # noqa: N802
        """Compare values, not texts; what is not measurable comes last."""
        a = self._model.sort_key(left.row(), left.column())
        b = self._model.sort_key(right.row(), right.column())
        if isinstance(a, float) and isinstance(b, float) and (isnan(a) or isnan(b)):
            return not isnan(a)
        return bool(a < b)  # numpy's own bool crashes Qt
