"""How far a surface reaches along its axis, and whether its section is round."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipecore._kernels import axis_rows as kernels
from pipecore._kernels import misfit as misfit_kernels
from pipecore.rounding import NO_ROUNDING, Rounding

Array = NDArray[np.float64]

MAX_GAP_RADII = 4.0
"""An element goes on across gaps of this many radii, or of `MAX_GAP_M`."""
MAX_GAP_M = 0.25
MIN_REPORTED_GAP_RADII = 2.0
"""Gaps of at least this many radii are reported."""
MIN_ARC_SHARE = 0.45
"""A step of axis is covered if it shows this share of the element's usual arc, and ..."""
MIN_COVERED_ARC, MIN_COVERED_ARC_SHARE = float(np.deg2rad(50.0)), 0.8
"""... this arc, or the latter share of the usual one where that is less."""
MIN_OVAL_ARC = float(np.deg2rad(200.0))
MAX_OVAL_RADII = 0.05
"""From this arc on an oval section can be distinguished, up to this amplitude in radii."""
MAX_OVAL_RESIDUAL_SHARE = 0.6
"""An oval section leaves at most this share of what a round one does: a bow leaves more."""
MIN_TURNING = 0.4
"""Normals turn with the clock by at least this share of what a round surface's do."""
MAX_SECTORS = 36
MIN_IN_SECTOR = 5, 0.02
"""Sectors of fewer points, or of a smaller share of all, are not used for the section."""
MIN_NARROWER_ARC = float(np.deg2rad(75.0))
"""A dent shows less of an arc inside the surface than a narrower pipe does."""
MAX_STEP_M = 0.03
"""Longest step, metres: ends of wide vessels are found as well as those of pipes."""


@dataclass(frozen=True)
class Extent:
    """Where along an axis a surface has points.

    Parameters
    ----------
    low, high : float
        Chainages of the first and last point.
    arc : float
        Median arc that covered steps show, radians.
    coverage : float
        Share of the steps between `low` and `high` that are covered.
    gaps : tuple of (float, float)
        Chainages between which steps are not covered.
    """

    low: float
    high: float
    arc: float
    coverage: float
    gaps: tuple[tuple[float, float], ...]


def find_extent(
    chainage: Array,
    clock: Array,
    residual: Array,
    normal_angle: Array,
    inside: Callable[[float, float], Array],
    length: float,
    radius: float,
    spacing: float,
    sigma: float,
) -> Extent | None:
    """Find how far points on a surface cover its axis, outward from where it was proposed.

    A step of axis is covered if points lie around enough of it, most of them on the
    surface, and their normals turn with the clock: where a bend, a reducer or a flange
    takes over, the residuals grow together; where a pipe leaves the floor that it lies
    on, the strip of floor below its axis is as near, but flat. Across a gap in which
    something round shows inside the surface it does not go on: between two flanges is
    their pipe.

    Parameters
    ----------
    chainage, clock, residual : ndarray, shape (n,)
        Of the points near the surface.
    normal_angle : ndarray, shape (n,)
        Angle from the surface's normal to each point's, towards increasing clock.
    inside : callable
        Asked, only where there are gaps, for chainage and clock, shape (2, m), of the points
        well inside the surface whose normals agree with it, between two chainages.
    length : float
        The proposed extent is chainage 0 … `length`.
    radius, spacing, sigma : float
        Radius, distance between neighbouring points and noise, metres.

    Returns
    -------
    Extent or None
        None if no step of the proposed extent is covered.
    """  # fmt: skip
    if len(chainage) == 0:
        return None
    step = max(2.0 * spacing, min(0.15 * radius, MAX_STEP_M))
    base = float(chainage.min())
    # A sector is wide enough to hold a point wherever the surface is seen.
    n_sectors = int(min(max(2 * np.pi * radius / (2.0 * spacing), 12), MAX_SECTORS))
    # Half of normal residuals are below 0.67 sigma.
    max_off = 1.2 * sigma + min(0.006 * radius, 0.0015)
    arc, covered, n_core = kernels.cover_rows(
        chainage, clock, residual, normal_angle, length, radius, base, step, n_sectors,
        (MIN_ARC_SHARE, MIN_COVERED_ARC, MIN_COVERED_ARC_SHARE, max_off,
         MIN_OVAL_ARC, MAX_OVAL_RADII, MAX_OVAL_RESIDUAL_SHARE, MIN_TURNING),
    )  # fmt: skip
    if n_core == 0:
        return None
    arcs_inside = np.zeros(len(covered) - 1)
    if covered[-1] - covered[0] >= len(covered):
        gaps = np.flatnonzero(np.diff(covered) > 1)
        begin, end = covered[gaps[0]] + 1, covered[gaps[-1] + 1]
        at, around = inside(base + begin * step, base + end * step)
        arcs_inside = kernels.arcs_in_gaps(at, around, base, step, covered, MAX_SECTORS)
    longest_gap = max(MAX_GAP_RADII * radius, MAX_GAP_M)
    place, place_last = kernels.best_part(
        covered, arcs_inside, base, step, length, longest_gap, MIN_NARROWER_ARC
    )
    part = covered[place : place_last + 1]
    first, last = int(part[0]), int(part[-1])
    low, high = kernels.bounds_of(chainage, base, step, first, last)
    breaks: Iterable[int] = ()
    if len(part) < last - first + 1:
        breaks = np.flatnonzero((np.diff(part) - 1) * step > MIN_REPORTED_GAP_RADII * radius)
    return Extent(
        low,
        high,
        float(np.median(arc[part])),
        len(part) / (last - first + 1),
        tuple((base + (part[b] + 1) * step, base + part[b + 1] * step) for b in breaks),
    )


def section_misfit(
    clock: Array, residual: Array, arc: float, rounding: Rounding = NO_ROUNDING
) -> float:
    """How far the mean section leaves the shapes that a pipe has, root mean square in metres.

    Those shapes are the circle and, on long arcs, the oval. Corners of boxes
    and the flanges of beams keep a residual in every sector around the axis. What rounding
    of the coordinates leaves there is no misfit.
    """
    n_harmonics = 2 if arc > MIN_OVAL_ARC else 1
    misfit = misfit_kernels.section_misfit(
        clock, residual, MAX_SECTORS, *MIN_IN_SECTOR, n_harmonics
    )
    if rounding.step and len(residual):
        by_rounding = float(rounding.neighbours_sd(float(np.std(residual))))
        misfit = np.sqrt(max(misfit**2 - by_rounding**2, 0.0))
    return float(misfit)
