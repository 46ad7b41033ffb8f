"""Fourier series through the points of a section: robust fit, choice of order, curvature."""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from pipecore._kernels.linear import solve_in_place
from pipecore.robust import MAD_TO_SD


class SeriesLimits(NamedTuple):
    """What a section has to be for a fit, and how outliers are found.

    points_per_parameter: least number of points for each parameter;
    min_span: shortest span between gaps that counts, radians;
    min_arc: least arc of all spans, radians;
    max_points: number of points from which means over cells are taken;
    n_cells: number of these cells over the full turn;
    n_rounds: of reweighting;
    tukey: reach of Tukey's weights, standard deviations;
    outlying: residual from which a point is an outlier, standard deviations.
    """

    points_per_parameter: int
    min_span: float
    min_arc: float
    max_points: int
    n_cells: int
    n_rounds: int
    tukey: float
    outlying: float


@njit(cache=True, nogil=True)
def write_terms(theta, order, derivative, terms):
    """Write 1, cos θ, sin θ, cos 2θ … at an angle, or their derivative.

    Parameters
    ----------
    theta : radians
    order : highest multiple
    derivative : 0, 1 or 2
    terms (2 · order + 1,) : filled
    """
    terms[0] = 0.0 if derivative else 1.0
    cos_1, sin_1 = math.cos(theta), math.sin(theta)
    cos, sin = 1.0, 0.0
    for k in range(1, order + 1):
        cos, sin = cos * cos_1 - sin * sin_1, sin * cos_1 + cos * sin_1
        a, b = cos, sin
        for _ in range(derivative):
            a, b = -k * b, k * a
        terms[2 * k - 1], terms[2 * k] = a, b


@njit(cache=True, nogil=True)
def write_normal(moments, order, normal):
    """Write Σ w b bᵀ of the terms b below and on the diagonal, from sums over single terms.

    By 2 cos a cos b = cos(a - b) + cos(a + b), and so on.

    Parameters
    ----------
    moments (4 · order + 1,) : Σ w of the terms up to twice the order
    order : highest multiple
    normal (p, p) : filled, p = 2 · order + 1
    """
    normal[0, 0] = moments[0]
    for a in range(1, order + 1):
        cos, sin = 2 * a - 1, 2 * a
        normal[cos, 0], normal[sin, 0] = moments[cos], moments[sin]
        for b in range(1, a + 1):
            apart, both = 2 * (a - b) - 1, 2 * (a + b) - 1
            cos_apart = moments[apart] if a > b else moments[0]
            sin_apart = moments[apart + 1] if a > b else 0.0
            normal[cos, 2 * b - 1] = 0.5 * (cos_apart + moments[both])
            normal[sin, 2 * b] = 0.5 * (cos_apart - moments[both])
            normal[sin, 2 * b - 1] = 0.5 * (moments[both + 1] + sin_apart)
            normal[cos, 2 * b] = 0.5 * (moments[both + 1] - sin_apart)


@njit(cache=True, nogil=True)
def find_outliers(waves, r, weight, n_rounds, tukey):
    """Return absolute residuals from a robust fit, and their robust standard deviation.

    Residuals are in the unit of r times the root of the weight.

    Parameters
    ----------
    waves (n, 4 · order + 1) : terms of each point up to twice the order of the fit
    r (n,) : metres
    weight (n,) : of each point
    n_rounds : of reweighting
    tukey : reach of Tukey's weights, standard deviations
    """
    n = r.shape[0]
    order = (waves.shape[1] - 1) // 4
    p = 2 * order + 1
    freedom = max(n - p, 1) / n
    moments, normal, right = np.empty(waves.shape[1]), np.empty((p, p)), np.empty(p)
    residual, robust = np.empty(n), np.ones(n)
    scale = math.nan
    for _ in range(n_rounds):
        moments[:] = 0.0
        right[:] = 0.0
        for i in range(n):
            w = weight[i] * robust[i]
            for k in range(waves.shape[1]):
                moments[k] += w * waves[i, k]
            w *= r[i]
            for k in range(p):
                right[k] += w * waves[i, k]
        write_normal(moments, order, normal)
        # On open arcs waves look alike; a hair of ridge is enough to find who strays.
        ridge = 1e-9 * normal[0, 0]
        for k in range(p):
            normal[k, k] += ridge
        solve_in_place(normal, right)
        for i in range(n):
            fitted = 0.0
            for k in range(p):
                fitted += waves[i, k] * right[k]
            residual[i] = abs(r[i] - fitted) * math.sqrt(weight[i])
        scale = max(MAD_TO_SD * np.median(residual) / math.sqrt(freedom), 1e-12)
        for i in range(n):
            t = residual[i] / (tukey * scale)
            robust[i] = max(1.0 - t * t, 1e-6) ** 2
    return residual, scale


@njit(cache=True, nogil=True, fastmath={"reassoc", "contract"})
def inner(a, b):
    """Return the inner product of two vectors, summed in any order.

    Parameters
    ----------
    a, b (n,) : vectors
    """
    total = 0.0
    for i in range(a.shape[0]):
        total += a[i] * b[i]
    return total


@njit(cache=True, nogil=True)
def orthogonalise(rest, upper):
    """Write the triangle R of a = Q R and, as its last column, Qᵀb.

    Modified Gram-Schmidt, stable with b taken along.

    Parameters
    ----------
    rest (p + 1, n) : [a, b]ᵀ; overwritten
    upper (p, p + 1) : filled
    """
    n, p = rest.shape[1], rest.shape[0] - 1
    upper[:, :] = 0.0
    for k in range(p):
        unit = rest[k]
        upper[k, k] = math.sqrt(inner(unit, unit))
        for i in range(n):
            unit[i] /= upper[k, k]
        for m in range(k + 1, p + 1):
            other = rest[m]
            share = inner(unit, other)
            upper[k, m] = share
            for i in range(n):
                other[i] -= share * unit[i]


@njit(cache=True, nogil=True)
def curvature(theta, coefficients, root, values, variances):
    """Write the curvature of a series at angles and its variance; return the mean radius, metres.

    (r² + 2r′² − r r″) / (r² + r′²)^{3/2}. Of its variance only that of r″ counts, by far the most.

    Parameters
    ----------
    theta (n,) : radians
    coefficients (p,) : metres
    root (p, p) : root of their covariance
    values, variances (n,) : filled, 1/metres and 1/metres²
    """
    p = coefficients.shape[0]
    order = (p - 1) // 2
    terms = np.empty(p)
    mean = 0.0
    for i in range(theta.shape[0]):
        r = slope = bend = spread = 0.0
        write_terms(theta[i], order, 0, terms)
        for k in range(p):
            r += terms[k] * coefficients[k]
        write_terms(theta[i], order, 1, terms)
        for k in range(p):
            slope += terms[k] * coefficients[k]
        write_terms(theta[i], order, 2, terms)
        for k in range(p):
            bend += terms[k] * coefficients[k]
            column = 0.0
            for m in range(p):
                column += terms[m] * root[m, k]
            spread += column * column
        mean += r / theta.shape[0]
        values[i] = (r * r + 2.0 * slope * slope - r * bend) / (r * r + slope * slope) ** 1.5
        variances[i] = spread / (r * r) ** 2
    return mean


@njit(cache=True, nogil=True)
def spans_of(ordered, max_gap, least, spans):
    """Write the arcs between wide gaps of angles; return how many.

    Parameters
    ----------
    ordered (n,) : angles, ascending, radians
    max_gap : widest gap within an arc, radians
    least : arcs no longer than this do not count, radians
    spans (m, 2) : filled with start and end, a full turn where there is no gap
    """
    n = ordered.shape[0]
    n_gaps, last = 0, 0
    for i in range(n):
        gap = ordered[(i + 1) % n] - ordered[i] + (2.0 * math.pi if i == n - 1 else 0.0)
        if gap > max_gap:
            n_gaps += 1
            last = i
    if n_gaps == 0:
        spans[0, 0], spans[0, 1] = 0.0, 2.0 * math.pi
        return 1
    found = 0
    start = (last + 1) % n
    for k in range(n):
        i = (last + 1 + k) % n
        gap = ordered[(i + 1) % n] - ordered[i] + (2.0 * math.pi if i == n - 1 else 0.0)
        if gap > max_gap:
            end = ordered[i] + (2.0 * math.pi if ordered[i] < ordered[start] else 0.0)
            if end - ordered[start] > least and found < spans.shape[0]:
                spans[found, 0], spans[found, 1] = ordered[start], end
                found += 1
            start = (i + 1) % n
    return found


@njit(cache=True, nogil=True)
def in_cells(theta, r, n_cells):
    """Return mean angle and radius of equal cells that hold points, and what the means hide.

    Parameters
    ----------
    theta, r (n,) : radians, in 0 … 2π, and metres
    n_cells : number of cells over a full turn

    Returns
    -------
    Means (m,) of angle and radius, counts (m,), and the sum of squares within cells, metres².
    """
    count = np.zeros(n_cells)
    middle, mean = np.zeros(n_cells), np.zeros(n_cells)
    squares = 0.0
    for i in range(theta.shape[0]):
        k = min(int(theta[i] * (n_cells / (2.0 * math.pi))), n_cells - 1)
        count[k] += 1.0
        middle[k] += theta[i]
        mean[k] += r[i]
        squares += r[i] * r[i]
    n = 0
    for k in range(n_cells):
        if count[k] > 0.0:
            middle[n], mean[n], count[n] = middle[k] / count[k], mean[k] / count[k], count[k]
            squares -= count[n] * mean[n] * mean[n]
            n += 1
    return middle[:n], mean[:n], count[:n], max(squares, 0.0)


@njit(cache=True, nogil=True)
def choose_order(rest, n_points, within, aic, upper):
    """Return the order with the least AIC, corrected for few points, and its sum of squares.

    Parameters
    ----------
    rest (p + 1, n) : each term, and the values, times the roots of the weights; overwritten
    n_points : number of points
    within : sum of squares within cells, metres²
    aic (orders,) : filled with the criterion of each order
    upper (p, p + 1) : filled as by `orthogonalise`
    """
    p = rest.shape[0] - 1
    whole = inner(rest[p], rest[p])
    orthogonalise(rest, upper)
    best, best_left, explained = 0, 0.0, 0.0
    for order in range(aic.shape[0]):
        size = 2 * order + 1
        for k in range(max(size - 2, 0), size):
            explained += upper[k, p] * upper[k, p]
        left = max(whole - explained + within, n_points * 1e-18)
        q = 2.0 * order + 2.0
        aic[order] = n_points * math.log(left / n_points) + 2.0 * q
        aic[order] += 2.0 * q * (q + 1.0) / max(n_points - q - 1.0, 1.0)
        if order == 0 or aic[order] < aic[best]:
            best, best_left = order, left
    return best, best_left


@njit(cache=True, nogil=True)
def inverted(upper, size):
    """Return the inverse of the first rows and columns of an upper triangle.

    Parameters
    ----------
    upper (p, p or more) : the triangle
    size : number of rows
    """
    inverse = np.zeros((size, size))
    for i in range(size - 1, -1, -1):
        for j in range(i, size):
            total = 1.0 if i == j else 0.0
            for k in range(i + 1, j + 1):
                total -= upper[i, k] * inverse[k, j]
            inverse[i, j] = total / upper[i, i]
    return inverse


@njit(cache=True, nogil=True)
def curvature_variation(theta, coefficients, root):
    """Return how much the curvature of a series varies; see `SectionCurve`.

    Parameters
    ----------
    theta (n,) : angles at which it is taken, radians
    coefficients (p,) : metres
    root (p, p) : root of their covariance
    """
    values, variances = np.empty(theta.shape[0]), np.empty(theta.shape[0])
    radius = curvature(theta, coefficients, root, values, variances)
    total = mean = 0.0
    for i in range(theta.shape[0]):
        weight = 1.0 / (variances[i] + (0.05 / radius) ** 2)
        total += weight
        mean += weight * values[i]
    mean /= total
    spread = 0.0
    for i in range(theta.shape[0]):
        weight = 1.0 / (variances[i] + (0.05 / radius) ** 2) / total
        spread += weight * ((values[i] - mean) ** 2 - variances[i])
    return radius * math.sqrt(max(spread, 0.0))


@njit(cache=True, nogil=True)
def fit_series(theta, r, max_order, max_gap, limits):
    """Fit a series to points in polar form, of the order with the least AIC.

    Parameters
    ----------
    theta, r (n,) : radians, in 0 … 2π, and metres
    max_order : highest order
    max_gap : widest gap between neighbouring points that is not left open, radians
    limits : SeriesLimits

    Returns
    -------
    Spans (k, 2), number of points without outliers, AIC of each order, noise, coefficients and
    the root of their covariance; these are empty where the arc is too short.
    """
    n = theta.shape[0]
    spans = np.empty((n, 2))
    spans = spans[: spans_of(np.sort(theta), max_gap, limits.min_span, spans)]
    arc = 0.0
    for k in range(spans.shape[0]):
        arc += spans[k, 1] - spans[k, 0]
    if arc < limits.min_arc:
        return spans, 0, np.empty(0), math.nan, np.empty(0), np.empty((0, 0))
    order = min(max_order, (n // limits.points_per_parameter - 1) // 2)
    weight, within = np.ones(n), 0.0
    if n > limits.max_points:
        theta, r, weight, within = in_cells(theta, r, limits.n_cells)
    n, p = theta.shape[0], 2 * order + 1
    waves = np.empty((n, 4 * order + 1))
    for i in range(n):
        write_terms(theta[i], 2 * order, 0, waves[i])
    residual, scale = find_outliers(waves, r, weight, limits.n_rounds, limits.tukey)
    # Weights that bend the tails of the noise would make it look smaller: all or nothing.
    kept = np.flatnonzero(residual < limits.outlying * scale)
    rest, n_points = np.empty((p + 1, kept.shape[0])), 0.0
    for j in range(kept.shape[0]):
        i = kept[j]
        root = math.sqrt(weight[i])
        for k in range(p):
            rest[k, j] = waves[i, k] * root
        rest[p, j] = r[i] * root
        n_points += weight[i]
    aic, upper = np.empty(order + 1), np.empty((p, p + 1))
    chosen, left = choose_order(rest, n_points, within, aic, upper)
    size = 2 * chosen + 1
    noise = math.sqrt(left / max(n_points - size, 1.0))
    inverse = inverted(upper, size)
    coefficients = np.zeros(size)
    for i in range(size):
        for j in range(i, size):
            coefficients[i] += inverse[i, j] * upper[j, p]
    return spans, int(n_points), aic, noise, coefficients, noise * inverse


@njit(cache=True, nogil=True)
def clocks_of(spans, step):
    """Return angles from end to end of every span.

    Parameters
    ----------
    spans (k, 2) : start and end, radians
    step : largest distance between angles, radians
    """
    n = 0
    for k in range(spans.shape[0]):
        n += max(2, math.ceil((spans[k, 1] - spans[k, 0]) / step) + 1)
    clocks = np.empty(n)
    n = 0
    for k in range(spans.shape[0]):
        start, end = spans[k, 0], spans[k, 1]
        m = max(2, math.ceil((end - start) / step) + 1)
        for i in range(m):
            clocks[n + i] = start + i * ((end - start) / (m - 1))
        n += m
    return clocks


@njit(cache=True, nogil=True)
def variations(theta, r, first, last, least_points, max_order, max_gap, limits, step, variation):
    """Write how much the curvature varies around each of many sections.

    Parameters
    ----------
    theta, r (n,) : radians, in 0 … 2π, and metres
    first, last (m,) : range of points of each section
    least_points : least number of points
    max_order, max_gap, limits : as in `fit_series`
    step : largest distance between angles where the curvature is taken, radians
    variation (m,) : filled; nan where the points define no curve
    """
    for row in range(first.shape[0]):
        a, b = first[row], last[row]
        variation[row] = math.nan
        if b - a >= least_points:
            spans, _, _, _, coefficients, root = fit_series(
                theta[a:b], r[a:b], max_order, max_gap, limits
            )
            if coefficients.shape[0]:
                clocks = clocks_of(spans, step)
                variation[row] = curvature_variation(clocks, coefficients, root)
