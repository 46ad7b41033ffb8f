"""A cloud larger than memory: its points in files, visited tile by tile."""

from collections.abc import Iterator, Sequence

from pipecore.allocation import Allocate
from pipecore.progress import Progress
from pipecore.settings import Settings, ThinningSettings
from pipecore.surface import Surface
from pipecore.tiling.curves import cut_in_batches, remove_planes
from pipecore.tiling.engine import Engine
from pipecore.tiling.slabs import TiledSurface, downsample_in_slabs
from pipecore.types import PointCloud, Stack
from pipecore.workspace import Cut, PlaneLabels, with_spans


class InTiles:
    """The points of a cloud in a store, which dask's workers share; see `Workspace`.

    Parameters
    ----------
    engine : Engine
        Its store holds the cloud's coordinates.
    cloud : PointCloud
    slab_bytes, batch_bytes : int
        What a slab of the cloud, and a batch of profiles, may take in memory.
    """

    def __init__(
        self, engine: Engine, cloud: PointCloud, slab_bytes: int, batch_bytes: int
    ) -> None:
        self.cloud = cloud
        self.allocate: Allocate = engine.store.create
        self._engine = engine
        self._slab_bytes, self._batch_bytes = slab_bytes, batch_bytes
        self._tiled: TiledSurface | None = None

    def sample_surface(self, settings: ThinningSettings, progress: Progress) -> Surface:
        """See `Workspace`."""
        self._tiled = downsample_in_slabs(
            self._engine,
            len(self.cloud),
            settings,
            self.cloud.step,
            self._slab_bytes,
            progress,
        )
        return self._tiled.surface

    def remove_planes(
        self, surface: Surface, max_radius: float, progress: Progress
    ) -> Iterator[PlaneLabels]:
        """See `Workspace`."""
        return remove_planes(self._engine, self._known(), max_radius, progress)

    def cut_stacks(
        self, stacks: Sequence[Stack], settings: Settings, progress: Progress
    ) -> Iterator[Cut]:
        """See `Workspace`."""
        for stack, span in with_spans(stacks):
            yield from cut_in_batches(
                self._engine, self._known(), stack, settings, self._batch_bytes, progress, span
            )

    def _known(self) -> TiledSurface:
        assert self._tiled is not None, "the surface has not been sampled"
        return self._tiled
