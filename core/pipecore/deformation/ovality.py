"""Ovality: the second harmonic of the contour along the pipe."""

from dataclasses import dataclass

import numpy as np

from pipecore.deformation.contour import Contour
from pipecore.deformation.free_sections import offset_terms
from pipecore.geometry import Array

MIN_ARC = np.deg2rad(200.0)
"""Below this the second harmonic cannot be separated from a shift of the centre."""

AMONG_ROWS = 1.1
"""Factor on the significance of a stretch: its peak is the largest of many rows."""


@dataclass(frozen=True)
class OvalStretch:
    """Rows [first, last] of a grid that are oval, with the largest ovality among them.

    `ovality` and `ovality_sd` are ratios, (Dmax - Dmin) / Dnom; `clock` is where the
    section is widest.
    """

    first: int
    last: int
    peak: int
    ovality: float
    ovality_sd: float
    clock: float
    z: float


def ovality_along(contour: Contour) -> tuple[Array, Array, Array]:
    """Return the ovality of every row of a contour.

    Noise alone gives a positive amplitude; its mean contribution is subtracted.

    Parameters
    ----------
    contour : Contour
        Fitted with five terms.

    Returns
    -------
    ovality, ovality_sd, clock : ndarray, shape (rows,)
        Ratios (Dmax - Dmin) / Dnom with their standard deviations, and the clock angle of the
        largest diameter, radians.
    """
    a2, b2 = (contour.terms[:, 3:5] - _of_offsets(contour)).T
    variance = np.trace(contour.term_covariance[:, 3:5, 3:5], axis1=1, axis2=2) / 2
    amplitude = np.sqrt(np.maximum(a2**2 + b2**2 - variance, 0.0))
    to_ratio = 2.0 / contour.grid.radius
    clock = np.mod(np.arctan2(b2, a2) / 2, 2 * np.pi)
    return amplitude * to_ratio, np.sqrt(variance) * to_ratio, clock


def _of_offsets(contour: Contour) -> Array:
    """What the centres' offsets from the axis alone add to second harmonics, shape (rows, 2)."""
    terms = contour.terms
    return offset_terms(terms[:, 1], terms[:, 2], contour.grid.radius)[:, 3:5]


def mean_ovality(contour: Contour) -> tuple[float, float]:
    """Return the ovality of an element's mean section.

    Parameters
    ----------
    contour : Contour
        Fitted with five terms.

    Returns
    -------
    ovality, ovality_sd : float
        Ratio (Dmax - Dmin) / Dnom and its standard deviation.
    """
    weights = contour.basis.mean
    mean = (weights @ contour.coefficients)[3:5] - _of_offsets(contour).mean(axis=0)
    covariance = np.einsum("a,akbl,b->kl", weights, contour.covariance, weights)[3:5, 3:5]
    variance = float(np.trace(covariance)) / 2
    amplitude = np.sqrt(max(float(mean @ mean) - variance, 0.0))
    to_ratio = 2.0 / contour.grid.radius
    return float(amplitude * to_ratio), float(np.sqrt(variance) * to_ratio)


def oval_stretches(contour: Contour, min_ovality: float, significance: float) -> list[OvalStretch]:
    """Find the stretches at least one diameter long that are oval.

    A stretch continues where the ovality stays above half of `min_ovality`.

    Parameters
    ----------
    contour : Contour
        Fitted with five terms.
    min_ovality : float
        Ratio (Dmax - Dmin) / Dnom that its peak has to reach.
    significance : float
        Of the settings: how many standard deviations.

    Returns
    -------
    list of OvalStretch
        In order of chainage.
    """
    ovality, sd, clock = ovality_along(contour)
    found = []
    for first, last in true_ranges((ovality > 0.5 * min_ovality) & (sd < min_ovality)):
        peak = first + int(np.argmax(ovality[first : last + 1]))
        long_enough = (last + 1 - first) * contour.grid.row_size >= 2 * contour.grid.radius
        is_clear = ovality[peak] > max(AMONG_ROWS * significance * sd[peak], min_ovality)
        if long_enough and is_clear:
            # The strongest value of many reads high: the stretch's upper quarter is its ovality.
            strong = first + np.flatnonzero(
                ovality[first : last + 1] >= np.quantile(ovality[first : last + 1], 0.75)
            )
            value = float(np.mean(ovality[strong]))
            found.append(
                OvalStretch(
                    first,
                    last,
                    peak,
                    value,
                    float(sd[peak]),
                    float(clock[peak]),
                    float(ovality[peak] / sd[peak]),
                )
            )
    return found


def true_ranges(flags: np.ndarray) -> list[tuple[int, int]]:
    """Return the first and last index of each unbroken sequence of true values.

    Parameters
    ----------
    flags : ndarray of bool, shape (n,)

    Returns
    -------
    list of (int, int)
    """
    edges = np.diff(np.concatenate([[0], flags.astype(np.int8), [0]]))
    return list(
        zip(
            np.flatnonzero(edges == 1).tolist(),
            (np.flatnonzero(edges == -1) - 1).tolist(),
            strict=True,
        )
    )
