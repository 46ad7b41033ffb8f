"""Numbers of the cubes of a grid, and their look-up by a hash table.

Cubes begin at whole multiples of their edge from the local zero, so that a part of the cloud
is divided as the whole is.
"""

import math

import numpy as np
from numba import njit

HASH_MULTIPLIER = np.uint64(0x9E3779B97F4A7C15)
EMPTY = np.int64(-1)


@njit(cache=True, nogil=True)
def voxel_key(x, y, z, first, edge, n_y, n_z):
    """Return the number of the cube that a point lies in, counted from cube `first`."""
    ix = np.int64(math.floor(x / edge)) - first[0]
    iy = np.int64(math.floor(y / edge)) - first[1]
    iz = np.int64(math.floor(z / edge)) - first[2]
    return (ix * n_y + iy) * n_z + iz


@njit(cache=True, nogil=True)
def hash_of(key):
    """Return the well mixed bits of a key; the upper ones are the best."""
    return np.uint64(key) * HASH_MULTIPLIER


@njit(cache=True, nogil=True)
def slot_of(key, table_keys, mask):
    """Slot of `key` in an open-addressing table, or the empty slot where it would go."""
    slot = np.int64(hash_of(key) >> np.uint64(20)) & mask
    while table_keys[slot] != EMPTY and table_keys[slot] != key:
        slot = (slot + 1) & mask
    return slot


@njit(cache=True, nogil=True)
def number_voxels(xyz, start, stop, first, edge, n_y, n_z, table_keys, table_ids, n, keys, ids):
    """Give each new cube of points start … stop the next number; write each point's number.

    `keys` takes the key of each number. Stops early where the table is half full; returns
    the point to go on with and how many cubes are numbered, `n` before.
    """
    mask = np.int64(table_keys.shape[0] - 1)
    room = min(table_keys.shape[0] // 2, keys.shape[0])
    for i in range(start, stop):
        key = voxel_key(xyz[i, 0], xyz[i, 1], xyz[i, 2], first, edge, n_y, n_z)
        slot = slot_of(key, table_keys, mask)
        if table_keys[slot] == EMPTY:
            if n >= room:
                return i, n
            table_keys[slot] = key
            table_ids[slot] = n
            keys[n] = key
            n += 1
        ids[i] = table_ids[slot]
    return stop, n


@njit(cache=True, nogil=True)
def rename_voxels(ids, start, stop, new_ids):
    """Give points start … stop the new numbers of their cubes."""
    for i in range(start, stop):
        ids[i] = new_ids[ids[i]]


@njit(cache=True, nogil=True)
def fill_table(keys, table_keys, table_ids):
    """Fill a hash table from distinct keys to their positions."""
    mask = np.int64(table_keys.shape[0] - 1)
    for i in range(keys.shape[0]):
        slot = slot_of(keys[i], table_keys, mask)
        table_keys[slot] = keys[i]
        table_ids[slot] = i
