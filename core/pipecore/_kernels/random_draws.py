"""Random draws that come out the same on every machine and in every thread."""

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def seeded(seed):
    """Return the first state of a series of draws.

    Parameters
    ----------
    seed : whole number
    """
    return np.uint64(seed) * np.uint64(2862933555777941757) + np.uint64(3037000493)


@njit(cache=True, nogil=True)
def next_random(state):
    """Return the next state of a linear congruential generator (Knuth's MMIX constants).

    Parameters
    ----------
    state : unsigned 64-bit
    """
    return state * np.uint64(6364136223846793005) + np.uint64(1442695040888963407)


@njit(cache=True, nogil=True)
def draw(state, n):
    """Return the next state, and an index below n.

    Parameters
    ----------
    state : unsigned 64-bit
    n : positive
    """
    state = next_random(state)
    return state, np.int64((state >> np.uint64(33)) % np.uint64(n))


@njit(cache=True, nogil=True)
def draw_fast(state, n):
    """Return what `draw` does, other indices, without its division.

    Parameters
    ----------
    state : unsigned 64-bit
    n : positive, below 2³¹
    """
    state = next_random(state)
    return state, np.int64(((state >> np.uint64(33)) * np.uint64(n)) >> np.uint64(31))
