"""Splitting of curves that hold more than one cut through a cylinder, by random pairs.

Points and normals are in the frame of their stack, see `oblique_cuts`.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from pipecore._kernels.circles import taubin_circle
from pipecore._kernels.oblique_cuts import along, common_axis, fits_circle, project_along_axis
from pipecore._kernels.oval_sections import N_SHAPE, fit_section, lies_on_section
from pipecore._kernels.random_draws import draw_fast, seeded

MIN_PAIR_COS = 0.94
"""Normals of two points whose cosine is larger define no axis."""
COS_HALF_PAIR = 0.985
"""Normals that are all closer than this to one direction are so close to each other too."""
ON_ONE_SECTION = 0.95
"""A curve with more of its points on one section needs no splitting."""
MAX_FAILURES = 2
"""A curve is left alone after this many draws in which no piece of it was found."""


class SplitLimits(NamedTuple):
    """How curves are split into pieces of one curvature.

    min_points: least number of points of a curve and of a piece;
    tolerance: distance within which points count as on their curve, metres;
    max_gap: gap between neighbouring points that counts as covered, metres;
    cos_radial: least cosine between a normal and the direction to the centre;
    min_cos_tilt: least cosine between a piece's axis and the stack's direction;
    max_radius: largest radius, metres;
    n_trials: random pairs tried for each piece;
    max_pieces: most pieces of one curve.
    """

    min_points: int
    tolerance: float
    max_gap: float
    cos_radial: float
    min_cos_tilt: float
    max_radius: float
    n_trials: int
    max_pieces: int


@njit(cache=True, nogil=True)
def pick_pair(nus, nvs, nds, state):
    """Draw two points whose normals differ clearly.

    The points of a curve are listed row by row, so neighbours in the list lie near each other.
    The second is drawn from a stretch around the first, of a length drawn from halvings of the
    curve: where it holds many pipes, far points seldom share one.

    Parameters
    ----------
    nus, nvs, nds (n,) : normals
    state : of the generator, see `random_draws`

    Returns
    -------
    Next state, and two indices, -1 where twelve draws found none.
    """
    n = nus.shape[0]
    n_halvings = 1
    while n >> n_halvings > 3:
        n_halvings += 1
    for _ in range(12):
        state, halvings = draw_fast(state, n_halvings)
        state, i = draw_fast(state, n)
        low, high = max(0, i - (n >> halvings)), min(n, i + (n >> halvings) + 1)
        state, ahead = draw_fast(state, high - low)
        j = low + ahead
        if abs(nus[i] * nus[j] + nvs[i] * nvs[j] + nds[i] * nds[j]) < MIN_PAIR_COS:
            return state, i, j
    return state, -1, -1


@njit(cache=True, nogil=True, fastmath={"reassoc", "contract"})
def turn_on_circle(us, vs, nus, nvs, nds, tu, tv, ad, sin, cx, cy, r, slack, cos_radial):
    """Return how many points lie on a circle, less those whose normals do not turn.

    Points count as far as their normals turn: a floor would lie on any large circle. Summed in
    lanes side by side, in single precision, without roots or divisions.

    Parameters
    ----------
    us, vs (n,) : points in the profile's plane, metres, single precision
    nus, nvs, nds (n,) : their normals
    tu, tv : direction of the axis's tilt in the plane
    ad, sin : cosine and sine of the tilt
    cx, cy, r : circle as seen along the axis, metres
    slack : largest distance from the circle, metres
    cos_radial : least cosine between a normal and the direction to the centre
    """
    one, zero = np.float32(1.0), np.float32(0.0)
    xu, xv, yu, yv = np.float32(-tv), np.float32(tu), np.float32(tu * ad), np.float32(tv * ad)
    x0, y0, lean = np.float32(cx), np.float32(cy), np.float32(sin)
    least, most = np.float32(max(r - slack, 0.0) ** 2), np.float32((r + slack) ** 2)
    radial = np.float32(cos_radial**2)
    count = cos2 = sin2 = zero
    for k in range(us.shape[0]):
        dx = xu * us[k] + xv * vs[k] - x0
        dy = yu * us[k] + yv * vs[k] - y0
        mx = xu * nus[k] + xv * nvs[k]
        my = yu * nus[k] + yv * nvs[k] - nds[k] * lean
        d2 = dx * dx + dy * dy
        facing = dx * mx + dy * my
        is_on = (d2 >= least) & (d2 <= most) & (facing * facing >= radial * d2)
        w = one if is_on else zero
        count += w
        cos2 += w * (dx * dx - dy * dy)
        sin2 += w * (dx * dy)
    return count - math.sqrt(cos2 * cos2 + np.float32(4.0) * sin2 * sin2) / (r * r)


@njit(cache=True, nogil=True)
def best_circle(uv, normals, free, limits, seed, inliers):
    """Find the cylinder cut with most inliers among the free points.

    Two points with their normals define an axis, the normals' cross product, and seen along it
    a centre, where the normals meet.

    Parameters
    ----------
    uv (n, 2) : points in the profile's plane, metres
    normals (n, 3) : unit normals in (u, v, d)
    free (n,) : points that may be used
    limits : SplitLimits
    seed : of the random draws
    inliers (n,) : filled

    Returns
    -------
    Number of inliers, 0 where there is no cut.
    """
    tolerance, cos_radial, max_radius = limits.tolerance, limits.cos_radial, limits.max_radius
    min_cos_tilt = limits.min_cos_tilt
    n = uv.shape[0]
    # The free points side by side, for the many trials; near zero, for single precision.
    table, n_free = np.empty((5, n), np.float32), 0
    u0, v0 = uv[0, 0], uv[0, 1]
    for k in range(n):
        if free[k]:
            table[0, n_free], table[1, n_free] = uv[k, 0] - u0, uv[k, 1] - v0
            table[2, n_free], table[3, n_free] = normals[k, 0], normals[k, 1]
            table[4, n_free] = normals[k, 2]
            n_free += 1
    if n_free == 0:
        return 0
    us, vs, nus, nvs, nds = (
        table[0, :n_free], table[1, :n_free], table[2, :n_free], table[3, :n_free],
        table[4, :n_free],
    )  # fmt: skip
    best_turn = 0.0
    best_au = best_av = best_ad = best_cx = best_cy = best_r = 0.0
    state = seeded(seed)
    for _ in range(limits.n_trials):
        state, i, j = pick_pair(nus, nvs, nds, state)
        if i < 0:
            continue
        au = nvs[i] * nds[j] - nds[i] * nvs[j]
        av = nds[i] * nus[j] - nus[i] * nds[j]
        ad = nus[i] * nvs[j] - nvs[i] * nus[j]
        length = math.sqrt(au * au + av * av + ad * ad)
        if ad < 0.0:
            length = -length
        au, av, ad = au / length, av / length, ad / length
        if ad < min_cos_tilt:
            continue
        tilt = math.sqrt(au * au + av * av)
        tu, tv = (au / tilt, av / tilt) if tilt > 1e-9 else (1.0, 0.0)
        xi, yi, mxi, myi = along(us[i], vs[i], nus[i], nvs[i], nds[i], tu, tv, ad, tilt)
        xj, yj, mxj, myj = along(us[j], vs[j], nus[j], nvs[j], nds[j], tu, tv, ad, tilt)
        sin = mxi * myj - myi * mxj
        if abs(sin) < 0.2:
            continue
        t = ((xj - xi) * myj - (yj - yi) * mxj) / sin
        cx, cy = xi + t * mxi, yi + t * myi
        r1, r2 = abs(t), math.sqrt((xj - cx) ** 2 + (yj - cy) ** 2)
        r = 0.5 * (r1 + r2)
        if abs(r1 - r2) > 0.25 * r or r > max_radius or r < tolerance:
            continue
        slack = tolerance + min(0.05 * r, 2.0 * tolerance)
        turn = turn_on_circle(us, vs, nus, nvs, nds, tu, tv, ad, tilt, cx, cy, r, slack, cos_radial)
        if turn > best_turn:
            best_turn, best_r = turn, r
            best_cx, best_cy = cx + tu * v0 - tv * u0, cy + (tu * u0 + tv * v0) * ad
            best_au, best_av, best_ad = au, av, ad
    if best_turn == 0.0:
        return 0
    au, av, ad, cx, cy, r = best_au, best_av, best_ad, best_cx, best_cy, best_r
    x, y, mx, my = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    weights = np.empty(n)
    for pass_ in range(3):
        project_along_axis(uv, normals, au, av, ad, x, y, mx, my)
        if pass_ > 0:
            cx, cy, r = taubin_circle(x, y, weights)
            if not r > 0.0 or r > max_radius:
                return 0
        reach = tolerance + (min(0.05 * r, 2.0 * tolerance) if pass_ == 0 else 0.0)
        best = 0
        for k in range(n):
            inliers[k] = free[k] and fits_circle(
                x[k], y[k], mx[k], my[k], cx, cy, r, reach, cos_radial
            )
            weights[k] = 1.0 if inliers[k] else 0.0
            best += inliers[k]
        if best < 5:
            return 0
        if pass_ < 2:
            au, av, ad, _, _ = common_axis(normals, inliers)
            if not ad >= min_cos_tilt:
                return 0
    return best


@njit(cache=True, nogil=True)
def share_on_one_section(uv, normals, tolerance, max_gap, min_cos_tilt):
    """Return the fraction of a curve's points on the section that fits them best.

    Parameters
    ----------
    uv (n, 2) : points in the profile's plane, metres
    normals (n, 3) : unit normals in (u, v, d)
    tolerance : distance within which points count as on their curve, metres
    max_gap : gap between neighbouring points that counts as covered, metres
    min_cos_tilt : least cosine between the axis and the stack's direction; 0 below
    """
    n = uv.shape[0]
    chosen = np.ones(n, np.bool_)
    au, av, ad, _, _ = common_axis(normals, chosen)
    if not ad >= min_cos_tilt:
        return 0.0
    x, y, mx, my = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    project_along_axis(uv, normals, au, av, ad, x, y, mx, my)
    weights, shape = np.empty(n), np.empty(N_SHAPE)
    cx, cy = fit_section(x, y, tolerance, max_gap, 5, weights, shape)
    if not math.isfinite(cx):
        return 0.0
    count = 0
    for k in range(n):
        count += lies_on_section(x[k], y[k], mx[k], my[k], cx, cy, shape, 1.5 * tolerance, 0.8)
    return count / n


@njit(cache=True, nogil=True)
def is_flat(normals, free):
    """Return whether the normals of the free points are too alike to define an axis.

    Parameters
    ----------
    normals (n, 3) : unit normals of either sign
    free (n,) : points that count
    """
    n = normals.shape[0]
    x = y = z = 0.0
    for k in range(n):
        if free[k]:
            a, b, c = normals[k, 0], normals[k, 1], normals[k, 2]
            sign = 1.0 if a * x + b * y + c * z >= 0.0 else -1.0
            x, y, z = x + sign * a, y + sign * b, z + sign * c
    least = COS_HALF_PAIR * math.sqrt(x * x + y * y + z * z)
    for k in range(n):
        if free[k] and not abs(normals[k, 0] * x + normals[k, 1] * y + normals[k, 2] * z) > least:
            return False
    return True


@njit(cache=True, nogil=True)
def split_curves(uv, normals, curve_starts, start, stop, limits, piece):
    """Split those of some curves that are not one cut through a cylinder.

    Parameters
    ----------
    uv (n, 2) : points in the profile's plane, metres, curve by curve
    normals (n, 3) : unit normals in (u, v, d)
    curve_starts (m + 1,) : where each curve begins
    start, stop : range of curves
    limits : SplitLimits
    piece (n,) : filled with the piece of each point within its curve from 1 on; 0 for points
      of no piece, and left as it is for curves that are not split
    """
    for c in range(start, stop):
        a, b = curve_starts[c], curve_starts[c + 1]
        n = b - a
        if n < limits.min_points:
            continue
        share = share_on_one_section(
            uv[a:b], normals[a:b], limits.tolerance, limits.max_gap, limits.min_cos_tilt
        )
        if share > ON_ONE_SECTION:
            continue
        free = np.ones(n, np.bool_)
        inliers = np.empty(n, np.bool_)
        n_free = n
        number = n_failed = 0
        while (
            number < limits.max_pieces and n_failed < MAX_FAILURES and n_free >= limits.min_points
        ):
            if is_flat(normals[a:b], free):
                break
            # The same curve is split the same way wherever it stands in the list.
            seed = n + number + n_failed
            count = best_circle(uv[a:b], normals[a:b], free, limits, seed, inliers)
            if count < limits.min_points:
                n_failed += 1
                continue
            number += 1
            for k in range(n):
                if inliers[k]:
                    piece[a + k] = number
                    free[k] = False
            n_free -= count
