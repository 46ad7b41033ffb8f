"""Local surface properties of points from their neighbours, found in a hashed grid of cells."""

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pipecore._kernels.eigen import least_eigenpair
from pipecore._kernels.voxel_hash import HashTable

LANES = 16
FAR_OFF = np.float32(1e18)
BATCH = 256
"""Points whose planes are solved for together."""
N_SUMS = 10
_ROWS = np.array([0, 0, 9, 34, 83, 164])
"""Where the rows of cells of each reach begin among those of all reaches."""


class SortedCells(NamedTuple):
    """Cubic cells that hold points, which are sorted by cell.

    keys (c,): numbers of the cells, ascending;
    starts (c + 1,): where the points of each begin;
    n_y, n_z: numbers of cells along y and z.
    """

    keys: NDArray[np.int64]
    starts: NDArray[np.integer]
    n_y: int
    n_z: int


class FoundCells(NamedTuple):
    """Cubic cells that hold points, looked up by a hash table.

    order (n,): the points, cell by cell;
    cells: the cells in that order;
    table: from the cells' numbers to their places in `cells`.
    """

    order: NDArray[np.integer]
    cells: SortedCells
    table: HashTable


@njit(cache=True, nogil=True)
def fit_planes(
    xyz, cells, radius, min_neighbours, start, stop, places, normals, residuals, spacings
):
    """Fit a plane to the neighbours of the points of some cells.

    Where there are too few neighbours, the radius grows in steps up to fourfold.

    Parameters
    ----------
    xyz (n, 3) : points sorted by cell, metres
    cells : SortedCells of edge `radius`
    radius : within which neighbours lie, metres
    min_neighbours : least number of neighbours, the point itself among them
    start, stop : range of cells
    places (n,) : where the results of each point are written
    normals (n, 3), residuals, spacings (n,) : filled with unit normals, root mean square
      distance from the plane and point spacing, metres; nan where there are too few neighbours
    """
    cell_starts = cells.starts
    first, last = np.empty(81, np.int64), np.empty(81, np.int64)
    begins = np.zeros(_ROWS[-1], np.int64)
    near = np.empty((3, 512), np.float32)
    sums, reaches = np.empty((N_SUMS, BATCH)), np.empty(BATCH)
    points, planes = np.empty(BATCH, np.int64), np.empty((5, BATCH))
    n_points = 0
    r2 = np.float32(radius * radius)
    for c in range(start, stop):
        # Looked up once for all points of the cell, and copied side by side.
        reach = 1
        n_ranges = list_ranges(c, reach, cells, begins, first, last)
        n_near = 0
        for k in range(n_ranges):
            n_near += last[k] - first[k]
        if n_near + LANES > near.shape[1]:
            near = np.empty((3, 2 * n_near + LANES), np.float32)
        zero = cell_starts[c]
        n_near = copy_ranges(xyz, zero, n_ranges, first, last, near)
        for i in range(cell_starts[c], cell_starts[c + 1]):
            if n_points == BATCH:
                solve_planes(n_points, sums, reaches, planes)
                write_planes(n_points, planes, points, normals, residuals, spacings)
                n_points = 0
            own = sums[:, n_points]
            sums_within(
                near[0, :n_near],
                near[1, :n_near],
                near[2, :n_near],
                np.float32(xyz[i, 0] - xyz[zero, 0]),
                np.float32(xyz[i, 1] - xyz[zero, 1]),
                np.float32(xyz[i, 2] - xyz[zero, 2]),
                r2,
                own,
            )
            reaches[n_points] = radius
            if own[0] < min_neighbours:
                for quarters in (5, 6, 7, 8, 10, 12, 16):
                    if reach != (quarters + 3) // 4:
                        reach = (quarters + 3) // 4
                        n_ranges = list_ranges(c, reach, cells, begins, first, last)
                    reaches[n_points] = 0.25 * quarters * radius
                    sum_ranges(xyz, i, n_ranges, first, last, reaches[n_points], own)
                    if own[0] >= min_neighbours:
                        break
            at = places[i]
            if own[0] >= min_neighbours:
                points[n_points] = at
                n_points += 1
            else:
                normals[at, 0] = normals[at, 1] = normals[at, 2] = math.nan
                residuals[at] = spacings[at] = math.nan
    solve_planes(n_points, sums, reaches, planes)
    write_planes(n_points, planes, points, normals, residuals, spacings)


@njit(cache=True, nogil=True)
def copy_ranges(xyz, zero, n_ranges, first, last, near):
    """Copy the points of some ranges, relative to one point; return their number.

    Filled up to whole lanes by points out of reach.

    Parameters
    ----------
    xyz (n, 3) : points, metres
    zero : index of that point
    n_ranges, first, last (ranges,) : the ranges
    near (3, m) : filled, single precision
    """
    x, y, z = xyz[zero, 0], xyz[zero, 1], xyz[zero, 2]
    n = 0
    for k in range(n_ranges):
        for j in range(first[k], last[k]):
            near[0, n] = xyz[j, 0] - x
            near[1, n] = xyz[j, 1] - y
            near[2, n] = xyz[j, 2] - z
            n += 1
    while n % LANES > 0:
        near[0, n] = near[1, n] = near[2, n] = FAR_OFF
        n += 1
    return n


@njit(cache=True, nogil=True, fastmath={"reassoc", "contract"})
def sums_within(xs, ys, zs, px, py, pz, r2, sums):
    """Write count, sums and sums of products of the points within reach of one, relative to it.

    In single precision, a ten millionth of the reach, and summed in lanes side by side.

    Parameters
    ----------
    xs, ys, zs (n,) : points, metres
    px, py, pz : that one
    r2 : square of the reach, metres²
    sums (N_SUMS,) : filled with n, x, y, z, xx, xy, xz, yy, yz, zz
    """
    none, one = np.float32(0.0), np.float32(1.0)
    n = sx = sy = sz = sxx = sxy = sxz = syy = syz = szz = none
    for j in range(xs.shape[0]):
        x, y, z = xs[j] - px, ys[j] - py, zs[j] - pz
        w = one if x * x + y * y + z * z <= r2 else none
        wx, wy, wz = w * x, w * y, w * z
        n += w
        sx += wx
        sy += wy
        sz += wz
        sxx += wx * x
        sxy += wx * y
        sxz += wx * z
        syy += wy * y
        syz += wy * z
        szz += wz * z
    sums[0], sums[1], sums[2], sums[3] = n, sx, sy, sz
    sums[4], sums[5], sums[6] = sxx, sxy, sxz
    sums[7], sums[8], sums[9] = syy, syz, szz


@njit(cache=True, nogil=True)
def sum_ranges(xyz, i, n_ranges, first, last, reach, sums):
    """Write what `sums_within` does, of the points of some ranges.

    Parameters
    ----------
    xyz (n, 3) : points, metres
    i : index of the point
    n_ranges, first, last (ranges,) : the ranges
    reach : metres
    sums (N_SUMS,) : filled
    """
    px, py, pz = xyz[i, 0], xyz[i, 1], xyz[i, 2]
    sums[:] = 0.0
    for k in range(n_ranges):
        for j in range(first[k], last[k]):
            x, y, z = xyz[j, 0] - px, xyz[j, 1] - py, xyz[j, 2] - pz
            if x * x + y * y + z * z <= reach * reach:
                sums[0] += 1.0
                sums[1] += x
                sums[2] += y
                sums[3] += z
                sums[4] += x * x
                sums[5] += x * y
                sums[6] += x * z
                sums[7] += y * y
                sums[8] += y * z
                sums[9] += z * z


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def solve_planes(n_points, sums, reaches, planes):
    """Write normal, residual and spacing of neighbourhoods.

    Parameters
    ----------
    n_points : number of neighbourhoods
    sums (N_SUMS, BATCH) : of each, see `sums_within`
    reaches (BATCH,) : metres
    planes (5, BATCH) : filled with the unit normal, residual and spacing
    """
    for i in range(n_points):
        n = sums[0, i]
        x, y, z = sums[1, i] / n, sums[2, i] / n, sums[3, i] / n
        xx, xy, xz = sums[4, i] / n - x * x, sums[5, i] / n - x * y, sums[6, i] / n - x * z
        yy, yz, zz = sums[7, i] / n - y * y, sums[8, i] / n - y * z, sums[9, i] / n - z * z
        least, planes[0, i], planes[1, i], planes[2, i] = least_eigenpair(xx, xy, xz, yy, yz, zz)
        planes[3, i] = math.sqrt(max(least, 0.0) * n / (n - 3.0))
        planes[4, i] = reaches[i] * math.sqrt(math.pi / n)


@njit(cache=True, nogil=True)
def write_planes(n_points, planes, points, normals, residuals, spacings):
    """Write the planes of a batch to their points.

    Parameters
    ----------
    n_points : number of points
    planes (5, BATCH) : of `solve_planes`
    points (BATCH,) : place of each
    normals (n, 3), residuals, spacings (n,) : filled there
    """
    for i in range(n_points):
        at = points[i]
        normals[at, 0], normals[at, 1], normals[at, 2] = planes[0, i], planes[1, i], planes[2, i]
        residuals[at], spacings[at] = planes[3, i], planes[4, i]


@njit(cache=True, nogil=True)
def list_ranges(c, reach, cells, begins, first, last):
    """List the ranges of points in the cells around one; return their number.

    Cells are numbered row by row, so that those of a row lie side by side.

    Parameters
    ----------
    c : index of the cell
    reach : number of cells to either side
    cells : SortedCells
    begins (164,) : where rows around begin; kept from call to call, for rising cells
    first, last (ranges,) : filled
    """
    cell_keys, cell_starts, n_y, n_z = cells.keys, cells.starts, cells.n_y, cells.n_z
    n_cells = cell_keys.shape[0]
    row = _ROWS[reach]
    n = 0
    for dx in range(-reach, reach + 1):
        for dy in range(-reach, reach + 1):
            low = cell_keys[c] + (dx * n_y + dy) * n_z - reach
            begin = first_from(cell_keys, begins[row], low)
            begins[row] = begin
            row += 1
            end = begin
            while end < n_cells and cell_keys[end] <= low + 2 * reach:
                end += 1
            if end > begin:
                first[n], last[n] = cell_starts[begin], cell_starts[end]
                n += 1
    return n


@njit(cache=True, nogil=True)
def first_from(keys, begin, low):
    """Return the index of the first key that is not below a limit, from an index on.

    Found in growing steps: it is mostly near.

    Parameters
    ----------
    keys (n,) : ascending
    begin : the index to begin at
    low : the limit
    """
    n = keys.shape[0]
    if begin >= n or keys[begin] >= low:
        return begin
    step = 1
    while begin + step < n and keys[begin + step] < low:
        begin += step
        step *= 2
    begin, end = begin + 1, min(begin + step, n)
    while begin < end:
        middle = (begin + end) // 2
        if keys[middle] < low:
            begin = middle + 1
        else:
            end = middle
    return begin
