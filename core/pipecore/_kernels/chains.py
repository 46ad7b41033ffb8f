"""Ellipses that follow each other along one axis."""

import math

from numba import njit

from pipecore._kernels.profiles import unite


@njit(cache=True, nogil=True)
def do_follow(i, j, centre, axis, radius, radius_sd, cos_turn, radius_change, max_offset):
    """Whether two ellipses may be neighbours on one axis."""
    ax, ay, az = axis[i, 0], axis[i, 1], axis[i, 2]
    bx, by, bz = axis[j, 0], axis[j, 1], axis[j, 2]
    turn = ax * bx + ay * by + az * bz
    if not abs(turn) > cos_turn:
        return False
    smaller = min(radius[i], radius[j])
    slack = 2.0 * math.sqrt(radius_sd[i] * radius_sd[i] + radius_sd[j] * radius_sd[j])
    if not abs(radius[i] - radius[j]) < radius_change * smaller + slack:
        return False
    sign = 1.0 if turn > 0.0 else -1.0
    mx, my, mz = ax + sign * bx, ay + sign * by, az + sign * bz
    x = centre[j, 0] - centre[i, 0]
    y = centre[j, 1] - centre[i, 1]
    z = centre[j, 2] - centre[i, 2]
    along = (x * mx + y * my + z * mz) / math.sqrt(mx * mx + my * my + mz * mz)
    offset = math.sqrt(max(x * x + y * y + z * z - along * along, 0.0))
    return offset < max_offset * smaller + slack


@njit(cache=True, nogil=True)
def unite_followers(
    pairs, members, centre, axis, radius, radius_sd, cos_turn, radius_change, max_offset, parents
):
    """Unite the ellipses of those pairs that may be neighbours; pairs are rows of `members`."""
    for row in range(pairs.shape[0]):
        i, j = members[pairs[row, 0]], members[pairs[row, 1]]
        if do_follow(i, j, centre, axis, radius, radius_sd, cos_turn, radius_change, max_offset):
            unite(parents, i, j)
