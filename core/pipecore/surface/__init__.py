"""The scanned surface as detection sees it: downsampled points with normals, spacing and noise."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipecore._kernels import local_surfaces
from pipecore.parallel import for_chunks
from pipecore.progress import NoProgress, Progress
from pipecore.settings import ThinningSettings
from pipecore.surface.downsampling import (
    NEIGHBOURHOOD,
    SMALLEST_VOXEL,
    DownsampledCloud,
    automatic_voxel,
    average_voxels,
    downsample,
)
from pipecore.surface.grid import cells_of
from pipecore.surface.planes import planes_of_points
from pipecore.surface.sorting import CellGrid, Order, index_type, take_points
from pipecore.surface.spacing import median_spacing
from pipecore.types import PointCloud

__all__ = [
    "NO_FULL_RESOLUTION_POINTS",
    "SMALLEST_VOXEL",
    "DownsampledCloud",
    "Order",
    "Surface",
    "automatic_voxel",
    "average_voxels",
    "cells_of",
    "downsample",
    "estimate_normals",
    "fit_planes",
    "index_type",
    "median_spacing",
    "planes_of_points",
    "sample_surface",
]

WIDEST_NEIGHBOURHOOD = 4 * NEIGHBOURHOOD
"""Where there are few points, a normal's neighbourhood reaches so far, in voxels."""
NOISE_QUANTILE = 0.25
"""Of the distances from the planes: edges and corners do not count as noise."""

MIN_NEIGHBOURS = 7

NO_FULL_RESOLUTION_POINTS: Order = np.empty(0, np.int32), np.zeros(1, np.int32)
"""Of a surface whose points stand for none of a cloud's."""


@dataclass(frozen=True, eq=False)
class Surface:
    """Downsampled points with normals, spacing and noise from their neighbourhoods.

    Parameters
    ----------
    xyz, normals : ndarray of float64, shape (m, 3)
        Local coordinates; unit normals of either sign, nan where there are too few neighbours.
    spacing : ndarray, shape (m,)
        Distance between neighbouring points around each point, metres.
    full_resolution_points : (ndarray of int, shape (n,), ndarray of int, shape (m + 1,))
        The cloud's points in the order of their surface points, and where those of each
        begin.
    voxel : float
        Edge of the thinning's voxels, metres.
    noise : float
        Typical distance of the downsampled points from their surface, metres.
    """

    xyz: NDArray[np.float64]
    normals: NDArray[np.float64]
    spacing: NDArray[np.float64]
    full_resolution_points: Order
    voxel: float
    noise: float

    @property
    def tolerance(self) -> float:
        """Distance within which points count as being on their curve, metres."""
        return max(0.25 * self.voxel, 3.0 * self.noise, 0.002)

    def part(self, rows: NDArray[np.integer]) -> "Surface":
        """Some of the points, without the cloud's points that they are means of.

        Parameters
        ----------
        rows : ndarray of int
            Indices of downsampled points.

        Returns
        -------
        Surface
        """
        return Surface(
            self.xyz[rows],
            self.normals[rows],
            self.spacing[rows],
            NO_FULL_RESOLUTION_POINTS,
            self.voxel,
            self.noise,
        )


def fit_planes(
    points: NDArray[np.float64], voxel: float, progress: Progress = NoProgress()
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Fit a plane to the neighbourhood of every downsampled point.

    The neighbourhood reaches at most `WIDEST_NEIGHBOURHOOD` voxels; what lies beyond does
    not change a bit of the result.

    Parameters
    ----------
    points : ndarray, shape (m, 3)
        Downsampled points, metres.
    voxel : float
        Edge of the voxels, metres.
    progress : Progress

    Returns
    -------
    normals : ndarray, shape (m, 3)
    residuals, spacing : ndarray, shape (m,)
        Root mean square distance of the neighbours from the plane, and the distance between
        them, metres; nan where there are too few.
    """
    n = len(points)
    radius = NEIGHBOURHOOD * voxel
    grid = CellGrid.build(points, radius, "normals", progress)
    xyz = take_points(points, grid.order)
    normals, residuals, spacing = np.empty((n, 3)), np.empty(n), np.empty(n)

    def work(start: int, stop: int) -> None:
        local_surfaces.fit_planes(
            xyz, grid.rows, radius, MIN_NEIGHBOURS, start, stop, grid.order,
            normals, residuals, spacing,
        )  # fmt: skip

    for_chunks(work, len(grid.cell_keys), 8_000, "normals", progress)
    return normals, residuals, spacing


def estimate_normals(downsampled: DownsampledCloud, progress: Progress) -> Surface:
    """Estimate normals, spacing and noise from the neighbourhoods of downsampled points.

    Parameters
    ----------
    downsampled : DownsampledCloud
    progress : Progress

    Returns
    -------
    Surface
    """
    normals, residuals, spacing = fit_planes(downsampled.xyz, downsampled.voxel, progress)
    known = np.isfinite(residuals).any()
    noise = float(np.nanquantile(residuals, NOISE_QUANTILE)) if known else np.nan
    return Surface(
        downsampled.xyz,
        normals,
        spacing,
        downsampled.full_resolution_points,
        downsampled.voxel,
        noise,
    )


def sample_surface(cloud: PointCloud, settings: ThinningSettings, progress: Progress) -> Surface:
    """Downsample a cloud and estimate the normals of its downsampled points.

    Parameters
    ----------
    cloud : PointCloud
    settings : ThinningSettings
    progress : Progress

    Returns
    -------
    Surface
    """
    return estimate_normals(downsample(cloud, settings, progress), progress)
