"""Cutting profiles and joining their points to curves."""

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pipecore._kernels.disjoint_sets import find_root, unite
from pipecore._kernels.grouping import argsort_keys

NOT_CUT = np.int32(-(2**31))
"""Profile of points that do not join a stack."""
MOST_PROFILES = 2.0**31
"""Points that are this many profiles from the local zero do not join either."""


class StackCut(NamedTuple):
    """How a stack cuts.

    direction, e1, e2 (3,): unit vectors along the stack and in its profiles' planes;
    width: of a profile, metres;
    offset: of profile 0 from the local zero along the direction, metres.
    """

    direction: NDArray[np.float64]
    e1: NDArray[np.float64]
    e2: NDArray[np.float64]
    width: float
    offset: float


class Smoothness(NamedTuple):
    """When two neighbouring points lie on one smooth curve.

    cos_corner: least cosine between their normals; below 0 nearness is enough;
    offset, slope: a chord leaves the perpendicular to the bisector of the normals by at most
    offset + slope · chord, metres.
    """

    cos_corner: float
    offset: float
    slope: float


@njit(cache=True, nogil=True)
def height_of(xyz, i, direction, offset):
    """Return the distance of a point along a stack's direction, metres.

    Parameters
    ----------
    xyz (n, 3) : points, metres
    i : index of the point
    direction (3,) : unit vector
    offset : zero of the distance, metres
    """
    return xyz[i, 0] * direction[0] + xyz[i, 1] * direction[1] + xyz[i, 2] * direction[2] - offset


@njit(cache=True, nogil=True)
def carry_point(xyz, normals, i, nd, cut):
    """Carry a point along its tangent plane to the mid-plane of its profile.

    p - h·(d - (d·n)n) / (1 - (d·n)²), h being the point's offset from the mid-plane.

    Parameters
    ----------
    xyz, normals (n, 3) : points, metres, and unit normals
    i : index of the point
    nd : n·d
    cut : StackCut

    Returns
    -------
    Index of the profile, position (u, v) in its plane, and the normal's components there.
    """
    direction, e1, e2, width = cut.direction, cut.e1, cut.e2, cut.width
    along = height_of(xyz, i, direction, cut.offset)
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
    """Return the cosine between a normal and a stack's direction; nan where there is no normal.

    Parameters
    ----------
    normals (n, 3) : unit normals
    i : index of the point
    direction (3,) : unit vector
    """
    return (
        normals[i, 0] * direction[0] + normals[i, 1] * direction[1] + normals[i, 2] * direction[2]
    )


@njit(cache=True, nogil=True)
def find_profiles(xyz, normals, spacing, start, stop, cut, max_slope, min_spacing, profile):
    """Write the profile of each of some points; return the lowest and the highest.

    Parameters
    ----------
    xyz, normals (n, 3) : points, metres, and unit normals, nan where not known
    spacing (n,) : distance to neighbours, metres
    start, stop : range of points
    cut : StackCut
    max_slope : |n·d| from which a surface is cut too obliquely
    min_spacing : of points that join, metres
    profile (n,) : filled; `NOT_CUT` for points that do not join
    """
    low, high = np.int64(2**31), np.int64(-(2**31))
    for i in range(start, stop):
        nd = slope_to(normals, i, cut.direction)
        # Also where the normal or the spacing is nan.
        if not (abs(nd) < max_slope and spacing[i] >= min_spacing):
            profile[i] = NOT_CUT
            continue
        place = math.floor(height_of(xyz, i, cut.direction, cut.offset) / cut.width)
        if not abs(place) < MOST_PROFILES:
            profile[i] = NOT_CUT
            continue
        index = np.int64(place)
        profile[i] = index
        low, high = min(low, index), max(high, index)
    return low, high


@njit(cache=True, nogil=True)
def carry_to_mid_planes(xyz, normals, points, cut, profile, uv, normals_uvd):
    """Carry points to the mid-planes of their profiles.

    Parameters
    ----------
    xyz, normals (n, 3) : points, metres, and unit normals
    points (m,) : indices of those that join the stack
    cut : StackCut
    profile (m,) : filled with the profile of each
    uv (m, 2) : filled with the position in its plane, metres
    normals_uvd (m, 3) : filled with the normal in (e1, e2, direction)
    """
    for row in range(points.shape[0]):
        i = points[row]
        nd = slope_to(normals, i, cut.direction)
        index, u, v, mu, mv = carry_point(xyz, normals, i, nd, cut)
        profile[row] = index
        uv[row, 0], uv[row, 1] = u, v
        normals_uvd[row, 0], normals_uvd[row, 1], normals_uvd[row, 2] = mu, mv, nd


@njit(cache=True, nogil=True)
def sort_by_cell(profile, uv, cell, margin):
    """Return the order of points by profile and by cell within it, their keys, and n_v.

    Cells count from the local zero: a part of the cloud is sorted as the whole is.

    Parameters
    ----------
    profile (n,) : of each point, ascending
    uv (n, 2) : positions in the plane, metres
    cell : edge of a cell, metres
    margin : empty cells between rows

    Returns
    -------
    Order, keys in that order, and the number of cells to a row.
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
def are_joined(du, dv, nu1, nv1, nu2, nv2, reach, smoothness):
    """Return whether two neighbours lie on one smooth curve.

    Their normals differ by less than the corner angle, and their chord is perpendicular to the
    bisector of the normals, as it is on every circle, within a tolerance.

    Parameters
    ----------
    du, dv : chord, metres
    nu1, nv1, nu2, nv2 : normals in the plane, of any length and sign
    reach : longest chord, metres
    smoothness : Smoothness
    """
    c2 = du * du + dv * dv
    if c2 > reach * reach:
        return False
    cos_corner = smoothness.cos_corner
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
    return off <= smoothness.offset + smoothness.slope * math.sqrt(c2)


@njit(cache=True, nogil=True)
def join_neighbours(keys, n_v, cell, uv, normals_uvd, reach, smoothness, start, stop, parents):
    """Unite neighbouring points that lie on one curve.

    Parameters
    ----------
    keys (n,) : number of each point's cell, ascending
    n_v : number of cells to a row
    cell : edge of a cell, metres
    uv (n, 2), normals_uvd (n, 3) : positions, metres, and normals
    reach (n,) : largest gap of each point, at least `cell`; a pair joins within the larger
    smoothness : Smoothness
    start, stop : range of points, which lies between profiles
    parents (n,) : disjoint sets; filled with roots
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
                        smoothness,
                    )
                ):
                    unite(parents, i, j)
                j += 1
    for i in range(start, stop):
        parents[i] = find_root(parents, i)


@njit(cache=True, nogil=True)
def gather(points, uv, normals_uvd, profile, members, starts):
    """Return points, positions and normals of members, and the profile of each group.

    Parameters
    ----------
    points (n,), uv (n, 2), normals_uvd (n, 3), profile (n,) : of all points
    members (m,), starts (g + 1,) : the members group by group, and where each begins
    """
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
