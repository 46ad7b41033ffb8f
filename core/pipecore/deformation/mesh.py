"""The scanned surface of an element as a mesh: cells of chainage and clock, holes left open."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipecore.deformation.deviation_map import Grid, box_sum, close_holes, point_spacing
from pipecore.geometry import Array, surface_points
from pipecore.types import Element, PointCloud, Result

FINEST_CELL = 0.04
"""Share of the radius that cells are at least, however dense the points."""

MARGIN = 1.0
"""What is shown around a deformation to either side along the pipe, in diameters."""


@dataclass(frozen=True, eq=False)
class SurfaceMesh:
    """Triangles over a part of an element's surface.

    Parameters
    ----------
    vertices : ndarray, shape (n, 3)
        Local coordinates, metres.
    deviation : ndarray, shape (n,)
        From the undeformed contour, metres, outward positive; not exaggerated.
    faces : ndarray of int32, shape (m, 3)
        Anticlockwise seen from outside.
    name : str
    """

    vertices: Array
    deviation: Array
    faces: NDArray[np.int32]
    name: str = ""


def mesh_surface(
    element: Element,
    xyz: Array,
    deviation: Array,
    chainages: tuple[float, float] | None = None,
    *,
    exaggeration: float = 1.0,
    name: str = "",
) -> SurfaceMesh:
    """Return the mesh of an element's surface as its points show it.

    Parameters
    ----------
    element : Element
    xyz : ndarray, shape (n, 3)
        Points of its surface, local coordinates.
    deviation : ndarray, shape (n,)
        Of each point from the undeformed contour, metres.
    chainages : (float, float), optional
        The stretch to be shown; the whole element if None.
    exaggeration : float
        By which deviations are drawn larger.
    name : str

    Returns
    -------
    SurfaceMesh
        Without vertices where fewer than three points lie on the stretch.

    Notes
    -----
    A vertex is the mean over 3 × 3 cells of about the points' spacing. Where no points
    are, there is a hole; only gaps of a cell or two between sparse points are bridged.
    """
    low, high = chainages or (0.0, element.axis.length)
    low, high = max(low, 0.0), min(high, element.axis.length)
    chainage, _, clock = element.axis.pipe_coordinates(xyz)
    inside = (chainage >= low) & (chainage <= high) & np.isfinite(deviation)
    if np.count_nonzero(inside) < 3:
        return SurfaceMesh(np.empty((0, 3)), np.empty(0), np.empty((0, 3), np.int32), name)
    radius = (element.radius + element.radius_end) / 2
    cell = max(FINEST_CELL * radius, point_spacing(element, chainage[inside], clock[inside]))
    rows = max(2, round((high - low) / cell))
    columns = max(16, round(2 * np.pi * radius / cell))
    grid = Grid(high - low, radius, rows, columns)
    index = grid.cell_of(chainage[inside] - low, clock[inside])
    count = grid.count(index)
    n = box_sum(count)
    total = box_sum(grid.total(index, np.asarray(deviation, np.float64)[inside]))
    known = close_holes(count > 0) & (n > 0.5)
    value = np.where(known, total / np.maximum(n, 1), np.nan)

    number = np.full(grid.shape, -1)
    number[known] = np.arange(np.count_nonzero(known))
    row, column = np.nonzero(known)
    at, theta = low + grid.chainages[row], grid.clocks[column]
    shown = element.radius_at(at) + exaggeration * value[known]
    # Corners of each square: here, further round, further along, both.
    a, b = number[:-1], np.roll(number, -1, axis=1)[:-1]
    c, d = number[1:], np.roll(number, -1, axis=1)[1:]
    whole = (a >= 0) & (b >= 0) & (c >= 0) & (d >= 0)
    first = np.stack([a[whole], b[whole], c[whole]], axis=1)
    second = np.stack([b[whole], d[whole], c[whole]], axis=1)
    return SurfaceMesh(
        surface_points(element.axis, at, shown, theta),
        value[known],
        np.concatenate([first, second]).astype(np.int32),
        name,
    )


def mesh_elements(
    cloud: PointCloud, result: Result, element_ids: Sequence[int], exaggeration: float = 1.0
) -> list[SurfaceMesh]:
    """Return the meshes of whole elements.

    Parameters
    ----------
    cloud : PointCloud
    result : Result
    element_ids : sequence of int
    exaggeration : float
        Factor on deviations as drawn.

    Returns
    -------
    list of SurfaceMesh
    """
    meshes = []
    for element_id in element_ids:
        element = result.element(element_id)
        inliers = result.element_id == element_id
        xyz = cloud.xyz[inliers].astype(np.float64)
        meshes.append(
            mesh_surface(
                element,
                xyz,
                result.deviation[inliers],
                exaggeration=exaggeration,
                name=element.label,
            )
        )
    return meshes


def mesh_deformations(
    cloud: PointCloud,
    result: Result,
    deformation_ids: Sequence[int] | None = None,
    exaggeration: float = 1.0,
) -> list[SurfaceMesh]:
    """Return the meshes of deformations, each with a diameter of pipe to either side.

    Parameters
    ----------
    cloud : PointCloud
    result : Result
    deformation_ids : sequence of int, optional
        All if None.
    exaggeration : float
        By which deviations are drawn larger.

    Returns
    -------
    list of SurfaceMesh
    """
    chosen = [
        d
        for d in result.deformations
        if deformation_ids is None or d.deformation_id in set(deformation_ids)
    ]
    meshes = []
    for d in chosen:
        element = result.element(d.element_id)
        inliers = result.element_id == d.element_id
        xyz = cloud.xyz[inliers].astype(np.float64)
        margin = MARGIN * 2 * float(element.radius_at(d.chainage))
        stretch = (d.chainage_start - margin, d.chainage_end + margin)
        name = f"{d.kind} {d.deformation_id} on {element.label}"
        meshes.append(
            mesh_surface(
                element,
                xyz,
                result.deviation[inliers],
                stretch,
                exaggeration=exaggeration,
                name=name,
            )
        )
    return meshes
