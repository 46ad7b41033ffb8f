"""LAS and LAZ, by laspy and lazrs."""

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from pipecore.io.formats.copc import Octree, read_octree
from pipecore.io.formats.las_header import LasHead, read_head
from pipecore.io.formats.laz import ChunkTable, find_chunks, unpack_chunks, unpack_in_order
from pipecore.io.left_out import NOISE, SATURATED, WITHHELD
from pipecore.io.source import (
    CHUNK_POINTS,
    DEFAULT,
    Chunk,
    FieldInfo,
    OpenOptions,
    Source,
    damaged,
    raise_read_errors,
    truncated,
    truncated_note,
)
from pipecore.notes import Note
from pipecore.settings import FlaggedPoints
from pipecore.types import Array, Storage

if TYPE_CHECKING:
    import laspy

LARGEST_PARALLEL_CHUNK = 2_000_000
OVERVIEW_POINTS = 200_000
"""A first picture shows about so many points, if they can be had from all over the file."""

_LOW_NOISE, _HIGH_NOISE = 7, 18
_WITHHELD_OLD, _WITHHELD_NEW = 0x80, 0x04
_INT32_MOST = 2**31 - 1
ORIGINAL_INTENSITY = "original_intensity"
"""Extra value that holds intensities which LAS cannot hold as such: signed or fractions."""
_HELD_ELSEWHERE = {"X", "Y", "Z", "intensity", "classification", ORIGINAL_INTENSITY}
"""What a cloud has arrays of its own for. Colours have 16 bits, of which it keeps 8."""


@contextmanager
def open_source(
    path: Path, options: OpenOptions = DEFAULT, *, rows: tuple[int, int] | None = None
) -> Iterator[Source]:
    """Open a LAS or LAZ file; see `pipecore.io.registry.Format.open`.

    `rows` are the first point to give and the one behind the last: of LAZ, COPC included,
    whole chunks, which its table of chunks finds; or from the first point on.
    """
    with raise_read_errors(path, "LAS"):
        file = path.open("rb")
    with file:
        with raise_read_errors(path, "LAS"):
            reader = _Reader.of(file, path, options)
            header = reader.head.header
            nodes = None
            if reader.table is not None and not reader.table.is_rebuilt:
                octree = read_octree(file, path, header, reader.table)
                nodes = None if octree is None else _Nodes(reader, octree)
            bounds = np.array([header.mins, header.maxs])
            step = float(np.abs(header.scales).max())
        yield Source(
            chunks=reader.chunks(rows or (0, reader.n_points)),
            fields=tuple(header.point_format.dimension_names),
            n_points=reader.n_points,
            bounds=bounds if np.isfinite(bounds).all() else None,
            system=reader.head.system,
            guid=str(header.uuid),
            step=step if np.isfinite(step) else 0.0,
            storage=_storage(reader.head),
            field_infos=_field_infos(header.point_format, reader.head.no_data),
            notes=reader.notes,
            left_out=reader.left_out,
            overview=nodes.overview if nodes else None,
            within=nodes.within if nodes else None,
            count_within=nodes.count_within if nodes else None,
            neighbourhood=nodes.neighbourhood if nodes else None,
        )


def chunk_starts(path: Path) -> list[int]:
    """Numbers of the points at which the chunks of a LAZ file begin; of a LAS file even ones.

    Where one ends another begins; the last number is that of all points. Of a file whose
    points can only be read in order, 0 alone.
    """
    with raise_read_errors(path, "LAS"), path.open("rb") as file:
        reader = _Reader.of(file, path, DEFAULT)
        n_points = reader.n_points
        if not reader.head.header.are_points_compressed:
            return [*range(0, n_points, CHUNK_POINTS), n_points]
        if reader.table is None or reader.table.is_rebuilt:
            return [0]
        return list(dict.fromkeys(reader.table.starts.tolist()))


@dataclass(frozen=True, eq=False)
class _Reader:
    """An open LAS or LAZ file."""

    file: BinaryIO
    path: Path
    head: LasHead
    table: ChunkTable | None
    n_points: int
    """As far as it is known before reading."""
    options: OpenOptions
    selection: "laspy.DecompressionSelection"
    notes: list[Note]
    left_out: Counter[str] = field(default_factory=Counter)

    @classmethod
    def of(cls, file: BinaryIO, path: Path, options: OpenOptions) -> "_Reader":
        import laspy  # noqa: PLC0415

        head = read_head(file, path)
        header, table, n_points = head.header, None, head.announced
        if not header.are_points_compressed:
            size = path.stat().st_size
            n_points = min(
                n_points, (size - header.offset_to_point_data) // header.point_format.size
            )
        elif n_points:
            table = find_chunks(file, path, head)
            if table is not None:
                n_points = table.n_points
        if n_points < head.announced and not n_points:
            raise truncated(path, head.announced, 0)
        notes = list(head.notes)
        if n_points < head.announced:
            notes.append(truncated_note(path, head.announced, n_points))
        elif table is not None and table.is_rebuilt:
            notes.append(_table_note(path))
        wanted = laspy.DecompressionSelection
        selection = (
            *(wanted.base(), wanted.Z, wanted.CLASSIFICATION, wanted.FLAGS, wanted.INTENSITY),
            *(wanted.RGB, wanted.POINT_SOURCE_ID),
        )
        chosen = wanted.all() if options.has_fields else selection[0]
        for part in () if options.has_fields else selection[1:]:
            chosen |= part
        if _has_original_intensity(header.point_format):
            chosen |= wanted.ALL_EXTRA_BYTES
        return cls(file, path, head, table, n_points, options, chosen, notes)

    def chunks(self, rows: tuple[int, int]) -> Iterator[Chunk]:
        """All points of some rows, as `open_source` takes them."""
        with raise_read_errors(self.path, "LAS"):
            n_all = max(rows[1] - rows[0], 1)
            n_read = 0
            for points in self._records(rows):
                for start in range(0, len(points), CHUNK_POINTS):
                    some = points[start : start + CHUNK_POINTS]
                    n_read += len(some)
                    self._check_channels(some)
                    yield self.chunk_of(some, min(1.0, n_read / n_all))

    def _records(self, rows: tuple[int, int]) -> Iterator[Any]:
        if not self.head.header.are_points_compressed:
            yield from self._plain_records(rows)
        elif self.table is None or self.table.largest > LARGEST_PARALLEL_CHUNK:
            # In parallel, whole chunks of that size would be held in memory.
            yield from self._records_in_order()
        elif len(which := self.table.of_rows(rows)):
            starts = (
                self.table.starts[which.start : which.stop + 1] - self.table.starts[which.start]
            )
            # Whole chunks, as many as begin within each so many points.
            group = (starts[:-1] // CHUNK_POINTS).astype(np.int64)
            for some in np.split(np.array(which), np.flatnonzero(np.diff(group)) + 1):
                yield self.unpack(some.tolist())

    def _plain_records(self, rows: tuple[int, int]) -> Iterator[Any]:
        import laspy  # noqa: PLC0415

        layout, start = self.head.header.point_format, self.head.header.offset_to_point_data
        for first in range(rows[0], rows[1], CHUNK_POINTS):
            n = min(CHUNK_POINTS, rows[1] - first)
            self.file.seek(start + first * layout.size)
            raw = np.empty(n * layout.size, np.uint8)
            n_bytes = self.file.readinto(raw)  # type: ignore[attr-defined]
            if n_bytes < len(raw):
                raise truncated(self.path, self.head.announced, first + n_bytes // layout.size)
            yield laspy.PackedPointRecord.from_buffer(raw, layout)

    def _records_in_order(self) -> Iterator[Any]:
        n_read = 0
        for points, is_end in unpack_in_order(
            self.file, self.path, self.head, self.table, self.selection
        ):
            n_read += len(points)
            if len(points):
                yield points
            if is_end:
                if not n_read:
                    raise truncated(self.path, self.head.announced, 0)
                self.notes.append(truncated_note(self.path, self.head.announced, n_read))
                return
        (kind,) = self.head.packing[:1]
        if self.table is None and kind != 1:
            self.notes.append(_table_note(self.path))

    def unpack(self, which: list[int]) -> Any:
        """The points of some chunks."""
        assert self.table is not None
        return unpack_chunks(self.file, self.head.header, self.table, which, self.selection)

    def _check_channels(self, points: Any) -> None:
        """Refuse what lazrs unpacks wrongly: points of version 4 with several scanner channels."""
        if self.head.has_new_items and np.asarray(points["scanner_channel"]).any():
            raise damaged(
                self.path,
                "LAZ",
                "its points are packed in version 4 with several scanner channels, which is not "
                "read yet; save it as LAS, or as LAZ 1.4 by LASzip before 3.5",
            )

    def chunk_of(self, points: Any, fraction: float) -> Chunk:
        """The chunk of some points, without those that the file marks."""
        header, layout = self.head.header, self.head.header.point_format
        classes = np.asarray(points["classification"], dtype=np.uint8)
        # Gathered once: each pass over records takes longer than all that is done with them.
        raw = [np.ascontiguousarray(points[name]) for name in "XYZ"]
        is_bad = self._marked(points, raw, classes)
        xyz = np.empty((len(points), 3))
        with np.errstate(all="ignore"):  # A damaged header's scales may be anything.
            for axis, steps in enumerate(raw):
                along = steps * header.scales[axis]
                along += header.offsets[axis]
                xyz[:, axis] = along
        rgb = None
        if "red" in layout.dimension_names:
            rgb = np.empty((len(points), 3), np.uint16)
            for i, name in enumerate(("red", "green", "blue")):
                rgb[:, i] = points[name]
        chunk = Chunk(
            xyz,
            fraction,
            intensity=np.asarray(points[self.intensity], dtype=np.float32),
            rgb=rgb,
            classification=classes,
            station=np.asarray(points["point_source_id"]),
            fields=self._fields(points) if self.options.has_fields else {},
        )
        return chunk if is_bad is None else chunk.take(~is_bad)

    @property
    def intensity(self) -> str:
        """Name of the value that holds intensities."""
        layout = self.head.header.point_format
        return ORIGINAL_INTENSITY if _has_original_intensity(layout) else "intensity"

    def _marked(
        self, points: Any, xyz: list[NDArray[np.int32]], classes: NDArray[np.uint8]
    ) -> NDArray[np.bool_] | None:
        """Which points the file marks as none, and counts of why; None if no point is."""
        is_new = self.head.header.point_format.id >= 6
        is_bad: NDArray[np.bool_] | None = None
        marks = []
        if self.options.flagged_points is FlaggedPoints.LEAVE_OUT:
            flags = np.asarray(points["classification_flags" if is_new else "raw_classification"])
            is_noise = classes == _LOW_NOISE
            if is_new:
                is_noise |= classes == _HIGH_NOISE
            marks.append((WITHHELD, (flags & (_WITHHELD_NEW if is_new else _WITHHELD_OLD)) != 0))
            marks.append((NOISE, is_noise))
        marks += [
            (SATURATED, (raw == _INT32_MOST) | (raw <= -_INT32_MOST))
            for raw in xyz
            if raw.max() == _INT32_MOST or raw.min() <= -_INT32_MOST
        ]
        for reason, is_marked in marks:
            if is_marked.any():
                is_new_bad = is_marked if is_bad is None else is_marked & ~is_bad
                self.left_out[reason] += int(np.count_nonzero(is_new_bad))
                is_bad = is_marked if is_bad is None else is_bad | is_marked
        return is_bad

    def _fields(self, points: Any) -> dict[str, NDArray[Any]]:
        layout = self.head.header.point_format
        return {
            name: np.array(points.array[name] if name in points.array.dtype.names else points[name])
            for name in layout.dimension_names
            if name not in _HELD_ELSEWHERE
        }


def _field_infos(layout: "laspy.PointFormat", no_data: dict[str, float]) -> dict[str, FieldInfo]:
    """How the extra bytes are stored."""

    def first(values: Any, default: float) -> float:
        return default if values is None or not len(values) else float(values[0])

    infos = {}
    for dimension in layout.extra_dimensions:
        infos[dimension.name] = FieldInfo(
            first(dimension.scales, 1.0) or 1.0,
            first(dimension.offsets, 0.0),
            no_data.get(dimension.name),
            str(dimension.description),
        )
    return infos


def _has_original_intensity(layout: "laspy.PointFormat") -> bool:
    return any(
        d.name == ORIGINAL_INTENSITY and d.dtype == np.float32 for d in layout.extra_dimensions
    )


def _storage(head: LasHead) -> Storage | None:
    steps, offsets = np.array(head.header.scales), np.array(head.header.offsets)
    if not (np.isfinite([steps, offsets]).all() and (steps > 0).all()):
        return None
    return Storage(steps, offsets, head.projection, str(head.header.uuid))


def _table_note(path: Path) -> Note:
    return Note(
        "The table of chunks of “{name}” is damaged or missing; its points were read in order.",
        name=path.name,
    )


@dataclass(frozen=True, eq=False)
class _Nodes:
    """An open COPC file's octree, and how to read its nodes."""

    reader: _Reader
    octree: Octree

    def overview(self) -> Chunk:
        """Points of the coarsest levels, from all over the file."""
        coarsest = self.octree.coarsest(OVERVIEW_POINTS)
        return next(self._chunks(coarsest, LARGEST_PARALLEL_CHUNK))

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
        with raise_read_errors(self.reader.path, "COPC"):
            upto = np.cumsum(self.octree.n_points[nodes])
            for some in np.split(nodes, np.flatnonzero(np.diff((upto - 1) // at_once)) + 1):
                if not len(some):
                    continue
                points = self.reader.unpack(self.octree.chunk[some].tolist())
                done = float(upto[np.searchsorted(nodes, some[-1])] / upto[-1])
                self._check(some, points)
                yield self.reader.chunk_of(points, done)

    def _check(self, nodes: NDArray[np.intp], points: Any) -> None:
        """Hold the points of nodes against their cubes, or a box would miss some unnoticed."""
        n = self.octree.n_points[nodes]
        header = self.reader.head.header
        raw = np.stack([points[name] for name in "XYZ"], axis=1)
        xyz = raw * header.scales + header.offsets
        low, high = (np.repeat(c[nodes], n, axis=0) for c in (self.octree.low, self.octree.high))
        if not ((xyz >= low) & (xyz <= high)).all():
            raise damaged(self.reader.path, "COPC", "points lie outside of the octree’s nodes")
