"""Distances from cylinders, cones, tori and spheres.

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


@njit(cache=True, nogil=True)
def n_parameters(kind):
    """Return the number of parameters of a kind of surface.

    Parameters
    ----------
    kind : CYLINDER, CONE, TORUS or SPHERE
    """
    if kind == CYLINDER:
        return 5
    if kind == CONE:
        return 6
    return 7 if kind == TORUS else 4


@njit(cache=True, nogil=True)
def across(x, y, z):
    """Return two unit vectors across a unit vector and each other.

    Parameters
    ----------
    x, y, z : the vector
    """
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
    """Write the two vectors across the direction of a surface.

    Parameters
    ----------
    surface (14,) : see the module; changed
    """
    a, b, c, d, e, f = across(surface[3], surface[4], surface[5])
    surface[6], surface[7], surface[8] = a, b, c
    surface[9], surface[10], surface[11] = d, e, f


@njit(cache=True, nogil=True)
def at_point(kind, surface, x, y, z, slopes):
    """Return the signed distance of a point and the outward unit vector there.

    nan where the direction outward is not defined: on the axis.

    Parameters
    ----------
    kind, surface (14,) : see the module
    x, y, z : metres
    slopes (MOST_PARAMETERS,) : filled with the derivatives of the distance
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
    """Write signed distances, derivatives and outward unit vectors of points.

    Parameters
    ----------
    kind, surface (14,) : see the module
    xyz (n, 3) : points, metres
    residuals (n,), slopes (n, p), outward (n, 3) : filled
    """
    row = np.empty(MOST_PARAMETERS)
    for i in range(xyz.shape[0]):
        residuals[i], outward[i, 0], outward[i, 1], outward[i, 2] = at_point(
            kind, surface, xyz[i, 0], xyz[i, 1], xyz[i, 2], row
        )
        for k in range(slopes.shape[1]):
            slopes[i, k] = row[k]


@njit(cache=True, nogil=True)
def move(kind, surface, step):
    """Move a surface by a step of its parameters, in place.

    Parameters
    ----------
    kind, surface (14,) : see the module; changed
    step (p,) : in the order of the parameters
    """
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
