"""PLY: ASCII and binary, either byte order, with lists.

The header is read here rather than by a library, so that points come in chunks, with
progress and cancel, and nothing is allocated on the header's word alone.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from pipecore.io.columns import ChunkMaker, find_columns, has_coordinates
from pipecore.io.formats.unread import mesh_error
from pipecore.io.records import check_room, read_records
from pipecore.io.source import (
    CHUNK_POINTS,
    DEFAULT,
    Chunk,
    OpenOptions,
    ScanInfo,
    Source,
    damaged,
    raise_read_errors,
    truncated,
    truncated_note,
)
from pipecore.io.storage import KEY, Extras, parse_extras
from pipecore.io.table import Dialect, TextTable
from pipecore.notes import Note

LONGEST_HEADER = 1_000_000

MESH_FACES = 0.5
"""A file with more faces than this a vertex is a mesh, not a scan."""

_BYTE_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_TYPES = {
    **{"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4"},
    **{"int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4"},
    **{"float": "f4", "double": "f8", "float32": "f4", "float64": "f8"},
    **{"int64": "i8", "uint64": "u8", "long": "i8", "ulong": "u8", "bool": "u1", "half": "f2"},
    **{"float16": "f2", "byte": "i1", "ubyte": "u1", "longlong": "i8", "ulonglong": "u8"},
}


@dataclass(frozen=True)
class _Property:
    name: str
    kind: str
    count_kind: str = ""
    """Of a list's count; "" for a plain value."""


@dataclass
class _Element:
    name: str
    count: int
    properties: list[_Property] = field(default_factory=list)

    @property
    def has_list(self) -> bool:
        return any(p.count_kind for p in self.properties)

    @property
    def names(self) -> list[str]:
        return [p.name for p in self.properties]


@dataclass(frozen=True)
class _Header:
    byte_order: str
    before: list[_Element]
    vertex: _Element
    n_faces: int
    n_lines: int
    size: int
    """Bytes."""
    extras: Extras | None
    """What this program has written besides the points."""

    def dtype(self, element: _Element) -> np.dtype[Any]:
        # Numbered, since a header may repeat a name.
        kinds = enumerate(p.kind for p in element.properties)
        return np.dtype([(f"f{i}", self.byte_order + kind) for i, kind in kinds])


@contextmanager
def open_source(path: Path, options: OpenOptions = DEFAULT) -> Iterator[Source]:
    """Open a PLY file; see `pipecore.io.registry.Format.open`."""
    with raise_read_errors(path, "PLY"):
        file = path.open("rb")
    notes: list[Note] = []
    with file:
        with raise_read_errors(path, "PLY"):
            header = _read_header(file, path)
            columns = _columns(header)
            if not has_coordinates(columns):
                raise damaged(path, "PLY", "its vertices have no x, y and z")
            _check_faces(header, path, notes)
            _skip_to_vertices(file, path, header)
        yield Source(
            chunks=_chunks(file, path, header, columns, options, notes),
            fields=tuple(header.vertex.names),
            n_points=header.vertex.count,
            notes=notes,
            **_told(header.extras),
        )


def _columns(header: _Header) -> dict[str, int]:
    """Places of the properties that have a role."""
    properties = header.vertex.properties
    found = find_columns(header.vertex.names)
    if header.extras is not None:
        fields = header.extras.fields
        found = {
            p.name.removeprefix("scalar_"): i
            for i, p in enumerate(properties)
            if p.name not in fields and p.name.removeprefix("scalar_") in found
        }
    return {role: i for role, i in found.items() if not properties[i].count_kind}


def _told(extras: Extras | None) -> dict[str, Any]:
    """What is known of a file that this program has written."""
    if extras is None:
        return {}
    factors = np.ones(3)
    if extras.system.plan is not None and extras.system.height is not None:
        factors = np.array([extras.system.plan[1]] * 2 + [extras.system.height[1]])
    return {
        "system": extras.system,
        "storage": extras.storage,
        "scans": [ScanInfo(s.name, s.position / factors) for s in extras.scans],
        "field_infos": extras.infos(),
    }


def _check_faces(header: _Header, path: Path, notes: list[Note]) -> None:
    """Refuse a mesh; note that faces are not read."""
    if not header.n_faces:
        return
    if header.n_faces > MESH_FACES * header.vertex.count:
        raise mesh_error(path)
    notes.append(
        Note(
            "“{name}” holds {n:,} faces besides its points; only the points are read.",
            name=path.name,
            n=header.n_faces,
        )
    )


def _chunks(
    file: BinaryIO,
    path: Path,
    header: _Header,
    columns: dict[str, int],
    options: OpenOptions,
    notes: list[Note],
) -> Iterator[Chunk]:
    with raise_read_errors(path, "PLY"):
        maker = ChunkMaker(tuple(columns))
        extras = header.extras
        more = _more_fields(header, columns) if options.has_fields else {}
        for values, fraction in _values(file, path, header, notes):
            fields = {name: values(i) for name, i in more.items()}
            chunk = maker.chunk(
                lambda role, values=values: values(columns[role]),  # type: ignore[misc]
                fraction,
                fields if extras is None else extras.joined(fields),
            )
            if extras is not None and extras.scans and chunk.station is not None:
                chunk = replace(chunk, station=chunk.station - 1)
            yield chunk


def _more_fields(header: _Header, columns: dict[str, int]) -> dict[str, int]:
    """Names and places of the values that have no role."""
    taken = set(columns.values())
    return {
        p.name: i
        for i, p in enumerate(header.vertex.properties)
        if i not in taken and not p.count_kind
    }


def _values(file: BinaryIO, path: Path, header: _Header, notes: list[Note]) -> Iterator[Any]:
    """Yield a function from a property's place to its values in a chunk, and the part read."""
    vertex = header.vertex
    if not vertex.count:
        return
    if not header.byte_order:
        yield from _text_values(file, path, header)
        return
    if vertex.has_list:
        yield from _list_values(file, path, header)
        return
    dtype = header.dtype(vertex)
    n_held = (path.stat().st_size - file.tell()) // dtype.itemsize
    if n_held < vertex.count:
        if n_held < 1:
            raise truncated(path, vertex.count, 0)
        notes.append(truncated_note(path, vertex.count, n_held))
    n = min(n_held, vertex.count)
    for records, fraction in read_records(file, path, dtype, n, path.stat().st_size):
        yield lambda i, records=records: records[f"f{i}"], fraction


def _text_values(file: BinaryIO, path: Path, header: _Header) -> Iterator[Any]:
    vertex = header.vertex
    if vertex.has_list:
        yield from _text_with_lists(file, path, header)
        return
    n_columns = len(vertex.names)
    n_lines = header.n_lines + sum(e.count for e in header.before)
    table = TextTable(
        file, path, Dialect(), tuple(range(n_columns)), n_columns, n_lines, n_rows=vertex.count
    )
    n_read = 0
    for rows in table.blocks():
        n_read += len(rows)
        yield lambda i, rows=rows: rows[:, i], n_read / vertex.count
    if n_read < vertex.count:
        raise truncated(path, vertex.count, n_read)


def _text_with_lists(file: BinaryIO, path: Path, header: _Header) -> Iterator[Any]:
    """Rows of text with lists among their values, which are passed over."""
    n_read, n = 0, header.vertex.count
    lists = [bool(p.count_kind) for p in header.vertex.properties]
    while n_read < n:
        lines = [file.readline() for _ in range(min(CHUNK_POINTS, n - n_read))]
        values = [_without_lists(line.split(), lists) for line in lines]
        n_whole = next((i for i, v in enumerate(values) if v is None), len(values))
        if n_whole < len(values):
            raise truncated(path, n, n_read + n_whole)
        rows = np.array(values, dtype=np.float64)
        n_read += len(rows)
        yield lambda i, rows=rows: rows[:, i], n_read / n


def _without_lists(words: list[bytes], lists: list[bool]) -> list[bytes] | None:
    """The plain values of a line, 0 for each list; None if it is too short."""
    place, plain = 0, []
    for is_list in lists:
        if place >= len(words):
            return None
        plain.append(b"0" if is_list else words[place])
        place += 1 + (int(words[place]) if is_list and words[place].isdigit() else 0)
    return plain if place <= len(words) else None


def _list_values(file: BinaryIO, path: Path, header: _Header) -> Iterator[Any]:
    """Rows of unequal length: where each begins is found first."""
    data: NDArray[np.uint8] = np.memmap(path, np.uint8, "r")
    vertex, place, n_read = header.vertex, file.tell(), 0
    while n_read < vertex.count:
        n = min(CHUNK_POINTS, vertex.count - n_read)
        check_room(path, len(data) - place, np.dtype("u1"), n)
        offsets = np.empty((n, len(vertex.properties)), np.int64)
        place = _walk(data, place, n, vertex, header.byte_order, offsets)
        if place < 0:
            raise truncated(path, vertex.count, n_read)
        n_read += n

        def values(i: int, offsets: NDArray[np.int64] = offsets) -> NDArray[Any]:
            kind = np.dtype(header.byte_order + vertex.properties[i].kind)
            rows = offsets[:, i, None] + np.arange(kind.itemsize)
            return np.asarray(data[rows].view(kind)[:, 0])

        yield values, n_read / vertex.count


def _walk(
    data: NDArray[np.uint8],
    place: int,
    n: int,
    element: _Element,
    byte_order: str,
    offsets: NDArray[np.int64],
) -> int:
    from pipecore.io.formats.ply_rows import find_rows  # noqa: PLC0415  (it brings numba)

    def sizes(kinds: list[str]) -> NDArray[np.int64]:
        return np.array([np.dtype(k).itemsize if k else 0 for k in kinds], np.int64)

    lists = [bool(p.count_kind) for p in element.properties]
    items = sizes([p.kind for p in element.properties])
    counts = sizes([p.count_kind for p in element.properties])
    fixed = np.where(lists, 0, items)
    return int(find_rows(data, place, n, fixed, counts, items, byte_order == ">", offsets))


def _read_header(file: BinaryIO, path: Path) -> _Header:
    head = file.read(LONGEST_HEADER)
    # Old Macs end lines by CR alone, where the first byte of the points may be anything.
    mark = (
        b"\r" if head[:80].split(b"\r")[0].strip() == b"ply" and b"\r\n" not in head[:80] else b"\n"
    )
    elements: list[_Element] = []
    byte_order: str | None = None
    n_lines = place = 0
    told: list[str] = []
    while (end := head.find(mark, place)) >= 0 or place < len(head):
        end = len(head) if end < 0 else end
        line = head[place:end].decode("latin-1")
        words = line.split()
        place, n_lines = end + 1, n_lines + 1
        match words:
            case ["end_header"]:
                break
            case ["format", name, *_] if name in _BYTE_ORDERS:
                byte_order = _BYTE_ORDERS[name]
            case ["element", name, count] if count.isdecimal() and len(count) < 19:
                elements.append(_Element(name, int(count)))
            case ["property", "list", count, kind, name] if (
                elements and count in _TYPES and kind in _TYPES and _TYPES[count][0] in "iu"
            ):
                elements[-1].properties.append(_Property(name, _TYPES[kind], _TYPES[count]))
            case ["property", kind, *names] if elements and kind in _TYPES and names:
                elements[-1].properties.append(_Property(" ".join(names), _TYPES[kind]))
            case ["comment", word, *_] if word == KEY:
                told.append(line.rstrip("\r")[len(f"comment {KEY} ") :])
            case [] | ["ply"] | ["comment", *_] | ["obj_info", *_]:
                pass
            case _:
                raise damaged(path, "PLY", f"line {n_lines} of its header makes no sense")
    else:
        raise damaged(path, "PLY", "its header does not end")
    position = next((i for i, e in enumerate(elements) if e.name in ("vertex", "point")), None)
    if byte_order is None or position is None:
        missing = "format" if byte_order is None else "vertices"
        raise damaged(path, "PLY", f"its header names no {missing}")
    n_faces = sum(e.count for e in elements if e.name in ("face", "tristrips"))
    file.seek(place)
    extras = parse_extras("".join(told)) if told else None
    return _Header(
        byte_order, elements[:position], elements[position], n_faces, n_lines, place, extras
    )


def _skip_to_vertices(file: BinaryIO, path: Path, header: _Header) -> None:
    file_size = path.stat().st_size
    for element in header.before:
        if not header.byte_order:
            # A row takes at least one character and the end of the line.
            check_room(path, file_size - file.tell() + 1, np.dtype("u2"), element.count)
            for _ in range(element.count):
                file.readline()
        elif not element.has_list:
            file.seek(element.count * header.dtype(element).itemsize, 1)
        else:
            check_room(path, file_size - file.tell(), np.dtype("u1"), element.count)
            data: NDArray[np.uint8] = np.memmap(path, np.uint8, "r")
            nowhere = np.empty((0, len(element.properties)), np.int64)
            place = _walk(data, file.tell(), element.count, element, header.byte_order, nowhere)
            if place < 0:
                raise truncated(path, header.vertex.count, 0)
            file.seek(place)
    if not header.byte_order:
        check_room(path, file_size - file.tell() + 1, np.dtype("u2"), header.vertex.count)
