"""``report.html``: the result on one page that needs no other file, to read and to print."""

from collections.abc import Iterator, Sequence
from datetime import datetime
from typing import Any

import jinja2
import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

import pipecore
from pipecore._kernels.grouping import group_by_label
from pipecore.allocation import BLOCK
from pipecore.formatting import (
    NOT_MEASURABLE,
    format_clock,
    format_count,
    format_measure,
)
from pipecore.geometry import ArcAxis
from pipecore.progress import NoProgress, Progress
from pipecore.report.page_tables import PageColumn
from pipecore.report.station_page import stations_of_page
from pipecore.report.summary import VERDICT_ORDER, by_verdict, summarise
from pipecore.report.world import FileCoordinates
from pipecore.resources import resource
from pipecore.rules import (
    Rule,
    dent_limit,
    depth_pct_od,
    load_rules,
    ovality_sd,
    verdict_words,
)
from pipecore.settings import FieldSpec, Settings, choices_of, iterate_fields
from pipecore.types import (
    KIND_LABELS,
    Deformation,
    DeformationKind,
    Element,
    ElementKind,
    PointCloud,
    Result,
)

POINTS_AT_ONCE = 10_000_000
"""Points of elements whose rows are held at a time."""


def render_html(cloud: PointCloud, result: Result, progress: Progress | None = None) -> str:
    """Return the report as one HTML page.

    Raises
    ------
    SettingsError
        If the settings' acceptance rule is no longer there.
    """
    rules = load_rules(result.settings.deformation.rule)
    place = FileCoordinates.of(result)
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(resource("report")),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
    )
    settings = [_setting_row(key, spec, result.settings) for key, spec in iterate_fields()]
    return environment.get_template("report.html.j2").render(
        source=_source(result),
        summary=summarise(result),
        facts=_facts(cloud, result, rules),
        not_measurable=NOT_MEASURABLE,
        deformations=_deformation_table(result, place),
        figures=_figures(cloud, result, place, progress or NoProgress()),
        blind_spot=_blind_spot(result, rules),
        elements=_element_table(result),
        candidates=_candidate_table(result, place),
        n_more_candidates=result.n_more_candidates,
        stations=stations_of_page(result),
        notes=[str(note) for note in result.notes if note not in cloud.notes],
        has_strain=any(np.isfinite(d.strain) for d in result.deformations),
        wall_thickness=f"{result.settings.deformation.wall_thickness_mm:g} mm",
        rules=rules,
        settings=settings,
        has_changes=any(s["is_changed"] for s in settings),
        made_by=f"PipeGUI {pipecore.__version__} · all tables beside this page as CSV",
    )


def _source(result: Result) -> str:
    return result.source.name if result.source else "the scan"


def _facts(cloud: PointCloud, result: Result, rules: Sequence[Rule]) -> list[tuple[str, str]]:
    unit = result.file_unit
    # An axis at a time: ten times as fast as all three along the rows.
    extent = [float(cloud.xyz[:, i].max()) - float(cloud.xyz[:, i].min()) for i in range(3)]
    on_elements = np.count_nonzero(result.element_id)
    facts = [
        ("Date", f"{datetime.now().astimezone():%Y-%m-%d %H:%M %Z}"),
        (
            "Points",
            f"{result.n_cloud_points:,}, of them {on_elements / len(cloud):.0%} on elements",
        ),
        ("Extent", " × ".join(f"{d:.1f}" for d in extent) + " m"),
        ("Coordinates", f"{cloud.crs or 'reference system not known'}, in {unit}"),
        ("Acceptance rule", "; ".join(f"{rule.title} ({rule.citation})" for rule in rules)),
    ]
    facts += [("Note on the file", str(note)) for note in result.notes]
    facts += [("Detected again", text) for text in _own_settings(result)]
    if result.seconds:
        facts.append(("Time taken", f"{sum(result.seconds.values()):.0f} s"))
    return facts


def _own_settings(result: Result) -> Iterator[str]:
    """Elements that were detected again, with the settings in which they differ."""
    for settings in dict.fromkeys(result.own_settings.values()):
        own = (e for e in result.elements if result.settings_of(e.element_id) == settings)
        rows = (
            _setting_row(key, spec, settings)
            for key, spec in iterate_fields()
            if settings.get(key) != result.settings.get(key)
        )
        values = "; ".join(f"{row['label']}: {row['value']}" for row in rows)
        yield f"{_listed([e.label for e in own])} ({values})"


def _deformation_table(result: Result, place: FileCoordinates) -> dict[str, Any]:
    columns = [
        PageColumn("#"),
        PageColumn("Element", numeric=False),
        PageColumn("Kind", numeric=False),
        PageColumn("Verdict", numeric=False),
        PageColumn("Depth (mm)"),
        PageColumn("% OD"),
        PageColumn("Ovality (%)"),
        PageColumn("Chainage (m)"),
        PageColumn("Clock"),
        PageColumn("Length × width (mm)"),
        PageColumn(f"Position x, y, z ({place.unit})"),
        PageColumn("Seen by", numeric=False),
        PageColumn("Remarks", numeric=False),
    ]
    has_strain = any(np.isfinite(d.strain) for d in result.deformations)
    if has_strain:
        columns.append(PageColumn("Strain (%), indicative"))
    rows = []
    for d in by_verdict(result):
        element = result.element(d.element_id)
        row = [
            str(d.deformation_id),
            element.label,
            d.kind,
            verdict_words(d),
            format_measure(1000 * d.depth, 1000 * d.depth_sd),
            _depth_pct_od(d, element),
            _ovality(d),
            format_measure(d.chainage, decimals=2),
            format_clock(d.clock),
            f"{_whole_mm(d.length)} × {_whole_mm(d.width)}",
            place.display(d.peak),
            ", ".join(d.seen_by),
            "; ".join(_remarks(d, result)),
        ]
        rows.append(row + ([_number_or_blank(100 * d.strain)] if has_strain else []))
    return {"columns": columns, "rows": rows}


def _remarks(d: Deformation, result: Result) -> list[str]:
    """How it lies to fittings and other dents, and why something could not be measured."""
    remarks = [str(d.verdict_reason)] if d.verdict_reason else []
    if d.fitting_id == d.element_id:
        remarks.append("on a fitting")
    elif d.fitting_id:
        fitting = result.element(d.fitting_id).label
        remarks.append(f"{d.fitting_distance:.2f} m to {fitting}")
    if d.next_id:
        relation = "interacts with" if d.interacts else "next dent:"
        remarks.append(f"{relation} {d.next_id}, {_whole_mm(d.next_distance)} mm away")
    wanted = {name: why for name, why in d.not_measurable.items() if name != "strain"}
    if result.settings.deformation.wall_thickness_mm > 0:
        wanted = dict(d.not_measurable)
    if d.kind is DeformationKind.BULGE and "depth" in wanted:
        wanted["height"] = wanted.pop("depth")
    return remarks + [f"{name} {NOT_MEASURABLE}: {why}" for name, why in wanted.items()]


def _depth_pct_od(d: Deformation, element: Element) -> str:
    value, sd = depth_pct_od(d, element)
    return format_measure(value, sd) if np.isfinite(value) else ""


def _ovality(d: Deformation) -> str:
    if d.kind is not DeformationKind.OVALITY:
        return _number_or_blank(100 * d.ovality)
    return format_measure(100 * d.ovality, 100 * ovality_sd(d))


def _number_or_blank(value: float) -> str:
    return format_measure(value) if np.isfinite(value) else ""


def _whole_mm(metres: float) -> str:
    return f"{1000 * metres:.0f}" if np.isfinite(metres) else "?"


def _element_table(result: Result) -> dict[str, Any]:
    columns = [
        PageColumn("Element", numeric=False),
        PageColumn("Run"),
        PageColumn("Verdict", numeric=False),
        PageColumn("Nominal size", numeric=False),
        PageColumn("Radius (mm)"),
        PageColumn("Bend (mm, °)"),
        PageColumn("Length (m)"),
        PageColumn("Arc seen (°)"),
        PageColumn("Residual (mm)"),
        PageColumn("Ovality (%)"),
        PageColumn("Straightness (mm)"),
        PageColumn("Not measured", numeric=False),
    ]
    worst = {
        e.element_id: min(
            (VERDICT_ORDER.index(d.verdict) for d in result.deformations_of(e.element_id)),
            default=len(VERDICT_ORDER),
        )
        for e in result.elements
    }
    rows = []
    for e in sorted(result.elements, key=lambda e: (worst[e.element_id], e.element_id)):
        rank = worst[e.element_id]
        radius = format_measure(1000 * e.radius, 1000 * e.radius_sd)
        if e.kind is ElementKind.CONE:
            radius += f" → {format_measure(1000 * e.radius_end)}"
        rows.append(
            [
                e.label,
                result.run_names.get(e.run_id, str(e.run_id)),
                VERDICT_ORDER[rank] if rank < len(VERDICT_ORDER) else "",
                _sizes(e),
                radius,
                _bend(e),
                format_measure(e.axis.length, decimals=2),
                f"{np.rad2deg(e.arc):.0f}",
                format_measure(1000 * e.rms),
                _value_or_reason(e, "ovality", format_measure(100 * e.ovality, 100 * e.ovality_sd)),
                _value_or_reason(e, "straightness", _number_or_blank(1000 * e.straightness)),
                e.not_measurable.get("profiles", ""),
            ]
        )
    return {"columns": columns, "rows": rows}


def _candidate_table(result: Result, place: FileCoordinates) -> dict[str, Any]:
    columns = [
        PageColumn("#"),
        PageColumn("Looked like", numeric=False),
        PageColumn("Radius (mm)"),
        PageColumn("Length (m)"),
        PageColumn("Arc seen (°)"),
        PageColumn(f"Position x, y, z ({place.unit})"),
        PageColumn("Why it was not accepted", numeric=False),
    ]
    rows = [
        [
            str(c.candidate_id),
            KIND_LABELS[c.kind],
            format_measure(1000 * c.radius, 1000 * c.radius_sd),
            format_measure(c.axis.length, decimals=2),
            f"{np.rad2deg(c.arc):.0f}",
            place.display(c.axis.at(c.axis.length / 2)),
            str(c.reason),
        ]
        for c in result.candidates
    ]
    return {"columns": columns, "rows": rows}


def _sizes(element: Element) -> str:
    """The nominal size, of a cone both, with the size that it may be besides."""
    names = [n.name for n in (element.nominal, element.nominal_end) if n is not None]
    text = " → ".join(names)
    other = element.other_nominal
    if other is not None:
        text += (
            f" ({'or ' if text else 'perhaps '}{other.name}: {1e3 * other.outside_diameter:g} mm)"
        )
    return text + (" clad" if element.is_clad else "")


def _value_or_reason(element: Element, name: str, value: str) -> str:
    why = element.not_measurable.get(name)
    return f"{NOT_MEASURABLE}: {why}" if why else value


def _bend(element: Element) -> str:
    axis = element.axis
    if not isinstance(axis, ArcAxis):
        return ""
    return f"{1000 * axis.bend_radius:.0f}, {np.rad2deg(axis.bend_angle):.1f}"


def _figures(
    cloud: PointCloud, result: Result, place: FileCoordinates, progress: Progress
) -> list[dict[str, Any]]:
    ordered = by_verdict(result)
    if not ordered:
        return []
    # The plot library takes a while to import: only where something is drawn.
    from pipecore.report.figures import draw_deformation  # noqa: PLC0415

    figures: dict[int, dict[str, Any]] = {}
    for element_ids in _portions(result, {d.element_id for d in ordered}):
        rows = _rows_of_elements(result, element_ids)
        for place_in_report, d in enumerate(ordered):
            if d.element_id not in rows:
                continue
            progress.update("drawing figures", len(figures) / len(ordered))
            element = result.element(d.element_id)
            figures[place_in_report] = {
                "title": f"{d.kind.capitalize()} {d.deformation_id} on {element.label}",
                "text": " · ".join(_where(d, place)),
                "verdict": d.verdict,
                "verdict_words": verdict_words(d),
                "svg": Markup(draw_deformation(d, cloud, result, rows[d.element_id])),
            }
    progress.update("drawing figures", 1.0)
    return [figures[k] for k in range(len(ordered))]


def _portions(result: Result, element_ids: set[int]) -> Iterator[set[int]]:
    """Elements in groups of together at most `POINTS_AT_ONCE` points, or of a single one."""
    portion: set[int] = set()
    n_points = 0
    for i in sorted(element_ids):
        own = result.element(i).n_points
        if portion and n_points + own > POINTS_AT_ONCE:
            yield portion
            portion, n_points = set(), 0
        portion.add(i)
        n_points += own
    yield portion


def _rows_of_elements(result: Result, element_ids: set[int]) -> dict[int, NDArray[np.intp]]:
    """Rows of the points of some elements, found in one pass over the cloud."""
    # Ids of elements that were deleted leave gaps.
    is_wanted = np.zeros(max(e.element_id for e in result.elements) + 1, np.bool_)
    is_wanted[list(element_ids)] = True
    n = len(result.element_id)
    rows = np.concatenate(
        [
            start + np.flatnonzero(is_wanted[result.element_id[start : start + BLOCK]])
            for start in range(0, max(n, 1), BLOCK)
        ]
    )
    owner = result.element_id[rows]
    members, starts = group_by_label(owner, len(is_wanted))
    return {i: rows[members[starts[i] : starts[i + 1]]] for i in element_ids}


def _where(d: Deformation, place: FileCoordinates) -> list[str]:
    """What stands beside a figure's title: how deep, and where."""
    parts = [
        format_measure(1000 * d.depth, 1000 * d.depth_sd, "mm"),
        f"chainage {d.chainage:.2f} m",
    ]
    if np.isfinite(d.clock):
        parts.append(f"{format_clock(d.clock)} o’clock")
    if np.isfinite(d.area) and np.isfinite(d.volume):
        parts.append(f"{1e4 * d.area:.0f} cm², {1e6 * d.volume:.0f} cm³")
    return [*parts, place.display(d.peak)]


def _blind_spot(result: Result, rules: Sequence[Rule]) -> str:
    """Say where the rule asks for more than was looked for."""
    smallest = result.settings.deformation.min_depth_mm / 1000
    limits = [(e, dent_limit(e, rules)) for e in result.elements]
    small = [e for e, limit in limits if limit is not None and limit.depth < smallest]
    if not small:
        return ""
    return (
        f"On {format_count(len(small), 'element')} the rule’s limit for dents lies below the "
        f"smallest depth that was looked for ({1000 * smallest:g} mm): "
        f"{_listed([e.label for e in small])}. That none is listed there does not clear them."
    )


def _listed(labels: Sequence[str], most: int = 12) -> str:
    more = len(labels) - most
    return ", ".join(labels[:most]) + (f" and {more} more" if more > 0 else "")


def _setting_row(key: str, spec: FieldSpec, settings: Settings) -> dict[str, Any]:
    value = settings.get(key)
    if value == 0 and spec.zero_means:
        text = spec.zero_means
    elif choices_of(spec.kind) is not None:
        text = ", ".join(value)
    elif isinstance(value, tuple):
        text = "; ".join(",".join(f"{c:g}" for c in vector) for vector in value) or "none"
    else:
        text = f"{value:g}" if isinstance(value, float) else str(value)
        text += f" {spec.unit}" if spec.unit else ""
    return {
        "label": spec.label,
        "value": text,
        "help": spec.help,
        "is_changed": value != spec.default,
    }
