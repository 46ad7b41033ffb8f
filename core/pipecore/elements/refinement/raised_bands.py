"""Bands around a pipe: clamps, straps, ribs and weld beads that stand proud of its surface.

They are as round as the pipe and nearly as near as its own points, so that a robust fit takes
both for one noisy surface, between the two. Cut into narrow rows along the axis, such a pipe
shows two levels that alternate; the pipe is the lower one.
"""

import numpy as np
from numpy.typing import NDArray

from pipecore.robust import robust_sd

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

MIN_POINTS = 5
"""Rows of fewer points have no level."""
MIN_BANDS = 3
"""What alternates less often may be a dent, a bow or a step of the pipe itself."""
LONGEST_BAND = 0.5
"""A band is shorter than this many radii."""
MIN_OWN = 0.4
"""Share of the rows that the pipe's own surface needs at least."""
SURE_GAP = 5.0
"""The levels are this many standard deviations of a row's level apart, or more."""
NEAR_LEVEL = 0.3
"""Rows count as the pipe's own up to this share of the way from its level to the bands'."""


def is_off_bands(chainage: Array, residual: Array, spacing: float, radius: float) -> Flags | None:
    """Which points of a pipe lie on its own surface, and not on bands around it.

    Parameters
    ----------
    chainage, residual : ndarray, shape (n,)
        Along the axis, and signed distance from the fitted surface, outward positive, metres.
    spacing : float
        Distance between neighbouring points, metres.
    radius : float
        Metres.

    Returns
    -------
    ndarray of bool, shape (n,), or None
        None where the pipe has no such bands.
    """
    step = 2.5 * spacing
    row = ((chainage - chainage.min()) / step).astype(np.intp)
    order = np.lexsort((residual, row))
    n = np.bincount(row)
    first = np.cumsum(n) - n
    level = np.full(len(n), np.nan)
    has_level = n >= MIN_POINTS
    level[has_level] = residual[order][(first + n // 2)[has_level]]
    levels = level[has_level]
    if len(levels) < 4 * MIN_BANDS:
        return None
    low, high = _two_levels(levels)
    scatter = robust_sd((residual - level[row])[has_level[row]])
    level_sd = 1.2533 * scatter / np.sqrt(np.median(n[has_level]))
    is_own = level < low + NEAR_LEVEL * (high - low)
    is_band = level > low + 0.5 * (high - low)
    lengths = _run_lengths(is_band)
    is_banded = (
        high - low > SURE_GAP * level_sd
        and is_own.sum() >= MIN_OWN * len(levels)
        and len(lengths) >= MIN_BANDS
        and lengths.max() * step < LONGEST_BAND * radius
    )
    return is_own[row] if is_banded else None


def _two_levels(values: Array) -> tuple[float, float]:
    """Medians below and above the threshold that parts values best (Otsu 1979, eq. 18)."""
    ordered = np.sort(values)
    n_low = np.arange(1, len(ordered))
    n_high = len(ordered) - n_low
    total = np.cumsum(ordered)
    gap = (total[-1] - total[:-1]) / n_high - total[:-1] / n_low
    split = int(np.argmax(n_low * n_high * gap**2)) + 1
    return float(np.median(ordered[:split])), float(np.median(ordered[split:]))


def _run_lengths(flags: Flags) -> NDArray[np.intp]:
    """Numbers of rows in the unbroken runs of true ones."""
    edges = np.flatnonzero(np.diff(np.r_[0, flags.astype(np.int8), 0]))
    return np.asarray(edges[1::2] - edges[::2], np.intp)
