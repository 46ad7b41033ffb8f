"""Cells of a deviation map, rows along the chainage and columns round the clock."""

import math

import numpy as np
from numba import njit

from pipecore._kernels.grouping import group_by_label


@njit(cache=True, nogil=True)
def group_medians(group, values, medians, counts):
    """Write the median and the number of the values of each group; nan where there are none."""
    members, starts = group_by_label(group, medians.shape[0])
    for k in range(medians.shape[0]):
        n = starts[k + 1] - starts[k]
        counts[k] = n
        if n == 0:
            medians[k] = math.nan
            continue
        own = np.empty(n)
        for i in range(n):
            own[i] = values[members[starts[k] + i]]
        own.sort()
        medians[k] = (own[(n - 1) // 2] + own[n // 2]) / 2.0


@njit(cache=True, nogil=True)
def interpolate(table, row_size, column_angle, chainage, clock, values):
    """Write a table's values at points, bilinear between the middles of cells, round the clock."""
    n_rows, n_columns = table.shape
    for i in range(chainage.shape[0]):
        row = min(max(chainage[i] / row_size - 0.5, 0.0), n_rows - 1.0)
        column = clock[i] / column_angle - 0.5
        r, c = min(int(row), n_rows - 2), math.floor(column)
        along, around = row - r, column - c
        left, right = c % n_columns, (c + 1) % n_columns
        near = table[r, left] * (1.0 - around) + table[r, right] * around
        far = table[r + 1, left] * (1.0 - around) + table[r + 1, right] * around
        values[i] = near * (1.0 - along) + far * along


@njit(cache=True, nogil=True)
def strongest(z, free):
    """Largest magnitude among free cells, and the first cell, counted in rows, that has it."""
    most, place = 0.0, 0
    for r in range(z.shape[0]):
        for c in range(z.shape[1]):
            if free[r, c] and abs(z[r, c]) > most:
                most, place = abs(z[r, c]), r * z.shape[1] + c
    return most, place
