"""Ellipses of profiles across an axis, as the fits leave them."""

import numpy as np

from pipecore.ellipses import Ellipses
from pipecore.geometry import Axis

WIDTH = 0.02


def along(axis: Axis, radius, step=WIDTH, sd=0.0002, rng=None) -> Ellipses:
    """Ellipses every `step` of an axis; with `rng`, off by their standard deviation."""
    s = np.arange(0.0, axis.length, step)
    n = len(s)
    radius = np.broadcast_to(radius, n).astype(float)
    centre, tangent = axis.at(s), np.array(axis.tangent(s))
    if rng is not None:
        radius = radius + sd * rng.normal(size=n)
        centre = centre + sd * rng.normal(size=(n, 3))
        tangent = tangent * rng.choice([-1.0, 1.0], n)[:, None]
    plain, count = np.full(n, 0.001), np.full(n, 40, np.int32)
    return Ellipses(
        stack_id=np.ones(n, np.int32),
        profile_index=np.arange(n, dtype=np.int32),
        width=np.full(n, WIDTH),
        centre=centre,
        normal=tangent,
        axis=tangent,
        radius=radius,
        radius_sd=np.full(n, sd),
        meeting_point=centre,
        meeting_distance=radius,
        arc=np.full(n, 6.0),
        n_points=count,
        rms=plain,
        semi_minor=radius,
        semi_major=radius,
        major_direction=np.array(axis.frame(s)[0]),
        aic_line=plain,
        aic_ellipse=plain,
    )
