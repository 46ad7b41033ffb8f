"""A cloud that grows chunk by chunk, never held twice in memory."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipecore.io import coordinates
from pipecore.io.crs import ReferenceSystem
from pipecore.io.left_out import STRAY, left_out_notes
from pipecore.io.mapped import MappedFile
from pipecore.io.screening import Screen, Whereabouts
from pipecore.io.source import CHUNK_POINTS, Chunk, FieldInfo, Source
from pipecore.io.spacing import median_spacing
from pipecore.io.stations import StationTable
from pipecore.io.storage import common_storage
from pipecore.local_frame import FLOAT32_REACH, choose_origin
from pipecore.notes import Note
from pipecore.rounding import STEP_SAMPLE
from pipecore.settings import StationSource
from pipecore.types import Array, Field, PointCloud
from pipecore.units import FileUnit


class GrowingArray:
    """An array that grows in place; rows that are never set stay zero.

    Parameters
    ----------
    dtype : dtype
    width : int, optional
        Number of columns; None for one dimension.
    path : Path, optional
        A file to keep it in, mapped into memory.
    """

    def __init__(
        self, dtype: np.dtype[Any] | type, width: int | None = None, path: Path | None = None
    ) -> None:
        self.file = MappedFile(path, dtype, width) if path else None
        self.array: NDArray[Any] = np.zeros((0,) if width is None else (0, width), dtype)

    def resize(self, n_rows: int) -> None:
        """Have so many rows; new ones are zero."""
        if self.file is not None:
            self.array = self.file.resized(n_rows)
            return
        if not len(self.array):
            # Zeros that are never touched take neither memory nor time.
            self.array = np.zeros((n_rows, *self.array.shape[1:]), self.array.dtype)
            return
        # In place (no second copy in memory); nothing else refers to the array yet.
        self.array.resize((n_rows, *self.array.shape[1:]), refcheck=False)

    def put(self, start: int, values: NDArray[Any] | int, n: int) -> None:
        """Set `n` rows, which may be new."""
        self.rows(start, n)[...] = values

    def rows(self, start: int, n: int) -> NDArray[Any]:
        """Return `n` rows, which may be new, to be set."""
        end = start + n
        if end > len(self.array):
            self.resize(max(end, len(self.array) + len(self.array) // 2))
        return self.array[start:end]


class GrowingCloud:
    """A cloud to which the chunks of files are added.

    Parameters
    ----------
    unit : FileUnit
    system : ReferenceSystem
    stations : StationSource
    folder : Path, optional
        Where to keep the arrays as files.
    corners : ndarray, optional
        Only points in this box are kept, in the files' coordinates, shape (2, 3).
    is_exact : bool
        Whether to keep all digits of coordinates, as float64.
    """

    def __init__(
        self,
        unit: FileUnit,
        system: ReferenceSystem,
        stations: StationSource,
        folder: Path | None = None,
        corners: Array | None = None,
        *,
        is_exact: bool = False,
    ) -> None:
        self._is_exact = is_exact
        self._folder, self._unit, self._system = folder, unit, system
        self._screen = Screen(corners)
        self._whereabouts: Whereabouts | None = None
        self.n_points = 0
        self.origin: Array | None = None
        self.xyz = self._column("xyz", np.float64 if is_exact else np.float32, 3)
        self._columns: dict[str, GrowingArray] = {}
        self._fields: dict[str, GrowingArray] = {}
        self._field_infos: dict[str, FieldInfo] = {}
        self._stations = StationTable(stations)
        self._files: list[tuple[Path, Source]] = []
        self._extents: list[tuple[Array, Array]] = []
        self._file_start = 0
        self._has_wide_colours = False
        self._step = 0.0
        self._notes: list[Note] = []

    @property
    def rgb(self) -> NDArray[Any] | None:
        """Colours so far, or None."""
        return self._columns["rgb"].array if "rgb" in self._columns else None

    def _column(self, name: str, dtype: Any, width: int | None = None) -> GrowingArray:
        path = self._folder and self._folder / f"{name}.{np.dtype(dtype).name}"
        return GrowingArray(dtype, width, path)

    def begin_file(self, path: Path, source: Source, file_size: int) -> None:
        """Take over what a source knows besides its points."""
        self._file_start = self.n_points
        self._has_wide_colours = False
        self._files.append((path, source))
        self._extents.append((np.full(3, np.inf), np.full(3, -np.inf)))
        self._screen.begin_file(self._unit.factors)
        self._stations.begin_file(path, source)
        self._field_infos.update(source.field_infos)
        if source.n_points is not None and self._screen.corners is None:
            # A compressed file may announce anything: what its size makes likely is enough.
            self.xyz.resize(self.n_points + min(source.n_points, file_size // 2))

    def add(self, chunk: Chunk) -> None:
        """Append the valid points of a chunk."""
        path, source = self._files[-1]
        xyz, keep, (low, high) = self._screen.valid(chunk, source.left_out)
        if not len(xyz):
            return
        if self.origin is None:
            self.origin = choose_origin(xyz)
            self._whereabouts = Whereabouts(self.origin)
        if self.n_points == self._file_start:
            notes, step = coordinates.notes_on_steps(path, source, chunk.xyz[keep], self._unit)
            self._notes += notes
            self._step = max(self._step, step)
        assert self._whereabouts is not None
        self._whereabouts.add(xyz, low, high)
        self._extend(low, high)
        self._append(xyz, low, high, chunk if isinstance(keep, slice) else chunk.take(keep))

    def _append(self, xyz: Array, low: Array, high: Array, chunk: Chunk) -> None:
        assert self.origin is not None
        n, start = len(xyz), self.n_points
        reach = np.maximum(self.origin - low, high - self.origin).max()
        if self.xyz.array.dtype == np.float32 and reach > FLOAT32_REACH:
            self._widen_coordinates()
        np.subtract(xyz, self.origin, out=self.xyz.rows(start, n), casting="same_kind")
        if chunk.intensity is not None:
            self._put("intensity", np.float32, None, chunk.intensity, n)
        if chunk.rgb is not None:
            self._put("rgb", np.uint8, 3, self._eight_bits(chunk.rgb), n)
        if chunk.classification is not None:
            self._put("classification", np.uint8, None, chunk.classification, n)
        self._put("station", np.uint16, None, self._stations.provisional(chunk.station, n), n)
        for name, values in chunk.fields.items():
            self._put_field(name, values, n)
        self.n_points += n

    def _put(self, name: str, dtype: type, width: int | None, values: Any, n: int) -> None:
        if name not in self._columns:
            self._columns[name] = self._column(name, dtype, width)
            self._columns[name].resize(len(self.xyz.array))
        self._columns[name].put(self.n_points, values, n)

    def _put_field(self, name: str, values: NDArray[Any], n: int) -> None:
        width = None if values.ndim == 1 else values.shape[1]
        if name not in self._fields:
            dtype = values.dtype.newbyteorder("=")
            path = self._folder and self._folder / f"field-{len(self._fields)}"
            self._fields[name] = GrowingArray(dtype, width, path)
        column = self._fields[name]
        if column.array.shape[1:] == values.shape[1:] and np.can_cast(
            values.dtype, column.array.dtype, "same_kind"
        ):
            column.put(self.n_points, values, n)

    def end_file(self) -> None:
        """Take what is known of a file when all its chunks are added."""
        _, source = self._files[-1]
        bounds = self._whereabouts.bounds() if self._whereabouts is not None else None
        for chunk in self._screen.keep_zeros(bounds, source.left_out):
            self._append(self._screen.world(chunk.xyz), np.zeros(3), np.zeros(3), chunk)
            self._extend(np.zeros(3), np.zeros(3))

    def _extend(self, low: Array, high: Array) -> None:
        """Have the box of the current file reach to these coordinates, metres."""
        least, most = self._extents[-1]
        self._extents[-1] = np.minimum(least, low), np.maximum(most, high)

    def _widen_coordinates(self) -> None:
        """Go over to float64."""
        if self._folder is None:
            self.xyz.array = self.xyz.array.astype(np.float64)
            return
        self._change_file(np.float64)

    def _change_file(self, dtype: type) -> None:
        assert self._folder is not None
        old, self.xyz = self.xyz.array, self._column("xyz", dtype, 3)
        self.xyz.resize(len(old))
        for start in range(0, self.n_points, CHUNK_POINTS):
            stop = min(start + CHUNK_POINTS, self.n_points)
            self.xyz.put(start, old[start:stop], stop - start)
        (self._folder / f"xyz.{old.dtype.name}").unlink(missing_ok=True)

    def of_chunk(self, chunk: Chunk) -> PointCloud:
        """Return the points of a chunk that is not added, as a cloud with the same origin."""
        assert self.origin is not None
        xyz = self._screen.world(chunk.xyz)
        keep = np.abs(xyz - self.origin).max(axis=1) <= FLOAT32_REACH
        rgb = None if chunk.rgb is None else chunk.rgb[keep]
        if rgb is not None and rgb.dtype != np.uint8:
            rgb = (rgb >> 8 if rgb.max(initial=0) > 255 else rgb).astype(np.uint8)
        local = (xyz[keep] - self.origin).astype(self.xyz.array.dtype)
        return PointCloud(origin=self.origin, xyz=local, rgb=rgb)

    def _eight_bits(self, rgb: NDArray[np.uint8] | NDArray[np.uint16]) -> NDArray[np.uint8]:
        """Return colours as 0 to 255, whichever bits of the 16 the file's writer used."""
        if rgb.dtype == np.uint8:
            return rgb.astype(np.uint8, copy=False)
        if not self._has_wide_colours and rgb.max(initial=0) > 255:
            self._has_wide_colours = True
            if self.rgb is not None:  # None of this file's colours so far reached the high bits.
                self.rgb[self._file_start : self.n_points] = 0
        if not self._has_wide_colours:
            return rgb.astype(np.uint8)
        return (rgb >> 8).astype(np.uint8)

    def part(self, start: int, n_points: int) -> PointCloud:
        """Return about so many of the points from `start` on, copied."""
        assert self.origin is not None
        rows = slice(start, self.n_points, max(1, (self.n_points - start) // n_points))
        return PointCloud(
            origin=self.origin,
            xyz=self.xyz.array[rows].copy(),
            rgb=None if self.rgb is None else self.rgb[rows].copy(),
        )

    def finish(self, source: Path, notes: tuple[Note, ...]) -> PointCloud:
        """Return the cloud; nothing can be added after that.

        Parameters
        ----------
        source : Path
        notes : tuple of Note
            What is to be said before all that the cloud knows itself.
        """
        assert self.origin is not None
        self._drop_strays()
        for column in self._all_columns():
            column.resize(self.n_points)
        ids, names, positions = self._stations.finish()
        station = self._columns.pop("station")
        if ids is not None:
            give_final_ids(station.array, ids)
        elif self._folder is not None:
            (self._folder / "station.uint16").unlink()
        columns: dict[str, Any] = {name: column.array for name, column in self._columns.items()}
        cloud = PointCloud(
            origin=self.origin,
            xyz=self.xyz.array,
            **columns,
            station=None if ids is None else station.array,
            station_names=names,
            stations=positions * self._unit.factors - self.origin,
            crs=self._system.name,
            crs_wkt=self._system.wkt,
            unit=self._unit,
            step=self._step,
            fields={
                name: _field(column.array, self._field_infos.get(name, FieldInfo()))
                for name, column in self._fields.items()
            },
            notes=(*notes, *self._all_notes()),
            source=source,
            storage=common_storage(
                [s.storage for _, s in self._files], self._unit, self._crs_from()
            ),
        )
        assert self._whereabouts is not None
        bounds = self._whereabouts.bounds()
        assert bounds is not None
        in_file = np.array(bounds) / self._unit.factors
        odd = odd_size_notes(
            self._files[0][0], cloud, in_file, is_angular=self._system.is_geographic
        )
        return replace(cloud, notes=(*cloud.notes, *odd))

    def _crs_from(self) -> int:
        """Place of the file whose reference system is that of the cloud."""
        names = [s.system.name for _, s in self._files]
        return names.index(self._system.name) if self._system.name in names else 0

    def _all_columns(self) -> list[GrowingArray]:
        return [self.xyz, *self._columns.values(), *self._fields.values()]

    def _all_notes(self) -> Iterator[Note]:
        yield from self._notes
        for (path, source), (low, high) in zip(self._files, self._extents, strict=True):
            yield from source.notes
            if self._screen.corners is None:
                factors = self._unit.factors
                yield from coordinates.header_bounds_notes(
                    path, source, low / factors, high / factors
                )
            yield from left_out_notes(path.name, source.left_out)

    def _drop_strays(self) -> None:
        """Take out the points that are far from all others."""
        assert self._whereabouts is not None
        assert self.origin is not None
        boxes = self._whereabouts.strays()
        if not boxes:
            return
        for column in self._all_columns():
            column.resize(self.n_points)
        n_kept, farthest = 0, 0.0
        for start in range(0, self.n_points, CHUNK_POINTS):
            stop = min(start + CHUNK_POINTS, self.n_points)
            xyz = self.xyz.array[start:stop].astype(np.float64) + self.origin
            is_kept = np.ones(len(xyz), np.bool_)
            for low, high in boxes:
                slack = 1e-6 * np.maximum(1.0, np.abs(xyz))
                is_kept &= ~((xyz >= low - slack) & (xyz <= high + slack)).all(axis=1)
            n = int(np.count_nonzero(is_kept))
            for column in self._all_columns():
                column.array[n_kept : n_kept + n] = column.array[start:stop][is_kept]
            farthest = max(farthest, float(np.abs(xyz[is_kept] - self.origin).max(initial=0.0)))
            n_kept += n
        self._files[-1][1].left_out[STRAY] += self.n_points - n_kept
        self.n_points = n_kept
        if not self._is_exact and self.xyz.array.dtype == np.float64 and farthest <= FLOAT32_REACH:
            if self._folder is None:
                self.xyz.array = self.xyz.array[:n_kept].astype(np.float32)
            else:
                self._change_file(np.float32)


def give_final_ids(station: NDArray[Any], ids: NDArray[np.uint16]) -> None:
    """Replace provisional ids of stations by the final ones, in place."""
    if np.array_equal(ids, np.arange(len(ids))):
        return
    for start in range(0, len(station), CHUNK_POINTS):
        rows = slice(start, start + CHUNK_POINTS)
        station[rows] = ids[station[rows]]


def odd_size_notes(
    path: Path, cloud: PointCloud, bounds: Array, *, is_angular: bool = False
) -> tuple[Note, ...]:
    """Return a note if the size of a cloud makes no sense in its unit.

    Parameters
    ----------
    path : Path
        The first file.
    cloud : PointCloud
    bounds : ndarray
        Lowest and highest coordinates in the file's unit, shape (2, 3).
    is_angular : bool
        Whether the coordinates are known to be degrees.
    """
    extent = np.sort((bounds[1] - bounds[0]) * cloud.unit.factors)[::-1]
    spacing = float(np.sqrt(extent[0] * max(extent[1], 1e-3 * extent[0]) / len(cloud)))
    if 5 * coordinates.NARROWEST_SPACING < spacing < coordinates.WIDEST_UNNAMED / 5:
        spacing = float("nan")  # a rough one is enough, since it is not odd
    else:
        sample = cloud.xyz[: 5 * STEP_SAMPLE].astype(np.float64)
        spacing = median_spacing(sample)
    return coordinates.sense_notes(
        path, cloud.unit, cloud.crs, spacing, bounds[0], bounds[1], is_angular=is_angular
    )


def _field(values: NDArray[Any], info: FieldInfo) -> Field:
    return Field(values, info.scale, info.offset, info.no_data, info.description)
