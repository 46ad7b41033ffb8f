"""Where the arrays go that have a value for every point: memory, unless a caller knows better."""

from typing import Any, Protocol

import numpy as np
from numpy.typing import DTypeLike, NDArray

BLOCK = 2_000_000
"""Rows of such an array that are looked at together, where it need not be in memory whole."""


class Allocate(Protocol):
    """Makes an array; `name` tells it from others that are in use at the time."""

    def __call__(self, name: str, shape: tuple[int, ...], dtype: DTypeLike) -> NDArray[Any]:
        """Return an array of zeros."""
        ...


def in_memory(name: str, shape: tuple[int, ...], dtype: DTypeLike) -> NDArray[Any]:
    """Allocate an array in memory.

    Parameters
    ----------
    name : str
        Not used.
    shape : tuple of int
    dtype : dtype_like

    Returns
    -------
    ndarray
        Of zeros.
    """
    return np.zeros(shape, dtype)
