"""Bowed, sagging and kinked pipes: one cylinder about a curved axis, fitted to its points.

Straight pieces give a first axis. Then the heights of the points above the surface about
it tell how far the axis is off at each place: in the direction of the clock angle θ a
shifted axis shows as u·cos θ + v·sin θ. Axis, extent and the points that count improve each other.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from pipecore._kernels.unrolling import unroll
from pipecore.elements.refinement.extent import Extent, find_extent, section_misfit
from pipecore.elements.refinement.fitted_element import FittedElement
from pipecore.elements.refinement.guess import MIN_SIGMA_M, band_of
from pipecore.elements.refinement.nearby_points import MIN_DEPTH_RADII, RADIAL_COS, NearbyPoints
from pipecore.elements.refinement.section_model import OVAL_ARC
from pipecore.elements.refinement.surface_fits import LineSurface, fit_surface
from pipecore.geometry import AnyAxis, Array, CurveAxis
from pipecore.robust import robust_sd, sample_evenly

Indices = NDArray[np.intp]
Flags = NDArray[np.bool_]

PIECE_RADII, FEWEST_PIECES, MOST_PIECES = 2.0, 4, 40
"""Length of the pieces of an axis in radii, and how many it has: a kink is as sharp as these."""
N_ROUNDS, N_STEPS = 40, 6
"""Rounds of growth at most, and steps of the robust fit in each."""
FIRST_BAND_RADII = 0.12
"""Points count up to this distance from the first axis, radii: pieces are off by as much."""
MARGIN_RADII = 2.0
"""How far beyond its ends an axis is looked for in a round."""
SETTLED_SIGMAS = 0.02
"""A step that moves the axis by less than this share of the points' scatter is the last."""
HELD_RADII = 0.25
"""An end that moves by less than this in a round holds still."""
STIFFNESS_RADII, OVAL_RADII = 0.3, 0.04
"""How much neighbouring offsets of an axis differ from a line's, and the size of ovality, where
no point says so; radii, as standard deviations."""
TURN_RADII, MAX_TURN_COS = 3.0, float(np.cos(np.deg2rad(10.0)))
"""A pipe turns by no more within this length, in radii: tighter ones are bends (of 17 radii)."""
BEYOND_RADII, MIN_ARC_BEYOND, MIN_POINTS_BEYOND = (0.8, 1.6), 0.6, 12
"""A pipe goes on where between these distances beyond its end, in radii, points lie around this
share of its arc."""
TUKEY_SDS = 4.685
FIT_POINTS, ROUND_POINTS, BOW_POINTS = 60_000, 12_000, 3_000
MIN_POINTS = 60


@dataclass(frozen=True, eq=False)
class _Near:
    """Points around a curved axis: downsampled, in pipe coordinates, with how they face it."""

    index: Indices
    chainage: Array
    clock: Array
    residual: Array
    normal_angle: Array


def fit_curved_pipe(
    parts: Sequence[FittedElement], nearby: NearbyPoints, is_free: Flags
) -> FittedElement | None:
    """Fit one cylinder about a curved axis to what pieces of it were fitted to.

    Parameters
    ----------
    parts : sequence of FittedElement
        Pieces of one pipe, in any order.
    nearby : NearbyPoints
    is_free : ndarray of bool
        Downsampled points that are on no other element.

    Returns
    -------
    FittedElement or None
        None where the points determine none.
    """
    weight = np.array([p.axis.length for p in parts])
    radius = float(np.average([p.fit.model.radius for p in parts], weights=weight))
    first = _first_axis([p.axis for p in parts], radius)
    if first is None:
        return None
    axis = first
    sigma = max(MIN_SIGMA_M, *(p.fit.sigma for p in parts))
    band = max(FIRST_BAND_RADII * radius, band_of(sigma))
    before, grows = axis, [True, True]
    for _ in range(N_ROUNDS):
        near = _points_about(axis, radius, nearby, is_free, MARGIN_RADII * radius, band)
        inside = (near.chainage > 0.0) & (near.chainage < axis.length)
        moved = _moved(axis, radius, near, inside, sigma)
        if moved is None:
            return None
        corner = _sharpest(moved[0], radius)
        if corner is not None:
            # A bend begins there: that end goes back to where it was, and stays.
            end = int(corner > moved[0].length / 2)
            if not grows[end]:
                return None
            grows[end], axis = False, before
            continue
        before = axis = moved[0]
        radius, sigma = moved[1:]
        band = band_of(sigma)
        near = _points_about(axis, radius, nearby, is_free, MARGIN_RADII * radius, band)
        extent = _extent(axis, radius, near, nearby, sigma)
        if extent is None:
            return None
        low = extent.low if grows[0] else max(extent.low, 0.0)
        high = extent.high if grows[1] else min(extent.high, axis.length)
        grown = max(abs(low), abs(high - axis.length))
        part = _between(axis, low, high, radius)
        if part is None:
            return None
        axis = part
        if grown < HELD_RADII * radius:
            break
    return _finished(axis, radius, sigma, nearby, is_free)


def goes_on(
    found: FittedElement, radius_share: float, nearby: NearbyPoints, is_free: Flags
) -> bool:
    """Return whether a surface like a pipe's goes on beyond an end of a straight one.

    Parameters
    ----------
    found : FittedElement
        About a straight axis.
    radius_share : float
        Points count up to this share of the radius off its surface.
    nearby : NearbyPoints
    is_free : ndarray of bool
        Downsampled points that may be on it.

    Returns
    -------
    bool
    """
    radius, axis = found.fit.model.radius, found.axis
    low, high = (k * radius for k in BEYOND_RADII)
    index = nearby.around_axis(axis, radius, high)
    index = index[is_free[index]]
    xyz, normals = nearby.surface.xyz[index].astype(np.float64), nearby.surface.normals[index]
    columns = chainage, _, clock, height, alignment = [np.empty(len(index)) for _ in range(5)]
    unroll(axis.numbers, radius, 0.0, xyz, normals, *columns)
    on = (np.abs(height) < radius_share * radius) & (alignment > RADIAL_COS)
    beyond = chainage < -low, chainage > axis.length + low
    needed = MIN_ARC_BEYOND * found.extent.arc
    return any(
        np.count_nonzero(on & there) >= MIN_POINTS_BEYOND and _arc(clock[on & there]) >= needed
        for there in beyond
    )


def bow_of_straight(found: FittedElement, nearby: NearbyPoints) -> float:
    """Return how far the points on a straight pipe surely say that its axis bows.

    Parameters
    ----------
    found : FittedElement
        About a straight axis.
    nearby : NearbyPoints

    Returns
    -------
    float
        Height of the parabola above its chord, less three standard deviations, metres;
        0 where nothing says so.
    """
    if len(found.inliers) < MIN_POINTS:
        return 0.0
    xyz = nearby.surface.xyz[sample_evenly(found.inliers, BOW_POINTS)].astype(np.float64)
    residual, _, _ = found.fit.model.residuals(xyz)
    chainage, _, clock = found.axis.pipe_coordinates(xyz)
    along = np.polynomial.legendre.legvander(2.0 * chainage / found.axis.length - 1.0, 2)
    cos, sin = np.cos(clock)[:, None], np.sin(clock)[:, None]
    columns = [along[:, :1], cos * along, sin * along]
    if found.extent.arc > OVAL_ARC:
        columns.append(np.stack([np.cos(2 * clock), np.sin(2 * clock)], axis=1))
    design = np.concatenate(columns, axis=1)
    solution, _, rank, _ = np.linalg.lstsq(design, residual, rcond=None)
    if rank < design.shape[1]:
        return 0.0
    left = residual - design @ solution
    variance = np.linalg.inv(design.T @ design).diagonal() * np.mean(np.square(left))
    bowed = [3, 6]
    # The second Legendre polynomial is 1.5 higher at its ends than in the middle.
    sure = np.linalg.norm(solution[bowed]) - 3.0 * np.sqrt(variance[bowed].max())
    return 1.5 * max(float(sure), 0.0)


def _sharpest(axis: CurveAxis, radius: float) -> float | None:
    """Where an axis turns more within `TURN_RADII` than a bowed or kinked pipe does, if it does."""
    s = np.arange(0.0, axis.length, 0.5 * radius)
    reach = round(TURN_RADII / 0.5)
    if len(s) <= reach:
        return None
    tangents = axis.tangent(s)
    cosines = (tangents[reach:] * tangents[:-reach]).sum(axis=1)
    k = int(np.argmin(cosines))
    return float(s[k] + 0.5 * TURN_RADII * radius) if cosines[k] < MAX_TURN_COS else None


def _n_pieces(length: float, radius: float) -> int:
    return int(np.clip(round(length / (PIECE_RADII * radius)), FEWEST_PIECES, MOST_PIECES))


def curve_through(places: Array, n_pieces: int) -> CurveAxis | None:
    """Return the axis through places; None where they turn back, as no bowed pipe does.

    Parameters
    ----------
    places : ndarray, shape (m, 3)
    n_pieces : int

    Returns
    -------
    CurveAxis or None
    """
    if not (np.diff(places @ (places[-1] - places[0])) > 0.0).all():
        return None
    return CurveAxis.through(places, n_pieces)


def _first_axis(axes: Sequence[AnyAxis], radius: float) -> CurveAxis | None:
    """A smooth curve along the axes of pieces."""
    samples = np.concatenate([a.at(np.linspace(0.0, a.length, 12)) for a in axes])
    middle = samples.mean(axis=0)
    direction = np.linalg.svd(samples - middle, full_matrices=False)[2][0]
    along = (samples - middle) @ direction
    low, high = float(along.min()), float(along.max())
    knots = np.linspace(low, high, _n_pieces(high - low, radius) + 1)
    basis = CubicSpline(knots, np.eye(len(knots)))(along)
    stiff = np.diff(np.eye(len(knots)), 2, axis=0)
    across = samples - middle - along[:, None] * direction
    off, *_ = np.linalg.lstsq(
        np.concatenate([basis, 0.1 * stiff]),
        np.concatenate([across, np.zeros((len(stiff), 3))]),
        rcond=None,
    )
    places = middle + knots[:, None] * direction + off
    return curve_through(places, len(knots) - 1)


def _between(axis: CurveAxis, low: float, high: float, radius: float) -> CurveAxis | None:
    """The axis between two chainages, in pieces of the usual length."""
    n = _n_pieces(high - low, radius)
    return curve_through(axis.at(np.linspace(low, high, 8 * n + 1)), n)


def _points_about(
    axis: CurveAxis,
    radius: float,
    nearby: NearbyPoints,
    is_free: Flags,
    margin: float,
    band: float,
) -> _Near:
    """Free points within `band` of the surface whose normals agree with it."""
    index = nearby.around_axis(axis, radius, margin)
    index = index[is_free[index]]
    xyz, normals = nearby.surface.xyz[index].astype(np.float64), nearby.surface.normals[index]
    columns = chainage, _, clock, height, alignment = [np.empty(len(index)) for _ in range(5)]
    unroll(axis.numbers, radius, 0.0, xyz, normals, *columns)
    on = (np.abs(height) <= band) & (alignment > RADIAL_COS)
    chainage, clock = chainage[on], clock[on]
    up, right = axis.frame(chainage)
    cos, sin = np.cos(clock)[:, None], np.sin(clock)[:, None]
    outward, ahead = cos * up + sin * right, cos * right - sin * up
    facing = (normals[on] * outward).sum(axis=1)
    turned = np.arctan((normals[on] * ahead).sum(axis=1) / facing)
    return _Near(index[on], chainage, clock, height[on], turned)


def _moved(
    axis: CurveAxis, radius: float, near: _Near, inside: Flags, sigma: float
) -> tuple[CurveAxis, float, float] | None:
    """The axis where its points want it, with the radius and their scatter, robustly."""
    rows = np.flatnonzero(inside)
    if len(rows) < MIN_POINTS:
        return None
    rows = sample_evenly(rows, ROUND_POINTS)
    clock, residual = near.clock[rows], near.residual[rows]
    n = len(axis.up)
    knots = np.linspace(0.0, axis.length, n)
    basis = CubicSpline(knots, np.eye(n))(near.chainage[rows])
    cos, sin = np.cos(clock)[:, None], np.sin(clock)[:, None]
    columns = [np.ones((len(rows), 1)), cos * basis, sin * basis]
    arc = _arc(clock)
    if arc > OVAL_ARC:
        columns.append(np.stack([np.cos(2 * clock), np.sin(2 * clock)], axis=1))
    design = np.concatenate(columns, axis=1)
    prior = np.zeros((design.shape[1], design.shape[1]))
    stiff = np.diff(np.eye(n), 2, axis=0) / (STIFFNESS_RADII * radius)
    for first in (1, 1 + n):
        prior[first : first + n, first : first + n] = stiff.T @ stiff
    if arc > OVAL_ARC:
        prior[-2:, -2:] = np.eye(2) / (OVAL_RADII * radius) ** 2
    solution = np.zeros(design.shape[1])
    scatter = max(sigma, robust_sd(residual - np.median(residual)))
    for _ in range(N_STEPS):
        left = residual - design @ solution
        weight = np.square(np.maximum(1.0 - np.square(left / (TUKEY_SDS * scatter)), 0.0))
        normal = (weight[:, None] * design).T @ design + scatter**2 * prior
        before, solution = (
            solution,
            np.linalg.solve(
                normal + 1e-9 * np.trace(normal) / len(normal) * np.eye(len(normal)),
                design.T @ (weight * residual),
            ),
        )
        scatter = max(robust_sd(residual - design @ solution), MIN_SIGMA_M)
        if np.abs(solution - before).max() < SETTLED_SIGMAS * scatter:
            break
    up, right = axis.frame(knots)
    to_up, to_right = solution[1 : 1 + n, None], solution[1 + n : 1 + 2 * n, None]
    places = axis.at(knots) + to_up * up + to_right * right
    if not np.isfinite(places).all() or abs(solution[0]) > FIRST_BAND_RADII * radius:
        return None
    curve = curve_through(places, n - 1)
    return None if curve is None else (curve, radius + float(solution[0]), float(scatter))


def _arc(clock: Array) -> float:
    """Arc that points cover, radians."""
    seen = np.bincount((clock / (2 * np.pi) * 72).astype(np.intp) % 72, minlength=72)
    return float(np.count_nonzero(seen > 0.002 * len(clock)) / 72 * 2 * np.pi)


def _extent(
    axis: CurveAxis, radius: float, near: _Near, nearby: NearbyPoints, sigma: float
) -> Extent | None:
    def find_inside(begin: float, end: float) -> Array:
        index = nearby.around_axis(axis, radius, MARGIN_RADII * radius)
        xyz = nearby.surface.xyz[index].astype(np.float64)
        columns = chainage, _, clock, height, alignment = [np.empty(len(index)) for _ in range(5)]
        unroll(axis.numbers, radius, 0.0, xyz, nearby.surface.normals[index], *columns)
        deep = (height < -MIN_DEPTH_RADII * radius) & (alignment > RADIAL_COS)
        deep &= (chainage > begin) & (chainage < end)
        return np.stack([chainage[deep], clock[deep]])

    return find_extent(
        near.chainage, near.clock, near.residual, near.normal_angle, find_inside,
        axis.length, radius, nearby.usual_spacing(near.index), sigma,
    )  # fmt: skip


def _finished(
    axis: CurveAxis, radius: float, sigma: float, nearby: NearbyPoints, is_free: Flags
) -> FittedElement | None:
    """The element, its radius fitted to all points with the axis made straight."""
    near = _points_about(axis, radius, nearby, is_free, 0.0, band_of(sigma))
    extent = _extent(axis, radius, near, nearby, sigma)
    if extent is None or len(near.index) < MIN_POINTS:
        return None
    chord = axis.chord
    model = LineSurface(chord.at(chord.length / 2), chord.direction, radius)
    index = sample_evenly(near.index, FIT_POINTS)
    _, xyz = nearby.full_resolution(index)
    fit = fit_surface(model, straightened(sample_evenly(xyz, FIT_POINTS), axis), 3.0 * sigma)
    if fit is None or abs(fit.model.radius - radius) > FIRST_BAND_RADII * radius:
        return None
    at_axis = np.array([-chord.length / 2, chord.length / 2])
    shift = (fit.model.middle - model.middle) + at_axis[:, None] * (
        fit.model.direction - model.direction
    )
    shift -= (shift @ chord.direction)[:, None] * chord.direction
    placed = _shifted(axis, shift)
    misfit = section_misfit(near.clock, near.residual, extent.arc, nearby.rounding)
    low, high = max(extent.low, 0.0), min(extent.high, placed.length)
    gaps = tuple((max(a, low), min(b, high)) for a, b in extent.gaps)
    whole = Extent(0.0, placed.length, extent.arc, extent.coverage, gaps)
    return FittedElement(fit, placed, near.index, whole, misfit)


def straightened(xyz: Array, axis: CurveAxis) -> Array:
    """Return points as if the axis was straight along its chord.

    Parameters
    ----------
    xyz : ndarray
        Local coordinates, shape (n, 3).
    axis : CurveAxis

    Returns
    -------
    ndarray
        Shape (n, 3).
    """
    chainage, distance, clock = axis.pipe_coordinates(xyz)
    up, right = axis.chord.frame(0.0)
    share = (chainage / axis.length * axis.chord.length)[:, None]
    across = np.cos(clock)[:, None] * up + np.sin(clock)[:, None] * right
    return np.asarray(axis.start + share * axis.chord.direction + distance[:, None] * across)


def _shifted(axis: CurveAxis, shift: Array) -> CurveAxis:
    """The axis with its two ends moved."""
    return CurveAxis(axis.start + shift[0], axis.end + shift[1], axis.up, axis.right)
