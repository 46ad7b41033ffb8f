"""Sections drawn with their deviations enlarged. Qt-free."""

import numpy as np

from pipecore.geometry import Array
from pipegui.states.section import Ellipse


def ellipse_points(ellipse: Ellipse, n: int = 181) -> Array:
    """Points along an ellipse, closed, shape (n, 2), millimetres."""
    t = np.linspace(0, 2 * np.pi, n)
    cos, sin = np.cos(ellipse.angle_rad), np.sin(ellipse.angle_rad)
    along, across = ellipse.semi_major_mm * np.cos(t), ellipse.semi_minor_mm * np.sin(t)
    u = ellipse.centre_uv[0] + along * cos - across * sin
    v = ellipse.centre_uv[1] + along * sin + across * cos
    return np.stack([u, v], axis=1)


def deviations(points: Array, reference: Ellipse) -> Array:
    """Distance of `points` (n, 2) beyond the reference along the ray from its centre."""
    _, rho, on_reference = _polar(points, reference)
    return rho - on_reference


def exaggerate(points: Array, reference: Ellipse, factor: float) -> Array:
    """Return `points` with their distances from the reference times `factor`."""
    direction, rho, on_reference = _polar(points, reference)
    moved = on_reference + factor * (rho - on_reference)
    return np.asarray(reference.centre_uv) + moved[:, None] * direction


def _polar(points: Array, reference: Ellipse) -> tuple[Array, Array, Array]:
    """Unit directions from the reference's centre, distances, and the reference's own."""
    offset = points - np.asarray(reference.centre_uv)
    rho = np.linalg.norm(offset, axis=1)
    direction = offset / np.maximum(rho, 1e-9)[:, None]
    cos, sin = np.cos(reference.angle_rad), np.sin(reference.angle_rad)
    along = direction @ np.array([cos, sin]) / reference.semi_major_mm
    across = direction @ np.array([-sin, cos]) / reference.semi_minor_mm
    return direction, rho, 1 / np.maximum(np.hypot(along, across), 1e-12)
