"""Waviness: whether a surface leaves its shape all over, as cloth and cast bodies do.

A dent leaves a pipe's shape in one place, ovality and a bow over all of it but smoothly.
Folds of clothes and the curves of limbs leave it everywhere and over short distances, by
more than the scatter of the points explains.
"""

import numpy as np
from numpy.typing import NDArray

from pipecore._kernels.misfit import least_distances
from pipecore.robust import robust_sd

Array = NDArray[np.float64]

MIN_ROW, ROW = 0.03, 0.4
"""Length of a cell along the axis: metres, radii."""
CELL_WIDTH, SECTORS = 0.03, (12, 24)
"""Width of a cell around the axis, metres, and the least and most cells around it."""
MIN_IN_CELL, MIN_CELLS = 4, 12
OVAL_ARC = np.deg2rad(200.0)
"""From this arc on an oval section can be distinguished from a round one that is off centre."""
MIN_SIGNIFICANCE = 4.0
"""Cells are wavy if their scatter exceeds that of noise by this many standard deviations."""
N_STEPS = 8
HALF_OF_SQUARES, VARIANCE_OF_MEDIAN = 0.4549, 5.4
"""Median of the square of a standard normal variable; variance, times n, of that of n in units
of it."""


def waviness(chainage: Array, clock: Array, residual: Array, radius: float, arc: float) -> float:
    """How far a surface leaves its shape all over, metres; 0 where noise explains it.

    The mean residuals of small cells are freed of what pipes may have (an axis that is
    off, tilted or bowed, and where the arc can tell an oval section that changes along
    the pipe). Of what is left the median square counts, so that a dent or a weld does not.

    Parameters
    ----------
    chainage, clock, residual : ndarray, shape (n,)
        Of the points on the surface.
    radius : float
    arc : float
        That the surface shows, radians.

    Returns
    -------
    float
        Standard deviation of the cells beyond noise; nan with too few cells.
    """
    if len(chainage) == 0:
        return np.nan
    step = max(ROW * radius, MIN_ROW)
    n_sectors = int(np.clip(2 * np.pi * radius / CELL_WIDTH, *SECTORS))
    row = np.floor((chainage - chainage.min()) / step).astype(np.intp)
    sector = (clock / (2 * np.pi) * n_sectors).astype(np.intp) % n_sectors
    place = row * n_sectors + sector
    in_place = np.bincount(place)
    cell = np.flatnonzero(in_place)
    n, of_cell = in_place[cell], (np.cumsum(in_place > 0) - 1)[place]
    mean = np.bincount(of_cell, residual) / n
    used = n >= MIN_IN_CELL
    if used.sum() < MIN_CELLS:
        return np.nan
    along, around = cell[used] // n_sectors, (cell[used] % n_sectors + 0.5) * 2 * np.pi / n_sectors
    design = _allowed(along, around, is_oval=arc > OVAL_ARC)
    if used.sum() < design.shape[1] + 6:
        return np.nan
    within = (residual - mean[of_cell]) * np.sqrt(n / np.maximum(n - 1.0, 1.0))[of_cell]
    noise = max(robust_sd(within[used[of_cell]]), 1e-6)
    mean, expected = mean[used], noise / np.sqrt(n[used])
    left = least_distances(design, mean, expected, N_STEPS)
    scatter = np.median(np.square(left / expected)) / HALF_OF_SQUARES
    if scatter < 1.0 + MIN_SIGNIFICANCE * np.sqrt(VARIANCE_OF_MEDIAN / len(left)):
        return 0.0
    excess = np.median(np.square(left)) / HALF_OF_SQUARES - np.median(np.square(expected))
    return float(np.sqrt(max(excess, 0.0)))


def _allowed(row: NDArray[np.intp], clock: Array, *, is_oval: bool) -> Array:
    """Shapes that a pipe may have, one column each, shape (cells, terms)."""
    span = max(int(np.ptp(row)), 1)
    x = 2.0 * (row - row.mean()) / span
    powers = [np.ones_like(x)] if span < 3 else [np.ones_like(x), x, x * x]
    waves = [np.cos(clock), np.sin(clock)]
    if is_oval:
        waves += [np.cos(2 * clock), np.sin(2 * clock)]
    return np.stack([np.ones_like(x), *(p * w for w in waves for p in powers)], axis=1)
