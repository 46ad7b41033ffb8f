"""Grids of cubic cells: where they lie, how they are numbered and looked up."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipecore._kernels import cell_sorting, voxel_hash
from pipecore._kernels.voxel_hash import HashTable, VoxelFrame
from pipecore.errors import PipecoreError
from pipecore.parallel import for_chunks
from pipecore.progress import NoProgress

Array = NDArray[np.float64]

CHUNK = 1_000_000


def cells_of(values: NDArray[np.floating], edge: float) -> Array:
    """Return the number of the cell of each coordinate: cells begin at multiples of `edge`.

    Cells do not depend on the other points, so that a part of a cloud is divided as the whole.

    Parameters
    ----------
    values : ndarray
        Coordinates, metres.
    edge : float
        Metres.

    Returns
    -------
    ndarray
        Whole numbers as float64, in the shape of `values`.
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
    n_x: int
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
        return cls(lowest.astype(np.int64), edge, *(int(n) for n in extent))

    @classmethod
    def of(cls, xyz: NDArray[np.floating], edge: float) -> "GridFrame":
        """Return the frame around points (n, 3)."""
        low, high = bounds(xyz)
        return cls.around(low, high, edge)

    @property
    def numbers(self) -> VoxelFrame:
        """The frame as the kernels take it."""
        return VoxelFrame(self.first, self.edge, self.n_y, self.n_z)

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
    """Lowest and highest coordinates of points (n, 3), of which there is at least one."""
    corners = np.empty((-(-len(xyz) // CHUNK), 2, 3))

    def find(start: int, stop: int) -> None:
        cell_sorting.find_bounds(xyz, start, stop, corners[start // CHUNK])

    if len(corners) == 1:
        find(0, len(xyz))
    else:
        for_chunks(find, len(xyz), CHUNK, "", NoProgress())
    return corners[:, 0].min(axis=0), corners[:, 1].max(axis=0)


def empty_table(n_keys: int) -> HashTable:
    """Return an empty hash table for up to `n_keys` keys: keys and ids."""
    size = 1 << max(4, int(np.ceil(np.log2(max(n_keys, 1) * 2))))
    return HashTable(np.full(size, voxel_hash.EMPTY), np.empty(size, np.int32))


def table_of(keys: NDArray[np.int64]) -> HashTable:
    """Return a hash table from distinct keys to their positions."""
    table = empty_table(len(keys))
    voxel_hash.fill_table(keys, table)
    return table


class VoxelCounter:
    """Numbers the cells that points lie in, in the order in which they are met."""

    def __init__(self, frame: GridFrame, room: int = 2**12) -> None:
        self._frame = frame
        self._table = empty_table(room)
        self._keys = np.empty(room, np.int64)
        self.n_cells = 0

    @property
    def keys(self) -> NDArray[np.int64]:
        """The cells' numbers in the frame, in the order of those given."""
        return self._keys[: self.n_cells]

    def add(self, xyz: NDArray[np.floating], start: int, stop: int, ids: NDArray[np.int32]) -> None:
        """Write the cells of points start … stop."""
        while True:
            start, self.n_cells = voxel_hash.number_voxels(
                xyz, start, stop, self._frame.numbers, self._table, self.n_cells, self._keys, ids
            )
            if start == stop:
                return
            self._grow()

    def _grow(self) -> None:
        known = self.keys.copy()
        self._table = empty_table(2 * len(self._keys))
        voxel_hash.fill_table(known, self._table)
        self._keys = np.resize(known, 2 * len(self._keys))
