"""What runs of profiles that leave the element's pattern are: crumples, ovality, twists."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import convolve1d

from pipecore.deformation.criteria import ProfileCriteria
from pipecore.deformation.deviation_map import DeviationMap
from pipecore.deformation.free_sections import joined, n_rows_of
from pipecore.deformation.ovality import OvalStretch, true_ranges
from pipecore.geometry import Array

RING_WINDOW = 0.2
"""Profiles pooled for the rings of a crumple, radii: a ring is about half a radius long."""

RING_GAP = 1.0
"""Largest distance between neighbouring rings of one crumple, radii."""

MIN_RING_CHANGES = 2
"""Least number of changes from larger to smaller and back: a dent with a raised rim has one to
either side, but they are no rings."""

N_SECTORS, MIN_RING_SECTORS, MIN_RING_SHARE = 8, 0.7, 0.4
"""A ring goes round: this share of the sectors that are seen has at least this share of its
height."""

OVAL_WINDOW = 1.0
"""Profiles pooled for ovality, radii."""

OVAL_DOMINANCE = 2.0
"""How many times larger the second harmonic is than the first: a dent's is the smaller one."""

MIN_TWIST, MIN_TWIST_SHARE = np.deg2rad(45.0), 0.8
"""Least turn of the widest diameter along a twist, and the share of its direction's variation
that an even turn explains."""


@dataclass(frozen=True)
class CrumpledStretch:
    """Rows [first, last] of a grid with rings, and the row of the largest.

    `height` is its size, outward positive, with the standard deviation `sd`, metres; `clock`
    is a place where it is seen, radians.
    """

    first: int
    last: int
    peak: int
    height: float
    sd: float
    clock: float


def crumpled_stretches(
    criteria: ProfileCriteria, cells: DeviationMap, min_height: float
) -> list[CrumpledStretch]:
    """Find the stretches where the mean radius grows and shrinks in turn.

    Parameters
    ----------
    criteria : ProfileCriteria
    cells : DeviationMap
        That they are of.
    min_height : float
        Of the largest and of the smallest ring, metres.

    Returns
    -------
    list of CrumpledStretch
        In order of chainage.
    """
    grid = criteria.grid
    height, sd = criteria.radius_deviation(RING_WINDOW)
    strong = criteria.significant_radius(RING_WINDOW) & (np.abs(height) >= min_height)
    strong &= _goes_round(criteria, cells, height)
    # Pooled profiles find the rings; a single one does not flatten them.
    height, sd = criteria.radius_deviation(0.0)
    found = []
    for first, last in true_ranges(joined(strong, n_rows_of(grid, RING_GAP * grid.radius))):
        rows = first + np.flatnonzero(strong[first : last + 1])
        if np.count_nonzero(np.diff(np.sign(height[rows]))) >= MIN_RING_CHANGES:
            peak = int(rows[np.argmax(np.abs(height[rows]))])
            clock = float(grid.clocks[np.argmax(cells.count[peak])])
            stretch = CrumpledStretch(
                first, last, peak, float(height[peak]), float(sd[peak]), clock
            )
            found.append(stretch)
    return found


def _goes_round(criteria: ProfileCriteria, cells: DeviationMap, height: Array) -> np.ndarray:
    """Whether a row's deviation from the pattern is that of a ring, not of one side."""
    grid = criteria.grid
    weight = cells.count
    off = np.where(weight > 0, cells.deviation - criteria.pattern.height, 0.0) * weight
    sector = np.arange(grid.n_columns) * N_SECTORS // grid.n_columns
    member = (sector[:, None] == np.arange(N_SECTORS)).astype(np.float64)
    size = n_rows_of(grid, RING_WINDOW * grid.radius)
    total, mass = (
        convolve1d(values @ member, np.ones(size), axis=0, mode="constant")
        for values in (off, weight)
    )
    is_seen = mass > 0
    mean = np.where(is_seen, total / np.maximum(mass, 1e-12), 0.0)
    agrees = is_seen & (mean * np.sign(height)[:, None] >= MIN_RING_SHARE * np.abs(height)[:, None])
    n_seen = np.maximum(is_seen.sum(axis=1), 1)
    return np.asarray(agrees.sum(axis=1) >= MIN_RING_SECTORS * n_seen)


def free_oval_stretches(criteria: ProfileCriteria, min_ovality: float) -> list[OvalStretch]:
    """Find the stretches at least one diameter long whose free sections are oval.

    Parameters
    ----------
    criteria : ProfileCriteria
    min_ovality : float
        Ratio (Dmax - Dmin) / Dnom that its peak has to reach.

    Returns
    -------
    list of OvalStretch
        In order of chainage.
    """
    grid = criteria.grid
    terms, covariance = criteria.deviations(OVAL_WINDOW)
    oval, variance = _second_harmonic(terms, covariance)
    others = np.hypot(np.hypot(terms[:, 1], terms[:, 2]), terms[:, 0])
    to_ratio = 2.0 / grid.radius
    sd = np.sqrt(variance) * to_ratio
    ovality = np.where(oval >= OVAL_DOMINANCE * others, oval * to_ratio, 0.0)
    is_oval = np.nan_to_num(ovality) > 0.5 * min_ovality
    reach = n_rows_of(grid, 0.5 * grid.radius)
    is_significant = criteria.significant_ovality(OVAL_WINDOW)
    found = []
    for first, last in true_ranges(joined(is_oval, reach)):
        rows = slice(first, last + 1)
        peak = first + int(np.argmax(np.nan_to_num(ovality[rows])))
        is_long = (last + 1 - first) * grid.row_size >= 2 * grid.radius
        if is_long and is_significant[peak] and ovality[peak] >= min_ovality:
            clock = float(np.mod(np.arctan2(terms[peak, 4], terms[peak, 3]) / 2, 2 * np.pi))
            stretch = OvalStretch(
                first, last, peak, float(ovality[peak]), float(sd[peak]), clock,
                float(ovality[peak] / sd[peak]),
            )  # fmt: skip
            found.append(stretch)
    return found


def measured_freely(stretch: OvalStretch, criteria: ProfileCriteria) -> OvalStretch:
    """Return an oval stretch with the ovality of its own sections, which nothing smooths.

    Parameters
    ----------
    stretch : OvalStretch
    criteria : ProfileCriteria

    Returns
    -------
    OvalStretch
        That of the upper quarter of its rows; as it was where they cannot be measured.
    """
    grid = criteria.grid
    length = (stretch.last + 1 - stretch.first) * grid.row_size
    window = min(OVAL_WINDOW, 0.25 * length / grid.radius)
    rows = slice(stretch.first, stretch.last + 1)
    # The strongest of many rows reads high: every other row says which are, the rest how oval.
    first, second = (criteria.every_other(start).deviations(window) for start in (0, 1))
    parts = []
    for (chosen, _), (terms, covariance) in ((first, second), (second, first)):
        amplitude = np.hypot(chosen[rows, 3], chosen[rows, 4])
        known = np.isfinite(amplitude) & np.isfinite(terms[rows, 3])
        if not known.any():
            return stretch
        strong = known & (np.nan_to_num(amplitude) >= np.quantile(amplitude[known], 0.75))
        variance = np.trace(covariance[rows, 3:5, 3:5], axis1=1, axis2=2)[strong] / 2
        square = np.sum(terms[rows, 3:5][strong] ** 2, axis=1)
        n_apart = max(1.0, np.count_nonzero(strong) / n_rows_of(grid, window * grid.radius))
        parts.append((np.mean(square) - 2 * np.mean(variance), np.mean(variance) / n_apart))
    to_ratio = 2.0 / grid.radius
    square, variance = np.mean(parts, axis=0)
    ovality, sd = np.sqrt(max(square, 0.0)), np.sqrt(variance / 2)
    return replace(stretch, ovality=float(ovality * to_ratio), ovality_sd=float(sd * to_ratio))


def turn_along(stretch: OvalStretch, criteria: ProfileCriteria) -> float:
    """Return by how much the widest diameter turns along an oval stretch, if it turns evenly.

    Parameters
    ----------
    stretch : OvalStretch
    criteria : ProfileCriteria

    Returns
    -------
    float
        Radians, signed; 0 where the direction does not turn evenly by `MIN_TWIST`.
    """
    grid = criteria.grid
    terms, covariance = criteria.deviations(OVAL_WINDOW)
    rows = np.arange(stretch.first, stretch.last + 1)
    oval, variance = _second_harmonic(terms[rows], covariance[rows])
    rows, variance = rows[np.isfinite(oval)], variance[np.isfinite(oval)]
    if len(rows) < 4:
        return 0.0
    phase = np.unwrap(np.arctan2(terms[rows, 4], terms[rows, 3]))
    weight = np.hypot(terms[rows, 3], terms[rows, 4]) ** 2 / variance
    s = grid.chainages[rows]
    s, phase = s - np.average(s, weights=weight), phase - np.average(phase, weights=weight)
    slope = float(np.sum(weight * s * phase) / np.sum(weight * s**2))
    left = float(np.sum(weight * (phase - slope * s) ** 2))
    share = 1 - left / max(float(np.sum(weight * phase**2)), 1e-300)
    turn = slope * float(np.ptp(s)) / 2
    n_apart = max(1.0, len(rows) / n_rows_of(grid, OVAL_WINDOW * grid.radius))
    sd = float(np.sqrt(len(rows) / n_apart / np.sum(weight * s**2))) * float(np.ptp(s)) / 2
    is_even = share >= MIN_TWIST_SHARE and abs(turn) >= max(MIN_TWIST, criteria.significance * sd)
    return turn if is_even else 0.0


def _second_harmonic(terms: Array, covariance: Array) -> tuple[Array, Array]:
    """Amplitude of second harmonics less what noise alone gives it, and its variance."""
    variance = np.trace(covariance[:, 3:5, 3:5], axis1=1, axis2=2) / 2
    amplitude = np.sqrt(np.maximum(terms[:, 3] ** 2 + terms[:, 4] ** 2 - variance, 0.0))
    return np.where(np.isfinite(terms[:, 3]), amplitude, np.nan), variance
