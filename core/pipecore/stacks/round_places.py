"""Where a surface may be round, at any radius: cells whose normal lines meet on one axis.

A pipe shows its curvature only in a neighbourhood that is not small beside its radius, and a
bundle of pipes only in one that is not large. So the same question is asked of cells of
growing size, from a few voxels up to the largest radius looked for.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipecore._kernels import round_places as kernels
from pipecore.parallel import for_chunks
from pipecore.progress import NoProgress, Progress
from pipecore.surface import Surface
from pipecore.surface.grid import GridFrame, VoxelCounter, bounds, table_of

Array = NDArray[np.float64]

FINEST_VOXELS, SCALE_RATIO = 4.0, 3
"""Edge of the smallest cells, in voxels, and how many times wider those of the next scale are.
A neighbourhood of three cells across turns a normal enough to tell from radii of a third of
the edge up to five of it."""
MIN_CURVED, MAX_OFF_AXIS = 0.02, 0.25
"""Shares of the eigenvalues of Σnnᵀ: below the former a place is flat, above the latter its
normals turn about more than one axis."""
MAX_MISS = 0.2
"""Normal lines pass the axis within this share of the points' distance from it."""
PER_DIRECTION = 40
"""Directions whose components agree to one part in so many are taken together: 1.4°."""
N_POINTS = 0
"""Which of the sums of a cell, see `kernels.N_SUMS`, is the number of its points."""
POINTS_AT_A_TIME, CELLS_AT_A_TIME = 1_000_000, 20_000


@dataclass(frozen=True, eq=False)
class RoundPlaces:
    """Places of a surface that may be round, by the direction of their axis.

    Parameters
    ----------
    axis : ndarray, shape (k, 3)
        Direction of the axis about which each is round.
    n_points : ndarray, shape (k,)
        How many of the surface's points each stands for.
    """

    axis: Array
    n_points: Array

    def __len__(self) -> int:
        """Return the number of places."""
        return len(self.axis)


def find_round_places(
    surface: Surface, max_radius: float, progress: Progress = NoProgress()
) -> RoundPlaces:
    """Find the places of a surface that may be round, at scales up to a radius.

    Parameters
    ----------
    surface : Surface
        The downsampled points with their normals, in memory or mapped from files.
    max_radius : float
        Largest radius looked for, metres.
    progress : Progress

    Returns
    -------
    RoundPlaces
        Of all scales together, those of nearly one direction as one; a place that is round at
        several scales counts several times.
    """
    if len(surface.xyz) == 0:
        return RoundPlaces(np.empty((0, 3)), np.empty(0))
    low, high = bounds(surface.xyz)
    widest = min(float((high - low).max()), max_radius)
    edge = FINEST_VOXELS * surface.voxel
    cells, sums = _sum_finest(surface, edge, low, progress)
    axes, counts = [], []
    while len(cells):
        around, n_points = _axes_around(cells, sums, progress), sums[:, N_POINTS]
        with np.errstate(invalid="ignore"):
            is_round = (around.miss < MAX_MISS * around.distance) & (n_points > 0)
            is_round &= around.distance < max_radius
        axes.append(around.axis[is_round])
        counts.append(n_points[is_round])
        edge *= SCALE_RATIO
        if edge > widest:
            break
        cells, sums = _coarser(cells, sums)
    return _by_direction(np.concatenate(axes), np.concatenate(counts))


def _by_direction(axes: Array, n_points: Array) -> RoundPlaces:
    """Places of nearly one direction as one, so that there are few thousand at the most."""
    sign = np.where(axes[np.arange(len(axes)), np.argmax(np.abs(axes), axis=1)] < 0, -1.0, 1.0)
    axes = axes * sign[:, None]
    _, place = np.unique(np.round(axes * PER_DIRECTION), axis=0, return_inverse=True)
    place = place.ravel()
    total = np.asarray(np.bincount(place, n_points), np.float64)
    mean = np.stack([np.bincount(place, n_points * a) for a in axes.T], axis=1)
    return RoundPlaces(mean / np.linalg.norm(mean, axis=1, keepdims=True), total)


def _sum_finest(
    surface: Surface, edge: float, zero: Array, progress: Progress
) -> tuple[NDArray[np.int64], Array]:
    """The finest cells (k, 3), and the sums of the points in each."""
    frame = GridFrame.of(surface.xyz, edge)
    counter = VoxelCounter(frame)
    sums = np.zeros((0, kernels.N_SUMS))
    for start in range(0, len(surface.xyz), POINTS_AT_A_TIME):
        progress.update("directions", 0.0)
        xyz, normals = (
            surface.xyz[start : start + POINTS_AT_A_TIME],
            surface.normals[start : start + POINTS_AT_A_TIME],
        )
        cell = np.empty(len(xyz), np.int32)
        counter.add(xyz, 0, len(xyz), cell)
        new = np.zeros((counter.n_cells - len(sums), kernels.N_SUMS))
        sums = np.concatenate([sums, new])
        kernels.add_to_cells(xyz, normals, zero, cell, sums)
    return frame.cells_of_keys(counter.keys), sums


def _coarser(cells: NDArray[np.int64], sums: Array) -> tuple[NDArray[np.int64], Array]:
    """Cells of the next scale, with the sums of the finer ones in them."""
    merged, place = np.unique(cells // SCALE_RATIO, axis=0, return_inverse=True)
    total = np.zeros((len(merged), sums.shape[1]))
    np.add.at(total, place.ravel(), sums)
    return merged, total


class _Axes(NamedTuple):
    """What the normal lines around cells meet on; nan where they tell no axis.

    Parameters
    ----------
    axis : ndarray, shape (k, 3)
        Unit vectors.
    miss, distance : ndarray, shape (k,)
        Of the lines from the axis, and of the points from it, root mean squares, metres.
    """

    axis: Array
    miss: Array
    distance: Array


def _axes_around(cells: NDArray[np.int64], sums: Array, progress: Progress) -> _Axes:
    """Axes around cells; see the kernel."""
    low = cells.min(axis=0) - 2
    n_y, n_z = (int(n) for n in (cells.max(axis=0) - low + 3)[1:])
    i = cells - low
    keys = np.asarray((i[:, 0] * n_y + i[:, 1]) * n_z + i[:, 2])
    table = table_of(keys)
    found = np.empty((len(keys), 5))

    def work(first: int, last: int) -> None:
        kernels.axes_of_cells(
            keys, sums, table, n_y, n_z, first, last, MIN_CURVED, MAX_OFF_AXIS, found
        )

    for_chunks(work, len(keys), CELLS_AT_A_TIME, "directions", progress)
    return _Axes(found[:, :3], found[:, 3], found[:, 4])
