"""Writing clouds as PLY: doubles, and every value of a point as a scalar of its own kind."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipecore.io.placing import Place
from pipecore.io.ply_file import ply_header, ply_rows
from pipecore.io.source import CHUNK_POINTS
from pipecore.io.storage import KEY, columns_of, describe
from pipecore.notes import Note
from pipecore.progress import Progress, in_chunks
from pipecore.types import PointCloud

OWN_NAMES = (
    *("x", "y", "z", "intensity", "red", "green", "blue"),
    *("scalar_classification", "scalar_station"),
)
NORMALS = {
    **{"nx": "nx", "ny": "ny", "nz": "nz"},
    **{"normal_x": "nx", "normal_y": "ny", "normal_z": "nz"},
    **{"nor:normalx": "nx", "nor:normaly": "ny", "nor:normalz": "nz"},
}
"""Names of normals, and those that other programs know; they take what begins with “scalar_”
for scalars without asking."""
LONGEST_COMMENT = 900
"""Other programs refuse lines of 1,024 characters."""
MOST_EXACT = 2**53
"""Whole numbers up to this are doubles too."""


def write_cloud(
    path: Path, cloud: PointCloud, place: Place, progress: Progress
) -> tuple[Note, ...]:
    """Write a cloud into a file.

    Parameters
    ----------
    path : Path
    cloud : PointCloud
    place : Place
        Unit and steps of the coordinates.
    progress : Progress
        Told about the stage "writing"; may cancel.

    Returns
    -------
    tuple of Note
        What PLY cannot hold.
    """
    columns = columns_of(cloud, OWN_NAMES, _name)
    own: dict[str, NDArray[Any]] = {}
    if cloud.rgb is not None:
        own |= {name: cloud.rgb[:, i] for i, name in enumerate(("red", "green", "blue"))}
    for name in ("intensity", "classification", "station"):
        if (values := getattr(cloud, name)) is not None:
            own[name if name == "intensity" else f"scalar_{name}"] = values
    own |= {column.name: column.values for column in columns}
    notes = [
        Note(
            "“{name}” holds “{field}” as doubles, which do not carry whole numbers beyond 2⁵³.",
            name=path.name,
            field=c.field,
        )
        for c in columns
        if _has_long_numbers(c.values)
    ]
    layout = np.dtype(
        [*((axis, "<f8") for axis in "xyz"), *((name, _kind(v)) for name, v in own.items())]
    )
    told = describe(cloud, columns, place.unit, place.storage)
    lines = [told[i : i + LONGEST_COMMENT] for i in range(0, len(told), LONGEST_COMMENT)]
    with path.open("wb") as file:
        comments = ["Written by PipeGUI", *(f"{KEY} {line}" for line in lines)]
        file.write(ply_header({"vertex": (len(cloud), layout)}, comments))
        for start, stop in in_chunks(len(cloud), CHUNK_POINTS, "writing", progress):
            rows = slice(start, stop)
            records = np.empty(stop - start, layout)
            for axis, values in zip("xyz", place.coordinates(cloud, rows).T, strict=True):
                records[axis] = values
            for name, values in own.items():
                records[name] = values[rows]
            file.write(ply_rows(records))
    return tuple(notes)


def _name(field: str) -> str:
    return NORMALS.get(field.casefold()) or f"scalar_{field.removeprefix('scalar_')}"


def _kind(values: NDArray[Any]) -> str:
    """The kind of a scalar: its own, where PLY has it."""
    kind = values.dtype.newbyteorder("=").str[1:]
    if kind == "b1":
        return "u1"
    if kind == "f2":
        return "<f4"
    return "<f8" if kind in ("i8", "u8") else f"<{kind}"


def _has_long_numbers(values: NDArray[Any]) -> bool:
    if values.dtype.kind not in "iu" or values.dtype.itemsize < 8 or not len(values):
        return False
    return int(values.max()) > MOST_EXACT or int(values.min()) < -MOST_EXACT
