"""The contour of a deviation map fitted to its cells: splines along, harmonics around.

A row of cells lies in the reach of four splines, the first of which is `first[row]`, with the
values `basis[row]`; `harmonics` (columns, terms) are the values of the terms per column.
Unknowns are in the order (spline, term). Cells that are used stand row by row in lists: those
of a row from `starts[row]` on, each with its column, height and weight.
"""

import math

import numpy as np
from numba import njit

from pipecore._kernels.linear import factorise_band, solve_by_band


@njit(cache=True, nogil=True)
def list_cells(height, variance, used, floor):
    """List the cells of rows that are used whose height and variance are finite.

    Returns where rows start, and columns, heights and weights 1 / (variance + floor²).
    """
    n_rows, n_columns = height.shape
    starts = np.zeros(n_rows + 1, np.int64)
    column = np.empty(height.size, np.int32)
    values, weights = np.empty(height.size), np.empty(height.size)
    n = 0
    for r in range(n_rows):
        if used[r]:
            for c in range(n_columns):
                if math.isfinite(variance[r, c]) and math.isfinite(height[r, c]):
                    column[n], values[n] = c, height[r, c]
                    weights[n] = 1.0 / (variance[r, c] + floor * floor)
                    n += 1
        starts[r + 1] = n
    return starts, column[:n], values[:n], weights[:n]


@njit(cache=True, nogil=True)
def normal_equations(first, basis, harmonics, starts, column, height, weight, band, right):
    """Add Σ w aaᵀ to a lower band, band[j, i - j], and write Σ w a·height to `right`."""
    n_columns, n_terms = harmonics.shape
    n_pairs = n_terms * (n_terms + 1) // 2
    pairs = np.empty((n_columns, n_pairs))
    for c in range(n_columns):
        p = 0
        for k in range(n_terms):
            for m in range(k + 1):
                pairs[c, p] = harmonics[c, k] * harmonics[c, m]
                p += 1
    right[:] = 0.0
    sums, moments, pull = np.empty(n_pairs), np.empty((n_terms, n_terms)), np.empty(n_terms)
    for r in range(first.shape[0]):
        if starts[r] == starts[r + 1]:
            continue
        sums[:] = 0.0
        pull[:] = 0.0
        for i in range(starts[r], starts[r + 1]):
            w, c = weight[i], column[i]
            for p in range(n_pairs):
                sums[p] += w * pairs[c, p]
            w *= height[i]
            for k in range(n_terms):
                pull[k] += w * harmonics[c, k]
        p = 0
        for k in range(n_terms):
            for m in range(k + 1):
                moments[k, m] = moments[m, k] = sums[p]
                p += 1
        for a in range(4):
            row = (first[r] + a) * n_terms
            for k in range(n_terms):
                right[row + k] += basis[r, a] * pull[k]
            for b in range(a + 1):
                at = (first[r] + b) * n_terms
                product = basis[r, a] * basis[r, b]
                for m in range(n_terms):
                    # Below the diagonal only.
                    for k in range(0 if b < a else m, n_terms):
                        band[at + m, row + k - at - m] += product * moments[k, m]


@njit(cache=True, nogil=True)
def heights(first, basis, harmonics, coefficients, table):
    """Write the contour's height per cell."""
    n_terms = harmonics.shape[1]
    for r in range(table.shape[0]):
        table[r, :] = 0.0
        for k in range(n_terms):
            term = 0.0
            for a in range(4):
                term += basis[r, a] * coefficients[first[r] + a, k]
            for c in range(table.shape[1]):
                table[r, c] += term * harmonics[c, k]


@njit(cache=True, nogil=True)
def scaled_residuals(
    first, basis, harmonics, coefficients, starts, column, height, weight, residuals
):
    """Write residuals in units of their noise; return their robust spread, at least 1."""
    n_terms, n = harmonics.shape[1], height.shape[0]
    terms = np.empty(n_terms)
    found, n_small = np.empty(n), 0
    for r in range(first.shape[0]):
        for k in range(n_terms):
            terms[k] = 0.0
            for a in range(4):
                terms[k] += basis[r, a] * coefficients[first[r] + a, k]
        for i in range(starts[r], starts[r + 1]):
            fitted = 0.0
            for k in range(n_terms):
                fitted += terms[k] * harmonics[column[i], k]
            residuals[i] = (height[i] - fitted) * math.sqrt(weight[i])
            found[i] = abs(residuals[i])
            n_small += found[i] <= 1.0 / 1.4826
    # Their median is sought only where it is not below one for sure.
    return max(1.4826 * np.median(found), 1.0) if n_small <= n // 2 and n > 0 else 1.0


@njit(cache=True, nogil=True)
def reweight(residuals, weight, spread, cauchy, tukey, weights):
    """Write `weight` times the loss's weights: Cauchy's where `cauchy` is positive, or Tukey's."""
    for i in range(weight.shape[0]):
        t = residuals[i] / spread
        if cauchy > 0.0:
            weights[i] = weight[i] / (1.0 + (t / cauchy) ** 2)
        else:
            weights[i] = weight[i] * max(1.0 - (t / tukey) ** 2, 0.0) ** 2


@njit(cache=True, nogil=True)
def fit_robustly(
    first, basis, harmonics, starts, column, height, weight, prior, cauchy, tukey, n_rounds,
    tolerance, band, coefficients,
):  # fmt: skip
    """Fit by Cauchy's weights, then by Tukey's, at most `n_rounds` of each.

    A loss has done its part where no coefficient changes by more than `tolerance`. Writes the
    coefficients, and the factor of their normal equations to `band`; returns how often it solved.
    """
    own, residuals = weight.copy(), np.empty(weight.shape[0])
    solution = coefficients.reshape(-1)
    before = np.empty(solution.shape[0])
    n_solved = 0
    for loss in range(3):
        # Plain first, which is one round.
        for _ in range(n_rounds if loss else 1):
            if loss:
                spread = scaled_residuals(
                    first, basis, harmonics, coefficients, starts, column, height, weight, residuals
                )
                bend = cauchy if loss == 1 else 0.0
                reweight(residuals, weight, spread, bend, tukey, own)
            before[:] = solution
            band[:, :] = prior
            normal_equations(first, basis, harmonics, starts, column, height, own, band, solution)
            factorise_band(band)
            solve_by_band(band, solution)
            n_solved += 1
            if loss and np.abs(solution - before).max() <= tolerance:
                break
    return n_solved


@njit(cache=True, nogil=True)
def row_covariances(first, basis, covariance, table):
    """Write the covariance of the terms at every row (rows, terms, terms)."""
    n_terms = table.shape[1]
    for r in range(table.shape[0]):
        for k in range(n_terms):
            for m in range(n_terms):
                total = 0.0
                for a in range(4):
                    for b in range(4):
                        total += (
                            basis[r, a] * basis[r, b] * covariance[first[r] + a, k, first[r] + b, m]
                        )
                table[r, k, m] = total


@njit(cache=True, nogil=True)
def standard_deviations(harmonics, covariance, table):
    """Write the standard deviation of a height per cell from the covariance of each row's terms."""
    n_terms = harmonics.shape[1]
    for r in range(table.shape[0]):
        for c in range(table.shape[1]):
            variance = 0.0
            for k in range(n_terms):
                variance += harmonics[c, k] ** 2 * covariance[r, k, k]
                for m in range(k):
                    product = harmonics[c, k] * harmonics[c, m]
                    variance += product * (covariance[r, k, m] + covariance[r, m, k])
            table[r, c] = math.sqrt(max(variance, 0.0))
