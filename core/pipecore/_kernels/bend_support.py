"""How many points agree with bends: between two straights, and at the end of one."""

import math

import numpy as np
from numba import njit

from pipecore._kernels.surface_models import CYLINDER, MOST_PARAMETERS, TORUS, at_point


@njit(cache=True, nogil=True)
def agreement(xyz, normals, tori, lines, tangents, tolerance, min_cos, counts):
    """Count the points that agree with straight, bend and straight as one pipe.

    Parameters
    ----------
    xyz, normals (n, 3) : points, metres, and unit normals of either sign
    tori (m, 14) : the bends tried, see `surface_models`
    lines (2, 14) : the straights, directed to the corner where their middles lie
    tangents (m,) : distance of each bend's tangent points from the corner, metres
    tolerance : largest distance from the surface, metres
    min_cos : least cosine between normals
    counts (m, 2) : filled with all points that agree, and those abreast of the bend
    """
    row = np.empty(MOST_PARAMETERS)
    counts[:, :] = 0
    for i in range(xyz.shape[0]):
        x, y, z = xyz[i, 0], xyz[i, 1], xyz[i, 2]
        nx, ny, nz = normals[i, 0], normals[i, 1], normals[i, 2]
        px, py, pz = x - lines[0, 0], y - lines[0, 1], z - lines[0, 2]
        first = -(px * lines[0, 3] + py * lines[0, 4] + pz * lines[0, 5])
        second = -(px * lines[1, 3] + py * lines[1, 4] + pz * lines[1, 5])
        # Beyond both tangent points, on the outside of the bend, is abreast of neither.
        side = 0 if first >= second else 1
        along = max(first, second)
        residual, ox, oy, oz = at_point(CYLINDER, lines[side], x, y, z, row)
        is_on_line = abs(residual) < tolerance and abs(nx * ox + ny * oy + nz * oz) > min_cos
        for k in range(tangents.shape[0]):
            if along > tangents[k]:
                if is_on_line:
                    counts[k, 0] += 1
                continue
            residual, ox, oy, oz = at_point(TORUS, tori[k], x, y, z, row)
            if abs(residual) < tolerance and abs(nx * ox + ny * oy + nz * oz) > min_cos:
                counts[k, 0] += 1
                counts[k, 1] += 1


@njit(cache=True, nogil=True)
def best_follower(
    place, normal, starts, bend_radii, cosines, sines, tolerance, min_cos, max_angle, max_length
):
    """Find the bend that may follow a straight and has most points on it.

    Of bends with equally many points the first in the order of the candidates counts.

    Parameters
    ----------
    place, normal (3, n) : along the straight from its end and across it, in its radii
    starts (a,) : candidate starts of the bend, radii
    bend_radii (b,) : candidate bend radii, radii
    cosines, sines (c,) : of candidate azimuths
    tolerance : largest distance from the surface, radii
    min_cos : least cosine between normals
    max_angle : largest bend angle, radians
    max_length : largest length of the bend, radii

    Returns
    -------
    Number of points, and indices of start, bend radius and azimuth.
    """
    best, best_start, best_radius, best_azimuth = -1, 0, 0, 0
    n = place.shape[1]
    for i in range(starts.shape[0]):
        for j in range(bend_radii.shape[0]):
            bend = bend_radii[j]
            # Angles below a limit (< π) are those of larger cosines.
            least_cos = math.cos(min(max_angle, max_length / bend))
            for k in range(cosines.shape[0]):
                cos, sin = cosines[k], sines[k]
                count = 0
                for m in range(n):
                    s = place[0, m] - starts[i]
                    if s <= 0.0:
                        continue
                    a, b = place[1, m], place[2, m]
                    aside = b * cos - a * sin
                    back = a * cos + b * sin - bend
                    distance = math.sqrt(s * s + back * back)
                    if -back <= least_cos * distance:
                        continue
                    outward = distance - bend
                    rho = math.sqrt(outward * outward + aside * aside)
                    if not abs(rho - 1.0) < tolerance:
                        continue
                    n_a, n_b = normal[1, m], normal[2, m]
                    along = (normal[0, m] * s + (n_a * cos + n_b * sin) * back) / distance
                    cosine = outward * along + aside * (n_b * cos - n_a * sin)
                    if abs(cosine) > min_cos * rho:
                        count += 1
                if count > best:
                    best, best_start, best_radius, best_azimuth = count, i, j, k
    return best, best_start, best_radius, best_azimuth
