"""Meshes as PLY or OBJ, for viewers and for comparing with a model.

A PLY file holds double coordinates, the deviation of each vertex in millimetres, a colour
(blue inward, orange outward) and the number of its mesh; an OBJ file one object a mesh.
"""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pipecore.errors import WriteError
from pipecore.io import write_file
from pipecore.io.ply_file import write_ply
from pipecore.report.world import FileCoordinates

if TYPE_CHECKING:
    from pipecore.deformation import SurfaceMesh

INWARD, OUTWARD, NONE = np.array([[0, 114, 178], [213, 94, 0], [235, 235, 235]], np.float64)
FULL_COLOUR = 0.01
"""Deviation from which on the colour is full, metres, if none is larger."""


def write_meshes(
    path: str | os.PathLike[str], meshes: Sequence["SurfaceMesh"], place: FileCoordinates
) -> None:
    """Write meshes into one file, whole or not at all; its ending tells the format.

    Parameters
    ----------
    path : path
        Ends in ``.ply`` or ``.obj``.
    meshes : sequence of SurfaceMesh
    place : FileCoordinates
        Coordinates are written as in the input file.

    Raises
    ------
    WriteError
        If the ending is neither, or the file cannot be written.
    """
    ending = Path(path).suffix.lower()
    if ending not in (".ply", ".obj"):
        raise WriteError(
            "“{path}” cannot be written: meshes are written as .ply or .obj.", path=path
        )
    with write_file(path) as temporary:
        if ending == ".ply":
            _write_ply(temporary, meshes, place)
        else:
            _write_obj(temporary, meshes, place)


def _write_ply(path: Path, meshes: Sequence["SurfaceMesh"], place: FileCoordinates) -> None:
    counts = [len(m.vertices) for m in meshes]
    first = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    vertices = np.empty(
        int(first[-1]),
        [
            *((axis, "f8") for axis in "xyz"),
            ("deviation_mm", "f4"),
            *((colour, "u1") for colour in ("red", "green", "blue")),
            ("mesh", "i4"),
        ],
    )
    faces = np.empty(sum(len(m.faces) for m in meshes), [("vertex_indices", "i4", (3,))])
    done = 0
    for number, (mesh, start) in enumerate(zip(meshes, first[:-1].tolist(), strict=True), start=1):
        rows = vertices[start : start + len(mesh.vertices)]
        for axis, values in zip("xyz", place.of_local(mesh.vertices).T, strict=True):
            rows[axis] = values
        rows["deviation_mm"] = 1000 * mesh.deviation
        for colour, values in zip(("red", "green", "blue"), _colours(mesh).T, strict=True):
            rows[colour] = values
        rows["mesh"] = number
        faces["vertex_indices"][done : done + len(mesh.faces)] = mesh.faces + start
        done += len(mesh.faces)
    comments = [f"mesh {i}: {m.name}" for i, m in enumerate(meshes, start=1)]
    write_ply(
        path,
        {"vertex": vertices, "face": faces},
        ["PipeGUI", *(c.encode("ascii", "replace").decode() for c in comments)],
    )


def _colours(mesh: "SurfaceMesh") -> NDArray[np.uint8]:
    if not len(mesh.deviation):
        return np.empty((0, 3), np.uint8)
    full = max(float(np.abs(mesh.deviation).max()), FULL_COLOUR)
    share = np.abs(mesh.deviation)[:, None] / full
    towards = np.where(mesh.deviation[:, None] < 0, INWARD, OUTWARD)
    return np.asarray(np.round(NONE + share * (towards - NONE)), np.uint8)


def _write_obj(path: Path, meshes: Sequence["SurfaceMesh"], place: FileCoordinates) -> None:
    with path.open("w", encoding="utf-8", newline="\n") as file:
        file.write("# PipeGUI\n")
        done = 1
        for mesh in meshes:
            file.write(f"o {mesh.name}\n")
            digits = f"%.{place.decimals}f"
            np.savetxt(file, place.of_local(mesh.vertices), f"v {digits} {digits} {digits}")
            np.savetxt(file, mesh.faces + done, "f %d %d %d")
            done += len(mesh.vertices)
