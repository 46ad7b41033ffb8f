"""Ellipses that follow each other along one axis."""

import math

from numba import njit

from pipecore._kernels.disjoint_sets import unite


@njit(cache=True, nogil=True)
def do_follow(ellipses, i, j, limits):
    """Return whether two ellipses may be neighbours on one axis.

    Parameters
    ----------
    ellipses : AxisEllipses
    i, j : indices of the ellipses
    limits : PieceLimits
    """
    centre, axis = ellipses.centre, ellipses.axis
    radius, radius_sd = ellipses.radius, ellipses.radius_sd
    ax, ay, az = axis[i, 0], axis[i, 1], axis[i, 2]
    bx, by, bz = axis[j, 0], axis[j, 1], axis[j, 2]
    turn = ax * bx + ay * by + az * bz
    if not abs(turn) > limits.min_cos:
        return False
    smaller = min(radius[i], radius[j])
    slack = 2.0 * math.sqrt(radius_sd[i] * radius_sd[i] + radius_sd[j] * radius_sd[j])
    if not abs(radius[i] - radius[j]) < limits.max_change * smaller + slack:
        return False
    sign = 1.0 if turn > 0.0 else -1.0
    mx, my, mz = ax + sign * bx, ay + sign * by, az + sign * bz
    x = centre[j, 0] - centre[i, 0]
    y = centre[j, 1] - centre[i, 1]
    z = centre[j, 2] - centre[i, 2]
    along = (x * mx + y * my + z * mz) / math.sqrt(mx * mx + my * my + mz * mz)
    offset = math.sqrt(max(x * x + y * y + z * z - along * along, 0.0))
    return offset < limits.max_offset * smaller + slack


@njit(cache=True, nogil=True)
def unite_followers(pairs, members, ellipses, limits, parents):
    """Unite the ellipses of those pairs that may be neighbours on one axis.

    Parameters
    ----------
    pairs (k, 2) : rows of `members`
    members (m,) : indices of ellipses
    ellipses : AxisEllipses, n of them
    limits : PieceLimits
    parents (n,) : disjoint sets; changed
    """
    for row in range(pairs.shape[0]):
        i, j = members[pairs[row, 0]], members[pairs[row, 1]]
        if do_follow(ellipses, i, j, limits):
            unite(parents, i, j)
