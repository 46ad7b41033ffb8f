"""Random draws that come out the same on every machine and in every thread."""

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def seeded(seed):
    """First state of a series of draws."""
    return np.uint64(seed) * np.uint64(2862933555777941757) + np.uint64(3037000493)


@njit(cache=True, nogil=True)
def draw(state, n):
    """Next state of a linear congruential generator (Knuth's MMIX), and an index below `n`.

    The index is of the state's high bits, without the division that a remainder takes.
    """
    state = state * np.uint64(6364136223846793005) + np.uint64(1442695040888963407)
    return state, np.int64(((state >> np.uint64(33)) * np.uint64(n)) >> np.uint64(31))
