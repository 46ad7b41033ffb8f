"""LAS and LAZ, by laspy and lazrs."""

import struct
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

import numpy as np

from pipecore.io.crs import name_in_wkt
from pipecore.io.source import (
    CHUNK_POINTS,
    Chunk,
    Source,
    damaged,
    told_as_read_errors,
    truncated,
)

if TYPE_CHECKING:
    import laspy

_COMPRESSED = 0x80
_RECORD_SIZES = (20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67)
"""Smallest size of a point record of formats 0 to 10, bytes."""


@contextmanager
def open_source(path: Path) -> Iterator[Source]:
    """Open a LAS or LAZ file; see `pipecore.io.registry.Format.open`."""
    with told_as_read_errors(path, "LAS"):
        import laspy  # noqa: PLC0415

        file = path.open("rb")
    with file:
        with told_as_read_errors(path, "LAS"):
            _check_header(file, path)
            wanted = laspy.DecompressionSelection
            reader = laspy.LasReader(
                file,
                closefd=False,
                decompression_selection=wanted.base()
                | wanted.Z
                | wanted.CLASSIFICATION
                | wanted.INTENSITY
                | wanted.RGB,
            )
            header = reader.header
            if header.are_points_compressed and header.point_count:
                _check_chunks(file, path, header)
            bounds = np.array([header.mins, header.maxs])
        yield Source(
            chunks=_chunks(reader, path),
            fields=tuple(header.point_format.dimension_names),
            n_points=header.point_count,
            bounds=bounds if np.isfinite(bounds).all() else None,
            crs=_crs_name(header),
        )


def _chunks(reader: "laspy.LasReader", path: Path) -> Iterator[Chunk]:
    with told_as_read_errors(path, "LAS"):
        header = reader.header
        names = set(header.point_format.dimension_names)
        n_read = 0
        while n_read < header.point_count:
            points = reader.read_points(CHUNK_POINTS)
            if not len(points):
                raise truncated(path, header.point_count, n_read)
            n_read += len(points)
            xyz = np.empty((len(points), 3))
            with np.errstate(all="ignore"):  # A damaged header's scales may be anything.
                for axis, name in enumerate("XYZ"):
                    np.multiply(points[name], header.scales[axis], out=xyz[:, axis])
                    xyz[:, axis] += header.offsets[axis]
            rgb = None
            if "red" in names:
                rgb = np.stack([points["red"], points["green"], points["blue"]], axis=1)
            yield Chunk(
                xyz,
                n_read / header.point_count,
                intensity=np.asarray(points["intensity"], dtype=np.float32),
                rgb=rgb,
                classification=np.asarray(points["classification"], dtype=np.uint8),
            )


def _check_header(file: BinaryIO, path: Path) -> None:
    """Hold the sizes and counts of the header against the file's size.

    laspy and lazrs allocate and loop on their word alone.
    """
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


def _check_chunks(file: BinaryIO, path: Path, header: "laspy.LasHeader") -> None:
    """Refuse chunks that are larger than the file before the decoder makes room for them."""
    import lazrs  # type: ignore[import-untyped]  # noqa: PLC0415

    packing = lazrs.LazVlr(header.vlrs[header.vlrs.index("LasZipVlr")].record_data)
    if packing.item_size() != header.point_format.size:
        raise damaged(path, "LAZ", "the size of its points contradicts itself")
    file.seek(header.offset_to_point_data)
    chunks = lazrs.read_chunk_table(file, packing)
    if sum(n_bytes for _, n_bytes in chunks) > path.stat().st_size:
        raise damaged(path, "LAZ", "it is truncated")
    n_held = sum(n_points for n_points, _ in chunks)
    if header.point_count > n_held:
        raise truncated(path, header.point_count, n_held)
    file.seek(header.offset_to_point_data)


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
