"""PLY: ASCII and binary, either byte order.

The header is read here rather than by a library, so that points come in chunks, with
progress and cancel, and nothing is allocated on the header's word alone.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from pipecore.io.columns import ChunkMaker, find_columns, has_coordinates
from pipecore.io.records import check_room, read_records
from pipecore.io.source import Chunk, Source, damaged, told_as_read_errors, truncated
from pipecore.io.table import Dialect, Table

LONGEST_HEADER = 1_000_000

_BYTE_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_TYPES = {
    **{"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4"},
    **{"int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4"},
    **{"float": "f4", "double": "f8", "float32": "f4", "float64": "f8"},
}


@dataclass
class _Element:
    name: str
    count: int
    names: list[str]
    types: list[str]
    has_list: bool = False


@dataclass(frozen=True)
class _Header:
    byte_order: str
    before: list[_Element]
    vertex: _Element
    n_lines: int

    def dtype(self, element: _Element) -> np.dtype[Any]:
        # Numbered, since a header may repeat a name.
        return np.dtype([(f"f{i}", self.byte_order + t) for i, t in enumerate(element.types)])


@contextmanager
def open_source(path: Path) -> Iterator[Source]:
    """Open a PLY file; see `pipecore.io.registry.Format.open`."""
    with told_as_read_errors(path, "PLY"):
        file = path.open("rb")
    with file:
        with told_as_read_errors(path, "PLY"):
            header = _read_header(file, path)
            _skip_to_vertices(file, path, header)
            columns = find_columns(header.vertex.names)
            if not has_coordinates(columns):
                raise damaged(path, "PLY", "its vertices have no x, y and z")
        yield Source(
            chunks=_chunks(file, path, header, columns),
            fields=tuple(header.vertex.names),
            n_points=header.vertex.count,
        )


def _chunks(
    file: BinaryIO, path: Path, header: _Header, columns: dict[str, int]
) -> Iterator[Chunk]:
    with told_as_read_errors(path, "PLY"):
        maker = ChunkMaker(tuple(columns))
        n_points = header.vertex.count
        if header.byte_order:
            dtype = header.dtype(header.vertex)
            for records, fraction in read_records(file, path, dtype, n_points, path.stat().st_size):
                yield maker.chunk(
                    lambda role, records=records: records[f"f{columns[role]}"],  # type: ignore[misc]
                    fraction,
                )
            return
        if not n_points:
            return
        n_columns = len(header.vertex.names)
        n_lines = header.n_lines + sum(e.count for e in header.before)
        table = Table(
            file, path, Dialect(), tuple(range(n_columns)), n_columns, n_lines, n_rows=n_points
        )
        n_read = 0
        for rows in table.blocks():
            n_read += len(rows)
            yield maker.chunk(
                lambda role, rows=rows: rows[:, columns[role]],  # type: ignore[misc]
                n_read / n_points,
            )
        if n_read < n_points:
            raise truncated(path, n_points, n_read)


def _read_header(file: BinaryIO, path: Path) -> _Header:
    elements: list[_Element] = []
    byte_order: str | None = None
    n_lines = 0
    while file.tell() < LONGEST_HEADER:
        words = file.readline(LONGEST_HEADER).decode("latin-1").split()
        n_lines += 1
        match words:
            case ["end_header"]:
                break
            case ["format", name, _] if name in _BYTE_ORDERS:
                byte_order = _BYTE_ORDERS[name]
            case ["element", name, count] if count.isdecimal() and len(count) < 19:
                elements.append(_Element(name, int(count), [], []))
            case ["property", "list", _, _, name] if elements:
                elements[-1].has_list = True
                elements[-1].names.append(name)
            case ["property", kind, name] if elements and kind in _TYPES:
                elements[-1].names.append(name)
                elements[-1].types.append(_TYPES[kind])
            case ["ply"] | ["comment", *_] | ["obj_info", *_]:
                pass
            case _:
                raise damaged(path, "PLY", f"line {n_lines} of its header makes no sense")
    else:
        raise damaged(path, "PLY", "its header does not end")
    position = next((i for i, e in enumerate(elements) if e.name == "vertex"), None)
    if byte_order is None or position is None:
        missing = "format" if byte_order is None else "vertices"
        raise damaged(path, "PLY", f"its header names no {missing}")
    return _Header(byte_order, elements[:position], elements[position], n_lines)


def _skip_to_vertices(file: BinaryIO, path: Path, header: _Header) -> None:
    file_size = path.stat().st_size
    for element in (*header.before, header.vertex):
        if element.has_list and (header.byte_order or element is header.vertex):
            raise damaged(path, "PLY", f"lists in its element “{element.name}” are not understood")
        if not header.byte_order:
            # A row takes at least one character and the end of the line.
            check_room(path, file_size - file.tell() + 1, np.dtype("u2"), element.count)
        if element is header.vertex:
            return
        if header.byte_order:
            file.seek(element.count * header.dtype(element).itemsize, 1)
        else:
            for _ in range(element.count):
                file.readline()
