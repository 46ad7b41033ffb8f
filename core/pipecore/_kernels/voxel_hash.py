"""Numbers of the cubes of a grid, and their look-up by a hash table.

Cubes begin at whole multiples of their edge from the local zero, so that a part of the cloud
is divided as the whole is.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

HASH_MULTIPLIER = np.uint64(0x9E3779B97F4A7C15)
EMPTY = np.int64(-1)


class VoxelFrame(NamedTuple):
    """How the cubes of a grid are numbered.

    first (3,): the lowest cube;
    edge: of a cube, metres;
    n_y, n_z: numbers of cubes along y and z.
    """

    first: NDArray[np.int64]
    edge: float
    n_y: int
    n_z: int


class HashTable(NamedTuple):
    """An open-addressing hash table, its size a power of two.

    keys (size,): `EMPTY` where there is none;
    ids (size,): value of each key.
    """

    keys: NDArray[np.int64]
    ids: NDArray[np.int32]


@njit(cache=True, nogil=True)
def voxel_key(x, y, z, frame):
    """Return the number of the cube that a point lies in.

    Parameters
    ----------
    x, y, z : metres
    frame : VoxelFrame
    """
    first, edge = frame.first, frame.edge
    ix = np.int64(math.floor(x / edge)) - first[0]
    iy = np.int64(math.floor(y / edge)) - first[1]
    iz = np.int64(math.floor(z / edge)) - first[2]
    return (ix * frame.n_y + iy) * frame.n_z + iz


@njit(cache=True, nogil=True)
def hash_of(key):
    """Return the well mixed bits of a key; the upper ones are the best.

    Parameters
    ----------
    key : int64
    """
    return np.uint64(key) * HASH_MULTIPLIER


@njit(cache=True, nogil=True)
def slot_of(key, table_keys, mask):
    """Return the slot of a key in a table, or the empty slot where it would go.

    Parameters
    ----------
    key : int64
    table_keys (size,) : see `HashTable`
    mask : size - 1
    """
    slot = np.int64(hash_of(key) >> np.uint64(20)) & mask
    while table_keys[slot] != EMPTY and table_keys[slot] != key:
        slot = (slot + 1) & mask
    return slot


@njit(cache=True, nogil=True)
def number_voxels(xyz, start, stop, frame, table, n, keys, ids):
    """Number the cubes of points as they are met, and write each point's number.

    Stops early where the table is half full.

    Parameters
    ----------
    xyz (n, 3) : points, metres
    start, stop : range of points
    frame : VoxelFrame
    table : HashTable of the cubes; added to
    n : number of cubes so far
    keys (m,) : filled with the key of each number
    ids (n,) : filled

    Returns
    -------
    Point to go on with, and number of cubes.
    """
    table_keys, table_ids = table.keys, table.ids
    mask = np.int64(table_keys.shape[0] - 1)
    room = min(table_keys.shape[0] // 2, keys.shape[0])
    for i in range(start, stop):
        key = voxel_key(xyz[i, 0], xyz[i, 1], xyz[i, 2], frame)
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
    """Give points the new numbers of their cubes.

    Parameters
    ----------
    ids (n,) : changed
    start, stop : range of points
    new_ids (cubes,) : new number of each
    """
    for i in range(start, stop):
        ids[i] = new_ids[ids[i]]


@njit(cache=True, nogil=True)
def fill_table(keys, table):
    """Fill a hash table from distinct keys to their positions.

    Parameters
    ----------
    keys (n,) : int64
    table : HashTable, empty and at least twice as large
    """
    table_keys, table_ids = table.keys, table.ids
    mask = np.int64(table_keys.shape[0] - 1)
    for i in range(keys.shape[0]):
        slot = slot_of(keys[i], table_keys, mask)
        table_keys[slot] = keys[i]
        table_ids[slot] = i
