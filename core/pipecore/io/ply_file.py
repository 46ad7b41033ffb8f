"""Writing binary PLY: elements as arrays of records."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

_KINDS = {
    **{"i1": "char", "u1": "uchar", "i2": "short", "u2": "ushort", "i4": "int", "u4": "uint"},
    **{"f4": "float", "f8": "double"},
}


def ply_header(
    elements: Mapping[str, tuple[int, np.dtype[Any]]], comments: Sequence[str] = ()
) -> bytes:
    """Return the header of a little-endian PLY file.

    Parameters
    ----------
    elements : mapping of str to (int, dtype)
        For each element its number of rows and their fields, of kinds that PLY has; a field
        of several values is a list.
    comments : sequence of str
        One line each.
    """
    lines = ["ply", "format binary_little_endian 1.0"]
    lines += [f"comment {' '.join(comment.split())}" for comment in comments]
    for element, (n, dtype) in elements.items():
        lines.append(f"element {element} {n}")
        for name in dtype.names or ():
            field = dtype[name]
            kind = _KINDS[field.base.str[1:]]
            lines.append(f"property {f'list uchar {kind}' if field.shape else kind} {name}")
    return ("\n".join([*lines, "end_header"]) + "\n").encode("ascii", "replace")


def ply_rows(rows: NDArray[Any]) -> bytes:
    """Return rows as PLY holds them, little-endian, each list behind its count."""
    fields: list[Any] = []
    for name in rows.dtype.names or ():
        field = rows.dtype[name]
        if field.shape:
            fields.append((f"{name} count", "u1"))
        fields.append((name, field.base.newbyteorder("<"), field.shape))
    packed = np.empty(len(rows), fields)
    for name in rows.dtype.names or ():
        packed[name] = rows[name]
        if rows.dtype[name].shape:
            packed[f"{name} count"] = rows.dtype[name].shape[0]
    return packed.tobytes()


def write_ply(
    path: Path, elements: Mapping[str, NDArray[Any]], comments: Sequence[str] = ()
) -> None:
    """Write elements, each an array of records, into a PLY file."""
    with path.open("wb") as file:
        file.write(ply_header({k: (len(v), v.dtype) for k, v in elements.items()}, comments))
        for rows in elements.values():
            file.write(ply_rows(rows))
