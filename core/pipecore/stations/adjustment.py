"""The adjustment of all stations: what each element tells, put together, with outliers left out."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipecore.stations.element_fit import Equations

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

UNTOLD_SD = 5e-3
"""A shift along a direction, or a turn at the distance of the points' spread, that is told no
better than to 5 mm is not told: registrations are better."""
CUT = 3.5
"""An element that is off by more standard deviations than this counts less (Huber): a hose, a pipe
that was moved between two scans."""
N_REWEIGHTINGS = 8
FEWEST_FREEDOMS = 12
"""With fewer degrees of freedom the elements do not say how well they agree."""
RANK_SHARE = 1e-2
"""How well elements agree is judged by what each tells best: along directions in which it tells
this much less, what was assumed of its shape agrees with itself."""
NOTHING_SHARE = 1e-9
"""What an element tells in a direction, next to its best, that it does not tell at all."""


@dataclass(frozen=True, eq=False)
class Solution:
    """Corrections of some stations relative to the first of them.

    Parameters
    ----------
    values : ndarray, shape (k, 6)
        Shift and rotation of each; zeros for the first, and along what is not told.
    covariance : ndarray, shape (6 k, 6 k)
        Very large where nothing is told.
    weights : ndarray, shape (e,)
        With which each of the equations went in.
    """

    values: Array
    covariance: Array
    weights: Array


def solve(equations: Sequence[Equations], n_stations: int, spread: float) -> Solution:
    """Solve for the corrections of all stations, the first one held.

    Parameters
    ----------
    equations : sequence of Equations
        Of the elements.
    n_stations : int
    spread : float
        Half the extent of the cloud, metres: turns are told as shifts at this distance.

    Returns
    -------
    Solution
    """
    size = 6 * n_stations
    unit = np.tile([1.0, 1.0, 1.0, 1 / spread, 1 / spread, 1 / spread], n_stations)
    # What is not told at all has the standard deviation of a thousand times the limit.
    nothing = np.eye(size) / (1e3 * UNTOLD_SD) ** 2
    scaled = [_scaled(e, unit) for e in equations]
    weights = np.ones(len(equations))
    values, covariance = np.zeros(size), np.zeros((size, size))
    for _ in range(N_REWEIGHTINGS):
        matrix, right = nothing.copy(), np.zeros(size)
        for weight, (rows, part, side) in zip(weights, scaled, strict=True):
            matrix[np.ix_(rows, rows)] += weight * part
            right[rows] += weight * side
        inverse = np.zeros((size, size))
        inverse[6:, 6:] = np.linalg.inv(matrix[6:, 6:])
        values = inverse @ right
        misfits = [_misfit(part, side, values[rows]) for rows, part, side in scaled]
        square = np.array([m[0] for m in misfits])
        freedoms = np.array([m[1] for m in misfits])
        excess = np.sqrt(square / np.maximum(freedoms, 1))
        usual = _usual_excess(excess, freedoms)
        weights = np.minimum(1.0, CUT * usual / np.maximum(excess, 1e-12))
        left = (weights * freedoms).sum() - np.linalg.matrix_rank(matrix[6:, 6:] - nothing[6:, 6:])
        factor = 1.0
        if left >= FEWEST_FREEDOMS:
            factor = max(1.0, float((weights * square).sum() / left))
        # Squared weights of the misfits would say the same with more words.
        covariance = factor * inverse
    values[6:] = _told(values[6:], covariance[6:, 6:])
    return Solution((values * unit).reshape(-1, 6), covariance * np.outer(unit, unit), weights)


def _told(values: Array, covariance: Array) -> Array:
    """Values without their parts along directions that are not told."""
    variances, vectors = np.linalg.eigh(covariance)
    told = vectors[:, variances <= UNTOLD_SD**2]
    return np.asarray(told @ (told.T @ values))


def pair_equations(equations: Sequence[Equations], first: int, second: int) -> list[Equations]:
    """What the elements that two stations have seen tell of these two alone.

    Parameters
    ----------
    equations : sequence of Equations
    first, second : int
        Places of the stations.

    Returns
    -------
    list of Equations
        Of the stations 0 and 1.
    """
    found = []
    for e in equations:
        wanted = [np.flatnonzero(e.stations == s) for s in (first, second)]
        if not all(map(len, wanted)):
            continue
        inside = np.concatenate([6 * int(w[0]) + np.arange(6) for w in wanted])
        outside = np.setdiff1d(np.arange(len(e.right)), inside)
        matrix, right = e.matrix[np.ix_(inside, inside)], e.right[inside]
        if len(outside):
            across = e.matrix[np.ix_(inside, outside)]
            rest = np.linalg.pinv(e.matrix[np.ix_(outside, outside)], NOTHING_SHARE, hermitian=True)
            matrix = matrix - across @ rest @ across.T
            right = right - across @ rest @ e.right[outside]
        own = [int(w[0]) for w in wanted]
        found.append(
            Equations(
                e.element_id, np.arange(2), matrix, right,
                e.square_sum[own], e.weight_sum[own], e.middle,
            )
        )  # fmt: skip
    return found


def told_part(covariance: Array) -> tuple[Array, tuple[Array, ...]]:
    """Split directions by whether they are told.

    Parameters
    ----------
    covariance : ndarray, shape (3, 3)
        Of a shift, metres squared.

    Returns
    -------
    projector : ndarray, shape (3, 3)
        Onto what is told.
    untold : tuple of ndarray
        Unit vectors along the rest; the largest component of each is positive.
    """
    values, vectors = np.linalg.eigh(covariance)
    is_told = np.sqrt(np.maximum(values, 0.0)) <= UNTOLD_SD
    told = vectors[:, is_told]
    untold = [v * np.sign(v[np.argmax(np.abs(v))]) for v in vectors[:, ~is_told].T]
    return told @ told.T, tuple(untold)


def _scaled(e: Equations, unit: Array) -> tuple[Indices, Array, Array]:
    """The rows of an element's stations among all, its equations with turns as shifts."""
    rows = (6 * e.stations[:, None] + np.arange(6)).ravel().astype(np.intp)
    own = unit[rows]
    return rows, e.matrix * np.outer(own, own), e.right * own


def _misfit(part: Array, side: Array, values: Array) -> tuple[float, int]:
    """Sum of squares of what an element tells otherwise, and in how many ways it could."""
    left = side - part @ values
    inverse_values, vectors = np.linalg.eigh(part)
    is_told = inverse_values > RANK_SHARE * inverse_values[-1]
    amounts = (vectors[:, is_told].T @ left) ** 2 / inverse_values[is_told]
    return float(amounts.sum()), int(is_told.sum())


def _usual_excess(excess: Array, freedoms: Array) -> float:
    """How far elements are usually off, in standard deviations; not below 1."""
    if freedoms.sum() < FEWEST_FREEDOMS:
        return 1.0
    return max(1.0, float(np.median(excess[freedoms > 0])))
