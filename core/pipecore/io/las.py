"""LAS and LAZ, by laspy and lazrs."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

from pipecore.io.crs import name_in_wkt
from pipecore.io.las_check import check_chunks, check_header
from pipecore.io.source import (
    CHUNK_POINTS,
    Chunk,
    Source,
    told_as_read_errors,
    truncated,
)

if TYPE_CHECKING:
    import laspy

LARGEST_PARALLEL_CHUNK = 2_000_000


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
            if header.are_points_compressed and header.point_count:
                largest = check_chunks(file, path, header)
                if largest > LARGEST_PARALLEL_CHUNK:
                    # In parallel, whole chunks of that size would be held in memory.
                    reader.laz_backend = (laspy.LazBackend.Lazrs,)
            bounds = np.array([header.mins, header.maxs])
            read = reader.read_points
            if rows is not None and rows[0] and header.are_points_compressed:
                read = _whole_chunks(file, header, selection, rows)
            elif rows is not None and rows[0]:
                reader.seek(rows[0])
        yield Source(
            chunks=_chunks(header, read, path, rows or (0, header.point_count)),
            fields=tuple(header.point_format.dimension_names),
            n_points=header.point_count,
            bounds=bounds if np.isfinite(bounds).all() else None,
            crs=_crs_name(header),
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
        return [0, *dict.fromkeys(end for end, _ in _chunk_ends(file, header) if end)]


def _chunk_ends(file: BinaryIO, header: "laspy.LasHeader") -> list[tuple[int, int]]:
    """For each chunk the points up to its end, and its size in bytes."""
    import lazrs  # type: ignore[import-untyped]  # noqa: PLC0415

    packing = lazrs.LazVlr(header.vlrs[header.vlrs.index("LasZipVlr")].record_data)
    file.seek(header.offset_to_point_data)
    chunks = lazrs.read_chunk_table(file, packing)
    # The last of chunks of equal size is said to be as large as the others.
    ends = np.minimum(np.cumsum([n for n, _ in chunks]), header.point_count)
    return list(zip(ends.tolist(), [n_bytes for _, n_bytes in chunks], strict=True))


def _whole_chunks(
    file: BinaryIO,
    header: "laspy.LasHeader",
    selection: "laspy.DecompressionSelection",
    rows: tuple[int, int],
) -> Callable[[int], Any]:
    """A reader of the points of whole chunks, found by the table of chunks.

    lazrs' own seeking misses the place where chunks differ in size.
    """
    import laspy  # noqa: PLC0415
    import lazrs  # noqa: PLC0415

    table: list[tuple[int, int]] = []
    place, begin = header.offset_to_point_data + 8, 0
    for end, n_bytes in _chunk_ends(file, header):
        if begin < rows[0]:
            place += n_bytes
        elif begin < rows[1]:
            table.append((end - begin, n_bytes))
        begin = end
    file.seek(place)
    compressed = np.frombuffer(file.read(sum(n for _, n in table)), np.uint8)
    raw = np.zeros((rows[1] - rows[0]) * header.point_format.size, np.uint8)
    packing = header.vlrs[header.vlrs.index("LasZipVlr")].record_data
    lazrs.decompress_points_with_chunk_table(compressed, packing, raw, table, selection.to_lazrs())
    points = laspy.PackedPointRecord.from_buffer(raw, header.point_format)
    n_given = 0

    def read(n: int) -> Any:
        nonlocal n_given
        n_given += n
        return points[n_given - n : n_given]

    return read


def _chunks(
    header: "laspy.LasHeader", read: Callable[[int], Any], path: Path, rows: tuple[int, int]
) -> Iterator[Chunk]:
    with told_as_read_errors(path, "LAS"):
        names = set(header.point_format.dimension_names)
        n_read, last = rows
        while n_read < last:
            points = read(min(CHUNK_POINTS, last - n_read))
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
                (n_read - rows[0]) / (last - rows[0]),
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
