"""Points in the order of the cubic cells they lie in, by a radix sort in buckets.

Cells are numbered as `GridFrame` does. A bucket holds the points of a range of numbers, so
that buckets are sorted beside each other, each in the processor's cache.
"""

import numpy as np
from numba import njit

from pipecore._kernels.grouping import argsort_keys
from pipecore._kernels.voxel_hash import voxel_key


@njit(cache=True, nogil=True)
def find_bounds(xyz, start, stop, corners):
    """Write the lowest and the highest coordinates of some points.

    Parameters
    ----------
    xyz (n, 3) : points, metres
    start, stop : range of points
    corners (2, 3) : filled
    """
    x, y, z = xyz[start, 0], xyz[start, 1], xyz[start, 2]
    low_x, low_y, low_z = x, y, z
    high_x, high_y, high_z = x, y, z
    for i in range(start + 1, stop):
        x, y, z = xyz[i, 0], xyz[i, 1], xyz[i, 2]
        low_x, low_y, low_z = min(low_x, x), min(low_y, y), min(low_z, z)
        high_x, high_y, high_z = max(high_x, x), max(high_y, y), max(high_z, z)
    corners[0, 0], corners[0, 1], corners[0, 2] = low_x, low_y, low_z
    corners[1, 0], corners[1, 1], corners[1, 2] = high_x, high_y, high_z


@njit(cache=True, nogil=True)
def count_bins(xyz, start, stop, frame, shift, counts):
    """Count the points whose cells' numbers share all but their last bits.

    Parameters
    ----------
    xyz (n, 3) : points, metres
    start, stop : range of points
    frame : VoxelFrame
    shift : number of last bits
    counts (b,) : added to
    """
    for i in range(start, stop):
        key = voxel_key(xyz[i, 0], xyz[i, 1], xyz[i, 2], frame)
        counts[key >> shift] += 1


@njit(cache=True, nogil=True)
def put_in_buckets(xyz, start, stop, frame, shift, bucket_of_bin, places, order):
    """Write the indices of points into their buckets.

    Parameters
    ----------
    xyz (n, 3) : points, metres
    start, stop : range of points
    frame : VoxelFrame
    shift : number of last bits that cells of one bin differ in
    bucket_of_bin (b,) : bucket of each bin
    places (buckets,) : next place of each bucket in `order`; moved on
    order (n,) : filled
    """
    for i in range(start, stop):
        key = voxel_key(xyz[i, 0], xyz[i, 1], xyz[i, 2], frame)
        bucket = bucket_of_bin[key >> shift]
        order[places[bucket]] = i
        places[bucket] += 1


@njit(cache=True, nogil=True)
def sort_bucket(xyz, frame, order, begins):
    """Sort points by their cells, stably, and mark where each cell begins.

    Parameters
    ----------
    xyz (n, 3) : points, metres
    frame : VoxelFrame
    order (m,) : indices of points; sorted in place
    begins (m,) : filled
    """
    n = order.shape[0]
    if n == 0:
        return
    keys = np.empty(n, np.int64)
    for k in range(n):
        i = order[k]
        keys[k] = voxel_key(xyz[i, 0], xyz[i, 1], xyz[i, 2], frame)
    sorted_rows = argsort_keys(keys - keys.min())
    points = order.copy()
    before = np.int64(0)
    for k in range(n):
        row = sorted_rows[k]
        order[k] = points[row]
        begins[k] = k == 0 or keys[row] != before
        before = keys[row]


@njit(cache=True, nogil=True)
def take_points(xyz, order, start, stop, taken):
    """Write points in a given order.

    Parameters
    ----------
    xyz (n, 3) : points, metres
    order (n,) : indices of points
    start, stop : range within `order`
    taken (n, 3) : filled
    """
    for k in range(start, stop):
        i = order[k]
        taken[k, 0], taken[k, 1], taken[k, 2] = xyz[i, 0], xyz[i, 1], xyz[i, 2]


@njit(cache=True, nogil=True)
def mean_points(xyz, order, starts, first, last, means):
    """Write the means of the points of cells.

    Points are added up in whole micrometres, so that their order does not matter.

    Parameters
    ----------
    xyz (n, 3) : points, metres
    order (n,), starts (c + 1,) : the points cell by cell, and where each cell begins
    first, last : range of cells
    means (c, 3) : filled
    """
    for c in range(first, last):
        x = y = z = np.int64(0)
        for k in range(starts[c], starts[c + 1]):
            i = order[k]
            x += np.int64(round(xyz[i, 0] * 1e6))
            y += np.int64(round(xyz[i, 1] * 1e6))
            z += np.int64(round(xyz[i, 2] * 1e6))
        n = 1e6 * (starts[c + 1] - starts[c])
        means[c, 0], means[c, 1], means[c, 2] = x / n, y / n, z / n
