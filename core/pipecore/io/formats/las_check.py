"""What a LAS or LAZ file says of itself, held against its size.

laspy and lazrs allocate and loop on the file's word alone; a lying one would take all
memory, or end the process.
"""

import struct
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

import numpy as np
from numpy.typing import NDArray

from pipecore.io.source import damaged, truncated

if TYPE_CHECKING:
    import laspy

_COMPRESSED = 0x80
_RECORD_SIZES = (20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67)
"""Smallest size of a point record of formats 0 to 10, bytes."""

_LAYERED = 3
_LAYERS = {10: 9, 11: 1, 12: 2, 13: 1}
"""Layers of a chunk for LASzip's items: point, colour, colour and infrared, wave packet."""
_EXTRA_BYTES = 14


def check_header(file: BinaryIO, path: Path) -> None:
    """Hold the sizes and counts of the header against the file's size."""
    size = path.stat().st_size
    head = file.read(375)
    if len(head) < 227:
        raise damaged(path, "LAS", "its header is cut off")
    minor = head[25]
    start, n_vlrs, kind, record_size, n_points = struct.unpack_from("<IIBHI", head, 96)
    if minor >= 4 and len(head) == 375:
        evlr_start, n_evlrs, n_points = struct.unpack_from("<QIQ", head, 235)
        _check_extended_records(file, path, evlr_start, n_evlrs, size)
    if start > size or 227 + 54 * n_vlrs > start:
        raise damaged(path, "LAS", "its header points beyond its end")
    point_format = kind & 0x3F
    if point_format >= len(_RECORD_SIZES) or record_size < _RECORD_SIZES[point_format]:
        raise damaged(path, "LAS", "its header names no known point format")
    if not kind & _COMPRESSED:
        n_held = (size - start) // record_size
        if n_points > n_held:
            raise truncated(path, n_points, n_held)
    elif n_points:
        _check_chunk_table(file, path, start, size)
    file.seek(0)


def _check_extended_records(file: BinaryIO, path: Path, start: int, n: int, size: int) -> None:
    for _ in range(n):
        file.seek(start + 20)
        length = file.read(8)
        start += 60 + int.from_bytes(length, "little")
        if len(length) < 8 or start > size:
            raise damaged(path, "LAS", "its header points beyond its end")


def _check_chunk_table(file: BinaryIO, path: Path, start: int, size: int) -> None:
    file.seek(start)
    place = file.read(8)
    if len(place) < 8:
        raise damaged(path, "LAZ", "it is truncated")
    (table,) = struct.unpack("<q", place)
    if table == -1:  # Written by a stream that could not go back: it stands at the end.
        file.seek(size - 8)
        (table,) = struct.unpack("<q", file.read(8))
    if not start < table <= size - 8:
        raise damaged(path, "LAZ", "it is truncated")
    file.seek(table + 4)
    (n_chunks,) = struct.unpack("<I", file.read(4))
    if n_chunks > table - start:
        raise damaged(path, "LAZ", "its table of chunks makes no sense")


def check_chunks(file: BinaryIO, path: Path, header: "laspy.LasHeader") -> int:
    """Hold the sizes of the compressed chunks and of their layers against the file's size.

    Returns
    -------
    int
        How many points the largest chunk is said to hold at most.
    """
    import lazrs  # type: ignore[import-untyped]  # noqa: PLC0415

    record = header.vlrs[header.vlrs.index("LasZipVlr")].record_data
    packing = lazrs.LazVlr(record)
    layout = header.point_format
    expected = lazrs.LazVlr.new_for_compression(layout.id, layout.num_extra_bytes).record_data()
    items = _items(record)
    if items[:, :2].tolist() != _items(expected)[:, :2].tolist():
        raise damaged(path, "LAZ", "it contradicts itself about what a point consists of")
    file.seek(header.offset_to_point_data)
    chunks = lazrs.read_chunk_table(file, packing)
    place = header.offset_to_point_data + 8
    size = path.stat().st_size
    n_layers = _count_layers(record, items)
    for n_points, n_bytes in chunks:
        if place + n_bytes > size:
            raise damaged(path, "LAZ", "it is truncated")
        # Writers of chunks of unequal size, such as COPC's, may leave an empty one at the end.
        if n_layers and (n_points or n_bytes):
            # Behind the first point, which is not compressed, and the number of points.
            file.seek(place + header.point_format.size + 4)
            layers = np.frombuffer(file.read(4 * n_layers), dtype="<u4")
            if len(layers) < n_layers or layers.sum(dtype=np.uint64) > n_bytes:
                raise damaged(path, "LAZ", "the parts of a chunk are larger than the chunk")
        place += n_bytes
    n_held = sum(n_points for n_points, _ in chunks)
    if header.point_count > n_held:
        raise truncated(path, header.point_count, n_held)
    file.seek(header.offset_to_point_data)
    return max(int(n_points) for n_points, _ in chunks)


def _items(record: bytes) -> NDArray[np.uint16]:
    """Return kind, size and version of the parts of which LASzip says a point consists."""
    (n_items,) = struct.unpack_from("<H", record, 32)
    return np.frombuffer(record, dtype="<u2", count=3 * n_items, offset=34).reshape(-1, 3)


def _count_layers(record: bytes, items: NDArray[np.uint16]) -> int:
    """Return into how many layers a chunk is divided; 0 in the older way of compression."""
    (compressor,) = struct.unpack_from("<H", record)
    if compressor != _LAYERED:
        return 0
    return sum(size if kind == _EXTRA_BYTES else _LAYERS[kind] for kind, size, _ in items.tolist())
