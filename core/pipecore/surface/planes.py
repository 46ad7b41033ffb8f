"""Floors, walls and other planes: no profile of theirs holds an ellipse, so none is cut.

They are recognised by the normals in cubic cells. Flat cells that continue each other make
patches, and a patch is plane if the widest pipe there may be would bend away from its plane by
far more than the patch does. Narrow flat patches may be a strip of such a pipe and are no planes.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipecore._kernels import plane_patches as kernels
from pipecore.parallel import for_chunks
from pipecore.progress import NoProgress, Progress
from pipecore.surface.grid import GridFrame, VoxelCounter

CELL_VOXELS = 8.0
"""Edge of the cells, in voxels."""
MIN_POINTS = 20
"""Of a cell and those around it, to decide whether they are flat."""
MAX_SPREAD, MAX_CURVED = 0.03, 0.01
"""Largest second eigenvalue of Σnnᵀ of flat places, and its largest difference from the least."""
MAX_TURN_COS = np.cos(np.deg2rad(10.0))
MAX_OFFSET = 0.15
"""Neighbouring cells go on in each other if their normals and means agree as far, in edges."""
BLOCK, SMALLEST_BLOCK = 0.4, 8
"""Patches end at cubes of this edge, in largest radii, and at least so many cells: a hall's floor
need not be plane. Cubes begin at two places, so that no strip is left over at their faces."""
SAGITTA = np.sqrt(0.2)
"""A strip of a cylinder lies off its plane by this times the mean square of its width over its
radius: root mean squares of x² / 2r and x for x spread evenly."""
MAX_SAGITTA_SHARE = 0.3
"""A plane lies off itself by at most this share of what the widest pipe would."""

POINTS_AT_A_TIME = 1_000_000

NO_PLANE = -1


@dataclass(frozen=True, eq=False)
class CellSums:
    """The cells that some points lie in, in the order in which they were met.

    Parameters
    ----------
    cells : ndarray of int64, shape (c, 3)
    sums : ndarray of int64, shape (c, 10)
        As the kernels in `pipecore._kernels.plane_patches` need them.
    """

    cells: NDArray[np.int64]
    sums: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class CellPlanes:
    """What is known of each cell of some points.

    Parameters
    ----------
    plane : ndarray of int32, shape (c,)
        Number of the cell's plane, from 0; `NO_PLANE` for the others.
    is_cut : ndarray of bool, shape (c,)
        Whether profiles have to be cut there: everywhere but well inside planes.
    """

    plane: NDArray[np.int32]
    is_cut: NDArray[np.bool_]


def sum_cells(
    xyz: NDArray[np.float64], normals: NDArray[np.float64], voxel: float
) -> tuple[CellSums, NDArray[np.int32]]:
    """Sum up points by cell; also the cell of each point."""
    edge = CELL_VOXELS * voxel
    ids = np.empty(len(xyz), np.int32)
    if len(xyz) == 0:
        return CellSums(np.empty((0, 3), np.int64), np.empty((0, kernels.N_SUMS), np.int64)), ids
    frame = GridFrame.of(xyz, edge)
    counter = VoxelCounter(frame)
    counter.add(xyz, 0, len(xyz), ids)
    sums = np.zeros((counter.n_cells, kernels.N_SUMS), np.int64)
    kernels.add_to_cells(xyz, normals, ids, edge, sums)
    return CellSums(frame.cells_of_keys(counter.keys), sums), ids


def find_planes(parts: Sequence[CellSums], voxel: float, max_radius: float) -> list[CellPlanes]:
    """Find the planes of a surface whose points were summed up in parts.

    Parameters
    ----------
    parts : sequence of CellSums
        However the surface was divided, the planes are the same.
    voxel, max_radius : float
        Edge of the thinning's voxels and largest radius of a pipe, metres.

    Returns
    -------
    list of CellPlanes
        For each part, in the order of its cells.
    """
    n_cells = [len(part.cells) for part in parts]
    if sum(n_cells) == 0:
        return [CellPlanes(np.empty(0, np.int32), np.empty(0, np.bool_)) for _ in parts]
    cells = np.concatenate([part.cells for part in parts])
    edge = CELL_VOXELS * voxel
    frame = GridFrame.around(cells.min(axis=0) + 0.5, cells.max(axis=0) + 0.5, 1.0)
    keys, at, place = np.unique(frame.keys_of_cells(cells), return_index=True, return_inverse=True)
    cells = cells[at]
    sums = np.zeros((len(keys), kernels.N_SUMS), np.int64)
    np.add.at(sums, place, np.concatenate([part.sums for part in parts]))
    plane, is_cut = _planes_of_cells(keys, cells, sums, frame, max_radius / edge)
    cells_of_part = np.split(place, np.cumsum(n_cells)[:-1])
    return [CellPlanes(plane[rows], is_cut[rows]) for rows in cells_of_part]


def _planes_of_cells(
    keys: NDArray[np.int64],
    cells: NDArray[np.int64],
    sums: NDArray[np.int64],
    frame: GridFrame,
    max_radius: float,
) -> tuple[NDArray[np.int32], NDArray[np.bool_]]:
    """Plane of each cell, and whether it is cut; lengths in edges."""
    n, grid = len(keys), (frame.n_y, frame.n_z)
    is_flat, is_plane, is_inner = np.zeros((3, n), np.bool_)
    normals, means = np.empty((n, 3)), np.empty((n, 3))
    kernels.describe_cells(
        keys, cells, sums, *grid, MIN_POINTS, MAX_SPREAD, MAX_CURVED, is_flat, normals, means
    )

    def patches(block: int, begin: int, is_member: NDArray[np.bool_]) -> NDArray[np.int32]:
        roots = np.arange(n, dtype=np.int32)
        kernels.unite_flat(
            keys, cells, *grid, block, begin, is_member, normals, means, MAX_TURN_COS, MAX_OFFSET,
            roots,
        )  # fmt: skip
        return roots

    block = max(SMALLEST_BLOCK, int(BLOCK * max_radius))
    max_ratio = MAX_SAGITTA_SHARE * SAGITTA / max_radius
    for begin in (0, block // 2):
        kernels.mark_planes(means, is_flat, patches(block, begin, is_flat), max_ratio, is_plane)
    kernels.mark_inner(keys, *grid, is_plane, sums[:, 0].copy(), is_inner)
    # A plane goes on from block to block.
    roots = patches(0, 0, is_plane)[is_plane]
    plane = np.full(n, NO_PLANE, np.int32)
    plane[is_plane] = np.unique(roots, return_inverse=True)[1]
    return plane, ~is_inner


def planes_of_points(
    xyz: NDArray[np.float64],
    normals: NDArray[np.float64],
    voxel: float,
    max_radius: float,
    progress: Progress = NoProgress(),
) -> tuple[NDArray[np.int32], NDArray[np.bool_]]:
    """Find the plane of each point of a surface and whether profiles are cut there.

    Parameters
    ----------
    xyz, normals : ndarray, shape (n, 3)
        Downsampled points, metres, and their unit normals.
    voxel, max_radius : float
        Edge of the voxels and largest radius of a pipe, metres.
    progress : Progress

    Returns
    -------
    plane : ndarray of int32, shape (n,)
        From 0; `NO_PLANE` for points of none.
    is_cut : ndarray of bool, shape (n,)
    """
    n = len(xyz)
    plane, is_cut = np.empty(n, np.int32), np.empty(n, np.bool_)
    n_parts = -(-n // POINTS_AT_A_TIME)
    rows = [slice(k * POINTS_AT_A_TIME, min((k + 1) * POINTS_AT_A_TIME, n)) for k in range(n_parts)]
    parts: list[CellSums | None] = [None] * n_parts

    def add(first: int, last: int) -> None:
        for k in range(first, last):
            parts[k], plane[rows[k]] = sum_cells(xyz[rows[k]], normals[rows[k]], voxel)

    for_chunks(add, n_parts, 1, "directions", progress, (0.8, 1.0))
    known = find_planes([part for part in parts if part], voxel, max_radius)
    for part, cells in zip(rows, known, strict=True):
        is_cut[part], plane[part] = cells.is_cut[plane[part]], cells.plane[plane[part]]
    return plane, is_cut
