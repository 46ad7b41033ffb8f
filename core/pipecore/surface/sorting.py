"""Points in the order of the cubic cells they lie in."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipecore._kernels import cell_sorting as kernels
from pipecore._kernels.local_surfaces import FoundCells, SortedCells
from pipecore.parallel import for_chunks
from pipecore.progress import NoProgress, Progress
from pipecore.surface.grid import GridFrame, table_of

Order = tuple[NDArray[np.integer], NDArray[np.integer]]
"""Positions of points in the order of what they belong to, and where those of each begin."""

CHUNK = 1_000_000
BUCKET = 32_768
"""About so many points are sorted at a time: they fit into a processor's cache."""
BIN_BITS = 16
"""Buckets are made up of so many ranges of cells at most (as a power of two)."""


def index_type(n: int) -> type[np.int32] | type[np.int64]:
    """Return the integer type for indices of `n` items and for their number.

    Parameters
    ----------
    n : int

    Returns
    -------
    type
        int32 where that is enough, int64 otherwise.
    """
    return np.int32 if n < 2**31 else np.int64


def sort_into_cells(
    xyz: NDArray[np.floating],
    frame: GridFrame,
    stage: str = "thinning",
    progress: Progress = NoProgress(),
    span: tuple[float, float] = (0.0, 1.0),
) -> Order:
    """Sort points (n, 3) by the number of their cell.

    First into buckets of consecutive cells, then each of these. Points of a cell stay in
    their order.

    Returns
    -------
    order : ndarray of int, shape (n,)
    starts : ndarray of int, shape (c + 1,)
        Where the points of each cell begin that holds any.
    """
    n = len(xyz)
    begin, end = span
    middle = begin + 0.4 * (end - begin)
    order, bounds = _put_in_buckets(xyz, frame, stage, progress, (begin, middle))
    is_first = np.empty(n, np.bool_)

    def sort(first: int, last: int) -> None:
        for k in range(first, last):
            bucket = slice(bounds[k], bounds[k + 1])
            kernels.sort_bucket(xyz, frame.numbers, order[bucket], is_first[bucket])

    for_chunks(sort, len(bounds) - 1, 8, stage, progress, (middle, end))
    return order, np.append(np.flatnonzero(is_first), n).astype(order.dtype)


def _put_in_buckets(
    xyz: NDArray[np.floating],
    frame: GridFrame,
    stage: str,
    progress: Progress,
    span: tuple[float, float],
) -> tuple[NDArray[np.integer], NDArray[np.int64]]:
    """The points bucket by bucket, and where each begins; cells ascend from one to the next."""
    n = len(xyz)
    if n <= BUCKET:
        return np.arange(n, dtype=index_type(n)), np.array([0, n])
    begin, end = span
    middle = 0.5 * (begin + end)
    last_cell = frame.n_x * frame.n_y * frame.n_z - 1
    shift = max(0, last_cell.bit_length() - BIN_BITS)
    counts = np.zeros((-(-n // CHUNK), (last_cell >> shift) + 1), np.int32)

    def count(start: int, stop: int) -> None:
        kernels.count_bins(xyz, start, stop, frame.numbers, shift, counts[start // CHUNK])

    for_chunks(count, n, CHUNK, stage, progress, (begin, middle))
    in_bin = counts.sum(axis=0, dtype=np.int64)
    bucket_of_bin = ((np.cumsum(in_bin) - in_bin) // BUCKET).astype(np.int32)
    is_first = np.diff(bucket_of_bin, prepend=-1) > 0
    bucket_of_bin = np.cumsum(is_first, dtype=np.int32) - 1
    in_bucket = np.add.reduceat(counts, np.flatnonzero(is_first), axis=1, dtype=np.int64)
    bounds = np.concatenate([[0], np.cumsum(in_bucket.sum(axis=0))])
    # Chunk after chunk within a bucket, so that its points are in their order.
    places = bounds[:-1] + np.cumsum(in_bucket, axis=0) - in_bucket
    order = np.empty(n, index_type(n))

    def put(start: int, stop: int) -> None:
        kernels.put_in_buckets(
            xyz, start, stop, frame.numbers, shift, bucket_of_bin, places[start // CHUNK], order
        )

    for_chunks(put, n, CHUNK, stage, progress, (middle, end))
    return order, bounds


def take_points(points: NDArray[np.float64], order: NDArray[np.integer]) -> NDArray[np.float64]:
    """Return points (n, 3) in another order."""
    taken = np.empty((len(order), 3))

    def take(start: int, stop: int) -> None:
        kernels.take_points(points, order, start, stop, taken)

    for_chunks(take, len(order), CHUNK, "", NoProgress())
    return taken


@dataclass(frozen=True, eq=False)
class CellGrid:
    """Points sorted by cell."""

    edge: float
    order: NDArray[np.integer]
    """Positions of the sorted points in the array given."""
    cell_keys: NDArray[np.int64]
    """Number of each cell, ascending, shape (c,)."""
    cell_starts: NDArray[np.integer]
    n_y: int
    n_z: int

    @classmethod
    def build(
        cls,
        xyz: NDArray[np.floating],
        edge: float,
        stage: str = "normals",
        progress: Progress = NoProgress(),
    ) -> "CellGrid":
        """Sort points (n, 3) into cells of `edge` metres."""
        frame = GridFrame.of(xyz, edge)
        order, starts = sort_into_cells(xyz, frame, stage, progress, (0.0, 0.0))
        keys = frame.keys(xyz[order[starts[:-1]]])
        return cls(edge, order, keys, starts, frame.n_y, frame.n_z)

    @property
    def rows(self) -> SortedCells:
        """The cells as kernels take them that go through all of them in order."""
        return SortedCells(self.cell_keys, self.cell_starts, self.n_y, self.n_z)

    @property
    def lookup(self) -> FoundCells:
        """The cells as kernels take them that look them up.

        Makes a hash table, so it is to be asked for once.
        """
        return FoundCells(self.order, self.rows, table_of(self.cell_keys))
