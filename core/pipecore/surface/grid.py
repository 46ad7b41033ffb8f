"""A hashed grid of cubic cells over points, for neighbours within a cell's edge."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipecore._kernels import voxels
from pipecore.errors import PipecoreError

Array = NDArray[np.float64]


def cells_of(values: NDArray[np.floating], edge: float) -> Array:
    """Whole number of the cell of each coordinate: cells begin at multiples of `edge`.

    They do not depend on what else is in the cloud, so that a part of it is divided as the
    whole is.
    """
    return np.floor(values.astype(np.float64) / edge)


def cell_numbers(
    xyz: NDArray[np.floating], edge: float
) -> tuple[NDArray[np.int64], NDArray[np.int64], int, int]:
    """Number of each point's cell, the grid's first cell, and its cells along y and z.

    A margin of four cells around the points keeps the numbers of neighbouring cells distinct.
    """
    lowest = cells_of(xyz.min(axis=0), edge) - 4
    extent = cells_of(xyz.max(axis=0), edge) - lowest + 5
    if max(np.prod(extent), np.abs(lowest).max()) > 2.0**62:
        raise PipecoreError(
            f"The points span {extent.max() * edge:.3g} m, too far for cells of "
            f"{edge * 1e3:.3g} mm; crop the cloud or thin it more."
        )
    keys = np.empty(len(xyz), np.int64)
    first = lowest.astype(np.int64)
    n_y, n_z = int(extent[1]), int(extent[2])
    voxels.voxel_keys(xyz, first, edge, n_y, n_z, keys)
    return keys, first, n_y, n_z


def empty_table(n_keys: int) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
    """Return an empty hash table for up to `n_keys` keys: keys and ids."""
    size = 1 << max(4, int(np.ceil(np.log2(max(n_keys, 1) * 2))))
    return np.full(size, voxels.EMPTY), np.empty(size, np.int32)


@dataclass(frozen=True, eq=False)
class CellGrid:
    """Points sorted by cell, with a hash table from cell numbers to ranges of points."""

    edge: float
    order: NDArray[np.intp]
    """Positions of the sorted points in the array given."""
    cells: NDArray[np.int32]
    """Cell (ix, iy, iz) of each sorted point, shape (n, 3)."""
    cell_starts: NDArray[np.int64]
    table_keys: NDArray[np.int64]
    table_ids: NDArray[np.int32]
    n_y: int
    n_z: int

    @classmethod
    def build(cls, xyz: NDArray[np.floating], edge: float) -> "CellGrid":
        """Sort points (n, 3) into cells of `edge` metres."""
        keys, _, n_y, n_z = cell_numbers(xyz, edge)
        order = np.argsort(keys, kind="stable")
        keys = keys[order]
        first = np.flatnonzero(np.diff(keys, prepend=keys[0] - 1))
        table_keys, table_ids = empty_table(len(first))
        voxels.fill_table(keys[first], table_keys, table_ids)
        cells = np.stack([keys // (n_y * n_z), keys // n_z % n_y, keys % n_z], axis=1)
        return cls(
            edge,
            order,
            cells.astype(np.int32),
            np.append(first, len(keys)),
            table_keys,
            table_ids,
            n_y,
            n_z,
        )

    @property
    def lookup(
        self,
    ) -> tuple[
        NDArray[np.int32], NDArray[np.int64], NDArray[np.int64], NDArray[np.int32], int, int
    ]:
        """What the kernels in `pipecore._kernels.neighbours` need to find neighbours."""
        return self.cells, self.cell_starts, self.table_keys, self.table_ids, self.n_y, self.n_z
