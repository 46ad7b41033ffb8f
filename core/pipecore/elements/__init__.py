"""Elements: pieces of axes refined, told true from false, joined to runs (paper, 3.3.5)."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pipecore.catalogues import nominal_size
from pipecore.elements.ahead import refine_in_turn
from pipecore.elements.corners import is_rounded_corner
from pipecore.elements.fittings import (
    End,
    flanges,
    propose_bends,
    propose_flanges,
    propose_reducers,
)
from pipecore.elements.joining import join_straights
from pipecore.elements.nearby import NearbyPoints
from pipecore.elements.pieces import LONG_PIECE, Piece, find_pieces
from pipecore.elements.refine import Fitted, refine_piece
from pipecore.elements.runs import Span, branches, meeting_ends, number_runs, trim_to_tangent
from pipecore.elements.surfaces import ArcSurface, LineSurface, SphereSurface
from pipecore.geometry import ArcAxis, LineAxis
from pipecore.progress import Progress
from pipecore.settings import ElementSettings
from pipecore.types import Element, ElementKind

__all__ = ["BuiltElements", "NearbyPoints", "build_elements", "find_pieces"]

Array = NDArray[np.float64]

MIN_COVERAGE = 0.5
"""Share of an element's length that must be covered by points."""
MIN_ARC, MIN_BEND_ARC = np.deg2rad(55.0), np.deg2rad(75.0)
MIN_SHARP_ARC, VERY_SHARP_RADIUS_SD = np.deg2rad(36.0), 0.005
"""A straight may show less than `MIN_ARC` where the points carry the radius to this share."""
SURE_ARC, SHARP_RADIUS_SD, LONG_RADIUS_SD = np.deg2rad(100.0), 0.010, 0.035
"""On shorter arcs the points must carry the radius to this share of it, or to the latter ..."""
LONG = 3.0
"""... where a straight is longer than this many radii: no corner and no chance is."""
MAX_RADIUS_SD = 0.04
"""Largest standard deviation of a radius, as a share of it."""
MAX_MISFIT, MAX_NOISE_MISFIT = 0.015, 0.35
"""Largest root mean square by which a section leaves circle and oval, in radii and in noise."""
MAX_SPHERE_MISFIT = 0.001
"""The same for spheres, over patches of the surface: vessel heads are flatter on top."""
MIN_TAPER_CHANGE = 0.06
"""A cone's radius changes at least by this share."""
MIN_LENGTH = 0.35
"""Shortest cylinder, in radii: a slice of a vessel's head is shorter."""
WIDE, WHOLE_ARC, MIN_WIDE_LENGTH = 0.18, np.deg2rad(200.0), 0.6
"""Wide cylinders that are not seen all round are longer than this many radii: heads are not."""


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
    for i, end_i, j, end_j in meeting_ends(spans):
        links.append((i, j))
        axes[i], axes[j] = _trimmed(axes[i], end_i, axes[j], end_j, fitted[i].fit.model.radius)
    links += branches([Span(axis, f.radii) for axis, f in zip(axes, fitted, strict=True)])
    kinds = [_kind(f) for f in fitted]
    for i, j in flanges(fitted):
        kinds[i] = ElementKind.FLANGE
        links.append((i, j))
    run = number_runs(len(fitted), links)
    kept = [i for i in range(len(fitted)) if _is_reported(fitted[i], kinds[i], run, i, settings)]
    return _numbered(
        [fitted[i] for i in kept],
        [axes[i] for i in kept],
        [kinds[i] for i in kept],
        run[kept],
        settings,
    )


def refine_pieces(
    pieces: list[Piece], nearby: NearbyPoints, settings: ElementSettings, progress: Progress
) -> tuple[list[Fitted], list[tuple[int, int]]]:
    """Refine what was proposed, the surest first; drop what does not hold.

    Returns the fitted pieces, and pairs (fitting, straight) that belong together.

    Spheres and long straights come first, then the fittings that these ask for, then
    the bends and short straights that the ellipses show on their own.
    """
    keeper = _Keeper(nearby, settings)
    spheres, straights, rest = _by_support(pieces)
    keeper.try_pieces(spheres + straights, progress, (0.3, 0.65))
    progress.update("elements", 0.65)
    joinable = list(keeper.fitted)
    for piece, ends in propose_bends(joinable, nearby):
        progress.update("elements", 0.67)
        keeper.try_piece(piece, between=ends)
    for piece, ends in propose_reducers(joinable):
        keeper.try_piece(piece, between=ends)
    keeper.try_pieces(rest, progress, (0.7, 0.95))
    for piece in propose_flanges(list(keeper.fitted), nearby, keeper.is_free):
        progress.update("elements", 0.97)
        keeper.try_piece(piece)
    progress.update("elements", 1.0)
    return keeper.fitted, keeper.links


def _by_support(pieces: list[Piece]) -> tuple[list[Piece], list[Piece], list[Piece]]:
    """Spheres, long straights and the rest, each with most ellipses first.

    Equal counts are told apart by place, not by the order in which they were found.
    """
    groups: tuple[list[Piece], list[Piece], list[Piece]] = ([], [], [])
    for piece in sorted(
        pieces, key=lambda p: (-len(p.ellipses), p.model.radius, *p.model.position.tolist())
    ):
        match piece.model:
            case SphereSurface():
                groups[0].append(piece)
            case LineSurface(is_tapered=False, radius=r) if piece.high - piece.low > LONG_PIECE * r:
                groups[1].append(piece)
            case _:
                groups[2].append(piece)
    return groups


class _Keeper:
    """Keeps the fitted pieces and which thinned points they have taken."""

    def __init__(self, nearby: NearbyPoints, settings: ElementSettings) -> None:
        self.fitted: list[Fitted] = []
        self.is_free = np.ones(len(nearby.surface.xyz), np.bool_)
        self._nearby = nearby
        self._settings = settings
        self.links: list[tuple[int, int]] = []
        self._joined: set[End] = set()

    def try_pieces(
        self, pieces: list[Piece], progress: Progress, span: tuple[float, float]
    ) -> None:
        """Refine pieces, several at once, and keep those that hold in their turn."""

        def refine(piece: Piece, used: list[NDArray[np.intp]]) -> Fitted | None:
            return self._refine(piece, self.is_free, used)

        for _, found in refine_in_turn(pieces, refine, self.is_free, progress, span):
            self._keep_if_it_holds(found)

    def try_piece(self, piece: Piece, between: tuple[End, End] | None = None) -> None:
        """Refine a piece and keep it if it holds.

        `between` are the ends of straights that it joins: they may have been followed
        into it, so their points may be used too. Each end is joined once.
        """
        usable = self.is_free
        if between is not None:
            if not self._joined.isdisjoint(between):
                return
            usable = usable.copy()
            for i, _ in between:
                usable[self.fitted[i].own] = True
        self._keep_if_it_holds(self._refine(piece, usable), between)

    def _refine(
        self,
        piece: Piece,
        usable: NDArray[np.bool_],
        used: list[NDArray[np.intp]] | None = None,
    ) -> Fitted | None:
        return refine_piece(
            piece,
            self._nearby,
            usable,
            lambda rough, slack: is_credible(rough, self._nearby, self._settings, slack),
            used,
        )

    def _keep_if_it_holds(
        self, found: Fitted | None, between: tuple[End, End] | None = None
    ) -> None:
        if found is None or not is_credible(found, self._nearby, self._settings):
            return
        if is_rounded_corner(found, self._nearby):
            return
        if between is not None:
            self._joined.update(between)
            self.links += [(len(self.fitted), i) for i, _ in between]
        self.is_free[found.own] = False
        self.fitted.append(found)


def is_credible(
    found: Fitted, nearby: NearbyPoints, settings: ElementSettings, slack: float = 1.0
) -> bool:
    """Whether a refined piece is a pipe element and not a corner, a bundle or a chance.

    `slack` multiplies the limits of what a last round of fitting can mend.
    """
    model, extent = found.fit.model, found.extent
    radius = model.radius
    is_sized = settings.min_radius_mm <= radius * 1e3 <= settings.max_radius_mm
    misfit = found.misfit / slack
    radius_sd = found.fit.radius_sd / slack**2
    max_sigma = slack * min(max(4.0 * nearby.surface.noise, 0.004), 0.08 * radius)
    if not is_sized or found.fit.sigma > max_sigma or radius_sd > MAX_RADIUS_SD * radius:
        return False
    if isinstance(model, SphereSurface):
        return len(found.own) >= 60 and misfit < MAX_SPHERE_MISFIT * radius + 0.0003
    is_round = misfit < MAX_MISFIT * radius + MAX_NOISE_MISFIT * found.fit.sigma
    is_straight = isinstance(model, LineSurface)
    is_very_sharp = is_straight and radius_sd < VERY_SHARP_RADIUS_SD * radius
    least_arc = MIN_SHARP_ARC if is_very_sharp else MIN_ARC
    is_seen = extent.coverage >= MIN_COVERAGE / slack and extent.arc >= least_arc / slack
    is_long = is_straight and found.axis.length > LONG * radius
    sharp = LONG_RADIUS_SD if is_long else SHARP_RADIUS_SD
    is_sharp = extent.arc >= SURE_ARC or radius_sd < sharp * radius
    if not (is_round and is_seen and is_sharp):
        return False
    if isinstance(model, ArcSurface):
        is_seen = extent.arc >= MIN_BEND_ARC
        return is_seen and model.bend_radius > 1.02 * radius and found.axis.length > 0.4 * radius
    if model.is_tapered:
        change = abs(found.radii[1] - found.radii[0])
        return change > MIN_TAPER_CHANGE * radius and found.axis.length > 0.3 * radius
    shortest = MIN_WIDE_LENGTH * radius if radius > WIDE and extent.arc < WHOLE_ARC else 0.0
    return found.axis.length > max(2.0 * nearby.surface.voxel, shortest)


def _kind(found: Fitted) -> ElementKind:
    match found.fit.model:
        case LineSurface(is_tapered=True):
            return ElementKind.CONE
        case LineSurface():
            return ElementKind.CYLINDER
        case ArcSurface():
            return ElementKind.TORUS
    return ElementKind.SPHERE


def _is_reported(
    found: Fitted, kind: ElementKind, run: NDArray[np.int32], i: int, settings: ElementSettings
) -> bool:
    """Whether an element stands for itself: short straights must be part of a run."""
    if kind is not ElementKind.CYLINDER:
        return True
    shortest = MIN_LENGTH * found.fit.model.radius
    if (run == run[i]).sum() == 1:
        shortest = max(shortest, settings.min_length_mm / 1e3)
    return found.axis.length >= shortest


def _trimmed_to_fitting(
    straight: LineAxis | ArcAxis, fitting: LineAxis | ArcAxis
) -> tuple[LineAxis | ArcAxis, LineAxis | ArcAxis]:
    """A straight and the fitting at its nearer end, cut where one takes over from the other."""
    if not isinstance(straight, LineAxis):
        return straight, fitting
    middle = fitting.at(fitting.length / 2)
    end = int(np.linalg.norm(straight.end - middle) < np.linalg.norm(straight.start - middle))
    if isinstance(fitting, ArcAxis):
        corner = straight.at((fitting.centre - straight.start) @ straight.direction)
        arc_end = int(np.linalg.norm(fitting.end - corner) < np.linalg.norm(fitting.start - corner))
        return trim_to_tangent(straight, end, fitting, arc_end, 0.5 * straight.length)
    return straight, fitting


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
    fitted: list[Fitted],
    axes: list[LineAxis | ArcAxis],
    kinds: list[ElementKind],
    run: NDArray[np.int32],
    settings: ElementSettings,
) -> BuiltElements:
    """Elements in their final order: the longest run first, along each run."""
    if not fitted:
        return BuiltElements((), ())
    length = np.bincount(run, [a.length for a in axes])
    order = sorted(
        range(len(fitted)),
        key=lambda i: (-length[run[i]], run[i], *np.round(axes[i].at(axes[i].length / 2), 6)),
    )
    run_id: dict[int, int] = {}
    elements: list[Element] = []
    own = []
    for i in order:
        found = fitted[i]
        model = found.fit.model
        run_id.setdefault(int(run[i]), len(run_id) + 1)
        start_radius, end_radius = replace(found, axis=axes[i]).radii
        size = nominal_size(2 * start_radius, settings.catalogue, settings.size_tolerance_pct)
        is_sized = kinds[i] in (ElementKind.CYLINDER, ElementKind.TORUS)
        shift = float(found.axis.pipe_coordinates(axes[i].start[None])[0][0])
        elements.append(
            Element(
                element_id=len(elements) + 1,
                run_id=run_id[int(run[i])],
                kind=kinds[i],
                axis=axes[i],
                radius=start_radius,
                radius_sd=found.radius_sd,
                radius_end=end_radius,
                centre=np.full(3, np.nan) if isinstance(model, LineSurface) else model.centre,
                n_points=0,
                n_profiles=0,
                arc=found.extent.arc,
                rms=found.fit.sigma,
                nominal=size if is_sized else None,
                gaps=tuple((a - shift, b - shift) for a, b in found.extent.gaps),
            )
        )
        own.append(found.own)
    return BuiltElements(tuple(elements), tuple(own))
