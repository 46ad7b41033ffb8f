"""LAS and LAZ, by laspy and lazrs."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from pipecore.io.crs import name_in_wkt
from pipecore.io.formats.copc import Octree, read_octree
from pipecore.io.formats.las_check import check_chunks, check_header
from pipecore.io.formats.laz import ChunkTable, unpack_chunks
from pipecore.io.source import (
    CHUNK_POINTS,
    Chunk,
    Source,
    damaged,
    told_as_read_errors,
    truncated,
)
from pipecore.types import Array

if TYPE_CHECKING:
    import laspy

LARGEST_PARALLEL_CHUNK = 2_000_000
OVERVIEW_POINTS = 200_000
"""A first picture shows about so many points, if they can be had from all over the file."""


@contextmanager
def open_source(path: Path, rows: tuple[int, int] | None = None) -> Iterator[Source]:
    """Open a LAS or LAZ file; see `pipecore.io.registry.Format.open`.

    `rows` are the first point to give and the one behind the last: of LAZ, COPC included,
    whole chunks, which its table of chunks finds; or from the first point on.
    """
    with told_as_read_errors(path, "LAS"):
        import laspy  # noqa: PLC0415

        file = path.open("rb")
    with file:
        with told_as_read_errors(path, "LAS"):
            check_header(file, path)
            wanted = laspy.DecompressionSelection
            selection = (
                wanted.base() | wanted.Z | wanted.CLASSIFICATION | wanted.INTENSITY | wanted.RGB
            )
            reader = laspy.LasReader(file, closefd=False, decompression_selection=selection)
            header = reader.header
            nodes = None
            if header.are_points_compressed and header.point_count:
                largest = check_chunks(file, path, header)
                if largest > LARGEST_PARALLEL_CHUNK:
                    # In parallel, whole chunks of that size would be held in memory.
                    reader.laz_backend = (laspy.LazBackend.Lazrs,)
                elif octree := read_octree(file, path, header):
                    nodes = _Nodes(file, path, header, octree, selection)
                file.seek(header.offset_to_point_data)
            bounds = np.array([header.mins, header.maxs])
            read = reader.read_points
            if rows is not None and rows[0] and header.are_points_compressed:
                read = _of_rows(file, header, selection, rows)
            elif rows is not None and rows[0]:
                reader.seek(rows[0])
        yield Source(
            chunks=_chunks(header, read, path, rows or (0, header.point_count)),
            fields=tuple(header.point_format.dimension_names),
            n_points=header.point_count,
            bounds=bounds if np.isfinite(bounds).all() else None,
            crs=_crs_name(header),
            overview=nodes.overview if nodes else None,
            within=nodes.within if nodes else None,
            count_within=nodes.count_within if nodes else None,
            neighbourhood=nodes.neighbourhood if nodes else None,
        )


def chunk_starts(path: Path) -> list[int]:
    """Numbers of the points at which the chunks of a LAZ file begin; of a LAS file even ones.

    Where one ends another begins; the last number is that of all points.
    """
    with told_as_read_errors(path, "LAS"), path.open("rb") as file:
        import laspy  # noqa: PLC0415

        check_header(file, path)
        header = laspy.LasHeader.read_from(file)
        n_points = int(header.point_count)
        if not header.are_points_compressed or not n_points:
            return [*range(0, n_points, CHUNK_POINTS), n_points]
        return list(dict.fromkeys(ChunkTable.read_from(file, header).starts.tolist()))


def _of_rows(
    file: BinaryIO,
    header: "laspy.LasHeader",
    selection: "laspy.DecompressionSelection",
    rows: tuple[int, int],
) -> Callable[[int], Any]:
    """A reader of the points of whole chunks, found by the table of chunks."""
    table = ChunkTable.read_from(file, header)
    points = unpack_chunks(file, header, table, table.of_rows(rows), selection)
    n_given = 0

    def read(n: int) -> Any:
        nonlocal n_given
        n_given += n
        return points[n_given - n : n_given]

    return read


@dataclass(frozen=True, eq=False)
class _Nodes:
    """An open COPC file's octree, and how to read its nodes."""

    file: BinaryIO
    path: Path
    header: "laspy.LasHeader"
    octree: Octree
    selection: "laspy.DecompressionSelection"

    def overview(self) -> Chunk:
        """Points of the coarsest levels, from all over the file."""
        coarsest = self.octree.coarsest(OVERVIEW_POINTS)
        here = self.file.tell()  # where the points are read in their order meanwhile
        chunk = next(self._chunks(coarsest, LARGEST_PARALLEL_CHUNK))
        self.file.seek(here)
        return chunk

    def within(self, corners: Array) -> Iterator[Chunk]:
        """The points of all nodes that touch a box, in their order in the file."""
        yield from self._chunks(self.octree.touching(*corners))

    def count_within(self, corners: Array) -> int:
        """Number of points in all nodes that touch a box."""
        return int(self.octree.n_points[self.octree.touching(*corners)].sum())

    def neighbourhood(self) -> Array:
        """All points in one of the fullest of the finest nodes."""
        node = self.octree.fullest()
        corners = self.octree.low[node], self.octree.high[node]
        xyz = np.concatenate([c.xyz for c in self.within(np.array(corners))])
        inside = ((xyz >= corners[0]) & (xyz <= corners[1])).all(axis=1)
        return np.asarray(xyz[inside])

    def _chunks(self, nodes: NDArray[np.intp], at_once: int | None = None) -> Iterator[Chunk]:
        at_once = at_once or CHUNK_POINTS
        with told_as_read_errors(self.path, "COPC"):
            upto = np.cumsum(self.octree.n_points[nodes])
            for some in np.split(nodes, np.flatnonzero(np.diff((upto - 1) // at_once)) + 1):
                if not len(some):
                    continue
                which = self.octree.chunk[some].tolist()
                points = unpack_chunks(
                    self.file, self.header, self.octree.table, which, self.selection
                )
                done = float(upto[np.searchsorted(nodes, some[-1])] / upto[-1])
                chunk = _chunk_of(self.header, points, done)
                self._check(some, chunk.xyz)
                yield chunk

    def _check(self, nodes: NDArray[np.intp], xyz: Array) -> None:
        """Hold the points of nodes against their cubes, or a box would miss some unnoticed."""
        n = self.octree.n_points[nodes]
        low, high = (np.repeat(c[nodes], n, axis=0) for c in (self.octree.low, self.octree.high))
        if not ((xyz >= low) & (xyz <= high)).all():
            raise damaged(self.path, "COPC", "points lie outside of the octree’s nodes")


def _chunks(
    header: "laspy.LasHeader", read: Callable[[int], Any], path: Path, rows: tuple[int, int]
) -> Iterator[Chunk]:
    with told_as_read_errors(path, "LAS"):
        n_read, last = rows
        while n_read < last:
            points = read(min(CHUNK_POINTS, last - n_read))
            if not len(points):
                raise truncated(path, header.point_count, n_read)
            n_read += len(points)
            yield _chunk_of(header, points, (n_read - rows[0]) / (last - rows[0]))


def _chunk_of(header: "laspy.LasHeader", points: Any, fraction: float) -> Chunk:
    xyz = np.empty((len(points), 3))
    with np.errstate(all="ignore"):  # A damaged header's scales may be anything.
        for axis, name in enumerate("XYZ"):
            np.multiply(points[name], header.scales[axis], out=xyz[:, axis])
            xyz[:, axis] += header.offsets[axis]
    rgb = None
    if "red" in header.point_format.dimension_names:
        rgb = np.stack([points["red"], points["green"], points["blue"]], axis=1)
    return Chunk(
        xyz,
        fraction,
        intensity=np.asarray(points["intensity"], dtype=np.float32),
        rgb=rgb,
        classification=np.asarray(points["classification"], dtype=np.uint8),
    )


_KEY_DIRECTORY, _KEY_TEXTS = 34735, 34737
_PROJECTED_CODE, _CITATIONS = 3072, (3073, 1026)


def _crs_name(header: "laspy.LasHeader") -> str:
    """Return the name of the coordinate system from its WKT or its GeoTIFF keys."""
    records = {
        vlr.record_id: vlr.record_data_bytes()
        for vlr in [*header.vlrs, *(header.evlrs or [])]
        if vlr.user_id == "LASF_Projection"
    }
    if 2112 in records:
        text: str = records[2112].decode("utf-8", errors="replace")
        return name_in_wkt(text)
    raw = records.get(_KEY_DIRECTORY, b"")
    entries = np.frombuffer(raw[: len(raw) // 8 * 8], dtype="<u2").reshape(-1, 4)[1:]
    keys = {int(key): (int(where), int(n), int(at)) for key, where, n, at in entries}
    texts: str = records.get(_KEY_TEXTS, b"").decode("latin-1")
    for citation in _CITATIONS:
        where, n, at = keys.get(citation, (0, 0, 0))
        name = texts[at : at + n].split("|", maxsplit=1)[0].strip("\0 ")
        if where == _KEY_TEXTS and name:
            return name
    code = keys.get(_PROJECTED_CODE, (0, 0, 0))[2]
    return f"EPSG:{code}" if 0 < code < 32767 else ""
