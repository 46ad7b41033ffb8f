"""How far a surface reaches along its axis, and whether its section is round."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from pipecore._kernels import extent as kernels
from pipecore._kernels import misfit as misfit_kernels

Array = NDArray[np.float64]

MAX_GAP = 4.0
"""An element goes on across gaps of this many radii, or of `MAX_GAP_LENGTH`."""
MAX_GAP_LENGTH = 0.25
SHOWN_GAP = 2.0
"""Gaps of at least this many radii are reported."""
MIN_COVERED_ARC = float(np.deg2rad(50.0))
"""... or 0.8 of what it usually shows."""
SHARE_OF_ARC = 0.45
"""A step of axis is covered if it shows this share of the arc that the element usually shows."""
OVAL_ARC = float(np.deg2rad(200.0))
MAX_OVAL = 0.05
"""From this arc on an oval section can be told, up to this amplitude in radii."""
OVAL_SHARE = 0.6
"""An oval section leaves at most this share of what a round one does: a bow leaves more."""
MIN_TURNING = 0.4
"""Normals turn with the clock by at least this share of what a round surface's do."""
MAX_SECTORS = 36
LEAST_IN_SECTOR = 5, 0.02
"""Sectors of fewer points, or of a smaller share of all, tell nothing of the section."""
MIN_NARROWER_ARC = float(np.deg2rad(75.0))
"""A dent shows less of an arc inside the surface than a narrower pipe does."""
LONGEST_STEP = 0.03
"""Ends of wide vessels are to be found as well as those of pipes, metres."""


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
    lean: Array,
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
    lean : ndarray, shape (n,)
        Angle from the surface's normal to each point's own, towards increasing clock.
    inside : callable
        Asked, only where there are gaps, for chainage and clock, shape (2, m), of the points
        well inside the surface that face as it does, between two chainages.
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
    step = max(2.0 * spacing, min(0.15 * radius, LONGEST_STEP))
    base = float(chainage.min())
    row = ((chainage - base) / step).astype(np.intp)
    n_rows = int(row.max()) + 1
    # A sector is wide enough to hold a point wherever the surface is seen.
    n_sectors = int(np.clip(2 * np.pi * radius / (2.0 * spacing), 12, MAX_SECTORS))
    seen = np.empty((n_rows, n_sectors), np.bool_)
    kernels.mark_sectors(row, clock, seen)
    arc = seen.sum(axis=1) * (2 * np.pi / n_sectors)
    middle = base + (np.arange(n_rows) + 0.5) * step
    is_core = (middle > 0) & (middle < length)
    if not is_core.any():
        return None
    usual_arc = float(np.quantile(arc[is_core], 0.75))
    # Half of normal residuals are below 0.67 sigma.
    off = _median_by_row(np.abs(residual), row, n_rows)
    max_off = 1.2 * sigma + min(0.006 * radius, 0.0015)
    if np.any((off >= max_off) & (arc > OVAL_ARC)):
        # An oval stretch of a pipe is off the circle, and still the pipe.
        oval = _oval_by_row(clock, residual, row, n_rows, radius)
        of_oval = _median_by_row(np.abs(residual - oval), row, n_rows)
        off = np.where(of_oval < OVAL_SHARE * off, of_oval, off)
    is_covered = (
        (arc >= max(SHARE_OF_ARC * usual_arc, min(MIN_COVERED_ARC, 0.8 * usual_arc)))
        & (off < max_off)
        & (turning_by_row(clock, lean, row, n_rows) > MIN_TURNING)
    )
    covered = np.flatnonzero(is_covered)
    if not is_covered[is_core].any():
        return None
    longest_gap = max(MAX_GAP * radius, MAX_GAP_LENGTH)
    arc_in_gaps = np.zeros(len(covered) - 1)
    gaps = np.flatnonzero(np.diff(covered) > 1)
    if len(gaps):
        begin, end = covered[gaps[0]] + 1, covered[gaps[-1] + 1]
        chainage_inside, clock_inside = inside(base + begin * step, base + end * step)
        seen_inside = _seen_by_row(chainage_inside, clock_inside, base, step, n_rows)
        total = seen_inside.cumsum(axis=0)
        in_gaps = total[covered[1:] - 1] > total[covered[:-1]]
        arc_in_gaps = in_gaps.sum(axis=1) * (2 * np.pi / MAX_SECTORS)
    ends = (np.diff(covered) * step > longest_gap) | (arc_in_gaps > MIN_NARROWER_ARC)
    parts = np.split(covered, np.flatnonzero(ends) + 1)
    part = max(parts, key=lambda p: int(is_core[p].sum()))
    first, last = int(part[0]), int(part[-1])
    breaks = np.flatnonzero((np.diff(part) - 1) * step > SHOWN_GAP * radius)
    return Extent(
        float(chainage[row == first].min()),
        float(chainage[row == last].max()),
        float(np.median(arc[part])),
        len(part) / (last - first + 1),
        tuple((base + (part[b] + 1) * step, base + part[b + 1] * step) for b in breaks),
    )


def _seen_by_row(
    chainage: Array, clock: Array, base: float, step: float, n_rows: int
) -> NDArray[np.int_]:
    """Whether each sector of each row holds a point, 0 or 1, shape (n_rows, sectors)."""
    row = np.floor((chainage - base) / step).astype(np.intp)
    seen = np.empty((n_rows, MAX_SECTORS), np.bool_)
    kernels.mark_sectors(row, clock, seen)
    return seen.astype(np.int_)


def turning_by_row(clock: Array, lean: Array, row: NDArray[np.intp], n_rows: int) -> Array:
    """How much the normals of each row turn with the clock: 1 on a pipe, 0 on a plane."""
    turning = np.empty(n_rows)
    kernels.turn_of_normals(clock, lean, row, turning)
    return turning


def _oval_by_row(
    clock: Array, residual: Array, row: NDArray[np.intp], n_rows: int, radius: float
) -> Array:
    """What an oval section adds to each point's residual; zero where the arc cannot tell.

    Only the second harmonic is taken, up to an ovality of 10 %: a change of radius or of
    centre is another element.
    """
    sector = (clock / (2 * np.pi) * MAX_SECTORS).astype(np.intp) % MAX_SECTORS
    cell = row * MAX_SECTORS + sector
    count = np.bincount(cell, minlength=n_rows * MAX_SECTORS).reshape(n_rows, MAX_SECTORS)
    total = np.bincount(cell, residual, minlength=n_rows * MAX_SECTORS).reshape(count.shape)
    # Three rows together hold enough points.
    count = uniform_filter1d(count.astype(np.float64), 3, axis=0, mode="nearest")
    total = uniform_filter1d(total, 3, axis=0, mode="nearest")
    seen = count > 0
    can_tell = seen.sum(axis=1) * (2 * np.pi / MAX_SECTORS) > OVAL_ARC
    mean = np.where(seen, total / np.where(seen, count, 1.0), 0.0)
    angle = (np.arange(MAX_SECTORS) + 0.5) * (2 * np.pi / MAX_SECTORS)
    terms = [np.ones_like(angle), *(f(k * angle) for k in (1, 2) for f in (np.cos, np.sin))]
    design = np.stack(terms, axis=1)
    normal = np.einsum("rs,sj,sk->rjk", seen[can_tell].astype(np.float64), design, design)
    right = (mean[can_tell] * seen[can_tell]) @ design
    second = np.zeros((n_rows, 2))
    second[can_tell] = np.linalg.solve(normal + 1e-6 * np.eye(5), right[..., None])[:, 3:, 0]
    size = np.hypot(second[:, 0], second[:, 1])
    second *= (size < MAX_OVAL * radius)[:, None]
    return np.asarray(second[row, 0] * np.cos(2 * clock) + second[row, 1] * np.sin(2 * clock))


def _median_by_row(values: Array, row: NDArray[np.intp], n_rows: int) -> Array:
    """Median of the values of each row; infinite where there are none."""
    medians = np.empty(n_rows)
    kernels.upper_medians(values, row, medians)
    return medians


def sphere_misfit(outward: Array, residual: Array) -> float:
    """How far a surface leaves a sphere, root mean square of the medians of its patches."""
    azimuth = np.mod(np.arctan2(outward[:, 1], outward[:, 0]), 2 * np.pi)
    # Patches of equal area: even steps of height and of azimuth.
    patch = (azimuth / (2 * np.pi) * 12).astype(np.intp) % 12
    patch = patch * 8 + np.clip((outward[:, 2] + 1.0) * 4, 0, 7).astype(np.intp)
    median = _median_by_row(residual, patch, 96)
    used = np.bincount(patch, minlength=96) >= 5
    return float(np.sqrt(np.mean(median[used] ** 2))) if used.any() else np.inf


def section_misfit(clock: Array, residual: Array, arc: float) -> float:
    """How far the mean section leaves the shapes that a pipe has, root mean square in metres.

    Those shapes are the circle and, where the arc can tell, the oval. Corners of boxes
    and the flanges of beams keep a residual of their own in every sector around the axis.
    """
    n_harmonics = 2 if arc > OVAL_ARC else 1
    return float(
        misfit_kernels.section_misfit(clock, residual, MAX_SECTORS, *LEAST_IN_SECTOR, n_harmonics)
    )
