"""Sections of pipes: a circle, or where that does not do an oval and three-lobed curve.

A section is a curve about a centre, r(φ) = r₀ + a₂ cos 2φ + b₂ sin 2φ + a₃ cos 3φ + b₃ sin 3φ,
its shape the five numbers (r₀, a₂, b₂, a₃, b₃).
"""

import math

import numpy as np
from numba import njit

from pipecore._kernels.circles import covered_arc, geometric_circle, taubin_circle, tukey_weight
from pipecore._kernels.linear import solve_step

N_SHAPE = 5
MIN_OVAL_POINTS = 16
"""Fewer points carry no oval."""
MIN_OVAL_ARC = math.radians(150.0)
"""On shorter arcs an oval is a circle of another radius."""
MAX_OVAL, MAX_LOBES = 0.09, 0.045
"""Largest amplitudes of the second and third harmonic, in radii: 18 % of ovality."""
OVAL_PRIOR, LOBES_SHARE = 0.05, 0.5
"""Scatter of the second harmonic's amplitude over pipes, in radii; that of the third in it.
What the points cannot tell stays near zero by it."""
WIDE_REACH = 0.25
"""Points this share of the radius off are still looked at first."""
ON_CIRCLE = 0.95
"""Of so many points on one circle no oval is asked for."""


@njit(cache=True, nogil=True)
def radius_towards(shape, c, s):
    """Radius of a section in one direction.

    Parameters
    ----------
    shape : (r₀, a₂, b₂, a₃, b₃)
    c, s : cosine and sine of the direction from the centre
    """
    c2, s2 = c * c - s * s, 2.0 * c * s
    c3, s3 = c2 * c - s2 * s, s2 * c + c2 * s
    return shape[0] + shape[1] * c2 + shape[2] * s2 + shape[3] * c3 + shape[4] * s3


@njit(cache=True, nogil=True)
def refine_section(x, y, cx, cy, reach, prior, weights, shape, n_iterations):
    """Fit centre and shape by reweighted least squares of the distances along the radius.

    Parameters
    ----------
    x, y : coordinates of the points (n,)
    cx, cy : centre to begin with
    reach : points this far off the section weigh nothing
    prior : the points' noise over the scatter of the second harmonic's amplitude
    weights : written, the last weights (n,)
    shape : (5,), to begin with and as fitted
    n_iterations : at most so many steps

    Returns
    -------
    Centre x and y; nan where it diverges.
    """
    normal, right, step, slope = np.empty((7, 7)), np.empty(7), np.empty(7), np.empty(7)
    for _ in range(n_iterations):
        normal[:, :] = 0.0
        right[:] = 0.0
        for i in range(x.shape[0]):
            dx, dy = x[i] - cx, y[i] - cy
            d = math.sqrt(dx * dx + dy * dy)
            weights[i] = 0.0
            if d == 0.0:
                continue
            c, s = dx / d, dy / d
            residual = d - radius_towards(shape, c, s)
            w = tukey_weight(residual, reach)
            weights[i] = w
            if w == 0.0:
                continue
            c2, s2 = c * c - s * s, 2.0 * c * s
            slope[0], slope[1], slope[2], slope[3], slope[4] = 1.0, c, s, c2, s2
            slope[5], slope[6] = c2 * c - s2 * s, s2 * c + c2 * s
            for k in range(7):
                right[k] -= w * slope[k] * residual
                for m in range(k + 1):
                    normal[k, m] += w * slope[k] * slope[m]
        for k in range(3, 7):
            stiffness = prior * prior if k < 5 else (prior / LOBES_SHARE) ** 2
            normal[k, k] += stiffness
            right[k] += stiffness * shape[k - 2]
        if not solve_step(normal, right, step):
            return math.nan, math.nan
        cx += step[1]
        cy += step[2]
        shape[0] += step[0]
        shape[1:] += step[3:]
        if not shape[0] > 0.0:
            return math.nan, math.nan
        if np.abs(step).max() < 1e-5 * shape[0]:
            break
    return cx, cy


@njit(cache=True, nogil=True)
def fit_oval(x, y, cx, cy, r, tolerance, max_gap, weights, shape):
    """Fit an oval section near a circle; False where the points carry none that pipes have.

    Parameters
    ----------
    x, y : coordinates of the points (n,)
    cx, cy, r : the circle to begin with
    tolerance : points within it are on their section
    max_gap : wider gaps around the section are not seen
    weights : written (n,)
    shape : written (5,)

    Returns
    -------
    Centre x and y; nan where there is none.
    """
    n = x.shape[0]
    shape[:] = 0.0
    shape[0] = r
    prior = 0.5 * tolerance / (OVAL_PRIOR * r)
    wide = WIDE_REACH * r + 4.0 * tolerance
    cx, cy = refine_section(x, y, cx, cy, wide, prior, weights, shape, 6)
    if math.isfinite(cx):
        cx, cy = refine_section(x, y, cx, cy, 4.0 * tolerance, prior, weights, shape, 6)
    if not math.isfinite(cx):
        return math.nan, math.nan
    r = shape[0]
    if (
        math.hypot(shape[1], shape[2]) > MAX_OVAL * r
        or math.hypot(shape[3], shape[4]) > MAX_LOBES * r
    ):
        return math.nan, math.nan
    angles, n_on = np.empty(n), 0
    for k in range(n):
        if weights[k] >= 0.1:
            angles[n_on] = math.atan2(y[k] - cy, x[k] - cx)
            n_on += 1
    if n_on < MIN_OVAL_POINTS:
        return math.nan, math.nan
    if covered_arc(np.sort(angles[:n_on]), max(max_gap / r, 0.35)) < MIN_OVAL_ARC:
        return math.nan, math.nan
    return cx, cy


@njit(cache=True, nogil=True)
def fit_section(x, y, tolerance, max_gap, n_iterations, weights, shape):
    """Fit a circle, and an oval where many points are off the circle.

    Parameters
    ----------
    x, y : coordinates of the points (n,)
    tolerance : points within it are on their section
    max_gap : wider gaps around the section are not seen
    n_iterations : of the circle's fit
    weights : written (n,): about 1 on the section, 0 from four tolerances on
    shape : written (5,)

    Returns
    -------
    Centre x and y; nan where the points carry no section.
    """
    n = x.shape[0]
    weights[:] = 1.0
    shape[:] = 0.0
    x0, y0, r0 = taubin_circle(x, y, weights)
    if not r0 > 0.0:
        return math.nan, math.nan
    cx, cy, r = geometric_circle(x, y, x0, y0, r0, 4.0 * tolerance, weights, n_iterations)
    is_circle = r > 0.0
    n_on, total = 0, 0.0
    for k in range(n):
        n_on += weights[k] > 0.5
        total += weights[k]
    if n >= MIN_OVAL_POINTS and not (is_circle and n_on > ON_CIRCLE * n):
        of_oval = np.empty(n)
        ox, oy = fit_oval(x, y, x0, y0, r0, tolerance, max_gap, of_oval, shape)
        if math.isfinite(ox) and (not is_circle or of_oval.sum() > total):
            weights[:] = of_oval
            return ox, oy
    shape[:] = 0.0
    shape[0] = r
    return (cx, cy) if is_circle else (math.nan, math.nan)


@njit(cache=True, nogil=True)
def lies_on_section(x, y, mx, my, cx, cy, shape, max_distance, cos_radial):
    """Whether a point lies on a section and its normal (mx, my) points about to the centre."""
    dx, dy = x - cx, y - cy
    d = math.sqrt(dx * dx + dy * dy)
    if d == 0.0:
        return False
    off = abs(d - radius_towards(shape, dx / d, dy / d))
    return off <= max_distance and abs(dx * mx + dy * my) >= cos_radial * d
