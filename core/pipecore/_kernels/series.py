"""Fourier series through the points of a section: robust fit, choice of order, curvature."""

import math

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def write_terms(theta, order, derivative, terms):
    """Write 1, cos θ, sin θ, cos 2θ … (2·order + 1,) at an angle, or their derivative."""
    terms[0] = 0.0 if derivative else 1.0
    for k in range(1, order + 1):
        phase = theta * k + derivative * 0.5 * math.pi
        scale = float(k) ** derivative
        terms[2 * k - 1], terms[2 * k] = scale * math.cos(phase), scale * math.sin(phase)


@njit(cache=True, nogil=True)
def solve_in_place(normal, right):
    """Solve a positive definite system by Cholesky's method; both are overwritten."""
    p = right.shape[0]
    for k in range(p):
        for m in range(k + 1):
            total = normal[k, m]
            for j in range(m):
                total -= normal[k, j] * normal[m, j]
            normal[k, m] = math.sqrt(total) if m == k else total / normal[m, m]
        total = right[k]
        for j in range(k):
            total -= normal[k, j] * right[j]
        right[k] = total / normal[k, k]
    for k in range(p - 1, -1, -1):
        for j in range(k + 1, p):
            right[k] -= normal[j, k] * right[j]
        right[k] /= normal[k, k]


@njit(cache=True, nogil=True)
def find_strays(basis, r, weight, n_rounds, tukey):
    """Residuals from a robust fit in units of their noise, and how wide they scatter."""
    n, p = basis.shape
    freedom = max(n - p, 1) / n
    normal, right = np.empty((p, p)), np.empty(p)
    residual, robust = np.empty(n), np.ones(n)
    scale = math.nan
    for _ in range(n_rounds):
        normal[:, :] = 0.0
        right[:] = 0.0
        for i in range(n):
            w = weight[i] * robust[i]
            for k in range(p):
                wk = w * basis[i, k]
                right[k] += wk * r[i]
                for m in range(k + 1):
                    normal[k, m] += wk * basis[i, m]
        # On open arcs waves look alike; a hair of ridge is enough to find who strays.
        ridge = 1e-9 * normal[0, 0]
        for k in range(p):
            normal[k, k] += ridge
        solve_in_place(normal, right)
        for i in range(n):
            fitted = 0.0
            for k in range(p):
                fitted += basis[i, k] * right[k]
            residual[i] = abs(r[i] - fitted) * math.sqrt(weight[i])
        scale = max(1.4826 * np.median(residual) / math.sqrt(freedom), 1e-12)
        for i in range(n):
            t = residual[i] / (tukey * scale)
            robust[i] = max(1.0 - t * t, 1e-6) ** 2
    return residual, scale


@njit(cache=True, nogil=True)
def orthogonalise(rest, upper):
    """Write the triangle R of a = Q R and, as its last column, Qᵀ b; `rest` is [a, b] and lost.

    Modified Gram-Schmidt, stable with b taken along.
    """
    n, p = rest.shape[0], rest.shape[1] - 1
    upper[:, :] = 0.0
    for k in range(p):
        total = 0.0
        for i in range(n):
            total += rest[i, k] * rest[i, k]
        upper[k, k] = math.sqrt(total)
        for i in range(n):
            rest[i, k] /= upper[k, k]
        for i in range(n):
            for m in range(k + 1, p + 1):
                upper[k, m] += rest[i, k] * rest[i, m]
        for i in range(n):
            for m in range(k + 1, p + 1):
                rest[i, m] -= rest[i, k] * upper[k, m]


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
