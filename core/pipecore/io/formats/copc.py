"""The octree of a COPC file: LAZ whose chunks are the nodes of a tree, coarse to fine.

Each point is in one node only. Nodes near the root hold few points from everywhere; a place
is complete with all nodes that touch it. A file whose tree contradicts its own table of
chunks is read as the plain LAZ file that it also is.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

import numpy as np
from numpy.typing import NDArray

from pipecore.io.formats.laz import ChunkTable
from pipecore.types import Array

if TYPE_CHECKING:
    import laspy
    from laspy.copc import CopcInfoVlr

_ENTRY = np.dtype(
    [("level", "<i4"), ("cell", "<i4", 3), ("place", "<u8"), ("n_bytes", "<i4"), ("n", "<i4")]
)
_IN_OTHER_PAGE = -1
DEEPEST = 30
"""Levels of a tree at most: cells are numbered by 32 bits."""


@dataclass(frozen=True, eq=False)
class Octree:
    """The nodes of a COPC file that hold points.

    Parameters
    ----------
    table : ChunkTable
    chunk, level : ndarray of int64, shape (k,)
        The chunk that holds a node's points, ascending; 0 is the level of the root.
    low, high : ndarray, shape (k, 3)
        Corners of the nodes' cubes, world coordinates in the file's unit.
    """

    table: ChunkTable
    chunk: NDArray[np.int64]
    level: NDArray[np.int64]
    low: Array
    high: Array

    @property
    def n_points(self) -> NDArray[np.int64]:
        """Number of points of each node."""
        return np.diff(self.table.starts)[self.chunk]

    def touching(self, low: Array, high: Array) -> NDArray[np.intp]:
        """Nodes that may hold points between two corners, both included."""
        apart = (self.low > high).any(axis=1) | (self.high < low).any(axis=1)
        return np.flatnonzero(~apart)

    def coarsest(self, n_points: int) -> NDArray[np.intp]:
        """Nodes of the highest levels that hold at most so many points, or of the very highest."""
        upto = np.cumsum(np.bincount(self.level, self.n_points))
        deepest = int(np.searchsorted(upto, n_points, side="right")) - 1
        return np.flatnonzero(self.level <= max(deepest, self.level.min()))

    def fullest(self) -> int:
        """The node with most points on the finest level that has any."""
        n_points = np.where(self.level == self.level.max(), self.n_points, 0)
        return int(np.argmax(n_points))


class _UnsoundError(Exception):
    """A tree that cannot be right."""


def read_octree(
    file: BinaryIO, path: Path, header: "laspy.LasHeader", table: ChunkTable
) -> Octree | None:
    """Read a COPC file's octree; None if the file has none, or one that is not to be trusted.

    Whatever the tree says is held against the file's size and its table of chunks: pages
    beyond the end or in a circle, cells that there are not, nodes that are no chunks, and
    chunks that no node holds.
    """
    import laspy  # noqa: PLC0415

    info = header.vlrs[0] if len(header.vlrs) else None
    if not isinstance(info, laspy.copc.CopcInfoVlr):
        return None
    root = info.hierarchy_root_offset, info.hierarchy_root_size
    try:
        entries = _read_pages(file, path.stat().st_size, *root)
        return _tree_of(entries[entries["n"] > 0], table, header, info)
    except _UnsoundError:
        return None


def _read_pages(file: BinaryIO, size: int, place: int, n_bytes: int) -> NDArray[np.void]:
    """All entries of the hierarchy's pages."""
    pages, found = [(place, n_bytes)], []
    left = size  # Pages do not overlap, so that together they are no larger than the file.
    while pages:
        place, n_bytes = pages.pop()
        left -= n_bytes
        if n_bytes <= 0 or n_bytes % _ENTRY.itemsize or left < 0 or place + n_bytes > size:
            raise _UnsoundError
        file.seek(place)
        found.append(np.frombuffer(file.read(n_bytes), _ENTRY))
        if (found[-1]["n"] < _IN_OTHER_PAGE).any():
            raise _UnsoundError
        others = found[-1][found[-1]["n"] == _IN_OTHER_PAGE]
        pages += zip(others["place"].tolist(), others["n_bytes"].tolist(), strict=True)
    return np.concatenate(found)


def _tree_of(
    nodes: NDArray[np.void], table: ChunkTable, header: "laspy.LasHeader", info: "CopcInfoVlr"
) -> Octree:
    """The tree of these nodes, which must be the file's chunks, each once."""
    place = nodes["place"].astype(np.int64)
    chunk = np.searchsorted(table.places, place)
    in_order = np.argsort(chunk, kind="stable")
    nodes, chunk, place = nodes[in_order], chunk[in_order], place[in_order]
    sizes, n_bytes = np.diff(table.starts), np.diff(table.places)
    if not np.array_equal(chunk, np.flatnonzero(sizes)):
        raise _UnsoundError
    level, cell = nodes["level"].astype(np.int64), nodes["cell"].astype(np.int64)
    is_sound = (
        (table.places[chunk] == place)
        & (n_bytes[chunk] == nodes["n_bytes"])
        & (sizes[chunk] == nodes["n"])
        & (level >= 0)
        & (level <= DEEPEST)
        & (cell.min(axis=1) >= 0)
    )
    if not is_sound.all() or (cell >= (1 << level)[:, None]).any():
        raise _UnsoundError
    # Rounded to the file's steps, a point may lie beyond its node's side.
    slack = np.abs(header.scales) + 1e-9 * info.halfsize
    lowest, highest = info.center - info.halfsize, info.center + info.halfsize
    if not ((header.mins >= lowest - slack) & (header.maxs <= highest + slack)).all():
        raise _UnsoundError
    edge = 2.0 * info.halfsize / (1 << level)[:, None]
    low = lowest + cell * edge
    return Octree(table, chunk, level, low - slack, low + edge + slack)
