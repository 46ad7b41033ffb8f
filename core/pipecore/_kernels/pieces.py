"""Straight and circular pieces of an axis, found among ellipse centres by random pairs."""

import math

import numpy as np
from numba import njit

from pipecore._kernels.ellipses import next_random


@njit(cache=True, nogil=True)
def draw(state, n):
    """Next random state, and an index below `n`."""
    state = next_random(state)
    return state, np.int64((state >> np.uint64(33)) % np.uint64(n))


@njit(cache=True, nogil=True)
def on_line(
    cx,
    cy,
    cz,
    ax,
    ay,
    az,
    r,
    sd,
    px,
    py,
    pz,
    dx,
    dy,
    dz,
    radius,
    slope,
    min_cos,
    max_offset,
    max_change,
):
    """Whether an ellipse fits a straight axis with a radius that is linear along it."""
    if abs(ax * dx + ay * dy + az * dz) < min_cos:
        return False
    qx, qy, qz = cx - px, cy - py, cz - pz
    s = qx * dx + qy * dy + qz * dz
    expected = radius + slope * s
    if not expected > 0.0 or abs(r - expected) > max_change * expected + 2.0 * sd:
        return False
    off2 = qx * qx + qy * qy + qz * qz - s * s
    limit = max_offset * expected + 2.0 * min(sd, 0.03 * expected)
    return off2 <= limit * limit


@njit(cache=True, nogil=True)
def best_line(
    centre, axis, radius, sd, free, n_trials, is_tapered, min_cos, max_offset, max_change, inliers
):
    """Find the straight piece with most ellipses. Writes the inliers, returns their number.

    With `is_tapered`, the radius changes along the piece as it does between the pair.
    """
    n = centre.shape[0]
    best = 0
    line = np.zeros(8)
    state = np.uint64(n) * np.uint64(2862933555777941757) + np.uint64(3037000493)
    for _ in range(n_trials):
        state, i = draw(state, n)
        if not free[i]:
            continue
        j, found = -1, False
        dx = dy = dz = length = 0.0
        for _ in range(20):
            state, j = draw(state, n)
            if j == i or not free[j]:
                continue
            dx, dy, dz = (
                centre[j, 0] - centre[i, 0],
                centre[j, 1] - centre[i, 1],
                centre[j, 2] - centre[i, 2],
            )
            length = math.sqrt(dx * dx + dy * dy + dz * dz)
            if 0.3 * radius[i] < length < 30.0 * radius[i]:
                found = True
                break
        if not found:
            continue
        dx, dy, dz = dx / length, dy / length, dz / length
        if is_tapered:
            start, slope = radius[i], (radius[j] - radius[i]) / length
            if abs(slope) < 0.04 or abs(slope) > 1.2:
                continue
        else:
            start, slope = 0.5 * (radius[i] + radius[j]), 0.0
            if abs(radius[i] - radius[j]) > max_change * start:
                continue
        count = 0
        for k in range(n):
            if free[k] and on_line(
                centre[k, 0],
                centre[k, 1],
                centre[k, 2],
                axis[k, 0],
                axis[k, 1],
                axis[k, 2],
                radius[k],
                sd[k],
                centre[i, 0],
                centre[i, 1],
                centre[i, 2],
                dx,
                dy,
                dz,
                start,
                slope,
                min_cos,
                max_offset,
                max_change,
            ):
                count += 1
        if count > best:
            best = count
            line[0], line[1], line[2] = centre[i, 0], centre[i, 1], centre[i, 2]
            line[3], line[4], line[5] = dx, dy, dz
            line[6], line[7] = start, slope
    if best == 0:
        return 0
    for k in range(n):
        inliers[k] = free[k] and on_line(
            centre[k, 0],
            centre[k, 1],
            centre[k, 2],
            axis[k, 0],
            axis[k, 1],
            axis[k, 2],
            radius[k],
            sd[k],
            line[0],
            line[1],
            line[2],
            line[3],
            line[4],
            line[5],
            line[6],
            line[7],
            min_cos,
            max_offset,
            max_change,
        )
    return best


@njit(cache=True, nogil=True)
def on_arc(
    cx,
    cy,
    cz,
    ax,
    ay,
    az,
    r,
    sd,
    ox,
    oy,
    oz,
    nx,
    ny,
    nz,
    bend,
    radius,
    min_cos,
    max_offset,
    max_change,
):
    """Whether an ellipse fits a circular axis of constant radius."""
    if abs(r - radius) > max_change * radius + 2.0 * sd:
        return False
    qx, qy, qz = cx - ox, cy - oy, cz - oz
    h = qx * nx + qy * ny + qz * nz
    rx, ry, rz = qx - h * nx, qy - h * ny, qz - h * nz
    rho = math.sqrt(rx * rx + ry * ry + rz * rz)
    limit = max_offset * radius + 2.0 * min(sd, 0.03 * radius)
    if (rho - bend) ** 2 + h * h > limit * limit or rho == 0.0:
        return False
    tx, ty, tz = ny * rz - nz * ry, nz * rx - nx * rz, nx * ry - ny * rx
    return abs(ax * tx + ay * ty + az * tz) >= min_cos * rho


@njit(cache=True, nogil=True)
def best_arc(
    centre, axis, radius, sd, free, n_trials, min_cos, max_offset, max_change, inliers, arc
):
    """Find the circular piece with most ellipses, from pairs of centres with their axes.

    Writes the inliers and the arc (centre, normal, bend radius); returns their number.
    """
    n = centre.shape[0]
    best = 0
    state = np.uint64(n) * np.uint64(2862933555777941757) + np.uint64(3037000493)
    for _ in range(n_trials):
        state, i = draw(state, n)
        state, j = draw(state, n)
        if i == j or not free[i] or not free[j]:
            continue
        r = 0.5 * (radius[i] + radius[j])
        if abs(radius[i] - radius[j]) > max_change * r:
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
        count = 0
        for k in range(n):
            if free[k] and on_arc(
                centre[k, 0],
                centre[k, 1],
                centre[k, 2],
                axis[k, 0],
                axis[k, 1],
                axis[k, 2],
                radius[k],
                sd[k],
                ox,
                oy,
                oz,
                nx,
                ny,
                nz,
                bend,
                r,
                min_cos,
                max_offset,
                max_change,
            ):
                count += 1
        if count > best:
            best = count
            arc[0], arc[1], arc[2] = ox, oy, oz
            arc[3], arc[4], arc[5] = nx, ny, nz
            arc[6], arc[7] = bend, r
    if best == 0:
        return 0
    for k in range(n):
        inliers[k] = free[k] and on_arc(
            centre[k, 0],
            centre[k, 1],
            centre[k, 2],
            axis[k, 0],
            axis[k, 1],
            axis[k, 2],
            radius[k],
            sd[k],
            arc[0],
            arc[1],
            arc[2],
            arc[3],
            arc[4],
            arc[5],
            arc[6],
            arc[7],
            min_cos,
            max_offset,
            max_change,
        )
    return best
