"""Cells of a deviation map, rows along the chainage and columns round the clock."""

import math

import numpy as np
from numba import njit

from pipecore._kernels.grouping import group_by_label

FEW = 16
"""So many values are sorted sooner than their median is selected."""


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
        if n > FEW:
            medians[k] = np.median(own)
        else:
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


@njit(cache=True, nogil=True)
def correlate(table, along, around, result):
    """Write a table's correlation with odd kernels along its rows' order and round the clock.

    Nothing lies beyond the ends.
    """
    n_rows, n_columns = table.shape
    half, turn = along.shape[0] // 2, around.shape[0] // 2
    wide = np.empty(n_columns + 2 * turn)
    middle = wide[turn : turn + n_columns]
    for r in range(n_rows):
        middle[:] = 0.0
        for k in range(max(-half, -r), min(half, n_rows - 1 - r) + 1):
            for c in range(n_columns):
                middle[c] += along[half + k] * table[r + k, c]
        for c in range(turn):
            wide[c] = middle[(c - turn) % n_columns]
            wide[turn + n_columns + c] = middle[c % n_columns]
        result[r, :] = 0.0
        for k in range(2 * turn + 1):
            for c in range(n_columns):
                result[r, c] += around[k] * wide[c + k]


@njit(cache=True, nogil=True)
def score(height, precision, is_told, contour_sd, allowed, z):
    """Turn what a filter gathered into heights, and write them in units of their noise.

    Returns how wide these scatter over the cells where they are told and allowed, 1 where
    these are few; z is 0 where nothing is told.
    """
    quiet, n = np.empty(z.size), 0
    for r in range(z.shape[0]):
        for c in range(z.shape[1]):
            height[r, c] /= precision[r, c]
            z[r, c] = 0.0
            if is_told[r, c]:
                z[r, c] = height[r, c] / math.sqrt(1.0 / precision[r, c] + contour_sd[r, c] ** 2)
                if allowed[r, c]:
                    quiet[n] = abs(z[r, c])
                    n += 1
    return 1.4826 * np.median(quiet[:n]) if n > 20 else 1.0
