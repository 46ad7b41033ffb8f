"""Cutting profiles and joining their points to curves."""

import math

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def carry_to_mid_planes(
    xyz, normals, usable, direction, e1, e2, width, offset, max_slope, profile, uv, normals_uvd
):
    """Carry each point along its tangent plane to the mid-plane of its profile.

    p - h·(d - (d·n)n) / (1 - (d·n)²), h being the point's offset from the mid-plane
    along the stack direction d. Points whose surface the stack cuts too obliquely
    (|n·d| ≥ `max_slope`) do not join: their `usable` becomes false. Writes the profile's
    index, the position in the plane (e1, e2), and the normal in (e1, e2, direction).
    """
    for i in range(xyz.shape[0]):
        nd = (
            normals[i, 0] * direction[0]
            + normals[i, 1] * direction[1]
            + normals[i, 2] * direction[2]
        )
        if not abs(nd) < max_slope:  # also where the normal is nan
            usable[i] = False
            continue
        usable[i] = True
        along = (
            xyz[i, 0] * direction[0] + xyz[i, 1] * direction[1] + xyz[i, 2] * direction[2] - offset
        )
        index = math.floor(along / width)
        h = along - (index + 0.5) * width
        across = 1.0 - nd * nd
        u = v = mu = mv = 0.0
        for k in range(3):
            moved = xyz[i, k] - h * (direction[k] - nd * normals[i, k]) / across
            u += moved * e1[k]
            v += moved * e2[k]
            mu += normals[i, k] * e1[k]
            mv += normals[i, k] * e2[k]
        profile[i] = index
        uv[i, 0], uv[i, 1] = u, v
        normals_uvd[i, 0], normals_uvd[i, 1], normals_uvd[i, 2] = mu, mv, nd


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
    for i in range(start, stop):
        rows = math.ceil(reach[i] / cell)
        # Within a cell each pair is met from the point that comes first; a point that
        # reaches further looks both ways, since the other may not reach as far.
        is_far = rows > 1
        for row in range(-rows if is_far else 0, rows + 1):
            low = keys[i] + row * n_v - rows
            high = keys[i] + row * n_v + rows
            j = i + 1 if row == 0 and not is_far else start + np.searchsorted(keys[start:stop], low)
            while j < stop and keys[j] <= high:
                if (j > i or (is_far and j < i)) and are_joined(
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
                ):
                    unite(parents, i, j)
                j += 1
    for i in range(start, stop):
        parents[i] = find_root(parents, i)
