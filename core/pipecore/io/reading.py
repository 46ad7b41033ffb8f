"""From the chunks of one or several files to one cloud in one local frame."""

import os
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from pipecore.errors import ReadError
from pipecore.io.ahead import read_ahead
from pipecore.io.coordinates import unit_of
from pipecore.io.crs import ReferenceSystem
from pipecore.io.growing import GrowingCloud
from pipecore.io.registry import Format, identify
from pipecore.io.source import Chunk, OpenOptions, Source
from pipecore.notes import Note
from pipecore.progress import NoProgress, Progress
from pipecore.settings import FlaggedPoints, LengthUnit, StationSource
from pipecore.types import Array, PointCloud, Reading
from pipecore.units import FileUnit

LOOK_POINTS = 10_000
"""About so many points of a chunk are shown before all are read."""

Corners = Sequence[Sequence[float]] | Array
"""Two opposite corners of a box."""

Paths = str | os.PathLike[str] | Sequence[str | os.PathLike[str]]


def read(
    paths: Paths,
    *,
    length_unit: LengthUnit = LengthUnit.AUTO,
    flagged_points: FlaggedPoints = FlaggedPoints.LEAVE_OUT,
    stations: StationSource = StationSource.AUTO,
    columns: str = "",
    has_fields: bool = False,
    box: Corners | None = None,
    folder: Path | None = None,
    progress: Progress | None = None,
    look: Callable[[PointCloud], None] | None = None,
) -> PointCloud:
    """Read one point cloud from one or several files.

    Several files are merged in one local frame; what only some of them have (colour,
    intensity, class) is zero for the others. Points whose coordinates are not finite or
    absurd, stray points, and those that the file marks invalid are left out; the cloud's
    notes count them.

    Parameters
    ----------
    paths : path or sequence of paths
        In any format of `pipecore.io.formats`; recognised by contents, not by ending.
    length_unit : LengthUnit
        Unit of the coordinates in the files; AUTO takes what their reference system names,
        else metres. Local coordinates are metres whatever it is, and `cloud.world(local)`
        gives *metres* in the files' coordinate system: divide by `cloud.unit.factors` to get
        the files' own numbers.
    flagged_points : FlaggedPoints
        Whether points are kept that a file marks as withheld or classes as noise.
    stations : StationSource
        What tells from which station a point was scanned.
    columns : str
        What the columns of text files hold, such as “x,y,z,-,intensity”; "" to find it out.
    has_fields : bool
        Whether `cloud.fields` holds all other values that the files have of each point, and
        coordinates keep all their digits, as float64: what is written again is unchanged.
    box : (2, 3) numbers, optional
        Two opposite corners, in the files' coordinates: only points between them, both
        included. Of COPC only the nodes that touch the box are read.
    folder : Path, optional
        Where to keep the points if they are more than memory holds: the cloud's arrays are
        then files in this folder, mapped into memory.
    progress : Progress, optional
        Told about the stage "reading"; may cancel.
    look : callable, optional
        Given a few points of every chunk as soon as it is read, evenly spread over it, as
        a cloud with the origin of the whole: for showing what comes. Of COPC first some from
        all over the file.

    Returns
    -------
    PointCloud
        Its origin is a whole multiple of 100 m near the middle of the points; `xyz` is
        float32 if all points lie within 1,024 m of it, else float64.

    Raises
    ------
    ReadError
        If a file cannot be read as a point cloud, with the file's name and the cause, if files
        are in different reference systems, or if no point lies in the box.
    CancelledError
        From `progress`.
    """
    corners = None if box is None else corners_of(box)
    files = _as_paths(paths)
    progress = progress or NoProgress()
    progress.update("reading", 0.0)
    recognised = [identify(path) for path in files]
    options = OpenOptions(columns, flagged_points, has_fields)
    unit, system, notes = common_unit(files, recognised, options, length_unit)
    sizes = np.array([path.stat().st_size for path in files], dtype=np.float64)
    starts = np.concatenate([[0.0], np.cumsum(sizes)]) / sizes.sum()
    cloud = GrowingCloud(unit, system, stations, folder, corners, is_exact=has_fields)
    done = 0.0

    def check() -> None:
        progress.update("reading", min(done, 1.0))

    with read_ahead(
        list(zip(files, recognised, strict=True)),
        options,
        lambda source: chunks_of(source, corners),
        check,
        has_overview=look is not None,
    ) as opened:
        for i, file in enumerate(opened):
            before = cloud.n_points
            cloud.begin_file(file.path, file.source, int(sizes[i]))
            for chunk in file.chunks:
                start = cloud.n_points
                cloud.add(chunk)
                if look is not None and cloud.n_points > start:
                    if start == before and file.overview is not None:
                        look(cloud.of_chunk(file.overview))
                    look(cloud.part(start, LOOK_POINTS))
                done = float(starts[i] + chunk.fraction * (starts[i + 1] - starts[i]))
                check()
            cloud.end_file()
            if cloud.n_points == before and corners is None:
                raise no_points(file.path, file.source.left_out)
    if cloud.n_points == 0:
        raise ReadError(
            "No point of “{name}” lies in the box that was asked for.", name=files[0].name
        )
    progress.update("reading", 1.0)
    how = reading_of(files, length_unit, flagged_points, stations, columns, corners)
    return replace(cloud.finish(files[0], notes), reading=how)


def reading_of(
    paths: Sequence[Path],
    length_unit: LengthUnit,
    flagged_points: FlaggedPoints,
    stations: StationSource,
    columns: str,
    box: Array | None,
) -> Reading:
    """Return what it takes to read files again; parameters are those of `read`."""
    arguments = {
        "length_unit": length_unit,
        "flagged_points": flagged_points,
        "stations": stations,
        "columns": columns,
        "box": box,
    }
    return Reading(tuple(paths), arguments)


def no_points(path: Path, left_out: Counter[str]) -> ReadError:
    """Return the error of a file without points to keep."""
    if n := left_out.total():
        return ReadError(
            "“{name}” holds no valid points: all {n:,} are marked or no measurements.",
            name=path.name,
            n=n,
        )
    return ReadError("“{name}” holds no valid points.", name=path.name)


def common_unit(
    files: Sequence[Path],
    recognised: Sequence[Format],
    options: OpenOptions,
    length_unit: LengthUnit,
) -> tuple[FileUnit, ReferenceSystem, tuple[Note, ...]]:
    """Return the unit and system of files that are to be one cloud, before any point is read.

    Raises
    ------
    ReadError
        If they are in different systems.
    """
    systems = []
    for path, file_format in zip(files, recognised, strict=True):
        with file_format.open(path, options) as source:
            systems.append((path, source.system))
    return unit_of(systems, length_unit)


def corners_of(box: Corners) -> Array:
    """Lowest and highest corner of a box, shape (2, 3).

    Parameters
    ----------
    box : Corners
        Two corners, each x, y, z.

    Returns
    -------
    ndarray
    """
    return np.sort(np.asarray(box, np.float64).reshape(2, 3), axis=0)


def chunks_of(source: Source, corners: Array | None) -> Iterator[Chunk]:
    """All chunks of a source, or at least those that hold points in a box."""
    if corners is None or source.within is None:
        return source.chunks
    return source.within(corners)


def _as_paths(paths: Paths) -> list[Path]:
    files = [Path(p) for p in ([paths] if isinstance(paths, str | os.PathLike) else paths)]
    if not files:
        raise ReadError("No file was given to read.")
    return files
