"""What reading a text file would give, for a person who says what its columns hold."""

import csv
import os
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from pipecore.errors import ReadError
from pipecore.io.columns import SKIPPED
from pipecore.io.formats.text import first_points
from pipecore.io.formats.text_layout import HEAD_BYTES, Layout, find_layout
from pipecore.io.registry import identify
from pipecore.io.source import Chunk
from pipecore.io.table import Dialect, is_comment
from pipecore.io.text_format import DecimalSign, Separator, TextFormat

N_LINES, N_POINTS = 50, 2000
COORDINATES, COLOURS = ("x", "y", "z"), ("red", "green", "blue")


@dataclass(frozen=True)
class PreviewLine:
    """A line of a text file.

    Parameters
    ----------
    text : str
    values : tuple of str
        As they stand in its columns.
    is_point : bool
        Whether it is read as a point.
    """

    text: str
    values: tuple[str, ...]
    is_point: bool


@dataclass(frozen=True, eq=False)
class TextPreview:
    """The beginning of a text file, and what comes of it.

    Parameters
    ----------
    lines : tuple of PreviewLine
    columns : tuple of str
        What each column is taken for, "-" for nothing.
    separator : Separator
        What separates the columns; not AUTO.
    decimal : DecimalSign
        The sign before decimals; not AUTO.
    points : Chunk, optional
        The first points, as they are read; None if nothing can be read.
    error : ReadError, optional
        Why nothing can be read.
    """

    lines: tuple[PreviewLine, ...]
    columns: tuple[str, ...]
    separator: Separator
    decimal: DecimalSign
    points: Chunk | None = None
    error: ReadError | None = None


def is_text(path: str | os.PathLike[str]) -> bool:
    """Return whether a file is read as text.

    Parameters
    ----------
    path : path

    Returns
    -------
    bool
    """
    try:
        return identify(Path(path)).module == "text"
    except ReadError:
        return False


def guessed_columns(path: str | os.PathLike[str]) -> str:
    """Return what the columns of a text file are taken for where nothing in it says so.

    Parameters
    ----------
    path : path

    Returns
    -------
    str
        Such as “x,y,z,-,intensity”; "" if a header names the columns, if there are but three,
        and for files that are no text.
    """
    path = Path(path)
    try:
        if not is_text(path):
            return ""
        with path.open("rb") as file:
            layout = find_layout(file, path)
    except (ReadError, OSError):
        return ""
    return "" if layout.names or layout.n_columns <= 3 else ",".join(_columns_of(layout))


def preview_text(path: str | os.PathLike[str], text_format: TextFormat) -> TextPreview:
    """Return the beginning of a text file, and what comes of it if it is read in a way.

    Parameters
    ----------
    path : path
    text_format : TextFormat
        How it is read; columns may still be missing.

    Returns
    -------
    TextPreview

    Raises
    ------
    ReadError
        If the file is not there or holds no text.
    """
    path = Path(path)
    lines = _first_lines(path)
    if not lines:
        raise ReadError("“{name}” holds no points.", name=path.name)
    try:
        _check(text_format.columns)
        layout, points = first_points(path, str(text_format), N_POINTS)
    except ReadError as error:
        return _unread(lines, text_format, error)
    return _preview(
        lines, layout.n_lines_before, layout.dialect, _columns_of(layout), points=points
    )


def _unread(lines: Sequence[str], text_format: TextFormat, error: ReadError) -> TextPreview:
    data = [line for line in lines[text_format.skip :] if not is_comment(line)]
    dialect = text_format.dialect(data[-1] if data else lines[-1])
    lengths = [len(_values(line, dialect.delimiter)) for line in data or lines]
    n_columns = Counter(lengths).most_common(1)[0][0]
    columns = (*text_format.columns, *("-",) * n_columns)[:n_columns]
    if n_columns < len(COORDINATES):
        error = ReadError(
            "These lines have {n} column(s), and a point needs three: choose another separator.",
            n=n_columns,
        )
    return _preview(lines, text_format.skip, dialect, columns, error=error)


def _preview(
    lines: Sequence[str],
    n_before: int,
    dialect: Dialect,
    columns: tuple[str, ...],
    points: Chunk | None = None,
    error: ReadError | None = None,
) -> TextPreview:
    shown = tuple(
        PreviewLine(line, _values(line, dialect.delimiter), i >= n_before and not is_comment(line))
        for i, line in enumerate(lines)
    )
    has_commas = any("," in value for line in shown if line.is_point for value in line.values)
    decimal = DecimalSign.COMMA if has_commas else DecimalSign.POINT
    return TextPreview(shown, columns, _separator(dialect.delimiter), decimal, points, error)


def _first_lines(path: Path) -> list[str]:
    try:
        with path.open("rb") as file:
            head = file.read(HEAD_BYTES)
    except OSError as error:
        raise ReadError("There is no file “{path}”.", path=path) from error
    if b"\0" in head:
        raise ReadError("“{name}” is no text: it has no columns to choose.", name=path.name)
    lines = [line.decode("utf-8-sig", errors="replace") for line in head.splitlines()]
    if len(head) == HEAD_BYTES and len(lines) > 1:
        lines.pop()  # It may be cut.
    return lines[:N_LINES]


def _values(line: str, delimiter: str | None) -> tuple[str, ...]:
    """The values of a line as they stand there."""
    if delimiter == "," and '"' in line:
        return tuple(value.strip() for value in next(csv.reader([line.strip()])))
    values = [value.strip().strip('"') for value in line.strip().split(delimiter)]
    return tuple(values[:-1] if len(values) > 1 and values[-1] == "" else values)


def _separator(delimiter: str | None) -> Separator:
    return next(s for s in Separator if s is not Separator.AUTO and s.delimiter == delimiter)


def _columns_of(layout: Layout) -> tuple[str, ...]:
    names = list(layout.names or ("-",) * layout.n_columns)
    for role, place in layout.columns.items():
        names[place] = role
    return tuple(name or "-" for name in names)


def _check(columns: Sequence[str]) -> None:
    """Raise a `ReadError` that says in one sentence what of the columns does not go together."""
    if not columns:
        return
    named = Counter(name for name in columns if name not in SKIPPED)
    missing = [name for name in COORDINATES if name not in named]
    if missing:
        raise ReadError("Choose the column that holds {names}.", names=", ".join(missing))
    twice = [name for name, n in named.items() if n > 1]
    if twice:
        raise ReadError("Only one column can hold {name}.", name=twice[0])
    if 0 < len(named.keys() & set(COLOURS)) < 3:
        raise ReadError("Colours need a column each for red, green and blue.")
