"""Points of one or several scans, with what a file says of each."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipecore.caller_arrays import (
    check_column,
    check_coordinates,
    check_positions,
    check_station_ids,
)
from pipecore.display import Summarised
from pipecore.local_frame import choose_origin, to_local
from pipecore.notes import Note
from pipecore.rounding import measured_step, sampled_runs
from pipecore.types.arrays import Array, Floats
from pipecore.units import FileUnit


@dataclass(frozen=True, eq=False)
class Field:
    """More values of each point, as a file stores them.

    Parameters
    ----------
    values : ndarray
        Of any integer or floating type, shape (n,) or (n, k).
    scale, offset : float
        What stands for a stored value v is scale · v + offset.
    no_data : float, optional
        The stored value that stands for none.
    description : str
        What the file says of it.
    """

    values: NDArray[Any]
    scale: float = 1.0
    offset: float = 0.0
    no_data: float | None = None
    description: str = ""

    def scaled(self) -> Array:
        """Return what the stored values stand for, float64; nan where there is none.

        Returns
        -------
        ndarray
            Shape as of `values`.
        """
        scaled = self.values * self.scale + self.offset
        if self.no_data is not None:
            scaled = np.where(self.values == self.no_data, np.nan, scaled)
        return np.asarray(scaled, dtype=np.float64)


@dataclass(frozen=True, eq=False)
class Storage:
    """How a file keeps coordinates: as whole numbers of steps from an offset.

    Parameters
    ----------
    steps, offsets : ndarray
        Of x, y and z in the file's unit, shape (3,).
    projection : tuple of (int, bytes)
        Records of LAS that name its reference system, as they stand, by their numbers.
    guid : str
        What identifies the project that the file is a part of, or "".
    unit : FileUnit, optional
        Of steps and offsets; None for that of the cloud.
    """

    steps: Array
    offsets: Array
    projection: tuple[tuple[int, bytes], ...] = ()
    guid: str = ""
    unit: FileUnit | None = None


@dataclass(frozen=True, eq=False)
class Reading:
    """From which files a cloud was read, and how.

    Parameters
    ----------
    paths : tuple of Path
    arguments : mapping of str to object
        Those of `pipecore.read`.
    """

    paths: tuple[Path, ...]
    arguments: Mapping[str, Any]


@dataclass(frozen=True, eq=False, repr=False)
class PointCloud(Summarised):
    """Points of one or several scans in one coordinate system.

    Made by `read` from files and by `from_points` from arrays; the constructor takes what
    is in its final form, and checks nothing.

    Parameters
    ----------
    origin : ndarray
        World coordinates of the local zero, float64, shape (3,).
    xyz : ndarray
        Local coordinates, shape (n, 3), C-contiguous; float32 where that keeps 0.1 mm
        (extents up to a kilometre), else float64. All finite.
    intensity : ndarray, optional
        As in the file, float32, shape (n,).
    rgb : ndarray, optional
        uint8, shape (n, 3).
    classification : ndarray, optional
        ASPRS classes, uint8, shape (n,).
    station : ndarray, optional
        Id of the station that each point was scanned from, from 1 on, uint16, shape (n,);
        None where nothing tells.
    station_names : tuple of str
        Where each station comes from: a file, or a file and a scan in it.
    stations : ndarray
        Scanner positions in local coordinates, shape (k, 3): of the stations in the order
        of their ids, nan where a file does not know one.
    crs : str
        The coordinate reference system's name, or "".
    crs_wkt : str
        Its well-known text, where the file or its EPSG code gives one, or "".
    unit : FileUnit
        Unit of the coordinates in the file.
    step : float
        Steps in which the file keeps coordinates, metres (rounding adds an SD of step/√12
        to each); 0 where there are none.
    fields : mapping of str to Field
        More values of each point, as the file has them, where `read` was asked for them.
    notes : tuple of Note
        What a reader should know of the file: what was left out, its unit, its errors.
    source : Path, optional
        The file it was read from.
    storage : Storage, optional
        How its files keep coordinates, where they all do so in the same steps.
    reading : Reading, optional
        From which files it was read, and how; see `pipecore.io.with_fields`.
    """

    origin: Array
    xyz: Floats
    intensity: NDArray[np.float32] | None = None
    rgb: NDArray[np.uint8] | None = None
    classification: NDArray[np.uint8] | None = None
    station: NDArray[np.uint16] | None = None
    station_names: tuple[str, ...] = ()
    stations: Array = field(default_factory=lambda: np.empty((0, 3)))
    crs: str = ""
    crs_wkt: str = ""
    unit: FileUnit = FileUnit()
    step: float = 0.0
    fields: Mapping[str, Field] = field(default_factory=dict)
    notes: tuple[Note, ...] = ()
    source: Path | None = None
    storage: Storage | None = None
    reading: Reading | None = None

    @classmethod
    def from_points(
        cls,
        xyz: ArrayLike,
        *,
        intensity: ArrayLike | None = None,
        rgb: ArrayLike | None = None,
        classification: ArrayLike | None = None,
        station: ArrayLike | None = None,
        stations: ArrayLike | None = None,
        crs: str = "",
    ) -> "PointCloud":
        """Make a cloud of arrays, which are checked and copied.

        Parameters
        ----------
        xyz : array_like
            World coordinates in metres, shape (n, 3). float64, or float32 where that is
            fine enough: at 400 km its steps are 3 cm.
        intensity : array_like, optional
            Shape (n,).
        rgb : array_like, optional
            Whole numbers from 0 to 255, shape (n, 3).
        classification : array_like, optional
            ASPRS classes, shape (n,).
        station : int or array_like, optional
            Number of the station that all points or each was scanned from, from 1 on, shape
            () or (n,).
        stations : array_like, optional
            Scanner positions in world coordinates, shape (3,) or (k, 3), in the order of the
            stations' numbers; nan where one is not known. They say along which line each
            point's noise is, which makes radii better.
        crs : str
            The coordinate reference system's name.

        Returns
        -------
        PointCloud
            Its origin is a whole multiple of 100 m near the middle of the points.

        Raises
        ------
        TypeError
            If an array does not hold numbers of the kind that it should.
        ValueError
            If an array has another shape or length, or holds values that are not finite or
            out of range.
        """
        world = check_coordinates(xyz)
        origin = choose_origin(world) if len(world) else np.zeros(3)
        n = len(world)
        positions = np.empty((0, 3)) if stations is None else check_positions(stations)
        ids = None if station is None else check_station_ids(station, n, positions)
        n_stations = 0 if ids is None else max(int(ids.max(initial=0)), len(positions))
        return cls(
            origin=origin,
            xyz=to_local(world, origin),
            intensity=None
            if intensity is None
            else check_column(intensity, "the intensity", n, np.float32),
            rgb=None if rgb is None else check_column(rgb, "the colours", n, np.uint8, 3),
            classification=None
            if classification is None
            else check_column(classification, "the classes", n, np.uint8),
            station=ids,
            station_names=tuple(f"Station {i + 1}" for i in range(n_stations)),
            stations=positions - origin,
            crs=crs,
            step=measured_step(sampled_runs(world)),
        )

    def __len__(self) -> int:
        """Return the number of points."""
        return len(self.xyz)

    def _title(self) -> str:
        return "PointCloud"

    def _facts(self) -> dict[str, str]:
        columns = ("intensity", "rgb", "classification")
        facts = {
            "points": f"{len(self):,}",
            "origin": "({:.10g}, {:.10g}, {:.10g}) m".format(*self.origin.tolist()),
            "with": " + ".join(c for c in columns if getattr(self, c) is not None),
            "scanner positions": str(len(self.stations) or ""),
            "crs": self.crs,
            "source": self.source.name if self.source else "",
        }
        return {name: text for name, text in facts.items() if text}

    def world(self, local: Array) -> Array:
        """World coordinates (float64) of local ones, any shape (..., 3).

        Parameters
        ----------
        local : ndarray
            Metres.

        Returns
        -------
        ndarray
            Metres, shape as of `local`.
        """
        return np.asarray(local, dtype=np.float64) + self.origin

    def take(self, rows: NDArray[np.bool_] | NDArray[np.integer[Any]] | slice) -> "PointCloud":
        """Return some of the points, with all their values.

        Parameters
        ----------
        rows : ndarray or slice
            A mask of shape (n,), or places of points.

        Returns
        -------
        PointCloud
            With the same origin and stations. A slice gives views, anything else copies.
        """
        held: dict[str, Any] = {
            name: None if (values := getattr(self, name)) is None else values[rows]
            for name in ("intensity", "rgb", "classification", "station")
        }
        fields = {name: replace(f, values=f.values[rows]) for name, f in self.fields.items()}
        return replace(self, xyz=self.xyz[rows], fields=fields, reading=None, **held)
