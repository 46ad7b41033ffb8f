"""Straight pieces of an axis, found among ellipse centres by random pairs."""

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pipecore._kernels.eigen import eigenvalues, eigenvector
from pipecore._kernels.random_draws import draw, seeded

Array = NDArray[np.float64]

N_LINE_COLUMNS = 10
"""Columns of a line: middle x, y, z; direction x, y, z; radius there, slope; low, high."""


class AxisEllipses(NamedTuple):
    """Ellipses as points of an axis: n of them, metres.

    centre, axis (n, 3): centres, and unit vectors along the pipe, of either sign;
    radius, radius_sd (n,): radii and their standard deviations.
    """

    centre: Array
    axis: Array
    radius: Array
    radius_sd: Array


class PieceLimits(NamedTuple):
    """What ellipses of one piece of an axis have in common.

    min_cos: least cosine between an ellipse's axis and the piece's;
    max_offset: largest distance of a centre from the axis, fraction of the radius;
    max_change: largest change of radius from the piece's, fraction of it;
    same_radius: the same once the piece is fitted;
    min_taper: least change of radius per metre of a tapered piece;
    min_length: least length, radii;
    min_ellipses: least number of ellipses.
    """

    min_cos: float
    max_offset: float
    max_change: float
    same_radius: float = 0.025
    min_taper: float = 0.04
    min_length: float = 0.5
    min_ellipses: int = 5


@njit(cache=True, nogil=True)
def on_line(ellipses, k, line, limits):
    """Return whether an ellipse fits a straight axis with a radius that is linear along it.

    Parameters
    ----------
    ellipses : AxisEllipses
    k : index of the ellipse
    line (8 or more,) : point, unit direction, radius there, metres, and slope of the radius
    limits : PieceLimits
    """
    dx, dy, dz = line[3], line[4], line[5]
    axis, centre, sd = ellipses.axis, ellipses.centre, ellipses.radius_sd[k]
    if abs(axis[k, 0] * dx + axis[k, 1] * dy + axis[k, 2] * dz) < limits.min_cos:
        return False
    qx, qy, qz = centre[k, 0] - line[0], centre[k, 1] - line[1], centre[k, 2] - line[2]
    s = qx * dx + qy * dy + qz * dz
    expected = line[6] + line[7] * s
    change = abs(ellipses.radius[k] - expected)
    if not expected > 0.0 or change > limits.max_change * expected + 2.0 * sd:
        return False
    off2 = qx * qx + qy * qy + qz * qz - s * s
    limit = limits.max_offset * expected + 2.0 * min(sd, 0.03 * expected)
    return off2 <= limit * limit


@njit(cache=True, nogil=True)
def best_line(ellipses, free, n_trials, is_tapered, limits, inliers):
    """Find the straight piece with most ellipses, from pairs of centres.

    The pairs are drawn at random, always the same.

    Parameters
    ----------
    ellipses : AxisEllipses, n of them
    free (n,) : ellipses that may be used
    n_trials : number of pairs
    is_tapered : whether the radius changes along the piece as between the pair
    limits : PieceLimits
    inliers (n,) : filled

    Returns
    -------
    Number of inliers, 0 where no pair defines a piece.
    """
    centre, radius = ellipses.centre, ellipses.radius
    n = centre.shape[0]
    best = 0
    line, trial = np.zeros(8), np.empty(8)
    state = seeded(n)
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
            if abs(radius[i] - radius[j]) > limits.max_change * start:
                continue
        trial[0], trial[1], trial[2] = centre[i, 0], centre[i, 1], centre[i, 2]
        trial[3], trial[4], trial[5] = dx, dy, dz
        trial[6], trial[7] = start, slope
        count = 0
        for k in range(n):
            if free[k] and on_line(ellipses, k, trial, limits):
                count += 1
        if count > best:
            best = count
            line[:] = trial
    if best == 0:
        return 0
    for k in range(n):
        inliers[k] = free[k] and on_line(ellipses, k, line, limits)
    return best


@njit(cache=True, nogil=True)
def weight_of(sd):
    """Return the weight of an ellipse in the fit of an axis, 1/metres².

    Parameters
    ----------
    sd : standard deviation of its radius, metres
    """
    return 1.0 / (sd**2 + 1e-8)


@njit(cache=True, nogil=True)
def weighted_median(values, weights):
    """Return the value below which half of the weights are.

    Parameters
    ----------
    values, weights (n,) : n > 0
    """
    order = np.argsort(values)
    below, half = 0.0, 0.5 * weights.sum()
    for k in order:
        below += weights[k]
        if below >= half:
            return values[k]
    return values[order[-1]]


@njit(cache=True, nogil=True)
def fit_line(ellipses, chosen, is_tapered, line, along):
    """Fit a line to chosen centres, weighted by their precision, and the radius along it.

    Parameters
    ----------
    ellipses : AxisEllipses
    chosen (m,) : indices of ellipses
    is_tapered : whether the radius changes along the line
    line (N_LINE_COLUMNS,) : first eight columns filled
    along (m,) : filled with the chainage of each from the middle, metres
    """
    centre, radius, sd = ellipses.centre, ellipses.radius, ellipses.radius_sd
    n = chosen.shape[0]
    weights, total, mx, my, mz = np.empty(n), 0.0, 0.0, 0.0, 0.0
    for m in range(n):
        k = chosen[m]
        w = weight_of(sd[k])
        weights[m], total = w, total + w
        mx, my, mz = mx + w * centre[k, 0], my + w * centre[k, 1], mz + w * centre[k, 2]
    mx, my, mz = mx / total, my / total, mz / total
    xx = xy = xz = yy = yz = zz = 0.0
    for m in range(n):
        k, w = chosen[m], weights[m] / total
        x, y, z = centre[k, 0] - mx, centre[k, 1] - my, centre[k, 2] - mz
        xx, xy, xz = xx + w * x * x, xy + w * x * y, xz + w * x * z
        yy, yz, zz = yy + w * y * y, yz + w * y * z, zz + w * z * z
    _, _, largest = eigenvalues(xx, xy, xz, yy, yz, zz)
    dx, dy, dz = eigenvector(xx, xy, xz, yy, yz, zz, largest)
    mean_s = mean_r = 0.0
    radii = np.empty(n)
    for m in range(n):
        k = chosen[m]
        x, y, z = centre[k, 0] - mx, centre[k, 1] - my, centre[k, 2] - mz
        along[m], radii[m] = x * dx + y * dy + z * dz, radius[k]
        mean_s, mean_r = mean_s + weights[m] * along[m], mean_r + weights[m] * radii[m]
    line[0], line[1], line[2], line[3], line[4], line[5] = mx, my, mz, dx, dy, dz
    if not is_tapered:
        line[6], line[7] = weighted_median(radii, weights), 0.0
        return
    mean_s, mean_r = mean_s / total, mean_r / total
    rise = run = 0.0
    for m in range(n):
        s = along[m] - mean_s
        rise, run = rise + weights[m] * s * (radii[m] - mean_r), run + weights[m] * s * s
    line[6], line[7] = mean_r - rise / run * mean_s, rise / run


@njit(cache=True, nogil=True)
def taper_of(ellipses, chosen, along):
    """Return the change of the radius along an axis, and its standard deviation.

    Parameters
    ----------
    ellipses : AxisEllipses
    chosen (m,) : indices of ellipses
    along (m,) : their chainages, metres
    """
    radius, sd = ellipses.radius, ellipses.radius_sd
    n = chosen.shape[0]
    total = mean_s = mean_r = 0.0
    for m in range(n):
        w = weight_of(sd[chosen[m]])
        total, mean_s, mean_r = total + w, mean_s + w * along[m], mean_r + w * radius[chosen[m]]
    mean_s, mean_r = mean_s / total, mean_r / total
    rise = run = square = 0.0
    for m in range(n):
        w, s, r = weight_of(sd[chosen[m]]), along[m] - mean_s, radius[chosen[m]] - mean_r
        rise, run, square = rise + w * s * r, run + w * s * s, square + w * r * r
    taper = rise / run
    left = max(square - taper * rise, 0.0)
    return taper, math.sqrt(left / max(n - 2, 1) / run)


@njit(cache=True, nogil=True)
def longest_part(along, max_gap):
    """Return the indices of the part with most entries that has no wide gap, ascending in chainage.

    Parameters
    ----------
    along (n,) : chainages, metres
    max_gap : widest gap, metres
    """
    order = np.argsort(along)
    first = best_first = best_last = 0
    for k in range(1, order.shape[0] + 1):
        if k == order.shape[0] or along[order[k]] - along[order[k - 1]] > max_gap:
            if k - first > best_last - best_first:
                best_first, best_last = first, k
            first = k
    return order[best_first:best_last]


@njit(cache=True, nogil=True)
def take_lines(ellipses, n_trials, is_tapered, limits, width, piece):
    """Take straight pieces off ellipses, best first.

    Parameters
    ----------
    ellipses : AxisEllipses, n of them
    n_trials : random pairs tried for each piece
    is_tapered : whether the radius changes along the pieces
    limits : PieceLimits
    width : usual width of the profiles, metres
    piece (n,) : filled with the number of each ellipse's piece, -1 for none

    Returns
    -------
    Pieces (k, N_LINE_COLUMNS).
    """
    radius, sd, min_ellipses = ellipses.radius, ellipses.radius_sd, limits.min_ellipses
    n = radius.shape[0]
    free, inliers = np.ones(n, np.bool_), np.empty(n, np.bool_)
    lines = np.empty((n // min_ellipses + 1, N_LINE_COLUMNS))
    piece[:] = -1
    n_free, n_found, n_failed = n, 0, 0
    while n_free >= min_ellipses and n_failed < 3:
        count = best_line(ellipses, free, n_trials, is_tapered, limits, inliers)
        if count < min_ellipses:
            break
        drawn = np.flatnonzero(inliers)
        line, along = lines[n_found], np.empty(count)
        fit_line(ellipses, drawn, is_tapered, line, along)
        # The pair's radius was rough: what is off the piece's own pattern stays free.
        chosen, n_fit = np.empty(count, np.int64), 0
        for m in range(count):
            k, expected = drawn[m], line[6] + line[7] * along[m]
            if abs(radius[k] - expected) < limits.same_radius * expected + 2.0 * sd[k]:
                chosen[n_fit], along[n_fit] = k, along[m]
                n_fit += 1
        chosen, along = chosen[:n_fit], along[:n_fit]
        length = 0.0
        if n_fit >= min_ellipses:
            part = longest_part(along, max(8.0 * width, 3.0 * line[6]))
            length = along[part[-1]] - along[part[0]]
            chosen, along = np.sort(chosen[part]), along[part]
        given_up = chosen if n_fit > 0 else drawn
        for k in given_up:
            free[k] = False
        n_free -= given_up.shape[0]
        if chosen.shape[0] < min_ellipses or length < max(limits.min_length * line[6], 2.5 * width):
            n_failed += 1
            continue
        fit_line(ellipses, chosen, is_tapered, line, along)
        taper, taper_sd = taper_of(ellipses, chosen, along)
        if is_tapered != (abs(taper) > max(limits.min_taper, 6.0 * taper_sd)):
            continue
        line[8], line[9] = along.min() - 0.5 * width, along.max() + 0.5 * width
        for k in chosen:
            piece[k] = n_found
        n_found += 1
    return lines[:n_found]
