"""Pipe coordinates of points about straight and circular axes.

An axis is seventeen numbers: the start of a line or the centre of an arc (0-2), the direction
or the normal (3-5), the unit vectors to 12:00 and 3:00 of a line, or to the start of an arc and
ahead there (6-11), the bend radius, 0 for a line (12), half the bend angle (13), cosine and
sine of the clock angle of the extrados (14, 15), and the length (16).
"""

import math

from numba import njit


@njit(cache=True, nogil=True)
def polar(up, right):
    """Return distance and clock angle in [0, 2π) of a point across an axis.

    Parameters
    ----------
    up, right : towards 12:00 and 3:00, metres
    """
    clock = math.atan2(right, up)
    if clock < 0.0:
        clock += 2.0 * math.pi
        # A hair before 12:00 rounds to a full turn.
        if clock >= 2.0 * math.pi:
            clock = 0.0
    return math.sqrt(up * up + right * right), clock


@njit(cache=True, nogil=True)
def across_axis(axis, x, y, z):
    """Return the chainage of a point, and its offsets to 12:00 and 3:00 of the axis, metres.

    Parameters
    ----------
    axis (17,) : see the module
    x, y, z : metres
    """
    px, py, pz = x - axis[0], y - axis[1], z - axis[2]
    along = px * axis[3] + py * axis[4] + pz * axis[5]
    a = px * axis[6] + py * axis[7] + pz * axis[8]
    b = px * axis[9] + py * axis[10] + pz * axis[11]
    bend, half = axis[12], axis[13]
    if bend == 0.0:
        return along, a, b
    # The cut of the circle is put opposite the middle of the arc.
    angle = half + (math.atan2(b, a) - half + math.pi) % (2.0 * math.pi) - math.pi
    outward, side = math.sqrt(a * a + b * b) - bend, -along
    cos, sin = axis[14], axis[15]
    return angle * bend, cos * outward - sin * side, sin * outward + cos * side


@njit(cache=True, nogil=True)
def pipe_coordinates(axis, xyz, chainage, rho, clock):
    """Write chainage, distance from the axis and clock angle of points.

    Parameters
    ----------
    axis (17,) : see the module
    xyz (n, 3) : metres
    chainage, rho, clock (n,) : filled, metres, metres and radians
    """
    for i in range(xyz.shape[0]):
        chainage[i], up, right = across_axis(axis, xyz[i, 0], xyz[i, 1], xyz[i, 2])
        rho[i], clock[i] = polar(up, right)


@njit(cache=True, nogil=True)
def place_on_axis(axis, chainage):
    """Return the point of an axis at a chainage, metres.

    Parameters
    ----------
    axis (17,) : see `pipe_coordinates`
    chainage : metres
    """
    bend = axis[12]
    if bend == 0.0:
        return (
            axis[0] + chainage * axis[3],
            axis[1] + chainage * axis[4],
            axis[2] + chainage * axis[5],
        )
    cos, sin = bend * math.cos(chainage / bend), bend * math.sin(chainage / bend)
    return (
        axis[0] + cos * axis[6] + sin * axis[9],
        axis[1] + cos * axis[7] + sin * axis[10],
        axis[2] + cos * axis[8] + sin * axis[11],
    )


@njit(cache=True, nogil=True)
def tangent(axis, chainage):
    """Return the unit tangent of an axis towards increasing chainage.

    Parameters
    ----------
    axis (17,) : see `pipe_coordinates`
    chainage : metres
    """
    bend = axis[12]
    if bend == 0.0:
        return axis[3], axis[4], axis[5]
    cos, sin = math.cos(chainage / bend), math.sin(chainage / bend)
    # The normal of the arc times outward.
    return (
        cos * axis[9] - sin * axis[6],
        cos * axis[10] - sin * axis[7],
        cos * axis[11] - sin * axis[8],
    )
