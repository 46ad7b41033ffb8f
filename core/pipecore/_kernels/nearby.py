"""Points around an axis or a place, from cells of two sizes.

A grid is the lower corner and the edge of its coarse cells, their numbers along y and z, a hash
table from the numbers of coarse cells to their ids, and the fine cells within each coarse one:
those from `cell_starts[id]` to `cell_starts[id + 1]`, with their middles and half a diagonal.
A fine cell's points are `members` from `starts[cell]` to `starts[cell + 1]`.
"""

import math

import numpy as np
from numba import njit

from pipecore._kernels.axes import across_axis, polar
from pipecore._kernels.grouping import argsort_keys
from pipecore._kernels.surfaces import MOST_PARAMETERS, at_point
from pipecore._kernels.voxels import EMPTY, slot_of


@njit(cache=True, nogil=True)
def place_on_axis(axis, chainage):
    """The point of an axis at a chainage."""
    bend = axis[12]
    if bend == 0.0:
        return (
            axis[0] + chainage * axis[3],
            axis[1] + chainage * axis[4],
            axis[2] + chainage * axis[5],
        )
    cos, sin = bend * math.cos(chainage / bend), bend * math.sin(chainage / bend)
    return (
        axis[0] + cos * axis[6] + sin * axis[9],
        axis[1] + cos * axis[7] + sin * axis[10],
        axis[2] + cos * axis[8] + sin * axis[11],
    )


@njit(cache=True, nogil=True)
def appended(items, n, item):
    """A list with room: `items` with `item` at n, in an array twice as long where it is full."""
    if n == items.shape[0]:
        longer = np.empty(2 * n, items.dtype)
        longer[:n] = items
        items = longer
    items[n] = item
    return items


@njit(cache=True, nogil=True)
def distance_from_axis(axis, x, y, z):
    """Distance of a point from a line or a full circle."""
    px, py, pz = x - axis[0], y - axis[1], z - axis[2]
    along = px * axis[3] + py * axis[4] + pz * axis[5]
    across = math.sqrt(max(px * px + py * py + pz * pz - along * along, 0.0))
    if axis[12] == 0.0:
        return across
    beyond = across - axis[12]
    return math.sqrt(beyond * beyond + along * along)


@njit(cache=True, nogil=True)
def cells_around(
    low, edge, n_y, n_z, table_keys, table_ids, cell_starts, middles, half_cell,
    axis, inner, outer, begin, end,
):  # fmt: skip
    """Fine cells that may hold points between two distances from an axis.

    The axis is walked from the chainage `begin` to `end` in steps; each coarse cell is taken
    at the step that is nearest to it.
    """
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
def cells_in_shell(
    low, edge, n_y, n_z, table_keys, table_ids, cell_starts, middles, half_cell,
    place, inner, outer,
):  # fmt: skip
    """Fine cells that may hold points between two distances from a place."""
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


@njit(cache=True, nogil=True)
def points_around(xyz, members, starts, cells, axis, inner, outer, margin):
    """Points of some cells between two distances from an axis and not beyond its ends."""
    n_most = 0
    for c in cells:
        n_most += starts[c + 1] - starts[c]
    found = np.empty(n_most, np.int64)
    n = 0
    for c in cells:
        for m in range(starts[c], starts[c + 1]):
            i = members[m]
            chainage, up, right = across_axis(axis, xyz[i, 0], xyz[i, 1], xyz[i, 2])
            rho2 = up * up + right * right
            if (
                inner * inner < rho2 < outer * outer
                and -margin < chainage < axis[16] + margin
            ):  # fmt: skip
                found[n] = i
                n += 1
    found = found[:n]
    return found[argsort_keys(found)]


@njit(cache=True, nogil=True)
def points_in_ball(xyz, members, starts, cells, place, radius):
    """Points of some cells within `radius` of a place, in order."""
    found = np.empty(256, np.int64)
    n = 0
    for c in cells:
        for m in range(starts[c], starts[c + 1]):
            i = members[m]
            x, y, z = xyz[i, 0] - place[0], xyz[i, 1] - place[1], xyz[i, 2] - place[2]
            if x * x + y * y + z * z <= radius * radius:
                found = appended(found, n, i)
                n += 1
    found = found[:n]
    return found[argsort_keys(found)]


@njit(cache=True, nogil=True)
def points_on_sphere(
    xyz, normals, is_free, members, starts, cells, centre, inner, outer, min_cos, stride
):
    """Free points of some cells between two distances from a place whose normals point to it.

    Of the cells' points only every `stride`-th is looked at.
    """
    found = np.empty(256, np.int64)
    n = 0
    for c in cells:
        for m in range(starts[c] + (-starts[c]) % stride, starts[c + 1], stride):
            i = members[m]
            if not is_free[i]:
                continue
            x, y, z = xyz[i, 0] - centre[0], xyz[i, 1] - centre[1], xyz[i, 2] - centre[2]
            rho = math.sqrt(x * x + y * y + z * z)
            if not inner < rho < outer:
                continue
            cosine = (normals[i, 0] * x + normals[i, 1] * y + normals[i, 2] * z) / rho
            if abs(cosine) > min_cos:
                found = appended(found, n, i)
                n += 1
    found = found[:n]
    return found[argsort_keys(found)]


@njit(cache=True, nogil=True)
def points_on(
    xyz, normals, is_free, members, starts, cells, axis, inner, outer, margin,
    kind, surface, band, min_cos, stride,
):  # fmt: skip
    """Free points of some cells that lie on a surface about an axis.

    That are points within `band` of it, between two distances from the axis, with normals
    like its own (cosine above `min_cos`); of the cells' points only every `stride`-th is
    looked at. Returns, in the order of their indices, the indices
    and (4, n): distance, chainage, clock, and the angle from the surface's normal to the
    point's own towards increasing clock.
    """
    found, table = np.empty(256, np.int64), np.empty((256, 4))
    row = np.empty(MOST_PARAMETERS)
    n = 0
    for c in cells:
        for m in range(starts[c] + (-starts[c]) % stride, starts[c + 1], stride):
            i = members[m]
            if not is_free[i]:
                continue
            x, y, z = xyz[i, 0], xyz[i, 1], xyz[i, 2]
            residual, ox, oy, oz = at_point(kind, surface, x, y, z, row)
            if not abs(residual) < band:
                continue
            cosine = normals[i, 0] * ox + normals[i, 1] * oy + normals[i, 2] * oz
            if not abs(cosine) > min_cos:
                continue
            chainage, up, right = across_axis(axis, x, y, z)
            rho, clock = polar(up, right)
            if not (inner < rho < outer and -margin < chainage < axis[16] + margin):
                continue
            tx, ty, tz = tangent(axis, chainage)
            ahead = (
                normals[i, 0] * (ty * oz - tz * oy)
                + normals[i, 1] * (tz * ox - tx * oz)
                + normals[i, 2] * (tx * oy - ty * ox)
            )
            if n == table.shape[0]:
                longer = np.empty((2 * n, 4))
                longer[:n] = table
                table = longer
            found = appended(found, n, i)
            table[n, 0], table[n, 1], table[n, 2] = residual, chainage, clock
            table[n, 3] = math.atan(ahead / cosine)
            n += 1
    order = argsort_keys(found[:n])
    columns = np.empty((4, n))
    for k in range(n):
        for column in range(4):
            columns[column, k] = table[order[k], column]
    return found[:n][order], columns


@njit(cache=True, nogil=True)
def stride_of(starts, cells, few):
    """Every how many-th point of some cells to look at, so that there are not more than few."""
    n = 0
    for c in cells:
        n += starts[c + 1] - starts[c]
    return max(1, -(-n // few)) if few > 0 else 1


@njit(cache=True, nogil=True)
def usual_spacing(spacing, chosen, least):
    """Median distance of chosen points to their neighbours where it is known; not below `least`."""
    known = np.empty(chosen.shape[0])
    n = 0
    for i in chosen:
        if not math.isnan(spacing[i]):
            known[n] = spacing[i]
            n += 1
    return max(least, np.median(known[:n])) if n > 0 else least


@njit(cache=True, nogil=True)
def look_on(
    grid, xyz, normals, spacing, voxel, is_free, members, starts, axis, shell, inner, outer,
    margin, kind, surface, band, min_cos, few,
):  # fmt: skip
    """Find the points on a surface about an axis; see `cells_around` and `points_on`.

    Where cells hold more than `few` points a sample is looked at, if `few` is not 0. Returns
    what `points_on` does and the distance between neighbours among the points looked at.
    """
    cells = cells_around(
        grid[0], grid[1], grid[2], grid[3], grid[4], grid[5], grid[6], grid[7], grid[8],
        axis, shell[0], shell[1], -margin, axis[16] + margin,
    )  # fmt: skip
    stride = stride_of(starts, cells, few)
    own, columns = points_on(
        xyz, normals, is_free, members, starts, cells, axis, inner, outer, margin,
        kind, surface, band, min_cos, stride,
    )  # fmt: skip
    return own, columns, usual_spacing(spacing, own, voxel) * math.sqrt(stride)


@njit(cache=True, nogil=True)
def points_inside(
    xyz, normals, members, starts, cells, axis, inner, outer, begin, end,
    kind, surface, depth, min_cos,
):  # fmt: skip
    """Chainage and clock (2, m) of points deeper than `depth` inside a surface, as `points_on`.

    Only between the chainages `begin` and `end`.
    """
    table = np.empty((256, 2))
    row = np.empty(MOST_PARAMETERS)
    n = 0
    for c in cells:
        for m in range(starts[c], starts[c + 1]):
            i = members[m]
            x, y, z = xyz[i, 0], xyz[i, 1], xyz[i, 2]
            residual, ox, oy, oz = at_point(kind, surface, x, y, z, row)
            if not residual < -depth:
                continue
            cosine = normals[i, 0] * ox + normals[i, 1] * oy + normals[i, 2] * oz
            if not abs(cosine) > min_cos:
                continue
            chainage, up, right = across_axis(axis, x, y, z)
            rho, clock = polar(up, right)
            if inner < rho < outer and begin < chainage < end:
                if n == table.shape[0]:
                    longer = np.empty((2 * n, 2))
                    longer[:n] = table
                    table = longer
                table[n, 0], table[n, 1] = chainage, clock
                n += 1
    return table[:n].T.copy()


@njit(cache=True, nogil=True)
def tangent(axis, chainage):
    """Unit tangent of an axis towards increasing chainage."""
    bend = axis[12]
    if bend == 0.0:
        return axis[3], axis[4], axis[5]
    cos, sin = math.cos(chainage / bend), math.sin(chainage / bend)
    # The normal of the arc times outward.
    return (
        cos * axis[9] - sin * axis[6],
        cos * axis[10] - sin * axis[7],
        cos * axis[11] - sin * axis[8],
    )


@njit(cache=True, nogil=True)
def behind(members, starts, chosen, xyz, index, places):
    """Write the points behind chosen thinned points, each one's in the order of their places."""
    n = 0
    for c in chosen:
        first = n
        for m in range(starts[c], starts[c + 1]):
            i = members[m]
            x, y, z = np.float64(xyz[i, 0]), np.float64(xyz[i, 1]), np.float64(xyz[i, 2])
            k = n
            while k > first and (
                places[k - 1, 0] > x
                or (places[k - 1, 0] == x and places[k - 1, 1] > y)
                or (places[k - 1, 0] == x and places[k - 1, 1] == y and places[k - 1, 2] > z)
            ):
                index[k] = index[k - 1]
                for a in range(3):
                    places[k, a] = places[k - 1, a]
                k -= 1
            index[k] = i
            places[k, 0], places[k, 1], places[k, 2] = x, y, z
            n += 1
