"""Sums over the cubic cells that a surface lies in, of which the nature of a place is told.

They are whole numbers, so that those of parts of a cloud add up to those of the whole.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipecore._kernels import planes as kernels
from pipecore.parallel import for_chunks
from pipecore.progress import NoProgress, Progress
from pipecore.surface.grid import GridFrame, VoxelCounter

CELL = 8.0
"""Edge of the cells, in voxels."""

AT_A_TIME = 1_000_000


@dataclass(frozen=True, eq=False)
class CellSums:
    """The cells that some points lie in, in the order in which they were met.

    Parameters
    ----------
    cells : ndarray of int64, shape (c, 3)
    sums : ndarray of int64, shape (c, 10)
        As the kernels in `pipecore._kernels.planes` need them.
    """

    cells: NDArray[np.int64]
    sums: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Cells:
    """All cells of a surface, row by row.

    Parameters
    ----------
    frame : GridFrame
        Numbers them; its edge is 1.
    keys : ndarray of int64, shape (c,)
        Their numbers, ascending.
    cells : ndarray of int64, shape (c, 3)
    sums : ndarray of int64, shape (c, 10)
    """

    frame: GridFrame
    keys: NDArray[np.int64]
    cells: NDArray[np.int64]
    sums: NDArray[np.int64]

    @classmethod
    def joined(cls, parts: Sequence[CellSums]) -> tuple["Cells", list[NDArray[np.intp]]]:
        """Add up parts of a surface; also the places of each part's cells among all.

        However the surface was divided, the result is the same.
        """
        cells = np.concatenate([np.empty((0, 3), np.int64), *(part.cells for part in parts)])
        sums = np.concatenate(
            [np.empty((0, kernels.N_SUMS), np.int64), *(part.sums for part in parts)]
        )
        corners = (cells.min(axis=0), cells.max(axis=0)) if len(cells) else np.zeros((2, 3))
        frame = GridFrame.around(corners[0] + 0.5, corners[1] + 0.5, 1.0)
        keys, at, place = np.unique(
            frame.keys_of_cells(cells), return_index=True, return_inverse=True
        )
        total = np.zeros((len(keys), kernels.N_SUMS), np.int64)
        np.add.at(total, place, sums)
        ends = np.cumsum([len(part.cells) for part in parts])
        return cls(frame, keys, cells[at], total), np.split(place, ends[:-1])

    def around(self) -> NDArray[np.int64]:
        """Return the sums of each cell and those next to it, without those of places."""
        around = np.empty((len(self.keys), kernels.N_NORMAL_SUMS), np.int64)
        kernels.sum_around(self.keys, self.sums, self.frame.n_y, self.frame.n_z, around)
        return around

    def coarser(self, times: int) -> tuple["Cells", NDArray[np.intp]]:
        """Return cells of so many times the edge, and which of them each cell is in.

        Their sums of places mean nothing.
        """
        joined, (place,) = Cells.joined([CellSums(self.cells // times, self.sums)])
        return joined, place


def sum_cells(
    xyz: NDArray[np.float64], normals: NDArray[np.float64], voxel: float
) -> tuple[CellSums, NDArray[np.int32]]:
    """Sum up points by cell; also the cell of each point."""
    edge = CELL * voxel
    ids = np.empty(len(xyz), np.int32)
    if len(xyz) == 0:
        return CellSums(np.empty((0, 3), np.int64), np.empty((0, kernels.N_SUMS), np.int64)), ids
    frame = GridFrame.of(xyz, edge)
    counter = VoxelCounter(frame)
    counter.add(xyz, 0, len(xyz), ids)
    sums = np.zeros((counter.n_cells, kernels.N_SUMS), np.int64)
    kernels.add_to_cells(xyz, normals, ids, edge, sums)
    return CellSums(frame.cells_of_keys(counter.keys), sums), ids


def cells_of_points(
    xyz: NDArray[np.float64],
    normals: NDArray[np.float64],
    voxel: float,
    progress: Progress = NoProgress(),
) -> tuple[Cells, NDArray[np.int32]]:
    """Sum up all points of a surface by cell; also the place of each point's cell."""
    n = len(xyz)
    n_parts = -(-n // AT_A_TIME)
    rows = [slice(k * AT_A_TIME, min((k + 1) * AT_A_TIME, n)) for k in range(n_parts)]
    parts: list[tuple[CellSums, NDArray[np.int32]] | None] = [None] * n_parts

    def add(first: int, last: int) -> None:
        for k in range(first, last):
            parts[k] = sum_cells(xyz[rows[k]], normals[rows[k]], voxel)

    for_chunks(add, n_parts, 1, "directions", progress, (0.8, 1.0))
    known = [part for part in parts if part]
    cells, places = Cells.joined([sums for sums, _ in known])
    ids = np.empty(n, np.int32)
    for own, place, (_, of_point) in zip(rows, places, known, strict=False):
        ids[own] = place[of_point]
    return cells, ids
