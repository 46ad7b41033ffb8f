"""Assembling what was selected: runs, fittings, tees and the final order of the elements."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pipecore.catalogues import with_sizes
from pipecore.elements.fittings.flanges import pair_flanges
from pipecore.elements.fittings.tees import ElementPart, Junction, cut_tees, find_junctions
from pipecore.elements.gates.refusals import too_short
from pipecore.elements.proposals import Proposal
from pipecore.elements.refinement.fitted_element import FittedElement
from pipecore.elements.refinement.nearby_points import NearbyPoints
from pipecore.elements.refinement.surface_fits import ArcSurface, LineSurface
from pipecore.elements.runs.ends import AxisSpan, End, Link, meeting_ends
from pipecore.elements.runs.joining import join_straights
from pipecore.elements.runs.numbering import number_runs
from pipecore.elements.runs.trimming import trim_to_each_other, trim_to_fitting
from pipecore.elements.selection import select_elements
from pipecore.ellipses import radius_sd_factor
from pipecore.geometry import AnyAxis
from pipecore.progress import Progress
from pipecore.rounding import Rounding
from pipecore.settings import ElementSettings
from pipecore.types import Candidate, Element, ElementKind

MIN_LENGTH_RADII = 0.35
"""Shortest cylinder, in radii: a slice of a vessel's head is shorter."""
MIN_PIPE_LENGTH_RADII = 6.0
"""A straight that nothing follows is a pipe if it is longer than this many radii, else a vessel."""
MIN_LONE_LENGTH_RADII, MIN_LONE_LENGTH = 3.0, 0.3
"""Shortest element that is part of no run, in radii or in metres, whichever is less: limbs and
bodies of people are shorter."""


MIN_CONE_ARC, MIN_CONE_COVERAGE = float(np.deg2rad(145.0)), 0.8
MIN_CONE_LENGTH_RADII, MIN_LONE_TAPER, MAX_LONE_CONE_SD = 0.8, 0.08, 0.0025
"""What a cone that is part of no run shows at least: arc, share of its length, length in radii of
its wide end, change of radius in shares of that, and how well its radius is known: limbs and
folds that taper have radii of 0.4 % and more, real cones of at most 0.1 %."""


def build_elements(
    proposals: list[Proposal],
    nearby: NearbyPoints,
    settings: ElementSettings,
    progress: Progress,
) -> tuple[tuple[Element, ...], tuple[Candidate, ...], int]:
    """Fit the proposed surfaces, keep those that pass the gates and join them to runs.

    Points on one element are not available to the next, so that every surface is
    reported once.

    Parameters
    ----------
    proposals : list of Proposal
        As from `propose_surfaces`, in any order.
    nearby : NearbyPoints
    settings : ElementSettings
    progress : Progress
        Receives fractions of the stage "elements".

    Returns
    -------
    elements : tuple of Element
        The longest run first, along each run; ovality and straightness are not measured yet.
    candidates : tuple of Candidate
        What was nearly accepted.
    n_more : int
        How many more there are.

    Raises
    ------
    CancelledError
        From `progress`.
    """
    fitted, links, not_accepted = select_elements(proposals, nearby, settings, progress)
    fitted, links = join_straights(fitted, links)
    axes, met = _trim_axes(fitted, links)
    kinds = [_kind(f) for f in fitted]
    for flange, pipe in pair_flanges(fitted):
        kinds[flange] = ElementKind.FLANGE
        links.append((flange, pipe))
    junctions = find_junctions(_spans(axes, fitted), met)
    links += [(j.branch, j.run) for j in junctions]
    run = number_runs(len(fitted), links)
    tees = [j for j in junctions if _is_tee(j, fitted, kinds, met)]
    reported = []
    for part in cut_tees(fitted, axes, tees, nearby.surface.xyz):
        kind = kinds[part.whole]
        if _is_reported(part, kind, run, settings):
            reported.append((part, ElementKind.TEE if part.is_tee else kind, int(run[part.whole])))
        elif _is_alone(part, run) and kind is ElementKind.CYLINDER:
            least = _least_lone_length(part, settings)
            not_accepted.add_dropped(part.found, too_short(part.axis.length, least))
    return _number_elements(reported, settings, nearby.rounding), *not_accepted.candidates()


def _spans(axes: list[AnyAxis], fitted: list[FittedElement]) -> list[AxisSpan]:
    return [AxisSpan(axis, f.radii) for axis, f in zip(axes, fitted, strict=True)]


def _trim_axes(fitted: list[FittedElement], links: list[Link]) -> tuple[list[AnyAxis], set[End]]:
    """Axes that end where the next element begins; also the ends that another follows.

    Adds the pairs of elements that follow each other to `links`.
    """
    axes = [f.axis for f in fitted]
    for fitting, straight in links:
        axes[straight], axes[fitting] = trim_to_fitting(axes[straight], axes[fitting])
    met = set()
    for i, end_i, j, end_j in meeting_ends(_spans(axes, fitted)):
        links.append((i, j))
        met |= {(i, end_i), (j, end_j)}
        radius = fitted[i].fit.model.radius
        axes[i], axes[j] = trim_to_each_other(axes[i], end_i, axes[j], end_j, radius)
    return axes, met


def _kind(found: FittedElement) -> ElementKind:
    match found.fit.model:
        case LineSurface(is_tapered=True):
            return ElementKind.CONE
        case LineSurface():
            return ElementKind.CYLINDER
        case ArcSurface():
            return ElementKind.TORUS
    return ElementKind.SPHERE


def _is_tee(
    junction: Junction,
    fitted: list[FittedElement],
    kinds: list[ElementKind],
    met: set[End],
) -> bool:
    """Whether a branch in the side of a pipe makes it a tee, and not a vessel with a nozzle."""
    run = fitted[junction.run]
    is_followed = (junction.run, 0) in met or (junction.run, 1) in met
    is_pipe = is_followed or run.axis.length > MIN_PIPE_LENGTH_RADII * run.fit.model.radius
    return (
        junction.is_wide
        and is_pipe
        and kinds[junction.run] is ElementKind.CYLINDER
        and kinds[junction.branch] in (ElementKind.CYLINDER, ElementKind.TORUS)
    )


def _is_reported(
    part: ElementPart, kind: ElementKind, run: NDArray[np.int32], settings: ElementSettings
) -> bool:
    """Whether an element is reported: a short one only if it is part of a run."""
    if part.is_tee or kind in (ElementKind.SPHERE, ElementKind.FLANGE):
        return True
    radius, length = part.found.fit.model.radius, part.axis.length
    is_alone = _is_alone(part, run)
    if is_alone and kind is ElementKind.CONE and not _is_clear_cone(part):
        return False
    if is_alone and length < _least_lone_length(part, settings):
        return False
    return kind is not ElementKind.CYLINDER or length >= MIN_LENGTH_RADII * radius


def _is_alone(part: ElementPart, run: NDArray[np.int32]) -> bool:
    return bool((run == run[part.whole]).sum() == 1)


def _least_lone_length(part: ElementPart, settings: ElementSettings) -> float:
    """Shortest length of an element that is part of no run, metres."""
    by_radius = min(MIN_LONE_LENGTH_RADII * part.found.fit.model.radius, MIN_LONE_LENGTH)
    return max(settings.min_length_mm / 1e3, by_radius)


def _is_clear_cone(part: ElementPart) -> bool:
    """Whether a cone without straights is one: limbs taper too, seen from one side and a bit."""
    radii = replace(part.found, axis=part.axis).radii
    taper = abs(radii[1] - radii[0]) / max(radii)
    return (
        part.found.extent.arc > MIN_CONE_ARC
        and part.found.extent.coverage > MIN_CONE_COVERAGE
        and part.axis.length > MIN_CONE_LENGTH_RADII * max(radii)
        and taper > MIN_LONE_TAPER
        and part.found.radius_sd < MAX_LONE_CONE_SD * min(radii)
    )


def _number_elements(
    parts: list[tuple[ElementPart, ElementKind, int]],
    settings: ElementSettings,
    rounding: Rounding,
) -> tuple[Element, ...]:
    """Elements in their final order: the longest run first, along each run."""
    if not parts:
        return ()
    length = np.bincount([run for _, _, run in parts], [part.axis.length for part, _, _ in parts])

    def place(item: tuple[ElementPart, ElementKind, int]) -> tuple[float, ...]:
        axis, run = item[0].axis, item[2]
        return (-length[run], run, *np.round(axis.at(axis.length / 2), 6))

    run_id: dict[int, int] = {}
    elements: list[Element] = []
    for part, kind, run in sorted(parts, key=place):
        run_id.setdefault(run, len(run_id) + 1)
        element = _element(part, kind, len(elements) + 1, run_id[run], rounding)
        elements.append(with_sizes(element, settings))
    return tuple(elements)


def _element(
    part: ElementPart, kind: ElementKind, element_id: int, run_id: int, rounding: Rounding
) -> Element:
    found = part.found
    model = found.fit.model
    start_radius, end_radius = replace(found, axis=part.axis).radii
    shift = float(found.axis.pipe_coordinates(part.axis.start[None])[0][0])
    length = part.axis.length
    by_rounding = rounding.radius_sd(
        model.radius, part.axis.tangent(length / 2), length, found.fit.sigma
    )
    by_rounding *= float(radius_sd_factor(found.extent.arc) * np.sqrt(2 * np.pi / found.extent.arc))
    return Element(
        element_id=element_id,
        run_id=run_id,
        kind=kind,
        axis=part.axis,
        radius=start_radius - rounding.radius_bias(start_radius),
        radius_sd=float(np.hypot(found.radius_sd, by_rounding)),
        radius_end=end_radius - rounding.radius_bias(end_radius),
        centre=np.full(3, np.nan) if isinstance(model, LineSurface) else model.centre,
        n_points=0,
        n_profiles=0,
        arc=found.extent.arc,
        rms=found.fit.sigma,
        gaps=tuple((a - shift, b - shift) for a, b in found.extent.gaps),
    )
