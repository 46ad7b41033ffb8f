"""Texts that describe what is on screen: summaries, properties, hover texts. Qt-free."""

import math
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from pipecore.formatting import (
    NOT_MEASURABLE,
    cell,
    format_clock,
    format_coordinate,
)
from pipecore.geometry import ArcAxis, Array
from pipecore.inspection.section import radius_is_measurable
from pipecore.rules import depth_pct_od
from pipecore.settings import FieldSpec, Settings, choices_of, iterate_fields
from pipecore.types import (
    Candidate,
    Deformation,
    DeformationKind,
    Element,
    ElementKind,
    PointCloud,
    Profiles,
    Result,
    Verdict,
)
from pipegui.i18n.reason_texts import reason_text
from pipegui.i18n.texts import (
    candidate_label,
    count,
    first_capital,
    format_measure,
    label_of,
    mark,
    run_label,
    tr,
)
from pipegui.model.document import Scan, Selection
from pipegui.model.result_queries import stack_name
from pipegui.model.view_commands import extent
from pipegui.states.unit_texts import unit_text
from pipegui.states.verdict_texts import conditions_text, verdict_text, why_text
from pipegui.states.view_state import PropertiesState

OVALITY = "(Dmax − Dmin) / Dnom"
ARC_TOO_SHORT = mark(
    "The scan sees {arc:.0f}° of the circumference: too little to carry this number."
)
INTERACTS = mark("Closer than one outside diameter: judge the two as one.")


@dataclass(frozen=True)
class Property:
    """A line of the properties: what, how much, and what is copied."""

    label: str
    text: str
    plain: str = ""
    hint: str = ""
    verdict: Verdict | None = None

    @property
    def is_measurable(self) -> bool:
        """Whether there is a number."""
        return self.text != tr(NOT_MEASURABLE)


@dataclass(frozen=True)
class Heading:
    """A heading between properties."""

    text: str


def _measure(
    label: str, value_m: float, sd_m: float = math.nan, *, unit: str = "mm", hint: str = ""
) -> Property:
    scale = {"mm": 1000.0, "m": 1.0, "%": 100.0, "°": 180 / math.pi}[unit]
    decimals = {"mm": 1, "m": 3, "%": 2, "°": 0}[unit]
    text = format_measure(scale * value_m, scale * sd_m, unit, decimals=decimals)
    text = text.replace(" °", "°")
    return Property(label, text, cell(scale * value_m, 4), hint)


def point_count(n_points: int) -> str:
    """Return a rounded count of points: "4.3 M points"."""
    if n_points >= 999_950:
        return tr("{n:.1f} M points").format(n=n_points / 1e6)
    if n_points >= 10_000:
        return tr("{n:.0f} k points").format(n=n_points / 1e3)
    return count("{n:,} point", "{n:,} points", n_points)


def deformation_name(deformation: Deformation) -> str:
    """Return the name of a deformation: "Dent 3"."""
    return f"{first_capital(tr(deformation.kind))} {deformation.deformation_id}"


def summary(result: Result) -> str:
    """Return a line such as "23 pipes in 7 runs, 5 deformations, 2 to reject"."""
    if not result.elements:
        return tr("No pipes found")
    n_pipes = sum(e.kind is ElementKind.CYLINDER for e in result.elements)
    n_runs = len({e.run_id for e in result.elements})
    pipes = count("{n:,} pipe", "{n:,} pipes", n_pipes)
    runs = count("{n:,} run", "{n:,} runs", n_runs)
    found = tr("{pipes} in {runs}").format(pipes=pipes, runs=runs)
    n_deformations = len(result.deformations)
    if not n_deformations:
        return tr("{found}, no deformations").format(found=found)
    parts = [found, count("{n:,} deformation", "{n:,} deformations", n_deformations)]
    verdicts = Counter(d.verdict for d in result.deformations)
    return ", ".join([*parts, *to_do(verdicts)])


def to_do(verdicts: Mapping[Verdict, int]) -> Iterator[str]:
    """Yield how many verdicts ask for something: "2 to reject"."""
    texts = {Verdict.REJECT: mark("{n} to reject"), Verdict.REVIEW: mark("{n} to review")}
    for verdict, text in texts.items():
        if verdicts[verdict]:
            yield tr(text).format(n=verdicts[verdict])


def coordinates(cloud: PointCloud, point_index: int) -> str:
    """Return world coordinates of a point: "E 432 105.214  N 6 201 877.530  H 112.031"."""
    return "   ".join(coordinate_lines(cloud, cloud.xyz[point_index]))


def axis_names(cloud: PointCloud) -> str:
    """Return the names of the axes: east, north and height, where the cloud is on a map."""
    return "ENH" if cloud.crs or np.abs(cloud.origin).max() > 1e4 else "XYZ"


def coordinate_lines(cloud: PointCloud, local: Array) -> tuple[str, ...]:
    """Return the world coordinates of a local point, each with its name."""
    named = zip(axis_names(cloud), cloud.world(local), strict=True)
    return tuple(f"{name} {format_coordinate(float(value))}" for name, value in named)


def radius_text(element: Element) -> str:
    """Return the radius with its uncertainty."""
    return format_measure(1000 * element.radius, 1000 * element.radius_sd, "mm")


def title(result: Result | None, selection: Selection) -> str:
    """Return what is selected: "Pipe 2 · dent 1"."""
    if result is None or selection == Selection():
        return ""
    if selection.candidate_id:
        return candidate_label(result.candidate(selection.candidate_id))
    if not selection.element_id:
        return run_label(result, selection.run_id)
    parts = [label_of(result.element(selection.element_id))]
    if selection.deformation_id:
        deformation = result.deformation(selection.deformation_id)
        parts.append(f"{tr(deformation.kind)} {deformation.deformation_id}")
    if selection.profile is not None:
        parts.append(
            tr("profile {profile_index}").format(profile_index=selection.profile.profile_index)
        )
    return " · ".join(parts)


def properties(state: PropertiesState) -> list[Property | Heading]:
    """Return the properties of the selection, the innermost thing first."""
    scan, selection = state.scan, state.selection
    if scan is None:
        return []
    result = scan.result
    if result is None or selection == Selection():
        return list(_of_scan(scan))
    if selection.candidate_id:
        return list(_of_candidate(result.candidate(selection.candidate_id), result))
    if not selection.element_id:
        return list(_of_run(result, selection.run_id))
    lines: list[Property | Heading] = []
    element = result.element(selection.element_id)
    if state.profile is not None:
        lines += [
            Heading(
                tr("Profile {profile_index}").format(
                    profile_index=int(state.profile.profile_index[0])
                )
            )
        ]
        lines += _of_profile(state.profile, result)
    if selection.deformation_id:
        deformation = result.deformation(selection.deformation_id)
        lines += [Heading(deformation_name(deformation))]
        lines += _of_deformation(deformation, element, result)
    return [*lines, Heading(label_of(element)), *_of_element(element, result)]


def _of_scan(scan: Scan) -> Iterator[Property | Heading]:
    cloud = scan.cloud
    yield Heading(scan.name)
    yield Property(tr("Points"), f"{len(cloud):,}", str(len(cloud)))
    low, high = extent(cloud)
    edges = " × ".join(f"{v:.2f}" for v in high - low)
    yield Property(tr("Extent"), f"{edges} m", " ".join(f"{v:.3f}" for v in high - low))
    middle = cloud.world((low + high) / 2)
    for name, value in zip("XYZ", middle, strict=True):
        yield Property(
            tr("Centre {name}").format(name=name),
            f"{format_coordinate(float(value))} m",
            f"{value:.4f}",
        )
    if cloud.crs:
        yield Property(tr("Coordinates"), cloud.crs, cloud.crs)
    in_metres = tr("Of the coordinates in the file; here they are in metres.")
    yield Property(tr("Unit"), unit_text(cloud.unit), str(cloud.unit), hint=in_metres)
    if scan.files:
        names = ", ".join(path.name for path in scan.files)
        paths = "\n".join(map(str, scan.files))
        yield Property(
            tr("File") if len(scan.files) == 1 else tr("Files"), names, paths, hint=paths
        )
    if cloud.notes:
        notes = [reason_text(note) for note in cloud.notes]
        yield Property(tr("Notes"), " ".join(notes), "\n".join(notes), hint="\n".join(notes))
    if scan.result is not None:
        seconds = sum(scan.result.seconds.values())
        yield Property(
            tr("Found"),
            summary(scan.result),
            hint=tr("Detected in {seconds:.1f} s.").format(seconds=seconds),
        )


def _of_run(result: Result, run_id: int) -> Iterator[Property | Heading]:
    elements = [e for e in result.elements if e.run_id == run_id]
    ids = {e.element_id for e in elements}
    yield Heading(run_label(result, run_id))
    yield Property(tr("Elements"), str(len(elements)), str(len(elements)))
    yield _measure(tr("Length"), sum(e.axis.length for e in elements), unit="m")
    sizes = sorted({e.nominal.name for e in elements if e.nominal})
    yield Property(tr("Sizes"), ", ".join(sizes) or tr("no nominal size within tolerance"))
    n_deformations = sum(d.element_id in ids for d in result.deformations)
    yield Property(tr("Deformations"), str(n_deformations), str(n_deformations))


def candidates_hint(result: Result) -> str:
    """Say what the list of candidates holds, and what it leaves out."""
    hint = tr("Looked like part of a pipe, and why it was not taken for one.")
    if result.n_more_candidates:
        more = tr("{n} more, farther from acceptance, are not listed.")
        hint += " " + more.format(n=result.n_more_candidates)
    return hint


def _of_candidate(candidate: Candidate, result: Result) -> Iterator[Property | Heading]:
    yield Heading(candidate_label(candidate))
    why = reason_text(candidate.reason)
    yield Property(tr("Not accepted"), why, hint=why)
    if math.isfinite(candidate.value):
        for name, value in ((tr("Value"), candidate.value), (tr("Limit"), candidate.limit)):
            text = f"{value:.3g} {candidate.unit}".strip()
            yield Property(name, text, cell(value, 4))
    yield _measure(tr("Radius"), candidate.radius, candidate.radius_sd)
    if candidate.kind is ElementKind.CONE:
        yield _measure(tr("Radius at end"), candidate.radius_end, candidate.radius_sd)
    yield _measure(tr("Length"), candidate.axis.length, unit="m")
    yield _measure(tr("Arc seen"), candidate.arc, unit="°")
    residual = tr("Root mean square distance from the surface.")
    yield _measure(tr("Residual"), candidate.rms, hint=residual)
    yield Property(tr("Points"), f"{candidate.n_points:,}", str(candidate.n_points))
    for name, point in ((tr("Start"), candidate.axis.start), (tr("End"), candidate.axis.end)):
        yield _position(name, point + result.origin)


def _of_element(element: Element, result: Result) -> Iterator[Property]:
    too_short = tr(ARC_TOO_SHORT).format(arc=math.degrees(element.arc))
    yield _measure(tr("Radius"), element.radius, element.radius_sd)
    if element.kind is ElementKind.CONE:
        yield _measure(tr("Radius at end"), element.radius_end, element.radius_sd)
    if element.nominal is not None:
        od = tr("OD {od:.1f} mm").format(od=1000 * element.nominal.outside_diameter)
        name = element.nominal.name
        if element.nominal_end is not None:
            name += f" → {element.nominal_end.name}"
        by = tr("Chosen by a person.") if element.is_nominal_confirmed else ""
        yield Property(tr("Nominal size"), f"{name} ({od})", name, hint=by)
    else:
        yield Property(tr("Nominal size"), tr("none within tolerance"))
    if element.other_nominal is not None:
        od = tr("OD {od:.1f} mm").format(od=1000 * element.other_nominal.outside_diameter)
        other = f"{element.other_nominal.name} ({od})"
        yield Property(tr("Or"), other, hint=tr("The measurement does not rule this size out."))
    if element.answers:
        yield Property(tr("Answers"), conditions_text(element.answers))
    if isinstance(element.axis, ArcAxis):
        yield _measure(tr("Bend radius"), element.axis.bend_radius)
        yield _measure(tr("Bend angle"), element.axis.bend_angle, unit="°")
    yield _measure(tr("Length"), element.axis.length, unit="m")
    yield _measure(
        tr("Ovality"),
        element.ovality,
        element.ovality_sd,
        unit="%",
        hint=OVALITY
        if math.isfinite(element.ovality)
        else reason_text(element.not_measurable.get("ovality", too_short)),
    )
    off_axis = tr("Largest distance of the measured axis from the fitted one.")
    yield _measure(tr("Straightness"), element.straightness, hint=off_axis)
    yield _measure(tr("Arc seen"), element.arc, unit="°", hint=tr("Median over the profiles."))
    yield _measure(
        tr("Residual"), element.rms, hint=tr("Root mean square distance from the surface.")
    )
    yield Property(tr("Points"), f"{element.n_points:,}", str(element.n_points))
    yield Property(tr("Profiles"), f"{element.n_profiles:,}", str(element.n_profiles))
    for name, point in ((tr("Start"), element.axis.start), (tr("End"), element.axis.end)):
        yield _position(name, point + result.origin)
    if element.gaps:
        gaps = ", ".join(f"{a:.2f} – {b:.2f} m ({b - a:.2f} m)" for a, b in element.gaps)
        yield Property(tr("Gaps"), gaps, hint=tr("Chainages without profiles, and their lengths."))
    if element.element_id in result.own_settings:
        yield _of_settings(result.own_settings[element.element_id], result.settings)


def _of_settings(own: Settings, others: Settings) -> Property:
    """Return what is different in the settings with which an element was detected again."""
    lines = [
        f"{tr(spec.label)}: {_setting(own, key, spec)} ({_setting(others, key, spec)})"
        for key, spec in iterate_fields()
        if own.get(key) != others.get(key)
    ]
    hint = tr("Detected again with these (in brackets: the other elements’):")
    return Property(tr("Own settings"), "; ".join(lines), hint="\n".join((hint, *lines)))


def _setting(settings: Settings, key: str, spec: FieldSpec) -> str:
    value = settings.get(key)
    if value == 0 and spec.zero_means:
        return tr(spec.zero_means)
    if choices_of(spec.kind) is not None:
        return ", ".join(value)
    if isinstance(value, tuple):
        return str(len(value))
    text = f"{value:g}" if isinstance(value, float) else tr(str(value))
    return f"{text} {spec.unit}".strip()


def _of_deformation(
    deformation: Deformation, element: Element, result: Result
) -> Iterator[Property]:
    verdict = deformation.verdict
    yield Property(
        tr("Verdict"),
        verdict_text(deformation),
        str(verdict),
        hint=why_text(deformation),
        verdict=verdict,
    )
    if deformation.verdict_reason:
        yield Property(tr("To look at"), reason_text(deformation.verdict_reason))
    if deformation.answers:
        yield Property(tr("Answers"), conditions_text(deformation.answers))
    is_bulge = deformation.kind is DeformationKind.BULGE
    name, of_od = (tr("Height"), tr("Height / OD")) if is_bulge else (tr("Depth"), tr("Depth / OD"))
    yield _measure(name, deformation.depth, deformation.depth_sd)
    share, share_sd = depth_pct_od(deformation, element)
    if math.isfinite(share):
        yield _measure(of_od, share / 100, share_sd / 100, unit="%")
    size = f"{1000 * deformation.length:.0f} × {1000 * deformation.width:.0f}"
    yield Property(tr("Length × width"), f"{size} mm", size, hint=tr("Along the axis × around."))
    yield _measure(tr("Chainage"), deformation.chainage, unit="m")
    clock = format_clock(deformation.clock)
    yield Property(
        tr("Clock"), clock, clock, hint=tr("Looking along increasing chainage, 12:00 up.")
    )
    why = {name: reason_text(text) for name, text in deformation.not_measurable.items()}
    if deformation.kind is DeformationKind.OVALITY:
        hint = why.get("ovality", OVALITY)
        yield _measure(tr("Ovality"), deformation.ovality, unit="%", hint=hint)
    if math.isfinite(deformation.area):
        area, volume = 1e4 * deformation.area, 1e6 * deformation.volume
        yield Property(tr("Area"), f"{area:.0f} cm²", cell(area, 1), tr("Of the undented surface."))
        yield Property(
            tr("Volume"), f"{volume:.1f} cm³", cell(volume, 2), tr("Between both surfaces.")
        )
    if math.isfinite(deformation.strain):
        yield _measure(tr("Strain"), deformation.strain, unit="%", hint=tr("Indicative only."))
    elif "strain" in why:
        yield _measure(tr("Strain"), math.nan, unit="%", hint=why["strain"])
    yield from _surroundings(deformation, result)
    yield _position(tr("Peak"), deformation.peak + result.origin)


def _surroundings(deformation: Deformation, result: Result) -> Iterator[Property]:
    # Either may have been deleted since.
    fitting = next((e for e in result.elements if e.element_id == deformation.fitting_id), None)
    other = next((d for d in result.deformations if d.deformation_id == deformation.next_id), None)
    if fitting is not None:
        is_on = deformation.fitting_id == deformation.element_id
        place = tr("on it") if is_on else f"{deformation.fitting_distance:.3f} m"
        distance = f"{deformation.fitting_distance:.4f}"
        yield Property(tr("Nearest fitting"), f"{label_of(fitting)}, {place}", distance)
    if other is not None:
        text = f"{tr(other.kind)} {other.deformation_id}, {deformation.next_distance:.3f} m"
        text, hint = (
            (tr("{text}, interacts").format(text=text), tr(INTERACTS))
            if deformation.interacts
            else (text, "")
        )
        yield Property(tr("Next dent"), text, f"{deformation.next_distance:.4f}", hint)


def _of_profile(profile: Profiles, result: Result) -> Iterator[Property]:
    row = {f: getattr(profile, f)[0] for f in profile.__dataclass_fields__}
    name = stack_name(result, int(row["stack_id"]))
    yield Property(tr("Stack"), name, name)
    yield _measure(tr("Chainage"), row["chainage"], unit="m")
    is_measurable = radius_is_measurable(profile)[0]
    yield _measure(
        tr("Radius"),
        row["radius"] if is_measurable else math.nan,
        row["radius_sd"],
        hint="" if is_measurable else tr("Little is seen of this profile, and that is deformed."),
    )
    yield _measure(tr("Semi-minor axis"), row["semi_minor"])
    yield _measure(tr("Semi-major axis"), row["semi_major"])
    too_short = tr(ARC_TOO_SHORT).format(arc=math.degrees(row["arc"]))
    hint = OVALITY if math.isfinite(row["ovality"]) else too_short
    yield _measure(tr("Ovality"), row["ovality"], unit="%", hint=hint)
    yield _measure(tr("Centre off axis"), row["centre_deviation"])
    yield _measure(tr("Arc seen"), row["arc"], unit="°")
    yield Property(tr("Points"), f"{int(row['n_points']):,}", str(int(row["n_points"])))


def _position(label: str, world: Array) -> Property:
    text = "  ".join(format_coordinate(float(v)) for v in world)
    return Property(label, text, " ".join(f"{v:.4f}" for v in world), hint=tr("X, Y, Z in metres"))
