"""Local surface properties of points from their neighbours, found in a hashed grid of cells."""

import math

import numpy as np
from numba import njit

from pipecore._kernels.eigen import eigenvalues, eigenvector, least_eigenpair
from pipecore._kernels.voxels import EMPTY, slot_of

LANES = 16
FAR_OFF = np.float32(1e18)
BATCH = 256
"""Points whose planes are solved for together."""
N_SUMS = 10
_ROWS = np.array([0, 0, 9, 34, 83, 164])
"""Where the rows of cells of each reach begin among those of all reaches."""


@njit(cache=True, nogil=True)
def fit_planes(
    xyz,
    cell_keys,
    cell_starts,
    n_y,
    n_z,
    radius,
    min_neighbours,
    start,
    stop,
    places,
    normals,
    residuals,
    spacings,
):
    """Fit a plane to the neighbours of the points of cells start … stop within `radius`.

    Where there are fewer than `min_neighbours`, the radius grows in steps up to fourfold.
    `xyz` is sorted by cell, whose edge is `radius`. Writes, at each point's `places`, the
    normal, the root mean square distance from the plane, and the spacing of the points;
    nan where there are too few.
    """
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
        n_ranges = list_ranges(c, reach, cell_keys, cell_starts, n_y, n_z, begins, first, last)
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
                        n_ranges = list_ranges(
                            c, reach, cell_keys, cell_starts, n_y, n_z, begins, first, last
                        )
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
    """Copy the points of some ranges, relative to the point `zero`; return their number.

    Filled up to whole lanes by what is out of reach.
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

    All in single precision, a ten millionth of the reach, and added up in lanes side by side:
    many times as fast as one after the other.
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
    """Write what `sums_within` does, of the points of some ranges within `reach` of a point."""
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
    """Write the normal, residual and spacing of the neighbourhoods with the given sums."""
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
    """Write what was found of each point to its place."""
    for i in range(n_points):
        at = points[i]
        normals[at, 0], normals[at, 1], normals[at, 2] = planes[0, i], planes[1, i], planes[2, i]
        residuals[at], spacings[at] = planes[3, i], planes[4, i]


@njit(cache=True, nogil=True)
def list_ranges(c, reach, cell_keys, cell_starts, n_y, n_z, begins, first, last):
    """List the ranges of points of the cells within `reach` of cell `c`; return their number.

    Cells are numbered row by row, so that those of a row lie side by side. Where the rows
    around begin is kept in `begins` from call to call, which are made for rising cells.
    """
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
    """Position of the first of ascending keys, from `begin` on, that is not below `low`.

    Found in growing steps: it is mostly near.
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


@njit(cache=True, nogil=True)
def fit_local_axes(
    xyz,
    normals,
    order,
    cell_keys,
    cell_starts,
    table_keys,
    table_ids,
    n_y,
    n_z,
    radius,
    sample,
    own_cells,
    start,
    stop,
    axes,
    spreads,
):
    """Find the direction that is most perpendicular to the normals around sampled points.

    `order` lists the points cell by cell; `own_cells` are those of the samples.
    Writes, for sample start … stop, the eigenvector of Σ n nᵀ with the smallest
    eigenvalue, and the eigenvalues in ascending order divided by their sum.
    """
    mask = np.int64(table_keys.shape[0] - 1)
    for k in range(start, stop):
        i = sample[k]
        px, py, pz = xyz[i, 0], xyz[i, 1], xyz[i, 2]
        cell = own_cells[k]
        n = 0
        xx = xy = xz = yy = yz = zz = 0.0
        for dx in range(-1, 2):
            for dy in range(-1, 2):
                for dz in range(-1, 2):
                    key = cell_keys[cell] + (dx * n_y + dy) * n_z + dz
                    slot = slot_of(key, table_keys, mask)
                    if table_keys[slot] == EMPTY:
                        continue
                    c = table_ids[slot]
                    for row in range(cell_starts[c], cell_starts[c + 1]):
                        j = order[row]
                        x, y, z = xyz[j, 0] - px, xyz[j, 1] - py, xyz[j, 2] - pz
                        if x * x + y * y + z * z <= radius * radius:
                            a, b, d = normals[j, 0], normals[j, 1], normals[j, 2]
                            if math.isnan(a):
                                continue
                            n += 1
                            xx += a * a
                            xy += a * b
                            xz += a * d
                            yy += b * b
                            yz += b * d
                            zz += d * d
        axes[k, 0] = axes[k, 1] = axes[k, 2] = math.nan
        spreads[k, 0] = spreads[k, 1] = spreads[k, 2] = math.nan
        if n >= 6:
            least, middle, largest = eigenvalues(xx, xy, xz, yy, yz, zz)
            x, y, z = eigenvector(xx, xy, xz, yy, yz, zz, least)
            axes[k, 0], axes[k, 1], axes[k, 2] = x, y, z
            spreads[k, 0], spreads[k, 1], spreads[k, 2] = least / n, middle / n, largest / n
