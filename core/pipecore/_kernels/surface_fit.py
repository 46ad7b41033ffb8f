"""Cylinders, cones, tori and spheres fitted robustly to points, without Python between.

Surfaces and their parameters are those of `pipecore._kernels.surface_models`.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pipecore._kernels.circles import tukey_weight
from pipecore._kernels.linear import mirror, solve_step
from pipecore._kernels.surface_models import (
    CONE,
    CYLINDER,
    MOST_PARAMETERS,
    at_point,
    move,
    n_parameters,
)
from pipecore.robust import MAD_TO_SD

TUKEY = 4.685
"""Reach of Tukey's weights in standard deviations: 95 % as good as least squares on noise."""
NARROWING = 0.7
"""The scale shrinks by no more than this in one iteration: the fit may still be far off."""
LEAST_SCALE = 1e-5
SETTLED = 0.02
"""A fit ends only when the scale changes by no more than this share."""
FACING = 0.3
"""Least cosine to the beam of points whose scatter is taken as noise along it."""


class BeamNoise(NamedTuple):
    """Noise along the laser's beam, as a quadrature over the normal distribution.

    min_one_sided: length of the mean of the outward vectors from which a surface is seen from
    one side and corrected; above 1 none is;
    steps (k,): nodes, standard deviations;
    shares (k,): their weights, of sum 1.
    """

    min_one_sided: float
    steps: NDArray[np.float64]
    shares: NDArray[np.float64]


@njit(cache=True, nogil=True)
def line_equations(surface, xyz, reach, residuals, normal, right):
    """Write what `weighted_normal_equations` does for cylinders and cones, several times as fast.

    Their derivatives are products of the chainage s and of cosine and sine of the clock angle,
    so that few sums are enough.

    Parameters
    ----------
    surface (14,) : see `surface_models`
    xyz (n, 3) : points, metres
    reach : of Tukey's weights, metres
    residuals (n,), normal (p, p), right (p,) : filled

    Returns
    -------
    Number of points within reach.
    """
    p = right.shape[0]
    x0, y0, z0 = surface[0], surface[1], surface[2]
    dx, dy, dz = surface[3], surface[4], surface[5]
    ux, uy, uz = surface[6], surface[7], surface[8]
    vx, vy, vz = surface[9], surface[10], surface[11]
    radius, slope = surface[12], surface[13]
    scale = 1.0 / math.sqrt(1.0 + slope * slope)
    # Σ w, times powers of s; times cos and sin; times their products.
    w0 = w1 = w2 = c0 = c1 = c2 = d0 = d1 = d2 = 0.0
    cc0 = cc1 = cc2 = cd0 = cd1 = cd2 = dd0 = dd1 = dd2 = 0.0
    r0 = r1 = rc0 = rc1 = rd0 = rd1 = 0.0
    n_used = 0
    for i in range(xyz.shape[0]):
        px, py, pz = xyz[i, 0] - x0, xyz[i, 1] - y0, xyz[i, 2] - z0
        s = px * dx + py * dy + pz * dz
        u = px * ux + py * uy + pz * uz
        v = px * vx + py * vy + pz * vz
        rho = math.sqrt(u * u + v * v)
        residual = scale * (rho - radius - slope * s) if rho > 0.0 else math.nan
        residuals[i] = residual
        if not abs(residual) < reach:
            continue
        n_used += 1
        q = residual / reach
        w = (1.0 - q * q) ** 2
        cos, sin = u / rho, v / rho
        ws, wc, wd, wr = w * s, w * cos, w * sin, w * residual
        w0, w1, w2 = w0 + w, w1 + ws, w2 + ws * s
        c0, d0 = c0 + wc, d0 + wd
        cc0, cd0, dd0 = cc0 + wc * cos, cd0 + wc * sin, dd0 + wd * sin
        wc, wd = wc * s, wd * s
        c1, d1 = c1 + wc, d1 + wd
        cc1, cd1, dd1 = cc1 + wc * cos, cd1 + wc * sin, dd1 + wd * sin
        wc, wd = wc * s, wd * s
        c2, d2 = c2 + wc, d2 + wd
        cc2, cd2, dd2 = cc2 + wc * cos, cd2 + wc * sin, dd2 + wd * sin
        r0, rc0, rd0 = r0 + wr, rc0 + wr * cos, rd0 + wr * sin
        wr *= s
        r1, rc1, rd1 = r1 + wr, rc1 + wr * cos, rd1 + wr * sin
    normal[0, 0], normal[1, 0], normal[1, 1] = cc0, cd0, dd0
    normal[2, 0], normal[2, 1], normal[2, 2] = cc1, cd1, cc2
    normal[3, 0], normal[3, 1], normal[3, 2], normal[3, 3] = cd1, dd1, cd2, dd2
    normal[4, 0], normal[4, 1], normal[4, 2], normal[4, 3], normal[4, 4] = c0, d0, c1, d1, w0
    right[0], right[1], right[2], right[3], right[4] = rc0, rd0, rc1, rd1, r0
    if p == 6:
        normal[5, 0], normal[5, 1], normal[5, 2], normal[5, 3] = c1, d1, c2, d2
        normal[5, 4], normal[5, 5], right[5] = w1, w2, r1
    for k in range(p):
        right[k] *= -scale
        for m in range(k + 1):
            normal[k, m] *= scale * scale
    mirror(normal)
    return n_used


@njit(cache=True, nogil=True)
def weighted_normal_equations(kind, surface, xyz, reach, residuals, normal, right):
    """Write distances, Σ w jjᵀ and Σ w j·residual with Tukey's weights w.

    Parameters
    ----------
    kind, surface (14,) : see `surface_models`
    xyz (n, 3) : points, metres
    reach : of Tukey's weights, metres
    residuals (n,), normal (p, p), right (p,) : filled

    Returns
    -------
    Number of points within reach.
    """
    if kind in (CYLINDER, CONE):
        return line_equations(surface, xyz, reach, residuals, normal, right)
    p = right.shape[0]
    row = np.empty(MOST_PARAMETERS)
    normal[:, :] = 0.0
    right[:] = 0.0
    n_used = 0
    for i in range(xyz.shape[0]):
        residual, _, _, _ = at_point(kind, surface, xyz[i, 0], xyz[i, 1], xyz[i, 2], row)
        residuals[i] = residual
        if abs(residual) < reach:
            n_used += 1
            weight = tukey_weight(residual, reach)
            for k in range(p):
                weighted = weight * row[k]
                right[k] += weighted * residual
                for m in range(k + 1):
                    normal[k, m] += weighted * row[m]
    mirror(normal)
    return n_used


@njit(cache=True, nogil=True)
def spread_within(residuals, reach):
    """Return the standard deviation from the median absolute residual of those within reach.

    Parameters
    ----------
    residuals (n,) : metres
    reach : metres
    """
    found = np.empty(residuals.shape[0])
    n = 0
    for residual in residuals:
        if abs(residual) < reach:
            found[n] = abs(residual)
            n += 1
    return MAD_TO_SD * np.median(found[:n]) if n > 0 else math.nan


@njit(cache=True, nogil=True)
def moves_less(kind, surface, xyz, step, limit):
    """Return whether a step changes the distance of every point by less than a limit.

    Parameters
    ----------
    kind, surface (14,) : see `surface_models`
    xyz (n, 3) : points, metres
    step (p,) : of the parameters
    limit : metres
    """
    row = np.empty(MOST_PARAMETERS)
    for i in range(xyz.shape[0]):
        at_point(kind, surface, xyz[i, 0], xyz[i, 1], xyz[i, 2], row)
        change = 0.0
        for k in range(step.shape[0]):
            change += row[k] * step[k]
        if not abs(change) < limit:
            return False
    return True


@njit(cache=True, nogil=True)
def fit_robustly(kind, surface, xyz, scale, n_iterations, converged):
    """Fit a surface by Gauss-Newton with Tukey's weights, in place; return the last scale.

    nan where the points do not define the surface.

    Parameters
    ----------
    kind, surface (14,) : see `surface_models`; changed
    xyz (n, 3) : points, metres
    scale : standard deviation to begin with, metres
    n_iterations : most iterations
    converged : change of distances below which it ends, metres
    """
    p = n_parameters(kind)
    normal, right, step = np.empty((p, p)), np.empty(p), np.empty(p)
    residuals = np.empty(xyz.shape[0])
    before = np.empty(surface.shape[0])
    for _ in range(n_iterations):
        reach = TUKEY * scale
        n_used = weighted_normal_equations(kind, surface, xyz, reach, residuals, normal, right)
        if n_used < 3 * p or not solve_step(normal, right, step):
            return math.nan
        before[:] = surface
        move(kind, surface, step)
        if not surface[12] > 0.0:
            return math.nan
        shown = spread_within(residuals, reach)
        change = abs(shown - scale)
        scale = min(scale, max(shown, NARROWING * scale, LEAST_SCALE))
        if change < SETTLED * scale and moves_less(kind, before, xyz, step, converged):
            break
    return scale


@njit(cache=True, nogil=True)
def judge_fit(kind, surface, xyz, reach, information, scatter, beam):
    """Write the matrices of Huber's covariance of an M-estimator, and the mean outward vector.

    Parameters
    ----------
    kind, surface (14,) : see `surface_models`
    xyz (n, 3) : points, metres
    reach : of Tukey's weights, metres
    information, scatter (p, p) : filled with the mean slope times Σjjᵀ, and Σ(wr)²jjᵀ
    beam (3,) : filled

    Returns
    -------
    Number of points within reach, and their robust standard deviation, metres.
    """
    p = information.shape[0]
    row = np.empty(MOST_PARAMETERS)
    residuals = np.empty(xyz.shape[0])
    information[:, :] = 0.0
    scatter[:, :] = 0.0
    beam[:] = 0.0
    n = 0
    slope = 0.0
    for i in range(xyz.shape[0]):
        residual, ox, oy, oz = at_point(kind, surface, xyz[i, 0], xyz[i, 1], xyz[i, 2], row)
        residuals[i] = residual
        if abs(residual) < reach:
            n += 1
            ratio = (residual / reach) ** 2
            slope += (1.0 - ratio) * (1.0 - 5.0 * ratio)
            pull = (tukey_weight(residual, reach) * residual) ** 2
            beam[0] += ox
            beam[1] += oy
            beam[2] += oz
            for k in range(p):
                for m in range(k + 1):
                    product = row[k] * row[m]
                    information[k, m] += product
                    scatter[k, m] += pull * product
    for k in range(p):
        for m in range(k + 1):
            information[k, m] *= slope / max(n, 1)
            scatter[k, m] *= n / (n - p) if n > p else math.nan
    mirror(information)
    mirror(scatter)
    for k in range(3):
        beam[k] /= max(n, 1)
    return n, spread_within(residuals, reach)


@njit(cache=True, nogil=True)
def noise_along(kind, surface, xyz, reach, beam):
    """Return the standard deviation along a beam of the points that face it, metres.

    Parameters
    ----------
    kind, surface (14,) : see `surface_models`
    xyz (n, 3) : points, metres
    reach : largest distance from the surface, metres
    beam (3,) : unit vector
    """
    row = np.empty(MOST_PARAMETERS)
    moved = np.empty(xyz.shape[0])
    n = 0
    for i in range(xyz.shape[0]):
        residual, ox, oy, oz = at_point(kind, surface, xyz[i, 0], xyz[i, 1], xyz[i, 2], row)
        facing = ox * beam[0] + oy * beam[1] + oz * beam[2]
        if abs(residual) < reach and facing > FACING:
            moved[n] = abs(residual / facing)
            n += 1
    return MAD_TO_SD * np.median(moved[:n]) if n > 0 else 0.0


@njit(cache=True, nogil=True)
def pull_along(kind, surface, xyz, reach, beam, steps, shares, pull):
    """Write the mean of Σ w j·residual for points moved along a beam.

    They are moved from where they would lie on the surface.

    Parameters
    ----------
    kind, surface (14,) : see `surface_models`
    xyz (n, 3) : points, metres
    reach : of Tukey's weights, metres
    beam (3,) : unit vector
    steps, shares (k,) : movements, metres, and their probabilities
    pull (p,) : filled
    """
    p = pull.shape[0]
    row = np.empty(MOST_PARAMETERS)
    pull[:] = 0.0
    for i in range(xyz.shape[0]):
        x, y, z = xyz[i, 0], xyz[i, 1], xyz[i, 2]
        residual, ox, oy, oz = at_point(kind, surface, x, y, z, row)
        if not abs(residual) < reach:
            continue
        x, y, z = x - residual * ox, y - residual * oy, z - residual * oz
        for k in range(steps.shape[0]):
            t = steps[k]
            residual, _, _, _ = at_point(
                kind, surface, x + t * beam[0], y + t * beam[1], z + t * beam[2], row
            )
            if abs(residual) < reach:
                weighted = shares[k] * tukey_weight(residual, reach) * residual
                for m in range(p):
                    pull[m] += weighted * row[m]


@njit(cache=True, nogil=True)
def subtract_range_noise_bias(kind, surface, xyz, reach, facing, noise, inverse):
    """Move a surface back by what noise along the laser's beam has moved it.

    Parameters
    ----------
    kind, surface (14,) : see `surface_models`; changed
    xyz (n, 3) : points, metres
    reach : of Tukey's weights, metres
    facing (3,) : mean outward vector of the points
    noise : BeamNoise
    inverse (p, p) : inverse of the fit's information matrix
    """
    p = inverse.shape[0]
    one_sidedness = math.sqrt(facing[0] ** 2 + facing[1] ** 2 + facing[2] ** 2)
    if one_sidedness < noise.min_one_sided:
        return
    beam = facing / one_sidedness
    sd = noise_along(kind, surface, xyz, reach, beam)
    pull, step = np.zeros(p), np.zeros(p)
    pull_along(kind, surface, xyz, reach, beam, noise.steps * sd, noise.shares, pull)
    for k in range(p):
        for m in range(p):
            step[k] += inverse[k, m] * pull[m]
    move(kind, surface, step)


@njit(cache=True, nogil=True)
def fit_surface(kind, surface, xyz, scale, n_iterations, converged, noise, covariance):
    """Fit a surface to points, in place, and write its covariance.

    Parameters
    ----------
    kind, surface (14,) : see `surface_models`; changed
    xyz (n, 3) : points, metres
    scale : standard deviation to begin with, metres
    n_iterations : most iterations
    converged : change of distances below which it ends, metres
    noise : BeamNoise
    covariance (p, p) : filled; points need not all scatter alike

    Returns
    -------
    Number of points that count, and their robust standard deviation, metres; 0 and nan where
    the points do not define the surface.
    """
    p = n_parameters(kind)
    scale = fit_robustly(kind, surface, xyz, scale, n_iterations, converged)
    if not scale > 0.0:
        return 0, math.nan
    reach = TUKEY * scale
    # Huber's covariance of an M-estimator; points need not all scatter alike.
    information, scatter, beam = np.empty((p, p)), np.empty((p, p)), np.empty(3)
    n, sigma = judge_fit(kind, surface, xyz, reach, information, scatter, beam)
    if n < 3 * p or not np.all(np.isfinite(information)):
        return 0, math.nan
    inverse = np.linalg.pinv(information)
    subtract_range_noise_bias(kind, surface, xyz, reach, beam, noise, inverse)
    for k in range(p):
        for m in range(p):
            total = 0.0
            for i in range(p):
                for j in range(p):
                    total += inverse[k, i] * scatter[i, j] * inverse[j, m]
            covariance[k, m] = total
    return n, sigma
