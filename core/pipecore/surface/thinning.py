"""The thinned cloud: one mean point per cube of a grid."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipecore import parallel
from pipecore._kernels import voxels
from pipecore.parallel import for_chunks
from pipecore.progress import NoProgress, Progress
from pipecore.settings import ThinningSettings
from pipecore.surface.grid import GridFrame, VoxelCounter
from pipecore.surface.spacing import median_spacing
from pipecore.types import PointCloud

SMALLEST_VOXEL = 0.003
"""Thinning finer than 3 mm keeps noise, not shape."""
CHUNK = 2_000_000
MAX_PARTS = 8
"""Most threads that number voxels: each looks at all points."""


@dataclass(frozen=True, eq=False)
class ThinnedCloud:
    """One point per occupied voxel: the mean of the points in it.

    Parameters
    ----------
    xyz : ndarray
        Means in local coordinates, float64, shape (m, 3), in the order of the voxels.
    parent : ndarray of int32, shape (n,)
        Index of the thinned point of each point of the cloud.
    voxel : float
        Edge of the voxels, metres.
    """

    xyz: NDArray[np.float64]
    parent: NDArray[np.int32]
    voxel: float


def thin(cloud: PointCloud, settings: ThinningSettings, progress: Progress) -> ThinnedCloud:
    """Average the points of `cloud` in voxels.

    The voxels' edge is the setting's, or the median spacing of the points where that is
    automatic. The result does not depend on the order of the points.
    """
    progress.update("thinning", 0.0)
    edge = settings.voxel_mm / 1e3 or max(
        median_spacing(cloud.xyz, progress=progress), SMALLEST_VOXEL
    )
    return average_voxels(cloud.xyz, edge, progress)


def average_voxels(
    xyz: NDArray[np.floating], edge: float, progress: Progress = NoProgress()
) -> ThinnedCloud:
    """Average points (n, 3) in voxels of `edge` metres.

    All points of some voxels give the same means as they do among those of other voxels.
    """
    frame = GridFrame.of(xyz, edge)
    parent, n_voxels = _number_voxels(xyz, frame, progress)

    # Each thread sums the voxels of one stretch.
    sums, counts = np.zeros((n_voxels, 3), np.int64), np.zeros(n_voxels, np.int64)
    stretch = -(-n_voxels // min(parallel.threads(), MAX_PARTS))

    def add(first: int, last: int) -> None:
        voxels.sum_voxels(xyz, parent, first, last, sums, counts)

    for_chunks(add, n_voxels, stretch, "thinning", progress, (0.7, 0.9))
    means = np.empty((n_voxels, 3))

    def average(first: int, last: int) -> None:
        voxels.mean_voxels(sums, counts, first, last, means)

    for_chunks(average, n_voxels, CHUNK, "thinning", progress, (0.9, 1.0))
    return ThinnedCloud(means, parent, edge)


def _number_voxels(
    xyz: NDArray[np.floating], frame: GridFrame, progress: Progress
) -> tuple[NDArray[np.int32], int]:
    """Number of each point's voxel, in the order of the voxels, and how many there are."""
    ids = np.empty(len(xyz), np.int32)
    # Each thread takes the voxels of one part, whichever points are in them.
    n_parts = min(parallel.threads(), MAX_PARTS)
    counters = [VoxelCounter(frame, part, n_parts) for part in range(n_parts)]
    for start in range(0, len(xyz), CHUNK):
        stop = min(start + CHUNK, len(xyz))

        def count(part: int, _: int, start: int = start, stop: int = stop) -> None:
            counters[part].add(xyz, start, stop, ids)

        span = (0.1 + 0.4 * start / len(xyz), 0.1 + 0.4 * stop / len(xyz))
        for_chunks(count, n_parts, 1, "thinning", progress, span)
    keys = np.concatenate([c.keys for c in counters])
    at = np.concatenate([np.arange(c.n_cells) * n_parts + c.part for c in counters])
    rank = np.empty(max(c.n_cells for c in counters) * n_parts, np.int32)
    counters.clear()  # Their tables are large.
    rank[at[np.argsort(keys)]] = np.arange(len(keys), dtype=np.int32)

    def rename(start: int, stop: int) -> None:
        voxels.rename_voxels(ids, start, stop, rank)

    for_chunks(rename, len(ids), CHUNK, "thinning", progress, (0.6, 0.7))
    return ids, len(keys)
