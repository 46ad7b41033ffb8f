"""Eigenvalues and eigenvectors of symmetric 3 × 3 matrices, in scalars."""

import math

from numba import njit


@njit(cache=True, nogil=True)
def eigenvalues(xx, xy, xz, yy, yz, zz):
    """Eigenvalues in ascending order (closed form by Smith, 1961)."""
    off = xy * xy + xz * xz + yz * yz
    q = (xx + yy + zz) / 3.0
    p2 = (xx - q) ** 2 + (yy - q) ** 2 + (zz - q) ** 2 + 2.0 * off
    if p2 <= 0.0:
        return q, q, q
    p = math.sqrt(p2 / 6.0)
    bxx, byy, bzz = (xx - q) / p, (yy - q) / p, (zz - q) / p
    bxy, bxz, byz = xy / p, xz / p, yz / p
    half_det = 0.5 * (
        bxx * (byy * bzz - byz * byz)
        - bxy * (bxy * bzz - byz * bxz)
        + bxz * (bxy * byz - byy * bxz)
    )
    phi = math.acos(min(1.0, max(-1.0, half_det))) / 3.0
    largest = q + 2.0 * p * math.cos(phi)
    smallest = q + 2.0 * p * math.cos(phi + 2.0 * math.pi / 3.0)
    return smallest, 3.0 * q - largest - smallest, largest


@njit(cache=True, nogil=True)
def eigenvector(xx, xy, xz, yy, yz, zz, value):
    """Unit eigenvector of an eigenvalue: the longest cross product of two rows of A - value·I.

    nan if the eigenvalue is multiple.
    """
    a0, a1, a2 = xx - value, xy, xz
    b0, b1, b2 = xy, yy - value, yz
    c0, c1, c2 = xz, yz, zz - value
    best, x, y, z = 0.0, 0.0, 0.0, 0.0
    for k in range(3):
        if k == 0:
            u0, u1, u2 = a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0
        elif k == 1:
            u0, u1, u2 = a1 * c2 - a2 * c1, a2 * c0 - a0 * c2, a0 * c1 - a1 * c0
        else:
            u0, u1, u2 = b1 * c2 - b2 * c1, b2 * c0 - b0 * c2, b0 * c1 - b1 * c0
        length2 = u0 * u0 + u1 * u1 + u2 * u2
        if length2 > best:
            best, x, y, z = length2, u0, u1, u2
    if best <= 0.0:
        return math.nan, math.nan, math.nan
    length = math.sqrt(best)
    return x / length, y / length, z / length
