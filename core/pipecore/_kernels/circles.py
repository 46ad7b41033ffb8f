"""Circles through points of a plane: Taubin's fit, and a robust geometric one."""

import math

from numba import njit


@njit(cache=True, nogil=True)
def taubin_circle(x, y, weights):
    """Return the circle through points by Taubin's method: centre x, y and radius.

    Newton iteration of Chernov & Lesort (2005); nan if the points define no circle.

    Parameters
    ----------
    x, y (n,) : any unit of length
    weights (n,) : not negative
    """
    n = x.shape[0]
    total = mx = my = 0.0
    for i in range(n):
        total += weights[i]
        mx += weights[i] * x[i]
        my += weights[i] * y[i]
    if total <= 0.0:
        return math.nan, math.nan, math.nan
    mx /= total
    my /= total
    xx = xy = yy = xz = yz = zz = 0.0
    for i in range(n):
        a, b, w = x[i] - mx, y[i] - my, weights[i]
        z = a * a + b * b
        xx += w * a * a
        xy += w * a * b
        yy += w * b * b
        xz += w * a * z
        yz += w * b * z
        zz += w * z * z
    xx /= total
    xy /= total
    yy /= total
    xz /= total
    yz /= total
    zz /= total
    z = xx + yy
    if z <= 0.0:
        return math.nan, math.nan, math.nan
    cov = xx * yy - xy * xy
    var_z = zz - z * z
    a3 = 4.0 * z
    a2 = -3.0 * z * z - zz
    a1 = var_z * z + 4.0 * cov * z - xz * xz - yz * yz
    a0 = xz * (xz * yy - yz * xy) + yz * (yz * xx - xz * xy) - var_z * cov
    t, value = 0.0, a0
    for _ in range(40):
        slope = a1 + t * (2.0 * a2 + 3.0 * a3 * t)
        if slope == 0.0:
            break
        t_new = t - value / slope
        if not math.isfinite(t_new) or t_new == t:
            break
        value_new = a0 + t_new * (a1 + t_new * (a2 + t_new * a3))
        if abs(value_new) >= abs(value):
            break
        t, value = t_new, value_new
    det = t * t - t * z + cov
    if abs(det) < 1e-14 * z * z:
        return math.nan, math.nan, math.nan
    cx = (xz * (yy - t) - yz * xy) / det / 2.0
    cy = (yz * (xx - t) - xz * xy) / det / 2.0
    return cx + mx, cy + my, math.sqrt(cx * cx + cy * cy + z)


@njit(cache=True, nogil=True)
def tukey_weight(residual, reach):
    """Return the weight of Tukey's biweight, (1 - (r/c)²)² and 0 from r = c on.

    Parameters
    ----------
    residual : r
    reach : c, in the unit of the residual
    """
    q = residual / reach
    return (1.0 - q * q) ** 2 if abs(q) < 1.0 else 0.0


@njit(cache=True, nogil=True)
def geometric_circle(x, y, cx, cy, r, reach, weights, n_iterations):
    """Refine a circle by iteratively reweighted geometric least squares; return centre and radius.

    Residuals are signed distances; nan where the normal equations are singular.

    Parameters
    ----------
    x, y (n,) : any unit of length
    cx, cy, r : circle to start from
    reach : distance from which points have no weight; inf for equal weights
    weights (n,) : filled with the last weights
    n_iterations : most iterations
    """
    n = x.shape[0]
    for _ in range(n_iterations):
        h00 = h01 = h02 = h11 = h12 = h22 = g0 = g1 = g2 = 0.0
        for i in range(n):
            dx, dy = x[i] - cx, y[i] - cy
            d = math.sqrt(dx * dx + dy * dy)
            if d == 0.0:
                weights[i] = 0.0
                continue
            res = d - r
            w = tukey_weight(res, reach)
            weights[i] = w
            j0, j1 = -dx / d, -dy / d
            h00 += w * j0 * j0
            h01 += w * j0 * j1
            h02 -= w * j0
            h11 += w * j1 * j1
            h12 -= w * j1
            h22 += w
            g0 += w * j0 * res
            g1 += w * j1 * res
            g2 -= w * res
        det = (
            h00 * (h11 * h22 - h12 * h12)
            - h01 * (h01 * h22 - h12 * h02)
            + h02 * (h01 * h12 - h11 * h02)
        )
        if not det > 1e-12 * h22 * h22 * h22:
            return math.nan, math.nan, math.nan
        # Cramer's rule for H·step = -g
        s0 = (
            -(
                g0 * (h11 * h22 - h12 * h12)
                - h01 * (g1 * h22 - h12 * g2)
                + h02 * (g1 * h12 - h11 * g2)
            )
            / det
        )
        s1 = (
            -(
                h00 * (g1 * h22 - h12 * g2)
                - g0 * (h01 * h22 - h12 * h02)
                + h02 * (h01 * g2 - g1 * h02)
            )
            / det
        )
        s2 = (
            -(
                h00 * (h11 * g2 - g1 * h12)
                - h01 * (h01 * g2 - g1 * h02)
                + g0 * (h01 * h12 - h11 * h02)
            )
            / det
        )
        cx += s0
        cy += s1
        r += s2
        if not r > 0.0:
            return math.nan, math.nan, math.nan
        if s0 * s0 + s1 * s1 + s2 * s2 < 1e-12 * r * r:
            break
    return cx, cy, r


@njit(cache=True, nogil=True)
def covered_arc(angles, max_gap):
    """Return the arc that angles cover, radians.

    Parameters
    ----------
    angles (n,) : ascending, radians
    max_gap : gaps up to this count as covered, radians
    """
    n = angles.shape[0]
    uncovered = 0.0
    for i in range(n):
        gap = angles[i] - angles[i - 1] if i > 0 else angles[0] + 2.0 * math.pi - angles[n - 1]
        if gap > max_gap:
            uncovered += gap
    return 2.0 * math.pi - uncovered
