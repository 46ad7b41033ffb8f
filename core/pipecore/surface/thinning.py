"""The thinned cloud: one mean point per cube of a grid."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from pipecore._kernels import voxels
from pipecore.progress import NoProgress, Progress, in_chunks
from pipecore.settings import ThinningSettings
from pipecore.surface.grid import cell_numbers, empty_table
from pipecore.types import PointCloud

SMALLEST_VOXEL = 0.003
"""Thinning finer than 3 mm keeps noise, not shape."""
_HASH_FACTORS = (0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9)


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


def median_spacing(
    xyz: NDArray[np.floating],
    n_sample: int = 4000,
    n_neighbours: int = 8,
    among: NDArray[np.bool_] | None = None,
) -> float:
    """Typical distance between neighbouring points on the scanned surfaces, metres.

    From the radius of the disc that holds `n_neighbours` points around sampled points:
    close pairs of overlapping scans do not make it smaller than it is. `among` says around
    which points, where others lack neighbours.
    """
    if len(xyz) < 2:
        return 0.0
    tree = cKDTree(xyz)
    places = xyz if among is None or not among.any() else xyz[among]
    sample = places[_sample_by_place(places, min(n_sample, len(places)))]
    n_neighbours = min(n_neighbours, len(xyz) - 1)
    reach, _ = tree.query(sample, n_neighbours + 1)
    return float(np.median(reach[:, -1]) * np.sqrt(np.pi / (n_neighbours + 1)))


def _sample_by_place(xyz: NDArray[np.floating], n_sample: int) -> NDArray[np.intp]:
    """Positions of points drawn by a hash of their coordinates, so in any order the same."""
    bits = np.ascontiguousarray(xyz, np.float64).view(np.uint64)
    mixed = bits @ np.array(_HASH_FACTORS, np.uint64)
    mixed = (mixed ^ (mixed >> np.uint64(31))) * np.uint64(_HASH_FACTORS[0])
    return np.argpartition(mixed, n_sample - 1)[:n_sample]


def thin(cloud: PointCloud, settings: ThinningSettings, progress: Progress) -> ThinnedCloud:
    """Average the points of `cloud` in voxels.

    The voxels' edge is the setting's, or the median spacing of the points where that is
    automatic. The result does not depend on the order of the points.
    """
    progress.update("thinning", 0.0)
    edge = settings.voxel_mm / 1e3 or max(median_spacing(cloud.xyz), SMALLEST_VOXEL)
    return average_voxels(cloud.xyz, edge, progress)


def average_voxels(
    xyz: NDArray[np.floating], edge: float, progress: Progress = NoProgress()
) -> ThinnedCloud:
    """Average points (n, 3) in voxels of `edge` metres.

    All points of some voxels give the same means as they do among those of other voxels.
    """
    keys, _, _, _ = cell_numbers(xyz, edge)
    parent = np.empty(len(xyz), np.int32)
    table_keys, table_ids = empty_table(len(xyz))
    n_voxels = 0
    for start, stop in in_chunks(len(xyz), 2_000_000, "thinning", progress):
        n_voxels = voxels.number_voxels(
            keys[start:stop], table_keys, table_ids, parent[start:stop], n_voxels
        )
    # In the order of the voxels, not in that of the points.
    key_of_voxel = np.empty(n_voxels, np.int64)
    key_of_voxel[parent] = keys
    rank = np.empty(n_voxels, np.int32)
    rank[np.argsort(key_of_voxel)] = np.arange(n_voxels, dtype=np.int32)
    parent = rank[parent]
    sums, counts = np.zeros((n_voxels, 3), np.int64), np.zeros(n_voxels, np.int64)
    voxels.sum_voxels(xyz, parent, sums, counts)
    return ThinnedCloud(sums / (1e6 * counts[:, None]), parent, edge)
