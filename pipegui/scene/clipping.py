"""The clip box in the 3D view: its edges, and the handles by which it is dragged."""

from dataclasses import replace

import numpy as np
from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper, vtkRenderer

from pipecore.geometry import Array
from pipegui.model.document import ClipBox
from pipegui.scene import shapes
from pipegui.scene.projection import Projection

GRAB_PX = 10.0
SMALLEST = 0.01
"""Metres that a box keeps along each axis."""
N_FACES = 6
MIDDLE = 6
"""Number of the handle that moves the whole box."""


def corners(box: ClipBox) -> Array:
    """Low and high corner, shape (2, 3)."""
    return np.array([box.low, box.high])


def handles(box: ClipBox) -> Array:
    """Middles of the faces (low x, high x, low y, …) and of the box, shape (7, 3)."""
    ends = corners(box)
    found = np.repeat([ends.mean(axis=0)], N_FACES + 1, axis=0)
    for face in range(N_FACES):
        axis, side = divmod(face, 2)
        found[face, axis] = ends[side, axis]
    return found


def handle_at(box: ClipBox, projection: Projection, cursor: tuple[float, float]) -> int:
    """Return the number of the handle under the cursor, the nearest to it, or -1."""
    pixels, _ = projection.to_screen(handles(box))
    away = np.linalg.norm(pixels - np.array(cursor), axis=1)
    away[~np.isfinite(away)] = np.inf
    nearest = int(np.argmin(away))
    return nearest if away[nearest] <= GRAB_PX else -1


def drag(
    box: ClipBox,
    handle: int,
    projection: Projection,
    start: tuple[float, float],
    cursor: tuple[float, float],
) -> ClipBox:
    """Return `box` with a handle dragged from `start` to `cursor`, both in pixels.

    A face moves along its axis to where that is nearest to the cursor's ray; the middle
    moves in the plane of the picture.
    """
    anchor = handles(box)[handle]
    if handle == MIDDLE:
        move = _in_picture(projection, anchor, cursor) - _in_picture(projection, anchor, start)
        low, high = corners(box) + move
        return replace(box, low=_point(low), high=_point(high))
    axis, side = divmod(handle, 2)
    step = _along(projection, anchor, axis, cursor) - _along(projection, anchor, axis, start)
    ends = corners(box)
    ends[side, axis] += step
    if side:
        ends[1, axis] = max(ends[1, axis], ends[0, axis] + SMALLEST)
    else:
        ends[0, axis] = min(ends[0, axis], ends[1, axis] - SMALLEST)
    return replace(box, low=_point(ends[0]), high=_point(ends[1]))


def _along(projection: Projection, anchor: Array, axis: int, cursor: tuple[float, float]) -> float:
    """Return how far along an axis from `anchor` the point nearest to the ray lies, metres."""
    origin, ray = projection.ray(*cursor)
    cosine = ray[axis]
    if abs(cosine) > 0.999:  # looking along the axis: the distance is not determined
        return 0.0
    offset = anchor - origin
    return float((cosine * (ray @ offset) - offset[axis]) / (1 - cosine**2))


def _in_picture(projection: Projection, anchor: Array, cursor: tuple[float, float]) -> Array:
    """Point of the cursor's ray that is as deep in the picture as `anchor`."""
    origin, ray = projection.ray(*cursor)
    forward = projection.matrix[2, :3]
    return origin + ((anchor - origin) @ forward) / (ray @ forward) * ray


def _point(values: Array) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return x, y, z


class BoxFrame:
    """The edges of the box, drawn over everything."""

    def __init__(self, layer: vtkRenderer) -> None:
        self._layer = layer
        self._actor: vtkActor | None = None

    def show(
        self, box: ClipBox | None, colour: tuple[float, float, float], width: float = 1.0
    ) -> None:
        """Draw the edges of a box, or none."""
        if self._actor is not None:
            self._layer.RemoveActor(self._actor)
            self._actor = None
        if box is None:
            return
        mapper = vtkPolyDataMapper()
        mapper.SetInputData(shapes.box_lines(*corners(box)))
        self._actor = vtkActor()
        self._actor.SetMapper(mapper)
        self._actor.GetProperty().SetColor(*colour)
        self._actor.GetProperty().SetLineWidth(width)
        self._actor.GetProperty().LightingOff()
        self._layer.AddActor(self._actor)


def is_shown(box: ClipBox | None, point: Array) -> bool:
    """Return whether a point is seen: there is no box, or it is on the side that is shown."""
    if box is None:
        return True
    return bool(((point >= box.low) & (point <= box.high)).all()) != box.is_inverted
