"""The contour of a deviation map fitted to its cells: splines along, harmonics around.

A row of cells lies in the reach of four splines, the first of which is `first[row]`, with the
values `basis[row]`; `harmonics` (columns, terms) are the values of the terms per column.
Unknowns are in the order (spline, term). Cells that are used stand row by row in lists: those
of a row from `starts[row]` on, each with its column, height and weight.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pipecore._kernels.linear import factorise_band, solve_by_band
from pipecore.robust import MAD_TO_SD


class ContourTerms(NamedTuple):
    """Values of splines and harmonics at the cells of a map (rows, columns).

    first (rows,): first of the four splines that reach each row;
    basis (rows, 4): their values there;
    harmonics (columns, terms): values of 1, cos θ, sin θ … at each column.
    """

    first: NDArray[np.int64]
    basis: NDArray[np.float64]
    harmonics: NDArray[np.float64]


class MapCells(NamedTuple):
    """The cells of a map that are used, row by row.

    starts (rows + 1,): where each row begins;
    column (n,): column of each cell;
    height (n,): mean height, metres;
    weight (n,): inverse variance of it, 1/metres².
    """

    starts: NDArray[np.int64]
    column: NDArray[np.int32]
    height: NDArray[np.float64]
    weight: NDArray[np.float64]


class RobustLoss(NamedTuple):
    """Reweighting of a robust fit.

    cauchy, tukey: reach of Cauchy's and of Tukey's weights, standard deviations;
    n_rounds: most solutions with either;
    tolerance: change of a coefficient below which a fit has converged, metres.
    """

    cauchy: float
    tukey: float
    n_rounds: int
    tolerance: float


@njit(cache=True, nogil=True)
def list_cells(height, variance, used, floor):
    """Return the cells of a map that are used and finite, as `MapCells`.

    Parameters
    ----------
    height, variance (rows, columns) : mean height, metres, and its variance, metres²
    used (rows,) : rows that are used
    floor : standard deviation added to every cell, metres
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
    return MapCells(starts, column[:n], values[:n], weights[:n])


@njit(cache=True, nogil=True)
def normal_equations(terms, cells, weight, band, right):
    """Add Σ w aaᵀ of the design's rows a to a lower band, and write Σ w a·height.

    Parameters
    ----------
    terms : ContourTerms
    cells : MapCells
    weight (n,) : w of each cell, 1/metres²
    band (p, 4 · terms) : added to, band[j, i - j]
    right (p,) : filled
    """
    first, basis, harmonics = terms.first, terms.basis, terms.harmonics
    starts, column, height = cells.starts, cells.column, cells.height
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
def heights(terms, coefficients, table):
    """Write the contour's height per cell, metres.

    Parameters
    ----------
    terms : ContourTerms
    coefficients (splines, terms) : metres
    table (rows, columns) : filled
    """
    first, basis, harmonics = terms.first, terms.basis, terms.harmonics
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
def scaled_residuals(terms, coefficients, cells, residuals):
    """Write residuals in units of their noise; return their robust standard deviation, at least 1.

    Parameters
    ----------
    terms : ContourTerms
    coefficients (splines, terms) : metres
    cells : MapCells
    residuals (n,) : filled
    """
    first, basis, harmonics = terms.first, terms.basis, terms.harmonics
    starts, column, height, weight = cells.starts, cells.column, cells.height, cells.weight
    n_terms, n = harmonics.shape[1], height.shape[0]
    at_row = np.empty(n_terms)
    found, n_small = np.empty(n), 0
    for r in range(first.shape[0]):
        for k in range(n_terms):
            at_row[k] = 0.0
            for a in range(4):
                at_row[k] += basis[r, a] * coefficients[first[r] + a, k]
        for i in range(starts[r], starts[r + 1]):
            fitted = 0.0
            for k in range(n_terms):
                fitted += at_row[k] * harmonics[column[i], k]
            residuals[i] = (height[i] - fitted) * math.sqrt(weight[i])
            found[i] = abs(residuals[i])
            n_small += found[i] <= 1.0 / MAD_TO_SD
    # Their median is sought only where it is not below one for sure.
    return max(MAD_TO_SD * np.median(found), 1.0) if n_small <= n // 2 and n > 0 else 1.0


@njit(cache=True, nogil=True)
def reweight(residuals, weight, spread, cauchy, tukey, weights):
    """Write weights times those of a robust loss: Cauchy's where its reach is positive, or Tukey's.

    Parameters
    ----------
    residuals (n,) : in units of their noise
    weight (n,) : before
    spread : robust standard deviation of the residuals
    cauchy, tukey : reach of either loss, standard deviations
    weights (n,) : filled
    """
    for i in range(weight.shape[0]):
        t = residuals[i] / spread
        if cauchy > 0.0:
            weights[i] = weight[i] / (1.0 + (t / cauchy) ** 2)
        else:
            weights[i] = weight[i] * max(1.0 - (t / tukey) ** 2, 0.0) ** 2


@njit(cache=True, nogil=True)
def fit_robustly(terms, cells, prior, loss, band, coefficients):
    """Fit a contour with Cauchy's weights, then with Tukey's; return how many systems it solved.

    Parameters
    ----------
    terms : ContourTerms
    cells : MapCells
    prior (p, 4 · terms) : lower band of the prior's inverse covariance
    loss : RobustLoss
    band (p, 4 · terms) : filled with the Cholesky factor of the last normal equations
    coefficients (splines, terms) : filled, metres
    """
    weight, residuals = cells.weight.copy(), np.empty(cells.weight.shape[0])
    solution = coefficients.reshape(-1)
    before = np.empty(solution.shape[0])
    n_solved = 0
    for stage in range(3):
        # Plain first, which is one round.
        for _ in range(loss.n_rounds if stage else 1):
            if stage:
                spread = scaled_residuals(terms, coefficients, cells, residuals)
                cauchy = loss.cauchy if stage == 1 else 0.0
                reweight(residuals, cells.weight, spread, cauchy, loss.tukey, weight)
            before[:] = solution
            band[:, :] = prior
            normal_equations(terms, cells, weight, band, solution)
            factorise_band(band)
            solve_by_band(band, solution)
            n_solved += 1
            if stage and np.abs(solution - before).max() <= loss.tolerance:
                break
    return n_solved


@njit(cache=True, nogil=True)
def row_covariances(first, basis, covariance, table):
    """Write the covariance of the terms at every row.

    Parameters
    ----------
    first (rows,), basis (rows, 4) : as in `ContourTerms`
    covariance (splines, terms, splines, terms) : of the coefficients, metres²
    table (rows, terms, terms) : filled
    """
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
    """Write the standard deviation of the contour's height per cell, metres.

    Parameters
    ----------
    harmonics (columns, terms) : values of the terms at each column
    covariance (rows, terms, terms) : of the terms at each row, metres²
    table (rows, columns) : filled
    """
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
