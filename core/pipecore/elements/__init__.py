"""Elements: pieces of axes refined, told true from false, joined to runs (paper, 3.3.5)."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pipecore.catalogues import nominal_size
from pipecore.elements.fittings.flanges import flanges
from pipecore.elements.fittings.tees import Junction, Part, cut_tees, find_junctions
from pipecore.elements.joining import join_straights
from pipecore.elements.proposals import Piece, find_pieces
from pipecore.elements.refinement.nearby_points import NearbyPoints
from pipecore.elements.refinement.refine import Fitted
from pipecore.elements.refinement.surface_fits import ArcSurface, LineSurface
from pipecore.elements.runs import Span, meeting_ends, number_runs, trim_to_reducer, trim_to_tangent
from pipecore.elements.selection import refine_pieces
from pipecore.geometry import ArcAxis, LineAxis
from pipecore.progress import Progress
from pipecore.settings import ElementSettings
from pipecore.types import Element, ElementKind

__all__ = ["BuiltElements", "NearbyPoints", "build_elements", "find_pieces"]

Array = NDArray[np.float64]

SIZED = (ElementKind.CYLINDER, ElementKind.TORUS, ElementKind.TEE)
"""Kinds whose radius is a pipe's."""
MIN_LENGTH = 0.35
"""Shortest cylinder, in radii: a slice of a vessel's head is shorter."""
MIN_RUN = 6.0
"""A straight that nothing follows is a pipe from so many radii on, and a vessel below."""
LONE, LONG_ENOUGH = 3.0, 0.3
"""What is part of no run is longer than this many radii, or metres: limbs and bodies are not.
A reducer is always part of one."""


@dataclass(frozen=True, eq=False)
class BuiltElements:
    """Elements with the thinned points that are theirs.

    Parameters
    ----------
    elements : tuple of Element
        With what the refinement knows; ovality and straightness come later.
    own : tuple of ndarray
        Indices of each element's thinned points.
    """

    elements: tuple[Element, ...]
    own: tuple[NDArray[np.intp], ...]


def build_elements(
    pieces: list[Piece],
    nearby: NearbyPoints,
    settings: ElementSettings,
    progress: Progress,
) -> BuiltElements:
    """Refine pieces to elements, the best supported first; join them to runs.

    Points that one element takes are no longer there for the next, so that every
    surface is reported once.
    """
    fitted, links = refine_pieces(pieces, nearby, settings, progress)
    fitted, links = join_straights(fitted, links)
    axes = [f.axis for f in fitted]
    for fitting, straight in links:
        axes[straight], axes[fitting] = _trimmed_to_fitting(axes[straight], axes[fitting])
    spans = [Span(axis, f.radii) for axis, f in zip(axes, fitted, strict=True)]
    met = set()
    for i, end_i, j, end_j in meeting_ends(spans):
        links.append((i, j))
        met |= {(i, end_i), (j, end_j)}
        axes[i], axes[j] = _trimmed(axes[i], end_i, axes[j], end_j, fitted[i].fit.model.radius)
    kinds = [_kind(f) for f in fitted]
    for i, j in flanges(fitted):
        kinds[i] = ElementKind.FLANGE
        links.append((i, j))
    junctions = find_junctions(
        [Span(axis, f.radii) for axis, f in zip(axes, fitted, strict=True)], met
    )
    links += [(j.branch, j.run) for j in junctions]
    run = number_runs(len(fitted), links)
    tees = [j for j in junctions if _is_tee(j, fitted, kinds, met)]
    return _numbered(
        [
            (part, ElementKind.TEE if part.is_tee else kinds[part.whole], int(run[part.whole]))
            for part in cut_tees(fitted, axes, tees, nearby.surface.xyz)
            if _is_reported(part, kinds[part.whole], run, settings)
        ],
        settings,
    )


def _kind(found: Fitted) -> ElementKind:
    match found.fit.model:
        case LineSurface(is_tapered=True):
            return ElementKind.CONE
        case LineSurface():
            return ElementKind.CYLINDER
        case ArcSurface():
            return ElementKind.TORUS
    return ElementKind.SPHERE


def _is_tee(
    junction: Junction, fitted: list[Fitted], kinds: list[ElementKind], met: set[tuple[int, int]]
) -> bool:
    """Whether a branch in the side of a pipe makes it a tee, and not a vessel with a nozzle."""
    run = fitted[junction.run]
    goes_on = (junction.run, 0) in met or (junction.run, 1) in met
    is_pipe = goes_on or run.axis.length > MIN_RUN * run.fit.model.radius
    return (
        junction.is_wide
        and is_pipe
        and kinds[junction.run] is ElementKind.CYLINDER
        and kinds[junction.branch] in (ElementKind.CYLINDER, ElementKind.TORUS)
    )


def _is_reported(
    part: Part, kind: ElementKind, run: NDArray[np.int32], settings: ElementSettings
) -> bool:
    """Whether an element stands for itself: what is short must be part of a run."""
    if part.is_tee or kind in (ElementKind.SPHERE, ElementKind.FLANGE):
        return True
    radius, length = part.found.fit.model.radius, part.axis.length
    is_alone = (run == run[part.whole]).sum() == 1
    if is_alone and kind is ElementKind.CONE:
        return False
    if is_alone and length < max(settings.min_length_mm / 1e3, min(LONE * radius, LONG_ENOUGH)):
        return False
    return kind is not ElementKind.CYLINDER or length >= MIN_LENGTH * radius


def _trimmed_to_fitting(
    straight: LineAxis | ArcAxis, fitting: LineAxis | ArcAxis
) -> tuple[LineAxis | ArcAxis, LineAxis | ArcAxis]:
    """A straight and the fitting at its nearer end, cut where one takes over from the other."""
    if not isinstance(straight, LineAxis):
        return straight, fitting
    if isinstance(fitting, LineAxis):
        return trim_to_reducer(straight, fitting), fitting
    middle = fitting.at(fitting.length / 2)
    end = int(np.linalg.norm(straight.end - middle) < np.linalg.norm(straight.start - middle))
    corner = straight.at((fitting.centre - straight.start) @ straight.direction)
    arc_end = int(np.linalg.norm(fitting.end - corner) < np.linalg.norm(fitting.start - corner))
    return trim_to_tangent(straight, end, fitting, arc_end, 0.5 * straight.length)


def _trimmed(
    a: LineAxis | ArcAxis, end_a: int, b: LineAxis | ArcAxis, end_b: int, radius: float
) -> tuple[LineAxis | ArcAxis, LineAxis | ArcAxis]:
    if isinstance(a, LineAxis) and isinstance(b, ArcAxis):
        return trim_to_tangent(a, end_a, b, end_b, 2.0 * radius)
    if isinstance(a, ArcAxis) and isinstance(b, LineAxis):
        line, arc = trim_to_tangent(b, end_b, a, end_a, 2.0 * radius)
        return arc, line
    return a, b


def _numbered(
    parts: list[tuple[Part, ElementKind, int]], settings: ElementSettings
) -> BuiltElements:
    """Elements in their final order: the longest run first, along each run."""
    if not parts:
        return BuiltElements((), ())
    length = np.bincount([run for _, _, run in parts], [part.axis.length for part, _, _ in parts])

    def place(item: tuple[Part, ElementKind, int]) -> tuple[float, ...]:
        axis, run = item[0].axis, item[2]
        return (-length[run], run, *np.round(axis.at(axis.length / 2), 6))

    run_id: dict[int, int] = {}
    elements: list[Element] = []
    for part, kind, run in sorted(parts, key=place):
        found = part.found
        model = found.fit.model
        run_id.setdefault(run, len(run_id) + 1)
        start_radius, end_radius = replace(found, axis=part.axis).radii
        size = nominal_size(2 * start_radius, settings.catalogue, settings.size_tolerance_pct)
        shift = float(found.axis.pipe_coordinates(part.axis.start[None])[0][0])
        elements.append(
            Element(
                element_id=len(elements) + 1,
                run_id=run_id[run],
                kind=kind,
                axis=part.axis,
                radius=start_radius,
                radius_sd=found.radius_sd,
                radius_end=end_radius,
                centre=np.full(3, np.nan) if isinstance(model, LineSurface) else model.centre,
                n_points=0,
                n_profiles=0,
                arc=found.extent.arc,
                rms=found.fit.sigma,
                nominal=size if kind in SIZED else None,
                gaps=tuple((a - shift, b - shift) for a, b in found.extent.gaps),
            )
        )
    return BuiltElements(
        tuple(elements), tuple(p.found.own for p, _, _ in sorted(parts, key=place))
    )
