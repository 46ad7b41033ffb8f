"""Selection: proposals refined the best supported first, each surface accepted once."""

import numpy as np
from numpy.typing import NDArray

from pipecore.elements.fittings.bends import Corner, corner_between, find_corners, fit_bend
from pipecore.elements.fittings.flanges import find_flanges
from pipecore.elements.fittings.open_ends import extend_open_end
from pipecore.elements.fittings.reducers import find_steps, fit_reducer
from pipecore.elements.fittings.straight_ends import straight_ends
from pipecore.elements.gates.acceptance import failed_gate
from pipecore.elements.gates.refusals import rounded_corner, shortfall
from pipecore.elements.gates.rounded_corners import is_rounded_corner
from pipecore.elements.not_accepted import NotAccepted
from pipecore.elements.proposals import LONG_STRAIGHT_RADII, Proposal
from pipecore.elements.refinement.fitted_element import FittedElement
from pipecore.elements.refinement.nearby_points import NearbyPoints
from pipecore.elements.refinement.refine import refine_proposal
from pipecore.elements.refinement.surface_fits import LineSurface, SphereSurface
from pipecore.elements.runs.ends import End, Link
from pipecore.elements.runs.joining import join_bowed
from pipecore.elements.speculative_refinement import refine_speculatively
from pipecore.progress import Progress
from pipecore.settings import ElementSettings

_Refused = tuple[FittedElement, str]
"""What was refused, and the gate that it failed."""
MIN_STRAIGHT_RADII = 1.5
"""Shorter straights wait for the bends: they may be part of one; radii."""


def select_elements(
    proposals: list[Proposal], nearby: NearbyPoints, settings: ElementSettings, progress: Progress
) -> tuple[list[FittedElement], list[Link], NotAccepted]:
    """Refine proposals, the best supported first, and keep those that pass the gates.

    Spheres and long straights come first, then the fittings between these straights, then
    the bends and short straights that the ellipses show on their own.

    Parameters
    ----------
    proposals : list of Proposal
        In any order.
    nearby : NearbyPoints
    settings : ElementSettings
    progress : Progress
        Receives fractions of the stage "elements".

    Returns
    -------
    fitted : list of FittedElement
    links : list of (int, int)
        Numbers of fittings and of the straights that they were fitted to.
    not_accepted : NotAccepted
        What was refused.
    """
    selector = Selector(nearby, settings)
    spheres, straights, rest = _by_support(proposals)
    selector.try_proposals(spheres, progress, (0.3, 0.31))
    short = selector.try_proposals(
        straights, progress, (0.31, 0.65), min_lengths=MIN_STRAIGHT_RADII
    )
    progress.update("elements", 0.65)
    selector.join_bowed()
    for corner, bend_radius, ends in find_corners(
        list(selector.fitted), nearby, progress, (0.65, 0.67)
    ):
        progress.update("elements", 0.67)
        selector.try_bend(corner, bend_radius, ends)
    selector.try_reducers()
    selector.extend_open_ends(progress)
    for ring in find_flanges(list(selector.fitted), nearby, selector.is_free):
        progress.update("elements", 0.7)
        selector.accept(ring)
    selector.try_proposals(short + rest, progress, (0.7, 0.95))
    selector.try_reducers()  # also between what has been found since
    progress.update("elements", 1.0)
    return *selector.result(), selector.not_accepted


def _by_support(proposals: list[Proposal]) -> tuple[list[Proposal], list[Proposal], list[Proposal]]:
    """Spheres, long straights and the rest, each with most ellipses first.

    Equal counts are ordered by radius and position, so that the order of the list is no matter.
    """
    groups: tuple[list[Proposal], list[Proposal], list[Proposal]] = ([], [], [])
    for proposal in sorted(
        proposals, key=lambda p: (-len(p.ellipses), p.model.radius, *p.model.position.tolist())
    ):
        match proposal.model:
            case SphereSurface():
                groups[0].append(proposal)
            case LineSurface(is_tapered=False, radius=r) if (
                proposal.length > LONG_STRAIGHT_RADII * r
            ):
                groups[1].append(proposal)
            case _:
                groups[2].append(proposal)
    return groups


class Selector:
    """The accepted elements, and which downsampled points are still free.

    Parameters
    ----------
    nearby : NearbyPoints
    settings : ElementSettings

    Attributes
    ----------
    fitted : list of FittedElement
        Accepted so far.
    is_free : ndarray of bool
        Downsampled points that are on none of them.
    links : list of (int, int)
        Numbers of fittings and of the straights that they were fitted to.
    """

    def __init__(self, nearby: NearbyPoints, settings: ElementSettings) -> None:
        self.fitted: list[FittedElement] = []
        self.is_free = np.ones(len(nearby.surface.xyz), np.bool_)
        self._nearby = nearby
        self._settings = settings
        self.links: list[Link] = []
        self._joined: set[End] = set()
        self._replaced: set[int] = set()
        self.not_accepted = NotAccepted(nearby.surface, self.is_free)

    def try_proposals(
        self,
        proposals: list[Proposal],
        progress: Progress,
        span: tuple[float, float],
        min_lengths: float = 0.0,
    ) -> list[Proposal]:
        """Refine proposals, several at once, and accept those that are valid in their turn.

        Returns those that could be fitted but are shorter than `min_lengths` radii; they are
        not accepted.
        """
        refused: dict[int, list[_Refused]] = {}

        def refine(proposal: Proposal, used: list[NDArray[np.intp]]) -> FittedElement | None:
            # One that is refined again is refused again: the last time counts.
            mine: list[_Refused] = []
            refused[id(proposal)] = mine
            return self._refine(proposal, self.is_free, used, mine)

        short = []
        refined = refine_speculatively(proposals, refine, self.is_free, progress, span)
        for proposal, found in refined:
            why = refused.pop(id(proposal))
            if found is None:
                self._note(why)
                continue
            if found.axis.length < min_lengths * found.fit.model.radius:
                short.append(proposal)
            else:
                self._accept_if_valid(found)
        return short

    def try_proposal(self, proposal: Proposal, between: tuple[End, ...] | None = None) -> None:
        """Refine a proposal and accept it if it is valid; see `_usable` for `between`."""
        usable = self._usable(between)
        if usable is not None:
            refused: list[_Refused] = []
            found = self._refine(proposal, usable, refused=refused)
            if found is None:
                self._note(refused)
            self._accept_if_valid(found, between)

    def try_bend(self, corner: Corner, bend_radius: float, between: tuple[End, ...]) -> None:
        """Fit a bend at a corner and accept it if it is valid."""
        usable = self._usable(between)
        if usable is not None:
            found = fit_bend(corner, bend_radius, self._nearby, usable)
            self._accept_if_valid(found, between)

    def join_bowed(self) -> None:
        """Put one pipe about a curved axis in the place of straights that are pieces of it.

        Before fittings are looked for: beside a piece, what leaves its line looks like a ring.
        """
        self.fitted = join_bowed(self.fitted, self._nearby, self.is_free)

    def try_reducers(self) -> None:
        """Fit reducers between straights on one line and accept those that are valid.

        A straight that was found in the side of a reducer is replaced by it.
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
            extension = extend_open_end(end, self._nearby, self.is_free)
            if extension is None:
                continue
            bend, straight = extension
            n = len(self.fitted)
            if straight is not None:
                self.try_proposal(straight)
            new = straight_ends(self.fitted, n)
            for other in new:
                corner = corner_between(self.fitted, end, other, self._nearby)
                if corner is not None:
                    self.try_bend(corner[1], corner[2], (end.which, other.which))
            if end.which not in self._joined:
                self.try_proposal(bend, between=(end.which,))
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
        proposal: Proposal,
        usable: NDArray[np.bool_],
        used: list[NDArray[np.intp]] | None = None,
        refused: list[_Refused] | None = None,
    ) -> FittedElement | None:
        def is_promising(rough: FittedElement, slack: float) -> bool:
            gate = failed_gate(rough, self._nearby.surface, self._settings, slack)
            if gate is not None and refused is not None:
                refused[:] = [(rough, gate)]
            return gate is None

        return refine_proposal(proposal, self._nearby, usable, is_promising, used)

    def _note(self, refused: list[_Refused]) -> None:
        """Remember what was refused, if anything could be fitted."""
        for found, gate in refused:
            self.not_accepted.add(
                found, shortfall(found, gate, self._nearby.surface, self._settings)
            )

    def _accept_if_valid(
        self, found: FittedElement | None, between: tuple[End, ...] | None = None
    ) -> bool:
        if found is None:
            return False
        gate = failed_gate(found, self._nearby.surface, self._settings)
        if gate is not None:
            self._note([(found, gate)])
            return False
        if is_rounded_corner(found, self._nearby):
            self.not_accepted.add(found, rounded_corner())
            return False
        self.accept(found, between)
        return True

    def accept(self, found: FittedElement, between: tuple[End, ...] | None = None) -> None:
        """Add an element; its points are no longer free, nor are the ends that it joins."""
        if between is not None:
            self._joined.update(between)
            self.links += [(len(self.fitted), i) for i, _ in between]
        self.is_free[found.inliers] = False
        self.fitted.append(found)

    def result(self) -> tuple[list[FittedElement], list[Link]]:
        """The accepted elements and links, without those that were replaced by others."""
        remaining = [i for i in range(len(self.fitted)) if i not in self._replaced]
        number = {i: k for k, i in enumerate(remaining)}
        links = [(number[a], number[b]) for a, b in self.links if {a, b} <= number.keys()]
        return [self.fitted[i] for i in remaining], links
