"""The points of a cloud in VTK: drawn in as many as there is time for.

Only what is drawn is copied, so that a cloud of any size costs no more than is seen of it.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import numpy_to_vtk
from vtkmodules.vtkCommonCore import vtkPoints
from vtkmodules.vtkCommonDataModel import vtkPlane, vtkPolyData
from vtkmodules.vtkRenderingCore import vtkActor, vtkPointGaussianMapper, vtkRenderer

from pipecore.types import Floats, PointCloud
from pipegui.model.cache import cached_with_owner
from pipegui.model.document import ClipBox
from pipegui.scene.spreading import Spread
from pipegui.style.colour_maps import Colours

SMALLEST_SLICE, LARGEST_SLICE = 25_000, 1_000_000
MOVING_LEVEL = 400_000
"""At most so many points are drawn while the camera moves."""
MOVING_SECONDS = 0.06
"""For the points of a frame while the camera moves: the rest of 0.1 s is for all else."""
FRAME_SECONDS = 0.02
"""What a frame costs without points, about."""
MOST_WITHOUT_CARD = 2_000_000
"""At most so many points at rest where memory has to stand in for a graphics card: each takes
nearly 200 bytes there, and a large window has no more pixels. See `details` for what is near."""
MIN_POINT_PX, MAX_POINT_PX = 1.0, 5.0

Rows = NDArray[np.int32]
ColourRows = Callable[[Rows], Colours]
"""Colours (n, 3) of rows of the cloud."""


def point_actor(xyz: NDArray[np.float32], colours: Colours) -> vtkActor:
    """Return an actor of coloured points; the arrays are shared, not copied."""
    points = vtkPoints()
    points.SetData(numpy_to_vtk(xyz))
    data = vtkPolyData()
    data.SetPoints(points)
    data.GetPointData().SetScalars(numpy_to_vtk(colours))
    # Draws points without cells, which would take 16 bytes a point; scale 0: no splats.
    mapper = vtkPointGaussianMapper()
    mapper.SetInputData(data)
    mapper.SetScaleFactor(0.0)
    mapper.EmissiveOff()
    actor = vtkActor()
    actor.SetMapper(mapper)
    actor.GetProperty().LightingOff()
    return actor


@dataclass(eq=False)
class _Slice:
    stop: int
    rows: Rows
    xyz: NDArray[np.float32]
    colours: Colours
    actor: vtkActor
    is_uploaded: bool = False
    is_coloured: bool = True


class PointLayer:
    """The points in an order that spreads them evenly, cut into slices.

    While the camera moves, as many slices are drawn as take no more than
    `MOVING_SECONDS`; at rest as many as take no more than the time that is given.
    """

    def __init__(self, renderer: vtkRenderer) -> None:
        self._renderer = renderer
        self._cloud: PointCloud | None = None
        self._visible: Rows | None = None
        self._spread = Spread(0)
        self._colour: ColourRows | None = None
        self.slices: list[_Slice] = []
        self.seconds_per_point = 1e-7
        self._clip: ClipBox | None = None
        self._is_drawing_new = False
        self.most = MOST_WITHOUT_CARD
        """At most so many points are drawn."""
        self.n_shown = 0
        """Number of points in the slices that are shown."""
        self.spacing = 0.01
        self.point_px = MAX_POINT_PX

    def __len__(self) -> int:
        """Return the number of points that can be seen."""
        return len(self._spread)

    @property
    def parts(self) -> list[NDArray[np.float32]]:
        """The points that have been drawn, in parts."""
        return [s.xyz for s in self.slices]

    @property
    def quick_parts(self) -> list[NDArray[np.float32]]:
        """The points that are drawn while moving: enough for hovering."""
        return [s.xyz for s in self.slices if s.stop <= MOVING_LEVEL] or self.parts[:1]

    def cloud_index(self, row: int) -> int:
        """Return the index in the cloud of a row of `parts`, counted through."""
        for part in self.slices:
            if row < part.stop:
                return int(part.rows[row - part.stop + len(part.rows)])
        raise IndexError(row)

    def set_points(
        self, cloud: PointCloud, visible: NDArray[np.integer] | None, colour: ColourRows
    ) -> None:
        """Show the points of a cloud in the rows `visible` (None: all)."""
        is_new = cloud is not self._cloud
        self.clear_actors()
        if is_new:
            self.spacing = _spacing_of(cloud)
        self._cloud, self._colour = cloud, colour
        self._visible = None if visible is None else visible.astype(np.int32, copy=False)
        self._spread = Spread(len(cloud) if self._visible is None else len(self._visible))
        self._reach(SMALLEST_SLICE)

    def set_colours(self, colour: ColourRows) -> None:
        """Recolour the points, each slice when it is drawn next."""
        self._colour = colour
        for part in self.slices:
            part.is_coloured = False

    def show(
        self,
        *,
        seconds: float,
        pixel_size: float,
        visible: bool = True,
        size: float = 1.0,
        scale: float = 1.0,
    ) -> None:
        """Show what can be drawn in so many seconds, 0 while the camera moves.

        A pixel is `pixel_size` metres large at the focus; the screen has `scale` for each.
        """
        limit = (seconds or MOVING_SECONDS) / self.seconds_per_point
        limit = min(max(limit, MOVING_LEVEL), self.most) if seconds else min(limit, MOVING_LEVEL)
        shown = self._reach(limit) if visible else []
        for part in shown:
            self._recolour(part)
        self.n_shown = shown[-1].stop if shown else 0
        self._is_drawing_new = not all(part.is_uploaded for part in shown)
        if shown:
            spacing = self.spacing * np.sqrt(min(len(self) / self.n_shown, 4))
            suiting = np.clip(1.2 * spacing / pixel_size, 1.5, MAX_POINT_PX)
            self.point_px = float(max(size * suiting, MIN_POINT_PX))
        for i, part in enumerate(self.slices):
            part.actor.SetVisibility(i < len(shown))
            part.actor.GetProperty().SetPointSize(scale * self.point_px)
        for part in shown:
            part.is_uploaded = True

    def learn(self, seconds: float) -> None:
        """Take note how long the last frame took. First frames upload and do not count."""
        if not self._is_drawing_new and self.n_shown:
            measured = max(seconds - FRAME_SECONDS, 1e-4) / self.n_shown
            # A frame of few points says little about what a point costs.
            weight = 0.5 * min(self.n_shown / MOVING_LEVEL, 1)
            self.seconds_per_point += weight * (measured - self.seconds_per_point)

    def clip(self, box: ClipBox) -> None:
        """Draw only what lies in the box; see `set_points` for leaving points out."""
        self._clip = box
        for part in self.slices:
            set_planes(part.actor, self._clip)

    def clear_actors(self) -> None:
        """Take all points out of the renderer."""
        for part in self.slices:
            self._renderer.RemoveActor(part.actor)
        self.slices, self.n_shown = [], 0
        self._visible = self._colour = self._clip = None
        self._spread = Spread(0)

    def forget(self) -> None:
        """Let go of the cloud too."""
        self.clear_actors()
        self._cloud = None

    def _reach(self, limit: float) -> list[_Slice]:
        """Return the slices up to `limit` points, at least the first; make those not there yet."""
        stop = self.slices[-1].stop if self.slices else 0
        while stop < len(self):
            start, stop = stop, min(max(2 * stop, SMALLEST_SLICE), stop + LARGEST_SLICE, len(self))
            if start and stop > limit:
                break
            self.slices.append(self._make_slice(start, stop))
        return [s for i, s in enumerate(self.slices) if i == 0 or s.stop <= limit]

    def _recolour(self, part: _Slice) -> None:
        if part.is_coloured:
            return
        assert self._colour is not None
        part.colours[:] = self._colour(part.rows)
        part.actor.GetMapper().GetInput().GetPointData().GetScalars().Modified()
        part.is_uploaded, part.is_coloured = False, True

    def _make_slice(self, start: int, stop: int) -> _Slice:
        assert self._cloud is not None
        assert self._colour is not None
        rows = self._spread.rows(start, stop).astype(np.int32)
        if self._visible is not None:
            rows = self._visible[rows]
        xyz = np.take(self._cloud.xyz, rows, axis=0).astype(np.float32, copy=False)
        colours = np.ascontiguousarray(self._colour(rows))
        actor = point_actor(xyz, colours)
        actor.VisibilityOff()
        if self._clip is not None:
            set_planes(actor, self._clip)
        self._renderer.AddActor(actor)
        return _Slice(stop, rows, xyz, colours, actor)


CLIP = "//VTK::Clip::Impl"
OUTSIDE = """
  bool isInside = true;
  for (int planeNum = 0; planeNum < numClipPlanes; planeNum++)
  {
    isInside = isInside && clipDistancesVSOutput[planeNum] >= 0.0;
  }
  if (isInside) discard;
"""
"""In the place of VTK's own, which draws what is on the right side of all planes."""


def set_planes(actor: vtkActor, box: ClipBox | None) -> None:
    """Let an actor draw only what the box shows."""
    mapper, shader = actor.GetMapper(), actor.GetShaderProperty()
    shader.ClearFragmentShaderReplacement(CLIP, True)
    planes = mapper.GetClippingPlanes()
    if box is None:
        if planes is not None and planes.GetNumberOfItems():
            mapper.RemoveAllClippingPlanes()
        return
    if box.is_inverted:
        shader.AddFragmentShaderReplacement(CLIP, True, OUTSIDE, False)
    if planes is None or not planes.GetNumberOfItems():
        for normal in (*np.eye(3), *-np.eye(3)):
            plane = vtkPlane()
            plane.SetNormal(normal)
            mapper.AddClippingPlane(plane)
    # Other planes would make VTK upload all points again; these are only moved.
    planes = mapper.GetClippingPlanes()
    for i in range(planes.GetNumberOfItems()):
        planes.GetItem(i).SetOrigin(box.low if i < 3 else box.high)


@cached_with_owner(maxsize=1)
def _spacing_of(cloud: PointCloud) -> float:
    """Return the spacing of a cloud's points, metres; three layers ask for it."""
    return estimate_spacing(cloud.xyz)


def estimate_spacing(xyz: Floats, n_sampled: int = 50_000) -> float:
    """Return about how far points are from each other on a surface, metres."""
    from scipy.spatial import cKDTree  # noqa: PLC0415 - takes its time

    if len(xyz) < 2:
        return 0.01
    sample = xyz[np.unique(np.random.default_rng(0).integers(0, len(xyz), n_sampled))]
    distances, _ = cKDTree(sample).query(sample[:: max(1, len(sample) // 1000)], k=2)
    # On a surface, n points are √(n/m) times as close as m of them. The nearest of points
    # strewn at random is half the mean spacing away.
    thinned = np.sqrt(len(sample) / len(xyz))
    return float(max(2 * np.median(distances[:, 1]) * thinned, 1e-4))
