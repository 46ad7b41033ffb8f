"""PCD, the Point Cloud Library's own format: ascii, binary and binary_compressed."""

from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from pipecore.io.columns import ChunkMaker, Values, find_columns, has_coordinates
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
from pipecore.io.table import TextTable, sniff_dialect
from pipecore.notes import Note
from pipecore.types import Array

_KINDS = {"F": "f", "I": "i", "U": "u"}
_DATA = ("ascii", "binary", "binary_compressed")
_STEP_BYTES = 64_000_000
LONGEST_HEADER = 100_000


@dataclass(frozen=True)
class _Header:
    names: tuple[str, ...]
    types: tuple[str, ...]
    counts: tuple[int, ...]
    n_points: int
    data: str
    station: Array
    n_lines: int

    @property
    def dtype(self) -> np.dtype[Any]:
        fields = enumerate(zip(self.types, self.counts, strict=True))
        return np.dtype([(f"f{i}", "<" + kind, (count,)) for i, (kind, count) in fields])


@contextmanager
def open_source(path: Path, options: OpenOptions = DEFAULT) -> Iterator[Source]:
    """Open a PCD file; see `pipecore.io.registry.Format.open`."""
    with raise_read_errors(path, "PCD"):
        file = path.open("rb")
    with file:
        with raise_read_errors(path, "PCD"):
            header = _read_header(file, path)
            columns = find_columns(
                [n if c else "" for n, c in zip(header.names, header.counts, strict=True)]
            )
            if not has_coordinates(columns):
                raise damaged(path, "PCD", "its header names no fields x, y and z")
            room = path.stat().st_size - file.tell()
            notes: list[Note] = []
            if header.data == "ascii":
                # A row takes at least one character and the end of the line.
                check_room(path, room + 1, np.dtype("u2"), header.n_points)
            elif header.data == "binary":
                header = _as_held(path, header, room // max(header.dtype.itemsize, 1), notes)
        yield Source(
            chunks=_chunks(file, path, header, columns, options),
            fields=tuple(n for n, c in zip(header.names, header.counts, strict=True) if c),
            n_points=header.n_points,
            scans=[ScanInfo(path.stem, position) for position in header.station],
            notes=notes,
        )


def _as_held(path: Path, header: _Header, n_held: int, notes: list[Note]) -> _Header:
    """The header with as many points as a file holds that ends too early."""
    if n_held >= header.n_points:
        return header
    if n_held < 1:
        raise truncated(path, header.n_points, 0)
    notes.append(truncated_note(path, header.n_points, n_held))
    return replace(header, n_points=n_held)


def _chunks(
    file: BinaryIO, path: Path, header: _Header, columns: dict[str, int], options: OpenOptions
) -> Iterator[Chunk]:
    with raise_read_errors(path, "PCD"):
        maker = ChunkMaker(tuple(columns))
        packed = next(
            (i for i, name in enumerate(header.names) if name.lower() in ("rgb", "rgba")), None
        )
        if packed is not None and header.types[packed][1:] == "4":
            maker = ChunkMaker((*columns, "red", "green", "blue"))
        else:
            packed = None

        def by_role(field: Callable[[int], Values]) -> Callable[[str], Values]:
            def column(role: str) -> Values:
                if packed is not None and role in _SHIFTS:
                    return _unpacked(field(packed), header.types[packed], _SHIFTS[role])
                return field(columns[role])

            return column

        more = _more_fields(header, columns, packed) if options.has_fields else {}

        def chunk(field: Callable[[int], Values], fraction: float) -> Chunk:
            fields = {name: field(i) for name, i in more.items()}
            return maker.chunk(by_role(field), fraction, fields)

        size = path.stat().st_size
        if not header.n_points:
            return
        if header.data == "ascii":
            yield from _text_chunks(file, path, header, chunk)
        elif header.data == "binary":
            for records, fraction in read_records(file, path, header.dtype, header.n_points, size):
                yield chunk(lambda i, r=records: r[f"f{i}"][:, 0], fraction)  # type: ignore[misc]
        else:
            plain = yield from _decompress(file, path, header, size)
            fields = _split(plain, header)
            for start in range(0, header.n_points, CHUNK_POINTS):
                rows = slice(start, start + CHUNK_POINTS)
                yield chunk(
                    lambda i, rows=rows: fields[i][rows],  # type: ignore[misc]
                    min(1.0, 0.5 + 0.5 * (start + CHUNK_POINTS) / header.n_points),
                )


def _text_chunks(
    file: BinaryIO,
    path: Path,
    header: _Header,
    chunk: Callable[[Callable[[int], Values], float], Chunk],
) -> Iterator[Chunk]:
    start = file.tell()
    first_line = file.readline(LONGEST_HEADER).decode("latin-1")
    file.seek(start)
    ends = np.cumsum(header.counts)
    # Text carries more than a field's declared size: coordinates are taken as they stand.
    table = TextTable(
        file,
        path,
        sniff_dialect(first_line),
        tuple(range(int(ends[-1]))),
        int(ends[-1]),
        header.n_lines,
        n_rows=header.n_points,
    )
    first = ends - header.counts
    n_read = 0
    for rows in table.blocks():
        n_read += len(rows)
        yield chunk(
            lambda i, rows=rows: rows[:, first[i]],  # type: ignore[misc]
            n_read / header.n_points,
        )
    if n_read < header.n_points:
        raise truncated(path, header.n_points, n_read)


def _more_fields(header: _Header, columns: dict[str, int], packed: int | None) -> dict[str, int]:
    """Names and places of the values that have no role, but for padding."""
    taken = {*columns.values(), packed}
    return {
        name: i
        for i, (name, count) in enumerate(zip(header.names, header.counts, strict=True))
        if i not in taken and count and name != "_"
    }


_SHIFTS = {"red": 16, "green": 8, "blue": 0}


def _unpacked(packed: Values, kind: str, shift: int) -> NDArray[np.uint8]:
    """Return one colour of three that are packed into the bits of one value."""
    if kind == "f4":
        bits = np.ascontiguousarray(packed.astype(np.float32)).view(np.uint32)
    else:
        bits = packed.astype(np.int64).astype(np.uint32)
    return ((bits >> np.uint32(shift)) & np.uint32(255)).astype(np.uint8)


def _decompress(
    file: BinaryIO, path: Path, header: _Header, size: int
) -> Generator[Chunk, None, NDArray[np.uint8]]:
    """Return the bytes of all fields; until then yield chunks without points."""
    from pipecore.io.formats import lzf  # noqa: PLC0415  (it brings numba)

    n_packed, n_plain = np.frombuffer(file.read(8), dtype="<u4").tolist()
    if n_packed > size - file.tell():
        raise damaged(path, "PCD", "it is truncated")
    if n_plain > n_packed * lzf.BEST_RATIO:
        raise damaged(path, "PCD", "it announces more than it can hold")
    check_room(path, n_plain, header.dtype, header.n_points)
    if n_plain != header.n_points * header.dtype.itemsize:
        raise damaged(path, "PCD", "its header contradicts the size of its points")
    packed = np.frombuffer(file.read(n_packed), dtype=np.uint8)
    plain = np.empty(n_plain, dtype=np.uint8)
    read = written = 0
    while written < n_plain:
        yield Chunk(np.empty((0, 3)), 0.5 * written / n_plain)
        stop = min(written + _STEP_BYTES, n_plain)
        read, written = lzf.decompress(packed, plain, read, written, stop)
        if read < 0 or written < stop:
            raise damaged(path, "PCD", "its compressed points cannot be unpacked")
    return plain


def _split(plain: NDArray[np.uint8], header: _Header) -> list[Values]:
    """Return the fields, each of which a compressed file holds in one piece."""
    fields: list[Values] = []
    offset = 0
    for kind, count in zip(header.types, header.counts, strict=True):
        end = offset + int(kind[1:]) * count * header.n_points
        values = plain[offset:end].view("<" + kind)
        fields.append(values.reshape(header.n_points, count)[:, 0] if count else values)
        offset = end
    return fields


def _read_header(file: BinaryIO, path: Path) -> _Header:
    entries: dict[str, list[str]] = {}
    n_lines = 0
    while "DATA" not in entries:
        line = file.readline(LONGEST_HEADER).decode("latin-1")
        n_lines += 1
        if not line or file.tell() > LONGEST_HEADER:
            raise damaged(path, "PCD", "its header does not end with a line DATA")
        if line.startswith("#") or not line.split():
            continue
        key, *values = line.split()
        if not key.isalpha() or not key.isupper():
            raise damaged(path, "PCD", f"line {n_lines} of its header makes no sense")
        entries[key] = values
    names = entries.get("FIELDS", [])
    sizes, kinds = entries.get("SIZE", []), entries.get("TYPE", [])
    counts = entries.get("COUNT", ["1"] * len(names))
    if not names or not len(names) == len(sizes) == len(kinds) == len(counts):
        raise damaged(path, "PCD", "FIELDS, SIZE, TYPE and COUNT of its header do not match")
    types = tuple(_KINDS.get(k, "?") + s for k, s in zip(kinds, sizes, strict=True))
    if not all(t in ("f4", "f8", *(k + s for k in "iu" for s in "1248")) for t in types):
        raise damaged(path, "PCD", "a SIZE or TYPE of its header does not exist")
    whole = [*counts, *entries.get("POINTS", []), *entries.get("WIDTH", [])]
    whole += entries.get("HEIGHT", [])
    if not all(number.isdecimal() and len(number) < 19 for number in whole):
        raise damaged(path, "PCD", "a number of its header is no whole number")
    if max(map(int, counts)) > 1_000_000:
        raise damaged(path, "PCD", "a COUNT of its header is absurd")
    n_points = int(
        entries["POINTS"][0]
        if entries.get("POINTS")
        else str(int(entries["WIDTH"][0]) * int(entries["HEIGHT"][0]))
    )
    data = entries["DATA"][0] if entries["DATA"] else ""
    if data not in _DATA:
        raise damaged(path, "PCD", f"DATA of its header is none of {', '.join(_DATA)}")
    view = np.array(entries.get("VIEWPOINT", [])[:3], dtype=np.float64)
    # All zero is what writers put that do not know the scanner's place.
    station = view.reshape(1, 3) if view.size == 3 and view.any() else np.empty((0, 3))
    return _Header(tuple(names), types, tuple(map(int, counts)), n_points, data, station, n_lines)
