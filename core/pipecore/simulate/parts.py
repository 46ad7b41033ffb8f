"""Everything that rays can hit, as meshes that know their element and material."""

from dataclasses import dataclass

import numpy as np

from pipecore.geometry import Array, LineAxis, surface_points, twelve_o_clock
from pipecore.simulate.placing import GASKET, End, PlacedElement, Placement
from pipecore.simulate.surface import Mesh, facets_around, grid_mesh
from pipecore.types import NO_ID, ElementKind


@dataclass(frozen=True, eq=False)
class Part:
    """One mesh. `element_id` is `NO_ID` for what is no element's lateral surface."""

    mesh: Mesh
    material: str
    element_id: int = NO_ID


def pipe_parts(placement: Placement) -> list[Part]:
    """Lateral surfaces of all elements, and what closes them."""
    parts = []
    for placed in placement.elements:
        if placed.element.kind is ElementKind.FLANGE:
            parts += _flange(placed)
        else:
            parts.append(Part(placed.surface.mesh(), placed.material, placed.element.element_id))
    parts += [_end(end) for end in placement.ends]
    return parts


def tube(axis: LineAxis, chainage: Array, radius: Array, n_facets: int) -> Mesh:
    """Surface about a line through (chainage, radius) pairs; (n, n_facets) radii if not round."""
    s, a = np.meshgrid(chainage, 2 * np.pi * np.arange(n_facets) / n_facets, indexing="ij")
    r = np.broadcast_to(radius if radius.ndim == 2 else radius[:, None], s.shape)
    points = surface_points(axis, s.ravel(), r.ravel(), a.ravel())
    return grid_mesh(points.reshape(*s.shape, 3), closed=True)


def rod(start: Array, end: Array, radius: float, n_facets: int = 16) -> Mesh:
    """A closed solid cylinder."""
    axis = LineAxis.between(start, end)
    return tube(
        axis,
        np.array([0.0, 0.0, axis.length, axis.length]),
        np.array([0, radius, radius, 0]),
        n_facets,
    )


def merged(meshes: list[Mesh]) -> Mesh:
    """One mesh of several."""
    offsets = np.cumsum([0] + [len(m.vertices) for m in meshes[:-1]])
    return Mesh(
        np.concatenate([m.vertices for m in meshes]),
        np.concatenate(
            [m.triangles + np.uint32(o) for m, o in zip(meshes, offsets, strict=True)]
        ).astype(np.uint32),
    )


def _end(end: End) -> Part:
    """A flat disc, or the 2:1 dome of a vessel."""
    height = end.radius / 2 if end.is_domed else 0.0
    # The dome starts a hair inside the pipe so that no ray slips between them.
    angle = np.linspace(0.0, np.pi / 2, 80 if end.is_domed else 2)
    axis = LineAxis(end.position, end.outward, max(height, 1.0))
    mesh = tube(axis, height * np.sin(angle), end.radius * np.cos(angle), facets_around(end.radius))
    return Part(mesh, end.material)


def _flange(placed: PlacedElement) -> list[Part]:
    """Two discs: their rims are the element, their faces and bolts are not."""
    axis, radius = placed.element.axis, placed.element.radius
    assert isinstance(axis, LineAxis)
    thickness = (axis.length - GASKET) / 2
    n_facets = facets_around(radius)
    enlarged = radius * (1 + (1 - np.cos(np.pi / n_facets)) * 2 / 3)
    rims, faces = [], []
    for start in (0.0, thickness + GASKET):
        ends = np.array([start, start + thickness])
        rims.append(tube(axis, ends, np.array([enlarged, enlarged]), n_facets))
        faces += [tube(axis, np.full(2, s), np.array([0.0, enlarged]), n_facets) for s in ends]
    bolt = max(0.008, 0.06 * radius)
    for k in range(placed.n_bolts):
        clock = 2 * np.pi * (k + 0.5) / placed.n_bolts
        ends = surface_points(axis, np.array([-bolt, axis.length + bolt]), 0.83 * radius, clock)
        faces.append(rod(ends[0], ends[1], bolt, 6))
    return [
        Part(merged(rims), placed.material, placed.element.element_id),
        Part(merged(faces), placed.material),
    ]


def block(centre: Array, size: Array, axes: Array) -> Mesh:
    """A box with edges `size` along the rows of `axes` (3, 3)."""
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) / 2
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]
    return Mesh(centre + (corners * size) @ axes, np.array(triangles, dtype=np.uint32))


def upright_axes(along: Array) -> Array:
    """Rows: `along`, across it, and its 12:00."""
    up = twelve_o_clock(along)
    return np.stack([along, np.cross(up, along), up])


def yaw_axes(yaw_deg: float) -> Array:
    """Rows: the axes turned by `yaw_deg` about the vertical."""
    c, s = np.cos(np.deg2rad(yaw_deg)), np.sin(np.deg2rad(yaw_deg))
    return np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
