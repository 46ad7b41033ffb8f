"""Local surface properties of points from their neighbours, found in a hashed grid of cells."""

import math

import numpy as np
from numba import njit

from pipecore._kernels.eigen import eigenvalues, eigenvector
from pipecore._kernels.voxels import EMPTY, slot_of

LANES = 16
FAR_OFF = 1e30


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
    begins = np.empty(9, np.int64)
    for row in range(9):
        step = (row // 3 - 1) * n_y + row % 3 - 1
        begins[row] = np.searchsorted(cell_keys, cell_keys[start] + step * n_z - 1)
    near = np.empty((3, 512))
    for c in range(start, stop):
        reach, n_near = 0, 0
        for i in range(cell_starts[c], cell_starts[c + 1]):
            px, py, pz = xyz[i, 0], xyz[i, 1], xyz[i, 2]
            at = places[i]
            normals[at, 0] = normals[at, 1] = normals[at, 2] = math.nan
            residuals[at] = spacings[at] = math.nan
            for quarters in (4, 5, 6, 7, 8, 10, 12, 16):
                if reach != (quarters + 3) // 4:
                    # Looked up once for all points of the cell, and copied side by side.
                    reach = (quarters + 3) // 4
                    n_ranges = list_ranges(
                        c, reach, cell_keys, cell_starts, n_y, n_z, begins, first, last
                    )
                    n_near = 0
                    for k in range(n_ranges):
                        n_near += last[k] - first[k]
                    if n_near + LANES > near.shape[1]:
                        near = np.empty((3, 2 * n_near + LANES))
                    n_near = 0
                    for k in range(n_ranges):
                        for j in range(first[k], last[k]):
                            near[0, n_near] = xyz[j, 0]
                            near[1, n_near] = xyz[j, 1]
                            near[2, n_near] = xyz[j, 2]
                            n_near += 1
                    # Whole lanes; what fills them is out of reach.
                    while n_near % LANES > 0:
                        near[0, n_near] = near[1, n_near] = near[2, n_near] = FAR_OFF
                        n_near += 1
                r2 = (0.25 * quarters * radius) ** 2
                n, sx, sy, sz, sxx, sxy, sxz, syy, syz, szz = sums_within(
                    near[0, :n_near], near[1, :n_near], near[2, :n_near], px, py, pz, r2
                )
                if n >= min_neighbours:
                    mx, my, mz = sx / n, sy / n, sz / n
                    xx, xy, xz = sxx / n - mx * mx, sxy / n - mx * my, sxz / n - mx * mz
                    yy, yz, zz = syy / n - my * my, syz / n - my * mz, szz / n - mz * mz
                    least, _, _ = eigenvalues(xx, xy, xz, yy, yz, zz)
                    x, y, z = eigenvector(xx, xy, xz, yy, yz, zz, least)
                    normals[at, 0], normals[at, 1], normals[at, 2] = x, y, z
                    residuals[at] = math.sqrt(max(least, 0.0) * n / (n - 3.0))
                    spacings[at] = 0.25 * quarters * radius * math.sqrt(math.pi / n)
                    break


@njit(cache=True, nogil=True, fastmath={"reassoc", "contract"})
def sums_within(xs, ys, zs, px, py, pz, r2):
    """Count, sums and sums of products of the points within reach of one, relative to it.

    Added up in lanes side by side: several times as fast as one after the other.
    """
    n = sx = sy = sz = sxx = sxy = sxz = syy = syz = szz = 0.0
    for j in range(xs.shape[0]):
        x, y, z = xs[j] - px, ys[j] - py, zs[j] - pz
        w = 1.0 if x * x + y * y + z * z <= r2 else 0.0
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
    return n, sx, sy, sz, sxx, sxy, sxz, syy, syz, szz


@njit(cache=True, nogil=True)
def list_ranges(c, reach, cell_keys, cell_starts, n_y, n_z, begins, first, last):
    """List the ranges of points of the cells within `reach` of cell `c`; return their number.

    Cells are numbered row by row, so that those of a row lie side by side. Where the rows
    of the next cells begin is kept in `begins` from call to call, which are made for rising
    cells; wider reaches are rare and searched for.
    """
    n = 0
    for dx in range(-reach, reach + 1):
        for dy in range(-reach, reach + 1):
            low = cell_keys[c] + (dx * n_y + dy) * n_z - reach
            if reach == 1:
                row = 3 * dx + dy + 4
                begin = begins[row]
                while begin < cell_keys.shape[0] and cell_keys[begin] < low:
                    begin += 1
                begins[row] = begin
            else:
                begin = np.searchsorted(cell_keys, low)
            end = begin
            while end < cell_keys.shape[0] and cell_keys[end] <= low + 2 * reach:
                end += 1
            if end > begin:
                first[n], last[n] = cell_starts[begin], cell_starts[end]
                n += 1
    return n


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
