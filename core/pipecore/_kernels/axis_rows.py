"""What the rows of points along an axis show: medians, sectors seen, turning of the normals."""

import math

import numpy as np
from numba import njit

from pipecore._kernels.grouping import group_by_label
from pipecore._kernels.linear import solve_in_place

OVAL_SECTORS = 36
"""Sectors around the axis whose means define an oval section."""


@njit(cache=True, nogil=True)
def upper_medians(values, group, medians):
    """Write the upper median of the values of each group, infinite for empty groups.

    Parameters
    ----------
    values (n,) : any unit
    group (n,) : group of each value
    medians (m,) : filled
    """
    members, starts = group_by_label(group, medians.shape[0])
    ordered = values[members]
    for k in range(medians.shape[0]):
        a, b = starts[k], starts[k + 1]
        middle = (b - a) // 2
        medians[k] = np.partition(ordered[a:b], middle)[middle] if b > a else math.inf


@njit(cache=True, nogil=True)
def rows_of(chainage, base, step):
    """Return the step of axis that each point lies in.

    Parameters
    ----------
    chainage (n,) : metres
    base : chainage where step 0 begins, metres
    step : length of a step, metres
    """
    row = np.empty(chainage.shape[0], np.int64)
    for i in range(chainage.shape[0]):
        row[i] = math.floor((chainage[i] - base) / step)
    return row


@njit(cache=True, nogil=True)
def mark_sectors(group, clock, seen):
    """Mark the sectors around the axis in which each group has points.

    Parameters
    ----------
    group (n,) : group of each point; points of others are left out
    clock (n,) : clock angles, radians
    seen (groups, sectors) : filled
    """
    n_sectors = seen.shape[1]
    seen[:, :] = False
    for i in range(group.shape[0]):
        k = group[i]
        if 0 <= k < seen.shape[0]:
            seen[k, int(clock[i] / (2.0 * math.pi) * n_sectors) % n_sectors] = True


@njit(cache=True, nogil=True)
def normal_turning(clock, normal_angle, group, turning):
    """Write how much the normals of each group turn with the clock: 1 on a pipe, 0 on a plane.

    It is one plus the slope of the normals' angle against the clock angle, by least squares.

    Parameters
    ----------
    clock (n,) : clock angles, radians
    normal_angle (n,) : angle from the surface's normal to the point's, radians
    group (n,) : group of each point
    turning (m,) : filled; 0 for groups of a single clock angle
    """
    n_groups = turning.shape[0]
    sums = np.zeros((n_groups, 3))
    for i in range(clock.shape[0]):
        sums[group[i], 0] += math.cos(clock[i])
        sums[group[i], 1] += math.sin(clock[i])
        sums[group[i], 2] += 1.0
    middle = np.empty(n_groups)
    for k in range(n_groups):
        middle[k] = math.atan2(sums[k, 1], sums[k, 0])
    # Σx, Σy, Σxx, Σxy with x around the middle.
    moments = np.zeros((n_groups, 4))
    for i in range(clock.shape[0]):
        k = group[i]
        x = (clock[i] - middle[k] + math.pi) % (2.0 * math.pi) - math.pi
        moments[k, 0] += x
        moments[k, 1] += normal_angle[i]
        moments[k, 2] += x * x
        moments[k, 3] += x * normal_angle[i]
    for k in range(n_groups):
        n = sums[k, 2]
        turning[k] = 0.0
        if n > 0.0:
            spread = moments[k, 2] - moments[k, 0] * moments[k, 0] / n
            if spread > 1e-12 * moments[k, 2]:
                together = moments[k, 3] - moments[k, 0] * moments[k, 1] / n
                turning[k] = 1.0 + together / spread


@njit(cache=True, nogil=True)
def off_oval(clock, residual, row, n_rows, n_sectors, min_arc, max_amplitude):
    """Return the distances of points from the oval section of their row.

    An oval is the second harmonic of the means of the sectors of three rows. Where they show
    too short an arc, or the harmonic is too large, distances are those from the circle.

    Parameters
    ----------
    clock (n,) : clock angles, radians
    residual (n,) : distances from the circle, metres
    row (n,) : row of each point
    n_rows, n_sectors : numbers of rows, and of sectors around the axis
    min_arc : least arc, radians
    max_amplitude : largest amplitude of the second harmonic, metres
    """
    count, total = np.zeros((n_rows, n_sectors)), np.zeros((n_rows, n_sectors))
    for i in range(clock.shape[0]):
        k = int(clock[i] / (2.0 * math.pi) * n_sectors) % n_sectors
        count[row[i], k] += 1.0
        total[row[i], k] += residual[i]
    terms = np.empty((n_sectors, 5))
    for k in range(n_sectors):
        angle = (k + 0.5) * (2.0 * math.pi / n_sectors)
        terms[k, 0] = 1.0
        terms[k, 1], terms[k, 2] = math.cos(angle), math.sin(angle)
        terms[k, 3], terms[k, 4] = math.cos(2.0 * angle), math.sin(2.0 * angle)
    second = np.zeros((n_rows, 2))
    normal, right = np.empty((5, 5)), np.empty(5)
    for r in range(n_rows):
        normal[:, :] = 0.0
        right[:] = 0.0
        n_seen = 0
        for k in range(n_sectors):
            n, mean = 0.0, 0.0
            for near in (max(r - 1, 0), r, min(r + 1, n_rows - 1)):
                n += count[near, k]
                mean += total[near, k]
            if n == 0.0:
                continue
            n_seen += 1
            mean /= n
            for a in range(5):
                right[a] += terms[k, a] * mean
                for b in range(a + 1):
                    normal[a, b] += terms[k, a] * terms[k, b]
        if n_seen * (2.0 * math.pi / n_sectors) <= min_arc:
            continue
        for a in range(5):
            normal[a, a] += 1e-6
        solve_in_place(normal, right)
        if math.hypot(right[3], right[4]) < max_amplitude:
            second[r, 0], second[r, 1] = right[3], right[4]
    off = np.empty(clock.shape[0])
    for i in range(clock.shape[0]):
        cos, sin = math.cos(2.0 * clock[i]), math.sin(2.0 * clock[i])
        off[i] = abs(residual[i] - second[row[i], 0] * cos - second[row[i], 1] * sin)
    return off


@njit(cache=True, nogil=True)
def cover_rows(
    chainage, clock, residual, normal_angle, length, radius, base, step, n_sectors, limits
):
    """Find the steps of an axis that are covered by points on its surface.

    See `pipecore.elements.refinement.extent.find_extent`.

    Parameters
    ----------
    chainage, clock, residual, normal_angle (n,) : metres, radians, metres and radians
    length, radius : of the proposed element, metres
    base, step : chainage where step 0 begins, and length of a step, metres
    n_sectors : number of sectors around the axis
    limits (8) : least arc, fraction of the usual one; arc that is enough, radians; fraction of
      the usual arc that is enough; largest median distance, metres; least arc of an oval,
      radians; its largest amplitude in radii; largest fraction of the distance that it leaves;
      least turning of normals

    Returns
    -------
    Arc of each step (radians), the covered steps, and how many of them lie within the length.
    """
    share, enough, share_enough, max_off, oval_arc, max_oval, oval_share, min_turning = limits
    row = rows_of(chainage, base, step)
    n_rows = row.max() + 1
    seen = np.empty((n_rows, n_sectors), np.bool_)
    mark_sectors(row, clock, seen)
    arc, in_core = np.zeros(n_rows), np.zeros(n_rows, np.bool_)
    for k in range(n_rows):
        for m in range(n_sectors):
            arc[k] += seen[k, m]
        arc[k] *= 2.0 * math.pi / n_sectors
        in_core[k] = 0.0 < base + (k + 0.5) * step < length
    covered = np.empty(n_rows, np.int64)
    if not in_core.any():
        return arc, covered[:0], 0
    usual_arc = np.quantile(arc[in_core], 0.75)
    off = np.empty(n_rows)
    upper_medians(np.abs(residual), row, off)
    if np.any((off >= max_off) & (arc > oval_arc)):
        # An oval stretch of a pipe is off the circle, and still the pipe.
        of_oval = np.empty(n_rows)
        from_oval = off_oval(
            clock, residual, row, n_rows, OVAL_SECTORS, oval_arc, max_oval * radius
        )
        upper_medians(from_oval, row, of_oval)
        for k in range(n_rows):
            if of_oval[k] < oval_share * off[k]:
                off[k] = of_oval[k]
    turning = np.empty(n_rows)
    normal_turning(clock, normal_angle, row, turning)
    least_arc = max(share * usual_arc, min(enough, share_enough * usual_arc))
    n = n_core = 0
    for k in range(n_rows):
        if arc[k] >= least_arc and off[k] < max_off and turning[k] > min_turning:
            covered[n] = k
            n += 1
            n_core += in_core[k]
    return arc, covered[:n], n_core


@njit(cache=True, nogil=True)
def arcs_in_gaps(chainage, clock, base, step, covered, n_sectors):
    """Return the arc that points show between each covered step and the next one, radians.

    Parameters
    ----------
    chainage, clock (n,) : of points inside the surface, metres and radians
    base, step : chainage where step 0 begins, and length of a step, metres
    covered (c,) : covered steps, ascending
    n_sectors : number of sectors around the axis
    """
    first, n_rows = covered[0], covered[-1] + 1 - covered[0]
    seen = np.empty((n_rows, n_sectors), np.bool_)
    mark_sectors(rows_of(chainage, base, step) - first, clock, seen)
    arcs = np.zeros(covered.shape[0] - 1)
    for k in range(covered.shape[0] - 1):
        for m in range(n_sectors):
            for r in range(covered[k] + 1 - first, covered[k + 1] - first):
                if seen[r, m]:
                    arcs[k] += 2.0 * math.pi / n_sectors
                    break
    return arcs


@njit(cache=True, nogil=True)
def best_part(covered, arcs_inside, base, step, length, longest_gap, most_arc):
    """Find the unbroken part with most covered steps within the proposed length.

    Parameters
    ----------
    covered (c,) : covered steps, ascending
    arcs_inside (c - 1,) : arcs that show inside the surface between them, radians
    base, step : chainage where step 0 begins, and length of a step, metres
    length : of the proposed element, metres
    longest_gap : a longer gap ends a part, metres
    most_arc : a gap in which more arc shows inside the surface ends a part, radians

    Returns
    -------
    First and last index in `covered`.
    """
    n = covered.shape[0]
    best, first, last, start, inside = -1, 0, 0, 0, 0
    for k in range(n):
        inside += 0.0 < base + (covered[k] + 0.5) * step < length
        is_end = k == n - 1 or (
            (covered[k + 1] - covered[k]) * step > longest_gap or arcs_inside[k] > most_arc
        )
        if is_end:
            if inside > best:
                best, first, last = inside, start, k
            start, inside = k + 1, 0
    return first, last


@njit(cache=True, nogil=True)
def bounds_of(chainage, base, step, first, last):
    """Return the least chainage of one step's points and the largest of another's, metres.

    Parameters
    ----------
    chainage (n,) : metres
    base, step : chainage where step 0 begins, and length of a step, metres
    first, last : the two steps
    """
    low, high = math.inf, -math.inf
    for c in chainage:
        k = math.floor((c - base) / step)
        if k == first:
            low = min(low, c)
        if k == last:
            high = max(high, c)
    return low, high


@njit(cache=True, nogil=True)
def points_between(inliers, chainage, clock, residual, low, high, end_margin, min_points):
    """Select the points within an extent, and those away from its ends.

    Parameters
    ----------
    inliers (n,) : indices of points on the surface
    chainage, clock, residual (n,) : metres, radians, metres
    low, high : the extent, metres
    end_margin : distance from the ends, metres
    min_points : all are taken where no more than this are away from the ends

    Returns
    -------
    Indices, clock and residual of the points within, and indices of those away from the ends.
    """
    n_most = inliers.shape[0]
    index, core = np.empty(n_most, inliers.dtype), np.empty(n_most, inliers.dtype)
    clocks, residuals = np.empty(n_most), np.empty(n_most)
    n = n_core = 0
    for i in range(n_most):
        if low <= chainage[i] <= high:
            index[n], clocks[n], residuals[n] = inliers[i], clock[i], residual[i]
            n += 1
            if low + end_margin <= chainage[i] <= high - end_margin:
                core[n_core] = inliers[i]
                n_core += 1
    chosen = core[:n_core] if n_core > min_points else index[:n]
    return index[:n], clocks[:n], residuals[:n], chosen
