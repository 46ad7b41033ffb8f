"""Tables of numbers in text: how their values are separated, and their rows block by block."""

import csv
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np

from pipecore.errors import ReadError
from pipecore.io.source import damaged
from pipecore.types import Array

BLOCK_BYTES = 2_000_000
LONGEST_LINE = 100_000

_NUMBER = re.compile(r"[-+]?(\d+\.?\d*([eE][-+]?\d+)?|\.\d+([eE][-+]?\d+)?|nan|inf(inity)?)", re.I)
_NO_NUMBER = re.compile(
    r"[-+]?(nan(\([a-z]*\))?|1\.#(qnan|snan|ind|inf)\w*|inf(inity)?)|n/?a|null|none|-+|\*+", re.I
)
"""How programs write what is no number; the first ones are those of C on Windows."""
_DECIMAL_COMMA = re.compile(r"[-+]?\d*,\d+([eE][-+]?\d+)?|[-+]?\d+([eE][-+]?\d+)?")
_COMMENT = ("#", "//", ";", "%", "!")


@dataclass(frozen=True)
class Dialect:
    """How the values of a line are separated.

    Parameters
    ----------
    delimiter : str, optional
        None for white space.
    has_decimal_commas : bool
    closes_lines : bool
        Whether a delimiter stands behind the last value too.
    """

    delimiter: str | None = None
    has_decimal_commas: bool = False
    closes_lines: bool = False

    def split(self, line: str) -> list[str]:
        """Return the values of a line of data as `float` reads them."""
        if self.is_quoted:
            values = [v.strip() for v in next(csv.reader([line.strip()]))]
        elif self.delimiter is None and '"' not in line:
            values = line.split()
        else:
            values = [v.strip().strip('"') for v in line.strip().split(self.delimiter)]
        if self.has_decimal_commas:
            values = [v.replace(",", ".") for v in values]
        return values[:-1] if self.closes_lines and values and values[-1] == "" else values

    @property
    def is_quoted(self) -> bool:
        """Whether commas separate values and decimals, which quotes tell apart."""
        return self.delimiter == "," and self.has_decimal_commas

    @property
    def is_ambiguous(self) -> bool:
        """Whether its commas may as well separate values."""
        return self.delimiter is None and self.has_decimal_commas

    def as_plain(self, lines: list[str]) -> tuple[list[str], str | None]:
        """Return lines without decimal commas, and what separates their values."""
        if self.is_quoted:
            return [";".join(row).replace(",", ".") for row in csv.reader(lines)], ";"
        if self.has_decimal_commas:
            return [line.replace(",", ".") for line in lines], self.delimiter
        return lines, self.delimiter


def sniff_dialect(line: str) -> Dialect:
    """Return how the values of a line of data are separated."""
    closes = line.rstrip(" \r\n")[-1:]
    if ";" in line:
        return Dialect(";", has_decimal_commas=True, closes_lines=closes == ";")
    if "\t" in line.strip():
        values = [v.strip().strip('"') for v in line.strip().split("\t")]
        if has_decimal_commas(values):
            return Dialect("\t", has_decimal_commas=True)
        # Tabs among spaces only line columns up.
        if "," not in line and len(values) >= 3 and ("" in values or " " in "".join(values)):
            return Dialect("\t")
    # “1,5 2,5 3,5” against “1.5, 2.5, 3.5” and “1,2,3”.
    values = [v.strip('"') for v in line.split()]
    if "," not in line or (len(values) >= 3 and all(map(_DECIMAL_COMMA.fullmatch, values))):
        return Dialect(None, has_decimal_commas="," in line)
    is_quoted = '"' in line and has_decimal_commas(next(csv.reader([line.strip()])))
    return Dialect(",", has_decimal_commas=is_quoted, closes_lines=closes == ",")


def has_decimal_commas(values: Sequence[str]) -> bool:
    """Return whether commas stand in some of these values, and only where they are decimal."""
    commas = [v for v in values if "," in v]
    return bool(commas) and all(map(_DECIMAL_COMMA.fullmatch, commas))


def is_number(value: str) -> bool:
    """Return whether a value can be read as a number."""
    return _NUMBER.fullmatch(value) is not None


def is_no_number(value: str) -> bool:
    """Return whether a value stands for a number that there is not, such as “-nan(ind)”."""
    return _NO_NUMBER.fullmatch(value) is not None


def is_comment(line: str) -> bool:
    """Return whether a line holds nothing or only a remark."""
    return not line.strip() or line.lstrip().startswith(_COMMENT)


def is_count(line: str) -> bool:
    """Return whether a line holds nothing but a number of points, as a PTS file's first does."""
    return re.fullmatch(r"\s*\d{1,18}\s*", line) is not None


def lines_of(file: BinaryIO, path: Path) -> Iterator[list[str]]:
    """Yield the lines of an open file from its position on, some at a time.

    Raises
    ------
    ReadError
        If a line has no end.
    """
    rest = b""
    while block := file.read(BLOCK_BYTES):
        if block.endswith(b"\r"):  # Perhaps half of a line's end.
            block += file.read(1)
        # Latin-1 cannot fail, and what is no number is no number in any encoding.
        lines = (rest + block).splitlines()
        rest = b"" if block.endswith((b"\n", b"\r")) else lines.pop()
        if len(rest) > LONGEST_LINE:
            raise damaged(path, "text", f"a line is over {LONGEST_LINE:,} characters long")
        yield [line.decode("latin-1") for line in lines]
    if rest:
        yield [rest.decode("latin-1")]


def parse_rows(lines: list[str], dialect: Dialect, columns: Sequence[int] | None) -> Array:
    """Return numbers in lines, float64, shape (any, n columns).

    Parameters
    ----------
    lines : list of str
    dialect : Dialect
    columns : sequence of int, optional
        Those to read; None for all, which must be as many in every line.

    Raises
    ------
    ValueError
        If something is no number.
    """
    if not any(line and not line.isspace() for line in lines[:1000]):
        raise ValueError("nothing to read")
    lines, delimiter = dialect.as_plain(lines)
    return np.loadtxt(
        lines,
        dtype=np.float64,
        comments=None,
        delimiter=delimiter,
        usecols=columns,
        quotechar='"',
        ndmin=2,
    )


@dataclass
class TextTable:
    """The rows of numbers that follow in an open file.

    Parameters
    ----------
    file : binary file
        Positioned at the first row.
    path : Path
        Its name, for errors.
    dialect : Dialect
    columns : tuple of int
        Those to read; the others may hold anything.
    n_columns : int
        Of every row.
    n_lines_before : int
        Lines above the first row, so that errors can name lines.
    n_rows : int, optional
        How many rows belong to the table; None for all.
    has_counts : bool
        Whether lines with a number of points may stand between the rows.
    """

    file: BinaryIO
    path: Path
    dialect: Dialect
    columns: tuple[int, ...]
    n_columns: int
    n_lines_before: int = 0
    n_rows: int | None = None
    has_counts: bool = False
    n_announced: int = 0
    """Points announced by the count lines between the rows met so far."""

    def blocks(self) -> Iterator[Array]:
        """Yield the rows, float64, shape (any, len(columns)); nan for what is no number.

        Raises
        ------
        ReadError
            Naming the line that is no row of numbers.
        """
        n_lines, n_left = self.n_lines_before, self.n_rows
        for lines in lines_of(self.file, self.path):
            start = 0
            while start < len(lines) and n_left != 0:
                # Empty lines are no rows: as many lines as rows may not be enough.
                stop = len(lines) if n_left is None else start + n_left
                rows = self._parse(lines[start:stop], n_lines + start)
                n_left = None if n_left is None else n_left - len(rows)
                start = stop
                yield rows
            n_lines += len(lines)
            if n_left == 0:
                return

    def _parse(self, lines: list[str], n_lines_before: int) -> Array:
        try:
            return self._numbers(lines)
        except ValueError:
            # Something is no row of numbers: find it, by halves, then one by one.
            half = len(lines) // 2
            if half > 500:
                parts = (lines[:half], n_lines_before), (lines[half:], n_lines_before + half)
                return np.concatenate([self._parse(*part) for part in parts])
            rows = []
            for i, line in enumerate(lines):
                if is_comment(line):
                    continue
                if self.has_counts and is_count(line):
                    self.n_announced += int(line)
                    continue
                rows.append(self._row(line, n_lines_before + i + 1))
            return np.array(rows, dtype=np.float64).reshape(-1, len(self.columns))

    def _row(self, line: str, number: int) -> list[float]:
        values = self.dialect.split(line)
        if len(values) == self.n_columns:
            row = [values[c] for c in self.columns]
            if all(is_number(v) or is_no_number(v) for v in row):
                return [float(v) if is_number(v) else np.nan for v in row]
        raise ReadError(
            "“{name}”: line {number} is no point with {n_columns} values: “{line}”.",
            name=self.path.name,
            number=number,
            n_columns=self.n_columns,
            line=_shortened(line),
        ) from None

    def _numbers(self, lines: list[str]) -> Array:
        # Without `usecols` numpy also holds that all rows are equally long.
        is_whole_row = len(self.columns) == self.n_columns and not self.dialect.closes_lines
        rows = parse_rows(lines, self.dialect, None if is_whole_row else self.columns)
        if rows.shape[1] != len(self.columns):
            raise ValueError("all rows are longer or shorter")
        return rows


def _shortened(line: str) -> str:
    line = "".join(c if c.isprintable() else "·" for c in line.strip())
    return line if len(line) <= 40 else line[:39] + "…"
