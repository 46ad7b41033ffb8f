"""Sums for ellipses fitted directly to groups of points in a plane."""

import math

from numba import njit


@njit(cache=True, nogil=True)
def scaled_moments(points, starts, mean, scale, moments):
    """Write the mean and scatter of each group of points, and the sums of powers once scaled.

    Parameters
    ----------
    points (n, 2) : grouped, any unit of length
    starts (m + 1,) : where each group begins
    mean (m, 2), scale (m,) : filled with mean and root mean square distance from it
    moments (m, 15) : filled with Σ xⁱyʲ by i + j and then by j: 1, x, y, x², xy, y² … y⁴
    """
    for g in range(starts.shape[0] - 1):
        first, last = starts[g], starts[g + 1]
        n = last - first
        mean_x = mean_y = spread = 0.0
        for i in range(first, last):
            mean_x += points[i, 0] / n
            mean_y += points[i, 1] / n
        for i in range(first, last):
            spread += (points[i, 0] - mean_x) ** 2 + (points[i, 1] - mean_y) ** 2
        mean[g, 0], mean[g, 1] = mean_x, mean_y
        scale[g] = math.sqrt(spread / n) if spread > 0.0 else 1.0
        moments[g, :] = 0.0
        for i in range(first, last):
            x, y = (points[i, 0] - mean_x) / scale[g], (points[i, 1] - mean_y) / scale[g]
            xx, xy, yy = x * x, x * y, y * y
            moments[g, 0] += 1.0
            moments[g, 1] += x
            moments[g, 2] += y
            moments[g, 3] += xx
            moments[g, 4] += xy
            moments[g, 5] += yy
            moments[g, 6] += xx * x
            moments[g, 7] += xx * y
            moments[g, 8] += x * yy
            moments[g, 9] += y * yy
            moments[g, 10] += xx * xx
            moments[g, 11] += xx * xy
            moments[g, 12] += xx * yy
            moments[g, 13] += xy * yy
            moments[g, 14] += yy * yy


@njit(cache=True, nogil=True)
def sampson_sums(points, starts, mean, scale, conics, sums):
    """Write the sum of each group's squared Sampson distances from its conic, F² / |∇F|².

    Points and sums are scaled as by `scaled_moments`.

    Parameters
    ----------
    points (n, 2) : grouped, any unit of length
    starts (m + 1,) : where each group begins
    mean (m, 2), scale (m,) : of each group
    conics (m, 6) : a x² + b xy + c y² + d x + e y + f of the scaled points
    sums (m,) : filled; nan where the conic is
    """
    for g in range(starts.shape[0] - 1):
        a, b, c = conics[g, 0], conics[g, 1], conics[g, 2]
        d, e, f = conics[g, 3], conics[g, 4], conics[g, 5]
        total = 0.0
        for i in range(starts[g], starts[g + 1]):
            x = (points[i, 0] - mean[g, 0]) / scale[g]
            y = (points[i, 1] - mean[g, 1]) / scale[g]
            value = a * x * x + b * x * y + c * y * y + d * x + e * y + f
            gradient = (2.0 * a * x + b * y + d) ** 2 + (b * x + 2.0 * c * y + e) ** 2
            # Where nothing is known that is nan, as it should be.
            total += value * value / (gradient if not gradient < 1e-300 else 1e-300)
        sums[g] = total
