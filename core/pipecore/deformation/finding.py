"""From the points around one element to its deformations: the steps in their order."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from pipecore.deformation.centre_line import CENTRE_KNOTS, MIN_BOW_RATIO, measure_centre_line
from pipecore.deformation.contour import (
    KNOT_DIAMETERS,
    Contour,
    fit_contour,
    inner_rows,
    oval_knot_diameters,
    usable_arc,
)
from pipecore.deformation.criteria import ProfileCriteria
from pipecore.deformation.deviation_map import DeviationMap, Flags, Grid, box_sum
from pipecore.deformation.element_surface import ElementSurface, find_element_surface
from pipecore.deformation.free_sections import FreeSections
from pipecore.deformation.hidden_ovality import (
    MAX_HIDDEN_OVALITY,
    faked_bow,
    may_be_ovality,
)
from pipecore.deformation.merging import merge
from pipecore.deformation.ovality import (
    MIN_ARC,
    OvalStretch,
    mean_ovality,
    oval_stretches,
    true_ranges,
)
from pipecore.deformation.patches import Patch, find_patches
from pipecore.deformation.profile_shapes import (
    crumpled_stretches,
    free_oval_stretches,
    measured_freely,
    turn_along,
)
from pipecore.deformation.records import (
    describe_bow,
    describe_crumple,
    describe_oval,
    describe_patch,
)
from pipecore.deformation.unrolled_points import UnrolledPoints, surface_distance, unroll
from pipecore.geometry import ArcAxis, Array, surface_points
from pipecore.reasons import Reason
from pipecore.rounding import NO_ROUNDING, Rounding
from pipecore.settings import DeformationSettings
from pipecore.types import Deformation, DeformationKind, Element, ElementKind

SEARCHED = (ElementKind.CYLINDER, ElementKind.CONE, ElementKind.TORUS, ElementKind.TEE)
"""Kinds whose contour is known well enough to look for deformations."""

NO_REASON = Reason()

SEARCH_OVALITY, FAINT_OVALITIES = 0.02, (0.01, 0.005, 0.0025)
"""Ovality from which stretches are sought; fainter ones, level by level, between these. The
setting only says which of them are told: what is found, and as what, does not move with it."""

SEARCH_DEPTH = 0.003
"""Rings of a crumple are sought from this height on, metres, whatever the setting."""

MIN_DEPTH_SD = 3.0
"""A depth has to be this many times its standard deviation."""

MIN_DENT_ARC = np.deg2rad(100.0)
MAX_SHORT_ARC = 0.2
"""Where less arc is seen, the contour follows a dent; reported from this fraction of the length."""

MIN_PROFILE_ARC, MIN_UNSEEN_RADII = np.deg2rad(40.0), 0.5
"""A profile is measured from this arc on; shorter stretches without one are not told."""

MIN_BOW_LENGTH = 6.0
"""In diameters: the line of a shorter stub hangs on what touches it."""

MAX_OVALITY_SD = 0.01
"""Ovality known less well than to a percentage point is no number for an inspector."""

MAX_STRAIGHTNESS_SD = 0.003
"""A centre line known less well than this is no number where it shows no bow, metres."""

MIN_EXPLAINED = 0.7
"""A bent pipe is bent in one bow or kink, which explains this share of its line's variation."""


@dataclass(frozen=True, eq=False)
class DeformationFinding:
    """What was found on one element.

    Parameters
    ----------
    deformations : tuple of Deformation
        In order of chainage; ids and verdicts are given later.
    deviation : ndarray of float32, shape (n,)
        Signed distance of every point from the undeformed contour, metres, outward
        positive; nan for points that are not of the surface.
    belongs : ndarray of bool, shape (n,)
    points : UnrolledPoints
        All n points in the coordinates of the element.
    map : DeviationMap, optional
        None where there are too few points.
    ovality, ovality_sd : float
        Of the mean section, ratios; nan where the arc cannot carry it.
    straightness : float
        Largest distance of the measured axis from its chord, metres; nan if unknown.
    not_measurable : dict of str to Reason
        Why the ovality or the straightness is nan where it would apply.
    """

    deformations: tuple[Deformation, ...]
    deviation: NDArray[np.float32]
    belongs: Flags
    points: UnrolledPoints
    map: DeviationMap | None
    ovality: float = np.nan
    ovality_sd: float = np.nan
    straightness: float = np.nan
    not_measurable: dict[str, Reason] = field(default_factory=dict)


def find_deformations(
    element: Element,
    xyz: Array,
    normals: Array,
    neighbours: Sequence[Element],
    settings: DeformationSettings,
    rounding: Rounding = NO_ROUNDING,
) -> DeformationFinding:
    """Find and measure the deformations of one element.

    Parameters
    ----------
    element : Element
    xyz, normals : ndarray, shape (n, 3)
        All points of the wide neighbourhood (0.4 to 1.3 radii from the axis), clutter
        included, with unit normals of either sign, nan where not known.
    neighbours : sequence of Element
        Elements whose surfaces come near: where they touch, nothing is called a bulge.
    settings : DeformationSettings
    rounding : Rounding
        Of the points' coordinates.

    Returns
    -------
    DeformationFinding
    """
    points = unroll(element, xyz, normals)
    surface = find_element_surface(element, points)
    if surface is None:
        return DeformationFinding(
            (),
            np.full(len(xyz), np.nan, np.float32),
            np.zeros(len(xyz), bool),
            points,
            None,
            not_measurable=dict.fromkeys(_applicable(element), Reason("too few points")),
        )
    heights = _height_map(element, surface, neighbours, rounding)
    arc = usable_arc(surface.grid, heights.covered)
    n_terms = 5 if arc >= MIN_ARC else 3

    def search(knot_diameters: float) -> tuple[list[Patch], Contour]:
        return find_patches(
            element,
            surface,
            heights,
            settings.significance,
            n_terms=n_terms,
            knot_diameters=knot_diameters,
        )

    patches, contour = search(KNOT_DIAMETERS)
    criteria = ProfileCriteria.of(heights, settings.significance)

    def oval_at(level: float) -> list[OvalStretch]:
        smooth = oval_stretches(contour, level, settings.significance) if n_terms == 5 else []
        return _of_both(smooth, free_oval_stretches(criteria, level))

    stretches = oval_at(SEARCH_OVALITY)
    if stretches:
        patches, contour = search(oval_knot_diameters(surface.grid))
        stretches = [measured_freely(o, criteria) for o in oval_at(SEARCH_OVALITY)]
        stretches = [o for o in stretches if o.ovality >= SEARCH_OVALITY]
        patches = [p for p in patches if not _is_of_ovality(p, stretches, surface.grid)]
    for level in FAINT_OVALITIES:
        if settings.min_ovality_pct < 100 * SEARCH_OVALITY:
            faint = [measured_freely(o, criteria) for o in oval_at(level)]
            stretches = _of_both(stretches, [o for o in faint if o.ovality >= level])
    stretches = [o for o in stretches if o.ovality >= settings.min_ovality_pct / 100]

    least = settings.min_depth_mm / 1000
    deformations = [
        describe_patch(element, surface, contour, p, settings.wall_thickness_mm / 1000)
        for p in patches
        if abs(p.bump.height) >= max(least, MIN_DEPTH_SD * p.bump.height_sd)
        and _arc_at(heights, p) >= MIN_DENT_ARC
        and not (n_terms == 3 and may_be_ovality(p))
    ]
    ovality, ovality_sd, why_no_ovality = _mean_ovality(contour, arc)
    deformations += [
        describe_oval(element, surface, contour, o, is_twisted=turn_along(o, criteria) != 0.0)
        for o in stretches
    ]
    straightness, why_not_straight = np.nan, NO_REASON
    if not isinstance(element.axis, ArcAxis) and element.kind in SEARCHED:
        straightness, why_not_straight, bow = _measure_bow(
            element, surface, heights, patches, n_terms=n_terms, settings=settings
        )
        deformations = [d for d in deformations if not _is_of_kink(d, bow, surface.grid)] + bow
    crumples = [
        describe_crumple(element, surface, contour, c)
        for c in crumpled_stretches(criteria, heights, SEARCH_DEPTH)
        if abs(c.height) >= least
    ]
    deformations = merge(deformations, crumples, criteria)

    deviation = np.full(len(xyz), np.nan, np.float32)
    inliers = surface.belongs
    at_point = surface.grid.interpolate(
        contour.height, points.chainage[inliers], points.clock[inliers]
    )
    deviation[inliers] = points.height[inliers] - at_point
    if element.kind not in SEARCHED:
        deformations = []
    return DeformationFinding(
        tuple(sorted(deformations, key=lambda d: (d.chainage, d.kind))),
        deviation,
        inliers,
        points,
        replace(heights, deviation=heights.deviation - contour.height),
        ovality,
        ovality_sd,
        straightness,
        {
            name: why
            for name, why in {
                "ovality": why_no_ovality,
                "straightness": why_not_straight,
                "dents": _why_no_dents(heights),
                "profiles": _unseen_stretches(heights),
            }.items()
            if why and (name in _applicable(element) or name in ("dents", "profiles"))
        }
        if element.kind in SEARCHED
        else {},
    )


def _of_both(smooth: list[OvalStretch], free: list[OvalStretch]) -> list[OvalStretch]:
    """Oval stretches of the contour, and those of free sections that it missed."""
    missed = [o for o in free if not any(o.first <= s.last and s.first <= o.last for s in smooth)]
    return sorted((*smooth, *missed), key=lambda o: o.first)


def _arcs(heights: DeviationMap) -> Array:
    """Arc that is seen at each row, radians."""
    return np.asarray(np.count_nonzero(heights.covered, axis=1) * heights.grid.column_angle)


def _arc_at(heights: DeviationMap, patch: Patch) -> float:
    """Arc that is seen along a bump, radians: the median over its rows."""
    grid = heights.grid
    reach = max(patch.span / 2, grid.row_size)
    return float(np.median(_arcs(heights)[np.abs(grid.chainages - patch.chainage) <= reach]))


def _why_no_dents(heights: DeviationMap) -> Reason:
    """Why dents are not measurable along a good part of an element; empty if they are."""
    short = float(np.mean(_arcs(heights) < MIN_DENT_ARC))
    if short < MAX_SHORT_ARC:
        return NO_REASON
    return Reason(
        "less than {needed}° of arc seen over {share} % of the length",
        needed=f"{np.rad2deg(MIN_DENT_ARC):.0f}",
        share=f"{100 * short:.0f}",
    )


def _unseen_stretches(heights: DeviationMap) -> Reason:
    """Where no profile of an element could be measured; empty if all could be."""
    grid = heights.grid
    unseen = (_arcs(heights) < MIN_PROFILE_ARC) & inner_rows(grid)
    stretches = [
        f"{first * grid.row_size:.2f}–{(last + 1) * grid.row_size:.2f}"
        for first, last in true_ranges(unseen)
        if (last + 1 - first) * grid.row_size >= MIN_UNSEEN_RADII * grid.radius
    ]
    if not stretches:
        return NO_REASON
    return Reason("no surface seen at chainage {stretches} m", stretches=", ".join(stretches))


def _applicable(element: Element) -> tuple[str, ...]:
    """What is measured of an element as a whole, if the scan carries it."""
    if element.kind not in SEARCHED:
        return ()
    return ("ovality",) if isinstance(element.axis, ArcAxis) else ("ovality", "straightness")


def _mean_ovality(contour: Contour, arc: float) -> tuple[float, float, Reason]:
    """Ovality of the mean section with its standard deviation, or why it is not measurable."""
    if contour.n_terms < 5:
        why = Reason(
            "{seen}° of arc seen, {needed}° are needed",
            seen=f"{np.rad2deg(arc):.0f}",
            needed=f"{np.rad2deg(MIN_ARC):.0f}",
        )
        return np.nan, np.nan, why
    ovality, sd = mean_ovality(contour)
    if sd > MAX_OVALITY_SD:
        why = Reason("the noise allows no better than ± {sd} %", sd=f"{100 * sd:.1f}")
        return np.nan, np.nan, why
    return ovality, sd, NO_REASON


def _height_map(
    element: Element, surface: ElementSurface, neighbours: Sequence[Element], rounding: Rounding
) -> DeviationMap:
    """Cell means above the fitted surface, with the cells where others touch it."""
    grid, inliers = surface.grid, surface.belongs
    cell = surface.cell[inliers]
    count = grid.count(cell)
    in_contact = surface.overlain.copy()
    chainage, clock = (a.ravel() for a in np.meshgrid(grid.chainages, grid.clocks, indexing="ij"))
    places = surface_points(element.axis, chainage, element.radius_at(chainage), clock)
    noise = surface.noise
    if rounding.step:
        along = element.axis.tangent(chainage)
        normal = places - element.axis.at(chainage)
        normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-9)[:, None]
        density = box_sum(count) / (9 * grid.row_size * grid.column_size)
        frame = normal, along, np.cross(along, normal)
        noise = rounding.point_sd(noise.ravel(), frame, density.ravel(), grid.radius)
        noise = noise.reshape(grid.shape)
    if neighbours:
        reach = max(2 * grid.row_size, 0.01)
        for other in neighbours:
            in_contact |= (surface_distance(other, places) < reach).reshape(grid.shape)
    return DeviationMap(
        grid, grid.mean(cell, surface.points.height[inliers]), noise, count, in_contact
    )


def _is_of_ovality(patch: Patch, stretches: list[OvalStretch], grid: Grid) -> bool:
    """Whether a bump is what a contour could not follow at the ends of an oval stretch."""
    diameter = 2 * grid.radius
    return any(
        oval.first * grid.row_size - diameter < patch.chainage
        and patch.chainage < oval.last * grid.row_size + diameter
        and abs(patch.bump.height) < oval.ovality * grid.radius
        for oval in stretches
    )


def _is_of_kink(found: Deformation, bow: list[Deformation], grid: Grid) -> bool:
    """Whether a bump is what a smooth contour leaves of a kink."""
    return any(
        line.kind is DeformationKind.KINK
        and abs(found.chainage - line.chainage) < 2 * grid.radius
        and not found.depth >= 0.5 * line.depth
        for line in bow
    )


def _measure_bow(
    element: Element,
    surface: ElementSurface,
    heights: DeviationMap,
    patches: list[Patch],
    *,
    n_terms: int,
    settings: DeformationSettings,
) -> tuple[float, Reason, list[Deformation]]:
    """Straightness or why it is not measurable, and the bow or kink if it is one."""
    grid = surface.grid
    used = heights.count > 0
    for patch in patches:
        used &= ~patch.cells(grid, 1.15)
    variance = np.where(used, heights.noise**2 / np.maximum(heights.count, 1), np.inf)
    contour = fit_contour(
        grid,
        heights.deviation,
        variance,
        n_terms,
        knot_diameters=CENTRE_KNOTS,
        constant_radius=True,
    )
    undented = replace(heights, in_contact=heights.in_contact | ~used)
    line = measure_centre_line(contour, FreeSections.of(undented), element.axis)
    least = max(settings.min_depth_mm / 1000, MIN_BOW_RATIO * grid.length)
    is_significant = line.straightness >= settings.significance * line.straightness_sd
    if line.straightness_sd > MAX_STRAIGHTNESS_SD and not is_significant:
        why = Reason(
            "the centre line is known to ± {sd} mm only", sd=f"{1000 * line.straightness_sd:.0f}"
        )
        return np.nan, why, []
    if line.straightness < least or not is_significant:
        return line.straightness, NO_REASON, []
    hidden = 0.0 if n_terms == 5 else faked_bow(heights)
    if line.straightness < hidden + settings.significance * line.straightness_sd:
        why = Reason(
            "an ovality of {ovality} %, which so short an arc cannot show, may be {size} mm of it",
            ovality=f"{100 * MAX_HIDDEN_OVALITY:.0f}",
            size=f"{1000 * min(hidden, line.straightness):.0f}",
        )
        return np.nan, why, []
    is_short = grid.length < MIN_BOW_LENGTH * 2 * grid.radius
    if is_short or line.explained < MIN_EXPLAINED:
        return line.straightness, NO_REASON, []
    return line.straightness, NO_REASON, [describe_bow(element, surface, contour, line)]
