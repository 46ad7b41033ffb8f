"""Local surface properties of points from their neighbours, found in a hashed grid of cells."""

import math

import numpy as np
from numba import njit

from pipecore._kernels.eigen import eigenvalues, eigenvector
from pipecore._kernels.voxels import EMPTY, slot_of


@njit(cache=True, nogil=True)
def fit_planes(
    xyz,
    cell_keys,
    cell_starts,
    table_keys,
    table_ids,
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
    mask = np.int64(table_keys.shape[0] - 1)
    first, last = np.empty(729, np.int64), np.empty(729, np.int64)
    for c in range(start, stop):
        n_ranges = list_ranges(
            cell_keys[c], 1, cell_starts, table_keys, table_ids, mask, n_y, n_z, first, last
        )
        reach = 1
        for i in range(cell_starts[c], cell_starts[c + 1]):
            px, py, pz = xyz[i, 0], xyz[i, 1], xyz[i, 2]
            at = places[i]
            normals[at, 0] = normals[at, 1] = normals[at, 2] = math.nan
            residuals[at] = spacings[at] = math.nan
            for quarters in (4, 5, 6, 7, 8, 10, 12, 16):
                if reach != (quarters + 3) // 4:
                    reach = (quarters + 3) // 4
                    n_ranges = list_ranges(
                        cell_keys[c], reach, cell_starts, table_keys, table_ids, mask, n_y, n_z,
                        first, last,
                    )  # fmt: skip
                r2 = (0.25 * quarters * radius) ** 2
                n = 0
                sx = sy = sz = sxx = sxy = sxz = syy = syz = szz = 0.0
                for k in range(n_ranges):
                    for j in range(first[k], last[k]):
                        x, y, z = xyz[j, 0] - px, xyz[j, 1] - py, xyz[j, 2] - pz
                        if x * x + y * y + z * z <= r2:
                            n += 1
                            sx += x
                            sy += y
                            sz += z
                            sxx += x * x
                            sxy += x * y
                            sxz += x * z
                            syy += y * y
                            syz += y * z
                            szz += z * z
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


@njit(cache=True, nogil=True)
def list_ranges(key, reach, cell_starts, table_keys, table_ids, mask, n_y, n_z, first, last):
    """List the ranges of points of the cells within `reach` of a cell; return their number.

    Ranges that follow each other are one.
    """
    n = 0
    for dx in range(-reach, reach + 1):
        for dy in range(-reach, reach + 1):
            for dz in range(-reach, reach + 1):
                near = key + (dx * n_y + dy) * n_z + dz
                slot = slot_of(near, table_keys, mask)
                if table_keys[slot] == EMPTY:
                    continue
                c = table_ids[slot]
                if n > 0 and last[n - 1] == cell_starts[c]:
                    last[n - 1] = cell_starts[c + 1]
                else:
                    first[n], last[n] = cell_starts[c], cell_starts[c + 1]
                    n += 1
    return n


@njit(cache=True, nogil=True)
def fit_local_axes(
    xyz,
    normals,
    cell_keys,
    cell_starts,
    table_keys,
    table_ids,
    n_y,
    n_z,
    radius,
    sample,
    start,
    stop,
    axes,
    spreads,
):
    """Find the direction that is most perpendicular to the normals around sampled points.

    Writes, for sample start … stop, the eigenvector of Σ n nᵀ with the smallest
    eigenvalue, and the eigenvalues in ascending order divided by their sum.
    """
    mask = np.int64(table_keys.shape[0] - 1)
    for k in range(start, stop):
        i = sample[k]
        px, py, pz = xyz[i, 0], xyz[i, 1], xyz[i, 2]
        cell = np.searchsorted(cell_starts, i, side="right") - 1
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
                    for j in range(cell_starts[c], cell_starts[c + 1]):
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
