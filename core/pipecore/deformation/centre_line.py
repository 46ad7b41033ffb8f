"""Bow and kink: the line of centres against its chord."""

from dataclasses import dataclass

import numpy as np

from pipecore.deformation.reference import Contour, inner_rows
from pipecore.geometry import Array

KINK_ADVANTAGE = 20.0
"""How much lower the χ² of two straight pieces must be than that of smooth bows."""

MIN_KINK = np.deg2rad(0.3)
MIN_BOW_RATIO = 0.001
"""A pipe counts as bowed from 3.2 mm in 3 m (ASTM A999)."""


@dataclass(frozen=True)
class CentreLine:
    """How far the measured axis leaves its chord, at most.

    `chainage` and `clock` say where and to which side, `is_kink` whether it changes
    direction there at once.
    """

    straightness: float
    straightness_sd: float
    chainage: float
    clock: float
    is_kink: bool


def measure_centre_line(contour: Contour) -> CentreLine:
    """Measure a contour fitted with a constant radius against the chord of its ends."""
    inner = inner_rows(contour.grid)
    s = contour.grid.chainages[inner]
    offset = contour.terms[inner, 1:3]
    deviation = offset - _chord(s, offset)
    distance = np.hypot(deviation[:, 0], deviation[:, 1])
    peak = int(np.argmax(distance))
    side = deviation[peak] / max(distance[peak], 1e-12)
    # The chord's ends are as uncertain as the peak: add their shares.
    share = (s[peak] - s[0]) / (s[-1] - s[0])
    covariance = contour.term_covariance[inner, 1:3, 1:3]
    variance = [float(side @ covariance[i] @ side) for i in (peak, 0, -1)]
    sd = np.sqrt(variance[0] + (1 - share) ** 2 * variance[1] + share**2 * variance[2])
    clock = float(np.mod(np.arctan2(side[1], side[0]), 2 * np.pi))
    kink = _find_kink(s, deviation @ side, covariance, side)
    if kink is not None:
        # The contour is smooth and rounds the corner; the two straight pieces do not.
        return CentreLine(kink[1], float(sd), kink[0], clock, True)
    return CentreLine(float(distance[peak]), float(sd), float(s[peak]), clock, False)


def _chord(s: Array, offset: Array) -> Array:
    share = ((s - s[0]) / (s[-1] - s[0]))[:, None]
    return np.asarray(offset[0] * (1 - share) + offset[-1] * share)


def _find_kink(
    s: Array, lateral: Array, covariance: Array, side: Array
) -> tuple[float, float] | None:
    """Chainage and sag of a kink, if two straight pieces fit better than smooth bows.

    These are a parabola and the line of a beam clamped at both ends, with as many
    parameters as the two pieces.
    """
    step = max(1, len(s) // 40)
    s, lateral = s[::step], lateral[::step]
    if len(s) < 8:
        return None
    sd = np.sqrt(np.einsum("k,rkl,l->r", side, covariance[::step], side))
    x = (s - s[0]) / (s[-1] - s[0])

    def chi2(columns: list[Array]) -> tuple[float, Array]:
        design = np.stack(columns, axis=1) / sd[:, None]
        solution, *_ = np.linalg.lstsq(design, lateral / sd, rcond=None)
        return float(np.sum((lateral / sd - design @ solution) ** 2)), solution

    smooth, _ = chi2([np.ones_like(x), x, x**2, np.cos(2 * np.pi * x)])
    best, turn, where = np.inf, 0.0, 0.0
    for knee in x[2:-2]:
        value, solution = chi2([np.ones_like(x), x, np.maximum(x - knee, 0)])
        if value < best:
            best, turn, where = value, abs(float(solution[2])), float(knee)
    length = float(s[-1] - s[0])
    if best + KINK_ADVANTAGE > smooth or turn / length < MIN_KINK:
        return None
    return float(s[0]) + where * length, turn * where * (1 - where)
