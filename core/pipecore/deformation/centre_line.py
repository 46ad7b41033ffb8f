"""Bow and kink: the line of centres against its chord."""

from dataclasses import dataclass

import numpy as np

from pipecore.deformation.contour import Contour, inner_rows
from pipecore.deformation.deviation_map import Grid
from pipecore.deformation.free_sections import FreeSections
from pipecore.geometry import AnyAxis, Array, CurveAxis, offsets_from_chord

KINK_ADVANTAGE = 20.0
"""How much lower the χ² of two straight pieces must be than that of smooth bows."""

MAX_KINK_SHARE = 0.6
"""The same as a share: where both fit badly, neither is the better."""

CENTRE_KNOTS = 1.5
"""Diameters between the knots of the contour that the line of centres is taken from."""

ROUNDED = 0.25
"""Diameters to either side of a kink over which profiles show both of its arms."""

MAX_BINS = 60
"""Profiles are pooled into at most so many places along the line."""

MIN_KINK = np.deg2rad(0.3)
MIN_BOW_RATIO = 0.001
"""A pipe counts as bowed from 3.2 mm in 3 m (ASTM A999)."""
LEAST_SD = 1e-6
"""No centre is known better, metres; rounding can bring a variance below zero."""


@dataclass(frozen=True)
class CentreLine:
    """How far the measured axis leaves its chord, at most.

    `chainage` and `clock` say where and to which side, `is_kink` whether it changes
    direction there at once. `explained` is the share of its variation (χ²) that a bow or
    a kink explains: a place where something else was taken for the pipe is neither.
    """

    straightness: float
    straightness_sd: float
    chainage: float
    clock: float
    is_kink: bool
    explained: float


def measure_centre_line(contour: Contour, sections: FreeSections, axis: AnyAxis) -> CentreLine:
    """Measure how far the line of centres leaves the chord of its ends.

    Parameters
    ----------
    contour : Contour
        Fitted with a constant radius.
    sections : FreeSections
        Of the same surface, dents left out: the contour would round a kink's corner.
    axis : AnyAxis
        That the surface is about: what a curved one has of the bow belongs to it.

    Returns
    -------
    CentreLine
    """
    inner = inner_rows(contour.grid)
    s = contour.grid.chainages[inner]
    of_axis = offsets_from_chord(axis, contour.grid.chainages)
    offset = contour.terms[inner, 1:3] + of_axis[inner]
    # The ends of a curved axis are known; those of the contour's rows lie a little within.
    ends = np.array([0.0, axis.length]) if isinstance(axis, CurveAxis) else s[[0, -1]]
    at_ends = contour.terms[inner, 1:3][[0, -1]] + offsets_from_chord(axis, ends)
    deviation = offset - _chord(s, ends, at_ends)
    distance = np.hypot(deviation[:, 0], deviation[:, 1])
    peak = int(np.argmax(distance))
    side = deviation[peak] / max(distance[peak], 1e-12)
    # The chord's ends are as uncertain as the peak: add their shares.
    share = (s[peak] - s[0]) / (s[-1] - s[0])
    covariance = contour.term_covariance[inner, 1:3, 1:3]
    variance = [max(float(side @ covariance[i] @ side), LEAST_SD**2) for i in (peak, 0, -1)]
    sd = np.sqrt(variance[0] + (1 - share) ** 2 * variance[1] + share**2 * variance[2])
    clock = float(np.mod(np.arctan2(side[1], side[0]), 2 * np.pi))
    shape = _shape_of(*_binned(contour, sections, side, of_axis), contour.grid)
    if shape.kink is not None:
        knee, sag, sag_sd = shape.kink
        return CentreLine(sag, max(sag_sd, float(sd)), knee, clock, True, shape.explained)
    return CentreLine(
        float(distance[peak]), float(sd), float(s[peak]), clock, False, shape.explained
    )


def _chord(s: Array, ends: Array, at_ends: Array) -> Array:
    """The line between the ends, at chainages `s`."""
    share = ((s - ends[0]) / (ends[1] - ends[0]))[:, None]
    return np.asarray(at_ends[0] * (1 - share) + at_ends[1] * share)


@dataclass(frozen=True)
class _Shape:
    """How much of the line's variation a bow or a kink explains, and the kink if it is one."""

    explained: float
    kink: tuple[float, float, float] | None


def _binned(
    contour: Contour, sections: FreeSections, side: Array, of_axis: Array
) -> tuple[Array, Array, Array]:
    """Chainages, and centres of pooled profiles to one side with their standard deviations."""
    inner = np.flatnonzero(inner_rows(contour.grid))
    size = max(1, -(-len(inner) // MAX_BINS)) // 2 * 2 + 1
    middles = inner[size // 2 :: size]
    centre, covariance = sections.pooled(size).centres(contour.terms[:, 0])
    middles = middles[np.isfinite(centre[middles, 0])]
    variance = np.einsum("k,rkl,l->r", side, covariance[middles], side)
    sd = np.sqrt(np.maximum(variance, LEAST_SD**2))
    return contour.grid.chainages[middles], (centre + of_axis)[middles] @ side, sd


def _shape_of(s: Array, lateral: Array, sd: Array, grid: Grid) -> _Shape:
    """Compare the line of centres with smooth bows and with two straight pieces.

    The bows are those of a beam under an even load however its ends are held, and of
    parts of one: curves of the fourth degree. The kink is given as chainage, sag and its deviation.
    """
    if len(s) < 8:
        return _Shape(0.0, None)
    x = (s - s[0]) / (s[-1] - s[0])
    y = lateral / sd
    waves, _ = np.linalg.qr(np.stack([x**k for k in range(5)], axis=1) / sd[:, None])
    share = waves.T @ y
    straight = float(y @ y - share[:2] @ share[:2])
    smooth = float(y @ y - share @ share)
    # What a kink at each place adds to the straight line.
    knees = x[2:-2]
    kinks = np.maximum(x[:, None] - knees, 0) / sd[:, None]
    kinks -= waves[:, :2] @ (waves[:, :2].T @ kinks)
    size, along = np.sum(kinks**2, axis=0), kinks.T @ y
    k = int(np.argmax(along**2 / size))
    best = straight - float(along[k] ** 2 / size[k])
    turn, where = abs(float(along[k] / size[k])), float(knees[k])
    explained = 1.0 - min(best, smooth) / max(straight, 1e-300)
    length = float(s[-1] - s[0])
    if best + KINK_ADVANTAGE > smooth or best > MAX_KINK_SHARE * smooth or turn / length < MIN_KINK:
        return _Shape(explained, None)
    knee = float(s[0]) + where * length
    return _Shape(explained, _measure_kink(s, lateral, sd, knee, turn / length, grid))


def _measure_kink(
    s: Array, lateral: Array, sd: Array, knee: float, turn: float, grid: Grid
) -> tuple[float, float, float]:
    """Chainage of a kink, its sag from end to end of the element, and the sag's deviation.

    Profiles across the corner show both pieces: these are measured away from it, where they
    are long enough. `turn` is what they turn by if they are not.
    """
    away = np.abs(s - knee) > ROUNDED * 2 * grid.radius
    sides = [np.flatnonzero(away & (s < knee)), np.flatnonzero(away & (s > knee))]
    if min(map(len, sides)) < 4:
        sides = [np.flatnonzero(s < knee), np.flatnonzero(s > knee)]
    else:
        rows = np.concatenate(sides)
        design = np.stack([np.ones_like(s), s, np.maximum(s - knee, 0)], axis=1) / sd[:, None]
        solution, *_ = np.linalg.lstsq(design[rows], (lateral / sd)[rows], rcond=None)
        turn = abs(float(solution[2]))
    variance = 0.0
    for side in sides:
        span = float(np.ptp(s[side]))
        variance += 12 * float(np.mean(sd[side] ** 2)) / (len(side) * span**2)
    arm = knee * (grid.length - knee) / grid.length
    return knee, turn * arm, float(np.sqrt(variance)) * arm
