"""What one element tells of the stations: a surface fitted to all its walls, each of them moved.

The unknowns of the element (place, radius, ovality, bow) are eliminated; what is left are normal
equations of the corrections alone.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipecore.geometry import ArcAxis
from pipecore.robust import TUKEY_REACH, robust_sd, tukey_weights
from pipecore.stations.samples import Samples
from pipecore.types import Element, ElementKind

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

OVAL_PRIOR = 0.003
"""SD of each harmonic from the second on, radii: pipes as delivered are oval by up to 1 %. Where
stations see the same places it does not matter; where they face each other across a pipe it is what
limits them."""
WAIST_PRIOR = 0.001
"""SD of the radius's curvature along an element, radii."""
BOW_PRIOR = 0.001
"""SD of the bow of an axis beyond what was fitted, of its length."""
FREE_PRIOR = 1.0
"""SD of place and radius, metres: nothing is known of them."""
NEAR_PRIOR = 0.03
"""SD of a wall's shift while walls are looked for: as far as points were taken."""
HARMONICS = (2, 3, 4)

MIN_INCIDENCE_COS = 0.3
"""Beams that graze the surface more than at 72° say little of it, and err by much else."""
SCALES = (6e-3, 3e-3)
"""Scales of the robust weights to begin with, metres, before they follow the points' own."""
N_ITERATIONS = 5
LEAST_SCALE = 1e-4
"""No scanner's noise is below a tenth of a millimetre."""


@dataclass(frozen=True, eq=False)
class Equations:
    """Normal equations of the stations' corrections, as one element tells them.

    Parameters
    ----------
    element_id : int
    stations : ndarray of int, shape (k,)
        Places of the stations among all.
    matrix, right : ndarray, shape (6 k, 6 k) and (6 k,)
        Of shift and rotation about the stations' pivots, station by station.
    square_sum : ndarray, shape (k,)
        Of the weighted residuals by station, metres squared.
    weight_sum : ndarray, shape (k,)
    middle : ndarray, shape (3,)
    """

    element_id: int
    stations: Indices
    matrix: Array
    right: Array
    square_sum: Array
    weight_sum: Array
    middle: Array


@dataclass(frozen=True, eq=False)
class Motion:
    """Small motions of all stations: x' = pivot + R (x - pivot) + shift.

    Parameters
    ----------
    pivot, shift, rotation : ndarray, shape (s, 3)
        Metres, metres and rotation vectors.
    """

    pivot: Array
    shift: Array
    rotation: Array

    def moved(self, xyz: Array, station: Indices) -> Array:
        """Return points moved by the motions of their stations.

        Parameters
        ----------
        xyz : ndarray, shape (n, 3)
        station : ndarray of int, shape (n,)

        Returns
        -------
        ndarray, shape (n, 3)
        """
        offset = xyz - self.pivot[station]
        turn = self.rotation[station]
        # To the second order: rotations are of a hundredth at most.
        once = np.cross(turn, offset)
        return np.asarray(xyz + once + 0.5 * np.cross(turn, once) + self.shift[station])


@dataclass(frozen=True, eq=False)
class _Rows:
    """Observation equations of points: height = shape · element - motion · station."""

    height: Array
    motion: Array
    shape: Array


def element_equations(
    samples: Samples, motion: Motion, positions: Array, pull: Array
) -> Equations | None:
    """Fit an element's surface to the walls of all stations and return what it tells of these.

    Parameters
    ----------
    samples : Samples
    motion : Motion
        How stations are moved so far.
    positions : ndarray, shape (s, 3)
        Scanners as they stand in the cloud; nan where not known.
    pull : ndarray, shape (6,)
        How the element itself is moved so far; changed to what was found.

    Returns
    -------
    Equations or None
        None where the points do not define the surface.
    """
    element = samples.element
    stations, place = np.unique(samples.station, return_inverse=True)
    xyz = motion.moved(samples.xyz, samples.station)
    beams = xyz - motion.moved(positions, np.arange(len(positions)))[samples.station]
    middle = element.axis.at(element.axis.length / 2)
    half = element.axis.length / 2
    xyz = xyz - _displacement(xyz - middle, pull, half)
    rows, counts = _observe(element, xyz, beams, middle, half)
    place = place[counts]
    k, own = len(stations), rows.shape.shape[1]
    prior = _shape_prior(element, own)
    near = np.full(6 * k, NEAR_PRIOR)
    residual = rows.height - np.median(rows.height)
    solution = None
    for i in range(N_ITERATIONS):
        scale = SCALES[i] if i < len(SCALES) else max(robust_sd(residual), LEAST_SCALE)
        sigma = _noise_by_station(residual, place, k, scale)
        weight = tukey_weights(residual / (TUKEY_REACH * scale)) / sigma[place] ** 2
        full, right = _normal_equations(rows, place, k, weight)
        with_priors = full + np.diag(1 / np.concatenate([near, prior]) ** 2)
        solution = np.linalg.solve(with_priors, right)
        residual = rows.height - rows.shape @ solution[6 * k :]
        blocks = solution[: 6 * k].reshape(k, 6)
        residual += np.einsum("ij,ij->i", rows.motion, blocks[place])
    if solution is None or not np.all(np.isfinite(solution)):
        return None
    own_part = full[6 * k :, 6 * k :] + np.diag(1 / prior**2)
    across = full[: 6 * k, 6 * k :]
    reduced = full[: 6 * k, : 6 * k] - across @ np.linalg.solve(own_part, across.T)
    reduced_right = right[: 6 * k] - across @ np.linalg.solve(own_part, right[6 * k :])
    change = _to_local(motion.pivot[stations], middle, half)
    pull += solution[6 * k : 6 * k + 6]
    weight *= sigma[place] ** 2
    return Equations(
        element.element_id,
        stations,
        change.T @ reduced @ change,
        change.T @ reduced_right,
        np.bincount(place, weight * residual**2, k).astype(np.float64),
        np.bincount(place, weight, k).astype(np.float64),
        middle,
    )


def _displacement(offset: Array, pose: Array, half: float) -> Array:
    """How far points at an offset from an element's middle are moved by its pose."""
    return np.asarray(pose[:3] + np.cross(pose[3:] / half, offset))


def _observe(
    element: Element, xyz: Array, beams: Array, middle: Array, half: float
) -> tuple[_Rows, NDArray[np.bool_]]:
    """Observation equations of the points that say something, and which these are.

    The point of the surface that a beam meant is where it meets the surface: taken there, noise
    along the beam moves heights by nothing on the average; see docs/decisions/0006.
    """
    chainage, distance, clock = element.axis.pipe_coordinates(xyz)
    height, normal = _height_and_normal(element, chainage, distance, clock, xyz)
    length = np.linalg.norm(beams, axis=1)
    is_known = np.isfinite(length)
    beam = np.where(is_known[:, None], beams / length[:, None], -normal)
    counts = -np.einsum("ij,ij->i", beam, normal) > MIN_INCIDENCE_COS
    beam, xyz = beam[counts], xyz[counts]
    height, normal = height[counts], normal[counts]
    ahead = np.zeros(len(xyz))
    for _ in range(3):
        ahead += height / np.minimum(np.einsum("ij,ij->i", beam, normal), -MIN_INCIDENCE_COS / 2)
        met = xyz - ahead[:, None] * beam
        chainage, distance, clock = element.axis.pipe_coordinates(met)
        height, normal = _height_and_normal(element, chainage, distance, clock, met)
    offset = met - middle
    motion = np.concatenate([normal, np.cross(offset, normal) / half], axis=1)
    observed = ahead * np.einsum("ij,ij->i", beam, normal)
    along = (chainage / half) - 1.0
    return _Rows(observed, motion, _shape_rows(element, motion, along, clock, normal)), counts


def _height_and_normal(
    element: Element, chainage: Array, distance: Array, clock: Array, xyz: Array
) -> tuple[Array, Array]:
    """Height of points above an element's surface, and its outward normal there."""
    if element.kind is ElementKind.SPHERE:
        outward = xyz - element.centre
        far = np.linalg.norm(outward, axis=1)
        return far - element.radius, outward / far[:, None]
    up, right = element.axis.frame(chainage)
    normal = np.cos(clock)[:, None] * up + np.sin(clock)[:, None] * right
    slope = (element.radius_end - element.radius) / element.axis.length
    cos = 1 / np.hypot(1.0, slope)
    if slope != 0.0:
        normal = cos * (normal - slope * element.axis.tangent(chainage))
    return cos * (distance - element.radius - slope * chainage), np.asarray(normal)


def _shape_rows(
    element: Element, motion: Array, along: Array, clock: Array, normal: Array
) -> Array:
    """Derivatives of the surface's height by the element's own unknowns, shape (n, p)."""
    one = np.ones_like(along)
    columns = [one, along]
    if isinstance(element.axis, ArcAxis):
        chainage = (along + 1.0) * element.axis.length / 2
        out = element.axis.at(chainage) - element.axis.centre
        columns.append(np.einsum("ij,ij->i", out / element.axis.bend_radius, normal))
    else:
        columns.append(along**2)
    for power in (along**2 - 1 / 3, along**3 - 0.6 * along):
        columns += [np.cos(clock) * power, np.sin(clock) * power]
    for k in HARMONICS:
        for wave in (np.cos(k * clock), np.sin(k * clock)):
            columns += [wave, wave * along]
    return np.concatenate([motion, np.stack(columns, axis=1)], axis=1)


def _shape_prior(element: Element, n: int) -> Array:
    """Standard deviations of the element's own unknowns before the fit, metres."""
    radius = max(element.radius, element.radius_end)
    prior = np.full(n, OVAL_PRIOR * radius)
    prior[:9] = FREE_PRIOR
    if not isinstance(element.axis, ArcAxis):
        prior[8] = WAIST_PRIOR * radius
    prior[9:13] = BOW_PRIOR * element.axis.length
    return prior


def _noise_by_station(residual: Array, place: Indices, k: int, scale: float) -> Array:
    sigma = np.full(k, scale)
    for s in range(k):
        own = residual[place == s]
        own = own[np.abs(own) < TUKEY_REACH * scale]
        if len(own):
            sigma[s] = np.clip(robust_sd(own), LEAST_SCALE, scale)
    return sigma


def _normal_equations(rows: _Rows, place: Indices, k: int, weight: Array) -> tuple[Array, Array]:
    """Weighted normal equations of the motions of k stations and the shape, without priors."""
    own = rows.shape.shape[1]
    full, right = np.zeros((6 * k + own, 6 * k + own)), np.zeros(6 * k + own)
    for s in range(k):
        mine = place == s
        block = slice(6 * s, 6 * s + 6)
        joint = np.concatenate([-rows.motion[mine], rows.shape[mine]], axis=1)
        weighted = joint * weight[mine, None]
        part, side = joint.T @ weighted, weighted.T @ rows.height[mine]
        full[block, block] = part[:6, :6]
        full[block, 6 * k :] = part[:6, 6:]
        full[6 * k :, block] = part[6:, :6]
        full[6 * k :, 6 * k :] += part[6:, 6:]
        right[block] = side[:6]
        right[6 * k :] += side[6:]
    return full, right


def _to_local(pivots: Array, middle: Array, half: float) -> Array:
    """Shift and turn at an element's middle, of those about the stations' pivots, (6 k, 6 k)."""
    k = len(pivots)
    change = np.zeros((6 * k, 6 * k))
    for s, pivot in enumerate(pivots):
        x, y, z = middle - pivot
        own = change[6 * s : 6 * s + 6, 6 * s : 6 * s + 6]
        own[:3, :3] = np.eye(3)
        own[:3, 3:] = [[0, z, -y], [-z, 0, x], [y, -x, 0]]
        own[3:, 3:] = half * np.eye(3)
    return change
