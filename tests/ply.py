"""PLY by hand, as its description has it: to hold our own reader and writer against."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

KINDS = {
    **{"i1": "char", "u1": "uchar", "i2": "short", "u2": "ushort", "i4": "int", "u4": "uint"},
    **{"f4": "float", "f8": "double", "i8": "int64", "u8": "uint64"},
}


def write_ply(
    path: Path,
    elements: dict[str, NDArray[Any]],
    *,
    text: bool = False,
    byte_order: str = "<",
    comments: tuple[str, ...] = (),
) -> Path:
    """Write arrays of records; a field of several values is a list."""
    name = "ascii" if text else {"<": "binary_little_endian", ">": "binary_big_endian"}[byte_order]
    lines = ["ply", f"format {name} 1.0", *(f"comment {c}" for c in comments)]
    for element, rows in elements.items():
        lines.append(f"element {element} {len(rows)}")
        for field in rows.dtype.names:
            kind = KINDS[rows.dtype[field].base.str[1:]]
            is_list = bool(rows.dtype[field].shape)
            lines.append(f"property {'list uchar ' if is_list else ''}{kind} {field}")
    body = b"".join(row_of(row, text, byte_order) for rows in elements.values() for row in rows)
    path.write_bytes("\n".join([*lines, "end_header\n"]).encode() + body)
    return path


def row_of(row: Any, text: bool, byte_order: str) -> bytes:
    values = []
    for field in row.dtype.names:
        if row.dtype[field].shape:
            values.append(np.uint8(len(row[field])))
        values += list(np.atleast_1d(row[field]))
    if text:
        return (" ".join(repr(v.item()) for v in values) + "\n").encode()
    return b"".join(np.array(v, v.dtype.newbyteorder(byte_order)).tobytes() for v in values)


def read_ply(path: Path) -> tuple[dict[str, dict[str, Any]], list[str]]:
    """Return the columns of each element of a little-endian file, and its comments."""
    head, _, body = path.read_bytes().partition(b"end_header\n")
    types = {ply: "<" + kind for kind, ply in KINDS.items()}
    elements: dict[str, list[tuple[str, ...]]] = {}
    counts, comments = {}, []
    for line in head.decode().splitlines():
        match line.split():
            case ["element", name, count]:
                elements[name], counts[name] = [], int(count)
            case ["property", *words]:
                list(elements.values())[-1].append(tuple(words))
            case ["comment", *words]:
                comments.append(" ".join(words))
    found: dict[str, dict[str, Any]] = {}
    place = 0
    for name, properties in elements.items():
        fields: list[Any] = []
        for words in properties:
            if words[0] == "list":
                n = body[place + np.dtype(fields).itemsize]  # all lists of a field are as long
                fields += [
                    (f"{words[3]} count", types[words[1]]),
                    (words[3], types[words[2]], (n,)),
                ]
            else:
                fields.append((words[1], types[words[0]]))
        rows = np.frombuffer(body, np.dtype(fields), counts[name], place)
        place += rows.nbytes
        found[name] = {field: rows[field] for field in rows.dtype.names}
    return found, comments
