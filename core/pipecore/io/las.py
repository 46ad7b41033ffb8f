"""LAS and LAZ, by laspy and lazrs."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

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
def open_source(path: Path) -> Iterator[Source]:
    """Open a LAS or LAZ file; see `pipecore.io.registry.Format.open`."""
    with told_as_read_errors(path, "LAS"):
        import laspy  # noqa: PLC0415

        file = path.open("rb")
    with file:
        with told_as_read_errors(path, "LAS"):
            check_header(file, path)
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
                largest = check_chunks(file, path, header)
                if largest > LARGEST_PARALLEL_CHUNK:
                    # In parallel, whole chunks of that size would be held in memory.
                    reader.laz_backend = (laspy.LazBackend.Lazrs,)
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
