"""Means of the points in each cube of a grid, and look-up of the cubes' neighbours.

Cubes begin at whole multiples of their edge from the local zero, and sums are kept in
whole micrometres, so that a part of the cloud is thinned as the whole is, in any order.
"""

import math

import numpy as np
from numba import njit

HASH_MULTIPLIER = np.uint64(0x9E3779B97F4A7C15)
EMPTY = np.int64(-1)


@njit(cache=True, nogil=True)
def voxel_keys(xyz, first, edge, n_y, n_z, keys):
    """Write the number of the cube that each point lies in, counted from cube `first`."""
    for i in range(xyz.shape[0]):
        ix = np.int64(math.floor(xyz[i, 0] / edge)) - first[0]
        iy = np.int64(math.floor(xyz[i, 1] / edge)) - first[1]
        iz = np.int64(math.floor(xyz[i, 2] / edge)) - first[2]
        keys[i] = (ix * n_y + iy) * n_z + iz


@njit(cache=True, nogil=True)
def slot_of(key, table_keys, mask):
    """Slot of `key` in an open-addressing table, or the empty slot where it would go."""
    slot = (np.uint64(key) * HASH_MULTIPLIER) >> np.uint64(20)
    slot = np.int64(slot) & mask
    while table_keys[slot] != EMPTY and table_keys[slot] != key:
        slot = (slot + 1) & mask
    return slot


@njit(cache=True, nogil=True)
def number_voxels(keys, table_keys, table_ids, ids, first_id):
    """Give each new key the next number; write each point's number. Return the count."""
    mask = np.int64(table_keys.shape[0] - 1)
    n = first_id
    for i in range(keys.shape[0]):
        slot = slot_of(keys[i], table_keys, mask)
        if table_keys[slot] == EMPTY:
            table_keys[slot] = keys[i]
            table_ids[slot] = n
            n += 1
        ids[i] = table_ids[slot]
    return n


@njit(cache=True, nogil=True)
def sum_voxels(xyz, ids, sums, counts):
    """Add up the points of each voxel, in whole micrometres."""
    for i in range(xyz.shape[0]):
        k = ids[i]
        for j in range(3):
            sums[k, j] += np.int64(round(xyz[i, j] * 1e6))
        counts[k] += 1


@njit(cache=True, nogil=True)
def fill_table(keys, table_keys, table_ids):
    """Fill a hash table from distinct keys to their positions."""
    mask = np.int64(table_keys.shape[0] - 1)
    for i in range(keys.shape[0]):
        slot = slot_of(keys[i], table_keys, mask)
        table_keys[slot] = keys[i]
        table_ids[slot] = i
