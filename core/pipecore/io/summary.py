"""What is in a file, without keeping its points."""

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from pipecore.io import coordinates
from pipecore.io.ahead import run_checked
from pipecore.io.left_out import STRAY, left_out_notes
from pipecore.io.reading import common_unit, no_points
from pipecore.io.registry import identify
from pipecore.io.screening import Screen, Whereabouts
from pipecore.io.source import Chunk, OpenOptions, Source
from pipecore.io.spacing import estimate_spacing
from pipecore.io.stations import StationTable
from pipecore.local_frame import choose_origin
from pipecore.notes import Note
from pipecore.progress import NoProgress, Progress
from pipecore.settings import FlaggedPoints, LengthUnit, StationSource
from pipecore.types import Array
from pipecore.units import FileUnit

SAMPLE_POINTS = 500_000


@dataclass(frozen=True)
class StationInfo:
    """A station of a file.

    Parameters
    ----------
    name : str
    n_points : int
    position : tuple of float, optional
        Where the scanner stood, world coordinates in the file's unit.
    """

    name: str
    n_points: int
    position: tuple[float, float, float] | None


@dataclass(frozen=True, eq=False)
class FileInfo:
    """What is in a point cloud file; lengths and coordinates are in the file's own unit.

    Parameters
    ----------
    path : Path
    format : str
        Its format's name, such as “LAS/LAZ”.
    n_points : int
        As many as `pipecore.read` gives.
    minimum, maximum : ndarray
        Corners of the box around the points, world coordinates, float64, shape (3,).
    spacing : float
        Estimated median distance of a point from its nearest neighbour; nan for one point.
    fields : tuple of str
        What the file calls the values of a point.
    crs : str
        The coordinate reference system's name, or "".
    n_scans : int
    n_stations : int
        Scans whose scanner position is known.
    unit : FileUnit
        Unit of the coordinates, as `pipecore.read` takes it.
    stations : tuple of StationInfo
        Empty where nothing tells stations apart.
    left_out : mapping of str to int
        How many points are left out, by the reasons of `pipecore.io.left_out`.
    notes : tuple of Note
        As those of the cloud that `pipecore.read` gives.
    """

    path: Path
    format: str
    n_points: int
    minimum: Array
    maximum: Array
    spacing: float
    fields: tuple[str, ...]
    crs: str
    n_scans: int
    n_stations: int
    unit: FileUnit = FileUnit()
    stations: tuple[StationInfo, ...] = ()
    left_out: Mapping[str, int] = field(default_factory=dict)
    notes: tuple[Note, ...] = ()


def info(
    path: str | os.PathLike[str],
    *,
    length_unit: LengthUnit = LengthUnit.AUTO,
    flagged_points: FlaggedPoints = FlaggedPoints.LEAVE_OUT,
    stations: StationSource = StationSource.AUTO,
    columns: str = "",
    progress: Progress | None = None,
) -> FileInfo:
    """Return what is in a point cloud file.

    All points are looked at, since headers are often wrong, but none are kept.

    Parameters
    ----------
    path : path
    length_unit, flagged_points, stations, columns
        As for `pipecore.read`.
    progress : Progress, optional
        Told about the stage "reading"; may cancel.

    Returns
    -------
    FileInfo

    Raises
    ------
    ReadError
        If the file cannot be read as a point cloud.
    CancelledError
        From `progress`.
    """
    path, progress = Path(path), progress or NoProgress()
    file_format = identify(path)
    options = OpenOptions(columns, flagged_points)
    unit, system, notes = common_unit([path], [file_format], options, length_unit)
    with file_format.open(path, options) as source:
        survey = _Survey(path, source, unit, stations)
        for chunk in source.chunks:
            progress.update("reading", min(chunk.fraction, 1.0))
            survey.add(chunk)
        if not survey.end():
            raise no_points(path, source.left_out)
        progress.update("reading", 1.0)
        low, high = survey.bounds()
        sample = np.concatenate(survey.sample)
        # A million points may take a second, and be asked to stop.
        spacing = run_checked(
            lambda: _spacing(source, sample, survey.n_points),
            lambda: progress.update("reading", 1.0),
        )
        notes += survey.notes(low, high)
        spacing_m = spacing * unit.metres
        notes += coordinates.sense_notes(
            path, unit, system.name, spacing_m, low, high, is_angular=system.is_geographic
        )
        return FileInfo(
            path,
            file_format.name,
            survey.n_points,
            low,
            high,
            spacing,
            source.fields,
            system.name,
            max(1, len(source.scans)),
            sum(bool(np.isfinite(scan.position).all()) for scan in source.scans),
            unit,
            survey.stations(),
            dict(source.left_out),
            notes,
        )


class _Survey:
    """Looks at the points of a file as reading it does, and keeps only some of them."""

    def __init__(self, path: Path, source: Source, unit: FileUnit, stations: StationSource) -> None:
        self._path, self._source, self._unit = path, source, unit
        self._screen = Screen()
        self._screen.begin_file(unit.factors)
        self._whereabouts: Whereabouts | None = None
        self._stations = StationTable(stations)
        self._stations.begin_file(path, source)
        self._n_by_id = np.zeros(1, np.int64)
        self._notes: tuple[Note, ...] = ()
        self.n_points = 0
        self.sample: list[Array] = []
        self._n_sample = 0

    def add(self, chunk: Chunk) -> None:
        """Look at a chunk."""
        xyz, keep, extremes = self._screen.valid(chunk, self._source.left_out)
        if not len(xyz):
            return
        if self._whereabouts is None:
            self._whereabouts = Whereabouts(choose_origin(xyz))
            self._notes = coordinates.notes_on_steps(
                self._path, self._source, chunk.xyz[keep], self._unit
            )[0]
        self._whereabouts.add(xyz, *extremes)
        self._count(chunk if isinstance(keep, slice) else chunk.take(keep))
        if self._n_sample < SAMPLE_POINTS:
            self.sample.append(chunk.xyz[keep][: SAMPLE_POINTS - self._n_sample])
            self._n_sample += len(self.sample[-1])

    def _count(self, chunk: Chunk) -> None:
        n = len(chunk)
        self.n_points += n
        ids = self._stations.provisional(chunk.station, n)
        counts = np.bincount(ids) if isinstance(ids, np.ndarray) else np.bincount([ids]) * n
        longer = max(len(counts), len(self._n_by_id))
        self._n_by_id = np.pad(self._n_by_id, (0, longer - len(self._n_by_id)))
        self._n_by_id[: len(counts)] += counts

    def end(self) -> bool:
        """Take what is known when all is read; return whether there are any points."""
        left_out = self._source.left_out
        bounds = self._whereabouts.bounds() if self._whereabouts is not None else None
        for chunk in self._screen.keep_zeros(bounds, left_out):
            self._count(chunk)
        if self._whereabouts is not None and (n := self._whereabouts.n_strays()):
            left_out[STRAY] += n
            self.n_points -= n
        return self.n_points > 0

    def bounds(self) -> tuple[Array, Array]:
        """Lowest and highest coordinates, in the file's unit."""
        assert self._whereabouts is not None
        bounds = self._whereabouts.bounds()
        assert bounds is not None
        return bounds[0] / self._unit.factors, bounds[1] / self._unit.factors

    def notes(self, low: Array, high: Array) -> tuple[Note, ...]:
        """Return what is to be said of the file."""
        source = self._source
        return (
            *self._notes,
            *source.notes,
            *coordinates.header_bounds_notes(self._path, source, low, high),
            *left_out_notes(self._path.name, source.left_out),
        )

    def stations(self) -> tuple[StationInfo, ...]:
        """Return the stations, with the numbers of their points."""
        ids, names, positions = self._stations.finish()
        if ids is None:
            return ()
        n_by_station = np.zeros(len(names) + 1, np.int64)
        np.add.at(n_by_station, ids[: len(self._n_by_id)], self._n_by_id)
        return tuple(
            StationInfo(
                name,
                int(n),
                (float(p[0]), float(p[1]), float(p[2])) if np.isfinite(p).all() else None,
            )
            for name, n, p in zip(names, n_by_station[1:], positions, strict=True)
        )


def _spacing(source: Source, sample: Array, n_points: int) -> float:
    """Spacing of a file's points: measured where they are all known, else estimated."""
    if source.neighbourhood is None:
        return estimate_spacing(sample, n_points)
    whole = source.neighbourhood()
    return estimate_spacing(whole, len(whole))
