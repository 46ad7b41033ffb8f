"""Which pieces hold: refined the surest first, each surface taken once."""

import numpy as np
from numpy.typing import NDArray

from pipecore.elements.fittings.bends import Corner, corner_between, find_corners, fit_bend
from pipecore.elements.fittings.flanges import find_flanges
from pipecore.elements.fittings.open_ends import extend_open_end
from pipecore.elements.fittings.reducers import find_steps, fit_reducer
from pipecore.elements.fittings.straight_ends import straight_ends
from pipecore.elements.gates.acceptance import passes_gates
from pipecore.elements.gates.rounded_corners import is_rounded_corner
from pipecore.elements.proposals import LONG_PIECE, Proposal
from pipecore.elements.refinement.nearby_points import NearbyPoints
from pipecore.elements.refinement.refine import FittedElement, refine_proposal
from pipecore.elements.refinement.surface_fits import LineSurface, SphereSurface
from pipecore.elements.runs.ends import End, Link
from pipecore.elements.speculative_refinement import refine_speculatively
from pipecore.progress import Progress
from pipecore.settings import ElementSettings

SHORT = 1.5
"""Straights of fewer radii wait for the bends: they may be part of one."""


def select_elements(
    pieces: list[Proposal], nearby: NearbyPoints, settings: ElementSettings, progress: Progress
) -> tuple[list[FittedElement], list[Link]]:
    """Refine what was proposed, the surest first; drop what does not hold.

    Returns the fitted pieces, and pairs (fitting, straight) that belong together.

    Spheres and long straights come first, then the fittings that these ask for, then
    the bends and short straights that the ellipses show on their own.
    """
    keeper = Selector(nearby, settings)
    spheres, straights, rest = _by_support(pieces)
    keeper.try_pieces(spheres, progress, (0.3, 0.31))
    put_off = keeper.try_pieces(straights, progress, (0.31, 0.65), min_lengths=SHORT)
    progress.update("elements", 0.65)
    joinable = list(keeper.fitted)

    for corner, bend_radius, ends in find_corners(joinable, nearby, progress, (0.65, 0.67)):
        progress.update("elements", 0.67)
        keeper.try_bend(corner, bend_radius, ends)
    keeper.try_reducers()
    keeper.extend_open_ends(progress)
    for ring in find_flanges(list(keeper.fitted), nearby, keeper.is_free):
        progress.update("elements", 0.7)
        keeper.keep(ring)
    keeper.try_pieces(put_off + rest, progress, (0.7, 0.95))
    keeper.try_reducers()  # also between what has been found since
    progress.update("elements", 1.0)
    return keeper.result()


def _by_support(pieces: list[Proposal]) -> tuple[list[Proposal], list[Proposal], list[Proposal]]:
    """Spheres, long straights and the rest, each with most ellipses first.

    Equal counts are told apart by place, not by the order in which they were found.
    """
    groups: tuple[list[Proposal], list[Proposal], list[Proposal]] = ([], [], [])
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


class Selector:
    """Keeps the fitted pieces and which downsampled points they have taken."""

    def __init__(self, nearby: NearbyPoints, settings: ElementSettings) -> None:
        self.fitted: list[FittedElement] = []
        self.is_free = np.ones(len(nearby.surface.xyz), np.bool_)
        self._nearby = nearby
        self._settings = settings
        self.links: list[Link] = []
        self._joined: set[End] = set()
        self._replaced: set[int] = set()

    def try_pieces(
        self,
        pieces: list[Proposal],
        progress: Progress,
        span: tuple[float, float],
        min_lengths: float = 0.0,
    ) -> list[Proposal]:
        """Refine pieces, several at once, and keep those that hold in their turn.

        Returns those that hold but are shorter than `min_lengths` radii; they are not kept.
        """

        def refine(piece: Proposal, used: list[NDArray[np.intp]]) -> FittedElement | None:
            return self._refine(piece, self.is_free, used)

        short = []
        for piece, found in refine_speculatively(pieces, refine, self.is_free, progress, span):
            if found is None:
                continue
            if found.axis.length < min_lengths * found.fit.model.radius:
                short.append(piece)
            else:
                self._accept_if_valid(found)
        return short

    def try_piece(self, piece: Proposal, between: tuple[End, ...] | None = None) -> None:
        """Refine a piece and keep it if it holds; see `_usable` for `between`."""
        usable = self._usable(between)
        if usable is not None:
            self._accept_if_valid(self._refine(piece, usable), between)

    def try_bend(self, corner: Corner, bend_radius: float, between: tuple[End, ...]) -> None:
        """Fit a bend at a corner and keep it if it holds."""
        usable = self._usable(between)
        if usable is not None:
            found = fit_bend(corner, bend_radius, self._nearby, usable)
            self._accept_if_valid(found, between)

    def try_reducers(self) -> None:
        """Fit reducers between straights on one line and keep those that hold.

        A straight that was found in the side of one gives way to it.
        """
        for step in find_steps(self.fitted):
            between = step.one.which, step.other.which
            usable = self._usable(between)
            if usable is None:
                continue
            inner = [i for i, f in enumerate(self.fitted) if step.has_between(f)]
            inner = [i for i in inner if self._joined.isdisjoint({(i, 0), (i, 1)})]
            for i in inner:
                usable[self.fitted[i].inliers] = True
            straights = self.fitted[between[0][0]], self.fitted[between[1][0]]
            found = fit_reducer(step, straights, self._nearby, usable)
            if self._accept_if_valid(found, between):
                self._joined |= {(i, end) for i in inner for end in (0, 1)}
                self._replaced.update(inner)

    def extend_open_ends(self, progress: Progress) -> None:
        """Look for a bend, and the straight beyond it, where nothing joins a straight yet."""
        ends = straight_ends(self.fitted)
        while ends:
            progress.update("elements", 0.68)
            end = ends.pop(0)
            if end.which in self._joined:
                continue
            followed = extend_open_end(end, self._nearby, self.is_free)
            if followed is None:
                continue
            bend, straight = followed
            n = len(self.fitted)
            if straight is not None:
                self.try_piece(straight)
            new = straight_ends(self.fitted, n)
            for other in new:
                corner = corner_between(self.fitted, end, other, self._nearby)
                if corner is not None:
                    self.try_bend(corner[1], corner[2], (end.which, other.which))
            if end.which not in self._joined:
                self.try_piece(bend, between=(end.which,))
            ends += new

    def _usable(self, between: tuple[End, ...] | None) -> NDArray[np.bool_] | None:
        """Points that are free or on the straights that are joined; None if an end is taken.

        Straights may have been followed into what joins them. Each end is joined once.
        """
        if between is None:
            return self.is_free
        if not self._joined.isdisjoint(between):
            return None
        usable = self.is_free.copy()
        for i, _ in between:
            usable[self.fitted[i].inliers] = True
        return usable

    def _refine(
        self,
        piece: Proposal,
        usable: NDArray[np.bool_],
        used: list[NDArray[np.intp]] | None = None,
    ) -> FittedElement | None:
        return refine_proposal(
            piece,
            self._nearby,
            usable,
            lambda rough, slack: passes_gates(rough, self._nearby.surface, self._settings, slack),
            used,
        )

    def _accept_if_valid(
        self, found: FittedElement | None, between: tuple[End, ...] | None = None
    ) -> bool:
        if found is None or not passes_gates(found, self._nearby.surface, self._settings):
            return False
        if is_rounded_corner(found, self._nearby):
            return False
        self.keep(found, between)
        return True

    def keep(self, found: FittedElement, between: tuple[End, ...] | None = None) -> None:
        """Keep what holds; its points are taken, and the ends that it joins."""
        if between is not None:
            self._joined.update(between)
            self.links += [(len(self.fitted), i) for i, _ in between]
        self.is_free[found.inliers] = False
        self.fitted.append(found)

    def result(self) -> tuple[list[FittedElement], list[Link]]:
        """The pieces and links, without those that gave way to others."""
        left = [i for i in range(len(self.fitted)) if i not in self._replaced]
        number = {i: k for k, i in enumerate(left)}
        links = [(number[a], number[b]) for a, b in self.links if {a, b} <= number.keys()]
        return [self.fitted[i] for i in left], links
