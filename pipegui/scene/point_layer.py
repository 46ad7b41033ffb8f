"""The points of a cloud in VTK: shuffled once, drawn in as many as there is time for."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from vtkmodules.util.numpy_support import numpy_to_vtk
from vtkmodules.vtkCommonCore import vtkPoints
from vtkmodules.vtkCommonDataModel import vtkPolyData
from vtkmodules.vtkRenderingCore import vtkActor, vtkPointGaussianMapper, vtkRenderer

from pipecore.types import Floats, PointCloud
from pipegui.colour_maps import Colours

SMALLEST_LEVEL = 25_000
MOVING_LEVEL = 400_000
"""At most so many points are drawn while the camera moves."""
LEVEL_FACTOR = 4
MOVING_SECONDS = 0.1
RESTING_SECONDS = 1.5
FRAME_SECONDS = 0.03
"""What a frame costs without points, about."""
MAX_POINT_PX = 5.0


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


class PointLayer:
    """All points in levels of detail: each the first so many of the shuffled points.

    While the camera moves, a level is drawn that takes no more than `MOVING_SECONDS`;
    at rest the largest that takes no more than `RESTING_SECONDS`.
    """

    def __init__(self, renderer: vtkRenderer) -> None:
        self._renderer = renderer
        self._shuffled = np.empty(0, np.int32)
        self._levels: list[tuple[int, vtkActor]] = []
        self._order = np.empty(0, np.int32)
        self._colours = np.empty((0, 3), np.uint8)
        self._shown = -1
        self._seconds_per_point = 1e-7
        self._is_new: set[int] = set()
        self.xyz = np.empty((0, 3), np.float32)
        self.spacing = 0.01
        self.point_px = MAX_POINT_PX

    @property
    def quick_xyz(self) -> NDArray[np.float32]:
        """The points of the level for moving: enough for hovering."""
        return self.xyz[:MOVING_LEVEL]

    def cloud_index(self, row: int) -> int:
        """Index in the cloud of a row of `xyz`."""
        return int(self._order[row])

    def set_cloud(self, cloud: PointCloud) -> None:
        """Take another cloud."""
        shuffled = np.random.default_rng(0).permutation(len(cloud)).astype(np.int32)
        self._shuffled = shuffled
        self.spacing = estimate_spacing(cloud.xyz)

    def set_points(
        self, cloud: PointCloud, visible: NDArray[np.bool_] | None, colours: Colours
    ) -> None:
        """Show the `visible` points (None: all) in their colours (n, 3)."""
        order = self._shuffled
        self._order = order if visible is None else order[visible[order]]
        self.xyz = np.ascontiguousarray(cloud.xyz[self._order], np.float32)
        self._colours = np.ascontiguousarray(colours[self._order])
        self.clear_actors()
        n = len(self.xyz)
        counts = [SMALLEST_LEVEL]
        while counts[-1] < n:
            counts.append(counts[-1] * LEVEL_FACTOR)
        for count in {min(c, n): None for c in counts if n}:
            actor = point_actor(self.xyz[:count], self._colours[:count])
            actor.VisibilityOff()
            self._renderer.AddActor(actor)
            self._levels.append((count, actor))
        self._is_new = set(range(len(self._levels)))

    def set_colours(self, colours: Colours) -> None:
        """Recolour the points; `colours` are of all points of the cloud."""
        np.take(colours, self._order, axis=0, out=self._colours)
        for _, actor in self._levels:
            actor.GetMapper().GetInput().GetPointData().GetScalars().Modified()
        self._is_new = set(range(len(self._levels)))

    def show(self, *, moving: bool, pixel_size: float, visible: bool = True) -> None:
        """Switch to the level for moving or resting; a pixel is so large at the focus."""
        self._shown = self._level(moving=moving) if visible else -1
        for i, (count, actor) in enumerate(self._levels):
            actor.SetVisibility(i == self._shown)
            if i == self._shown:
                spacing = self.spacing * np.sqrt(min(len(self.xyz) / count, 4))
                self.point_px = float(np.clip(1.2 * spacing / pixel_size, 1.5, MAX_POINT_PX))
                actor.GetProperty().SetPointSize(self.point_px)

    @property
    def n_shown(self) -> int:
        """Number of points in the level that is shown."""
        return self._levels[self._shown][0] if self._shown >= 0 else 0

    def learn(self, seconds: float) -> None:
        """Take note how long the last frame took. First frames upload and do not count."""
        if self._shown in self._is_new:
            self._is_new.discard(self._shown)
        elif self._shown >= 0:
            measured = max(seconds - FRAME_SECONDS, 1e-4) / self.n_shown
            # A frame of few points says little about what a point costs.
            weight = 0.5 * min(self.n_shown / MOVING_LEVEL, 1)
            self._seconds_per_point += weight * (measured - self._seconds_per_point)

    def clear_actors(self) -> None:
        """Take all points out of the renderer."""
        for _, actor in self._levels:
            self._renderer.RemoveActor(actor)
        self._levels, self._shown = [], -1

    def _level(self, *, moving: bool) -> int:
        limit = (MOVING_SECONDS if moving else RESTING_SECONDS) / self._seconds_per_point
        limit = min(limit, MOVING_LEVEL) if moving else max(limit, MOVING_LEVEL)
        fitting = [i for i, (count, _) in enumerate(self._levels) if count <= limit]
        return max(fitting, default=0 if self._levels else -1)


def estimate_spacing(xyz: Floats, n_sampled: int = 50_000) -> float:
    """Return about how far points are from each other on a surface, metres."""
    if len(xyz) < 2:
        return 0.01
    sample = xyz[np.unique(np.random.default_rng(0).integers(0, len(xyz), n_sampled))]
    distances, _ = cKDTree(sample).query(sample[:: max(1, len(sample) // 1000)], k=2)
    # On a surface, n points are √(n/m) times as close as m of them. The nearest of points
    # strewn at random is half the mean spacing away.
    thinned = np.sqrt(len(sample) / len(xyz))
    return max(2 * float(np.median(distances[:, 1])) * thinned, 1e-4)
