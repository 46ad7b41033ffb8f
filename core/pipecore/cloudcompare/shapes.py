"""Elements and deformations as objects of CloudCompare: primitives, polylines and labels."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import cccorelib
import numpy as np
import pycc
from scipy.spatial import cKDTree

from pipecore.formatting import format_measure
from pipecore.geometry import AnyAxis, ArcAxis, Array, CurveAxis
from pipecore.types import Deformation, Element, ElementKind, PointCloud, Result

N_ALONG = 24
"""Points along a curved axis."""
PIECE_RADII = 2.0
"""A bowed pipe is shown as cylinders of this length at least."""


def group_of(cloud: PointCloud, result: Result, source: Any) -> Any:
    """Return everything that was found as one group.

    Parameters
    ----------
    cloud : PointCloud
    result : Result
    source : pycc.ccPointCloud
        Whose global shift and scale all of it has.

    Returns
    -------
    pycc.ccHObject
        A group for each run (surfaces and axes), and one of labels of the deformations.
    """
    scale = float(source.getGlobalScale())
    group = pycc.ccHObject(f"Pipes of {source.getName()}")
    for run_id in sorted({e.run_id for e in result.elements}):
        run = pycc.ccHObject(result.run_names.get(run_id) or f"Run {run_id}")
        for element in result.elements:
            if element.run_id == run_id:
                for surface in _surfaces(element, scale):
                    surface.getAssociatedCloud().copyGlobalShiftAndScale(source)
                    surface.setColor(pycc.Rgb(125, 156, 196))
                    surface.showColors(True)
                    run.addChild(surface)
                run.addChild(_axis(element, scale, source))
        group.addChild(run)
    if result.deformations:
        group.addChild(_labels(cloud, result, source, scale))
    return group


def element_name(element: Element) -> str:
    """Return what an element is called there: its name, radius and size.

    Parameters
    ----------
    element : Element

    Returns
    -------
    str
    """
    radius = format_measure(1000 * element.radius, 1000 * element.radius_sd, "mm")
    size = f", {element.nominal.name}" if element.nominal else ""
    return f"{element.label}: r {radius}{size}"


def _surfaces(element: Element, scale: float) -> Sequence[Any]:
    name, axis = element_name(element), element.axis
    if element.kind is ElementKind.SPHERE:
        frame = _matrix(*_across(np.array([0.0, 0.0, 1.0])), element.centre * scale)
        return [pycc.ccSphere(float(scale * element.radius), frame, name)]
    if isinstance(axis, ArcAxis):
        ahead = np.cross(axis.normal, axis.towards_start)
        frame = _matrix(axis.towards_start, ahead, axis.normal, axis.centre * scale)
        inside = scale * (axis.bend_radius - element.radius)
        outside = scale * (axis.bend_radius + element.radius)
        torus = pycc.ccTorus(
            float(inside), float(outside), float(axis.bend_angle), False, 0.0, frame, name
        )
        return [torus]
    ends = np.array([0.0, axis.length])
    if isinstance(axis, CurveAxis):
        n_pieces = int(np.clip(axis.length / (PIECE_RADII * element.radius), 1, N_ALONG))
        ends = np.linspace(0.0, axis.length, n_pieces + 1)
    pieces = []
    for low, high in pairwise(ends):
        start, end = axis.at(low), axis.at(high)
        frame = _matrix(*_across(end - start), scale * (start + end) / 2)
        height = float(scale * np.linalg.norm(end - start))
        radii = [float(scale * r) for r in element.radius_at(np.array([low, high]))]
        if radii[0] == radii[1]:
            pieces.append(pycc.ccCylinder(radii[0], height, frame, name))
        else:
            pieces.append(pycc.ccCone(radii[0], radii[1], height, 0.0, 0.0, frame, name))
    return pieces


def _axis(element: Element, scale: float, source: Any) -> Any:
    points = scale * _along(element.axis)
    vertices = pycc.ccPointCloud(*np.ascontiguousarray(points.T, np.float32))
    vertices.copyGlobalShiftAndScale(source)
    line = pycc.ccPolyline(vertices)
    line.addPointIndex(0, len(points))
    line.setName(f"Axis of {element.label}")
    line.setColor(pycc.Rgb(60, 60, 60))
    line.showColors(True)
    line.copyGlobalShiftAndScale(source)
    line.addChild(vertices)
    vertices.setEnabled(False)
    return line


def _along(axis: AnyAxis) -> Array:
    n = N_ALONG if isinstance(axis, ArcAxis | CurveAxis) else 2
    return np.asarray(axis.at(np.linspace(0.0, axis.length, n)))


def _labels(cloud: PointCloud, result: Result, source: Any, scale: float) -> Any:
    """The labels; each is pinned to a point at its peak, of a cloud of these points alone."""
    peaks = np.array([d.peak for d in result.deformations])
    on_elements = np.flatnonzero(result.element_id > 0)
    _, nearest = cKDTree(cloud.xyz[on_elements]).query(peaks)
    at = scale * cloud.xyz[on_elements[nearest]].astype(np.float64)
    places = pycc.ccPointCloud(*np.ascontiguousarray(at.T, np.float32))
    places.setName("Places of the deformations")
    places.copyGlobalShiftAndScale(source)
    group = pycc.ccHObject("Deformations")
    group.addChild(places)
    for index, deformation in enumerate(result.deformations):
        label = pycc.cc2DLabel(_deformation_name(deformation, result))
        label.addPickedPoint(places, index)
        label.displayPointLegend(False)
        label.setCollapsed(True)
        places.addChild(label)
    return group


def _deformation_name(deformation: Deformation, result: Result) -> str:
    element = result.element(deformation.element_id)
    size = ""
    if np.isfinite(deformation.depth):
        depth = format_measure(1000 * deformation.depth, 1000 * deformation.depth_sd, "mm")
        size = f" {depth}"
    name = f"{deformation.kind} {deformation.deformation_id}".capitalize()
    return f"{name}:{size} on {element.label}, {deformation.verdict}"


def _across(direction: Array) -> tuple[Array, Array, Array]:
    """Right-handed unit vectors, the third along a direction."""
    ahead = direction / np.linalg.norm(direction)
    aside = np.eye(3)[int(np.argmin(np.abs(ahead)))]
    first = np.cross(aside, ahead)
    first /= np.linalg.norm(first)
    return first, np.cross(ahead, first), ahead


def _matrix(x: Array, y: Array, z: Array, place: Array) -> Any:
    return pycc.ccGLMatrix(*(cccorelib.CCVector3(*map(float, v)) for v in (x, y, z, place)))
