"""Directions in which stacks are cut."""

import numpy as np
from numpy.typing import NDArray

from pipecore.stacks.round_places import RoundPlaces

Array = NDArray[np.float64]

AXES = np.eye(3)
DIAGONALS = np.array([[1, 1, 1], [1, 1, -1], [1, -1, 1], [-1, 1, 1]]) / np.sqrt(3.0)

COVER_COS = float(np.cos(np.deg2rad(24.0)))
"""An axis is well cut by a stack within this angle of it: the section is at most 1.09 times as
long as wide."""
PEAK_COS = float(np.cos(np.deg2rad(12.0)))
"""A direction is moved to the mean of the axes within this angle of it."""
MAX_DIRECTIONS = 16
MIN_POINTS, MIN_SHARE = 80.0, 0.001
"""Places of fewer points, or of a smaller share of all round ones, get no direction of their own:
chance makes as many."""


def cover_directions(places: RoundPlaces) -> list[Array]:
    """Choose few directions so that nearly every round place is well cut along one.

    Greedy: the direction with most places around it, moved to their mean, then the same
    for the places left over.

    Parameters
    ----------
    places : RoundPlaces

    Returns
    -------
    list of ndarray, shape (3,)
        Unit vectors, most frequent first.
    """
    chosen: list[Array] = []
    left, weight = places.axis, places.n_points
    candidates = _hemisphere(400)
    least = max(MIN_POINTS, MIN_SHARE * float(weight.sum()))
    while len(chosen) < MAX_DIRECTIONS and weight.sum() > least:
        # Towards the peak: weights fall off well inside the cover angle.
        support = weight @ np.maximum((left @ candidates.T) ** 2 - COVER_COS**2, 0.0)
        direction = candidates[np.argmax(support)]
        for _ in range(3):
            is_near = np.abs(left @ direction) > PEAK_COS
            if not is_near.any():
                break
            near = left[is_near]
            direction = np.linalg.eigh((weight[is_near, None] * near).T @ near)[1][:, -1]
        is_covered = np.abs(left @ direction) > COVER_COS
        if weight[is_covered].sum() < least:
            break
        chosen.append(_canonical(direction))
        left, weight = left[~is_covered], weight[~is_covered]
    return chosen


def automatic_directions(places: RoundPlaces) -> list[Array]:
    """Directions along which the cloud's own surfaces run, most frequent first.

    Where the cloud shows no round place, the axes and diagonals.
    """
    return cover_directions(places) or [*AXES, *DIAGONALS]


def _hemisphere(n: int) -> Array:
    """About `n` directions spread evenly over a half sphere (Fibonacci lattice)."""
    k = np.arange(n) + 0.5
    z = k / n
    azimuth = np.pi * (1 + 5**0.5) * k
    rho = np.sqrt(1 - z * z)
    return np.stack([rho * np.cos(azimuth), rho * np.sin(azimuth), z], axis=1)


def _canonical(direction: Array) -> Array:
    """Return the direction with its largest component positive."""
    return np.asarray(direction * np.sign(direction[np.argmax(np.abs(direction))]))
