"""Sums over the cells of a deviation map for its contour: splines along, harmonics around.

A row of cells lies in the reach of four splines, the first of which is `first[row]`, with the
values `basis[row]`; `harmonics` (columns, terms) are the values of the terms per column.
Unknowns are in the order (spline, term). Cells of weight zero are not used.
"""

import math

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def normal_equations(first, basis, harmonics, height, weight, band, right):
    """Add Σ w aaᵀ to a lower band, band[i - j, j], and write Σ w a·height to `right`."""
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
    for r in range(weight.shape[0]):
        sums[:] = 0.0
        pull[:] = 0.0
        for c in range(n_columns):
            w = weight[r, c]
            if w == 0.0:
                continue
            for p in range(n_pairs):
                sums[p] += w * pairs[c, p]
            w *= height[r, c]
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
                column = (first[r] + b) * n_terms
                product = basis[r, a] * basis[r, b]
                for k in range(n_terms):
                    # Below the diagonal only.
                    for m in range(n_terms if b < a else k + 1):
                        band[row + k - column - m, column + m] += product * moments[k, m]


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
def scaled_residuals(first, basis, harmonics, coefficients, height, weight, residuals):
    """Write residuals in units of their noise where weighted; return their robust spread."""
    heights(first, basis, harmonics, coefficients, residuals)
    found = np.empty(weight.size)
    n = 0
    for r in range(weight.shape[0]):
        for c in range(weight.shape[1]):
            if weight[r, c] > 0.0:
                scaled = (height[r, c] - residuals[r, c]) * math.sqrt(weight[r, c])
                residuals[r, c] = scaled
                found[n] = abs(scaled)
                n += 1
    return 1.4826 * np.median(found[:n]) if n > 0 else 1.0


@njit(cache=True, nogil=True)
def reweight(residuals, weight, spread, cauchy, tukey, weights):
    """Write `weight` times the loss's weights: Cauchy's where `cauchy` is positive, or Tukey's."""
    for r in range(weight.shape[0]):
        for c in range(weight.shape[1]):
            w = weight[r, c]
            if w > 0.0:
                t = residuals[r, c] / spread
                if cauchy > 0.0:
                    w /= 1.0 + (t / cauchy) ** 2
                else:
                    w *= max(1.0 - (t / tukey) ** 2, 0.0) ** 2
            weights[r, c] = w


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
