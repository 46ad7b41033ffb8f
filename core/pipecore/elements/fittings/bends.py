"""Bends between two straights: tangent to both, so that only the bend radius is unknown.

A free torus on a bend of which little is seen has a bend radius that is hardly known, and
takes in points of the straights beside it, which make it larger still. Straights that meet
at an angle leave one unknown: the rounder the corner, the earlier the bend begins. Points
before it must agree with the straights and points in it with the torus, for one bend radius.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pipecore._kernels import bend_support as kernels
from pipecore.elements.fittings.constrained import FittingInliers, complete_fitting
from pipecore.elements.fittings.straight_ends import StraightEnd, normal_angle, straight_ends
from pipecore.elements.refinement.fitted_element import FittedElement
from pipecore.elements.refinement.nearby_points import RADIAL_COS, NearbyPoints
from pipecore.elements.refinement.surface_fits import (
    ArcSurface,
    LineSurface,
    SurfaceFit,
)
from pipecore.elements.runs.ends import End
from pipecore.geometry import ArcAxis, cross, unit
from pipecore.parallel import for_chunks
from pipecore.progress import NoProgress, Progress
from pipecore.robust import TUKEY_REACH, robust_sd, sample_evenly

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

MAX_RADIUS_DIFFERENCE = 0.06
"""Pipes joined by a bend are of one radius to within this share, and so is the bend."""
MIN_TURN, MAX_TURN = np.deg2rad(6.0), np.deg2rad(135.0)
MAX_SKEW = 0.2
"""Axes joined by a bend pass each other within this share of the radius."""
BEND_RADII = np.geomspace(1.1, 11.0, 60)
"""Bend radii tried, in radii of the pipe."""
OVERSHOOT_RADII = 1.5
"""A straight may reach this many radii into the bend."""
N_NEWTON_STEPS = 6
"""Rounds of Gauss and Newton; the residual is nearly linear in the bend radius."""
MIN_POINTS, MIN_POINTS_ON_BEND = 15, 12
"""Points that a bend is fitted to, and those for which one is tried."""
PAIRS_AT_ONCE = 200
"""Pairs of ends that one thread tests at a time; most are rejected at once."""
MAX_POINTS = 20_000
MAX_FREE_RADIUS_SD = 0.015
"""A bend whose points determine its bend radius to this share needs no straights for it."""


@dataclass(frozen=True, eq=False)
class Corner:
    """Where the axes of two straights meet.

    Parameters
    ----------
    place : ndarray, shape (3,)
    towards : tuple of ndarray
        Unit vectors along both straights, towards the corner.
    turn : float
        Angle by which the pipe turns, radians.
    radius : float
        Of the pipe, metres.
    sd : float
        Standard deviation of the axes' distance from the place, metres.
    """

    place: Array
    towards: tuple[Array, Array]
    turn: float
    radius: float
    sd: float = 0.0

    @cached_property
    def normal(self) -> Array:
        """Unit normal of the plane of both axes, about which the bend turns."""
        return unit(cross(self.towards[0], -self.towards[1]))

    @cached_property
    def inward(self) -> Array:
        """Unit vector across the first straight, to the side to which the bend turns."""
        return cross(self.normal, self.towards[0])

    @property
    def half_tangent(self) -> float:
        """Distance from the corner to where the bend begins, in bend radii."""
        return float(np.tan(self.turn / 2))

    def centre(self, bend_radius: float) -> Array:
        """The point about which the bend of a bend radius turns."""
        begin = self.place - bend_radius * self.half_tangent * self.towards[0]
        return np.asarray(begin + bend_radius * self.inward)

    def surface(self, bend_radius: float, radius: float) -> ArcSurface:
        """The bend of a bend radius."""
        return ArcSurface(self.centre(bend_radius), self.normal, bend_radius, radius)

    def axis(self, bend_radius: float) -> ArcAxis:
        """Its axis from one straight to the other."""
        return ArcAxis(self.centre(bend_radius), self.normal, -self.inward, bend_radius, self.turn)


def find_corners(
    fitted: list[FittedElement],
    nearby: NearbyPoints,
    progress: Progress = NoProgress(),
    span: tuple[float, float] = (0.0, 1.0),
) -> list[tuple[Corner, float, tuple[End, End]]]:
    """Find pairs of straight ends that a bend may join, those with most points on it first.

    Parameters
    ----------
    fitted : list of FittedElement
    nearby : NearbyPoints
    progress : Progress
    span : (float, float)
        Which part of the stage "elements" this is.

    Returns
    -------
    list of (Corner, float, (End, End))
        With the bend radius, of those tried, that most points agree with.
    """
    ends = straight_ends(fitted)
    pairs = list(_may_meet(ends))
    between: list[tuple[int, Corner, float] | None] = [None] * len(pairs)

    def look(first: int, last: int) -> None:
        for k in range(first, last):
            one, other = (ends[i] for i in pairs[k])
            between[k] = corner_between(fitted, one, other, nearby)

    for_chunks(look, len(pairs), PAIRS_AT_ONCE, "elements", progress, span)
    found = [
        (*corner, (ends[a].which, ends[b].which))
        for corner, (a, b) in zip(between, pairs, strict=True)
        if corner is not None
    ]
    found.sort(key=lambda x: (-x[0], x[3]))
    return [(corner, bend_radius, pair) for _, corner, bend_radius, pair in found]


def _may_meet(ends: list[StraightEnd]) -> Iterator[tuple[int, int]]:
    """Pairs of ends of one radius that are no further apart than a bend reaches."""
    if not ends:
        return
    point, radius = np.stack([e.point for e in ends]), np.array([e.radius for e in ends])
    # From an end to the corner, there and on to the other, and what the axes may miss by.
    furthest = 2.0 * BEND_RADII[-1] * np.tan(MAX_TURN / 2) * (1.0 + MAX_RADIUS_DIFFERENCE) * radius
    furthest += 2.0 * MAX_SKEW * radius + 0.01
    for a in range(len(ends) - 1):
        smaller = np.minimum(radius[a], radius[a + 1 :])
        is_one_size = np.abs(radius[a] - radius[a + 1 :]) <= MAX_RADIUS_DIFFERENCE * smaller
        is_near = np.square(point[a + 1 :] - point[a]).sum(axis=1) < furthest[a] ** 2
        for b in (np.flatnonzero(is_one_size & is_near) + a + 1).tolist():
            yield a, b


def corner_between(
    fitted: list[FittedElement], one: StraightEnd, other: StraightEnd, nearby: NearbyPoints
) -> tuple[int, Corner, float] | None:
    """The corner that two ends make: number of points on its bend, corner, bend radius."""
    smaller = min(one.radius, other.radius)
    if (
        one.which[0] == other.which[0]
        or abs(one.radius - other.radius) > MAX_RADIUS_DIFFERENCE * smaller
    ):
        return None
    turn = float(np.arccos(np.clip(-(one.outward @ other.outward), -1.0, 1.0)))
    if not MIN_TURN < turn < MAX_TURN:
        return None
    ahead, ahead_other, skew = _closest(one.point, one.outward, other.point, other.outward)
    radius = 0.5 * (one.radius + other.radius)
    furthest = BEND_RADII[-1] * radius * np.tan(turn / 2)
    if skew > MAX_SKEW * radius + 0.002:
        return None
    if min(ahead, ahead_other) < -OVERSHOOT_RADII * radius or max(ahead, ahead_other) > furthest:
        return None
    place = 0.5 * (one.point + ahead * one.outward + other.point + ahead_other * other.outward)
    sd_one, sd_other = (axis_sd(fitted[e.which[0]], place) for e in (one, other))
    corner = Corner(
        place, (one.outward, other.outward), turn, radius, float(np.hypot(sd_one, sd_other))
    )
    best = _best_bend_radius(corner, max(ahead, ahead_other), nearby)
    return None if best is None else (best[0], corner, best[1])


def axis_sd(found: FittedElement, place: Array) -> float:
    """Standard deviation of a straight's axis abreast of a place, across it, metres."""
    model, covariance = found.fit.model, found.fit.covariance
    assert isinstance(model, LineSurface)
    s = float((place - model.middle) @ model.direction)
    variance = [
        covariance[k, k] + 2 * s * covariance[k, k + 2] + s**2 * covariance[k + 2, k + 2]
        for k in (0, 1)
    ]
    return float(np.sqrt(max(float(np.mean(variance)), 0.0)))


def _closest(p: Array, u: Array, q: Array, v: Array) -> tuple[float, float, float]:
    """Parameters of the closest points of the lines p + s·u and q + t·v, and their distance."""
    w = p - q
    b, d, e = float(u @ v), float(u @ w), float(v @ w)
    det = 1.0 - b * b
    s, t = (b * e - d) / det, (e - b * d) / det
    return s, t, float(np.linalg.norm(w + s * u - t * v))


def _best_bend_radius(corner: Corner, gap: float, nearby: NearbyPoints) -> tuple[int, float] | None:
    """The bend radius that most points agree with, and how many; `gap` is to the further end."""
    radius = corner.radius
    tangent_max = min(BEND_RADII[-1] * radius * corner.half_tangent, gap + 3.0 * radius)
    ball = nearby.within_ball(corner.place, tangent_max + 1.2 * radius)
    xyz, normals = nearby.surface.xyz[ball], nearby.surface.normals[ball]
    tolerance = max(3.0 * nearby.surface.noise, 0.03 * radius)
    tried = BEND_RADII * radius
    tried = tried[tried * corner.half_tangent <= tangent_max]
    if len(tried) == 0:
        return None
    counts = np.empty((len(tried), 2), np.int64)
    kernels.agreement(
        xyz, normals,
        _surfaces(corner, tried, radius),
        np.stack([LineSurface(corner.place, t, radius).numbers() for t in corner.towards]),
        tried * corner.half_tangent, tolerance, RADIAL_COS, counts,
    )  # fmt: skip
    counts = np.where(counts[:, 1] >= MIN_POINTS_ON_BEND, counts[:, 0], -1)
    best = int(np.argmax(counts))
    return None if counts[best] < 0 else (int(counts[best]), float(tried[best]))


def _surfaces(corner: Corner, bend_radii: Array, radius: float) -> Array:
    """The bends of several bend radii as the kernels take them, shape (k, 14)."""
    numbers = np.tile(corner.surface(1.0, radius).numbers(), (len(bend_radii), 1))
    numbers[:, :3] = [corner.centre(b) for b in bend_radii]
    numbers[:, 13] = bend_radii
    return numbers


def pipe_residuals(
    corner: Corner, bend_radius: float, radius: float, xyz: Array
) -> tuple[Array, Array, Array, NDArray[np.bool_]]:
    """Distances of points from straight, bend and straight as one pipe.

    Returns
    -------
    tuple of ndarray
        Signed distances (n,), derivatives by the bend radius (n,), outward unit vectors
        (n, 3), and whether each point is abreast of the bend (n,).
    """
    q = xyz - corner.place
    tangent = bend_radius * corner.half_tangent
    before = [-(q @ t) > tangent for t in corner.towards]
    # Beyond both tangent points, on the outside of the bend, is abreast of neither straight.
    along = np.array([-(q @ t) for t in corner.towards])
    first = before[0] & ((along[0] >= along[1]) | ~before[1])
    second = before[1] & ~first
    residual, jacobian, outward = corner.surface(bend_radius, radius).residuals(xyz)
    # The centre moves away from the corner as the bend radius grows.
    shift = corner.inward - corner.half_tangent * corner.towards[0]
    by_bend_radius = jacobian[:, :3] @ shift + jacobian[:, 5]
    for is_there, towards in ((first, corner.towards[0]), (second, corner.towards[1])):
        line = LineSurface(corner.place, towards, corner.radius)
        residual[is_there], _, outward[is_there] = line.residuals(xyz[is_there])
        by_bend_radius[is_there] = 0.0
    return residual, by_bend_radius, outward, ~(first | second)


def fit_bend(
    corner: Corner, bend_radius: float, nearby: NearbyPoints, usable: NDArray[np.bool_]
) -> FittedElement | None:
    """Fit the bend radius, and the pipe's radius in the bend, to all points around a corner.

    Parameters
    ----------
    corner : Corner
    bend_radius : float
        Where to start.
    nearby : NearbyPoints
    usable : ndarray of bool
        Downsampled points that are free or on the straights.

    Returns
    -------
    FittedElement or None
        None where the bend radius is not well determined. Its covariance is that of a
        torus whose other parameters are known.
    """
    radius = corner.radius
    sigma = max(nearby.surface.noise, 0.001, 0.01 * radius)
    furthest = 1.4 * bend_radius * corner.half_tangent + radius
    ball = nearby.within_ball(corner.place, furthest + 1.2 * radius)
    ball = ball[usable[ball]]
    _, xyz, normals = nearby.full_resolution_with_normals(ball)
    if len(xyz) > MAX_POINTS:
        order = sample_evenly(np.lexsort(xyz.T), MAX_POINTS)
        xyz, normals = xyz[order], normals[order]
    scale, bend_sd = 3.0 * sigma, np.inf
    for _ in range(N_NEWTON_STEPS):
        residual, slope, outward, in_bend = pipe_residuals(corner, bend_radius, radius, xyz)
        radial = np.abs(np.einsum("ij,ij->i", normals, outward)) > RADIAL_COS
        near = radial & (np.abs(residual) < TUKEY_REACH * scale)
        if (near & in_bend).sum() < MIN_POINTS:
            return None
        weight = np.square(1.0 - np.square(residual[near] / (TUKEY_REACH * scale)))
        design = np.stack([slope[near], -1.0 * in_bend[near]], axis=1)
        normal_matrix = design.T @ (weight[:, None] * design)
        if np.linalg.cond(normal_matrix) > 1e10:
            return None
        step = np.linalg.solve(normal_matrix, -design.T @ (weight * residual[near]))
        bend_radius += float(np.clip(step[0], -0.2 * bend_radius, 0.2 * bend_radius))
        radius += float(step[1])
        shown = robust_sd(residual[near])
        scale = min(scale, max(shown, 0.7 * scale, 1e-5))
        bend_sd = float(scale * np.sqrt(np.linalg.inv(normal_matrix)[0, 0]))
        radius_sd = float(scale * np.sqrt(np.linalg.inv(normal_matrix)[1, 1]))
        if (
            not 1.02 * radius < bend_radius
            or abs(radius / corner.radius - 1) > MAX_RADIUS_DIFFERENCE
        ):
            return None
    # The corner's own uncertainty moves the bend by as much, and its radius by far more.
    bend_sd = float(np.hypot(bend_sd, corner.sd / (1.0 / np.cos(corner.turn / 2) - 1.0)))
    return _fitted(corner, bend_radius, radius, scale, (bend_sd, radius_sd), nearby, ball)


def _fitted(
    corner: Corner,
    bend_radius: float,
    radius: float,
    sigma: float,
    sds: tuple[float, float],
    nearby: NearbyPoints,
    ball: Indices,
) -> FittedElement | None:
    axis, model = corner.axis(bend_radius), corner.surface(bend_radius, radius)
    xyz, normals = nearby.surface.xyz[ball], nearby.surface.normals[ball]
    residual, _, outward, in_bend = pipe_residuals(corner, bend_radius, radius, xyz)
    cosine = np.abs(np.einsum("ij,ij->i", normals, outward))
    on = in_bend & (cosine > RADIAL_COS) & (np.abs(residual) < max(5.0 * sigma, 0.0025))
    if on.sum() < MIN_POINTS:
        return None
    chainage, _, clock = axis.pipe_coordinates(xyz[on])
    angle = normal_angle(normals[on], outward[on], axis.tangent(chainage))
    covariance = np.zeros((7, 7))
    covariance[5, 5], covariance[6, 6] = sds[0] ** 2, sds[1] ** 2
    return complete_fitting(
        SurfaceFit(model, covariance, sigma, int(on.sum())),
        axis,
        FittingInliers(ball[on], chainage, clock, residual[on], angle),
        nearby,
        lambda free: bool(np.sqrt(free.covariance[5, 5]) < MAX_FREE_RADIUS_SD * bend_radius),
    )
