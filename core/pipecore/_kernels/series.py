"""Fourier series through the points of a section: robust fit, choice of order, curvature."""

import math

import numpy as np
from numba import njit

from pipecore._kernels.linear import solve_in_place


@njit(cache=True, nogil=True)
def write_terms(theta, order, derivative, terms):
    """Write 1, cos θ, sin θ, cos 2θ … (2·order + 1,) at an angle, or their derivative."""
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
    """Write Σ w b bᵀ of the terms b up to an order, below the diagonal, from Σ w of twice as many.

    2 cos a cos b = cos(a - b) + cos(a + b), and so on.
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
def find_strays(waves, r, weight, n_rounds, tukey):
    """Residuals from a robust fit in units of their noise, and how wide they scatter.

    `waves` are the terms up to twice the order of the fit.
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
        scale = max(1.4826 * np.median(residual) / math.sqrt(freedom), 1e-12)
        for i in range(n):
            t = residual[i] / (tukey * scale)
            robust[i] = max(1.0 - t * t, 1e-6) ** 2
    return residual, scale


@njit(cache=True, nogil=True, fastmath={"reassoc", "contract"})
def inner(a, b):
    """Sum of products, in whatever order is fast."""
    total = 0.0
    for i in range(a.shape[0]):
        total += a[i] * b[i]
    return total


@njit(cache=True, nogil=True)
def orthogonalise(rest, upper):
    """Write the triangle R of a = Q R and, as its last column, Qᵀ b; `rest` is [a, b]ᵀ and lost.

    Modified Gram-Schmidt, stable with b taken along.
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
    """Write the curvature of a series at angles and its variance, 1/metres; return the mean radius.

    (r² + 2r′² - r r″) / (r² + r′²)^{3/2}; by far the most of its variance is that of r″.
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
    """Write the arcs between gaps wider than `max_gap` of angles in order; return how many.

    Arcs no longer than `least` do not count. Where there is no gap it is a full turn.
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
    """Mean angle and radius of cells that hold points, their counts, and what they hide."""
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
    """Least order by Akaike's criterion (corrected for few points), and what it leaves.

    `rest` holds a row for each term and one for the values, times the roots of the weights, and
    is lost; `upper` becomes the triangle of `orthogonalise`. Writes the criterion of each order.
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
    """Inverse of a triangle's first rows and columns, from its last row up."""
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
    """How much the curvature of a series varies at angles; see `SectionCurve`."""
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
    """Fit a series to points in polar form, of the order that the criterion chooses.

    `limits` are the points for each parameter, the shortest span that counts, the least arc
    of all, the points from which on cells are taken, their number, and the rounds, Tukey's
    reach and the reach in units of the noise by which strays are found. Returns the spans
    (k, 2), how many points are no strays, the criterion of each order, the noise, the
    coefficients and the root of their covariance; none of these for too short an arc.
    """
    per_parameter, least_span, least_arc, max_points, n_cells, n_rounds, tukey, outlying = limits
    n = theta.shape[0]
    spans = np.empty((n, 2))
    spans = spans[: spans_of(np.sort(theta), max_gap, least_span, spans)]
    arc = 0.0
    for k in range(spans.shape[0]):
        arc += spans[k, 1] - spans[k, 0]
    if arc < least_arc:
        return spans, 0, np.empty(0), math.nan, np.empty(0), np.empty((0, 0))
    order = min(max_order, (n // per_parameter - 1) // 2)
    weight, within = np.ones(n), 0.0
    if n > max_points:
        theta, r, weight, within = in_cells(theta, r, n_cells)
    n, p = theta.shape[0], 2 * order + 1
    waves = np.empty((n, 4 * order + 1))
    for i in range(n):
        write_terms(theta[i], 2 * order, 0, waves[i])
    residual, scale = find_strays(waves, r, weight, n_rounds, tukey)
    # Weights that bend the tails of the noise would make it look smaller: all or nothing.
    kept = np.flatnonzero(residual < outlying * scale)
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
    """Angles from end to end of every span, no further than `step` apart."""
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
    """Write how much the curvature varies around each section; nan where it carries no curve.

    A section has the points from `first` to `last`.
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
