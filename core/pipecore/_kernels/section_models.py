"""Section models: harmonics of the clock times Legendre polynomials of the chainage.

The height above a surface about an axis is h(x, θ) = Σ Pₘ(x) (aₖₘ cos kθ + bₖₘ sin kθ), with x the
chainage scaled to −1 … 1. `n_powers[k]` says how many polynomials go with the harmonic k. The
coefficients stand in the order of k, then m, the cosine's before the sine's.
"""

import math

import numpy as np
from numba import njit

from pipecore._kernels.circles import tukey_weight
from pipecore._kernels.linear import solve_step
from pipecore.robust import MAD_TO_SD, TUKEY_REACH

MOST_TERMS = 64
LEAST_IN_CELL = 3
MOST_SHRINK = 0.2
"""The reach shrinks to no less than this share of itself in one iteration."""


@njit(cache=True, nogil=True)
def fill_terms(x, clock, n_powers, row):
    """Write the terms at one place; returns their number.

    Parameters
    ----------
    x : scaled chainage
    clock : radians
    n_powers : polynomials of each harmonic (k,)
    row : written, at least as long as there are terms
    """
    p = 0
    for k in range(n_powers.shape[0]):
        c, s = math.cos(k * clock), math.sin(k * clock)
        before, value = 0.0, 1.0
        for m in range(n_powers[k]):
            row[p] = value * c
            p += 1
            if k > 0:
                row[p] = value * s
                p += 1
            before, value = value, ((2 * m + 1) * x * value - m * before) / (m + 1)
    return p


@njit(cache=True, nogil=True)
def mean_cells(chainage, clock, residual, low, high, n_rows, n_sectors):
    """Mean chainage, clock and mean residual of cells of chainage and clock, shape (cells, 3).

    Parameters
    ----------
    chainage, clock, residual : of the points (n,); metres, radians, metres
    low, high : chainages of the first and the last row's outer ends
    n_rows, n_sectors : cells along and around
    """
    n_cells = n_rows * n_sectors
    sums = np.zeros((n_cells, 3))
    step = (high - low) / n_rows
    for i in range(chainage.shape[0]):
        row = min(max(int((chainage[i] - low) / step), 0), n_rows - 1)
        cell = row * n_sectors + int(clock[i] / (2.0 * math.pi) * n_sectors) % n_sectors
        sums[cell, 0] += 1.0
        sums[cell, 1] += chainage[i]
        sums[cell, 2] += residual[i]
    cells, n = np.empty((n_cells, 3)), 0
    for k in range(n_cells):
        if sums[k, 0] >= LEAST_IN_CELL:
            cells[n, 0] = sums[k, 1] / sums[k, 0]
            cells[n, 1] = (k % n_sectors + 0.5) * (2.0 * math.pi / n_sectors)
            cells[n, 2] = sums[k, 2] / sums[k, 0]
            n += 1
    return cells[:n]


@njit(cache=True, nogil=True)
def fit_terms(cells, low, high, n_powers, prior, reach, n_iterations, coefficients):
    """Fit the terms to cells by Tukey's weights; False where they do not carry them.

    Parameters
    ----------
    cells : of `mean_cells`
    low, high : chainages at x = −1 and 1
    n_powers : polynomials of each harmonic (k,)
    prior : scatter of the amplitudes of the harmonics from the second on, metres; what the cells
        cannot tell of them stays near zero
    reach : cells this far off weigh nothing at first; it shrinks to what they scatter
    n_iterations : of reweighting
    coefficients : written (p,)
    """
    n, p = cells.shape[0], coefficients.shape[0]
    if n < p + 6:
        return False
    terms, row = np.empty((n, p)), np.empty(MOST_TERMS)
    for i in range(n):
        fill_terms((2.0 * cells[i, 0] - low - high) / (high - low), cells[i, 1], n_powers, row)
        terms[i] = row[:p]
    first_oval = n_powers[0] + (2 * n_powers[1] if n_powers.shape[0] > 1 else 0)
    coefficients[:] = 0.0
    left, size = cells[:, 2].copy(), np.empty(n)
    normal, right, step = np.empty((p, p)), np.empty(p), np.empty(p)
    for _ in range(n_iterations):
        normal[:, :] = 0.0
        right[:] = 0.0
        for i in range(n):
            w = tukey_weight(left[i], reach)
            if w == 0.0:
                continue
            for k in range(p):
                right[k] -= w * terms[i, k] * left[i]
                for m in range(k + 1):
                    normal[k, m] += w * terms[i, k] * terms[i, m]
        stiffness = (reach / TUKEY_REACH / prior) ** 2
        for k in range(first_oval, p):
            normal[k, k] += stiffness
            right[k] += stiffness * coefficients[k]
        if not solve_step(normal, right, step):
            return False
        coefficients += step
        for i in range(n):
            left[i] = cells[i, 2]
            for k in range(p):
                left[i] -= terms[i, k] * coefficients[k]
            size[i] = abs(left[i])
        scatter = MAD_TO_SD * np.partition(size, n // 2)[n // 2]
        reach = max(TUKEY_REACH * scatter, MOST_SHRINK * reach)
    return True


@njit(cache=True, nogil=True)
def heights(chainage, clock, low, high, n_powers, coefficients, height):
    """Write the height of a section model at places; beyond its ends it goes on as there.

    Parameters
    ----------
    chainage, clock : of the places (n,); metres, radians
    low, high : chainages at x = −1 and 1
    n_powers : polynomials of each harmonic (k,)
    coefficients : (p,)
    height : written (n,), metres
    """
    row = np.empty(MOST_TERMS)
    for i in range(chainage.shape[0]):
        x = (2.0 * chainage[i] - low - high) / (high - low)
        p = fill_terms(min(max(x, -1.0), 1.0), clock[i], n_powers, row)
        height[i] = 0.0
        for k in range(p):
            height[i] += row[k] * coefficients[k]
