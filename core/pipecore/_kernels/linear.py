"""Small positive definite systems, by Cholesky's method, whole or as a band."""

import math

import numpy as np
from numba import njit

LEAST_PIVOT = 1e-10
"""A parameter adds at least this share to what the ones before it explain."""


@njit(cache=True, nogil=True)
def mirror(matrix):
    """Write what stands below the diagonal of a matrix above it.

    Parameters
    ----------
    matrix (n, n) : changed
    """
    for k in range(matrix.shape[0]):
        for m in range(k):
            matrix[m, k] = matrix[k, m]


@njit(cache=True, nogil=True)
def solve_in_place(normal, right):
    """Solve a positive definite system by Cholesky's method.

    Parameters
    ----------
    normal (p, p) : its lower triangle; overwritten
    right (p,) : becomes the solution
    """
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
def solve_step(normal, right, step):
    """Solve normal equations for a step; return False where they are singular.

    By Cholesky's method, scaled to unit diagonal; see `LEAST_PIVOT`.

    Parameters
    ----------
    normal (p, p) : JᵀJ
    right (p,) : Jᵀr
    step (p,) : filled with -(JᵀJ)⁻¹Jᵀr
    """
    p = right.shape[0]
    diagonal = np.empty(p)
    for k in range(p):
        diagonal[k] = math.sqrt(max(normal[k, k], 1e-300))
    lower = np.empty((p, p))
    for k in range(p):
        for m in range(k + 1):
            total = normal[k, m] / (diagonal[k] * diagonal[m])
            for j in range(m):
                total -= lower[k, j] * lower[m, j]
            if m < k:
                lower[k, m] = total / lower[m, m]
            elif total > LEAST_PIVOT:
                lower[k, k] = math.sqrt(total)
            else:
                return False
        total = -right[k] / diagonal[k]
        for j in range(k):
            total -= lower[k, j] * step[j]
        step[k] = total / lower[k, k]
        if not math.isfinite(step[k]):
            return False
    for k in range(p - 1, -1, -1):
        for j in range(k + 1, p):
            step[k] -= lower[j, k] * step[j]
        step[k] /= lower[k, k]
    for k in range(p):
        step[k] /= diagonal[k]
    return True


@njit(cache=True, nogil=True)
def factorise_band(band):
    """Turn a positive definite band matrix into its Cholesky factor.

    Parameters
    ----------
    band (p, width) : lower band, band[j, i - j]; changed
    """
    size, width = band.shape
    for j in range(size):
        root = math.sqrt(band[j, 0])
        reach = min(width, size - j)
        for i in range(reach):
            band[j, i] /= root
        for k in range(1, reach):
            for i in range(reach - k):
                band[j + k, i] -= band[j, k] * band[j, k + i]


@njit(cache=True, nogil=True)
def solve_by_band(band, right):
    """Solve a system by the factor of its band matrix.

    Parameters
    ----------
    band (p, width) : of `factorise_band`
    right (p,) : becomes the solution
    """
    size, width = band.shape
    for j in range(size):
        right[j] /= band[j, 0]
        for i in range(1, min(width, size - j)):
            right[j + i] -= band[j, i] * right[j]
    for j in range(size - 1, -1, -1):
        for i in range(1, min(width, size - j)):
            right[j] -= band[j, i] * right[j + i]
        right[j] /= band[j, 0]


@njit(cache=True, nogil=True)
def inverse_by_band(band, inverse):
    """Write the inverse of a matrix from the factor of its band.

    Parameters
    ----------
    band (p, width) : of `factorise_band`
    inverse (p, p) : filled
    """
    inverse[:, :] = 0.0
    for i in range(inverse.shape[0]):
        inverse[i, i] = 1.0
        solve_by_band(band, inverse[i])
