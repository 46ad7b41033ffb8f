"""The deviation map: signed distances from the contour in cells over chainage and clock."""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pipecore._kernels import map_filters as kernels
from pipecore.geometry import Array
from pipecore.robust import MAD_TO_SD, robust_sd
from pipecore.types import Element

Flags = NDArray[np.bool_]
Cells = NDArray[np.intp]

CELL_PER_RADIUS = 0.1


@dataclass(frozen=True)
class Grid:
    """Cells over the chainage (rows, 0 … length) and the whole clock (columns).

    Parameters
    ----------
    length, radius : float
        Of the element, metres; the radius is the mean one of a cone.
    n_rows, n_columns : int
    """

    length: float
    radius: float
    n_rows: int
    n_columns: int

    @classmethod
    def for_element(cls, element: Element, spacing: float) -> "Grid":
        """Return a grid of cells of 0.1 radii, larger where points are sparse.

        Parameters
        ----------
        element : Element
        spacing : float
            Distance between points, metres.

        Returns
        -------
        Grid
        """
        radius = (element.radius + element.radius_end) / 2
        cell = max(CELL_PER_RADIUS * radius, 0.7 * spacing)
        length = element.axis.length
        rows = max(4, round(length / cell))
        return cls(length, radius, rows, max(16, round(2 * np.pi * radius / cell)))

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.n_rows, self.n_columns

    @property
    def row_size(self) -> float:
        """Metres of chainage in one cell."""
        return self.length / self.n_rows

    @property
    def column_angle(self) -> float:
        """Radians of clock in one cell."""
        return 2 * np.pi / self.n_columns

    @property
    def column_size(self) -> float:
        """Metres around the circumference in one cell."""
        return self.column_angle * self.radius

    @property
    def chainages(self) -> Array:
        """Centres of the rows, metres."""
        return np.asarray((np.arange(self.n_rows) + 0.5) * self.row_size)

    @property
    def clocks(self) -> Array:
        """Centres of the columns, radians."""
        return np.asarray((np.arange(self.n_columns) + 0.5) * self.column_angle)

    def rows_near(self, chainage: float, reach: float) -> slice:
        """Return the rows whose middles may lie within reach of a chainage.

        Parameters
        ----------
        chainage, reach : float
            Metres.

        Returns
        -------
        slice
        """
        first = math.floor((chainage - reach) / self.row_size - 0.5)
        last = math.ceil((chainage + reach) / self.row_size - 0.5)
        return slice(min(max(first, 0), self.n_rows), min(max(last + 1, 0), self.n_rows))

    def cell_of(self, chainage: Array, clock: Array) -> Cells:
        """Return the flat index of the cell of each point.

        Parameters
        ----------
        chainage, clock : ndarray, shape (n,)
            Metres and radians; points beyond the ends fall into the end cells.

        Returns
        -------
        ndarray of int, shape (n,)
        """
        row = np.clip(np.floor(chainage / self.row_size), 0, self.n_rows - 1)
        column = np.mod(np.floor(clock / self.column_angle), self.n_columns)
        return (row * self.n_columns + column).astype(np.intp)

    def count(self, cell: Cells) -> Array:
        """Return the number of points per cell.

        Parameters
        ----------
        cell : ndarray of int, shape (n,)
            Flat index of each point's cell.

        Returns
        -------
        ndarray, shape (rows, columns)
        """
        counts = np.bincount(cell, minlength=self.n_rows * self.n_columns)
        return counts.reshape(self.shape).astype(np.float64)

    def total(self, cell: Cells, values: Array) -> Array:
        """Return the sum of values per cell.

        Parameters
        ----------
        cell : ndarray of int, shape (n,)
            Flat index of each point's cell.
        values : ndarray, shape (n,)

        Returns
        -------
        ndarray, shape (rows, columns)
        """
        size = self.n_rows * self.n_columns
        return np.bincount(cell, values, minlength=size).reshape(self.shape).astype(np.float64)

    def mean(self, cell: Cells, values: Array) -> Array:
        """Return the mean of values per cell.

        Parameters
        ----------
        cell : ndarray of int, shape (n,)
            Flat index of each point's cell.
        values : ndarray, shape (n,)

        Returns
        -------
        ndarray, shape (rows, columns)
            nan where a cell is empty.
        """
        n = self.count(cell)
        return np.where(n > 0, self.total(cell, values) / np.maximum(n, 1), np.nan)

    def interpolate(self, table: Array, chainage: Array, clock: Array) -> Array:
        """Return the values of a table at points, bilinear between cells' middles, round the clock.

        Parameters
        ----------
        table : ndarray, shape (rows, columns)
        chainage, clock : ndarray, shape (n,)
            Metres and radians.

        Returns
        -------
        ndarray, shape (n,)
        """
        values = np.empty(len(chainage))
        kernels.interpolate(table, self.row_size, self.column_angle, chainage, clock, values)
        return values


@dataclass(frozen=True, eq=False)
class DeviationMap:
    """Signed distance from the undeformed contour over chainage and clock.

    Parameters
    ----------
    grid : Grid
    deviation : ndarray, shape (rows, columns)
        Mean of each cell's points, metres, outward positive; nan where there are none.
    noise : ndarray, shape (rows, columns)
        Standard deviation of one point there, metres.
    count : ndarray, shape (rows, columns)
        Points of the surface.
    in_contact : ndarray of bool, shape (rows, columns)
        Cells where another object touches the surface.
    """

    grid: Grid
    deviation: Array
    noise: Array
    count: Array
    in_contact: Flags

    @cached_property
    def covered(self) -> Flags:
        """Cells with points, small holes between sparse points closed."""
        return close_holes(self.count > 0)

    @cached_property
    def near_contact(self) -> Flags:
        """Cells in contact with another object, and the cells next to them."""
        return dilate(self.in_contact)


def close_holes(cells: Flags) -> Flags:
    """Close holes of one or two cells, round the clock.

    Parameters
    ----------
    cells : ndarray of bool, shape (rows, columns)

    Returns
    -------
    ndarray of bool, shape (rows, columns)
    """
    wide = np.pad(np.pad(cells, ((0, 0), (3, 3)), mode="wrap"), ((3, 3), (0, 0)))
    return np.asarray(ndimage.binary_closing(wide, np.ones((3, 3)))[3:-3, 3:-3])


def dilate(cells: Flags, times: int = 1) -> Flags:
    """Grow flagged cells to their neighbours, round the clock.

    Parameters
    ----------
    cells : ndarray of bool, shape (rows, columns)
    times : int
        By how many cells.

    Returns
    -------
    ndarray of bool, shape (rows, columns)
    """
    wide = np.pad(cells, ((0, 0), (times, times)), mode="wrap")
    wide = ndimage.binary_dilation(wide, np.ones((3, 3)), iterations=times)
    return np.asarray(wide[:, times:-times])


def box_sum(table: Array, reach: int = 1) -> Array:
    """Return sums over (2·reach + 1)² cells, round the clock, nothing beyond the ends.

    Parameters
    ----------
    table : ndarray, shape (rows, columns)
    reach : int
        Cells to either side.

    Returns
    -------
    ndarray, shape (rows, columns)
    """
    size = 2 * reach + 1
    along = ndimage.uniform_filter1d(table, size, axis=0, mode="constant") * size
    return np.asarray(ndimage.uniform_filter1d(along, size, axis=1, mode="wrap") * size)


def point_spacing(element: Element, chainage: Array, clock: Array) -> float:
    """Return the typical distance between points on an element, from how many share a cell.

    Parameters
    ----------
    element : Element
    chainage, clock : ndarray, shape (n,)
        Of its points, metres and radians.

    Returns
    -------
    float
        Metres.
    """
    radius = (element.radius + element.radius_end) / 2
    size = 0.25 * radius
    rows = max(1, round(element.axis.length / size))
    grid = Grid(element.axis.length, radius, rows, 25)
    count = grid.count(grid.cell_of(chainage, clock))
    occupied = count[count > 0]
    if len(occupied) == 0:
        return size
    return float(np.sqrt(grid.row_size * grid.column_size / np.median(occupied)))


def local_noise(grid: Grid, cell: Cells, height: Array) -> Array:
    """Return the standard deviation of one point about its neighbourhood's mean, per cell.

    Robust (from the median of absolute residuals) over blocks of about 30° by 1 m, as
    noise follows range and incidence; the whole element's where a block has few points.

    Parameters
    ----------
    grid : Grid
    cell : ndarray of int, shape (n,)
        Flat index of each point's cell.
    height : ndarray, shape (n,)
        Metres.

    Returns
    -------
    ndarray, shape (rows, columns)
        Metres.
    """
    n, total = grid.count(cell), grid.total(cell, height)
    around, mean = box_sum(n), box_sum(total)
    mean /= np.maximum(around, 1)
    # A point pulls the mean it is compared with: n - 1 of n degrees of freedom are left.
    share = np.sqrt(np.maximum(around - 1, 0) / np.maximum(around, 1))
    usable = around.ravel()[cell] >= 4
    if np.count_nonzero(usable) < 10:
        return np.full(grid.shape, robust_sd(height - np.median(height)))
    residual = np.abs(height - mean.ravel()[cell])[usable] / share.ravel()[cell[usable]]
    overall = robust_sd(residual)
    block_rows = max(1, round(1.0 / grid.row_size))
    block_columns = max(1, round(grid.n_columns / 12))
    row, column = np.divmod(cell[usable], grid.n_columns)
    n_across = -(-grid.n_columns // block_columns)
    block = (row // block_rows) * n_across + column // block_columns
    n_blocks = (-(-grid.n_rows // block_rows)) * n_across
    medians, counts = group_median(block, residual, n_blocks)
    # A shrunken estimate: forty points' worth of belief in the whole element's noise.
    local = np.where(counts > 0, MAD_TO_SD * medians, overall)
    blended = np.sqrt((counts * local**2 + 40 * overall**2) / (counts + 40))
    rows, columns = np.indices(grid.shape)
    return np.asarray(blended[(rows // block_rows) * n_across + columns // block_columns])


def group_median(group: Cells, values: Array, n_groups: int) -> tuple[Array, Array]:
    """Return the median and the count of the values of each group.

    Parameters
    ----------
    group : ndarray of int, shape (n,)
    values : ndarray, shape (n,)
    n_groups : int

    Returns
    -------
    medians, counts : ndarray, shape (n_groups,)
        Medians are nan where a group is empty.
    """
    medians, counts = np.empty(n_groups), np.empty(n_groups)
    kernels.group_medians(group, values, medians, counts)
    return medians, counts
