"""Lines and surfaces of elements and profiles, many merged into one mesh. No window here."""

from collections.abc import Sequence

import numpy as np
import pyvista as pv

from pipecore.geometry import Array, LineAxis, surface_points
from pipecore.types import Element, ElementKind, Profiles, SurfaceOfRevolution

N_AROUND = 48
N_ALONG_BEND = 24
N_WIRES = 8
"""Lines along a surface that is drawn as wires."""


def axis_lines(elements: Sequence[SurfaceOfRevolution]) -> pv.PolyData:
    """Return the axes of `elements`, straight or curved."""
    return _polylines([e.axis.at(_chainages(e)) for e in elements])


def ellipse_lines(profiles: Profiles) -> pv.PolyData:
    """Return the ellipses of `profiles`."""
    return _polylines(list(ellipses(profiles)))


def ellipses(profiles: Profiles, n_around: int = N_AROUND) -> Array:
    """Return points along the ellipses of `profiles`, closed, shape (m, n_around + 1, 3)."""
    t = np.linspace(0, 2 * np.pi, n_around + 1)[None, :, None]
    minor_direction = np.cross(profiles.normal, profiles.major_direction)
    major = (profiles.semi_major[:, None] * profiles.major_direction)[:, None, :]
    minor = (profiles.semi_minor[:, None] * minor_direction)[:, None, :]
    points = profiles.centre[:, None, :] + np.cos(t) * major + np.sin(t) * minor
    return points[np.isfinite(points).all(axis=(1, 2))]


def end_rings(element: SurfaceOfRevolution) -> pv.PolyData:
    """Return the circles at both ends of an element, or a sphere's equator."""
    clock = np.linspace(0, 2 * np.pi, N_AROUND + 1)
    if element.kind is ElementKind.SPHERE:
        around = np.stack([np.cos(clock), np.sin(clock), 0 * clock], axis=1)
        return _polylines([element.centre + element.radius * around])
    ends = (0.0, element.axis.length)
    return _polylines([surface_points(element.axis, s, element.radius_at(s), clock) for s in ends])


def wire(surface: SurfaceOfRevolution) -> pv.PolyData:
    """Return a surface as circles across its axis and lines along it."""
    clock = np.linspace(0, 2 * np.pi, N_AROUND + 1)
    if surface.kind is ElementKind.SPHERE:
        around = surface.radius * np.stack([np.cos(clock), np.sin(clock), 0 * clock], axis=1)
        return _polylines([surface.centre + np.roll(around, i, axis=1) for i in range(3)])
    length = surface.axis.length
    n_rings = int(np.clip(np.ceil(length / (2 * surface.radius)) + 1, 2, 100))
    rings = [
        surface_points(surface.axis, s, surface.radius_at(s), clock)
        for s in np.linspace(0, length, n_rings)
    ]
    s = np.linspace(0, length, N_ALONG_BEND)
    lines = [
        surface_points(surface.axis, s, surface.radius_at(s), np.full(len(s), angle))
        for angle in np.linspace(0, 2 * np.pi, N_WIRES, endpoint=False)
    ]
    return _polylines([*rings, *lines])


def box_lines(low: Array, high: Array) -> pv.PolyData:
    """Return the edges of an upright box: two rings and the posts between them."""
    x, y = np.array([low[0], high[0]]), np.array([low[1], high[1]])
    ring = np.column_stack([x[[0, 1, 1, 0, 0]], y[[0, 0, 1, 1, 0]]])
    rings = [np.column_stack([ring, np.full(5, z)]) for z in (low[2], high[2])]
    posts = [np.stack([rings[0][i], rings[1][i]]) for i in range(4)]
    return _polylines([*rings, *posts])


def surfaces(elements: tuple[Element, ...]) -> pv.PolyData:
    """Return the fitted surfaces of `elements` with their normals."""
    meshes = [_surface(e) for e in elements]
    return pv.merge(meshes) if meshes else pv.PolyData()


def outline(elements: Sequence[SurfaceOfRevolution]) -> Array:
    """Return points around `elements` that have to be in view to see them, shape (n, 3)."""
    points = [np.empty((0, 3))]
    for e in elements:
        if e.kind is ElementKind.SPHERE:
            points.append(e.centre + e.radius * np.vstack([np.eye(3), -np.eye(3)]))
            continue
        grid = np.meshgrid(_chainages(e), np.linspace(0, 2 * np.pi, 8, endpoint=False))
        s, clock = (values.ravel() for values in grid)
        points.append(surface_points(e.axis, s, e.radius_at(s), clock))
    return np.concatenate(points)


def _chainages(element: SurfaceOfRevolution) -> Array:
    n_along = 2 if isinstance(element.axis, LineAxis) else N_ALONG_BEND
    return np.linspace(0, element.axis.length, n_along)


def _polylines(curves: list[Array]) -> pv.PolyData:
    if not curves:
        return pv.PolyData()
    lengths = [len(c) for c in curves]
    starts = np.cumsum([0, *lengths[:-1]])
    cells = [np.r_[n, start : start + n] for n, start in zip(lengths, starts, strict=True)]
    return pv.PolyData(np.concatenate(curves).astype(np.float32), lines=np.concatenate(cells))


def _surface(element: Element) -> pv.PolyData:
    if element.kind is ElementKind.SPHERE:
        return pv.Sphere(
            radius=element.radius, center=element.centre, theta_resolution=48, phi_resolution=24
        )
    s, clock = np.meshgrid(_chainages(element), np.linspace(0, 2 * np.pi, N_AROUND + 1))
    points = surface_points(element.axis, s.ravel(), element.radius_at(s.ravel()), clock.ravel())
    normals = points - element.axis.at(s.ravel())
    rows, columns = s.shape
    corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    quads = np.stack([corner, corner + 1, corner + columns + 1, corner + columns], axis=1)
    mesh = pv.PolyData(
        points.astype(np.float32),
        faces=np.column_stack([np.full(len(quads), 4), quads]).ravel(),
    )
    mesh.point_data["Normals"] = (
        normals / np.maximum(np.linalg.norm(normals, axis=1), 1e-9)[:, None]
    ).astype(np.float32)
    return mesh
