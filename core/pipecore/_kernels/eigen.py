"""Eigenvalues and eigenvectors of symmetric 3 × 3 matrices, in scalars."""

import math

from numba import njit

_TINY = 1e-300


@njit(cache=True, nogil=True)
def eigenvalues(xx, xy, xz, yy, yz, zz):
    """Return the eigenvalues of a symmetric matrix in ascending order (closed form, Smith 1961).

    Parameters
    ----------
    xx, xy, xz, yy, yz, zz : the matrix
    """
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


# Chebyshev's interpolation of cos(2 asin(s) / 3 + 2π / 3) for s from 0 to 1, as a polynomial: the
# angle itself has roots at both ends, this has none. It errs by less than 1e-14.
_SERIES = (
    -0.500000000000003, -0.577350269187008, 0.111111110852733, -0.0534583487801286,
    0.0329216321544017, -0.022866278417006, 0.0170555566068771, -0.0132923374954998,
    0.0105464780153852, -0.00819800529461645, 0.00589970094733871, -0.00366376509191468,
    0.0018151676049456, -0.000654353760182858, 0.0001499243080616, -0.0000162124633789063,
)  # fmt: skip
_S0, _S1, _S2, _S3, _S4, _S5, _S6, _S7, _S8, _S9, _S10, _S11, _S12, _S13, _S14, _S15 = _SERIES


@njit(cache=True, nogil=True, inline="always")
def longer(x, y, z, length2, u, v, w):
    """Return the longer of two vectors and its squared length.

    Parameters
    ----------
    x, y, z, length2 : the first vector and its squared length
    u, v, w : the second vector
    """
    other = u * u + v * v + w * w
    is_longer = other > length2
    x = u if is_longer else x
    y = v if is_longer else y
    z = w if is_longer else z
    return x, y, z, other if is_longer else length2


@njit(cache=True, nogil=True, inline="always")
def least_eigenpair(xx, xy, xz, yy, yz, zz):
    """Return the smallest eigenvalue of a symmetric matrix and its unit eigenvector.

    As `eigenvalues` and `eigenvector` give them, nan if it is multiple; without branches and
    calls and inlined, so that the loop around it handles several matrices at a time.

    Parameters
    ----------
    xx, xy, xz, yy, yz, zz : the matrix
    """
    q = (xx + yy + zz) / 3.0
    bxx, byy, bzz = xx - q, yy - q, zz - q
    p2 = (bxx * bxx + byy * byy + bzz * bzz + 2.0 * (xy * xy + xz * xz + yz * yz)) / 6.0
    p = math.sqrt(p2)
    half_det = 0.5 * (
        bxx * (byy * bzz - yz * yz) - xy * (xy * bzz - yz * xz) + xz * (xy * yz - byy * xz)
    )
    cos_phi = half_det / max(p2 * p, _TINY)
    s = min(math.sqrt(0.5 * max(1.0 - cos_phi, 0.0)), 1.0)
    t = ((((_S15 * s + _S14) * s + _S13) * s + _S12) * s + _S11) * s + _S10
    t = (((((t * s + _S9) * s + _S8) * s + _S7) * s + _S6) * s + _S5) * s + _S4
    t = (((t * s + _S3) * s + _S2) * s + _S1) * s + _S0
    value = q + 2.0 * p * t
    a0, b1, c2 = xx - value, yy - value, zz - value
    x, y, z = xy * yz - xz * b1, xz * xy - a0 * yz, a0 * b1 - xy * xy
    best = x * x + y * y + z * z
    x, y, z, best = longer(x, y, z, best, xy * c2 - xz * yz, xz * xz - a0 * c2, a0 * yz - xy * xz)
    x, y, z, best = longer(x, y, z, best, b1 * c2 - yz * yz, yz * xz - xy * c2, xy * yz - b1 * xz)
    scale = 1.0 / math.sqrt(max(best, _TINY))
    scale = scale if best > 0.0 else math.nan
    return value, scale * x, scale * y, scale * z


@njit(cache=True, nogil=True)
def eigenvector(xx, xy, xz, yy, yz, zz, value):
    """Return the unit eigenvector of an eigenvalue, nan if the eigenvalue is multiple.

    It is the longest cross product of two rows of A - value·I.

    Parameters
    ----------
    xx, xy, xz, yy, yz, zz : the matrix A
    value : the eigenvalue
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
