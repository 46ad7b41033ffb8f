"""Residuals of bumps and their derivatives.

A bump is h·b(ρ) + c over an ellipse, ρ the distance from its peak in shares of half its length
and half its width. Its parameters are h, the peak's two coordinates, the logarithms of length
and width, c, and if there are seven, log q. The section b is a bell, cos²(π/2 · ρᑫ), a cone,
1 - ρ, or a frustum, (1 - ρ)(1 + q) cut off at one; each is zero from ρ = 1 on.
"""

import math

from numba import njit

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
def residuals(form, p, along, around, deviation, noise, residual):
    """Write (deviation - bump) / noise of points (n,)."""
    length, width = math.exp(p[3]), math.exp(p[4])
    q = math.exp(p[6]) if p.shape[0] > 6 else 1.0
    for i in range(along.shape[0]):
        u, v = 2.0 * (along[i] - p[1]) / length, 2.0 * (around[i] - p[2]) / width
        height, _, _ = section(form, math.sqrt(u * u + v * v), q)
        residual[i] = (deviation[i] - p[0] * height - p[5]) / noise[i]


@njit(cache=True, nogil=True)
def derivatives(form, p, along, around, noise, jacobian):
    """Write the derivatives of the residuals by the parameters, (n, 6 or 7)."""
    length, width = math.exp(p[3]), math.exp(p[4])
    q = math.exp(p[6]) if p.shape[0] > 6 else 1.0
    for i in range(along.shape[0]):
        u, v = 2.0 * (along[i] - p[1]) / length, 2.0 * (around[i] - p[2]) / width
        rho = math.sqrt(u * u + v * v)
        height, by_rho, by_log_q = section(form, rho, q)
        scale = -1.0 / noise[i]
        slope = scale * p[0] * by_rho / rho if rho > 0.0 else 0.0
        jacobian[i, 0] = scale * height
        jacobian[i, 1] = -slope * u * 2.0 / length
        jacobian[i, 2] = -slope * v * 2.0 / width
        jacobian[i, 3] = -slope * u * u
        jacobian[i, 4] = -slope * v * v
        jacobian[i, 5] = scale
        if p.shape[0] > 6:
            jacobian[i, 6] = scale * p[0] * by_log_q
