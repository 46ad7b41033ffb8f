"""Pipe coordinates of points about straight, circular and bowed axes.

An axis is seventeen numbers: the start of a line or the centre of an arc (0-2), the direction
or the normal (3-5), the unit vectors to 12:00 and 3:00 of a line, or to the start of an arc and
ahead there (6-11), the bend radius, 0 for a line (12), half the bend angle (13), cosine and
sine of the clock angle of the extrados (14, 15), and the length (16).

A bowed axis has a negative number at (12): that of its pieces of equal length along its chord,
which is kept as a line and whose length stands at (13). Ten numbers follow for each piece:
coefficients of the cubic offsets to 12:00 and to 3:00 of the chord (four each, of the distance
along the chord from where the piece begins), the chainage there, and chainage per distance.
"""

import math

from numba import njit

FIRST, PER_PIECE = 17, 10
"""Where the numbers of a bowed axis's pieces begin, and how many each has."""
N_NEWTON = 4
"""Steps to the foot of a point on a bowed axis: each squares the error, slopes are small."""


@njit(cache=True, nogil=True)
def offsets_of_curve(axis, t):
    """Return the offsets of a bowed axis from its chord, their first and second derivatives.

    Beyond its ends it goes on straight.

    Parameters
    ----------
    axis (17 + 10 n,) : see the module
    t : distance along the chord, metres
    """
    n = int(-axis[12])
    size = axis[13] / n
    k = min(max(math.floor(t / size), 0), n - 1)
    x = t - k * size
    c = FIRST + PER_PIECE * k
    low = min(max(x, 0.0), size)
    beyond = x - low
    u = axis[c] + low * (axis[c + 1] + low * (axis[c + 2] + low * axis[c + 3]))
    v = axis[c + 4] + low * (axis[c + 5] + low * (axis[c + 6] + low * axis[c + 7]))
    du = axis[c + 1] + low * (2.0 * axis[c + 2] + 3.0 * low * axis[c + 3])
    dv = axis[c + 5] + low * (2.0 * axis[c + 6] + 3.0 * low * axis[c + 7])
    ddu, ddv = (
        2.0 * axis[c + 2] + 6.0 * low * axis[c + 3],
        2.0 * axis[c + 6] + 6.0 * low * axis[c + 7],
    )
    if beyond != 0.0:
        u, v, ddu, ddv = u + beyond * du, v + beyond * dv, 0.0, 0.0
    return u, v, du, dv, ddu, ddv


@njit(cache=True, nogil=True)
def along_chord(axis, chainage):
    """Return the distance along the chord of a bowed axis at a chainage, metres.

    Parameters
    ----------
    axis (17 + 10 n,) : see the module
    chainage : metres
    """
    n = int(-axis[12])
    size = axis[13] / n
    k = min(max(math.floor(chainage / axis[16] * n), 0), n - 1)
    while k > 0 and chainage < axis[FIRST + PER_PIECE * k + 8]:
        k -= 1
    while k < n - 1 and chainage >= axis[FIRST + PER_PIECE * (k + 1) + 8]:
        k += 1
    c = FIRST + PER_PIECE * k
    return k * size + (chainage - axis[c + 8]) / axis[c + 9]


@njit(cache=True, nogil=True)
def frame_of_curve(axis, du, dv):
    """Return tangent, 12:00 and 3:00 of a bowed axis where its offsets have these slopes.

    Parameters
    ----------
    axis (17 + 10 n,) : see the module
    du, dv : slopes to 12:00 and 3:00 of the chord
    """
    size = math.sqrt(1.0 + du * du + dv * dv)
    tx = (axis[3] + du * axis[6] + dv * axis[9]) / size
    ty = (axis[4] + du * axis[7] + dv * axis[10]) / size
    tz = (axis[5] + du * axis[8] + dv * axis[11]) / size
    lean = du / size
    ux, uy, uz = axis[6] - lean * tx, axis[7] - lean * ty, axis[8] - lean * tz
    size = math.sqrt(ux * ux + uy * uy + uz * uz)
    ux, uy, uz = ux / size, uy / size, uz / size
    return tx, ty, tz, ux, uy, uz, ty * uz - tz * uy, tz * ux - tx * uz, tx * uy - ty * ux


@njit(cache=True, nogil=True)
def across_curve(axis, along, a, b):
    """Return distance along the chord, chainage, and offsets to 12:00 and 3:00 of a bowed axis.

    Parameters
    ----------
    axis (17 + 10 n,) : see the module
    along, a, b : place of a point along the chord and to its 12:00 and 3:00, metres
    """
    t = along
    for _ in range(N_NEWTON):
        u, v, du, dv, ddu, ddv = offsets_of_curve(axis, t)
        slope = 1.0 + du * du + dv * dv - (a - u) * ddu - (b - v) * ddv
        t += (along - t + (a - u) * du + (b - v) * dv) / max(slope, 0.2)
    n = int(-axis[12])
    size = axis[13] / n
    k = min(max(math.floor(t / size), 0), n - 1)
    c = FIRST + PER_PIECE * k
    chainage = axis[c + 8] + (t - k * size) * axis[c + 9]
    u, v, du, dv, _, _ = offsets_of_curve(axis, t)
    # The point as seen from the axis, in the frame of the chord: its tangent part is zero.
    p, q, w = along - t, a - u, b - v
    steep = math.sqrt(1.0 + du * du + dv * dv)
    lean = du / steep
    # 12:00 is that of the chord made perpendicular to the tangent (1, du, dv) / steep.
    m0, m1, m2 = -lean / steep, 1.0 - lean * du / steep, -lean * dv / steep
    size = math.sqrt(m0 * m0 + m1 * m1 + m2 * m2)
    m0, m1, m2 = m0 / size, m1 / size, m2 / size
    # 3:00 is tangent × 12:00.
    r0 = (du * m2 - dv * m1) / steep
    r1 = (dv * m0 - m2) / steep
    r2 = (m1 - du * m0) / steep
    return t, chainage, p * m0 + q * m1 + w * m2, p * r0 + q * r1 + w * r2


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
    if bend < 0.0:
        _, chainage, up, right = across_curve(axis, along, a, b)
        return chainage, up, right
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
    if bend < 0.0:
        t = along_chord(axis, chainage)
        u, v, _, _, _, _ = offsets_of_curve(axis, t)
        return (
            axis[0] + t * axis[3] + u * axis[6] + v * axis[9],
            axis[1] + t * axis[4] + u * axis[7] + v * axis[10],
            axis[2] + t * axis[5] + u * axis[8] + v * axis[11],
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
    if bend < 0.0:
        _, _, du, dv, _, _ = offsets_of_curve(axis, along_chord(axis, chainage))
        tx, ty, tz, _, _, _, _, _, _ = frame_of_curve(axis, du, dv)
        return tx, ty, tz
    cos, sin = math.cos(chainage / bend), math.sin(chainage / bend)
    # The normal of the arc times outward.
    return (
        cos * axis[9] - sin * axis[6],
        cos * axis[10] - sin * axis[7],
        cos * axis[11] - sin * axis[8],
    )
