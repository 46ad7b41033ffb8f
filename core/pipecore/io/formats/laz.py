"""The chunks of a LAZ file: where they are, and any of them unpacked by itself.

lazrs allocates and loops on the file's word alone; a lying one would take all memory, or end
the process. Tables of chunks are therefore held against the file's size, and made anew from
the chunks themselves where they are damaged or missing, if the chunks say how large they are.
"""

import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from pipecore.io.formats.las_header import LasHead
from pipecore.io.source import damaged

if TYPE_CHECKING:
    import laspy

POINTWISE, CHUNKED, LAYERED = 1, 2, 3
"""How LASzip packs points: all in a row (LASzip 1), in chunks, in chunks of layers."""
_LAYERS = {10: 9, 11: 1, 12: 2, 13: 1}
"""Layers of a chunk for LASzip's items: point, colour, colour and infrared, wave packet."""
_EXTRA_BYTES = 14
_UNEQUAL = 2**32 - 1
"""Said to be the size of chunks that differ in size."""
_MOST_PER_BYTE = 1000
"""Points in a byte of a file at most, where only its header says how many there are."""
_STEP_POINTS = 50_000
"""Points unpacked at once where they cannot be found by chunks."""


@dataclass(frozen=True, eq=False)
class ChunkTable:
    """Where the chunks of a LAZ file are.

    Parameters
    ----------
    starts, places : ndarray of int64, shape (k + 1,)
        Number of the first point of each chunk, and the chunk's place in the file; the last
        ones are where all end.
    packing : bytes
        How points are packed, as lazrs takes it.
    is_rebuilt : bool
        Whether the file's own table is damaged or missing.
    """

    starts: NDArray[np.int64]
    places: NDArray[np.int64]
    packing: bytes
    is_rebuilt: bool = False

    def __len__(self) -> int:
        """Return the number of chunks."""
        return len(self.starts) - 1

    @property
    def n_points(self) -> int:
        """Number of points in all chunks."""
        return int(self.starts[-1])

    @property
    def largest(self) -> int:
        """Number of points of the largest chunk."""
        return int(np.diff(self.starts).max(initial=0))

    def of_rows(self, rows: tuple[int, int]) -> range:
        """Chunks of a range of points that begins and ends where chunks do."""
        inside = (self.starts[:-1] >= rows[0]) & (self.starts[:-1] < rows[1])
        which = np.flatnonzero(inside & (np.diff(self.starts) > 0))
        return range(int(which[0]), int(which[-1]) + 1) if len(which) else range(0)


def find_chunks(file: BinaryIO, path: Path, head: LasHead) -> ChunkTable | None:
    """Find the chunks of a LAZ file.

    Returns
    -------
    ChunkTable or None
        None if points can only be unpacked one after the other, because LASzip 1 packed
        them, or because the table is damaged and the chunks do not say how large they are.

    Raises
    ------
    ReadError
        If the file contradicts itself about what a point consists of.
    """
    layout, packing = head.header.point_format, head.packing
    items = _items(packing, path)
    expected = _expected_items(layout)
    if items[:, :2].tolist() != expected[:, :2].tolist():
        raise damaged(path, "LAZ", "it contradicts itself about what a point consists of")
    (compressor,) = struct.unpack_from("<H", packing)
    if compressor not in (POINTWISE, CHUNKED, LAYERED):
        raise damaged(path, "LAZ", "its points are packed in no known way")
    if compressor == POINTWISE:
        return None
    start, size = head.header.offset_to_point_data, path.stat().st_size
    table = _read_table(file, head, size)
    if compressor == LAYERED:
        n_layers = sum(
            n if kind == _EXTRA_BYTES else _LAYERS[kind] for kind, n, _ in items.tolist()
        )
        told = None if table is None else _walk(file, head, n_layers, table, size)
        return told or _walk(file, head, n_layers, None, size)
    if table is None or table[:, 0].sum() < head.announced or start + 8 + table[:, 1].sum() > size:
        return None
    return _as_table(table, start, head)


def _as_table(
    chunks: NDArray[np.int64], start: int, head: LasHead, *, is_rebuilt: bool = False
) -> ChunkTable:
    n_points, n_bytes = chunks.T
    # The last of chunks of equal size is said to be as large as the others.
    return ChunkTable(
        np.minimum(np.concatenate([[0], np.cumsum(n_points)]), min(head.announced, 2**62)),
        start + 8 + np.concatenate([[0], np.cumsum(n_bytes)]),  # behind the table's own place
        head.packing,
        is_rebuilt,
    )


def _items(packing: bytes, path: Path) -> NDArray[np.uint16]:
    """Return kind, size and version of the parts of which LASzip says a point consists."""
    n_items = struct.unpack_from("<H", packing, 32)[0] if len(packing) >= 34 else 0
    if not n_items or len(packing) < 34 + 6 * n_items:
        raise damaged(path, "LAZ", "it does not say how its points are packed")
    return np.frombuffer(packing, dtype="<u2", count=3 * n_items, offset=34).reshape(-1, 3)


def _expected_items(layout: "laspy.PointFormat") -> NDArray[np.uint16]:
    import lazrs  # type: ignore[import-untyped]  # noqa: PLC0415

    record = lazrs.LazVlr.new_for_compression(layout.id, layout.num_extra_bytes).record_data()
    (n_items,) = struct.unpack_from("<H", record, 32)
    return np.frombuffer(record, dtype="<u2", count=3 * n_items, offset=34).reshape(-1, 3)


def _read_table(file: BinaryIO, head: LasHead, size: int) -> NDArray[np.int64] | None:
    """Numbers of points and bytes of the chunks as the file says, or None if it cannot be."""
    import lazrs  # noqa: PLC0415

    start = head.header.offset_to_point_data
    file.seek(start)
    place = file.read(8)
    if len(place) < 8:
        return None
    (table,) = struct.unpack("<q", place)
    if table == -1:  # Written by a stream that could not go back: it stands at the end.
        file.seek(size - 8)
        (table,) = struct.unpack("<q", file.read(8))
    if not start < table <= size - 8:
        return None
    file.seek(table + 4)
    (n_chunks,) = struct.unpack("<I", file.read(4))
    if not 0 < n_chunks <= table - start:
        return None
    file.seek(start)
    try:
        chunks = lazrs.read_chunk_table(file, lazrs.LazVlr(head.packing))
    except BaseException as error:
        if not isinstance(error, Exception) and type(error).__name__ != "PanicException":
            raise
        return None
    found = np.array(chunks, np.uint64).reshape(-1, 2)
    if found.max(initial=0) > 2**40 or found[:, 1].sum(dtype=np.float64) > size:
        return None
    return found.astype(np.int64)


def _walk(
    file: BinaryIO, head: LasHead, n_layers: int, told: NDArray[np.int64] | None, size: int
) -> ChunkTable | None:
    """Go from chunk to chunk of layers, each of which says how many points and bytes it has.

    With the file's own table, return None where it contradicts the chunks; without, stop at
    the first chunk that is not whole.
    """
    start = head.header.offset_to_point_data
    prefix = head.header.point_format.size + 4  # the first point, and the number of points
    place, n_points = start + 8, 0
    found: list[tuple[int, int]] = []
    n_chunks = len(told) if told is not None else None
    (chunk_size,) = struct.unpack_from("<I", head.packing, 12)
    while n_points < head.announced and (n_chunks is None or len(found) < n_chunks):
        file.seek(place + prefix - 4)
        raw = file.read(4 + 4 * n_layers)
        own = told[len(found)] if told is not None else None
        if own is not None and not own.any():
            # Writers of chunks of unequal size, such as COPC's, may leave an empty one.
            found.append((0, 0))
            continue
        if len(raw) < 4 + 4 * n_layers:
            break
        sizes = np.frombuffer(raw, dtype="<u4").astype(np.int64)
        n, n_bytes = int(sizes[0]), prefix + 4 * n_layers + int(sizes[1:].sum())
        is_whole = 0 < n <= chunk_size and place + n_bytes <= size
        if own is not None:
            is_whole &= n_bytes <= own[1] and n <= max(own[0], 1)
            n_bytes = int(own[1])
        if not is_whole:
            break
        found.append((n, n_bytes))
        n_points += n
        place += n_bytes
        if n < chunk_size != _UNEQUAL:
            break  # Only the last of chunks of equal size is smaller.
    if told is not None and n_points < head.announced:
        return None
    chunks = np.array(found, np.int64).reshape(-1, 2)
    return _as_table(chunks, start, head, is_rebuilt=told is None)


def unpack_chunks(
    file: BinaryIO,
    header: "laspy.LasHeader",
    table: ChunkTable,
    which: Sequence[int],
    selection: "laspy.DecompressionSelection",
) -> "laspy.PackedPointRecord":
    """Return the points of some chunks, in the order given.

    lazrs' own seeking misses the place where chunks differ in size.
    """
    import laspy  # noqa: PLC0415
    import lazrs  # noqa: PLC0415

    compressed = bytearray()
    sizes = []
    for chunk in which:
        place, end = table.places[chunk : chunk + 2].tolist()
        file.seek(place)
        compressed += file.read(end - place)
        sizes.append((int(table.starts[chunk + 1] - table.starts[chunk]), end - place))
    raw = np.zeros(sum(n for n, _ in sizes) * header.point_format.size, np.uint8)
    lazrs.decompress_points_with_chunk_table(
        np.frombuffer(compressed, np.uint8), table.packing, raw, sizes, selection.to_lazrs()
    )
    return laspy.PackedPointRecord.from_buffer(raw, header.point_format)


def unpack_in_order(
    file: BinaryIO,
    path: Path,
    head: LasHead,
    table: ChunkTable | None,
    selection: "laspy.DecompressionSelection",
) -> Iterator[tuple["laspy.PackedPointRecord", bool]]:
    """Yield points one after the other, without a table of chunks if it is None.

    Yields
    ------
    (PackedPointRecord, bool)
        Some points, and whether the file ended within them.
    """
    import laspy  # noqa: PLC0415
    import lazrs  # noqa: PLC0415

    header, (compressor,) = head.header, struct.unpack_from("<H", head.packing)
    if head.announced > _MOST_PER_BYTE * path.stat().st_size:
        raise damaged(path, "LAZ", f"it cannot hold the {head.announced:,} points it announces")
    stream: Any = file
    if compressor != POINTWISE and (table is None or table.is_rebuilt):
        stream = _WithoutTable(file, header.offset_to_point_data, path.stat().st_size)
    stream.seek(header.offset_to_point_data)
    unpacker = lazrs.LasZipDecompressor(stream, head.packing, selection.to_lazrs())
    n_left, size = head.announced, header.point_format.size
    while n_left > 0:
        n = min(_STEP_POINTS, n_left)
        raw = np.zeros(n * size, np.uint8)
        try:
            unpacker.decompress_many(raw)
        except lazrs.LazrsError:
            # What it wrote before the end is whole, but perhaps for the last point.
            rows = np.flatnonzero(raw.reshape(n, size).any(axis=1))
            n_whole = int(rows[-1]) if len(rows) else 0
            yield (
                laspy.PackedPointRecord.from_buffer(raw[: n_whole * size], header.point_format),
                True,
            )
            return
        n_left -= n
        yield laspy.PackedPointRecord.from_buffer(raw, header.point_format), False


_FAR_AWAY = 1 << 60
"""Place of a table that is not there, where no file reaches."""


class _WithoutTable:
    """A LAZ file whose table of chunks seems to be empty, and far behind its end."""

    def __init__(self, file: BinaryIO, start: int, size: int) -> None:
        self._file, self._start, self._size = file, start, size
        self._place = 0

    def seek(self, offset: int, whence: int = 0) -> int:
        """Go to a place; see `io.IOBase.seek`."""
        self._place = offset + {0: 0, 1: self._place, 2: self._size}[whence]
        return self._place

    def tell(self) -> int:
        """Return the place."""
        return self._place

    def read(self, n: int = -1) -> bytes:
        """Return up to so many bytes."""
        if self._place >= _FAR_AWAY:
            data = bytearray(max(0, min(n, _FAR_AWAY + 8 - self._place)))
        else:
            self._file.seek(self._place)
            data = bytearray(self._file.read(n))
            for k, byte in enumerate(struct.pack("<q", _FAR_AWAY)):
                if 0 <= self._start + k - self._place < len(data):
                    data[self._start + k - self._place] = byte
        self._place += len(data)
        return bytes(data)
