"""Rows of binary PLY that hold lists: where each begins, which only walking tells."""

import numba
import numpy as np
from numpy.typing import NDArray


@numba.njit(cache=True, nogil=True)
def find_rows(
    data: NDArray[np.uint8],
    start: int,
    n_rows: int,
    fixed: NDArray[np.int64],
    count_sizes: NDArray[np.int64],
    item_sizes: NDArray[np.int64],
    is_big: bool,
    offsets: NDArray[np.int64],
) -> int:
    """Find where each property of each row begins.

    Parameters
    ----------
    data : ndarray of uint8, shape (n,)
        The file's bytes.
    start : int
        Where the first row begins.
    n_rows : int
    fixed : ndarray of int64, shape (k,)
        Bytes of each property; 0 for a list.
    count_sizes, item_sizes : ndarray of int64, shape (k,)
        Bytes of a list's count and of its items; 0 for what is no list.
    is_big : bool
        Whether counts are big-endian.
    offsets : ndarray of int64, shape (n_rows, k)
        Set to where the properties begin; not set if it has no rows.

    Returns
    -------
    int
        Where the last row ends; -1 if the data ends before, or a list is longer than it.
    """
    place = start
    n_properties = len(fixed)
    for row in range(n_rows):
        for k in range(n_properties):
            if len(offsets):
                offsets[row, k] = place
            if fixed[k] > 0:
                place += fixed[k]
            else:
                size = count_sizes[k]
                if place + size > len(data):
                    return -1
                count = np.int64(0)
                for i in range(size):
                    at = place + i if is_big else place + size - 1 - i
                    count = count * 256 + np.int64(data[at])
                if count < 0 or count > len(data):
                    return -1
                place += size + count * item_sizes[k]
            if place > len(data):
                return -1
    return place
