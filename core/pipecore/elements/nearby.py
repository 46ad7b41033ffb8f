"""All points of the full cloud around an axis."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from pipecore._kernels.grouping import group_by_label
from pipecore.geometry import Axis
from pipecore.surface import Surface
from pipecore.types import PointCloud

Array = NDArray[np.float64]

INNER, OUTER = 0.4, 1.3
"""The neighbourhood of an axis, in radii: deep dents inside, what touches outside."""


class NearbyPoints:
    """Looks up thinned points around an axis, and the cloud's points behind them."""

    def __init__(self, cloud: PointCloud, surface: Surface) -> None:
        self._cloud = cloud
        self.surface = surface
        self._tree = cKDTree(surface.xyz)
        self._is_found = np.zeros(len(surface.xyz), np.bool_)
        self._members, self._starts = group_by_label(surface.parent, len(surface.xyz))

    def thinned(self, axis: Axis, radius: float, margin: float) -> NDArray[np.intp]:
        """Thinned points within the neighbourhood of `axis`, up to `margin` beyond its ends."""
        step = max(0.7 * radius, self.surface.voxel)
        n = max(2, int(np.ceil((axis.length + 2 * margin) / step)) + 1)
        places = axis.at(np.linspace(-margin, axis.length + margin, n))
        half_step = 0.5 * (axis.length + 2 * margin) / (n - 1)
        balls = self._tree.query_ball_point(places, float(np.hypot(OUTER * radius, half_step)))
        for ball in balls:
            self._is_found[ball] = True
        found = np.flatnonzero(self._is_found)
        self._is_found[found] = False
        if len(found) == 0:
            return found
        chainage, rho, _ = axis.pipe_coordinates(self.surface.xyz[found])
        inside = (rho > INNER * radius) & (rho < OUTER * radius)
        return found[inside & (chainage > -margin) & (chainage < axis.length + margin)]

    def usual_spacing(self, thinned: NDArray[np.intp]) -> float:
        """Distance between neighbours among some thinned points, not below the thinning's."""
        if len(thinned) == 0:
            return self.surface.voxel
        return max(self.surface.voxel, float(np.nanmedian(self.surface.spacing[thinned])))

    def within_ball(self, centre: Array, radius: float) -> NDArray[np.intp]:
        """Thinned points within `radius` of a place, in order."""
        return np.sort(np.asarray(self._tree.query_ball_point(centre, radius), np.intp))

    def of_cloud(self, thinned: NDArray[np.intp]) -> tuple[NDArray[np.intp], Array, Array]:
        """Indices, coordinates and normals (of their thinned point) of the cloud's points."""
        sizes = self._starts[thinned + 1] - self._starts[thinned]
        first = np.concatenate([[0], np.cumsum(sizes)[:-1]]).astype(np.intp)
        rows = np.arange(sizes.sum()) + np.repeat(self._starts[thinned] - first, sizes)
        index = self._members[rows]
        return (
            index,
            self._cloud.xyz[index].astype(np.float64),
            np.repeat(self.surface.normals[thinned], sizes, axis=0),
        )
