"""Circular pieces of an axis, found among ellipse centres by random pairs."""

import math

import numpy as np
from numba import njit

from pipecore._kernels.random_draws import draw, seeded


@njit(cache=True, nogil=True)
def on_arc(ellipses, k, arc, limits):
    """Return whether an ellipse fits a circular axis of constant radius.

    Parameters
    ----------
    ellipses : AxisEllipses
    k : index of the ellipse
    arc (8,) : centre, unit normal, bend radius and pipe radius, metres
    limits : PieceLimits
    """
    axis, centre, sd = ellipses.axis, ellipses.centre, ellipses.radius_sd[k]
    nx, ny, nz, bend, radius = arc[3], arc[4], arc[5], arc[6], arc[7]
    if abs(ellipses.radius[k] - radius) > limits.max_change * radius + 2.0 * sd:
        return False
    qx, qy, qz = centre[k, 0] - arc[0], centre[k, 1] - arc[1], centre[k, 2] - arc[2]
    h = qx * nx + qy * ny + qz * nz
    rx, ry, rz = qx - h * nx, qy - h * ny, qz - h * nz
    rho = math.sqrt(rx * rx + ry * ry + rz * rz)
    limit = limits.max_offset * radius + 2.0 * min(sd, 0.03 * radius)
    if (rho - bend) ** 2 + h * h > limit * limit or rho == 0.0:
        return False
    tx, ty, tz = ny * rz - nz * ry, nz * rx - nx * rz, nx * ry - ny * rx
    along = abs(axis[k, 0] * tx + axis[k, 1] * ty + axis[k, 2] * tz)
    return along >= limits.min_cos * rho


@njit(cache=True, nogil=True)
def best_arc(ellipses, free, n_trials, limits, inliers, arc):
    """Find the circular piece with most ellipses, from pairs of centres with their axes.

    Two ellipses with their axes define an arc; the pairs are drawn at random, always the same.

    Parameters
    ----------
    ellipses : AxisEllipses, n of them
    free (n,) : ellipses that may be used
    n_trials : number of pairs
    limits : PieceLimits
    inliers (n,) : filled with which ellipses fit the arc
    arc (8,) : filled with centre, unit normal, bend radius and pipe radius, metres

    Returns
    -------
    Number of inliers, 0 where no pair defines an arc.
    """
    centre, axis, radius = ellipses.centre, ellipses.axis, ellipses.radius
    n = centre.shape[0]
    trial = np.empty(8)
    best = 0
    state = seeded(n)
    for _ in range(n_trials):
        state, i = draw(state, n)
        state, j = draw(state, n)
        if i == j or not free[i] or not free[j]:
            continue
        r = 0.5 * (radius[i] + radius[j])
        if abs(radius[i] - radius[j]) > limits.max_change * r:
            continue
        wx, wy, wz = (
            centre[j, 0] - centre[i, 0],
            centre[j, 1] - centre[i, 1],
            centre[j, 2] - centre[i, 2],
        )
        if wx * wx + wy * wy + wz * wz > (16.0 * r) ** 2:
            continue
        # Both tangents point from i towards j.
        si = 1.0 if axis[i, 0] * wx + axis[i, 1] * wy + axis[i, 2] * wz > 0.0 else -1.0
        sj = 1.0 if axis[j, 0] * wx + axis[j, 1] * wy + axis[j, 2] * wz > 0.0 else -1.0
        tx, ty, tz = si * axis[i, 0], si * axis[i, 1], si * axis[i, 2]
        sx, sy, sz = sj * axis[j, 0], sj * axis[j, 1], sj * axis[j, 2]
        nx, ny, nz = ty * sz - tz * sy, tz * sx - tx * sz, tx * sy - ty * sx
        sin = math.sqrt(nx * nx + ny * ny + nz * nz)
        if sin < 0.3:
            continue
        nx, ny, nz = nx / sin, ny / sin, nz / sin
        # Unit vectors towards the centre, n × t at either end.
        ux, uy, uz = ny * tz - nz * ty, nz * tx - nx * tz, nx * ty - ny * tx
        vx, vy, vz = ny * sz - nz * sy, nz * sx - nx * sz, nx * sy - ny * sx
        ex, ey, ez = ux - vx, uy - vy, uz - vz
        bend = (wx * ex + wy * ey + wz * ez) / (ex * ex + ey * ey + ez * ez)
        if not 1.02 * r < bend < 12.0 * r:
            continue
        ox, oy, oz = centre[i, 0] + bend * ux, centre[i, 1] + bend * uy, centre[i, 2] + bend * uz
        trial[0], trial[1], trial[2] = ox, oy, oz
        trial[3], trial[4], trial[5] = nx, ny, nz
        trial[6], trial[7] = bend, r
        count = 0
        for k in range(n):
            if free[k] and on_arc(ellipses, k, trial, limits):
                count += 1
        if count > best:
            best = count
            arc[:] = trial
    if best == 0:
        return 0
    for k in range(n):
        inliers[k] = free[k] and on_arc(ellipses, k, arc, limits)
    return best
