"""Round places: cells of a grid around which the normal lines meet on one axis.

On a surface of revolution the line through each point along its normal meets the axis. So the
axis of a neighbourhood is the direction most perpendicular to its normals, and where it lies
comes from the normal lines by least squares. Sums over cells carry all of it, at any scale:
normals of either sign do.
"""

import math

import numpy as np
from numba import njit

from pipecore._kernels.eigen import eigenvalues, eigenvector
from pipecore._kernels.voxel_hash import EMPTY, slot_of

N_SUMS = 20
"""Sums of a cell: points; Σnnᵀ (xx, xy, xz, yy, yz, zz); Σn(n·p) (x, y, z); Σp (x, y, z);
Σppᵀ (xx, xy, xz, yy, yz, zz); Σ(n·p)²."""
MIN_POINTS = 12
"""Fewer points around a cell tell no axis."""


@njit(cache=True, nogil=True)
def add_to_cells(xyz, normals, zero, cell, sums):
    """Add points to the sums of their cells, in their order.

    Parameters
    ----------
    xyz, normals : (n, 3), metres; points whose normal is nan are passed over
    zero : place from which positions are counted (3,), metres
    cell : cell of each point (n,)
    sums : (cells, N_SUMS)
    """
    for i in range(xyz.shape[0]):
        a, b, c = normals[i, 0], normals[i, 1], normals[i, 2]
        if math.isnan(a):
            continue
        k = cell[i]
        x, y, z = xyz[i, 0] - zero[0], xyz[i, 1] - zero[1], xyz[i, 2] - zero[2]
        along = a * x + b * y + c * z
        sums[k, 0] += 1.0
        sums[k, 1] += a * a
        sums[k, 2] += a * b
        sums[k, 3] += a * c
        sums[k, 4] += b * b
        sums[k, 5] += b * c
        sums[k, 6] += c * c
        sums[k, 7] += a * along
        sums[k, 8] += b * along
        sums[k, 9] += c * along
        sums[k, 10] += x
        sums[k, 11] += y
        sums[k, 12] += z
        sums[k, 13] += x * x
        sums[k, 14] += x * y
        sums[k, 15] += x * z
        sums[k, 16] += y * y
        sums[k, 17] += y * z
        sums[k, 18] += z * z
        sums[k, 19] += along * along


@njit(cache=True, nogil=True)
def form(s, first, ax, ay, az, bx, by, bz):
    """The bilinear form aᵀMb of a symmetric matrix whose six sums begin at `first`."""
    xx, xy, xz = s[first], s[first + 1], s[first + 2]
    yy, yz, zz = s[first + 3], s[first + 4], s[first + 5]
    return (
        ax * (xx * bx + xy * by + xz * bz)
        + ay * (xy * bx + yy * by + yz * bz)
        + az * (xz * bx + yz * by + zz * bz)
    )


@njit(cache=True, nogil=True)
def axis_of_sums(s, min_curved, max_off_axis, result):
    """Write the axis of a neighbourhood, how far normal lines miss it, and the points' distance.

    Parameters
    ----------
    s : (N_SUMS,), of the neighbourhood
    min_curved : least share of the middle eigenvalue of Σnnᵀ; below, the surface is flat
    max_off_axis : largest share of the least eigenvalue in the middle one
    result : written (5,): axis x, y, z; root mean square distance of the normal lines from it,
        and of the points, metres; nan where there is no axis
    """
    result[:] = math.nan
    n = s[0]
    if n < MIN_POINTS:
        return
    least, middle, _ = eigenvalues(s[1], s[2], s[3], s[4], s[5], s[6])
    if not (middle > min_curved * n and least < max_off_axis * middle):
        return
    x, y, z = eigenvector(s[1], s[2], s[3], s[4], s[5], s[6], least)
    # Two directions u, v across the axis.
    ux, uy, uz = (0.0, z, -y) if abs(x) < 0.6 else (-z, 0.0, x)
    length = math.sqrt(ux * ux + uy * uy + uz * uz)
    if not length > 0.0:
        return
    ux, uy, uz = ux / length, uy / length, uz / length
    vx, vy, vz = y * uz - z * uy, z * ux - x * uz, x * uy - y * ux
    # Σ(I − nnᵀ) c = Σ(p − n(n·p)) for the place c of the axis, seen along it.
    nuu = form(s, 1, ux, uy, uz, ux, uy, uz)
    nuv = form(s, 1, ux, uy, uz, vx, vy, vz)
    nvv = form(s, 1, vx, vy, vz, vx, vy, vz)
    pu, pv = s[10] * ux + s[11] * uy + s[12] * uz, s[10] * vx + s[11] * vy + s[12] * vz
    bu = pu - (s[7] * ux + s[8] * uy + s[9] * uz)
    bv = pv - (s[7] * vx + s[8] * vy + s[9] * vz)
    huu, huv, hvv = n - nuu, -nuv, n - nvv
    det = huu * hvv - huv * huv
    if not det > 1e-6 * n * n:
        return
    cu, cv = (bu * hvv - bv * huv) / det, (huu * bv - huv * bu) / det
    across = form(s, 13, ux, uy, uz, ux, uy, uz) + form(s, 13, vx, vy, vz, vx, vy, vz)
    missed = across - s[19] - cu * bu - cv * bv
    distance = across - 2.0 * (cu * pu + cv * pv) + n * (cu * cu + cv * cv)
    result[0], result[1], result[2] = x, y, z
    result[3] = math.sqrt(max(missed, 0.0) / n)
    result[4] = math.sqrt(max(distance, 0.0) / n)


@njit(cache=True, nogil=True)
def axes_of_cells(keys, sums, table, n_y, n_z, start, stop, min_curved, max_off_axis, found):
    """Write the axis around each of the cells start … stop, from it and its 26 neighbours.

    Parameters
    ----------
    keys : number of each cell in its grid (cells,)
    sums : (cells, N_SUMS)
    table : HashTable from keys to cells
    n_y, n_z : cells of the grid along y and z
    start, stop : which cells
    min_curved, max_off_axis : see `axis_of_sums`
    found : written (cells, 5)
    """
    table_keys, table_ids = table.keys, table.ids
    mask = np.int64(table_keys.shape[0] - 1)
    around = np.empty(N_SUMS)
    for k in range(start, stop):
        around[:] = 0.0
        for dx in range(-1, 2):
            for dy in range(-1, 2):
                for dz in range(-1, 2):
                    key = keys[k] + (dx * n_y + dy) * n_z + dz
                    slot = slot_of(key, table_keys, mask)
                    if table_keys[slot] != EMPTY:
                        around += sums[table_ids[slot]]
        axis_of_sums(around, min_curved, max_off_axis, found[k])
