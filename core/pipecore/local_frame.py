"""From world coordinates, which may be millions of metres, to local ones near zero."""

import numpy as np
from numpy.typing import NDArray

ORIGIN_STEP = 100.0
"""The origin is a whole multiple of this, metres."""

FLOAT32_REACH = 1024.0
"""Up to this far from the origin a float32 is within 0.03 mm, metres."""

FARTHEST = 1e9
"""Coordinates beyond this (metres) lie off any map; they count as invalid, like nan."""


def choose_origin(xyz: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a round position near the middle of points.

    Parameters
    ----------
    xyz : ndarray
        World coordinates, metres, shape (n, 3); at least one point.

    Returns
    -------
    ndarray
        The median of the points, rounded to `ORIGIN_STEP`, shape (3,).
    """
    return np.asarray(np.round(np.median(xyz, axis=0) / ORIGIN_STEP) * ORIGIN_STEP + 0.0)


def to_local(
    xyz: NDArray[np.float64], origin: NDArray[np.float64]
) -> NDArray[np.float32] | NDArray[np.float64]:
    """Return local coordinates, as float32 where that keeps 0.1 mm.

    Parameters
    ----------
    xyz : ndarray
        World coordinates, metres, shape (n, 3).
    origin : ndarray
        World coordinates of the local zero, shape (3,).

    Returns
    -------
    ndarray
        Shape (n, 3), C-contiguous.
    """
    local = xyz - origin
    reach = np.abs(local).max(initial=0.0)
    if reach <= FLOAT32_REACH:
        return np.ascontiguousarray(local, np.float32)
    return np.ascontiguousarray(local)
