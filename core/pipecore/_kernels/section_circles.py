"""Circles of the sections across an element's own axis."""

import math

import numpy as np
from numba import njit

from pipecore._kernels.circles import covered_arc, geometric_circle, taubin_circle


@njit(cache=True, nogil=True)
def fit_sections(x, y, starts, max_gap, fits):
    """Fit a circle to each group of points.

    All points weigh the same: a dent is meant to show.

    Parameters
    ----------
    x, y (n,) : grouped, metres
    starts (m + 1,) : where each group begins
    max_gap : gap between neighbouring points that counts as covered, metres
    fits (m, 5) : filled with centre x, y, radius, rms, metres, and arc, radians; nan for none
    """
    for c in range(starts.shape[0] - 1):
        a, b = starts[c], starts[c + 1]
        n = b - a
        fits[c, :] = math.nan
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
        fits[c, 0], fits[c, 1], fits[c, 2] = cx, cy, r
        fits[c, 3] = math.sqrt(ss / max(n - 3, 1))
        fits[c, 4] = covered_arc(np.sort(angles), max(max_gap / r, 0.2))
