"""Distances from cylinders, cones, tori and spheres, and their robust fit to points.

A surface is a kind and fourteen numbers: a place (0-2), the direction of its axis (3-5) and
two unit vectors across it (6-11), the radius (12), and the slope of a cone or the bend radius
of a torus (13). Its parameters, in the order of its derivatives, are

- cylinder, cone: offset and tilt along either vector across (2 + 2), radius[, slope];
- torus: centre (3), tilt along either vector (2), bend radius, radius;
- sphere: centre (3), radius.
"""

import math

import numpy as np
from numba import njit

CYLINDER, CONE, TORUS, SPHERE = 0, 1, 2, 3
MOST_PARAMETERS = 7
TUKEY = 4.685
"""Reach of Tukey's weights in standard deviations: 95 % as good as least squares on noise."""
NARROWING = 0.7
"""The scale shrinks by no more than this in one iteration: the fit may still be far off."""
LEAST_SCALE = 1e-5
CONVERGED, SETTLED = 1e-6, 0.02
"""A fit ends when no point's distance changes by more than this, nor the scale by this share."""
WORST_CONDITION = 1e10
FACING = 0.3
"""Least cosine to the beam of points that tell the noise along it."""


@njit(cache=True, nogil=True)
def n_parameters(kind):
    """Number of parameters of a kind of surface."""
    if kind == CYLINDER:
        return 5
    if kind == CONE:
        return 6
    return 7 if kind == TORUS else 4


@njit(cache=True, nogil=True)
def across(x, y, z):
    """Two unit vectors across a unit vector and each other."""
    if abs(x) <= abs(y) and abs(x) <= abs(z):
        length = math.hypot(y, z)
        a, b, c = 0.0, -z / length, y / length
    elif abs(y) <= abs(z):
        length = math.hypot(x, z)
        a, b, c = z / length, 0.0, -x / length
    else:
        length = math.hypot(x, y)
        a, b, c = -y / length, x / length, 0.0
    return a, b, c, y * c - z * b, z * a - x * c, x * b - y * a


@njit(cache=True, nogil=True)
def place_frame(surface):
    """Write the two vectors across the direction of a surface."""
    a, b, c, d, e, f = across(surface[3], surface[4], surface[5])
    surface[6], surface[7], surface[8] = a, b, c
    surface[9], surface[10], surface[11] = d, e, f


@njit(cache=True, nogil=True)
def at_point(kind, surface, x, y, z, slopes):
    """Signed distance of a point, and the outward unit vector there; writes the derivatives.

    nan where the direction outward is not defined: on the axis.
    """
    px, py, pz = x - surface[0], y - surface[1], z - surface[2]
    if kind == SPHERE:
        rho = math.sqrt(px * px + py * py + pz * pz)
        if rho == 0.0:
            return math.nan, math.nan, math.nan, math.nan
        px, py, pz = px / rho, py / rho, pz / rho
        slopes[0], slopes[1], slopes[2], slopes[3] = -px, -py, -pz, -1.0
        return rho - surface[12], px, py, pz
    s = px * surface[3] + py * surface[4] + pz * surface[5]
    u = px * surface[6] + py * surface[7] + pz * surface[8]
    v = px * surface[9] + py * surface[10] + pz * surface[11]
    rho = math.sqrt(u * u + v * v)
    if rho == 0.0:
        return math.nan, math.nan, math.nan, math.nan
    cos, sin = u / rho, v / rho
    ox = cos * surface[6] + sin * surface[9]
    oy = cos * surface[7] + sin * surface[10]
    oz = cos * surface[8] + sin * surface[11]
    if kind == TORUS:
        beyond = rho - surface[13]
        distance = math.sqrt(beyond * beyond + s * s)
        if distance == 0.0:
            return math.nan, math.nan, math.nan, math.nan
        cos, sin = beyond / distance, s / distance
        ox = cos * ox + sin * surface[3]
        oy = cos * oy + sin * surface[4]
        oz = cos * oz + sin * surface[5]
        # Tilting the normal by w: the height changes by u·w1 + v·w2.
        per_height = sin - cos * s / rho
        slopes[0], slopes[1], slopes[2] = -ox, -oy, -oz
        slopes[3], slopes[4] = per_height * u, per_height * v
        slopes[5], slopes[6] = -cos, -1.0
        return distance - surface[12], ox, oy, oz
    slope = surface[13]
    scale = 1.0 / math.sqrt(1.0 + slope * slope)
    slopes[0], slopes[1] = -scale * cos, -scale * sin
    slopes[2], slopes[3] = -scale * s * cos, -scale * s * sin
    slopes[4] = -scale
    if kind == CONE:
        slopes[5] = -scale * s
        ox = scale * (ox - slope * surface[3])
        oy = scale * (oy - slope * surface[4])
        oz = scale * (oz - slope * surface[5])
    return scale * (rho - surface[12] - slope * s), ox, oy, oz


@njit(cache=True, nogil=True)
def at_points(kind, surface, xyz, residuals, slopes, outward):
    """Write distances (n,), derivatives (n, p) and outward unit vectors (n, 3) of points."""
    row = np.empty(MOST_PARAMETERS)
    for i in range(xyz.shape[0]):
        residuals[i], outward[i, 0], outward[i, 1], outward[i, 2] = at_point(
            kind, surface, xyz[i, 0], xyz[i, 1], xyz[i, 2], row
        )
        for k in range(slopes.shape[1]):
            slopes[i, k] = row[k]


@njit(cache=True, nogil=True)
def move(kind, surface, step):
    """Move a surface by a step of its parameters, in place."""
    if kind == SPHERE:
        for k in range(3):
            surface[k] += step[k]
        surface[12] += step[3]
        return
    if kind == TORUS:
        for k in range(3):
            surface[k] += step[k]
        tilt_1, tilt_2 = step[3], step[4]
        surface[13] += step[5]
        surface[12] += step[6]
    else:
        for k in range(3):
            surface[k] += step[0] * surface[6 + k] + step[1] * surface[9 + k]
        tilt_1, tilt_2 = step[2], step[3]
        surface[12] += step[4]
        if kind == CONE:
            surface[13] += step[5]
    for k in range(3):
        surface[3 + k] += tilt_1 * surface[6 + k] + tilt_2 * surface[9 + k]
    length = math.sqrt(surface[3] ** 2 + surface[4] ** 2 + surface[5] ** 2)
    for k in range(3):
        surface[3 + k] /= length
    place_frame(surface)


@njit(cache=True, nogil=True)
def tukey(residual, reach):
    """Weight that falls to zero at `reach`."""
    q = residual / reach
    return (1.0 - q * q) ** 2 if abs(q) < 1.0 else 0.0


@njit(cache=True, nogil=True)
def weighted_normal_equations(kind, surface, xyz, reach, residuals, normal, right):
    """Write distances, Σ w jjᵀ (p, p) and Σ w j·residual (p,); return how many points count."""
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
            weight = tukey(residual, reach)
            for k in range(p):
                weighted = weight * row[k]
                right[k] += weighted * residual
                for m in range(k + 1):
                    normal[k, m] += weighted * row[m]
    for k in range(p):
        for m in range(k):
            normal[m, k] = normal[k, m]
    return n_used


@njit(cache=True, nogil=True)
def spread_within(residuals, reach):
    """Standard deviation from the median absolute residual of those within `reach`."""
    found = np.empty(residuals.shape[0])
    n = 0
    for residual in residuals:
        if abs(residual) < reach:
            found[n] = abs(residual)
            n += 1
    return 1.4826 * np.median(found[:n]) if n > 0 else math.nan


@njit(cache=True, nogil=True)
def moves_less(kind, surface, xyz, step, limit):
    """Whether a step changes the distance of every point by less than `limit`."""
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
def solve_step(normal, right, step):
    """Solve for the step that lessens the residuals; False where the points do not carry one."""
    p = right.shape[0]
    diagonal = np.empty(p)
    for k in range(p):
        diagonal[k] = math.sqrt(max(normal[k, k], 1e-300))
    scaled = np.empty((p, p))
    for k in range(p):
        for m in range(p):
            scaled[k, m] = normal[k, m] / (diagonal[k] * diagonal[m])
            if not math.isfinite(scaled[k, m]):
                return False
    if not np.linalg.cond(scaled) <= WORST_CONDITION:
        return False
    step[:] = np.linalg.solve(scaled, -right / diagonal) / diagonal
    return True


@njit(cache=True, nogil=True)
def fit_robustly(kind, surface, xyz, scale, n_iterations):
    """Move a surface onto points by Gauss-Newton with Tukey's weights, in place.

    Returns the last scale; nan where the points do not carry the surface.
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
        if change < SETTLED * scale and moves_less(kind, before, xyz, step, CONVERGED):
            break
    return scale


@njit(cache=True, nogil=True)
def judge_fit(kind, surface, xyz, reach, information, scatter, beam):
    """What the points within `reach` tell of a fitted surface.

    Writes Huber's information matrix of an M-estimator and the scatter of its gradient
    (p, p), and the mean of the outward vectors (3,). Returns the points' number and spread.
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
            pull = (tukey(residual, reach) * residual) ** 2
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
            information[m, k], scatter[m, k] = information[k, m], scatter[k, m]
    for k in range(3):
        beam[k] /= max(n, 1)
    return n, spread_within(residuals, reach)


@njit(cache=True, nogil=True)
def noise_along(kind, surface, xyz, reach, beam):
    """Standard deviation along a beam of the points within `reach` that face it."""
    row = np.empty(MOST_PARAMETERS)
    moved = np.empty(xyz.shape[0])
    n = 0
    for i in range(xyz.shape[0]):
        residual, ox, oy, oz = at_point(kind, surface, xyz[i, 0], xyz[i, 1], xyz[i, 2], row)
        facing = ox * beam[0] + oy * beam[1] + oz * beam[2]
        if abs(residual) < reach and facing > FACING:
            moved[n] = abs(residual / facing)
            n += 1
    return 1.4826 * np.median(moved[:n]) if n > 0 else 0.0


@njit(cache=True, nogil=True)
def pull_along(kind, surface, xyz, reach, beam, steps, shares, pull):
    """Write the mean of Σ w j·residual for points within `reach` that are moved along a beam.

    They are moved from where they would lie on the surface, by `steps` (metres) that are
    as probable as `shares`.
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
                weighted = shares[k] * tukey(residual, reach) * residual
                for m in range(p):
                    pull[m] += weighted * row[m]
