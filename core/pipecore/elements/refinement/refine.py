"""Refinement: a robust geometric fit of each piece to all points around it, and its extent."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipecore._kernels.axis_rows import points_between
from pipecore._kernels.misfit import sphere_misfit
from pipecore.elements.proposals import Proposal, arc_direction
from pipecore.elements.refinement.extent import (
    MAX_SECTORS,
    Extent,
    find_extent,
    section_misfit,
)
from pipecore.elements.refinement.nearby_points import NearbyPoints, PointsOnSurface
from pipecore.elements.refinement.raised_bands import is_off_bands
from pipecore.elements.refinement.section_model import (
    MAX_HEIGHT,
    SectionModel,
    fit_section_model,
)
from pipecore.elements.refinement.surface_fits import (
    ArcSurface,
    LineSurface,
    SphereSurface,
    SurfaceFit,
    fit_surface,
)
from pipecore.ellipses import radius_sd_factor
from pipecore.geometry import ArcAxis, LineAxis, cross
from pipecore.robust import robust_sd, sample_evenly

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
Flags = NDArray[np.bool_]
AnySurface = LineSurface | ArcSurface | SphereSurface

RADIAL_COS = float(np.cos(np.deg2rad(30.0)))
"""A point belongs to a surface only if its normal is this close to the surface's."""
CLEAR_COS = float(np.cos(np.deg2rad(15.0)))
"""Beside bands the normals of the pipe's own points are this close to the surface's."""
MAX_FIT_POINTS, MAX_ROUGH_POINTS = 60_000, 1_500
"""Larger elements are fitted to an even sample of this many points; fewer in early rounds."""
LEAST_POINTS, SURE_POINTS, MANY_POINTS = 15, 4_000, 6_000
"""No fit takes fewer points. What early rounds are unsure of is judged as if they had used up
to so many points. More than many are fitted to at last if so many of them hold."""
LEAST_CLEAR = 30
"""Points from which on a fit stays clear of the ends."""
AGAIN = 1.5
"""A fit that starts from that of a sample takes so many times its standard deviation."""
INSIDE = 0.1
"""Points are well inside a surface from this share of its radius on."""
MAX_RADIUS_CHANGE = 0.25
"""A fit that leaves the proposed radius by more has found something else."""
PATCHES = 12, 8, 5
"""Patches of a sphere around and up, and the points from which on one counts."""
ROUGH_NOISE, ROUGH_SHARE = 1.5, 0.005
"""Where points scatter about the round surface by more than so many times their noise, and than
this share of the radius, the section may be no circle."""
OVAL_BAND, CLEARLY_BETTER = 0.13, 0.75
"""Points are looked at up to this distance from the round surface, in radii; a section model
counts where it leaves at most this share of their scatter."""
MIN_SIGMA = 0.0005
"""No guess of the scatter is smaller, metres."""
N_ROUNDS = 3
HARDLY_ROUGH, ROUGH, VERY_ROUGH = 1.15, 1.5, 3.0
"""Slack for pieces fitted to a sample at last, and for those whose last round of fitting is
still to come, or whose last two are."""


@dataclass(frozen=True, eq=False)
class FittedElement:
    """A piece fitted to the cloud.

    Parameters
    ----------
    fit : SurfaceFit
    axis : LineAxis or ArcAxis
        As scanned, from where the points start to where they end.
    inliers : ndarray of int
        Downsampled points on the surface.
    extent : Extent
        Along `axis`.
    misfit : float
        See `section_misfit`; metres.
    """

    fit: SurfaceFit[LineSurface] | SurfaceFit[ArcSurface] | SurfaceFit[SphereSurface]
    axis: LineAxis | ArcAxis
    inliers: Indices
    extent: Extent
    misfit: float
    section: SectionModel | None = None
    """How its section leaves the round one; None where it hardly does."""

    @property
    def _n_sectors(self) -> float:
        return max(self.extent.arc / (2 * np.pi) * MAX_SECTORS, 1.0)

    @property
    def excess_misfit(self) -> float:
        """How far the section leaves circle and oval beyond what noise does, metres."""
        by_noise = 0.5 * np.pi * self.fit.sigma**2 * self._n_sectors / max(len(self.inliers), 1)
        return float(np.sqrt(max(self.misfit**2 - by_noise, 0.0)))

    @property
    def radius_sd(self) -> float:
        """Standard deviation of the radius: the fit's, and what is off the round section.

        Sectors that leave circle and oval by more than noise does are as many wrong
        measurements of the radius as there are sectors; metres.
        """
        off_round = self.excess_misfit / np.sqrt(self._n_sectors)
        factor = float(radius_sd_factor(self.extent.arc))
        return float(np.hypot(self.fit.radius_sd, factor * off_round))

    @property
    def radii(self) -> tuple[float, float]:
        """Radius at the start and at the end of the axis, metres."""
        model = self.fit.model
        if not isinstance(model, LineSurface):
            return model.radius, model.radius
        return model.radius_at(self.axis.start), model.radius_at(self.axis.end)


def refine_proposal(
    piece: Proposal,
    nearby: NearbyPoints,
    is_free: Flags,
    is_promising: Callable[[FittedElement, float], bool] = lambda fitted, slack: True,
    used: list[Indices] | None = None,
) -> FittedElement | None:
    """Fit a piece's surface to the cloud's points and find how far it reaches.

    Fit and extent improve each other in a few rounds.

    Parameters
    ----------
    piece : Proposal
    nearby : NearbyPoints
    is_free : ndarray of bool
        Downsampled points that no other element has taken.
    is_promising : callable
        Asked, with a slack for the limits of what later rounds can mend, before the last
        round, which alone uses all points: most pieces end there. Of spheres already after
        the first round.
    used : list, optional
        The free points that had a say are added to it.

    Returns
    -------
    FittedElement or None
        None where the points do not carry the surface.
    """
    used = [] if used is None else used
    if isinstance(piece.model, SphereSurface):
        return _refine_sphere(piece.model, nearby, is_free, is_promising, used)
    model = piece.model
    guess = _Guess(
        model,
        axis_between(model, piece.low, piece.high),
        max(nearby.surface.noise, 0.001, 0.01 * model.radius),
    )
    fitted: FittedElement | None = None
    for round_ in range(N_ROUNDS - 1):
        rough = _refine_roughly(guess, round_, nearby, is_free, used)
        if rough is None:
            return None
        guess, fitted = rough
    if fitted is None or not is_promising(fitted, ROUGH):
        return None
    return _refine_finally(guess, fitted, nearby, is_free, is_promising, used)


@dataclass(frozen=True, eq=False)
class _Guess:
    """What a round of refinement begins with: a surface, how far it reaches, its section.

    The section model, if any, is counted along `axis`; `sigma` is the points' scatter about it.
    """

    model: LineSurface | ArcSurface
    axis: LineAxis | ArcAxis
    sigma: float
    section: SectionModel | None = None

    def after(self, fit: SurfaceFit[Any], low: float, high: float) -> "_Guess":
        """The fitted surface between two chainages of the old axis, still without a section."""
        axis = axis_through(fit.model, self.axis.at(np.array([low, high])))
        return _Guess(fit.model, axis, max(fit.sigma, MIN_SIGMA))


@dataclass(frozen=True, eq=False)
class _Look:
    """The points on a guessed surface, how far they reach, and those that a fit takes."""

    near: PointsOnSurface
    extent: Extent
    inliers: Indices
    chosen: Indices
    misfit: float


def _look_at(
    guess: _Guess, round_: int, nearby: NearbyPoints, is_free: Flags, used: list[Indices]
) -> _Look | None:
    """The points on a guessed surface; None where they do not cover its axis."""
    model, axis, sigma, section = guess.model, guess.axis, guess.sigma, guess.section
    near = nearby.on_surface(
        model, axis, _margin(axis, model.radius, round_), is_free,
        band=_band(sigma) + (section.max_height if section else 0.0),
        depth=INSIDE * model.radius, min_cos=RADIAL_COS, is_rough=round_ < N_ROUNDS - 1,
    )  # fmt: skip
    used.append(near.inliers)
    if section is not None:
        near = near.about(section, _band(sigma))
    extent = find_extent(
        near.chainage, near.clock, near.residual, near.lean, near.inside,
        axis.length, model.radius, near.spacing, sigma,
    )  # fmt: skip
    if extent is None:
        return None
    # Near the ends other surfaces begin, so the fit stays clear of them.
    clear = min(0.3 * model.radius, 0.1 * (extent.high - extent.low))
    own, own_clock, own_residual, chosen = points_between(
        near.inliers, near.chainage, near.clock, near.residual,
        extent.low, extent.high, clear, LEAST_CLEAR,
    )  # fmt: skip
    misfit = section_misfit(own_clock, own_residual, extent.arc)
    return _Look(near, extent, own, chosen, misfit)


def _refine_roughly(
    guess: _Guess, round_: int, nearby: NearbyPoints, is_free: Flags, used: list[Indices]
) -> tuple[_Guess, FittedElement | None] | None:
    """One round on downsampled points: the next guess, and the element as fitted so far."""
    look = _look_at(guess, round_, nearby, is_free, used)
    if look is None:
        # A section may be so far from round that the circle runs along its points nowhere.
        oval = None if round_ else _fit_oval(guess, 2 * np.pi, nearby, is_free, used)
        return None if oval is None else (oval[0], None)
    scale = 3.0 * guess.sigma
    fit = _fit_roughly(
        guess.model, look.chosen, nearby, scale, _flattened(guess.axis, guess.section)
    )
    if fit is None:
        return None
    fitted = FittedElement(fit, guess.axis, look.inliers, look.extent, look.misfit, guess.section)
    following = guess.after(fit, look.extent.low, look.extent.high)
    rough = max(ROUGH_NOISE * nearby.surface.noise, ROUGH_SHARE * fit.model.radius)
    if guess.section is None and following.sigma <= rough:
        return following, fitted
    oval = _fit_oval(following, look.extent.arc, nearby, is_free, used)
    if oval is None:
        return following, fitted
    following, fit = oval
    section = following.section
    fitted = FittedElement(fit, following.axis, look.inliers, look.extent, 0.0, section)
    return following, fitted


def _refine_finally(
    guess: _Guess,
    fitted: FittedElement,
    nearby: NearbyPoints,
    is_free: Flags,
    is_promising: Callable[[FittedElement, float], bool],
    used: list[Indices],
) -> FittedElement | None:
    """The last round, on all points; `fitted` is how the piece was before."""
    look = _look_at(guess, N_ROUNDS - 1, nearby, is_free, used)
    if look is None:
        return None
    told = partial(
        FittedElement,
        axis=guess.axis,
        inliers=look.inliers,
        extent=look.extent,
        misfit=look.misfit,
        section=guess.section,
    )
    # All but the fit itself is as it will be at last.
    if (
        not is_promising(told(fitted.fit), HARDLY_ROUGH)
        and _off_bands(fitted.fit, look.chosen, nearby, look.near.spacing) is None
    ):
        return None
    fit = fit_measured(
        guess.model, look.chosen, nearby, 3.0 * guess.sigma, look.near.spacing,
        partial(_holds, is_promising, told), _flattened(guess.axis, guess.section),
    )  # fmt: skip
    if fit is None:
        return None
    last = guess.after(fit, look.extent.low, look.extent.high)
    return _placed(told(fit), last.axis)


def _fit_oval(
    guess: _Guess, arc: float, nearby: NearbyPoints, is_free: Flags, used: list[Indices]
) -> tuple[_Guess, SurfaceFit[Any]] | None:
    """A guess with a section model, and the fit of its surface without the section's heights.

    None where the points scatter about it hardly less than about the round surface.
    """
    model = guess.model
    near = nearby.on_surface(
        model, guess.axis, 0.0, is_free, band=OVAL_BAND * model.radius,
        depth=INSIDE * model.radius, min_cos=RADIAL_COS, is_rough=True,
    )  # fmt: skip
    used.append(near.inliers)
    found = fit_section_model(near.chainage, near.clock, near.residual, model.radius, arc)
    if found is None:
        return None
    left = near.residual - found.height(near.chainage, near.clock)
    before, after = robust_sd(near.residual - np.median(near.residual)), robust_sd(left)
    section = found.without_pose()
    if after > CLEARLY_BETTER * before or section.max_height > MAX_HEIGHT * model.radius:
        return None
    on = near.inliers[np.abs(left) <= _band(after)]
    fit = _fit_roughly(model, on, nearby, 3.0 * after, _flattened(guess.axis, section))
    if fit is None:
        return None
    return replace(guess.after(fit, 0.0, guess.axis.length), section=section), fit


def _flattened(
    axis: LineAxis | ArcAxis, section: SectionModel | None
) -> Callable[[Array], Array] | None:
    """What takes a section's heights off points, so that a round surface fits them."""
    if section is None:
        return None

    def flatten(xyz: Array) -> Array:
        chainage, _, clock = axis.pipe_coordinates(xyz)
        up, right = axis.frame(chainage)
        outward = np.cos(clock)[:, None] * up + np.sin(clock)[:, None] * right
        return np.asarray(xyz - section.height(chainage, clock)[:, None] * outward)

    return flatten


def _placed(fitted: FittedElement, axis: LineAxis | ArcAxis) -> FittedElement:
    """The fitted piece with the axis of its last fit, its extent counted from the axis's start."""
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


def axis_between(model: LineSurface | ArcSurface, low: float, high: float) -> LineAxis | ArcAxis:
    """The axis of a model between two of its chainages (lines) or angles (arcs)."""
    if isinstance(model, ArcSurface):
        return model.axis_from(arc_direction(model, low), high - low)
    return model.axis_between(low, high)


def axis_through(model: LineSurface | ArcSurface, ends: Array) -> LineAxis | ArcAxis:
    """The model's axis between the places nearest to two points."""
    if isinstance(model, LineSurface):
        low, high = (ends - model.middle) @ model.direction
        return model.axis_between(float(low), float(high))
    start, end = (e - model.centre for e in ends)
    axis = model.axis_from(start, 0.0)
    ahead = cross(axis.normal, axis.towards_start)
    angle = float(np.mod(np.arctan2(end @ ahead, end @ axis.towards_start), 2 * np.pi))
    return model.axis_from(start, angle)


def _margin(axis: LineAxis | ArcAxis, radius: float, round_: int) -> float:
    """How far beyond its ends an axis may grow in this round."""
    if isinstance(axis, ArcAxis):
        opening = (2 * np.pi - axis.bend_angle) * axis.bend_radius
        return min(0.8 * radius, 0.5 * opening)
    return radius if round_ == 0 else 0.5 * axis.length + 4.0 * radius


def _band(sigma: float) -> float:
    """Distance up to which points are on a surface."""
    return max(5.0 * sigma, 0.0025)


def _fit_roughly(
    model: AnySurface,
    downsampled: Indices,
    nearby: NearbyPoints,
    scale: float,
    flatten: Callable[[Array], Array] | None = None,
) -> SurfaceFit[Any] | None:
    """Fit the model to downsampled points."""
    if len(downsampled) < LEAST_POINTS:
        return None
    points = nearby.surface.xyz[sample_evenly(downsampled, MAX_ROUGH_POINTS)]
    if flatten is not None:
        points = flatten(points)
    return _fit_sample(model, points, scale, min(len(downsampled), SURE_POINTS))


def _holds(
    is_promising: Callable[[FittedElement, float], bool],
    told: Callable[[SurfaceFit[Any]], FittedElement],
    fit: SurfaceFit[Any],
) -> bool:
    """Whether a piece is promising with the fit of a sample."""
    return is_promising(told(fit), HARDLY_ROUGH)


def _fit_sample(
    model: AnySurface, points: Array, scale: float, n_all: int
) -> SurfaceFit[Any] | None:
    """Fit the model to a sample; it is as sure of it as `n_all` points would be."""
    fit = fit_surface(model, points, scale, is_rough=True)
    if fit is None or not _is_still(fit, model):
        return None
    return replace(fit, covariance=fit.covariance * min(len(points) / n_all, 1.0))


def _is_still(fit: SurfaceFit[Any], model: AnySurface) -> bool:
    """Whether a fit found what was proposed."""
    return bool(abs(fit.model.radius - model.radius) <= MAX_RADIUS_CHANGE * model.radius)


def fit_measured(
    model: AnySurface,
    downsampled: Indices,
    nearby: NearbyPoints,
    scale: float,
    spacing: float,
    holds: Callable[[SurfaceFit[Any]], bool] = lambda fit: True,
    flatten: Callable[[Array], Array] | None = None,
) -> SurfaceFit[Any] | None:
    """Fit a model as elements are measured: to all points, free of bands around the pipe.

    Parameters
    ----------
    model : LineSurface, ArcSurface or SphereSurface
        Where to start.
    downsampled : ndarray of int
        Downsampled points on the surface.
    nearby : NearbyPoints
    scale : float
        Distance from the surface up to which points count in full, metres.
    spacing : float
        Distance between neighbouring downsampled points, metres.
    holds : callable
        Asked of the fit to a sample of many points, from which that to all begins.

    Returns
    -------
    SurfaceFit or None
        None where the points do not carry the surface, or carry quite another one.
    """
    if len(downsampled) < LEAST_POINTS:
        return None
    _, points = nearby.full_resolution(downsampled)
    points = sample_evenly(points, MAX_FIT_POINTS)
    if flatten is not None:
        points = flatten(points)
    start = model
    if len(points) > MANY_POINTS:
        sampled = _fit_sample(model, sample_evenly(points, SURE_POINTS), scale, len(points))
        if sampled is None or not (
            holds(sampled) or _off_bands(sampled, downsampled, nearby, spacing) is not None
        ):
            return None
        start, scale = sampled.model, AGAIN * sampled.sigma
    fit = fit_surface(start, points, scale)
    if fit is None or not _is_still(fit, model):
        return None
    own = _off_bands(fit, downsampled, nearby, spacing) if flatten is None else None
    if own is None:
        return fit
    if len(own) >= LEAST_POINTS:
        _, points = nearby.full_resolution(own)
        fit = fit_surface(fit.model, sample_evenly(points, MAX_FIT_POINTS), 3.0 * fit.sigma)
        if fit is not None and _is_still(fit, model):
            return fit
    return None


def _off_bands(
    fit: SurfaceFit[Any], downsampled: Indices, nearby: NearbyPoints, spacing: float
) -> Indices | None:
    """The points that are not of bands around a pipe; None where there are none of those."""
    model = fit.model
    if not isinstance(model, LineSurface):
        return None
    xyz = nearby.surface.xyz[downsampled]
    chainage = (xyz - model.middle) @ model.direction
    residual, _, outward = model.residuals(xyz)
    is_own = is_off_bands(chainage, residual, spacing, model.radius)
    if is_own is None:
        return None
    # Where a band or a rib meets the pipe, the normals turn away before the points do.
    cosine = np.abs(np.einsum("ij,ij->i", nearby.surface.normals[downsampled], outward))
    return np.asarray(downsampled[is_own & (cosine > CLEAR_COS)], np.intp)


def _refine_sphere(
    model: SphereSurface,
    nearby: NearbyPoints,
    is_free: Flags,
    is_promising: Callable[[FittedElement, float], bool],
    used: list[Indices],
) -> FittedElement | None:
    sigma = max(nearby.surface.noise, 0.001, 0.01 * model.radius)
    fitted = None
    for round_ in range(N_ROUNDS):
        is_final = round_ == N_ROUNDS - 1
        if is_final and not (fitted and is_promising(fitted, ROUGH)):
            return None
        own = nearby.on_sphere(
            model, is_free, band=_band(sigma), min_cos=RADIAL_COS, is_rough=not is_final
        )
        used.append(own)
        if is_final:
            fit = fit_measured(model, own, nearby, 3.0 * sigma, nearby.surface.voxel)
        else:
            fit = _fit_roughly(model, own, nearby, 3.0 * sigma)
        if fit is None:
            return None
        model = fit.model
        sigma = max(fit.sigma, MIN_SIGMA)
        fitted = _fitted_sphere(fit, own, nearby)
        if round_ == 0 and not is_promising(fitted, VERY_ROUGH):
            return None
    return fitted


def _fitted_sphere(
    fit: SurfaceFit[SphereSurface], own: Indices, nearby: NearbyPoints
) -> FittedElement:
    model, upright = fit.model, np.array([0.0, 0.0, 1.0])
    misfit, low, high, arc = sphere_misfit(
        nearby.surface.xyz, own, model.centre, model.radius, MAX_SECTORS, *PATCHES
    )
    axis = LineAxis(model.centre + low * upright, upright, high - low)
    return FittedElement(fit, axis, own, Extent(0.0, axis.length, arc, 1.0, ()), misfit)
