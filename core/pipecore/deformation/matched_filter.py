"""Where the map leaves the contour by more than its noise: a matched filter of bump sizes.

A smooth bump of extents L × W is looked for at every cell. With weights w (inverse
variances of the cell means) and a bump shape k, its height there and its variance are

    h = Σ k w d / Σ k² w,    var h = 1 / Σ k² w + var(contour),

which uses holes and uneven density for what they are.
"""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from pipecore._kernels.maps import strongest
from pipecore.deformation.deviation_map import Flags, Grid
from pipecore.geometry import Array

EXTENTS = (0.18, 0.25, 0.35, 0.5, 0.7, 1.0)
"""Extents of the bumps looked for, shares of the outside diameter."""

MIN_POINTS = 5
"""Fewer points than this under a bump are no evidence, however far off they lie."""


@dataclass(frozen=True)
class Candidate:
    """A place where a bump of a certain size stands out.

    `length` and `width` are the extents of the filter that saw it best.
    """

    chainage: float
    clock: float
    length: float
    width: float
    height: float
    z: float
    inflation: float


def find_candidates(
    grid: Grid,
    *,
    deviation: Array,
    weight: Array,
    count: Array,
    contour_sd: Array,
    allowed: Flags,
    threshold: float,
) -> list[Candidate]:
    """Return bumps and dents above `threshold` times their noise, strongest first.

    Parameters
    ----------
    grid : Grid
    deviation, weight, count, contour_sd : ndarray, shape (rows, columns)
        Cell means, their inverse variances (0 where empty), points, and the contour's sd.
    allowed : ndarray of bool
        Cells where a peak may lie.
    threshold : float
    """
    layers = []
    diameter = 2 * grid.radius
    for extent in EXTENTS:
        size = extent * diameter
        if size < 2.5 * max(grid.row_size, grid.column_size):
            continue
        height, sd, points = _respond(grid, deviation, weight, count, size)
        z = np.where(points >= MIN_POINTS, height / np.hypot(sd, contour_sd), 0.0)
        quiet = z[allowed & (points >= MIN_POINTS)]
        # Noise that neighbours share shows as a spread of z above one.
        spread = 1.4826 * float(np.median(np.abs(quiet))) if len(quiet) > 20 else 1.0
        inflation = max(1.0, spread)
        layers.append((z / inflation, height, size, inflation))

    found: list[Candidate] = []
    free = allowed.copy()
    while layers:
        peaks = [strongest(z, free) for z, *_ in layers]
        best = max(range(len(layers)), key=lambda k: peaks[k][0])
        z, height, size, inflation = layers[best]
        row, column = divmod(peaks[best][1], grid.n_columns)
        if not free[row, column] or abs(z[row, column]) < threshold:
            break
        found.append(
            Candidate(
                float(grid.chainages[row]),
                float(grid.clocks[column]),
                size,
                size,
                float(height[row, column]),
                float(z[row, column]),
                inflation,
            )
        )
        free &= ~disc(grid, found[-1].chainage, found[-1].clock, 1.2 * size, 1.2 * size)
    return found


def disc(grid: Grid, chainage: float, clock: float, length: float, width: float) -> Flags:
    """Cells within an ellipse of full axes `length` and `width`."""
    along = (grid.chainages - chainage) / (length / 2)
    turn = np.mod(grid.clocks - clock + np.pi, 2 * np.pi) - np.pi
    around = turn * grid.radius / (width / 2)
    return np.asarray(along[:, None] ** 2 + around[None, :] ** 2 < 1.0)


def _respond(
    grid: Grid, deviation: Array, weight: Array, count: Array, size: float
) -> tuple[Array, Array, Array]:
    """Height of a bump of extent `size` at every cell, its sd, and the points under it."""
    bell = [_bell(size, grid.row_size), _bell(size, grid.column_size)]

    def correlate(table: Array, kernels: list[Array]) -> Array:
        along = ndimage.correlate1d(table, kernels[0], axis=0, mode="constant")
        return np.asarray(ndimage.correlate1d(along, kernels[1], axis=1, mode="wrap"))

    evidence = correlate(weight * np.nan_to_num(deviation), bell)
    precision = np.maximum(correlate(weight, [np.square(k) for k in bell]), 1e-12)
    points = correlate(count, [(k > 0.1).astype(np.float64) for k in bell])
    return evidence / precision, 1.0 / np.sqrt(precision), points


def _bell(size: float, cell: float) -> Array:
    half = int(np.floor(size / 2 / cell))
    return np.asarray(np.cos(np.pi * np.arange(-half, half + 1) * cell / size) ** 2)
