"""What shapes leave of values: least squares, and the least sum of distances."""

import math

import numpy as np
from numba import njit

from pipecore._kernels.grouping import group_by_label

MIN_NEW_SHARE = 1e-9
"""A term counts where the ones before it leave at least this fraction of it."""


@njit(cache=True, nogil=True)
def remove_explained(terms, values):
    """Subtract from values what terms explain by least squares (modified Gram-Schmidt).

    Terms that are sums of the ones before them add nothing.

    Parameters
    ----------
    terms (n, p) : overwritten
    values (n,) : become the residuals
    """
    n, p = terms.shape
    whole = np.zeros(p)
    for i in range(n):
        for k in range(p):
            whole[k] += terms[i, k] * terms[i, k]
    share = np.empty(p)
    for k in range(p):
        total = 0.0
        for i in range(n):
            total += terms[i, k] * terms[i, k]
        if not total > MIN_NEW_SHARE * MIN_NEW_SHARE * whole[k]:
            continue
        share[k:] = 0.0
        of_values = 0.0
        for i in range(n):
            for m in range(k + 1, p):
                share[m] += terms[i, k] * terms[i, m]
            of_values += terms[i, k] * values[i]
        for i in range(n):
            for m in range(k + 1, p):
                terms[i, m] -= share[m] / total * terms[i, k]
            values[i] -= of_values / total * terms[i, k]


@njit(cache=True, nogil=True)
def sphere_misfit(xyz, chosen, centre, radius, n_sectors, n_around, n_high, min_points):
    """Return how far points leave a sphere, how high they reach over its centre, and their arc.

    The misfit is the root mean square of the medians of patches of equal area, even steps of
    height and azimuth. The arc is that of the sectors about the vertical that hold points.

    Parameters
    ----------
    xyz (n, 3) : points, metres
    chosen (m,) : indices of points
    centre (3,), radius : of the sphere, metres
    n_sectors : number of sectors about the vertical
    n_around, n_high : numbers of patches in azimuth and height
    min_points : patches of fewer points do not count

    Returns
    -------
    Misfit (infinite where no patch counts), lowest and highest point, metres, arc, radians, and
    the mean of 1 / points of the patches that count: what noise adds to the squared misfit.
    """
    n = chosen.shape[0]
    patch, residual = np.empty(n, np.int64), np.empty(n)
    seen = np.zeros(n_sectors, np.bool_)
    low, high = math.inf, -math.inf
    for m in range(n):
        i = chosen[m]
        x, y, z = xyz[i, 0] - centre[0], xyz[i, 1] - centre[1], xyz[i, 2] - centre[2]
        rho = math.sqrt(x * x + y * y + z * z)
        residual[m] = rho - radius
        low, high = min(low, z), max(high, z)
        turn = math.atan2(y, x) / (2.0 * math.pi) + 0.5
        step = int((z / rho + 1.0) * 0.5 * n_high)
        patch[m] = min(int(turn * n_around), n_around - 1) * n_high + min(step, n_high - 1)
        seen[min(int(turn * n_sectors), n_sectors - 1)] = True
    members, starts = group_by_label(patch, n_around * n_high)
    total, n_used, inverse = 0.0, 0, 0.0
    for k in range(n_around * n_high):
        a, b = starts[k], starts[k + 1]
        if b - a >= min_points:
            middle = (b - a) // 2
            total += np.partition(residual[members[a:b]], middle)[middle] ** 2
            n_used += 1
            inverse += 1.0 / (b - a)
    misfit = math.sqrt(total / n_used) if n_used > 0 else math.inf
    arc = 2.0 * math.pi * seen.sum() / n_sectors
    return misfit, low, high, arc, inverse / max(n_used, 1)


@njit(cache=True, nogil=True)
def section_misfit(clock, residual, n_sectors, min_points, min_share, n_harmonics):
    """Return how far the medians of sectors leave a circle (one harmonic) or an oval (two).

    Root mean square over the degrees of freedom; 0 where there are two of them or fewer.

    Parameters
    ----------
    clock (n,) : clock angles, radians
    residual (n,) : distances from the surface, metres
    n_sectors : number of sectors
    min_points, min_share : sectors of fewer points, or of a smaller fraction, do not count
    n_harmonics : 1 or 2
    """
    n = clock.shape[0]
    sector = np.empty(n, np.int64)
    for i in range(n):
        sector[i] = int(clock[i] / (2.0 * math.pi) * n_sectors) % n_sectors
    members, starts = group_by_label(sector, n_sectors)
    p = 1 + 2 * n_harmonics
    values, terms = np.empty(n_sectors), np.empty((n_sectors, p))
    n_used = 0
    for s in range(n_sectors):
        a, b = starts[s], starts[s + 1]
        if b - a < max(min_points, min_share * n):
            continue
        middle = (b - a) // 2
        values[n_used] = np.partition(residual[members[a:b]], middle)[middle]
        angle = (s + 0.5) * (2.0 * math.pi / n_sectors)
        terms[n_used, 0] = 1.0
        for k in range(1, n_harmonics + 1):
            terms[n_used, 2 * k - 1] = math.cos(k * angle)
            terms[n_used, 2 * k] = math.sin(k * angle)
        n_used += 1
    if n_used <= p + 2:
        return 0.0
    values = values[:n_used]
    remove_explained(terms[:n_used], values)
    total = 0.0
    for value in values:
        total += value * value
    return math.sqrt(total / (n_used - p))


@njit(cache=True, nogil=True)
def least_distances(terms, values, expected, n_steps):
    """Return the residuals of values from terms with the least sum of absolute values.

    By iteratively reweighted least squares.

    Parameters
    ----------
    terms (n, p) : design
    values (n,) : any unit
    expected (n,) : expected noise, in that unit
    n_steps : number of iterations
    """
    n, p = terms.shape
    weight, left = 1.0 / expected, values.copy()
    weighted, scaled = np.empty((n, p)), np.empty(n)
    for _ in range(n_steps):
        for i in range(n):
            for k in range(p):
                weighted[i, k] = weight[i] * terms[i, k]
            scaled[i] = weight[i] * values[i]
        remove_explained(weighted, scaled)
        for i in range(n):
            left[i] = scaled[i] / weight[i]
            # Weights of the least sum of distances, levelled where noise is all there is.
            weight[i] = 1.0 / expected[i] / math.sqrt(max(abs(left[i]), expected[i]))
    return left
