"""What the rows of points along an axis show: medians, sectors seen, turning of the normals."""

import math

import numpy as np
from numba import njit

from pipecore._kernels.grouping import group_by_label


@njit(cache=True, nogil=True)
def upper_medians(values, group, medians):
    """Write the (upper) median of the values of each group, infinite where there are none."""
    members, starts = group_by_label(group, medians.shape[0])
    ordered = values[members]
    for k in range(medians.shape[0]):
        a, b = starts[k], starts[k + 1]
        middle = (b - a) // 2
        medians[k] = np.partition(ordered[a:b], middle)[middle] if b > a else math.inf


@njit(cache=True, nogil=True)
def mark_sectors(group, clock, seen):
    """Mark the sectors around the axis in which each group (n_groups, n_sectors) has points."""
    n_sectors = seen.shape[1]
    seen[:, :] = False
    for i in range(group.shape[0]):
        k = group[i]
        if 0 <= k < seen.shape[0]:
            seen[k, int(clock[i] / (2.0 * math.pi) * n_sectors) % n_sectors] = True


@njit(cache=True, nogil=True)
def turn_of_normals(clock, lean, group, turning):
    """Write how much the normals of each group turn with the clock: slope of lean, plus one."""
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
        moments[k, 1] += lean[i]
        moments[k, 2] += x * x
        moments[k, 3] += x * lean[i]
    for k in range(n_groups):
        n = sums[k, 2]
        turning[k] = 0.0
        if n > 0.0:
            spread = moments[k, 2] - moments[k, 0] * moments[k, 0] / n
            if spread > 1e-12 * moments[k, 2]:
                together = moments[k, 3] - moments[k, 0] * moments[k, 1] / n
                turning[k] = 1.0 + together / spread
