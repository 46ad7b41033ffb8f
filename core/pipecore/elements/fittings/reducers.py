"""Reducers between two straights on one line: only where they begin and end is unknown.

A free cone on a reducer of which little is seen has a slope that is hardly known, and where
the straights beside it end is known to a few centimetres only. Straights of different radii
on one line leave two unknowns: where the one ends and where the other begins. Points before,
between and after must agree with the straights and with the cone from the one to the other.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pipecore.elements.fittings.constrained import FittingInliers, complete_fitting
from pipecore.elements.fittings.straight_ends import StraightEnd, normal_angle, straight_ends
from pipecore.elements.refinement.fitted_element import FittedElement
from pipecore.elements.refinement.nearby_points import RADIAL_COS, NearbyPoints
from pipecore.elements.refinement.surface_fits import (
    LineSurface,
    SurfaceFit,
)
from pipecore.geometry import LineAxis, unit
from pipecore.robust import robust_sd, sample_evenly

Array = NDArray[np.float64]

MAX_OFFSET, MAX_AXIS_ANGLE = 0.12, np.deg2rad(6.0)
"""Axes of straights joined by a reducer pass each other within this share of the radius, and
enclose no more than this angle."""
MIN_RADIUS_RATIO, MAX_RADIUS_RATIO = 0.4, 0.96
"""Radii of the narrow end, in those of the wide one."""
MIN_PIPE_RADII = 1.5
"""Straights that a reducer joins are longer than this many radii."""
MIN_LENGTH_RADII, MAX_LENGTH_RADII, MAX_GAP_RADII = 0.1, 5.0, 12.0
"""Lengths of a reducer, and the widest gap between straights that it may join, with what is
hidden of them, in radii of its wider end."""
OVERSHOOT_RADII = 1.0
"""A straight may reach so many radii too far, or end as much too early."""
N_PLACES_TRIED = 28
"""Places tried for either end; then again between those beside the best."""
MAX_OFFSET_RADII = 0.35
"""Ends of a straight that is part of a reducer are no further off its axis, in radii of its
wider end."""
MIN_FACING_COS = np.cos(np.deg2rad(50.0))
"""Points whose normals differ more from the radial direction are not of the reducer."""
MIN_POINTS, MAX_POINTS = 12, 1500
"""Points on a reducer at least, and how many are used at most to find where it begins and ends."""
MIN_SIGMA_M = 0.0005
"""Least standard deviation of the points about a cone, metres."""
MIN_SHARE = 0.6
"""Of the points between the radii of both straights so many lie on a reducer."""
MAX_FREE_RADIUS_SD = 0.006
"""A reducer whose points determine its radius to this share needs no straights for it."""


def find_steps(fitted: list[FittedElement]) -> list["RadiusStep"]:
    """Straights on one line but of different radii, near each other; the furthest first.

    What lies between two is then known before it may be taken for a straight itself.
    """
    ends = [e for e in straight_ends(fitted) if _is_pipe(fitted[e.which[0]])]
    return sorted(_steps(ends), key=lambda step: -step.gap)


def _is_pipe(straight: FittedElement) -> bool:
    """Whether a straight is longer than a flange or the end of something else."""
    return straight.axis.length > MIN_PIPE_RADII * straight.fit.model.radius


def _steps(ends: list[StraightEnd]) -> Iterator["RadiusStep"]:
    if not ends:
        return
    points, radii = np.stack([e.point for e in ends]), np.array([e.radius for e in ends])
    for a, one in enumerate(ends):
        furthest = 1.1 * MAX_GAP_RADII * np.maximum(one.radius, radii[a + 1 :])
        is_near = np.square(points[a + 1 :] - one.point).sum(axis=1) < furthest**2
        for b in (np.flatnonzero(is_near) + a + 1).tolist():
            if _may_be_joined(one, ends[b]):
                yield RadiusStep(one, ends[b])


def _may_be_joined(one: StraightEnd, other: StraightEnd) -> bool:
    wide, narrow = max(one.radius, other.radius), min(one.radius, other.radius)
    if one.which[0] == other.which[0] or not MIN_RADIUS_RATIO < narrow / wide < MAX_RADIUS_RATIO:
        return False
    if -(one.outward @ other.outward) < np.cos(MAX_AXIS_ANGLE):
        return False
    gap = other.point - one.point
    along = float(gap @ one.outward)
    across = float(np.linalg.norm(gap - along * one.outward))
    return -OVERSHOOT_RADII * wide < along < MAX_GAP_RADII * wide and across <= MAX_OFFSET * wide


@dataclass(frozen=True, eq=False)
class RadiusStep:
    """Two straights on one line, and what lies between them.

    Chainage is counted along their common direction from the end of the first.
    """

    one: StraightEnd
    other: StraightEnd

    @cached_property
    def direction(self) -> Array:
        """From the first straight to the second."""
        return unit(self.one.outward - self.other.outward)

    @cached_property
    def gap(self) -> float:
        """From the end of the first straight to that of the second, along the direction."""
        return float((self.other.point - self.one.point) @ self.direction)

    @property
    def wide(self) -> float:
        """Radius of the wider straight."""
        return max(self.one.radius, self.other.radius)

    @property
    def narrow(self) -> float:
        """Radius of the narrower straight."""
        return min(self.one.radius, self.other.radius)

    def has_between(self, straight: FittedElement) -> bool:
        """Whether a straight lies where the reducer would, and may be part of it.

        A cylinder fits one side of a reducer of low slope, leaning to its axis.
        """
        model = straight.fit.model
        if not isinstance(model, LineSurface) or not self.narrow < model.radius < self.wide:
            return False
        ends = np.stack([straight.axis.start, straight.axis.end])
        chainage = self.chainage(ends)
        off = np.linalg.norm(ends - self.centre(self.one, chainage), axis=1)
        reach = OVERSHOOT_RADII * self.wide
        return bool(
            chainage.min() > -reach
            and chainage.max() < self.gap + reach
            and np.ptp(chainage) < MAX_LENGTH_RADII * self.wide
            and off.max() < MAX_OFFSET_RADII * self.wide
        )

    def chainage(self, xyz: Array) -> Array:
        """Chainage of points (n, 3)."""
        return np.asarray((xyz - self.one.point) @ self.direction)

    def centre(self, end: StraightEnd, chainage: Array | float) -> Array:
        """Where the axis of one of the straights is at a chainage."""
        begin = (end.point - self.one.point) @ self.direction
        per_chainage = end.outward / (end.outward @ self.direction)
        return np.asarray(end.point + np.multiply.outer(chainage - begin, per_chainage))

    def axis(self, begin: float, end: float) -> LineAxis:
        """Axis of the cone that begins and ends at two chainages."""
        start, stop = self.centre(self.one, begin), self.centre(self.other, end)
        return LineAxis(start, unit(stop - start), float(np.linalg.norm(stop - start)))

    def cone(self, begin: float, end: float) -> LineSurface:
        """The cone that begins and ends at two chainages."""
        axis = self.axis(begin, end)
        return LineSurface(
            axis.at(axis.length / 2),
            axis.direction,
            0.5 * (self.one.radius + self.other.radius),
            (self.other.radius - self.one.radius) / axis.length,
            is_tapered=True,
        )

    def off(self, xyz: Array, begin: float, ends: Array) -> Array:
        """Distances of points (n, 3) from straight, cone and straight as one pipe.

        For one begin and several ends of the cone, shape (k, n). Between, a point is as far
        off as it is from both straights drawn on, each counted by how near its end is.
        """
        chainage = self.chainage(xyz)
        t = np.clip((chainage - begin) / (ends[:, None] - begin), 0.0, 1.0)
        one, other = (
            np.linalg.norm(xyz - self.centre(end, chainage), axis=1) - end.radius
            for end in (self.one, self.other)
        )
        return np.asarray(np.abs(one + t * (other - one)))


def fit_reducer(
    step: RadiusStep,
    straights: tuple[FittedElement, FittedElement],
    nearby: NearbyPoints,
    usable: NDArray[np.bool_],
) -> FittedElement | None:
    """Find where a reducer between two straights begins and ends.

    Parameters
    ----------
    step : RadiusStep
    straights : tuple of FittedElement
        Those of its ends.
    nearby : NearbyPoints
    usable : ndarray of bool
        Downsampled points that are free or on the straights.

    Returns
    -------
    FittedElement or None
        None where no cone joins the straights. Unless its points determine it, its radius
        is as sure as those of the straights.
    """
    before, after = (min(OVERSHOOT_RADII * step.wide, 0.5 * s.axis.length) for s in straights)
    low, high = -before, step.gap + after
    if high - low < MIN_LENGTH_RADII * step.wide:
        return None
    around = LineAxis(step.one.point + low * step.direction, step.direction, high - low)
    points = nearby.around_axis(around, step.wide, 0.0)
    xyz = nearby.surface.xyz[points]
    chainage, rho, _ = around.pipe_coordinates(xyz)
    outward = (xyz - around.at(chainage)) / rho[:, None]
    cosine = np.abs(np.einsum("ij,ij->i", nearby.surface.normals[points], outward))
    chosen = usable[points] & (cosine > MIN_FACING_COS)
    points, xyz = points[chosen], xyz[chosen]
    if len(points) < MIN_POINTS:
        return None
    band = max(5.0 * nearby.surface.noise, 0.005)
    begin, end = _best_ends(step, sample_evenly(xyz, MAX_POINTS), low, high, band)
    return _fitted(step, begin, end, straights, nearby, points, band)


def _best_ends(
    step: RadiusStep, xyz: Array, low: float, high: float, band: float
) -> tuple[float, float]:
    """Chainages between which the cone leaves least of the points' distances."""
    best = (np.inf, low, high)
    begins = ends = np.linspace(low, high, N_PLACES_TRIED)
    for _ in range(2):
        for begin in begins:
            lengths = (ends - begin) / step.wide
            possible = ends[(lengths > MIN_LENGTH_RADII) & (lengths < MAX_LENGTH_RADII)]
            if len(possible) == 0:
                continue
            left = np.square(np.minimum(step.off(xyz, begin, possible), band)).sum(axis=1)
            least = int(np.argmin(left))
            best = min(best, (float(left[least]), float(begin), float(possible[least])))
        beside = (high - low) / (N_PLACES_TRIED - 1) * np.linspace(-1.0, 1.0, 9)
        begins, ends = best[1] + beside, best[2] + beside
    return best[1], best[2]


def _fitted(
    step: RadiusStep,
    begin: float,
    end: float,
    straights: tuple[FittedElement, FittedElement],
    nearby: NearbyPoints,
    points: NDArray[np.intp],
    band: float,
) -> FittedElement | None:
    xyz, normals = nearby.surface.xyz[points], nearby.surface.normals[points]
    axis, model = step.axis(begin, end), step.cone(begin, end)
    chainage, rho, clock = axis.pipe_coordinates(xyz)
    residual, _, outward = model.residuals(xyz)
    between = (chainage > 0) & (chainage < axis.length)
    cosine = np.abs(np.einsum("ij,ij->i", normals, outward))
    on = between & (np.abs(residual) < band) & (cosine > RADIAL_COS)
    beside = between & (rho > step.narrow - band) & (rho < step.wide + band)
    if on.sum() < max(MIN_POINTS, MIN_SHARE * beside.sum()):
        return None
    sigma = max(robust_sd(residual[on]), MIN_SIGMA_M)
    angle = normal_angle(normals[on], outward[on], axis.tangent(chainage[on]))
    sds = np.array([s.radius_sd for s in straights])
    across = sigma**2 / on.sum()
    tilt = 12.0 * across / axis.length**2
    covariance = np.diag(
        [across, across, tilt, tilt, (sds @ sds) / 4, (sds @ sds) / axis.length**2]
    )
    return complete_fitting(
        SurfaceFit(model, covariance, sigma, int(on.sum())),
        axis,
        FittingInliers(points[on], chainage[on], clock[on], residual[on], angle),
        nearby,
        lambda free: free.radius_sd < MAX_FREE_RADIUS_SD * free.model.radius,
    )
