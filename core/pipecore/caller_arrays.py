"""Arrays as callers give them: checked, and brought to the types that a cloud holds.

A caller's mistake is a `TypeError` (no numbers) or a `ValueError` (numbers that cannot be
meant), in words that say which array is wrong and what to do.
"""

import os
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipecore.local_frame import FARTHEST


def check_coordinates(xyz: ArrayLike) -> NDArray[np.float64]:
    """Return world coordinates as float64.

    Parameters
    ----------
    xyz : array_like
        Metres, shape (n, 3), integers or floats of at least 32 bits.

    Returns
    -------
    ndarray
        Shape (n, 3), finite.

    Raises
    ------
    TypeError
        If they are not real numbers, or of 16 bits.
    ValueError
        If they are of another shape, not finite, or off any map.
    """
    if isinstance(xyz, str | os.PathLike):
        raise TypeError(f"the points must be numbers, not {str(xyz)!r}; pipecore.read reads files")
    array = _numbers(xyz, "the points")
    if array.dtype == np.float16:
        raise TypeError(
            "the points are float16, which keeps three digits of a coordinate; "
            "give float64, or float32 near zero"
        )
    if array.size == 0 and array.ndim < 2:
        array = array.reshape(0, 3)
    if array.ndim != 2 or array.shape[1] != 3:
        raise ValueError(f"the points must have shape (n, 3), not {array.shape}")
    points = array.astype(np.float64)
    is_valid = (np.abs(points) <= FARTHEST).all(axis=1)  # nan compares as False
    if not is_valid.all():
        raise ValueError(
            f"{np.count_nonzero(~is_valid):,} of {len(points):,} points are nan, infinite or "
            f"farther than {FARTHEST:g} m from zero; leave them out first, as by "
            "xyz[np.isfinite(xyz).all(axis=1)]"
        )
    return points


def check_positions(positions: ArrayLike) -> NDArray[np.float64]:
    """Return one position or several as float64, shape (k, 3).

    Parameters
    ----------
    positions : array_like
        World coordinates in metres, shape (3,) or (k, 3).

    Returns
    -------
    ndarray
        Shape (k, 3).

    Raises
    ------
    TypeError
        If they are not real numbers.
    ValueError
        If they are of another shape or infinite; nan stands for a position not known.
    """
    array = _numbers(positions, "the scanner positions").astype(np.float64)
    if array.shape[-1:] != (3,) or array.ndim > 2:
        raise ValueError(f"scanner positions must have shape (3,) or (k, 3), not {array.shape}")
    if np.isinf(array).any():
        raise ValueError("a scanner position is infinite")
    return array.reshape(-1, 3)


def check_station_ids(
    station: ArrayLike, n_points: int, positions: NDArray[np.float64]
) -> NDArray[np.uint16]:
    """Return the number of each point's station.

    Parameters
    ----------
    station : int or array_like
        From 1 on: one for all points, or shape (n_points,).
    n_points : int
    positions : ndarray
        Scanner positions in the order of the numbers, shape (k, 3); k = 0 if none is known.

    Returns
    -------
    ndarray
        uint16, shape (n_points,).

    Raises
    ------
    TypeError
        If they are not whole numbers.
    ValueError
        If they are of another shape, or number a station 0 or one without its position.
    """
    if np.ndim(station) == 0:
        station = np.full(n_points, station)
    ids = check_column(station, "the stations' numbers", n_points, np.uint16)
    if n_points and ids.min() < 1:
        raise ValueError("stations are numbered from 1 on, but some points have station 0")
    if len(positions) and ids.max(initial=0) > len(positions):
        raise ValueError(
            f"there are points of station {ids.max()}, but only {len(positions)} scanner positions"
        )
    return ids


def check_column(
    values: ArrayLike,
    name: str,
    n_points: int,
    dtype: type[np.generic],
    n_components: int | None = None,
) -> NDArray[Any]:
    """Return a value for each point, in the type in which a cloud holds it.

    Parameters
    ----------
    values : array_like
        Shape (n_points,), or (n_points, n_components).
    name : str
        What an error calls it.
    n_points : int
    dtype : type
        An integer type takes whole numbers within its range only.
    n_components : int, optional

    Returns
    -------
    ndarray
        Of `dtype`, C-contiguous.

    Raises
    ------
    TypeError
        If they are not real numbers, or not whole numbers where these are wanted.
    ValueError
        If they are of another shape or out of range.
    """
    array = _numbers(values, name)
    shape = (n_points,) if n_components is None else (n_points, n_components)
    if array.shape != shape:
        raise ValueError(
            f"{name} must have shape {shape}, one for each of {n_points:,} points, "
            f"not {array.shape}"
        )
    if np.issubdtype(dtype, np.integer):
        bounds = np.iinfo(dtype)  # type: ignore[type-var]
        if array.size and not np.issubdtype(array.dtype, np.integer):
            raise TypeError(f"{name} must be whole numbers, not {array.dtype}")
        if array.size and (array.min() < bounds.min or array.max() > bounds.max):
            raise ValueError(
                f"{name} must be from {bounds.min} to {bounds.max}, "
                f"not from {array.min()} to {array.max()}"
            )
    return np.ascontiguousarray(array, dtype)


def _numbers(values: ArrayLike, name: str) -> NDArray[Any]:
    try:
        array = np.asarray(values)
    except ValueError as error:  # rows of different lengths
        raise ValueError(f"{name} cannot be made an array: {error}") from error
    if array.size and array.dtype.kind not in "iuf":
        raise TypeError(f"{name} must be real numbers, not {array.dtype}")
    return array if array.size else array.astype(np.float64)
