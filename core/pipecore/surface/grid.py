"""A hashed grid of cubic cells over points, for neighbours within a cell's edge."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipecore._kernels import voxels
from pipecore._kernels.grouping import group_by_label
from pipecore.errors import PipecoreError

Array = NDArray[np.float64]
Table = tuple[NDArray[np.int64], NDArray[np.int32]]


def cells_of(values: NDArray[np.floating], edge: float) -> Array:
    """Whole number of the cell of each coordinate: cells begin at multiples of `edge`.

    They do not depend on what else is in the cloud, so that a part of it is divided as the
    whole is.
    """
    return np.floor(values.astype(np.float64) / edge)


@dataclass(frozen=True, eq=False)
class GridFrame:
    """Where the cubic cells of a grid lie and how they are numbered.

    A margin of four cells around the points keeps the numbers of neighbouring cells distinct.
    """

    first: NDArray[np.int64]
    """The lowest cell."""
    edge: float
    n_y: int
    n_z: int

    @classmethod
    def around(cls, low: Array, high: Array, edge: float) -> "GridFrame":
        """Return the frame of cells of `edge` metres for points between two corners.

        Raises
        ------
        PipecoreError
            If there would be more cells than can be numbered.
        """
        lowest = cells_of(low, edge) - 4
        extent = cells_of(high, edge) - lowest + 5
        if max(np.prod(extent), np.abs(lowest).max()) > 2.0**62:
            raise PipecoreError(
                "The points span {extent:.3g} m, too far for cells of {edge:.3g} mm; crop the "
                "cloud or thin it more.",
                extent=extent.max() * edge,
                edge=edge * 1000.0,
            )
        return cls(lowest.astype(np.int64), edge, int(extent[1]), int(extent[2]))

    @classmethod
    def of(cls, xyz: NDArray[np.floating], edge: float) -> "GridFrame":
        """Return the frame around points (n, 3)."""
        low, high = bounds(xyz)
        return cls.around(low, high, edge)

    @property
    def numbers(self) -> tuple[NDArray[np.int64], float, int, int]:
        """What the kernels need to number a cell."""
        return self.first, self.edge, self.n_y, self.n_z

    def keys(self, xyz: NDArray[np.floating]) -> NDArray[np.int64]:
        """Return the number of the cell of each point (n, 3)."""
        return self.keys_of_cells(cells_of(xyz, self.edge).astype(np.int64))

    def keys_of_cells(self, cells: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the numbers of cells (n, 3), which count from the local zero."""
        i = cells - self.first
        return np.asarray((i[:, 0] * self.n_y + i[:, 1]) * self.n_z + i[:, 2])

    def cells_of_keys(self, keys: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the cells (n, 3) that have the given numbers."""
        rows, z = np.divmod(keys, self.n_z)
        x, y = np.divmod(rows, self.n_y)
        return np.stack([x, y, z], axis=1) + self.first


def bounds(xyz: NDArray[np.floating]) -> tuple[Array, Array]:
    """Lowest and highest coordinates of points (n, 3)."""
    # Column by column is several times as fast as along the first axis at once.
    columns = range(xyz.shape[1])
    low = np.array([xyz[:, i].min() for i in columns], np.float64)
    return low, np.array([xyz[:, i].max() for i in columns], np.float64)


def empty_table(n_keys: int) -> Table:
    """Return an empty hash table for up to `n_keys` keys: keys and ids."""
    size = 1 << max(4, int(np.ceil(np.log2(max(n_keys, 1) * 2))))
    return np.full(size, voxels.EMPTY), np.empty(size, np.int32)


def table_of(keys: NDArray[np.int64]) -> Table:
    """Return a hash table from distinct keys to their positions."""
    table = empty_table(len(keys))
    voxels.fill_table(keys, *table)
    return table


class VoxelCounter:
    """Numbers the cells that points lie in, in the order in which they are met.

    Some counters may share the points between them, each taking the cells of one part.
    """

    def __init__(
        self, frame: GridFrame, part: int = 0, n_parts: int = 1, room: int = 2**12
    ) -> None:
        self.part = part
        self._frame, self._n_parts = frame, n_parts
        self._table = empty_table(room)
        self._keys = np.empty(room, np.int64)
        self.n_cells = 0

    @property
    def keys(self) -> NDArray[np.int64]:
        """The cells' numbers in the frame, in the order of those given."""
        return self._keys[: self.n_cells]

    def add(self, xyz: NDArray[np.floating], start: int, stop: int, ids: NDArray[np.int32]) -> None:
        """Write the cells of points start … stop: `n_parts` times the number plus `part`."""
        while True:
            start, self.n_cells = voxels.number_voxels(
                xyz, start, stop, *self._frame.numbers, self.part, self._n_parts,
                *self._table, self.n_cells, self._keys, ids,
            )  # fmt: skip
            if start == stop:
                return
            self._grow()

    def _grow(self) -> None:
        known = self.keys.copy()
        self._table = empty_table(2 * len(self._keys))
        voxels.fill_table(known, *self._table)
        self._keys = np.resize(known, 2 * len(self._keys))


@dataclass(frozen=True, eq=False)
class CellGrid:
    """Points sorted by cell."""

    edge: float
    order: NDArray[np.int64]
    """Positions of the sorted points in the array given."""
    cell_keys: NDArray[np.int64]
    """Number of each cell, ascending, shape (c,)."""
    cell_starts: NDArray[np.int64]
    n_y: int
    n_z: int

    @classmethod
    def build(cls, xyz: NDArray[np.floating], edge: float) -> "CellGrid":
        """Sort points (n, 3) into cells of `edge` metres."""
        frame = GridFrame.of(xyz, edge)
        counter = VoxelCounter(frame)
        cell = np.empty(len(xyz), np.int32)
        counter.add(xyz, 0, len(xyz), cell)
        by_key = np.argsort(counter.keys)
        keys = counter.keys[by_key]
        rank = np.empty(len(keys), np.int32)
        rank[by_key] = np.arange(len(keys), dtype=np.int32)
        del counter
        voxels.rename_voxels(cell, 0, len(cell), rank)
        order, starts = group_by_label(cell, len(keys))
        return cls(edge, order, keys, starts, frame.n_y, frame.n_z)

    @property
    def rows(self) -> tuple[NDArray[np.int64], NDArray[np.int64], int, int]:
        """What kernels need that go through all cells in their order."""
        return self.cell_keys, self.cell_starts, self.n_y, self.n_z

    @property
    def lookup(
        self,
    ) -> tuple[
        NDArray[np.int64], NDArray[np.int64], NDArray[np.int64], NDArray[np.int32], int, int
    ]:
        """What the kernels in `pipecore._kernels.neighbours` need to find neighbours.

        Makes a hash table from the cells' numbers to their places: to be asked for once.
        """
        table = table_of(self.cell_keys)
        return self.cell_keys, self.cell_starts, *table, self.n_y, self.n_z
