"""All points of the full cloud around an axis."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pipecore._kernels import cell_search, point_search
from pipecore._kernels.grouping import group_by_label, group_into
from pipecore._kernels.voxel_hash import rename_voxels
from pipecore.allocation import Allocate, in_memory
from pipecore.elements.refinement.section_model import SectionModel
from pipecore.elements.refinement.surface_fits import LineSurface, SphereSurface, SurfaceModel
from pipecore.geometry import Axis
from pipecore.progress import NoProgress, Progress
from pipecore.rounding import Rounding
from pipecore.surface import Surface
from pipecore.surface.grid import GridFrame, VoxelCounter, table_of
from pipecore.types import PointCloud

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

INNER_RADII, OUTER_RADII = 0.4, 1.3
"""The neighbourhood of an axis, in radii: deep dents inside, what touches outside."""
MAX_SPHERE_RADII = 1.2
"""The same of a sphere."""
CELL_VOXELS, COARSE_CELLS = 6.0, 4
"""Edge of the cells in which points are looked up, in voxels; of coarse cells, in fine ones."""

RADIAL_COS = float(np.cos(np.deg2rad(30.0)))
"""A point is on a surface only if its normal is this close to the surface's."""
MIN_DEPTH_RADII = 0.1
"""Points are well inside a surface from this depth on."""

ROUGH_SAMPLE_POINTS = 20_000
"""A rough search takes about this many of the points in the cells about a surface."""

POINTS_PER_UPDATE, FRACTION_AT_START = 2_000_000, 0.3
"""Points put into cells between two updates of the progress, and the fraction reported."""


@dataclass(frozen=True, eq=False)
class PointsOnSurface:
    """Downsampled points on a surface, in the order of their indices, and what lies inside it.

    Parameters
    ----------
    inliers : ndarray of int, shape (n,)
    residual, chainage, clock, normal_angle : ndarray, shape (n,)
        Distance from the surface, pipe coordinates, and the angle from the surface's normal
        to the point's, towards increasing clock.
    inside : callable
        Takes the chainages between which it is asked for, and returns chainage and clock of
        the points well inside the surface whose normals agree with it, shape (2, m).
    spacing : float
        Distance between neighbours among the points looked at, metres.
    """

    inliers: Indices
    residual: Array
    chainage: Array
    clock: Array
    normal_angle: Array
    inside: Callable[[float, float], Array]
    spacing: float

    def about(self, section: SectionModel, band: float) -> "PointsOnSurface":
        """Those within `band` of a section model, with distances from that."""
        residual = self.residual - section.height(self.chainage, self.clock)
        on = np.flatnonzero(np.abs(residual) <= band)
        return replace(
            self,
            inliers=self.inliers[on],
            residual=residual[on],
            chainage=self.chainage[on],
            clock=self.clock[on],
            normal_angle=self.normal_angle[on],
        )


def _number_by_first_use(
    keys: NDArray[np.int64],
) -> tuple[NDArray[np.int32], NDArray[np.int64]]:
    """Number keys in the order in which they first occur; also the key of each number."""
    known, at, place = np.unique(keys, return_index=True, return_inverse=True)
    order = np.argsort(at)
    ids = np.empty(len(known), np.int32)
    ids[order] = np.arange(len(known), dtype=np.int32)
    return ids[place], known[order]


class NearbyPoints:
    """Looks up downsampled points around an axis, and the cloud's points that they are means of.

    Parameters
    ----------
    cloud : PointCloud
    surface : Surface
    progress : Progress
        Updated now and then while the points are put into cells.
    allocate : callable
        Makes the arrays with a value for each downsampled point.
    """

    def __init__(
        self,
        cloud: PointCloud,
        surface: Surface,
        progress: Progress = NoProgress(),
        allocate: Allocate = in_memory,
    ) -> None:
        self._cloud = cloud
        self.surface = surface
        self.rounding = Rounding(cloud.step)
        self._members, self._starts = surface.full_resolution_points
        edge = CELL_VOXELS * surface.voxel
        frame = GridFrame.of(surface.xyz, edge)
        first, _, n_y, n_z = frame.numbers
        counter = VoxelCounter(frame)
        cell = allocate("cell_of_point", (len(surface.xyz),), np.int32)
        for start in range(0, len(cell), POINTS_PER_UPDATE):
            progress.update("elements", FRACTION_AT_START)
            counter.add(surface.xyz, start, min(start + POINTS_PER_UPDATE, len(cell)), cell)
        progress.update("elements", FRACTION_AT_START)
        numbers = counter.keys
        place = np.stack([numbers // (n_y * n_z), numbers // n_z % n_y, numbers % n_z], axis=1)
        coarse_y, coarse_z = n_y // COARSE_CELLS + 1, n_z // COARSE_CELLS + 1
        x, y, z = (place // COARSE_CELLS).T
        coarse, coarse_numbers = _number_by_first_use((x * coarse_y + y) * coarse_z + z)
        table = table_of(coarse_numbers)
        order, cell_starts = group_by_label(coarse, len(coarse_numbers))
        middles = (first + place[order] + 0.5) * edge
        rank = np.empty(len(order), np.int32)
        rank[order] = np.arange(len(order), dtype=np.int32)
        progress.update("elements", FRACTION_AT_START)
        rename_voxels(cell, 0, len(cell), rank)
        points = allocate("points_of_cells", (len(cell),), np.int32)
        starts = group_into(cell, len(order), points)
        self._grid = cell_search.PointCells(
            np.asarray(first * edge, np.float64), COARSE_CELLS * edge, coarse_y, coarse_z, table,
            cell_starts, middles, 0.5 * np.sqrt(3.0) * edge + 1e-6, points, starts,
        )  # fmt: skip

    def around_axis(
        self, axis: Axis, radius: float, margin: float, inner: float = INNER_RADII
    ) -> Indices:
        """Downsampled points from `inner` radii off `axis` on, up to `margin` beyond its ends.

        Parameters
        ----------
        axis : LineAxis or ArcAxis
        radius : float
            Of the pipe, metres.
        margin : float
            Metres.
        inner : float
            Radii.

        Returns
        -------
        ndarray of intp
            Indices of downsampled points.
        """
        tube = cell_search.Tube(
            axis.numbers, inner * radius, OUTER_RADII * radius, -margin, axis.length + margin
        )
        cells = cell_search.cells_around(self._grid, tube)
        return np.asarray(point_search.points_around(self.surface.xyz, self._grid, cells, tube))

    def on_surface(
        self,
        model: SurfaceModel,
        axis: Axis,
        margin: float,
        is_free: NDArray[np.bool_],
        *,
        band: float,
        depth: float,
        min_cos: float,
        is_rough: bool = False,
    ) -> PointsOnSurface:
        """Free downsampled points on a surface about an axis, and what lies inside it.

        Parameters
        ----------
        model : SurfaceModel
        axis : Axis
            Of the surface.
        margin : float
            How far beyond the axis's ends points are looked for, metres.
        is_free : ndarray of bool
            Downsampled points that may be on the surface.
        band, depth : float
            Points are on it up to the former distance, and inside from the latter on.
        min_cos : float
            Least cosine between a point's normal and the surface's.
        is_rough : bool
            Whether a sample of the points will do where there are many.

        Returns
        -------
        PointsOnSurface
        """
        narrow = wide = model.radius
        if isinstance(model, LineSurface) and model.is_tapered:
            ends = axis.at(np.array([-margin, axis.length + margin]))
            narrow, wide = sorted(max(model.radius_at(end), 0.0) for end in ends)
        inner, outer = INNER_RADII * narrow, OUTER_RADII * wide
        points = point_search.OrientedPoints(self.surface.xyz, self.surface.normals, is_free)
        target = point_search.Target(model.kind, model.numbers(), band, depth, min_cos)
        tube = cell_search.Tube(axis.numbers, inner, outer, -margin, axis.length + margin)
        # Only in a shell about the surface, which for a cone is not about one distance.
        shell = tube
        if not model.is_conical:
            shell = tube._replace(
                inner=max(inner, model.radius - band), outer=min(outer, model.radius + band)
            )
        inliers, columns, spacing = point_search.points_on_surface(
            points, self.surface.spacing, self.surface.voxel, self._grid, tube, shell, target,
            ROUGH_SAMPLE_POINTS if is_rough else 0,
        )  # fmt: skip

        def find_inside(begin: float, end: float) -> Array:
            part = tube._replace(begin=begin, end=end)
            cells = cell_search.cells_around(self._grid, part)
            found: Array = point_search.points_inside(points, self._grid, cells, part, target)
            return found

        residual, chainage, clock, normal_angle = columns
        return PointsOnSurface(
            inliers, residual, chainage, clock, normal_angle, find_inside, spacing
        )

    def on_sphere(
        self,
        model: SphereSurface,
        is_free: NDArray[np.bool_],
        *,
        band: float,
        min_cos: float,
        is_rough: bool = False,
    ) -> Indices:
        """Free downsampled points within `band` of a sphere whose normals agree with it.

        With `is_rough`, a sample of them where there are many.

        Parameters
        ----------
        model : SphereSurface
        is_free : ndarray of bool
            Downsampled points that may be on the sphere.
        band : float
            Metres.
        min_cos : float
            Least cosine between a point's normal and the sphere's.
        is_rough : bool

        Returns
        -------
        ndarray of intp
            Indices of downsampled points.
        """
        outer = min(model.radius + band, MAX_SPHERE_RADII * model.radius)
        inner = model.radius - band
        cells = cell_search.cells_in_shell(self._grid, model.centre, inner, outer)
        stride = point_search.stride_of(self._grid, cells, ROUGH_SAMPLE_POINTS if is_rough else 0)
        return np.asarray(
            point_search.points_on_sphere(
                point_search.OrientedPoints(self.surface.xyz, self.surface.normals, is_free),
                self._grid, cells, model.centre, inner, outer, min_cos, stride,
            )
        )  # fmt: skip

    def usual_spacing(self, downsampled: Indices) -> float:
        """Distance between neighbours among some downsampled points, not below the thinning's.

        Parameters
        ----------
        downsampled : ndarray of intp
            Indices of downsampled points, shape (k,).

        Returns
        -------
        float
            Metres.
        """
        return float(
            point_search.usual_spacing(self.surface.spacing, downsampled, self.surface.voxel)
        )

    def within_ball(self, centre: Array, radius: float) -> Indices:
        """Downsampled points within `radius` of a place, in order.

        Parameters
        ----------
        centre : ndarray
            Local coordinates, shape (3,).
        radius : float
            Metres.

        Returns
        -------
        ndarray of intp
            Indices of downsampled points.
        """
        cells = cell_search.cells_in_shell(self._grid, centre, 0.0, radius)
        return np.asarray(
            point_search.points_in_ball(self.surface.xyz, self._grid, cells, centre, radius)
        )

    def full_resolution(self, downsampled: Indices) -> tuple[Indices, Array]:
        """Indices and coordinates of the cloud's points in the voxels of downsampled points.

        Those of one voxel are in the order of their coordinates, so that the
        order of the cloud does not matter.

        Parameters
        ----------
        downsampled : ndarray of intp
            Indices of downsampled points, shape (k,).

        Returns
        -------
        rows : ndarray of intp
            Of the cloud, shape (n,).
        xyz : ndarray
            Local coordinates, shape (n, 3).
        """
        n = int(self._n_in_voxel(downsampled).sum())
        index, xyz = np.empty(n, np.intp), np.empty((n, 3))
        point_search.full_resolution_points(
            self._members, self._starts, downsampled, self._cloud.xyz, index, xyz
        )
        return index, xyz

    def full_resolution_with_normals(self, downsampled: Indices) -> tuple[Indices, Array, Array]:
        """As `full_resolution`, with the normals of the downsampled points, one for each point.

        Parameters
        ----------
        downsampled : ndarray of intp
            Indices of downsampled points, shape (k,).

        Returns
        -------
        rows : ndarray of intp
            Of the cloud, shape (n,).
        xyz, normals : ndarray
            Shape (n, 3).
        """
        index, xyz = self.full_resolution(downsampled)
        normals = np.repeat(
            self.surface.normals[downsampled], self._n_in_voxel(downsampled), axis=0
        )
        return index, xyz, normals

    def _n_in_voxel(self, downsampled: Indices) -> Indices:
        return np.asarray(self._starts[downsampled + 1] - self._starts[downsampled], np.intp)
