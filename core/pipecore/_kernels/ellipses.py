"""Curves of a profile as oblique cuts through a cylinder: splitting and constrained fits.

Points are given in the frame of their stack: (u, v) in the profile's plane, normals as
(u, v, d) with d along the stack's direction. The plane cuts a cylinder of axis a in an
ellipse with semi-minor axis r and semi-major axis r / |a·d|. Seen along a it is a circle;
that circle, or an oval where it does not do, is what is fitted.
"""

import math

import numpy as np
from numba import njit

from pipecore._kernels.circles import covered_arc, taubin_circle
from pipecore._kernels.draws import draw_fast, seeded
from pipecore._kernels.eigen import eigenvalues, eigenvector
from pipecore._kernels.oval_sections import N_SHAPE, fit_section, lies_on_section, radius_towards

MIN_PAIR_COS = 0.94
"""Normals of two points whose cosine is larger tell no axis."""
COS_HALF_PAIR = 0.985
"""Normals that are all closer than this to one direction are so close to each other too."""
ON_ONE_SECTION = 0.95
"""A curve with more of its points on one section needs no splitting."""
MAX_FAILURES = 2
"""A curve is left alone after this many draws in which no piece of it was found."""


@njit(cache=True, nogil=True)
def common_axis(normals, chosen):
    """Direction most perpendicular to the chosen normals; eigenvalue shares of Σnnᵀ, ascending."""
    n = 0
    xx = xy = xz = yy = yz = zz = 0.0
    for i in range(normals.shape[0]):
        if chosen[i]:
            a, b, c = normals[i, 0], normals[i, 1], normals[i, 2]
            n += 1
            xx += a * a
            xy += a * b
            xz += a * c
            yy += b * b
            yz += b * c
            zz += c * c
    if n < 3:
        return math.nan, math.nan, math.nan, math.nan, math.nan
    least, middle, _ = eigenvalues(xx, xy, xz, yy, yz, zz)
    u, v, d = eigenvector(xx, xy, xz, yy, yz, zz, least)
    if d < 0.0:
        u, v, d = -u, -v, -d
    return u, v, d, least / n, middle / n


@njit(cache=True, nogil=True)
def along(u, v, nu, nv, nd, tu, tv, ad, sin):
    """A point and its normal as seen along an axis tilted by `sin` towards (tu, tv).

    x runs across the tilt, y along it, foreshortened by `ad`.
    """
    x, y = tu * v - tv * u, (tu * u + tv * v) * ad
    return x, y, tu * nv - tv * nu, (tu * nu + tv * nv) * ad - nd * sin


@njit(cache=True, nogil=True)
def look_along(uv, normals, au, av, ad, x, y, mx, my):
    """Write points and normals as seen along the axis (au, av, ad); see `along`.

    Returns (tu, tv), the direction of the tilt in the profile's plane.
    """
    sin = math.sqrt(au * au + av * av)
    tu, tv = (au / sin, av / sin) if sin > 1e-9 else (1.0, 0.0)
    for i in range(uv.shape[0]):
        x[i], y[i], mx[i], my[i] = along(
            uv[i, 0], uv[i, 1], normals[i, 0], normals[i, 1], normals[i, 2], tu, tv, ad, sin
        )
    return tu, tv


@njit(cache=True, nogil=True)
def fits_circle(x, y, mx, my, cx, cy, r, max_distance, cos_radial):
    """Whether a point lies on a circle and its normal points to the centre."""
    dx, dy = x - cx, y - cy
    d = math.sqrt(dx * dx + dy * dy)
    return abs(d - r) <= max_distance and abs(dx * mx + dy * my) >= cos_radial * d


@njit(cache=True, nogil=True)
def pick_pair(nus, nvs, nds, state):
    """Two points whose normals differ clearly: state, indices, or -1 if luck fails.

    The points of a curve are listed row by row, so neighbours in the list lie near each
    other. The second point is drawn from a stretch around the first, of a length drawn
    from halvings of the curve: where it holds many pipes, far points seldom share one.
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
    """How far the normals of the points on a circle turn, in points.

    Points count as far as their normals turn: a floor would lie on any large circle. Seen
    along an axis as `look_along` does, tilted by `sin` towards (tu, tv); added up in lanes
    side by side, in single precision, without roots or divisions.
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
def best_circle(
    uv, normals, free, tolerance, cos_radial, min_cos_tilt, max_radius, n_trials, seed, inliers
):
    """Find the cylinder cut with most inliers among the `free` points.

    Two points with their normals give an axis (the normals' cross product) and, seen
    along it, a centre (where the normals meet). Writes the inliers, returns their number.
    """
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
    for _ in range(n_trials):
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
        look_along(uv, normals, au, av, ad, x, y, mx, my)
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
    """Share of a curve's points on the section that fits them all best, seen along their axis."""
    n = uv.shape[0]
    chosen = np.ones(n, np.bool_)
    au, av, ad, _, _ = common_axis(normals, chosen)
    if not ad >= min_cos_tilt:
        return 0.0
    x, y, mx, my = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    look_along(uv, normals, au, av, ad, x, y, mx, my)
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
    """Whether the free points' normals are so alike that no two of them tell an axis."""
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
def split_curves(
    uv,
    normals,
    curve_starts,
    start,
    stop,
    min_points,
    tolerance,
    max_gap,
    cos_radial,
    min_cos_tilt,
    max_radius,
    n_trials,
    max_pieces,
    piece,
):
    """Split curves start … stop that are not one cut through a cylinder.

    Writes the piece of each point within its curve: 0 for points of no piece, and for
    all points of a curve that needs no splitting; 1, 2, … for the pieces.
    """
    for c in range(start, stop):
        a, b = curve_starts[c], curve_starts[c + 1]
        n = b - a
        if n < min_points:
            continue
        share = share_on_one_section(uv[a:b], normals[a:b], tolerance, max_gap, min_cos_tilt)
        if share > ON_ONE_SECTION:
            continue
        free = np.ones(n, np.bool_)
        inliers = np.empty(n, np.bool_)
        n_free = n
        number = n_failed = 0
        while number < max_pieces and n_failed < MAX_FAILURES and n_free >= min_points:
            if is_flat(normals[a:b], free):
                break
            count = best_circle(
                uv[a:b],
                normals[a:b],
                free,
                tolerance,
                cos_radial,
                min_cos_tilt,
                max_radius,
                n_trials,
                # The same curve is split the same way wherever it stands in the list.
                n + number + n_failed,
                inliers,
            )
            if count < min_points:
                n_failed += 1
                continue
            number += 1
            for k in range(n):
                if inliers[k]:
                    piece[a + k] = number
                    free[k] = False
            n_free -= count


N_FIT_COLUMNS = 14
"""Columns of a fit: centre u, v; axis u, v, d; radius; rms; arc; points;
share of radial normals; where the normals meet u, v, d, and the points' distance from there."""


@njit(cache=True, nogil=True)
def fit_curves(
    uv, normals, curve_starts, start, stop, tolerance, max_gap, min_cos_tilt, max_off_axis, fits
):
    """Fit a cylinder cut to each of the curves start … stop; write `N_FIT_COLUMNS` values.

    They are nan where the curve is none: also where the axis is tilted too much (cosine below
    `min_cos_tilt`), or hardly defined (λ1 above `max_off_axis` λ2).
    Where the normals meet is the centre of the section on a cylinder, and the centre of
    the sphere on a sphere, wherever it was cut.
    """
    for c in range(start, stop):
        a, b = curve_starts[c], curve_starts[c + 1]
        n = b - a
        fits[c, :] = math.nan
        if n < 5:
            continue
        points, vectors = uv[a:b], normals[a:b]
        chosen = np.ones(n, np.bool_)
        x, y, mx, my = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
        weights, shape = np.empty(n), np.empty(N_SHAPE)
        au, av, ad, l1, l2 = common_axis(vectors, chosen)
        # Also where they are nan.
        if not (ad >= min_cos_tilt and l1 <= max_off_axis * l2):
            continue
        tu, tv = look_along(points, vectors, au, av, ad, x, y, mx, my)
        cx, cy = fit_section(x, y, tolerance, max_gap, 8, weights, shape)
        if not math.isfinite(cx):
            continue
        r = shape[0]
        total = ss = 0.0
        xx = xy = xz = yy = yz = zz = bx = by = bz = 0.0
        n_in = n_radial = 0
        angles = np.empty(n)
        for k in range(n):
            dx, dy = x[k] - cx, y[k] - cy
            d = math.sqrt(dx * dx + dy * dy)
            if weights[k] < 0.1 or d == 0.0:
                continue
            angles[n_in] = math.atan2(dy, dx)
            n_in += 1
            total += weights[k]
            ss += weights[k] * (d - radius_towards(shape, dx / d, dy / d)) ** 2
            radial = (dx * mx[k] + dy * my[k]) / d
            n_radial += abs(radial) > 0.9
            # Normal equations of the point nearest to all normals' lines.
            nu, nv, nd = vectors[k, 0], vectors[k, 1], vectors[k, 2]
            pn = points[k, 0] * nu + points[k, 1] * nv
            xx += 1.0 - nu * nu
            xy -= nu * nv
            xz -= nu * nd
            yy += 1.0 - nv * nv
            yz -= nv * nd
            zz += 1.0 - nd * nd
            bx += points[k, 0] - pn * nu
            by += points[k, 1] - pn * nv
            bz -= pn * nd
        if n_in < 5:
            continue
        sorted_angles = np.sort(angles[:n_in])
        arc = covered_arc(sorted_angles, max(max_gap / r, 0.35))
        # Back from the view along the axis to the profile's plane.
        along_tilt = cy / ad
        fits[c, 0] = -tv * cx + tu * along_tilt
        fits[c, 1] = tu * cx + tv * along_tilt
        fits[c, 2], fits[c, 3], fits[c, 4] = au, av, ad
        fits[c, 5] = r
        fits[c, 6] = math.sqrt(ss / total)
        fits[c, 7] = arc
        fits[c, 8] = n_in
        fits[c, 9] = n_radial / n
        det = xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz)
        if det > 0.0:
            mu = (
                bx * (yy * zz - yz * yz) - xy * (by * zz - yz * bz) + xz * (by * yz - yy * bz)
            ) / det
            mv = (
                xx * (by * zz - yz * bz) - bx * (xy * zz - yz * xz) + xz * (xy * bz - by * xz)
            ) / det
            md = (
                xx * (yy * bz - by * yz) - xy * (xy * bz - by * xz) + bx * (xy * yz - yy * xz)
            ) / det
            distance = 0.0
            for k in range(n):
                if weights[k] >= 0.1:
                    distance += math.sqrt(
                        (points[k, 0] - mu) ** 2 + (points[k, 1] - mv) ** 2 + md * md
                    )
            fits[c, 10], fits[c, 11], fits[c, 12] = mu, mv, md
            fits[c, 13] = distance / n_in
