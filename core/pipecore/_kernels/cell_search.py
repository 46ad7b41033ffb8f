"""Search for the cells around an axis or a place, of two sizes."""

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pipecore._kernels.pipe_coordinates import across_axis, place_on_axis
from pipecore._kernels.voxel_hash import EMPTY, HashTable, slot_of


class PointCells(NamedTuple):
    """Points in fine cubic cells, which lie within coarse ones.

    low (3,): lower corner of the coarse cells, metres;
    edge: of a coarse cell, metres;
    n_y, n_z: numbers of coarse cells along y and z;
    table: from the numbers of coarse cells to their ids;
    cell_starts (c + 1,): where the fine cells of each coarse one begin;
    middles (m, 3): of the fine cells, metres;
    half_cell: half a fine cell's diagonal, metres;
    members (n,): the points, fine cell by fine cell;
    starts (m + 1,): where those of each begin.
    """

    low: NDArray[np.float64]
    edge: float
    n_y: int
    n_z: int
    table: HashTable
    cell_starts: NDArray[np.int64]
    middles: NDArray[np.float64]
    half_cell: float
    members: NDArray[np.int32]
    starts: NDArray[np.int64]


class Tube(NamedTuple):
    """The space between two distances from an axis and two chainages, metres.

    axis (17,): see `pipe_coordinates`;
    inner, outer: distances from it;
    begin, end: chainages.
    """

    axis: NDArray[np.float64]
    inner: float
    outer: float
    begin: float
    end: float


@njit(cache=True, nogil=True)
def appended(items, n, item):
    """Return an array with an item written at n, twice as long where it was full.

    Parameters
    ----------
    items (m,) : array with n items
    n : number of items
    item : of the array's type
    """
    if n == items.shape[0]:
        longer = np.empty(2 * n, items.dtype)
        longer[:n] = items
        items = longer
    items[n] = item
    return items


@njit(cache=True, nogil=True)
def distance_from_axis(axis, x, y, z):
    """Return the distance of a point from an unbounded line, a full circle or a curve, metres.

    Parameters
    ----------
    axis (17,) : see `pipe_coordinates`
    x, y, z : metres
    """
    if axis[12] < 0.0:
        _, up, right = across_axis(axis, x, y, z)
        return math.sqrt(up * up + right * right)
    px, py, pz = x - axis[0], y - axis[1], z - axis[2]
    along = px * axis[3] + py * axis[4] + pz * axis[5]
    across = math.sqrt(max(px * px + py * py + pz * pz - along * along, 0.0))
    if axis[12] == 0.0:
        return across
    beyond = across - axis[12]
    return math.sqrt(beyond * beyond + along * along)


@njit(cache=True, nogil=True)
def cells_around(grid, tube):
    """Find the fine cells that may hold points of a tube.

    The axis is walked in steps; each coarse cell is taken at the step nearest to it.

    Parameters
    ----------
    grid : PointCells
    tube : Tube

    Returns
    -------
    Indices of fine cells.
    """
    low, edge, n_y, n_z = grid.low, grid.edge, grid.n_y, grid.n_z
    table_keys, table_ids = grid.table.keys, grid.table.ids
    cell_starts, middles, half_cell = grid.cell_starts, grid.middles, grid.half_cell
    axis, inner, outer, begin, end = tube.axis, tube.inner, tube.outer, tube.begin, tube.end
    mask = np.int64(table_keys.shape[0] - 1)
    half_coarse = 0.5 * math.sqrt(3.0) * edge
    length = end - begin
    n_steps = max(1, math.ceil(length / max(1.5 * outer, 2.0 * edge)))
    step = length / n_steps
    reach = outer + 0.5 * step + half_coarse
    cells = np.empty(256, np.int64)
    n = 0
    for k in range(n_steps):
        px, py, pz = place_on_axis(axis, begin + (k + 0.5) * step)
        ix0 = max(math.floor((px - reach - low[0]) / edge), 0)
        ix1 = math.floor((px + reach - low[0]) / edge)
        iy0 = max(math.floor((py - reach - low[1]) / edge), 0)
        iy1 = min(math.floor((py + reach - low[1]) / edge), n_y - 1)
        iz0 = max(math.floor((pz - reach - low[2]) / edge), 0)
        iz1 = min(math.floor((pz + reach - low[2]) / edge), n_z - 1)
        for ix in range(ix0, ix1 + 1):
            x = low[0] + (ix + 0.5) * edge
            for iy in range(iy0, iy1 + 1):
                y = low[1] + (iy + 0.5) * edge
                for iz in range(iz0, iz1 + 1):
                    z = low[2] + (iz + 0.5) * edge
                    rho = distance_from_axis(axis, x, y, z)
                    if rho > outer + half_coarse or rho < inner - half_coarse:
                        continue
                    slot = slot_of((ix * n_y + iy) * n_z + iz, table_keys, mask)
                    if table_keys[slot] == EMPTY:
                        continue
                    chainage, _, _ = across_axis(axis, x, y, z)
                    nearest = math.floor((chainage - begin) / step)
                    if min(max(nearest, 0), n_steps - 1) != k:
                        continue
                    c = table_ids[slot]
                    for m in range(cell_starts[c], cell_starts[c + 1]):
                        rho = distance_from_axis(axis, middles[m, 0], middles[m, 1], middles[m, 2])
                        if inner - half_cell <= rho <= outer + half_cell:
                            cells = appended(cells, n, np.int64(m))
                            n += 1
    return cells[:n]


@njit(cache=True, nogil=True)
def cells_in_shell(grid, place, inner, outer):
    """Find the fine cells that may hold points between two distances from a place.

    Parameters
    ----------
    grid : PointCells
    place (3,) : metres
    inner, outer : distances, metres

    Returns
    -------
    Indices of fine cells.
    """
    low, edge, n_y, n_z = grid.low, grid.edge, grid.n_y, grid.n_z
    table_keys, table_ids = grid.table.keys, grid.table.ids
    cell_starts, middles, half_cell = grid.cell_starts, grid.middles, grid.half_cell
    mask = np.int64(table_keys.shape[0] - 1)
    half_coarse = 0.5 * math.sqrt(3.0) * edge
    px, py, pz = place[0], place[1], place[2]
    cells = np.empty(256, np.int64)
    n = 0
    ix0 = max(math.floor((px - outer - low[0]) / edge), 0)
    ix1 = math.floor((px + outer - low[0]) / edge)
    iy0 = max(math.floor((py - outer - low[1]) / edge), 0)
    iy1 = min(math.floor((py + outer - low[1]) / edge), n_y - 1)
    iz0 = max(math.floor((pz - outer - low[2]) / edge), 0)
    iz1 = min(math.floor((pz + outer - low[2]) / edge), n_z - 1)
    for ix in range(ix0, ix1 + 1):
        x = low[0] + (ix + 0.5) * edge - px
        for iy in range(iy0, iy1 + 1):
            y = low[1] + (iy + 0.5) * edge - py
            for iz in range(iz0, iz1 + 1):
                z = low[2] + (iz + 0.5) * edge - pz
                rho = math.sqrt(x * x + y * y + z * z)
                if rho > outer + half_coarse or rho < inner - half_coarse:
                    continue
                slot = slot_of((ix * n_y + iy) * n_z + iz, table_keys, mask)
                if table_keys[slot] == EMPTY:
                    continue
                c = table_ids[slot]
                for m in range(cell_starts[c], cell_starts[c + 1]):
                    u, v, w = middles[m, 0] - px, middles[m, 1] - py, middles[m, 2] - pz
                    rho = math.sqrt(u * u + v * v + w * w)
                    if inner - half_cell <= rho <= outer + half_cell:
                        cells = appended(cells, n, np.int64(m))
                        n += 1
    return cells[:n]
