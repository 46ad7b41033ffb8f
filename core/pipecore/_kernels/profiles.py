"""Cutting profiles and joining their points to curves."""

import math

import numpy as np
from numba import njit

from pipecore._kernels.grouping import argsort_keys

NOT_CUT = np.int32(-(2**31))
"""Profile of points that do not join a stack."""
MOST_PROFILES = 2.0**31
"""Points that are this many profiles from the local zero do not join either."""


@njit(cache=True, nogil=True)
def height_of(xyz, i, direction, offset):
    """Distance of a point along the stack's direction."""
    return xyz[i, 0] * direction[0] + xyz[i, 1] * direction[1] + xyz[i, 2] * direction[2] - offset


@njit(cache=True, nogil=True)
def carry_point(xyz, normals, i, nd, direction, e1, e2, width, offset):
    """Carry a point along its tangent plane to the mid-plane of its profile.

    p - h·(d - (d·n)n) / (1 - (d·n)²), h being the point's offset from the mid-plane
    along the stack direction d. Returns the profile's index, the position in the plane
    (e1, e2), and the normal's components along e1 and e2.
    """
    along = height_of(xyz, i, direction, offset)
    index = np.int64(math.floor(along / width))
    h = along - (index + 0.5) * width
    across = 1.0 - nd * nd
    u = v = mu = mv = 0.0
    for k in range(3):
        moved = xyz[i, k] - h * (direction[k] - nd * normals[i, k]) / across
        u += moved * e1[k]
        v += moved * e2[k]
        mu += normals[i, k] * e1[k]
        mv += normals[i, k] * e2[k]
    return index, u, v, mu, mv


@njit(cache=True, nogil=True)
def slope_to(normals, i, direction):
    """Cosine between a normal and the stack's direction; nan where there is no normal."""
    return (
        normals[i, 0] * direction[0] + normals[i, 1] * direction[1] + normals[i, 2] * direction[2]
    )


@njit(cache=True, nogil=True)
def find_profiles(
    xyz, normals, spacing, start, stop, direction, width, offset, max_slope, min_spacing, profile
):
    """Write the profile of each of the points start … stop; return the lowest and the highest.

    `NOT_CUT` is written for points whose surface the stack cuts too obliquely
    (|n·d| ≥ `max_slope`), or that are closer to their neighbours than `min_spacing`.
    """
    low, high = np.int64(2**31), np.int64(-(2**31))
    for i in range(start, stop):
        nd = slope_to(normals, i, direction)
        # Also where the normal or the spacing is nan.
        if not (abs(nd) < max_slope and spacing[i] >= min_spacing):
            profile[i] = NOT_CUT
            continue
        place = math.floor(height_of(xyz, i, direction, offset) / width)
        if not abs(place) < MOST_PROFILES:
            profile[i] = NOT_CUT
            continue
        index = np.int64(place)
        profile[i] = index
        low, high = min(low, index), max(high, index)
    return low, high


@njit(cache=True, nogil=True)
def carry_to_mid_planes(
    xyz, normals, points, direction, e1, e2, width, offset, profile, uv, normals_uvd
):
    """Carry each of the `points` to the mid-plane of its profile.

    Writes the profile's index, the position in the plane (e1, e2), and the normal in (e1,
    e2, direction).
    """
    for row in range(points.shape[0]):
        i = points[row]
        nd = slope_to(normals, i, direction)
        index, u, v, mu, mv = carry_point(xyz, normals, i, nd, direction, e1, e2, width, offset)
        profile[row] = index
        uv[row, 0], uv[row, 1] = u, v
        normals_uvd[row, 0], normals_uvd[row, 1], normals_uvd[row, 2] = mu, mv, nd


@njit(cache=True, nogil=True)
def sort_by_cell(profile, uv, cell, margin):
    """Order points by profile and by cell within it, row by row; also their keys and n_v.

    Points come profile by profile. Cells count from the local zero: a part of the cloud is
    sorted as the whole is. Between rows there are `margin` empty cells.
    """
    n = profile.shape[0]
    low_u = low_v = np.int64(2**62)
    high_u = high_v = np.int64(-(2**62))
    cells = np.empty((n, 2), np.int64)
    for i in range(n):
        u, v = np.int64(math.floor(uv[i, 0] / cell)), np.int64(math.floor(uv[i, 1] / cell))
        cells[i, 0], cells[i, 1] = u, v
        low_u, high_u = min(low_u, u), max(high_u, u)
        low_v, high_v = min(low_v, v), max(high_v, v)
    n_u, n_v = high_u - low_u + margin, high_v - low_v + margin
    keys = np.empty(n, np.int64)
    for i in range(n):
        row = (np.int64(profile[i]) - profile[0]) * n_u + cells[i, 0] - low_u
        keys[i] = row * n_v + cells[i, 1] - low_v
    order = argsort_keys(keys)
    return order, keys[order], n_v


@njit(cache=True, nogil=True)
def find_root(parents, i):
    """Root of `i`, halving paths on the way."""
    while parents[i] != i:
        parents[i] = parents[parents[i]]
        i = parents[i]
    return i


@njit(cache=True, nogil=True)
def unite(parents, i, j):
    """Unite the sets of `i` and `j`; the smaller root stays."""
    a, b = find_root(parents, i), find_root(parents, j)
    if a < b:
        parents[b] = a
    elif b < a:
        parents[a] = b


@njit(cache=True, nogil=True)
def are_joined(du, dv, nu1, nv1, nu2, nv2, reach, cos_corner, offset, slope):
    """Whether two neighbours lie on one smooth curve.

    They are within `reach`, their normals differ by less than the corner angle, and
    their chord is perpendicular to the bisector of the normals, as it is on every
    circle, but for `offset` + `slope` · chord. With `cos_corner` < 0 nearness is enough.
    """
    c2 = du * du + dv * dv
    if c2 > reach * reach:
        return False
    if cos_corner < 0.0:
        return True
    scale = math.sqrt((nu1 * nu1 + nv1 * nv1) / (nu2 * nu2 + nv2 * nv2))
    if nu1 * nu2 + nv1 * nv2 < 0.0:
        scale = -scale
    nu2, nv2 = scale * nu2, scale * nv2
    if nu1 * nu2 + nv1 * nv2 < cos_corner * (nu1 * nu1 + nv1 * nv1):
        return False
    bu, bv = nu1 + nu2, nv1 + nv2
    off = abs(du * bu + dv * bv) / math.sqrt(bu * bu + bv * bv)
    return off <= offset + slope * math.sqrt(c2)


@njit(cache=True, nogil=True)
def join_neighbours(
    keys, n_v, cell, uv, normals_uvd, reach, cos_corner, offset, slope, start, stop, parents
):
    """Unite neighbouring points start … stop that lie on one curve.

    Points are sorted by `keys`, which number the cells of all profiles row by row;
    start and stop lie between profiles. `reach` holds each point's largest gap, at least
    `cell`; a pair joins within the larger of its two.
    """
    most_rows = 1
    for i in range(start, stop):
        most_rows = max(most_rows, math.ceil(reach[i] / cell))
    # Where each row's neighbours begin moves on with the point, and back a little at times.
    begins = np.full(2 * most_rows + 1, start, np.int64)
    for i in range(start, stop):
        rows = math.ceil(reach[i] / cell)
        # Within a cell each pair is met from the point that comes first; a point that
        # reaches further looks both ways, since the other may not reach as far.
        is_far = rows > 1
        for row in range(-rows if is_far else 0, rows + 1):
            low = keys[i] + row * n_v - rows
            high = keys[i] + row * n_v + rows
            if row == 0 and not is_far:
                j = i + 1
            else:
                j = begins[most_rows + row]
                while j < stop and keys[j] < low:
                    j += 1
                while j > start and keys[j - 1] >= low:
                    j -= 1
                begins[most_rows + row] = j
            while j < stop and keys[j] <= high:
                if (
                    (j > i or (is_far and j < i))
                    and parents[i] != parents[j]
                    and are_joined(
                        uv[j, 0] - uv[i, 0],
                        uv[j, 1] - uv[i, 1],
                        normals_uvd[i, 0],
                        normals_uvd[i, 1],
                        normals_uvd[j, 0],
                        normals_uvd[j, 1],
                        reach[i],
                        cos_corner,
                        offset,
                        slope,
                    )
                ):
                    unite(parents, i, j)
                j += 1
    for i in range(start, stop):
        parents[i] = find_root(parents, i)


@njit(cache=True, nogil=True)
def gather(points, uv, normals_uvd, profile, members, starts):
    """Points, positions and normals of the members, and the profile of each group."""
    n = members.shape[0]
    of = np.empty(n, np.int32)
    places, vectors = np.empty((n, 2)), np.empty((n, 3))
    for row in range(n):
        i = members[row]
        of[row] = points[i]
        places[row, 0], places[row, 1] = uv[i, 0], uv[i, 1]
        for k in range(3):
            vectors[row, k] = normals_uvd[i, k]
    index = np.empty(starts.shape[0] - 1, np.int32)
    for g in range(index.shape[0]):
        index[g] = profile[members[starts[g]]]
    return of, places, vectors, index
