"""What shapes leave of values: least squares, and the least sum of distances."""

import math

import numpy as np
from numba import njit

from pipecore._kernels.grouping import group_by_label

NEW = 1e-9
"""A term adds something where the ones before it leave this share of it."""


@njit(cache=True, nogil=True)
def take_off(terms, values):
    """Take from values (n,) what terms (n, p) explain by least squares; the terms are lost.

    Modified Gram-Schmidt. Terms that are sums of the ones before them add nothing.
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
        if not total > NEW * NEW * whole[k]:
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
def look_at_sphere(xyz, chosen, centre, radius, n_sectors, n_around, n_high, least):
    """How far chosen points leave a sphere, how high they reach over its centre, and their arc.

    The misfit is the root mean square of the medians of patches of equal area: even steps of
    height and of azimuth. Those of fewer than `least` points do not count; infinite where
    none does. The arc is that of the sectors about the vertical that hold points.

    Returns
    -------
    misfit, low, high, arc : float
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
    total, n_used = 0.0, 0
    for k in range(n_around * n_high):
        a, b = starts[k], starts[k + 1]
        if b - a >= least:
            middle = (b - a) // 2
            total += np.partition(residual[members[a:b]], middle)[middle] ** 2
            n_used += 1
    misfit = math.sqrt(total / n_used) if n_used > 0 else math.inf
    return misfit, low, high, 2.0 * math.pi * seen.sum() / n_sectors


@njit(cache=True, nogil=True)
def section_misfit(clock, residual, n_sectors, least, least_share, n_harmonics):
    """How far the medians of sectors leave a circle (one harmonic) or an oval (two).

    Sectors of fewer than `least` points or a `least_share` of all do not count. Root mean
    square over the degrees of freedom; 0 where there are two of them or fewer.
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
        if b - a < max(least, least_share * n):
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
    take_off(terms[:n_used], values)
    total = 0.0
    for value in values:
        total += value * value
    return math.sqrt(total / (n_used - p))


@njit(cache=True, nogil=True)
def least_distances(terms, values, expected, n_steps):
    """What terms (n, p) leave of values (n,) where the sum of what they leave is least.

    In units of the noise `expected` (n,), by weighted least squares in `n_steps`.
    """
    n, p = terms.shape
    weight, left = 1.0 / expected, values.copy()
    weighted, scaled = np.empty((n, p)), np.empty(n)
    for _ in range(n_steps):
        for i in range(n):
            for k in range(p):
                weighted[i, k] = weight[i] * terms[i, k]
            scaled[i] = weight[i] * values[i]
        take_off(weighted, scaled)
        for i in range(n):
            left[i] = scaled[i] / weight[i]
            # Weights of the least sum of distances, levelled where noise is all there is.
            weight[i] = 1.0 / expected[i] / math.sqrt(max(abs(left[i]), expected[i]))
    return left
