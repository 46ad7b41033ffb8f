"""The downsampled cloud: one mean point per cube of a grid."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipecore._kernels import cell_sorting
from pipecore.parallel import for_chunks
from pipecore.progress import NoProgress, Progress
from pipecore.settings import ThinningSettings
from pipecore.surface.grid import GridFrame
from pipecore.surface.sorting import Order, sort_into_cells
from pipecore.surface.spacing import median_spacing, widen_over_rows
from pipecore.types import PointCloud

NEIGHBOURHOOD = 2.8
"""Radius of the neighbourhood of a normal, in voxels."""
SMALLEST_VOXEL = 0.003
"""Thinning finer than 3 mm keeps noise, not shape."""
VOXEL_STEPS = 2.0
"""Rounded coordinates hold no shape smaller than this, in their steps."""
CHUNK = 500_000


@dataclass(frozen=True, eq=False)
class DownsampledCloud:
    """One point per occupied voxel: the mean of the points in it.

    Parameters
    ----------
    xyz : ndarray
        Means in local coordinates, float64, shape (m, 3), in the order of the voxels.
    full_resolution_points : (ndarray of int, shape (n,), ndarray of int, shape (m + 1,))
        The cloud's points in the order of their downsampled points, and where those of each
        begin.
    voxel : float
        Edge of the voxels, metres.
    """

    xyz: NDArray[np.float64]
    full_resolution_points: Order
    voxel: float


def downsample(
    cloud: PointCloud, settings: ThinningSettings, progress: Progress
) -> DownsampledCloud:
    """Average the points of a cloud in voxels.

    The voxels' edge is the setting's, or the median spacing of the points where that is
    automatic. The result does not depend on the order of the points.

    Parameters
    ----------
    cloud : PointCloud
    settings : ThinningSettings
    progress : Progress

    Returns
    -------
    DownsampledCloud
    """
    progress.update("thinning", 0.0)
    edge = settings.voxel_mm / 1e3 or automatic_voxel(cloud.xyz, cloud.step, progress=progress)
    return average_voxels(cloud.xyz, edge, progress)


def automatic_voxel(
    xyz: NDArray[np.floating],
    step: float,
    among: NDArray[np.bool_] | None = None,
    progress: Progress = NoProgress(),
) -> float:
    """Return the edge of voxels where the setting is automatic.

    It is the median spacing of the points, or larger: so that the neighbourhood of a normal
    holds more than one row of points, and no less than the coordinates' steps can show.

    Parameters
    ----------
    xyz : ndarray, shape (n, 3)
        Local coordinates, metres.
    step : float
        Steps of the coordinates, metres.
    among : ndarray of bool, shape (n,), optional
        Points that have all their neighbours, where others lack some.
    progress : Progress

    Returns
    -------
    float
        Metres.
    """
    spacing = median_spacing(xyz, among=among, progress=progress)
    least = max(spacing, SMALLEST_VOXEL, VOXEL_STEPS * step)
    if len(xyz) < 2:
        return least
    reach = NEIGHBOURHOOD * least
    wide = widen_over_rows(xyz, reach, progress)
    return least if wide == reach else wide / NEIGHBOURHOOD


def average_voxels(
    xyz: NDArray[np.floating], edge: float, progress: Progress = NoProgress()
) -> DownsampledCloud:
    """Average points in voxels.

    The mean of a voxel does not depend on points in other voxels.

    Parameters
    ----------
    xyz : ndarray, shape (n, 3)
        Local coordinates, metres.
    edge : float
        Edge of the voxels, metres.
    progress : Progress

    Returns
    -------
    DownsampledCloud
    """
    frame = GridFrame.of(xyz, edge)
    order, starts = sort_into_cells(xyz, frame, "thinning", progress, (0.1, 0.8))
    means = np.empty((len(starts) - 1, 3))

    def average(first: int, last: int) -> None:
        cell_sorting.mean_points(xyz, order, starts, first, last, means)

    for_chunks(average, len(means), CHUNK, "thinning", progress, (0.8, 1.0))
    return DownsampledCloud(means, (order, starts), edge)
