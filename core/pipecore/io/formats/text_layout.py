"""How a text file is laid out: what its lines above the points and its first points tell."""

import codecs
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np

from pipecore.errors import ReadError
from pipecore.io.columns import SKIPPED, find_columns, has_coordinates
from pipecore.io.table import (
    Dialect,
    is_comment,
    is_count,
    is_no_number,
    is_number,
)
from pipecore.io.text_format import TextFormat
from pipecore.types import Array

HEAD_BYTES = 65536
SAMPLE_LINES = 200


@dataclass(frozen=True)
class Layout:
    """How a text file is laid out.

    Parameters
    ----------
    dialect : Dialect
    n_columns : int
    columns : dict of str to int
        Where x, y, z, intensity, … are.
    read_columns : tuple of int
        Those that hold numbers.
    names : tuple of str
        Of all columns, or ().
    n_lines_before, n_bytes_before : int
        What stands above the first point.
    announced : int, optional
        Number of points that the file announces.
    """

    dialect: Dialect
    n_columns: int
    columns: dict[str, int]
    read_columns: tuple[int, ...]
    names: tuple[str, ...]
    n_lines_before: int
    n_bytes_before: int
    announced: int | None


def find_layout(
    file: BinaryIO, path: Path, columns: str = "", *, has_fields: bool = False
) -> Layout:
    """Find how a text file is laid out.

    Parameters
    ----------
    file : binary file
        At its beginning.
    path : Path
    columns : str
        What a person says the columns hold; "" to find it out.
    has_fields : bool
        Whether columns of numbers are read that hold nothing of the above.

    Raises
    ------
    ReadError
        If the file holds no points, or its header contradicts its points.
    """
    head = file.read(HEAD_BYTES)
    raw_lines = head.splitlines(keepends=True)
    if len(head) == HEAD_BYTES and len(raw_lines) > 1:
        raw_lines.pop()  # It may be cut.
    lines = [raw.decode("utf-8-sig", errors="replace").rstrip("\r\n") for raw in raw_lines]
    chosen = TextFormat.parse(columns)
    announced, header, first = _first_point(lines, chosen)
    if first is None:
        raise ReadError("“{name}” holds no points.", name=path.name)
    sample = [line for line in lines[first : first + SAMPLE_LINES] if not is_comment(line)]
    dialect = chosen.dialect(lines[first])
    values = dialect.split(lines[first])
    found: dict[str, int] = {}
    if chosen.columns:
        names = _chosen_names(path, chosen.columns, len(values), first)
    else:
        names, found = _columns_of(path, header, dialect, sample, values, first)
    found = found or find_columns(names)
    numeric = _numeric_columns(sample, dialect, len(values))
    wanted = set(found.values()) | (
        {i for i in numeric if names and names[i]} if has_fields else set()
    )
    return Layout(
        dialect,
        len(values),
        found,
        numeric if len(numeric) == len(values) else tuple(sorted(wanted)),
        names,
        first,
        sum(map(len, raw_lines[:first])) if first else len(_mark(head)),
        announced,
    )


def _first_point(
    lines: Sequence[str], chosen: TextFormat
) -> tuple[int | None, str | None, int | None]:
    """The count of points, the line that names columns, and the number of the first point's."""
    announced, header = None, None
    for i, line in enumerate(lines):
        if i < chosen.skip:
            continue
        if not chosen.columns and _is_header(line):
            header = line
        elif is_comment(line):
            continue
        elif announced is None and is_count(line):
            announced = int(line)
        elif chosen.columns and not _has_numbers(line, chosen):
            continue
        else:
            return announced, header, i
    return announced, header, None


def _has_numbers(line: str, chosen: TextFormat) -> bool:
    values = chosen.dialect(line).split(line)
    return sum(map(is_number, values)) >= 3


def _chosen_names(
    path: Path, chosen: tuple[str, ...], n_values: int, first: int
) -> tuple[str, ...]:
    if len(chosen) > n_values:
        raise ReadError(
            "“{name}”: {n_names} columns are named, line {line} has {n_values} values.",
            name=path.name,
            n_names=len(chosen),
            line=first + 1,
            n_values=n_values,
        )
    return tuple("" if name in SKIPPED else name for name in chosen) + ("",) * (
        n_values - len(chosen)
    )


def _columns_of(
    path: Path,
    header: str | None,
    dialect: Dialect,
    sample: Sequence[str],
    values: Sequence[str],
    first: int,
) -> tuple[tuple[str, ...], dict[str, int]]:
    """Names of the columns, and which hold what."""
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
    if names:
        return names, find_columns(names)
    found = _guess_columns(sample, dialect, len(values))
    if found is None:
        raise ReadError(
            "“{name}”: line {line} is neither a point nor a header that names x, y and z; say "
            "what its columns hold (--columns x,y,z,…).",
            name=path.name,
            line=first + 1,
        )
    return (), found


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
    """Return whether a line names columns, x, y and z among them."""
    for delimiter in (";", ",", "\t", None):
        names = _names(line, Dialect(delimiter))
        if has_coordinates(find_columns(names)):
            return True
    return False


def _numeric_columns(sample: Sequence[str], dialect: Dialect, n: int) -> tuple[int, ...]:
    """Numbers of the columns that hold nothing but numbers in a sample of lines."""
    rows = [row for row in map(dialect.split, sample) if len(row) == n]
    return tuple(
        i for i in range(n) if all(is_number(row[i]) or is_no_number(row[i]) for row in rows)
    )


def _guess_columns(sample: Sequence[str], dialect: Dialect, n: int) -> dict[str, int] | None:
    """Return what columns without names hold; None if there are no three numbers in a row.

    x y z come first, but for a point's name or number, or the row and column of a scan; then
    intensity, colours, or both. Normals are left out.
    """
    rows = [row for row in (dialect.split(line) for line in sample) if len(row) == n]
    if n < 3 or not rows:
        return None
    table = np.array([[_number(v) for v in row] for row in rows])
    numeric = _numeric_columns(sample, dialect, n)
    start = _n_leading(table, [i in numeric for i in range(n)])
    if start is None:
        return None
    columns = {"x": start, "y": start + 1, "z": start + 2}
    return columns | {role: start + 3 + i for role, i in _guess_rest(table[:, start + 3 :]).items()}


def _number(value: str) -> float:
    number = float(value) if is_number(value) else np.nan
    return number if np.isfinite(number) else np.nan


def _n_leading(table: Array, has_numbers: Sequence[bool]) -> int | None:
    """Number of columns before x: a point's name or number, or row and column of a scan."""
    if table.shape[1] >= 4 and not has_numbers[0] and all(has_numbers[1:4]):
        return 1
    if not all(has_numbers[:3]):
        return None
    is_whole: list[bool] = np.all((table % 1 == 0) & (table >= 0), axis=0).tolist()
    steps: Array = np.diff(table, axis=0)
    if table.shape[1] >= 4 and len(table) > 2 and is_whole[0] and not all(is_whole[1:4]):
        if bool(np.all(steps[:, 0] == 1)) and not any(is_whole[1:4]):
            return 1
        is_grid = is_whole[1] and np.mean(np.any(steps[:, :2] == 1, axis=1)) > 0.5
        if table.shape[1] >= 5 and is_grid and not any(is_whole[2:5]):
            return 2
    return 0


def _guess_rest(extra: Array) -> dict[str, int]:
    """Return what the columns behind x, y, z hold, by their place among them."""
    n = extra.shape[1]
    extra = extra[~np.isnan(extra).any(axis=1)]
    if not extra.size:
        return {}

    def are_colours(values: Array) -> bool:
        return bool(((values >= 0) & (values <= 255) & (values % 1 == 0)).all())

    def are_fractions(values: Array) -> bool:
        is_within = bool(((values >= 0) & (values <= 1)).all()) and bool((values % 1 != 0).any())
        return is_within and not are_normals(values)

    def are_normals(values: Array) -> bool:
        return bool((np.abs(np.linalg.norm(values, axis=1) - 1) < 0.02).mean() > 0.9)

    def is_alpha(values: Array) -> bool:
        return bool((values == 255).all() or (values == 1).all())

    def rgb(at: int) -> dict[str, int]:
        return {"red": at, "green": at + 1, "blue": at + 2}

    colours_first = are_colours(extra[:, :3]) or are_fractions(extra[:, :3])
    if n in (1, 2):
        return {"intensity": 0}
    if n > 3 and colours_first and is_alpha(extra[:, 3]):
        return rgb(0) | ({"intensity": 4} if n in (5, 8) else {})
    if n == 6 or (n > 6 and are_normals(extra[:, -3:])):
        n -= 3
    if n > 3 and are_colours(extra[:, 1:4]):
        return {"intensity": 0} | rgb(1)
    if n > 3 and are_normals(extra[:, 1:4]):
        return {"intensity": 0}
    return (rgb(0) | ({"intensity": 3} if n > 3 else {})) if colours_first else {}
