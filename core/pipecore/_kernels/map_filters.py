"""Cells of a deviation map, rows along the chainage and columns round the clock."""

import math

import numpy as np
from numba import njit

from pipecore._kernels.grouping import group_by_label
from pipecore.robust import MAD_TO_SD

MAX_SORTED = 16
"""Up to as many values are sorted sooner than their median is selected."""


@njit(cache=True, nogil=True)
def group_medians(group, values, medians, counts):
    """Write the median and the number of the values of each group; nan for empty groups.

    Parameters
    ----------
    group (n,) : group of each value
    values (n,) : any unit
    medians, counts (m,) : filled
    """
    members, starts = group_by_label(group, medians.shape[0])
    for k in range(medians.shape[0]):
        n = starts[k + 1] - starts[k]
        counts[k] = n
        if n == 0:
            medians[k] = math.nan
            continue
        sample = np.empty(n)
        for i in range(n):
            sample[i] = values[members[starts[k] + i]]
        if n > MAX_SORTED:
            medians[k] = np.median(sample)
        else:
            sample.sort()
            medians[k] = (sample[(n - 1) // 2] + sample[n // 2]) / 2.0


@njit(cache=True, nogil=True)
def interpolate(table, row_size, column_angle, chainage, clock, values):
    """Write a table's values at points, bilinear between the middles of cells, round the clock.

    Parameters
    ----------
    table (rows, columns) : any unit
    row_size : length of a cell, metres
    column_angle : of a cell, radians
    chainage, clock (n,) : metres and radians
    values (n,) : filled
    """
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
    """Return the largest magnitude among free cells, and the first cell that has it.

    Parameters
    ----------
    z (rows, columns) : any unit
    free (rows, columns) : cells that count

    Returns
    -------
    Magnitude and flat index, 0 and 0 where there is none.
    """
    most, place = 0.0, 0
    for r in range(z.shape[0]):
        for c in range(z.shape[1]):
            if free[r, c] and abs(z[r, c]) > most:
                most, place = abs(z[r, c]), r * z.shape[1] + c
    return most, place


@njit(cache=True, nogil=True)
def correlate(table, along, around, result):
    """Write a table's correlation with odd kernels along its rows and round the clock.

    Nothing lies beyond the ends.

    Parameters
    ----------
    table (rows, columns) : any unit
    along (k,), around (m,) : kernels of odd length; m may not exceed twice the columns
    result (rows, columns) : filled
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
def score(height, precision, is_measurable, contour_sd, allowed, z):
    """Turn weighted sums into heights, and write them in units of their noise.

    Parameters
    ----------
    height (rows, columns) : Σ k w d; becomes Σ k w d / Σ k² w, metres
    precision (rows, columns) : Σ k² w, 1/metres²
    is_measurable (rows, columns) : cells with enough points; z is 0 elsewhere
    contour_sd (rows, columns) : standard deviation of the contour, metres
    allowed (rows, columns) : cells that the spread is taken of
    z (rows, columns) : filled

    Returns
    -------
    Robust standard deviation of z, 1 where there are few cells.
    """
    quiet, n = np.empty(z.size), 0
    for r in range(z.shape[0]):
        for c in range(z.shape[1]):
            height[r, c] /= precision[r, c]
            z[r, c] = 0.0
            if is_measurable[r, c]:
                z[r, c] = height[r, c] / math.sqrt(1.0 / precision[r, c] + contour_sd[r, c] ** 2)
                if allowed[r, c]:
                    quiet[n] = abs(z[r, c])
                    n += 1
    return MAD_TO_SD * np.median(quiet[:n]) if n > 20 else 1.0
