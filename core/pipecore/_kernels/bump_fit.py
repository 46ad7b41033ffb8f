"""Bumps fitted to points.

A bump is h·b(ρ) + c over an ellipse, ρ the distance from its peak in shares of half its length
and half its width. Its parameters are h, the peak's two coordinates, the logarithms of length
and width, c, and if there are seven, log q. The section b is a bell, cos²(π/2 · ρᑫ), a cone,
1 - ρ, or a frustum, (1 - ρ)(1 + q) cut off at one; each is zero from ρ = 1 on.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pipecore._kernels.linear import mirror, solve_in_place

BELL, CONE, FRUSTUM = 0, 1, 2


class BumpPoints(NamedTuple):
    """Points of a bump, each (n,), metres.

    along, around: place in the plane of the unrolled surface;
    deviation: height above the contour;
    noise: its standard deviation.
    """

    along: NDArray[np.float64]
    around: NDArray[np.float64]
    deviation: NDArray[np.float64]
    noise: NDArray[np.float64]


class BumpPrior(NamedTuple):
    """Priors as residuals, slopes · p - middle, of unit variance.

    slopes (m, p): their derivatives by the parameters;
    middle (m,): their values at p = 0, negative.
    """

    slopes: NDArray[np.float64]
    middle: NDArray[np.float64]


@njit(cache=True, nogil=True)
def section(form, rho, q):
    """Return the height of a section, and its derivatives by ρ and by log q.

    Parameters
    ----------
    form : BELL, CONE or FRUSTUM
    rho : distance from the peak, fraction of the half extents
    q : exponent of the bell, or shape of the frustum
    """
    if rho >= 1.0:
        return 0.0, 0.0, 0.0
    if form == CONE:
        return 1.0 - rho, -1.0, 0.0
    if form == FRUSTUM:
        height = (1.0 - rho) * (1.0 + q)
        if height >= 1.0:
            return 1.0, 0.0, 0.0
        return height, -(1.0 + q), q * (1.0 - rho)
    if rho <= 0.0:
        return 1.0, 0.0, 0.0
    t = rho if q == 1.0 else rho**q
    slope = -0.5 * math.pi * q * math.sin(math.pi * t) * t
    return math.cos(0.5 * math.pi * t) ** 2, slope / rho, slope * math.log(rho)


@njit(cache=True, nogil=True)
def gather(form, p, points, prior, normal, right):
    """Write JᵀJ and -Jᵀr of the residuals r = (bump - deviation) / noise, and return Σr².

    J are the derivatives of the residuals by the parameters; priors count as residuals.

    Parameters
    ----------
    form : BELL, CONE or FRUSTUM
    p (6 or 7,) : parameters, see the module
    points : BumpPoints
    prior : BumpPrior
    normal (p, p), right (p,) : filled
    """
    along, around, deviation, noise = points.along, points.around, points.deviation, points.noise
    slopes, middle = prior.slopes, prior.middle
    n_free = p.shape[0]
    length, width = math.exp(p[3]), math.exp(p[4])
    q = math.exp(p[6]) if n_free > 6 else 1.0
    normal[:, :] = 0.0
    right[:] = 0.0
    total = 0.0
    row = np.empty(n_free)
    for i in range(along.shape[0]):
        u, v = 2.0 * (along[i] - p[1]) / length, 2.0 * (around[i] - p[2]) / width
        rho = math.sqrt(u * u + v * v)
        height, by_rho, by_log_q = section(form, rho, q)
        scale = 1.0 / noise[i]
        residual = scale * (p[0] * height + p[5] - deviation[i])
        slope = scale * p[0] * by_rho / rho if rho > 0.0 else 0.0
        row[0] = scale * height
        row[1] = -slope * u * 2.0 / length
        row[2] = -slope * v * 2.0 / width
        row[3] = -slope * u * u
        row[4] = -slope * v * v
        row[5] = scale
        if n_free > 6:
            row[6] = scale * p[0] * by_log_q
        total += residual * residual
        for k in range(n_free):
            right[k] -= row[k] * residual
            for m in range(k + 1):
                normal[k, m] += row[k] * row[m]
    for i in range(slopes.shape[0]):
        residual = -middle[i]
        for k in range(n_free):
            residual += slopes[i, k] * p[k]
        total += residual * residual
        for k in range(n_free):
            right[k] -= slopes[i, k] * residual
            for m in range(k + 1):
                normal[k, m] += slopes[i, k] * slopes[i, m]
    mirror(normal)
    return total


@njit(cache=True, nogil=True)
def fit(form, first, points, prior, max_evaluations, tolerance, p, normal):
    """Fit a bump by the method of Levenberg and Marquardt, and return Σr².

    Parameters
    ----------
    form : BELL, CONE or FRUSTUM
    first (6 or 7,) : parameters to start from
    points : BumpPoints
    prior : BumpPrior
    max_evaluations : most evaluations of the residuals
    tolerance : it ends where a step neither gained nor promised more of Σr², a fraction
    p (p,), normal (p, p) : filled with the parameters and their normal matrix
    """
    n_free = first.shape[0]
    damping = 1e-3
    right, ahead_right = np.empty(n_free), np.empty(n_free)
    ahead, ahead_normal = np.empty(n_free), np.empty((n_free, n_free))
    damped, step = np.empty((n_free, n_free)), np.empty(n_free)
    p[:] = first
    total = gather(form, p, points, prior, normal, right)
    for _ in range(max_evaluations - 1):
        damped[:, :] = normal
        step[:] = right
        for k in range(n_free):
            damped[k, k] += damping * normal[k, k]
        solve_in_place(damped, step)
        promised = 0.0
        for k in range(n_free):
            promised += step[k] * (right[k] + damping * normal[k, k] * step[k])
            ahead[k] = p[k] + step[k]
        there = gather(form, ahead, points, prior, ahead_normal, ahead_right)
        gained = total - there
        if gained >= 0.0:  # also false where it is not a number
            p[:] = ahead
            normal[:, :] = ahead_normal
            right[:] = ahead_right
            total = there
            damping = max(0.1 * damping, 1e-9)
        else:
            damping *= 10.0
        if promised <= tolerance * total and gained <= tolerance * total:
            break
    return total
