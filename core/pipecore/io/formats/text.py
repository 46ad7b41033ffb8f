"""Points in text: PTS, XYZ, TXT, CSV, ASC."""

import codecs
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np

from pipecore.errors import ReadError
from pipecore.io.columns import ChunkMaker, find_columns, has_coordinates
from pipecore.io.source import Chunk, Source, told_as_read_errors, truncated
from pipecore.io.table import Dialect, Table, is_comment, is_count, is_number, sniff_dialect
from pipecore.types import Array

HEAD_BYTES = 65536
SAMPLE_LINES = 200


@dataclass(frozen=True)
class _Layout:
    """What the lines above the first point and the first points tell about the file."""

    dialect: Dialect
    n_columns: int
    columns: dict[str, int]
    read_columns: tuple[int, ...]
    names: tuple[str, ...]
    n_lines_before: int
    n_bytes_before: int
    announced: int | None


@contextmanager
def open_source(path: Path) -> Iterator[Source]:
    """Open a text file; see `pipecore.io.registry.Format.open`."""
    with told_as_read_errors(path, "text"):
        file = path.open("rb")
    with file:
        with told_as_read_errors(path, "text"):
            layout = _find_layout(file, path)
            file.seek(layout.n_bytes_before)
        yield Source(
            chunks=_chunks(file, path, layout),
            fields=layout.names or tuple(layout.columns),
        )


def _chunks(file: BinaryIO, path: Path, layout: _Layout) -> Iterator[Chunk]:
    with told_as_read_errors(path, "text"):
        table = Table(
            file,
            path,
            layout.dialect,
            layout.read_columns,
            layout.n_columns,
            layout.n_lines_before,
            has_counts=layout.announced is not None,
        )
        position = {role: table.columns.index(column) for role, column in layout.columns.items()}
        maker = ChunkMaker(tuple(position))
        file_size = path.stat().st_size
        n_rows = 0
        for rows in table.blocks():
            n_rows += len(rows)
            yield maker.chunk(
                lambda role, rows=rows: rows[:, position[role]],  # type: ignore[misc]
                file.tell() / file_size,
            )
        if layout.announced is not None and n_rows < layout.announced + table.n_announced:
            raise truncated(path, layout.announced + table.n_announced, n_rows)


def _find_layout(file: BinaryIO, path: Path) -> _Layout:
    head = file.read(HEAD_BYTES)
    raw_lines = head.splitlines(keepends=True)
    if len(head) == HEAD_BYTES and len(raw_lines) > 1:
        raw_lines.pop()  # It may be cut.
    lines = [raw.decode("utf-8-sig", errors="replace").rstrip("\r\n") for raw in raw_lines]

    announced, header, first = None, None, None
    for i, line in enumerate(lines):
        if _is_header(line):
            header = line
        elif is_comment(line):
            continue
        elif announced is None and header is None and is_count(line):
            announced = int(line)
        else:
            first = i
            break
    if first is None:
        raise ReadError("“{name}” holds no points.", name=path.name)

    sample = [line for line in lines[first : first + SAMPLE_LINES] if not is_comment(line)]
    dialect = sniff_dialect(lines[first])
    values = dialect.split(lines[first])
    names = _names(header, dialect) if header is not None else ()
    if header is not None and is_comment(header) and len(names) != len(values):
        header, names = None, ()  # A remark that speaks of x, y and z.
    if header is not None and len(names) != len(values):
        raise ReadError(
            "“{name}”: the header names {n_names} columns, line {line} has {n_values} values.",
            name=path.name,
            n_names=len(names),
            line=first + 1,
            n_values=len(values),
        )
    if header is None and (len(values) < 3 or not all(map(is_number, values[:3]))):
        raise ReadError(
            "“{name}”: line {line} is neither a point nor a header that names x, y and z.",
            name=path.name,
            line=first + 1,
        )
    columns = find_columns(names) if names else _guess_columns(sample, dialect, len(values))
    return _Layout(
        dialect,
        len(values),
        columns,
        tuple(range(len(values)))
        if all(map(is_number, values))
        else tuple(sorted(columns.values())),
        names,
        first,
        sum(map(len, raw_lines[:first])) if first else len(_mark(head)),
        announced,
    )


def _mark(head: bytes) -> bytes:
    """Return the mark by which some editors begin UTF-8 text."""
    return codecs.BOM_UTF8 if head.startswith(codecs.BOM_UTF8) else b""


def _names(header: str, dialect: Dialect) -> tuple[str, ...]:
    header = header.strip().lstrip("#/").strip()
    if dialect.delimiter is None:
        # A blank-separated table may well have its names separated by commas.
        return tuple(header.replace(",", " ").replace(";", " ").split())
    delimiter = dialect.delimiter if dialect.delimiter in header else None
    return tuple(name.strip().strip('"') for name in header.split(delimiter))


def _is_header(line: str) -> bool:
    """Tell whether a line names columns, x, y and z among them."""
    for delimiter in (";", ",", None):
        names = _names(line, Dialect(delimiter))
        if has_coordinates(find_columns(names)):
            return True
    return False


def _guess_columns(sample: list[str], dialect: Dialect, n_columns: int) -> dict[str, int]:
    """Return what columns without names hold: x y z, then intensity, colours or both."""
    columns = {"x": 0, "y": 1, "z": 2}
    rows = [dialect.split(line)[3:] for line in sample]
    numbers = [[float(v) for v in row] for row in rows if all(map(is_number, row))]
    extra = np.array([row for row in numbers if len(row) == n_columns - 3], dtype=np.float64)
    if n_columns == 3 or not extra.size:
        return columns

    def are_colours(values: Array) -> bool:
        return bool(((values >= 0) & (values <= 255) & (values % 1 == 0)).all())

    def with_rgb(at: int) -> dict[str, int]:
        return {"red": at, "green": at + 1, "blue": at + 2}

    n_extra = n_columns - 3
    if n_extra in (1, 2):
        return columns | {"intensity": 3}
    if n_extra == 3:
        return columns | with_rgb(3) if are_colours(extra) else columns
    if are_colours(extra[:, 1:4]):
        return columns | {"intensity": 3} | with_rgb(4)
    if are_colours(extra[:, :3]):
        return columns | with_rgb(3) | {"intensity": 6}
    return columns
