"""The deformations as a table model, and the proxy that sorts and filters it."""

from collections.abc import Callable
from dataclasses import dataclass
from math import isfinite, isnan
from typing import Any

from PySide6.QtCore import (
    QAbstractTableModel,
    QModelIndex,
    QObject,
    QPersistentModelIndex,
    QSortFilterProxyModel,
    Qt,
)

from pipecore.report.format import NOT_MEASURABLE, cell, format_clock, format_measure
from pipecore.report.summary import VERDICT_ORDER, by_verdict
from pipecore.rules import outside_diameter
from pipecore.types import Deformation, DeformationKind, Element, Result, Verdict
from pipegui import theme

Index = QModelIndex | QPersistentModelIndex
Role = Qt.ItemDataRole
SORT_ROLE = int(Role.UserRole)


@dataclass(frozen=True)
class Column:
    """A column: how its cells read, are copied and are sorted."""

    title: str
    copied_title: str
    text: Callable[[Deformation, Element], str]
    plain: Callable[[Deformation, Element], str]
    sort_key: Callable[[Deformation, Element], Any]
    hint: str = ""
    is_text: bool = False


def _number(
    title: str,
    copied_title: str,
    value: Callable[[Deformation, Element], float],
    decimals: int,
    hint: str = "",
) -> Column:
    return Column(
        title,
        copied_title,
        lambda d, e: format_measure(value(d, e), decimals=decimals),
        lambda d, e: cell(value(d, e), decimals),
        value,
        hint,
    )


def _depth_pct(deformation: Deformation, element: Element) -> float:
    return 100 * deformation.depth / outside_diameter(element)


COLUMNS = (
    _number("#", "deformation_id", lambda d, e: d.deformation_id, 0),
    Column(
        "Element",
        "element",
        lambda d, e: e.label,
        lambda d, e: e.label,
        lambda d, e: e.element_id,
        is_text=True,
    ),
    Column(
        "Kind",
        "kind",
        lambda d, e: str(d.kind),
        lambda d, e: str(d.kind),
        lambda d, e: str(d.kind),
        is_text=True,
    ),
    Column(
        "Clock",
        "clock",
        lambda d, e: format_clock(d.clock),
        lambda d, e: format_clock(d.clock),
        lambda d, e: d.clock,
        "Looking along increasing chainage, 12:00 up; on a vertical pipe 12:00 is grid north.",
    ),
    _number("Chainage, m", "chainage_m", lambda d, e: d.chainage, 3, "From the element’s start"),
    Column(
        "Depth, mm",
        "depth_mm",
        lambda d, e: format_measure(1000 * d.depth, 1000 * d.depth_sd),
        lambda d, e: cell(1000 * d.depth, 2),
        lambda d, e: d.depth,
        "Gap to the undented contour, ± one standard deviation",
    ),
    _number("% OD", "depth_pct_od", _depth_pct, 1, "Depth in percent of the outside diameter"),
    _number("Length, mm", "length_mm", lambda d, e: 1000 * d.length, 0, "Along the axis"),
    _number("Width, mm", "width_mm", lambda d, e: 1000 * d.width, 0, "Around the circumference"),
    Column(
        "Ovality, %",
        "ovality_pct",
        # Only ovality has one: elsewhere the cell does not apply, which is not "not measurable".
        lambda d, e: (
            format_measure(100 * d.ovality, decimals=2)
            if d.kind is DeformationKind.OVALITY or isfinite(d.ovality)
            else ""
        ),
        lambda d, e: cell(100 * d.ovality, 2),
        lambda d, e: d.ovality,
        "(Dmax − Dmin) / Dnom",
    ),
    Column(
        "Verdict",
        "verdict",
        lambda d, e: str(d.verdict),
        lambda d, e: str(d.verdict),
        lambda d, e: (VERDICT_ORDER.index(d.verdict), -d.depth),
        is_text=True,
    ),
)
VERDICT_COLUMN = next(i for i, c in enumerate(COLUMNS) if c.title == "Verdict")


class DeformationModel(QAbstractTableModel):
    """The deformations of a result, the worst first."""

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._rows: list[tuple[Deformation, Element]] = []

    def set_result(self, result: Result | None) -> None:
        """Show the deformations of a result."""
        self.beginResetModel()
        self._rows = (
            [(d, result.element(d.element_id)) for d in by_verdict(result)] if result else []
        )
        self.endResetModel()

    def deformation(self, row: int) -> Deformation:
        """Return the deformation in a row."""
        return self._rows[row][0]

    def row_of(self, deformation_id: int) -> int:
        """Return the row of a deformation, -1 if it has none."""
        return next(
            (i for i, (d, _) in enumerate(self._rows) if d.deformation_id == deformation_id), -1
        )

    def plain(self, row: int, column: int) -> str:
        """Return a cell as it is copied."""
        return COLUMNS[column].plain(*self._rows[row])

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
                return COLUMNS[section].title
            case Role.ToolTipRole:
                return COLUMNS[section].hint or None
            case Role.TextAlignmentRole:
                return self._alignment(section)
        return None

    def _alignment(self, column: int) -> Qt.AlignmentFlag:
        is_text = COLUMNS[column].is_text
        side = Qt.AlignmentFlag.AlignLeft if is_text else Qt.AlignmentFlag.AlignRight
        return side | Qt.AlignmentFlag.AlignVCenter

    def data(self, index: Index, role: int = Role.DisplayRole) -> Any:
        """Return what is shown of a cell."""
        if not index.isValid():
            return None
        deformation, element = self._rows[index.row()]
        column = COLUMNS[index.column()]
        text = column.text(deformation, element)
        is_verdict = index.column() == VERDICT_COLUMN
        value: Any = None
        match role:
            case Role.DisplayRole:
                value = text
            case Role.TextAlignmentRole:
                value = self._alignment(index.column())
            case Role.DecorationRole if is_verdict:
                value = theme.verdict_icon(deformation.verdict)
            case Role.ForegroundRole if text == NOT_MEASURABLE:
                value = theme.colour("muted")
            case Role.ToolTipRole if is_verdict and deformation.rule:
                value = f"By the rule “{deformation.rule}”"
            case Role.ToolTipRole if text == NOT_MEASURABLE:
                value = "The scan does not carry this number: its arc is too short, or too noisy."
        return value

    def sort_key(self, row: int, column: int) -> Any:
        """Return what a cell is sorted by."""
        return COLUMNS[column].sort_key(*self._rows[row])


class DeformationFilter(QSortFilterProxyModel):
    """Sorts by value and leaves out what the user does not want to see."""

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self.kind: DeformationKind | None = None
        self.verdict: Verdict | None = None
        self.min_depth_mm = 0.0

    def set_filter(
        self, kind: DeformationKind | None, verdict: Verdict | None, min_depth_mm: float
    ) -> None:
        """Show only what is of this kind and verdict (None: any) and at least this deep."""
        self.kind, self.verdict, self.min_depth_mm = kind, verdict, min_depth_mm
        self.invalidate()

    def filterAcceptsRow(self, source_row: int, source_parent: Index) -> bool:  # noqa: N802
        """Whether a deformation is shown."""
        deformation = self.sourceModel().deformation(source_row)
        return (
            self.kind in (None, deformation.kind)
            and self.verdict in (None, deformation.verdict)
            # Without a depth a deformation is rather shown than overlooked.
            and not bool(1000 * deformation.depth < self.min_depth_mm)
        )

    def lessThan(self, left: Index, right: Index) -> bool:  # noqa: N802
        """Compare values, not texts; what is not measurable comes last."""
        model = self.sourceModel()
        a = model.sort_key(left.row(), left.column())
        b = model.sort_key(right.row(), right.column())
        if isinstance(a, float) and isinstance(b, float) and (isnan(a) or isnan(b)):
            return not isnan(a)
        return bool(a < b)  # numpy's own bool crashes Qt
