"""PTX, Leica's text of structured scans: for each its grid, its pose, and a line a point.

A scan is: number of columns, number of rows, the scanner's position and three axes, a matrix
of four rows (points are rows, so that the last one is the translation), and columns × rows
lines “x y z intensity” or “x y z intensity r g b” in the scanner's frame. 0 0 0 stands for a
direction from which nothing came back.
"""

import re
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np

from pipecore.errors import ReadError
from pipecore.io.columns import ChunkMaker
from pipecore.io.left_out import NO_RETURN
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
from pipecore.io.table import Dialect, lines_of, parse_rows
from pipecore.notes import Note
from pipecore.types import Array

_HEADER_LINES = 10
_ROLES = {
    4: ("x", "y", "z", "intensity"),
    7: ("x", "y", "z", "intensity", "red", "green", "blue"),
}


@dataclass(frozen=True, eq=False)
class _Scan:
    """The header of one scan: points, and the matrix from its frame to the file's."""

    n_points: int
    matrix: Array


@contextmanager
def open_source(path: Path, options: OpenOptions = DEFAULT) -> Iterator[Source]:
    """Open a PTX file; see `pipecore.io.registry.Format.open`."""
    with raise_read_errors(path, "PTX"):
        file = path.open("rb")
    notes: list[Note] = []
    left_out: Counter[str] = Counter()
    with file:
        with raise_read_errors(path, "PTX"):
            n_values = _first_scan(file, path)
        scans: list[ScanInfo] = []
        yield Source(
            chunks=_chunks(file, path, scans, notes, left_out),
            fields=_ROLES[n_values],
            scans=scans,
            notes=notes,
            left_out=left_out,
        )


class _Lines:
    """The lines of a file, some at a time, with their numbers."""

    def __init__(self, file: BinaryIO, path: Path) -> None:
        self._blocks, self.path = lines_of(file, path), path
        self._lines: list[str] = []
        self._next = self.number = 0

    def some(self, n: int) -> list[str]:
        """Up to so many lines, none of them empty; [] at the end."""
        while self._next >= len(self._lines):
            block = next(self._blocks, None)
            if block is None:
                return []
            self._lines, self._next = block, 0
        found = self._lines[self._next : self._next + n]
        self._next += len(found)
        self.number += len(found)
        return [line for line in found if line and not line.isspace()] or self.some(n)

    def header(self) -> list[str]:
        """The lines of a scan's header; [] at the end of the file."""
        lines: list[str] = []
        while len(lines) < _HEADER_LINES and (line := self.some(1)):
            lines += line
        return lines


def _first_scan(file: BinaryIO, path: Path) -> int:
    """Number of values of the first point; the file is at its beginning after."""
    lines = _Lines(file, path)
    _parse_header(lines.header(), lines)
    first = lines.some(1)
    file.seek(0)
    return 7 if first and len(first[0].split()) == 7 else 4


def _parse_header(lines: list[str], source: _Lines) -> _Scan:
    first = source.number - len(lines) + 1
    widths = (1, 1, 3, 3, 3, 3, 4, 4, 4, 4)
    try:
        if len(lines) < _HEADER_LINES:
            raise ValueError("cut off")
        rows = [[float(v) for v in line.replace(",", ".").split()] for line in lines]
        if [len(row) for row in rows] != list(widths):
            raise ValueError("other numbers")
        n_points = int(rows[0][0]) * int(rows[1][0])
        matrix = np.array(rows[6:])
        is_rigid = np.isfinite(matrix).all() and abs(np.linalg.det(matrix[:3, :3])) > 1e-6
        if n_points < 0 or not is_rigid:
            raise ValueError("no pose")
    except (ValueError, OverflowError):
        raise ReadError(
            "“{name}”: line {line} does not begin a scan of PTX: its number of columns, of rows, "
            "a position, three axes and a matrix of four rows.",
            name=source.path.name,
            line=max(first, 1),
        ) from None
    return _Scan(n_points, matrix)


def _chunks(
    file: BinaryIO,
    path: Path,
    scans: list[ScanInfo],
    notes: list[Note],
    left_out: Counter[str],
) -> Iterator[Chunk]:
    with raise_read_errors(path, "PTX"):
        lines, size = _Lines(file, path), path.stat().st_size
        announced = held = 0
        while header := lines.header():
            scan = _parse_header(header, lines)
            announced += scan.n_points
            scans.append(ScanInfo(f"scan {len(scans) + 1}", scan.matrix[3, :3]))
            n_left = scan.n_points
            while n_left and (some := lines.some(min(n_left, CHUNK_POINTS))):
                n_left -= len(some)
                held += len(some)
                done, number = file.tell() / size, len(scans) - 1
                yield _chunk(_rows(some, lines), scan, number, done, left_out)
        if not held:
            raise truncated(path, announced, 0)
        if held < announced:
            notes.append(truncated_note(path, announced, held))


def _rows(lines: list[str], source: _Lines) -> Array:
    """Numbers in lines of one scan, all as many."""
    dialect = Dialect()
    try:
        rows = parse_rows(lines, dialect, None)
    except ValueError:
        n = len(lines[0].split())
        for i, line in enumerate(lines):
            values = line.split()
            if len(values) != n or not all(map(_is_value, values)):
                raise ReadError(
                    "“{name}”: line {line} is no point of PTX: x y z intensity, or with r g b.",
                    name=source.path.name,
                    line=source.number - len(lines) + i + 1,
                ) from None
        rows = np.array([[_value(v) for v in line.split()] for line in lines])
    if rows.shape[1] not in _ROLES:
        raise damaged(source.path, "PTX", f"its points have {rows.shape[1]} values, not 4 or 7")
    return rows


def _value(text: str) -> float:
    return float(text) if re.fullmatch(r"[-+\d.eE]+", text) else float("nan")


def _is_value(text: str) -> bool:
    return re.fullmatch(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?|-?nan.*|-?1\.#.*", text) is not None


def _chunk(rows: Array, scan: _Scan, number: int, fraction: float, left_out: Counter[str]) -> Chunk:
    is_return = (rows[:, :3] != 0).any(axis=1)
    left_out[NO_RETURN] += len(rows) - int(np.count_nonzero(is_return))
    rows = rows[is_return]
    rows[:, :3] = rows[:, :3] @ scan.matrix[:3, :3] + scan.matrix[3, :3]
    roles = _ROLES[rows.shape[1]]
    position = {role: i for i, role in enumerate(roles)}
    chunk = ChunkMaker(roles).chunk(lambda role: rows[:, position[role]], min(fraction, 1.0))
    return Chunk(chunk.xyz, chunk.fraction, chunk.intensity, chunk.rgb, station=number)


SIGNATURE = re.compile(
    rb"\s*\d+[ \t]*[\r\n]+\s*\d+[ \t]*[\r\n]+"  # columns and rows
    rb"(?:\s*[-+.\deE]+[ \t]+[-+.\deE]+[ \t]+[-+.\deE]+[ \t]*[\r\n]+){4}"
    rb"\s*(?:[-+.\deE]+[ \t]+){3}[-+.\deE]+[ \t]*[\r\n]+"
)
"""Matches the beginning of such a file: two counts, four lines of three numbers, one of four."""
