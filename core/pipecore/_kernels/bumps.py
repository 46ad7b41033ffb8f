"""Bumps fitted to points.

A bump is h·b(ρ) + c over an ellipse, ρ the distance from its peak in shares of half its length
and half its width. Its parameters are h, the peak's two coordinates, the logarithms of length
and width, c, and if there are seven, log q. The section b is a bell, cos²(π/2 · ρᑫ), a cone,
1 - ρ, or a frustum, (1 - ρ)(1 + q) cut off at one; each is zero from ρ = 1 on.
"""

import math

import numpy as np
from numba import njit

from pipecore._kernels.linear import mirror, solve_in_place

BELL, CONE, FRUSTUM = 0, 1, 2


@njit(cache=True, nogil=True)
def section(form, rho, q):
    """Height of a section, and its derivatives by ρ and by log q."""
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
def gather(form, p, along, around, deviation, noise, slopes, middle, normal, right):
    """Write JᵀJ and -Jᵀr of the residuals (bump - deviation) / noise, and return Σr².

    J are their derivatives by the parameters. Beliefs are residuals too, slopes · p - middle.
    """
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
def fit(form, first, along, around, deviation, noise, slopes, middle, n_most, tolerance, p, normal):
    """Fit a bump by Levenberg and Marquardt's method, from `first`; return Σr².

    Writes its parameters and their normal matrix. It ends where a step neither gained nor
    promised more than `tolerance` of Σr², or after `n_most` looks at the points.
    """
    n_free = first.shape[0]
    damping = 1e-3
    right, ahead_right = np.empty(n_free), np.empty(n_free)
    ahead, ahead_normal = np.empty(n_free), np.empty((n_free, n_free))
    damped, step = np.empty((n_free, n_free)), np.empty(n_free)
    p[:] = first
    total = gather(form, p, along, around, deviation, noise, slopes, middle, normal, right)
    for _ in range(n_most - 1):
        damped[:, :] = normal
        step[:] = right
        for k in range(n_free):
            damped[k, k] += damping * normal[k, k]
        solve_in_place(damped, step)
        promised = 0.0
        for k in range(n_free):
            promised += step[k] * (right[k] + damping * normal[k, k] * step[k])
            ahead[k] = p[k] + step[k]
        there = gather(
            form, ahead, along, around, deviation, noise, slopes, middle, ahead_normal, ahead_right
        )
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
