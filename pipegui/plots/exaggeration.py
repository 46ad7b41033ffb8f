"""Sections drawn with their deviations enlarged. Qt-free."""

import numpy as np

from pipecore.geometry import Array
from pipecore.inspection.section import SectionEllipse


def ellipse_points(ellipse: SectionEllipse, n: int = 181) -> Array:
    """Return points along an ellipse, closed, shape (n, 2), metres."""
    t = np.linspace(0, 2 * np.pi, n)
    cos, sin = np.cos(ellipse.angle), np.sin(ellipse.angle)
    along, across = ellipse.semi_major * np.cos(t), ellipse.semi_minor * np.sin(t)
    u = ellipse.centre_uv[0] + along * cos - across * sin
    v = ellipse.centre_uv[1] + along * sin + across * cos
    return np.stack([u, v], axis=1)


def exaggerate(points: Array, reference: SectionEllipse, factor: float) -> Array:
    """Return points (n, 2) with their distances from the reference times `factor`."""
    direction, distance, on_reference = reference.rays(points)
    moved = on_reference + factor * (distance - on_reference)
    return np.asarray(np.asarray(reference.centre_uv) + moved[:, None] * direction)
