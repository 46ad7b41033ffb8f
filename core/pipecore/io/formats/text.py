"""Points in text: PTS, XYZ, TXT, CSV, ASC."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from pipecore.io.columns import ChunkMaker
from pipecore.io.formats.text_layout import Layout, find_layout
from pipecore.io.source import (
    DEFAULT,
    Chunk,
    OpenOptions,
    Source,
    raise_read_errors,
    truncated,
    truncated_note,
)
from pipecore.io.table import TextTable
from pipecore.notes import Note


@contextmanager
def open_source(path: Path, options: OpenOptions = DEFAULT) -> Iterator[Source]:
    """Open a text file; see `pipecore.io.registry.Format.open`."""
    with raise_read_errors(path, "text"):
        file = path.open("rb")
    notes: list[Note] = []
    with file:
        with raise_read_errors(path, "text"):
            layout = find_layout(file, path, options.columns, has_fields=options.has_fields)
            file.seek(layout.n_bytes_before)
        yield Source(
            chunks=_chunks(file, path, layout, options, notes),
            fields=tuple(filter(None, layout.names)) or tuple(layout.columns),
            notes=notes,
        )


def first_points(path: Path, columns: str, n_points: int) -> tuple[Layout, Chunk]:
    """Return how a text file is laid out, and its first points.

    Parameters
    ----------
    path : Path
    columns : str
        What the columns hold; see `InputSettings.columns`.
    n_points : int
        About so many.

    Raises
    ------
    ReadError
        If it cannot be read so.
    """
    options = OpenOptions(columns)
    with raise_read_errors(path, "text"), path.open("rb") as file:
        layout = find_layout(file, path, columns)
        file.seek(layout.n_bytes_before)
        return layout, next(_chunks(file, path, layout, options, [], n_points))


def _chunks(
    file: BinaryIO,
    path: Path,
    layout: Layout,
    options: OpenOptions,
    notes: list[Note],
    n_points: int | None = None,
) -> Iterator[Chunk]:
    with raise_read_errors(path, "text"):
        table = TextTable(
            file,
            path,
            layout.dialect,
            layout.read_columns,
            layout.n_columns,
            layout.n_lines_before,
            n_points,
            has_counts=layout.announced is not None,
        )
        position = {role: table.columns.index(column) for role, column in layout.columns.items()}
        more = _more_fields(layout, table) if options.has_fields else {}
        maker = ChunkMaker(tuple(position))
        file_size = path.stat().st_size
        n_rows = 0
        for rows in table.blocks():
            n_rows += len(rows)
            yield maker.chunk(
                lambda role, rows=rows: rows[:, position[role]],  # type: ignore[misc]
                file.tell() / file_size,
                {name: rows[:, i] for name, i in more.items()},
            )
        if layout.announced is None:
            return
        announced = layout.announced + table.n_announced
        if n_rows == 0:
            raise truncated(path, announced, 0)
        if n_rows < announced:
            notes.append(truncated_note(path, announced, n_rows))


def _more_fields(layout: Layout, table: TextTable) -> dict[str, int]:
    """Names of the columns that have no role, and their places among those read."""
    taken = set(layout.columns.values())
    return {
        name: table.columns.index(i)
        for i, name in enumerate(layout.names)
        if name and i not in taken and i in table.columns
    }
