"""Refinement: a robust geometric fit of each proposal to all points around it, and its extent."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipecore._kernels.axis_rows import points_between
from pipecore.elements.proposals import Proposal
from pipecore.elements.refinement.extent import Extent, find_extent, section_misfit
from pipecore.elements.refinement.fitted_element import FittedElement
from pipecore.elements.refinement.guess import Guess, axis_between, band_of
from pipecore.elements.refinement.nearby_points import (
    MIN_DEPTH_RADII,
    RADIAL_COS,
    NearbyPoints,
    PointsOnSurface,
)
from pipecore.elements.refinement.oval_fit import fit_oval, section_remover
from pipecore.elements.refinement.refine_sphere import (
    LAST_ROUND_SLACK,
    N_ROUNDS,
    refine_sphere,
)
from pipecore.elements.refinement.sampled_fits import (
    fit_measured,
    fit_roughly,
    points_off_bands,
)
from pipecore.elements.refinement.surface_fits import SphereSurface, SurfaceFit
from pipecore.geometry import AnyAxis, ArcAxis

Indices = NDArray[np.intp]
Flags = NDArray[np.bool_]

LAST_FIT_SLACK = 1.15
"""Factor on the limits of acceptance for an element whose last fit, to all points, is to come."""
MIN_POINTS_OFF_ENDS = 30
"""Points from which on a fit leaves out those near the ends."""
MIN_SCATTER_NOISES, MIN_SCATTER_RADII = 1.5, 0.005
"""A section model is tried where points scatter about the round surface by more than so many
times their noise and more than this share of the radius."""


def refine_proposal(
    proposal: Proposal,
    nearby: NearbyPoints,
    is_free: Flags,
    is_promising: Callable[[FittedElement, float], bool] = lambda fitted, slack: True,
    used: list[Indices] | None = None,
) -> FittedElement | None:
    """Fit a proposed surface to the cloud's points and find its extent.

    Fit and extent improve each other in a few rounds.

    Parameters
    ----------
    proposal : Proposal
    nearby : NearbyPoints
    is_free : ndarray of bool
        Downsampled points that no other element has taken.
    is_promising : callable
        Asked, with a slack for the limits of what later rounds can mend, before the last
        round, which alone uses all points: most proposals end there. Of spheres already after
        the first round.
    used : list, optional
        The free points that were looked at are appended.

    Returns
    -------
    FittedElement or None
        None where the surface is not well determined.
    """
    used = [] if used is None else used
    if isinstance(proposal.model, SphereSurface):
        return refine_sphere(proposal.model, nearby, is_free, is_promising, used)
    model = proposal.model
    guess = Guess(
        model,
        axis_between(model, proposal.low, proposal.high),
        max(nearby.surface.noise, 0.001, 0.01 * model.radius),
    )
    fitted: FittedElement | None = None
    for round_ in range(N_ROUNDS - 1):
        rough = _refine_roughly(guess, round_, nearby, is_free, used)
        if rough is None:
            return None
        guess, fitted = rough
    if fitted is None or not is_promising(fitted, LAST_ROUND_SLACK):
        return None
    return _refine_finally(guess, fitted, nearby, is_free, is_promising, used)


@dataclass(frozen=True, eq=False)
class _Neighbourhood:
    """The points on a guessed surface, how far they reach, and those that a fit takes."""

    near: PointsOnSurface
    extent: Extent
    inliers: Indices
    chosen: Indices
    misfit: float


def _points_on(
    guess: Guess, round_: int, nearby: NearbyPoints, is_free: Flags, used: list[Indices]
) -> _Neighbourhood | None:
    """The points on a guessed surface; None where they do not cover its axis."""
    model, axis, sigma, section = guess.model, guess.axis, guess.sigma, guess.section
    near = nearby.on_surface(
        model, axis, _margin(axis, model.radius, round_), is_free,
        band=band_of(sigma) + (section.max_height if section else 0.0),
        depth=MIN_DEPTH_RADII * model.radius, min_cos=RADIAL_COS, is_rough=round_ < N_ROUNDS - 1,
    )  # fmt: skip
    used.append(near.inliers)
    if section is not None:
        near = near.about(section, band_of(sigma))
    extent = find_extent(
        near.chainage, near.clock, near.residual, near.normal_angle, near.inside,
        axis.length, model.radius, near.spacing, sigma,
    )  # fmt: skip
    if extent is None:
        return None
    # Near the ends other surfaces begin, so the fit stays clear of them.
    clear = min(0.3 * model.radius, 0.1 * (extent.high - extent.low))
    inliers, inlier_clock, inlier_residual, chosen = points_between(
        near.inliers, near.chainage, near.clock, near.residual,
        extent.low, extent.high, clear, MIN_POINTS_OFF_ENDS,
    )  # fmt: skip
    misfit = section_misfit(inlier_clock, inlier_residual, extent.arc, nearby.rounding)
    return _Neighbourhood(near, extent, inliers, chosen, misfit)


def _refine_roughly(
    guess: Guess, round_: int, nearby: NearbyPoints, is_free: Flags, used: list[Indices]
) -> tuple[Guess, FittedElement | None] | None:
    """One round on downsampled points: the next guess, and the element as fitted so far."""
    on = _points_on(guess, round_, nearby, is_free, used)
    if on is None:
        # A section may be so far from round that the circle runs along its points nowhere.
        oval = None if round_ else fit_oval(guess, 2 * np.pi, nearby, is_free, used)
        return None if oval is None else (oval[0], None)
    scale = 3.0 * guess.sigma
    fit = fit_roughly(
        guess.model, on.chosen, nearby, scale, section_remover(guess.axis, guess.section)
    )
    if fit is None:
        return None
    fitted = FittedElement(fit, guess.axis, on.inliers, on.extent, on.misfit, guess.section)
    following = guess.after(fit, on.extent.low, on.extent.high)
    rough = max(MIN_SCATTER_NOISES * nearby.surface.noise, MIN_SCATTER_RADII * fit.model.radius)
    if guess.section is None and following.sigma <= rough:
        return following, fitted
    oval = fit_oval(following, on.extent.arc, nearby, is_free, used)
    if oval is None:
        return following, fitted
    following, fit = oval
    section = following.section
    fitted = FittedElement(fit, following.axis, on.inliers, on.extent, 0.0, section)
    return following, fitted


def _refine_finally(
    guess: Guess,
    fitted: FittedElement,
    nearby: NearbyPoints,
    is_free: Flags,
    is_promising: Callable[[FittedElement, float], bool],
    used: list[Indices],
) -> FittedElement | None:
    """The last round, on all points; `fitted` is the element of the round before."""
    on = _points_on(guess, N_ROUNDS - 1, nearby, is_free, used)
    if on is None:
        return None
    with_fit = partial(
        FittedElement,
        axis=guess.axis,
        inliers=on.inliers,
        extent=on.extent,
        misfit=on.misfit,
        section=guess.section,
    )
    # All but the fit itself is final.
    if (
        not is_promising(with_fit(fitted.fit), LAST_FIT_SLACK)
        and points_off_bands(fitted.fit, on.chosen, nearby, on.near.spacing) is None
    ):
        return None
    fit = fit_measured(
        guess.model, on.chosen, nearby, 3.0 * guess.sigma, on.near.spacing,
        partial(_holds, is_promising, with_fit), section_remover(guess.axis, guess.section),
    )  # fmt: skip
    if fit is None:
        return None
    last = guess.after(fit, on.extent.low, on.extent.high)
    return _placed(with_fit(fit), last.axis)


def _placed(fitted: FittedElement, axis: AnyAxis) -> FittedElement:
    """The element with the axis of its last fit, its extent counted from the axis's start."""
    old = fitted.extent
    gaps = tuple((a - old.low, b - old.low) for a, b in old.gaps)
    extent = Extent(0.0, axis.length, old.arc, old.coverage, gaps)
    return FittedElement(
        fitted.fit,
        axis,
        fitted.inliers,
        extent,
        fitted.misfit,
        fitted.section.from_chainage(old.low) if fitted.section else None,
    )


def _margin(axis: AnyAxis, radius: float, round_: int) -> float:
    """How far beyond its ends an axis may grow in this round."""
    if isinstance(axis, ArcAxis):
        opening = (2 * np.pi - axis.bend_angle) * axis.bend_radius
        return min(0.8 * radius, 0.5 * opening)
    return radius if round_ == 0 else 0.5 * axis.length + 4.0 * radius


def _holds(
    is_promising: Callable[[FittedElement, float], bool],
    with_fit: Callable[[SurfaceFit[Any]], FittedElement],
    fit: SurfaceFit[Any],
) -> bool:
    """Whether an element is promising with the fit of a sample."""
    return is_promising(with_fit(fit), LAST_FIT_SLACK)
