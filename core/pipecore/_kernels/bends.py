"""How many points agree with bends: between two straights, and at the end of one."""

import math

import numpy as np
from numba import njit

from pipecore._kernels.surfaces import CYLINDER, MOST_PARAMETERS, TORUS, at_point


@njit(cache=True, nogil=True)
def agreement(xyz, normals, tori, lines, tangents, tolerance, min_cos, counts):
    """Count the points that agree with straight, bend and straight as one pipe.

    `lines` (2, 14) are the straights, directed towards the corner where their middles lie;
    `tori` (m, 14) the bends tried, which begin at `tangents` (m,) before the corner. Writes
    to `counts` (m, 2) the points within `tolerance` of each pipe with normals like its own,
    and those of them that are abreast of the bend.
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
    place, normal, starts, bend_radii, cosines, sines, tolerance, min_cos, max_angle, ahead
):
    """Find the bend, of those that may follow a straight, that most points are on.

    Points and normals (3, n) are seen from the straight's end: along it and across, in its
    radii. A bend has one of the `starts`, of the `bend_radii` and of the azimuths, in the
    order of which the first counts where several are as good, and ends at `max_angle` or a
    length of `ahead`. Returns the number of points and three indices.
    """
    best, best_start, best_radius, best_azimuth = -1, 0, 0, 0
    n = place.shape[1]
    for i in range(starts.shape[0]):
        for j in range(bend_radii.shape[0]):
            bend = bend_radii[j]
            # Angles below a limit (< π) are those of larger cosines.
            least_cos = math.cos(min(max_angle, ahead / bend))
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
