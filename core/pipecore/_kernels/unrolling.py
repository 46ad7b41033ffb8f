"""Points in the coordinates of an element, with how they face its surface."""

import math

from numba import njit

from pipecore._kernels.pipe_coordinates import (
    across_axis,
    along_chord,
    frame_of_curve,
    offsets_of_curve,
    polar,
)


@njit(cache=True, nogil=True)
def facing(axis, slope, x, y, z, nx, ny, nz):
    """Return chainage, distance and clock of a point, and how its normal agrees with a surface's.

    The surface is one of revolution. The last value is the cosine between the normals times the
    distance from the axis.

    Parameters
    ----------
    axis (17,) : see `pipe_coordinates`
    slope : change of radius per metre of chainage
    x, y, z : point, metres
    nx, ny, nz : its unit normal
    """
    chainage, up, right = across_axis(axis, x, y, z)
    rho, clock = polar(up, right)
    bend = axis[12]
    if bend == 0.0:
        across = nx * (axis[6] * up + axis[9] * right)
        across += ny * (axis[7] * up + axis[10] * right)
        across += nz * (axis[8] * up + axis[11] * right)
        ahead = nx * axis[3] + ny * axis[4] + nz * axis[5]
    elif bend < 0.0:
        _, _, du, dv, _, _ = offsets_of_curve(axis, along_chord(axis, chainage))
        tx, ty, tz, ux, uy, uz, rx, ry, rz = frame_of_curve(axis, du, dv)
        across = nx * (ux * up + rx * right)
        across += ny * (uy * up + ry * right)
        across += nz * (uz * up + rz * right)
        ahead = nx * tx + ny * ty + nz * tz
    else:
        # Out of the arc's centre, along its normal, and ahead.
        cos, sin = math.cos(chainage / bend), math.sin(chainage / bend)
        outward = axis[14] * up + axis[15] * right
        side = axis[15] * up - axis[14] * right
        start = nx * axis[6] + ny * axis[7] + nz * axis[8]
        later = nx * axis[9] + ny * axis[10] + nz * axis[11]
        across = outward * (cos * start + sin * later)
        across += side * (nx * axis[3] + ny * axis[4] + nz * axis[5])
        ahead = cos * later - sin * start
    return chainage, rho, clock, (across - slope * rho * ahead) / math.sqrt(1.0 + slope * slope)


@njit(cache=True, nogil=True)
def unroll(axis, radius, slope, xyz, normals, chainage, rho, clock, height, alignment):
    """Write pipe coordinates of points, their height above a surface, and |cosines| to its normal.

    Parameters
    ----------
    axis (17,) : see `pipe_coordinates`
    radius, slope : radius at chainage 0, metres, and its change per metre
    xyz, normals (n, 3) : points, metres, and unit normals
    chainage, rho, clock, height, alignment (n,) : filled, metres and radians
    """
    steep = math.sqrt(1.0 + slope * slope)
    for i in range(xyz.shape[0]):
        s, distance, theta, along = facing(
            axis, slope, xyz[i, 0], xyz[i, 1], xyz[i, 2],
            normals[i, 0], normals[i, 1], normals[i, 2],
        )  # fmt: skip
        chainage[i], rho[i], clock[i] = s, distance, theta
        height[i] = (distance - radius - slope * s) / steep
        alignment[i] = abs(along) / max(distance, 1e-9)
