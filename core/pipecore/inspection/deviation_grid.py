"""The deviation of an element's points, averaged in cells of chainage and clock."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipecore.geometry import Array
from pipecore.inspection.points import ElementPoints
from pipecore.types import Element

CELL_RADII = 0.1
"""Size of a cell in radii of the pipe; larger where there are too few points."""
MAX_CELL_RADII = 0.4
MIN_POINTS_PER_CELL = 3
"""Least median number of points in the cells that have any."""
MAX_ROWS = 4000


@dataclass(frozen=True, eq=False)
class DeviationGrid:
    """A pipe's surface cut open along its length and laid flat.

    Parameters
    ----------
    deviation : ndarray, shape (n_rows, n_columns)
        Mean of the points in each cell, metres, outward positive; nan where there are
        none. Rows follow the chainage, columns the clock.
    n_points : ndarray of int, shape (n_rows, n_columns)
    start, length : float
        Chainage at which the grid starts and its length, metres.
    centre_clock : float
        Clock angle in the middle of the columns, radians.
    """

    deviation: Array
    n_points: NDArray[np.intp]
    start: float
    length: float
    centre_clock: float = 0.0

    @property
    def chainages(self) -> Array:
        """Centres of the rows, metres."""
        n_rows = self.deviation.shape[0]
        return np.asarray(self.start + (np.arange(n_rows) + 0.5) * self.length / n_rows)

    @property
    def clocks(self) -> Array:
        """Centres of the columns, clock angles 0 … 2π."""
        n_columns = self.deviation.shape[1]
        from_centre = (np.arange(n_columns) + 0.5) * 2 * np.pi / n_columns - np.pi
        return np.asarray(np.mod(self.centre_clock + from_centre, 2 * np.pi))

    def cell(self, chainage: float, clock: float) -> tuple[int, int] | None:
        """Return row and column of a place, None outside the grid."""
        n_rows, n_columns = self.deviation.shape
        row = int(np.floor((chainage - self.start) / self.length * n_rows))
        turn = float(clock_from(clock, self.centre_clock)) + np.pi
        column = int(turn / (2 * np.pi) * n_columns) % n_columns
        return (row, column) if 0 <= row < n_rows else None


def clock_from(clock: Array | float, centre: float = 0.0) -> Array:
    """Return clock angles as angles from another one.

    Parameters
    ----------
    clock : ndarray or float
        Radians.
    centre : float
        The clock angle that counts as zero, radians.

    Returns
    -------
    ndarray
        -π … π, of the shape of `clock`.
    """
    return np.asarray(np.mod(np.asarray(clock) - centre + np.pi, 2 * np.pi) - np.pi)


def grid_deviation(
    element: Element,
    points: ElementPoints,
    *,
    extent: tuple[float, float] | None = None,
    centre_clock: float = 0.0,
) -> DeviationGrid:
    """Average the deviation of an element's points in cells of chainage and clock.

    Cells are squares of a tenth of the radius, larger (up to 0.4 r) where points are few.

    Parameters
    ----------
    element : Element
    points : ElementPoints
        Those without a deviation are left out.
    extent : tuple of float, optional
        First and last chainage of the grid, metres; by default the element with all its
        points.
    centre_clock : float
        Clock angle in the middle of the columns, radians.

    Returns
    -------
    DeviationGrid
    """
    chainage, deviation = points.chainage, points.deviation
    is_known = np.isfinite(deviation)
    if extent is None:
        known = chainage[is_known]
        start = min(0.0, float(known.min(initial=0.0)))
        stop = max(element.axis.length, float(known.max(initial=0.0)))
    else:
        start, stop = extent
        is_known &= (chainage >= start) & (chainage <= stop)
    along, turn = chainage[is_known], clock_from(points.clock[is_known], centre_clock) + np.pi
    length = max(stop - start, 1e-3)
    size = CELL_RADII
    while True:
        n_columns = round(2 * np.pi / size)
        n_rows = int(np.clip(np.ceil(length / (size * element.radius)), 1, MAX_ROWS))
        row = np.clip(((along - start) / length * n_rows).astype(np.intp), 0, n_rows - 1)
        column = (turn / (2 * np.pi) * n_columns).astype(np.intp) % n_columns
        counts = np.bincount(row * n_columns + column, minlength=n_rows * n_columns)
        is_full = not counts.any() or np.median(counts[counts > 0]) >= MIN_POINTS_PER_CELL
        if is_full or size * np.sqrt(2) > MAX_CELL_RADII:
            break
        size *= np.sqrt(2)
    sums = np.bincount(row * n_columns + column, deviation[is_known], n_rows * n_columns)
    mean = np.where(counts > 0, sums / np.maximum(counts, 1), np.nan)
    shape = (n_rows, n_columns)
    return DeviationGrid(mean.reshape(shape), counts.reshape(shape), start, length, centre_clock)
