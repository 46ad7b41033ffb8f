"""The deviation of an element's points, averaged in cells of chainage and clock. Qt-free."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipecore.geometry import Array
from pipecore.types import Element

CELL_RADII = 0.1
"""Size of a cell in radii of the pipe; larger where there are too few points."""
LARGEST_CELL_RADII = 0.4
ENOUGH_POINTS = 3
"""Median number in the cells that have any."""
MAX_CELLS_ALONG = 4000


@dataclass(frozen=True, eq=False)
class Unrolled:
    """A pipe's surface cut open at 6:00 and laid flat, 12:00 in the middle.

    Parameters
    ----------
    deviation_mm : ndarray, shape (n_along, n_around)
        Mean of the points in each cell, nan where there are none.
    n_points : ndarray of int, shape (n_along, n_around)
    start, length : float
        Chainage at which the map starts and its length, metres.
    """

    deviation_mm: Array
    n_points: NDArray[np.intp]
    start: float
    length: float

    def cell(self, chainage: float, clock: float) -> tuple[int, int] | None:
        """Return the cell at a place, or None outside the map."""
        n_along, n_around = self.deviation_mm.shape
        along = int(np.floor((chainage - self.start) / self.length * n_along))
        around = int((from_clock(clock) + np.pi) / (2 * np.pi) * n_around) % n_around
        return (along, around) if 0 <= along < n_along else None


def from_clock(clock: Array | float) -> Array:
    """Angle from 12:00, -π … π, of clock angles 0 … 2π: the map's second axis."""
    return np.mod(np.asarray(clock) + np.pi, 2 * np.pi) - np.pi


def unroll(element: Element, chainage: Array, clock: Array, deviation: Array) -> Unrolled:
    """Return the map of an element from its points' pipe coordinates and deviations (metres)."""
    known = np.isfinite(deviation)
    chainage, clock, deviation = chainage[known], clock[known], deviation[known]
    start = min(0.0, float(chainage.min(initial=0.0)))
    stop = max(element.axis.length, float(chainage.max(initial=0.0)))
    length = max(stop - start, 1e-3)
    size = CELL_RADII
    while True:
        n_around = round(2 * np.pi / size)
        n_along = int(np.clip(np.ceil(length / (size * element.radius)), 1, MAX_CELLS_ALONG))
        along = np.clip(((chainage - start) / length * n_along).astype(np.intp), 0, n_along - 1)
        around = ((from_clock(clock) + np.pi) / (2 * np.pi) * n_around).astype(np.intp) % n_around
        counts = np.bincount(along * n_around + around, minlength=n_along * n_around)
        has_enough = not counts.any() or np.median(counts[counts > 0]) >= ENOUGH_POINTS
        if has_enough or size * np.sqrt(2) > LARGEST_CELL_RADII:
            break
        size *= np.sqrt(2)
    sums = np.bincount(along * n_around + around, 1000 * deviation, n_along * n_around)
    means = np.where(counts > 0, sums / np.maximum(counts, 1), np.nan)
    shape = (n_along, n_around)
    return Unrolled(means.reshape(shape), counts.reshape(shape), start, length)
