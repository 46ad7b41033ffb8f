"""Reading LAS and LAZ in parts, in any order and by several processes, into files.

A part is some whole chunks of a LAZ file. What comes out is what `pipecore.io.read` makes of
the files with a folder; where its points must be looked at in their order, nothing comes out.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipecore.io import coordinates
from pipecore.io.formats import las
from pipecore.io.growing import (
    give_final_ids,
    odd_size_notes,
)
from pipecore.io.mapped import MappedFile
from pipecore.io.reading import common_unit, reading_of
from pipecore.io.registry import identify
from pipecore.io.screening import extremes, has_zeros
from pipecore.io.source import CHUNK_POINTS, OpenOptions, Source
from pipecore.io.stations import StationTable
from pipecore.io.storage import common_storage
from pipecore.local_frame import FLOAT32_REACH, choose_origin
from pipecore.notes import Note
from pipecore.settings import FlaggedPoints, LengthUnit, StationSource
from pipecore.types import Array, PointCloud
from pipecore.units import FileUnit

PART_POINTS = 1_000_000
FLOAT32_ERROR = 1e-4
"""How far off coordinates may be that are kept as float32, metres."""
_COLUMNS: dict[str, tuple[type, int | None]] = {
    "xyz": (np.float32, 3),
    "intensity": (np.float32, None),
    "rgb": (np.uint8, 3),
    "classification": (np.uint8, None),
    "station": (np.uint16, None),
}


@dataclass(frozen=True, eq=False)
class FilePart:
    """Some points of a file and where they go.

    Parameters
    ----------
    path : Path
    rows : (int, int)
        The first point in the file, and the one behind the last.
    place : int
        Row of the cloud of the first one.
    origin : ndarray
    unit : FileUnit
    has_wide_colours : bool
        Whether the file's colours use all of their 16 bits.
    options : OpenOptions
    """

    path: Path
    rows: tuple[int, int]
    place: int
    origin: Array
    unit: FileUnit
    has_wide_colours: bool
    options: OpenOptions


@dataclass(frozen=True, eq=False)
class PlannedCloud:
    """A cloud that is filled by `read_part`, and what it takes to finish it.

    Parameters
    ----------
    parts : list of FilePart
    cloud : PointCloud
    stations : StationSource
    files : list of (Path, int, Source)
        Each file, where its points end in the cloud, and what its header says.
    """

    parts: list[FilePart]
    cloud: PointCloud
    stations: StationSource
    files: list[tuple[Path, int, Source]]


def plan_parts(
    paths: Sequence[Path],
    folder: Path,
    *,
    length_unit: LengthUnit = LengthUnit.AUTO,
    flagged_points: FlaggedPoints = FlaggedPoints.LEAVE_OUT,
    stations: StationSource = StationSource.AUTO,
    columns: str = "",
) -> PlannedCloud | None:
    """Make room for the points of LAS and LAZ files and say in which parts to read them.

    Parameters
    ----------
    paths : sequence of Path
    folder : Path
        Where the cloud's arrays are kept as files.
    length_unit, flagged_points, stations, columns
        As for `pipecore.read`.

    Returns
    -------
    PlannedCloud or None
        None where the files must be read in order: if one has another format, if float32
        does not carry their extent, if it is damaged, or if it shows late which bits its
        colours use.
    """
    recognised = [identify(path) for path in paths]
    if any(f.module != "las" for f in recognised):
        return None
    options = OpenOptions(columns, flagged_points)
    unit, system, notes = common_unit(paths, recognised, options, length_unit)
    origin: Array | None = None
    parts: list[FilePart] = []
    files: list[tuple[Path, int, Source]] = []
    n_points, has_colours, step = 0, False, 0.0
    of_steps: list[Note] = []
    for path in paths:
        starts = las.chunk_starts(path)
        if len(starts) < 2:
            return None
        with las.open_source(path, options, rows=(0, min(CHUNK_POINTS, starts[-1]))) as source:
            first = next(iter(source.chunks), None)
        if source.bounds is None or source.left_out.total() or first is None:
            return None
        if origin is None:
            origin = choose_origin(first.xyz * unit.factors)
        if not np.abs(source.bounds * unit.factors - origin).max() <= FLOAT32_REACH:
            return None
        is_coloured = first.rgb is not None
        is_wide = first.rgb is not None and bool(first.rgb.max(initial=0) > 255)
        if is_coloured and not is_wide:
            return None
        has_colours |= is_coloured
        own_notes, own_step = coordinates.notes_on_steps(path, source, first.xyz, unit)
        step = max(step, own_step)
        of_steps += own_notes
        parts += [
            FilePart(path, rows, n_points + rows[0], origin, unit, is_wide, options)
            for rows in _grouped(starts)
        ]
        n_points += starts[-1]
        files.append((path, n_points, source))
    assert origin is not None
    arrays = {
        name: MappedFile(_path(folder, name), dtype, width).resized(n_points)
        for name, (dtype, width) in _COLUMNS.items()
        if name != "rgb" or has_colours
    }
    cloud = PointCloud(
        origin=origin,
        **arrays,  # type: ignore[arg-type]
        crs=system.name,
        crs_wkt=system.wkt,
        unit=unit,
        step=step,
        notes=(*notes, *of_steps),
        source=paths[0],
        storage=common_storage([source.storage for _, _, source in files], unit),
        reading=reading_of(paths, length_unit, flagged_points, stations, columns, None),
    )
    return PlannedCloud(parts, cloud, stations, files)


def read_part(folder: Path, part: FilePart) -> bool:
    """Read a part into the files of a folder.

    Returns
    -------
    bool
        False where the file's header lied, or points have to be left out: then the files have
        to be read in order.
    """
    with las.open_source(part.path, part.options, rows=part.rows) as source:
        place = part.place
        for chunk in source.chunks:
            xyz = chunk.xyz * part.unit.factors
            local = xyz - part.origin
            with np.errstate(invalid="ignore"):
                is_valid = np.abs(local).max(initial=0.0) < FLOAT32_REACH
            if not is_valid or source.left_out.total() or has_zeros(chunk.xyz):
                return False
            rows = slice(place, place + len(local))
            _open(folder, "xyz")[rows] = local
            for name, values in (
                ("intensity", chunk.intensity),
                ("classification", chunk.classification),
                ("station", chunk.station),
            ):
                assert values is not None
                _open(folder, name)[rows] = values
            if chunk.rgb is not None:
                _open(folder, "rgb")[rows] = chunk.rgb >> 8
            place = rows.stop
    return place - part.place == part.rows[1] - part.rows[0]


def finish_parts(folder: Path, planned: PlannedCloud) -> PointCloud:
    """Return the cloud when all its parts are read.

    Parameters
    ----------
    folder : Path
        That of `plan_parts`.
    planned : PlannedCloud
    """
    cloud, table = planned.cloud, StationTable(planned.stations)
    station, xyz = _open(folder, "station"), _open(folder, "xyz")
    begin = 0
    notes = list(cloud.notes)
    for path, end, source in planned.files:
        table.begin_file(path, source)
        low, high = np.full(3, np.inf), np.full(3, -np.inf)
        for start in range(begin, end, CHUNK_POINTS):
            rows = slice(start, min(start + CHUNK_POINTS, end))
            station[rows] = table.provisional(np.array(station[rows]), rows.stop - rows.start)
            least, most = extremes(np.asarray(xyz[rows], np.float64))
            low, high = np.minimum(low, least), np.maximum(high, most)
        begin = end
        factors = cloud.unit.factors
        notes += source.notes
        notes += coordinates.header_bounds_notes(
            path,
            source,
            (low + cloud.origin) / factors,
            (high + cloud.origin) / factors,
            FLOAT32_ERROR / cloud.unit.metres,
        )
    path, _, source = planned.files[0]
    assert source.bounds is not None
    odd = odd_size_notes(path, cloud, source.bounds)
    cloud = replace(cloud, notes=(*notes, *odd))
    ids, names, positions = table.finish()
    if ids is None:
        cloud = replace(cloud, station=None)
        del station
        _path(folder, "station").unlink()
        return cloud
    give_final_ids(station, ids)
    places = positions * cloud.unit.factors - cloud.origin
    return replace(cloud, station_names=names, stations=places)


def remove_parts(folder: Path) -> None:
    """Delete what `plan_parts` made, so that the files can be read in order."""
    for name in _COLUMNS:
        _path(folder, name).unlink(missing_ok=True)


def _grouped(starts: list[int]) -> list[tuple[int, int]]:
    """Ranges of whole chunks of at least `PART_POINTS` points, but for the last."""
    groups, first = [], starts[0]
    for end in starts[1:]:
        if end - first >= PART_POINTS or end == starts[-1]:
            groups.append((first, end))
            first = end
    return groups


def _path(folder: Path, name: str) -> Path:
    return folder / f"{name}.{np.dtype(_COLUMNS[name][0]).name}"


def _open(folder: Path, name: str) -> NDArray[Any]:
    dtype, width = _COLUMNS[name]
    array = np.asarray(np.memmap(_path(folder, name), dtype, "r+"))
    return array if width is None else array.reshape(-1, width)
