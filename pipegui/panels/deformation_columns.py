"""The deformation table's columns: how cells read, are copied and sorted. Qt-free."""

from collections.abc import Callable
from dataclasses import dataclass
from math import isfinite
from typing import Any

from pipecore.formatting import (
    cell,
    format_clock,
    format_coordinate,
)
from pipecore.geometry import Array
from pipecore.report.summary import VERDICT_ORDER
from pipecore.rules import depth_pct_od
from pipecore.types import Deformation, Element, Result, Review, ReviewState
from pipegui.i18n.reason_texts import reason_text
from pipegui.i18n.texts import format_measure, label_of, mark, tr
from pipegui.states.verdict_texts import verdict_text

REVIEW_ORDER = tuple(ReviewState)


@dataclass(frozen=True, eq=False)
class Row:
    """What the cells of a row are made of."""

    deformation: Deformation
    element: Element
    result: Result
    review: Review = Review()

    @property
    def peak(self) -> Array:
        """World coordinates of the peak."""
        return self.deformation.peak + self.result.origin


@dataclass(frozen=True)
class TableColumn:
    """A column; `field` is the deformation's field that it shows, if it is one that can be nan."""

    key: str
    title: str
    text: Callable[[Row], str]
    plain: Callable[[Row], str]
    sort_key: Callable[[Row], Any]
    hint: str = ""
    is_text: bool = False
    is_shown_first: bool = True
    field: str = ""

    @property
    def copied_title(self) -> str:
        """What stands above the cells in a spreadsheet, as in the CSV table."""
        return self.key

    def why_not(self, row: Row) -> str:
        """Return why a cell holds no number."""
        default = tr("The scan does not carry this number: its arc is too short, or too noisy.")
        return reason_text(row.deformation.not_measurable.get(self.field, default))


def _number(
    key: str,
    title: str,
    value: Callable[[Row], float],
    decimals: int,
    hint: str = "",
    *,
    field: str = "",
    is_shown_first: bool = True,
) -> TableColumn:
    """Return a column of numbers, empty where the deformation's kind has no such number."""

    def text(row: Row) -> str:
        number = value(row)
        does_apply = isfinite(number) or not field or field in row.deformation.not_measurable
        return format_measure(number, decimals=decimals) if does_apply else ""

    return TableColumn(
        key,
        title,
        text,
        lambda row: cell(value(row), decimals),
        value,
        hint,
        field=field,
        is_shown_first=is_shown_first,
    )


def _text(
    key: str,
    title: str,
    text: Callable[[Row], str],
    sort_key: Callable[[Row], Any] | None = None,
    hint: str = "",
    *,
    plain: Callable[[Row], str] | None = None,
    is_shown_first: bool = True,
) -> TableColumn:
    return TableColumn(
        key,
        title,
        text,
        plain or text,
        sort_key or (lambda row: text(row).casefold()),
        hint,
        is_text=True,
        is_shown_first=is_shown_first,
    )


def _coordinate(key: str, title: str, axis: int) -> TableColumn:
    return TableColumn(
        key,
        title,
        lambda row: format_coordinate(float(row.peak[axis])),
        lambda row: cell(float(row.peak[axis]), 4),
        lambda row: float(row.peak[axis]),
        mark("Of the peak, in the coordinates of the scan"),
        is_shown_first=False,
    )


def _fitting(row: Row) -> str:
    wanted = row.deformation.fitting_id
    fitting = next((e for e in row.result.elements if e.element_id == wanted), None)
    if fitting is None:  # there is none, or it was deleted since
        return ""
    if fitting.element_id == row.element.element_id:
        return tr("on {label}").format(label=label_of(fitting))
    return f"{label_of(fitting)}: {row.deformation.fitting_distance:.2f} m"


def _neighbour(row: Row) -> str:
    if not row.deformation.next_id:
        return ""
    text = f"{row.deformation.next_id}: {row.deformation.next_distance:.2f} m"
    return tr("{text}, interacts").format(text=text) if row.deformation.interacts else text


COLUMNS = (
    _number("deformation_id", "#", lambda r: r.deformation.deformation_id, 0),
    _text(
        "element",
        mark("Element"),
        lambda r: label_of(r.element),
        lambda r: r.element.element_id,
        plain=lambda r: r.element.label,
    ),
    _text(
        "kind", mark("Kind"), lambda r: tr(r.deformation.kind), plain=lambda r: r.deformation.kind
    ),
    TableColumn(
        "clock",
        mark("Clock"),
        lambda r: format_clock(r.deformation.clock),
        lambda r: format_clock(r.deformation.clock),
        lambda r: r.deformation.clock,
        mark(
            "Looking along increasing chainage, 12:00 up; on a vertical pipe 12:00 is grid north."
        ),
    ),
    _number(
        "chainage_m",
        mark("Chainage, m"),
        lambda r: r.deformation.chainage,
        3,
        mark("From the element’s start"),
    ),
    TableColumn(
        "depth_mm",
        mark("Depth, mm"),
        lambda r: format_measure(1000 * r.deformation.depth, 1000 * r.deformation.depth_sd),
        lambda r: cell(1000 * r.deformation.depth, 2),
        lambda r: r.deformation.depth,
        mark("Against the undented contour, ± one standard deviation. Of a bulge: its height."),
        field="depth",
    ),
    _number(
        "depth_pct_od",
        mark("% OD"),
        lambda r: depth_pct_od(r.deformation, r.element)[0],
        1,
        mark("Depth or height in percent of the outside diameter"),
        field="depth",
    ),
    _number(
        "length_mm",
        mark("Length, mm"),
        lambda r: 1000 * r.deformation.length,
        0,
        mark("Along the axis"),
    ),
    _number(
        "width_mm",
        mark("Width, mm"),
        lambda r: 1000 * r.deformation.width,
        0,
        mark("Around the circumference"),
    ),
    _number(
        "ovality_pct",
        mark("Ovality, %"),
        lambda r: 100 * r.deformation.ovality,
        2,
        "(Dmax − Dmin) / Dnom",
        field="ovality",
    ),
    _number(
        "area_cm2",
        mark("Area, cm²"),
        lambda r: 1e4 * r.deformation.area,
        0,
        mark("What a dent or bulge covers of the undented surface"),
        field="area",
        is_shown_first=False,
    ),
    _number(
        "volume_cm3",
        mark("Volume, cm³"),
        lambda r: 1e6 * r.deformation.volume,
        1,
        mark("Between the undented surface and the real one"),
        field="volume",
        is_shown_first=False,
    ),
    _number(
        "strain_pct",
        mark("Strain, %"),
        lambda r: 100 * r.deformation.strain,
        1,
        mark("After ASME B31.8; indicative only. Needs the wall thickness."),
        field="strain",
        is_shown_first=False,
    ),
    _text(
        "seen_by",
        mark("Seen by"),
        lambda r: ", ".join(tr(c) for c in r.deformation.seen_by),
        hint=mark("The criteria that show it: the deviation map, and what profiles show."),
        plain=lambda r: "+".join(r.deformation.seen_by),
        is_shown_first=False,
    ),
    TableColumn(
        "fitting",
        mark("Nearest fitting"),
        _fitting,
        _fitting,
        lambda r: r.deformation.fitting_distance,
        mark("The nearest flange, bend or other fitting, and how far it is along the run"),
        is_text=True,
        is_shown_first=False,
    ),
    TableColumn(
        "next",
        mark("Next dent"),
        _neighbour,
        _neighbour,
        lambda r: r.deformation.next_distance,
        mark(
            "The nearest other dent or bulge of the run. They interact within one outside diameter."
        ),
        is_text=True,
        is_shown_first=False,
    ),
    _coordinate("peak_x", "X (E), m", 0),
    _coordinate("peak_y", "Y (N), m", 1),
    _coordinate("peak_z", "Z (H), m", 2),
    _number(
        "n_points",
        mark("Points"),
        lambda r: r.deformation.n_points,
        0,
        mark("In it"),
        is_shown_first=False,
    ),
    _text(
        "verdict",
        mark("Verdict"),
        lambda r: verdict_text(r.deformation),
        lambda r: (VERDICT_ORDER.index(r.deformation.verdict), -r.deformation.depth),
        plain=lambda r: r.deformation.verdict,
    ),
    _text(
        "rule",
        mark("Rule"),
        lambda r: r.deformation.rule,
        hint=mark("The rule that gave the verdict"),
        is_shown_first=False,
    ),
    _text(
        "review",
        mark("Review"),
        lambda r: tr(r.review.state),
        lambda r: REVIEW_ORDER.index(r.review.state),
        mark("What you decided. Double-click or F2 to change it."),
        plain=lambda r: r.review.state,
    ),
    _text(
        "comment",
        mark("Comment"),
        lambda r: r.review.comment,
        hint=mark("Your own words. Double-click or F2 to write."),
    ),
)
INDEX = {column.key: i for i, column in enumerate(COLUMNS)}
EXPENDABLE = ("width_mm", "length_mm", "ovality_pct", "depth_pct_od", "clock", "deformation_id")
"""Shown at first, but left out of a narrow table, the first first; the properties have them."""
SHOWN_FIRST = tuple(column.key for column in COLUMNS if column.is_shown_first)
