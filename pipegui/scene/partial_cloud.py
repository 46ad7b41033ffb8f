"""What has been read of a scan so far, shown while the rest is read."""

import numpy as np
from vtkmodules.vtkRenderingCore import vtkActor, vtkRenderer

from pipecore.geometry import Array
from pipecore.types import PointCloud
from pipegui.scene.point_layer import point_actor

PLAIN = (126, 140, 158)
"""Of points without colours of their own."""
POINT_PX = 2.0
MOST = 3_000_000
"""Points; more are not needed to see what comes."""
N_SAMPLED = 400


class PartialCloud:
    """Parts of a cloud as they come, each an actor."""

    def __init__(self, renderer: vtkRenderer) -> None:
        self._renderer = renderer
        self._actors: list[vtkActor] = []
        self._samples: list[Array] = []
        self._n_points = 0

    def __len__(self) -> int:
        """Return the number of points that are shown."""
        return self._n_points

    @property
    def sample(self) -> Array:
        """A few points of every part, shape (n, 3)."""
        return np.concatenate(self._samples)

    def add(self, part: PointCloud, scale: float = 1.0) -> None:
        """Show one more part; `scale` pixels of the screen are one."""
        self._samples.append(part.xyz[:: max(1, len(part) // N_SAMPLED)].astype(np.float64))
        if self._n_points > MOST:
            return
        colours = part.rgb
        if colours is None:
            colours = np.full((len(part), 3), PLAIN, np.uint8)
        actor = point_actor(np.ascontiguousarray(part.xyz, np.float32), colours)
        actor.GetProperty().SetPointSize(scale * POINT_PX)
        self._renderer.AddActor(actor)
        self._actors.append(actor)
        self._n_points += len(part)

    def clear(self) -> None:
        """Take all parts away."""
        for actor in self._actors:
            self._renderer.RemoveActor(actor)
        self._actors, self._samples, self._n_points = [], [], 0
