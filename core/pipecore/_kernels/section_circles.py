"""Circles of the sections across an element's own axis."""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from pipecore._kernels.circles import covered_arc, geometric_circle, taubin_circle


class SectionCircles(NamedTuple):
    """Circles of sections, one array (m,) per column; nan where none fits."""

    centre_x: np.ndarray
    """Metres, as the following but the arc."""
    centre_y: np.ndarray
    radius: np.ndarray
    rms: np.ndarray
    arc: np.ndarray
    """Radians."""


def empty_circles(n_sections: int) -> SectionCircles:
    """Return columns for so many circles."""
    return SectionCircles(*np.full((5, n_sections), math.nan))


@njit(cache=True, nogil=True)
def fit_sections(x, y, starts, max_gap, circles):
    """Fit a circle to each group of points.

    All points weigh the same: a dent is meant to show.

    Parameters
    ----------
    x, y (n,) : grouped, metres
    starts (m + 1,) : where each group begins
    max_gap : gap between neighbouring points that counts as covered, metres
    circles : `empty_circles`, filled
    """
    for c in range(starts.shape[0] - 1):
        a, b = starts[c], starts[c + 1]
        n = b - a
        if n < 5:
            continue
        weights = np.ones(n)
        cx, cy, r = taubin_circle(x[a:b], y[a:b], weights)
        if not r > 0.0:
            continue
        cx, cy, r = geometric_circle(x[a:b], y[a:b], cx, cy, r, math.inf, weights, 10)
        if not r > 0.0:
            continue
        ss = 0.0
        angles = np.empty(n)
        for k in range(n):
            dx, dy = x[a + k] - cx, y[a + k] - cy
            ss += (math.sqrt(dx * dx + dy * dy) - r) ** 2
            angles[k] = math.atan2(dy, dx)
        circles.centre_x[c], circles.centre_y[c], circles.radius[c] = cx, cy, r
        circles.rms[c] = math.sqrt(ss / max(n - 3, 1))
        circles.arc[c] = covered_arc(np.sort(angles), max(max_gap / r, 0.2))
