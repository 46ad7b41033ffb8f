"""Plane stretches of a surface, from sums over cubic cells.

The sums of a cell are whole numbers, so that those of parts of a cloud add up to those of the
whole: how many points have a normal, the sum of n nᵀ (xx, xy, xz, yy, yz, zz), and that of the
places within the cell, both in units of 1 / `SCALE`.
"""

import math

import numpy as np
from numba import njit

from pipecore._kernels.disjoint_sets import find_root, unite
from pipecore._kernels.eigen import eigenvalues, eigenvector

SCALE = 2.0**20
N_SUMS = 10

MIN_CELLS, MIN_ACROSS = 12, 1.0
"""Patches of fewer cells are no planes, nor are those of less mean square width: four cells."""


@njit(cache=True, nogil=True)
def whole(value):
    """Return the nearest whole number of units of 1 / `SCALE`.

    Parameters
    ----------
    value : any unit
    """
    return np.int64(math.floor(value * SCALE + 0.5))


@njit(cache=True, nogil=True)
def add_to_cells(xyz, normals, ids, edge, sums):
    """Add points that have a normal to the sums of their cells.

    Parameters
    ----------
    xyz, normals (n, 3) : points, metres, and unit normals, nan where not known
    ids (n,) : cell of each point
    edge : of a cell, metres
    sums (c, N_SUMS) : added to
    """
    for i in range(ids.shape[0]):
        x, y, z = normals[i, 0], normals[i, 1], normals[i, 2]
        if math.isnan(x):
            continue
        c = ids[i]
        sums[c, 0] += 1
        sums[c, 1] += whole(x * x)
        sums[c, 2] += whole(x * y)
        sums[c, 3] += whole(x * z)
        sums[c, 4] += whole(y * y)
        sums[c, 5] += whole(y * z)
        sums[c, 6] += whole(z * z)
        for k in range(3):
            place = xyz[i, k] / edge
            sums[c, 7 + k] += whole(place - math.floor(place))


@njit(cache=True, nogil=True)
def describe_cells(
    keys, cells, sums, n_y, n_z, min_points, max_spread, max_curved, is_flat, normals, means
):
    """Write whether each cell and those around it are flat, their normal, and the cell's mean.

    A place is flat if the second eigenvalue of Σnnᵀ is small, and hardly above the least: noise
    turns normals alike in both directions, a curved surface in one.

    Parameters
    ----------
    keys (c,) : numbers of the cells, ascending, row by row
    cells (c, 3) : the cells
    sums (c, N_SUMS) : see the module
    n_y, n_z : numbers of cells along y and z
    min_points : least number of points of a cell and those around it
    max_spread : largest second eigenvalue, fraction of the sum of all
    max_curved : largest difference of the two smaller eigenvalues, fraction of that sum
    is_flat (c,), normals, means (c, 3) : filled; means in edges; nan where not known
    """
    n = keys.shape[0]
    begins = np.zeros(9, np.int64)
    around = np.empty(7, np.int64)
    for c in range(n):
        around[:] = 0
        for row in range(9):
            low = keys[c] + ((row // 3 - 1) * n_y + row % 3 - 1) * n_z - 1
            j = begins[row]
            while j < n and keys[j] < low:
                j += 1
            begins[row] = j
            while j < n and keys[j] <= low + 2:
                for k in range(7):
                    around[k] += sums[j, k]
                j += 1
        own = sums[c, 0]
        for k in range(3):
            means[c, k] = cells[c, k] + sums[c, 7 + k] / (own * SCALE) if own > 0 else math.nan
        is_flat[c] = False
        normals[c, 0] = normals[c, 1] = normals[c, 2] = math.nan
        if own == 0 or around[0] < min_points:
            continue
        share = 1.0 / (around[0] * SCALE)
        xx, xy, xz = around[1] * share, around[2] * share, around[3] * share
        yy, yz, zz = around[4] * share, around[5] * share, around[6] * share
        least, middle, largest = eigenvalues(xx, xy, xz, yy, yz, zz)
        if middle <= max_spread and middle - least <= max_curved:
            is_flat[c] = True
            x, y, z = eigenvector(xx, xy, xz, yy, yz, zz, largest)
            normals[c, 0], normals[c, 1], normals[c, 2] = x, y, z


@njit(cache=True, nogil=True)
def unite_flat(
    keys, cells, n_y, n_z, block, begin, is_member, normals, means, min_cos, max_offset, parents
):
    """Unite neighbouring cells that continue each other within a block.

    Parameters
    ----------
    keys (c,) : numbers of the cells, ascending, row by row
    cells (c, 3) : the cells
    n_y, n_z : numbers of cells along y and z
    block : cells along a side of a block; 0 for no bounds
    begin : cell from which blocks count
    is_member (c,) : cells that may be united
    normals, means (c, 3) : of the cells, means in edges
    min_cos, max_offset : see `goes_on`
    parents (c,) : filled with the root of each cell
    """
    n = keys.shape[0]
    begins = np.zeros(5, np.int64)
    for c in range(n):
        # The rows ahead, and what comes next in the cell's own: each pair is met once.
        for row in range(5):
            step = row - 1 if row < 3 else row - 3
            low = keys[c] + ((1 if row < 3 else 0) * n_y + step) * n_z - 1
            high = low + 2
            if row == 3:
                low = keys[c] + 1
            j = begins[row]
            while j < n and keys[j] < low:
                j += 1
            begins[row] = j
            if not is_member[c]:
                continue
            while j < n and keys[j] <= high:
                if is_member[j] and goes_on(
                    c, j, cells, block, begin, normals, means, min_cos, max_offset
                ):
                    unite(parents, c, j)
                j += 1
    for c in range(n):
        parents[c] = find_root(parents, c)


@njit(cache=True, nogil=True)
def goes_on(i, j, cells, block, begin, normals, means, min_cos, max_offset):
    """Return whether two neighbouring cells are of one block and one smooth surface.

    Parameters
    ----------
    i, j : indices of the cells
    cells (c, 3) : the cells
    block, begin : see `unite_flat`
    normals, means (c, 3) : of the cells, means in edges
    min_cos : least cosine between normals
    max_offset : largest distance of a mean from the other's plane, edges
    """
    cos = off_i = off_j = 0.0
    for k in range(3):
        if block > 0 and (cells[i, k] - begin) // block != (cells[j, k] - begin) // block:
            return False
        cos += normals[i, k] * normals[j, k]
        chord = means[j, k] - means[i, k]
        off_i += chord * normals[i, k]
        off_j += chord * normals[j, k]
    return abs(cos) >= min_cos and abs(off_i) <= max_offset and abs(off_j) <= max_offset


@njit(cache=True, nogil=True)
def mark_planes(means, is_flat, roots, max_ratio, is_plane):
    """Mark the cells of patches, flat cells of one root, that are plane.

    A patch is if its root mean square distance from its plane is small against the mean square
    of its shorter extent, and it has at least `MIN_CELLS` cells.

    Parameters
    ----------
    means (c, 3) : of the cells, in edges
    is_flat (c,) : cells that count
    roots (c,) : patch of each cell
    max_ratio : of that distance and that mean square, 1/edges
    is_plane (c,) : set for those cells, other marks are left
    """
    n = roots.shape[0]
    sums = np.zeros((n, N_SUMS))
    for c in range(n):
        if not is_flat[c]:
            continue
        r = roots[c]
        x, y, z = means[c, 0] - means[r, 0], means[c, 1] - means[r, 1], means[c, 2] - means[r, 2]
        sums[r, 0] += 1.0
        sums[r, 1] += x
        sums[r, 2] += y
        sums[r, 3] += z
        sums[r, 4] += x * x
        sums[r, 5] += x * y
        sums[r, 6] += x * z
        sums[r, 7] += y * y
        sums[r, 8] += y * z
        sums[r, 9] += z * z
    verdict = np.zeros(n, np.bool_)
    for r in range(n):
        count = sums[r, 0]
        if count < MIN_CELLS:
            continue
        mx, my, mz = sums[r, 1] / count, sums[r, 2] / count, sums[r, 3] / count
        off, across, _ = eigenvalues(
            sums[r, 4] / count - mx * mx,
            sums[r, 5] / count - mx * my,
            sums[r, 6] / count - mx * mz,
            sums[r, 7] / count - my * my,
            sums[r, 8] / count - my * mz,
            sums[r, 9] / count - mz * mz,
        )
        verdict[r] = across >= MIN_ACROSS and math.sqrt(max(off, 0.0)) <= max_ratio * across
    for c in range(n):
        is_plane[c] |= is_flat[c] and verdict[roots[c]]


@njit(cache=True, nogil=True)
def mark_inner(keys, n_y, n_z, is_plane, counts, is_inner):
    """Mark the cells of planes around which all cells that hold points are of planes too.

    Parameters
    ----------
    keys (c,) : numbers of the cells, ascending, row by row
    n_y, n_z : numbers of cells along y and z
    is_plane (c,) : cells of planes
    counts (c,) : points of each cell
    is_inner (c,) : filled
    """
    n = keys.shape[0]
    begins = np.zeros(9, np.int64)
    for c in range(n):
        is_inner[c] = is_plane[c]
        for row in range(9):
            low = keys[c] + ((row // 3 - 1) * n_y + row % 3 - 1) * n_z - 1
            j = begins[row]
            while j < n and keys[j] < low:
                j += 1
            begins[row] = j
            while j < n and keys[j] <= low + 2:
                if counts[j] > 0 and not is_plane[j]:
                    is_inner[c] = False
                j += 1
