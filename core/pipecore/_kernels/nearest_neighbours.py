"""Distances to the nearest neighbours of a few sampled points among very many."""

import math

import numpy as np
from numba import njit

from pipecore._kernels.voxel_hash import EMPTY, HASH_MULTIPLIER, slot_of, voxel_key

_FACTORS = (HASH_MULTIPLIER, np.uint64(0xC2B2AE3D27D4EB4F), np.uint64(0x165667B19E3779F9))
_FACTOR_X, _FACTOR_Y, _FACTOR_Z = _FACTORS


@njit(cache=True, nogil=True)
def hash_places(xyz, start, stop, hashes):
    """Write a hash of the coordinates of some points.

    Parameters
    ----------
    xyz (n, 3) : points, metres
    start, stop : range of points
    hashes (m,) : filled, unsigned
    """
    place = np.empty(3, np.float64)
    bits = place.view(np.uint64)
    for i in range(start, stop):
        place[0], place[1], place[2] = xyz[i, 0], xyz[i, 1], xyz[i, 2]
        mixed = bits[0] * _FACTOR_X + bits[1] * _FACTOR_Y + bits[2] * _FACTOR_Z
        hashes[i - start] = (mixed ^ (mixed >> np.uint64(31))) * _FACTOR_X


@njit(cache=True, nogil=True)
def draw_places(xyz, start, stop, bound, drawn):
    """List the points of a range whose hash is small; return how many.

    Parameters
    ----------
    xyz (n, 3) : points, metres
    start, stop : range of points
    bound : largest hash
    drawn (m,) : filled with indices
    """
    n = 0
    block = np.empty(1024, np.uint64)
    for begin in range(start, stop, 1024):
        end = min(begin + 1024, stop)
        hash_places(xyz, begin, end, block)
        for i in range(begin, end):
            if block[i - begin] <= bound:
                drawn[n] = i
                n += 1
    return n


@njit(cache=True, nogil=True)
def collect_marked(xyz, start, stop, frame, table, found, cells):
    """List the points of a range that lie in marked cubes; return how many.

    Parameters
    ----------
    xyz (n, 3) : points, metres
    start, stop : range of points
    frame : VoxelFrame
    table : HashTable of the marked cubes
    found, cells (m,) : filled with indices of points, and values of their cubes
    """
    table_keys, table_ids = table.keys, table.ids
    mask = np.int64(table_keys.shape[0] - 1)
    n = 0
    for i in range(start, stop):
        key = voxel_key(xyz[i, 0], xyz[i, 1], xyz[i, 2], frame)
        slot = slot_of(key, table_keys, mask)
        if table_keys[slot] != EMPTY:
            found[n] = i
            cells[n] = table_ids[slot]
            n += 1
    return n


@njit(cache=True, nogil=True)
def nearest_in_cells(xyz, sample, frame, table, points, starts, k, reach):
    """Write each sample's distance to its k-th nearest point, itself counted.

    Parameters
    ----------
    xyz (n, 3) : points, metres
    sample (m, 3) : places, metres
    frame : VoxelFrame
    table : HashTable of the cubes around all samples
    points (p,), starts (c + 1,) : the points cube by cube, and where each begins
    k : number of points
    reach (m,) : filled, metres; nan where fewer than k lie within a cube's edge
    """
    table_keys, table_ids, edge, n_y, n_z = table.keys, table.ids, frame.edge, frame.n_y, frame.n_z
    mask = np.int64(table_keys.shape[0] - 1)
    nearest = np.empty(k, np.float64)
    for s in range(sample.shape[0]):
        x, y, z = sample[s, 0], sample[s, 1], sample[s, 2]
        key = voxel_key(x, y, z, frame)
        nearest[:] = math.inf
        for dx in range(-1, 2):
            for dy in range(-1, 2):
                for dz in range(-1, 2):
                    near = key + (dx * n_y + dy) * n_z + dz
                    cell = table_ids[slot_of(near, table_keys, mask)]
                    for m in range(starts[cell], starts[cell + 1]):
                        i = points[m]
                        u, v, w = xyz[i, 0] - x, xyz[i, 1] - y, xyz[i, 2] - z
                        d2 = u * u + v * v + w * w
                        if d2 >= nearest[k - 1]:
                            continue
                        j = k - 1
                        while j > 0 and nearest[j - 1] > d2:
                            nearest[j] = nearest[j - 1]
                            j -= 1
                        nearest[j] = d2
        d = math.sqrt(nearest[k - 1])
        reach[s] = d if d <= edge else math.nan
