"""The scanned surface as detection sees it: thinned points with normals, spacing and noise."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipecore._kernels import neighbours
from pipecore.parallel import for_chunks
from pipecore.progress import Progress
from pipecore.settings import ThinningSettings
from pipecore.surface.grid import CellGrid
from pipecore.surface.thinning import ThinnedCloud, median_spacing, thin
from pipecore.types import PointCloud

__all__ = [
    "Surface",
    "ThinnedCloud",
    "estimate_normals",
    "median_spacing",
    "sample_surface",
    "thin",
]

NEIGHBOURHOOD = 2.8
"""Radius of the neighbourhood of a normal, in voxels."""

MIN_NEIGHBOURS = 7


@dataclass(frozen=True, eq=False)
class Surface:
    """Thinned points with what their neighbourhoods tell.

    Parameters
    ----------
    xyz, normals : ndarray of float64, shape (m, 3)
        Local coordinates; unit normals of either sign, nan where there are too few neighbours.
    spacing : ndarray, shape (m,)
        Distance between neighbouring points around each point, metres.
    parent : ndarray of int32, shape (n,)
        Index of the surface point of each point of the cloud.
    voxel : float
        Edge of the thinning's voxels, metres.
    noise : float
        Typical distance of the thinned points from their surface, metres.
    """

    xyz: NDArray[np.float64]
    normals: NDArray[np.float64]
    spacing: NDArray[np.float64]
    parent: NDArray[np.int32]
    voxel: float
    noise: float

    @property
    def tolerance(self) -> float:
        """Distance within which points count as being on their curve, metres."""
        return max(0.25 * self.voxel, 3.0 * self.noise, 0.002)


def estimate_normals(thinned: ThinnedCloud, progress: Progress) -> Surface:
    """Fit a plane to the neighbourhood of every thinned point."""
    n = len(thinned.xyz)
    radius = NEIGHBOURHOOD * thinned.voxel
    grid = CellGrid.build(thinned.xyz, radius)
    xyz = thinned.xyz[grid.order]
    normals, residuals, spacing = np.empty((n, 3)), np.empty(n), np.empty(n)

    def work(start: int, stop: int) -> None:
        neighbours.fit_planes(
            xyz, *grid.lookup, radius, MIN_NEIGHBOURS, start, stop, normals, residuals, spacing
        )

    for_chunks(work, n, 50_000, "normals", progress)
    noise = float(np.nanquantile(residuals, 0.25)) if np.isfinite(residuals).any() else np.nan
    back = np.empty(n, np.intp)
    back[grid.order] = np.arange(n)
    return Surface(thinned.xyz, normals[back], spacing[back], thinned.parent, thinned.voxel, noise)


def sample_surface(cloud: PointCloud, settings: ThinningSettings, progress: Progress) -> Surface:
    """Thin `cloud` and estimate the normals of the thinned points."""
    return estimate_normals(thin(cloud, settings, progress), progress)
