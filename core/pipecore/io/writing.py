"""Writing clouds, with all that their files hold of each point."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from pipecore.errors import ReadError, WriteError
from pipecore.io.atomic import write_file
from pipecore.io.columns import find_columns
from pipecore.io.placing import place_of
from pipecore.io.reading import read
from pipecore.io.registry import identify
from pipecore.io.source import CHUNK_POINTS, OpenOptions
from pipecore.notes import Note
from pipecore.progress import NoProgress, Progress
from pipecore.types import PointCloud
from pipecore.units import FileUnit

WRITTEN = (".las", ".laz", ".ply", ".e57")
SAME = 1e-3
"""Points of a file read anew are the same ones if they are no further off, metres."""


def write(
    cloud: PointCloud,
    path: str | os.PathLike[str],
    *,
    progress: Progress | None = None,
) -> tuple[Note, ...]:
    """Write a cloud as LAS, LAZ, PLY or E57, whole or not at all.

    Coordinates are those of the file that the cloud came from, to the last digit; so are its
    reference system, stations and the fields that the cloud has. `read(…, has_fields=True)` and
    `with_fields` give clouds with all fields.

    Parameters
    ----------
    cloud : PointCloud
        For a part of one, `cloud.take(rows)`.
    path : path
        Ends in ``.las``, ``.laz``, ``.ply`` or ``.e57``.
    progress : Progress, optional
        Told about the stage "writing"; may cancel.

    Returns
    -------
    tuple of Note
        What the format cannot hold.

    Raises
    ------
    WriteError
        If the ending is another, or the operating system refuses.
    CancelledError
        From `progress`.

    Notes
    -----
    LAS keeps the point format, steps and offsets of a cloud from LAS; others get the coarsest
    decimal steps that hold their coordinates, from 0.1 to 10⁻⁶ m. Intensities that LAS cannot
    hold (signed, or fractions) are stretched to 0 to 65,535, and kept as they are in an extra
    value, `original_intensity`, which `read` prefers. `point_source_id` is the station. LAS
    holds no scanner positions.

    PLY holds doubles, and fields as scalars of their own kinds. E57 holds doubles, and a scan
    for each station, in its scanner's frame: points are in the order of their stations. What
    these formats have no place for (steps, names, scales) is in a comment or an extension.
    """
    ending = Path(path).suffix.lower()
    if ending not in WRITTEN:
        raise WriteError(
            "“{path}” cannot be written: clouds are written as .las, .laz, .ply or .e57.", path=path
        )
    progress = progress or NoProgress()
    place = place_of(cloud, is_fine=ending in (".las", ".laz"))
    with write_file(path) as temporary:
        if ending == ".ply":
            from pipecore.io.formats.ply_writing import write_cloud  # noqa: PLC0415

            notes = write_cloud(temporary, cloud, place, progress)
        elif ending == ".e57":
            from pipecore.io.formats.e57_writing import write_scans  # noqa: PLC0415

            notes = write_scans(temporary, cloud, place, progress)
        else:
            from pipecore.io.formats.las_writing import NO_EXTRA, write_las  # noqa: PLC0415

            is_packed = ending == ".laz"
            notes = write_las(temporary, cloud, place, NO_EXTRA, progress, is_packed=is_packed)
            if np.isfinite(cloud.stations).any():
                notes += (Note("“{name}” does not hold where the scanners stood: LAS cannot."),)
    return _of_path(notes, path)


def write_laz(
    path: str | os.PathLike[str],
    cloud: PointCloud,
    extra: Mapping[str, NDArray[Any]] | None = None,
    *,
    factors: Mapping[str, float] | None = None,
    kinds: Mapping[str, DTypeLike] | None = None,
    unit: FileUnit | None = None,
    progress: Progress | None = None,
) -> tuple[Note, ...]:
    """Write a cloud with more values of each point as LAZ, whole or not at all.

    Parameters
    ----------
    path : path
    cloud : PointCloud
        Written in the steps of its own file, if that has any; else of 0.1 mm, at 10⁷ m too.
    extra : mapping of str to ndarray, optional
        More values of each point, integer, boolean or floating, shape (n,), by a name of
        up to 32 characters. They take the place of the cloud's fields of the same names.
    factors : mapping of str to float, optional
        What some of the extra values are multiplied by when they are written.
    kinds : mapping of str to dtype, optional
        As what some of the extra values are written, where that is not what they are.
    unit : FileUnit, optional
        Unit of the coordinates written; by default that of the file the cloud came from.
    progress : Progress, optional
        Told about the stage "writing"; may cancel.

    Returns
    -------
    tuple of Note
        What LAS cannot hold: a cloud wider than 429 km is written in coarser steps.

    Raises
    ------
    WriteError
        If the operating system refuses.
    CancelledError
        From `progress`.
    """
    from pipecore.io.formats.las_writing import Extra, write_las  # noqa: PLC0415

    extra = extra or {}
    for name, values in extra.items():
        if len(values) != len(cloud) or values.ndim != 1:
            raise ValueError(f"“{name}” has shape {values.shape}, not ({len(cloud)},).")
    more = Extra(extra, factors or {}, kinds or {})
    place = place_of(cloud, unit)
    with write_file(path) as temporary:
        notes = write_las(temporary, cloud, place, more, progress or NoProgress())
    return _of_path(notes, path)


def with_fields(
    cloud: PointCloud, *, folder: Path | None = None, progress: Progress | None = None
) -> PointCloud:
    """Return a cloud with all that its files hold of each point, by reading them anew.

    Parameters
    ----------
    cloud : PointCloud
        As `read` gave it, whole.
    folder : Path, optional
        Where to keep the values as files, if they are more than memory holds.
    progress : Progress, optional
        Told about the stage "reading"; may cancel.

    Returns
    -------
    PointCloud
        The same points in the same order; `cloud` itself if it has fields.

    Raises
    ------
    ReadError
        If it was not read from files, or these are no longer there or changed.
    CancelledError
        From `progress`.
    """
    if cloud.fields:
        return cloud
    if cloud.reading is None:
        raise ReadError("The cloud was not read from a file, or is only a part of one.")
    again = read(
        cloud.reading.paths,
        **cloud.reading.arguments,
        has_fields=True,
        folder=folder,
        progress=progress,
    )
    if not _are_same(cloud, again):
        raise ReadError("“{name}” has changed since it was read.", name=cloud.reading.paths[0].name)
    return again


def may_have_fields(cloud: PointCloud) -> bool:
    """Return whether `with_fields` may find more than a cloud has.

    Parameters
    ----------
    cloud : PointCloud
    """
    if cloud.fields or cloud.reading is None:
        return False
    for path in cloud.reading.paths:
        try:
            with identify(path).open(
                path, OpenOptions(cloud.reading.arguments["columns"])
            ) as source:
                if len(find_columns(source.fields)) < len(source.fields):
                    return True
        except ReadError:
            return True
    return False


def _are_same(cloud: PointCloud, again: PointCloud) -> bool:
    if len(cloud) != len(again) or cloud.unit != again.unit:
        return False
    for start in range(0, len(cloud), CHUNK_POINTS):
        rows = slice(start, start + CHUNK_POINTS)
        off = again.xyz[rows] - cloud.xyz[rows] + (again.origin - cloud.origin)
        if not np.abs(off).max(initial=0.0) <= SAME:
            return False
    return True


def _of_path(notes: tuple[Note, ...], path: str | os.PathLike[str]) -> tuple[Note, ...]:
    """Notes with the name of the file, not of the one under which it was written."""
    name = Path(path).name
    return tuple(Note(n.template, **{**n.values, "name": name}) for n in notes)
