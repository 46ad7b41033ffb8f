"""From the chunks of one or several files to one cloud in one local frame."""

import os
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pipecore.errors import ReadError
from pipecore.io.mapped import MappedFile
from pipecore.io.registry import identify
from pipecore.io.source import CHUNK_POINTS, Chunk, Source
from pipecore.progress import NoProgress, Progress
from pipecore.settings import LengthUnit
from pipecore.types import Array, PointCloud

ORIGIN_STEP = 100.0
"""The local zero is a whole multiple of this, metres."""

FLOAT32_REACH = 1024.0
"""Up to this far from the local zero a float32 is within 0.03 mm, metres."""

LOOK_POINTS = 10_000
"""About so many points of a chunk are shown before all are read."""

FARTHEST = 1e9
"""Coordinates beyond this (metres) lie off any map; they count as invalid, like nan."""

Box = Sequence[Sequence[float]] | Array
"""Two opposite corners."""

Paths = str | os.PathLike[str] | Sequence[str | os.PathLike[str]]


def read(
    paths: Paths,
    *,
    length_unit: LengthUnit = LengthUnit.METRE,
    box: Box | None = None,
    folder: Path | None = None,
    progress: Progress | None = None,
    look: Callable[[PointCloud], None] | None = None,
) -> PointCloud:
    """Read one point cloud from one or several files.

    Several files are merged in one local frame; what only some of them have (colour,
    intensity, class) is zero for the others. Points whose coordinates are not finite or
    absurd are left out, as are those that the file marks invalid.

    Parameters
    ----------
    paths : path or sequence of paths
        In any format of `pipecore.io.formats`; recognised by contents, not by ending.
    length_unit : LengthUnit
        Unit of the coordinates in the files. Local coordinates are metres whatever it
        is, and `cloud.world(local)` gives *metres* in the files' coordinate system:
        divide by `length_unit.metres` to get the files' own numbers.
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
        If a file cannot be read as a point cloud, with the file's name and the cause, or no
        point lies in the box.
    CancelledError
        From `progress`.
    """
    corners = None if box is None else corners_of(box)
    files = _as_paths(paths)
    progress = progress or NoProgress()
    progress.update("reading", 0.0)
    recognised = [identify(path) for path in files]
    sizes = np.array([path.stat().st_size for path in files], dtype=np.float64)
    starts = np.concatenate([[0.0], np.cumsum(sizes)]) / sizes.sum()
    cloud = _GrowingCloud(length_unit.metres, folder, corners)
    for i, path in enumerate(files):
        with recognised[i].open(path) as source:
            before = cloud.n_points
            cloud.begin_file(source, int(sizes[i]))
            for chunk in chunks_of(source, corners):
                start = cloud.n_points
                cloud.add(chunk)
                if look is not None and cloud.n_points > start:
                    if start == before and source.overview is not None:
                        look(cloud.of_chunk(source.overview()))
                    look(cloud.part(start, LOOK_POINTS))
                done = starts[i] + chunk.fraction * (starts[i + 1] - starts[i])
                progress.update("reading", min(float(done), 1.0))
            if cloud.n_points == before and corners is None:
                raise ReadError("“{name}” holds no valid points.", name=path.name)
    if cloud.n_points == 0:
        raise ReadError(
            "No point of “{name}” lies in the box that was asked for.", name=files[0].name
        )
    progress.update("reading", 1.0)
    return cloud.finish(files[0])


def corners_of(box: Box) -> Array:
    """Lowest and highest corner of a box, shape (2, 3)."""
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


def first_origin(xyz: Array) -> Array:
    """Origin of a cloud whose first points, in world coordinates and metres, are these."""
    return np.asarray(np.round(np.median(xyz, axis=0) / ORIGIN_STEP) * ORIGIN_STEP + 0.0)


class _Column:
    """An array that grows in place; rows that are never set stay zero."""

    def __init__(self, dtype: type, width: int | None = None, path: Path | None = None) -> None:
        self._file = MappedFile(path, dtype, width) if path else None
        self.array: NDArray[np.generic] = np.zeros((0,) if width is None else (0, width), dtype)

    def resize(self, n_rows: int) -> None:
        if self._file is not None:
            self.array = self._file.resized(n_rows)
            return
        # In place (no second copy in memory); nothing else refers to the array yet.
        self.array.resize((n_rows, *self.array.shape[1:]), refcheck=False)

    def put(self, start: int, values: NDArray[np.generic]) -> None:
        end = start + len(values)
        if end > len(self.array):
            self.resize(max(end, len(self.array) + len(self.array) // 2))
        self.array[start:end] = values


class _GrowingCloud:
    """A cloud to which chunks are added, never held twice in memory."""

    def __init__(
        self, metres_per_unit: float, folder: Path | None = None, corners: Array | None = None
    ) -> None:
        self._folder, self._corners = folder, corners
        self.metres_per_unit = metres_per_unit
        self.n_points = 0
        self.origin: Array | None = None
        self.xyz = self._column("xyz", np.float32, 3)
        self.intensity: _Column | None = None
        self.rgb: _Column | None = None
        self.classification: _Column | None = None
        self.stations: list[Array] = []
        self.crs = ""
        self.file_start = 0
        self.has_wide_colours = False

    def _column(self, name: str, dtype: type, width: int | None = None) -> _Column:
        path = self._folder and self._folder / f"{name}.{np.dtype(dtype).name}"
        return _Column(dtype, width, path)

    def _widen_coordinates(self) -> None:
        """Go over to float64."""
        if self._folder is None:
            self.xyz.array = self.xyz.array.astype(np.float64)
            return
        narrow, self.xyz = self.xyz.array, self._column("xyz", np.float64, 3)
        self.xyz.resize(len(narrow))
        for start in range(0, self.n_points, CHUNK_POINTS):
            rows = slice(start, min(start + CHUNK_POINTS, self.n_points))
            self.xyz.put(start, narrow[rows])
        (self._folder / "xyz.float32").unlink()

    def begin_file(self, source: Source, file_size: int) -> None:
        """Take over what a source knows besides its points."""
        self.file_start = self.n_points
        self.has_wide_colours = False
        self.crs = self.crs or source.crs
        self.stations.append(source.stations * self.metres_per_unit)
        if source.n_points is not None and self._corners is None:
            # A compressed file may announce anything: what its size makes likely is enough.
            self.xyz.resize(self.n_points + min(source.n_points, file_size // 2))

    def add(self, chunk: Chunk) -> None:
        """Append the valid points of a chunk."""
        xyz, keep = self._valid(chunk.xyz)
        if not len(xyz):
            return
        if self.origin is None:
            self.origin = first_origin(xyz)
        local = xyz - self.origin
        if self.xyz.array.dtype == np.float32 and np.abs(local).max() > FLOAT32_REACH:
            self._widen_coordinates()
        self.xyz.put(self.n_points, local)
        if chunk.intensity is not None:
            self.intensity = self.intensity or self._column("intensity", np.float32)
            self.intensity.put(self.n_points, chunk.intensity[keep])
        if chunk.rgb is not None:
            self.rgb = self.rgb or self._column("rgb", np.uint8, 3)
            self.rgb.put(self.n_points, self._eight_bits(chunk.rgb[keep]))
        if chunk.classification is not None:
            self.classification = self.classification or self._column("classification", np.uint8)
            self.classification.put(self.n_points, chunk.classification[keep])
        self.n_points += len(local)

    def _valid(self, xyz: Array) -> tuple[Array, NDArray[np.bool_] | slice]:
        """World coordinates in metres of what is to be kept of a chunk, and which points."""
        is_kept: NDArray[np.bool_] | None = None
        if self._corners is not None:
            is_kept = ((xyz >= self._corners[0]) & (xyz <= self._corners[1])).all(axis=1)
        if self.metres_per_unit != 1.0:
            xyz = xyz * self.metres_per_unit
        if is_kept is None and (not len(xyz) or (xyz.min() >= -FARTHEST and xyz.max() <= FARTHEST)):
            return xyz, slice(None)
        is_valid = np.all(np.abs(xyz) <= FARTHEST, axis=1)
        is_kept = is_valid if is_kept is None else is_valid & is_kept
        return xyz[is_kept], is_kept

    def of_chunk(self, chunk: Chunk) -> PointCloud:
        """Return the points of a chunk that is not added, as a cloud with the same origin."""
        assert self.origin is not None
        xyz, keep = self._valid(chunk.xyz)
        rgb = None if chunk.rgb is None else chunk.rgb[keep]
        if rgb is not None and rgb.dtype != np.uint8:
            rgb = (rgb >> 8 if rgb.max(initial=0) > 255 else rgb).astype(np.uint8)
        local = (xyz - self.origin).astype(self.xyz.array.dtype)
        return PointCloud(origin=self.origin, xyz=local, rgb=rgb)  # type: ignore[arg-type]

    def _eight_bits(self, rgb: NDArray[np.uint8] | NDArray[np.uint16]) -> NDArray[np.uint8]:
        """Return colours as 0 to 255, whichever bits of the 16 the file's writer used."""
        if rgb.dtype == np.uint8:
            return rgb.astype(np.uint8, copy=False)
        if not self.has_wide_colours and rgb.max(initial=0) > 255:
            self.has_wide_colours = True
            if self.rgb is not None:  # None of this file's colours so far reached the high bits.
                self.rgb.array[self.file_start : self.n_points] = 0
        if not self.has_wide_colours:
            return rgb.astype(np.uint8)
        return (rgb >> 8).astype(np.uint8)

    def part(self, start: int, n_points: int) -> PointCloud:
        """Return about so many of the points from `start` on, copied."""
        assert self.origin is not None
        rows = slice(start, self.n_points, max(1, (self.n_points - start) // n_points))
        return PointCloud(
            origin=self.origin,
            xyz=self.xyz.array[rows].copy(),  # type: ignore[arg-type]
            rgb=None if self.rgb is None else self.rgb.array[rows].copy(),  # type: ignore[arg-type]
        )

    def finish(self, source: Path) -> PointCloud:
        """Return the cloud; nothing can be added after that."""
        assert self.origin is not None
        stations = np.concatenate(self.stations) - self.origin
        self.xyz.resize(self.n_points)
        for column in (self.intensity, self.rgb, self.classification):
            if column is not None:
                column.resize(self.n_points)
        return PointCloud(
            origin=self.origin,
            xyz=self.xyz.array,  # type: ignore[arg-type]
            intensity=self.intensity and self.intensity.array,  # type: ignore[arg-type]
            rgb=self.rgb and self.rgb.array,  # type: ignore[arg-type]
            classification=self.classification and self.classification.array,  # type: ignore[arg-type]
            stations=stations[np.isfinite(stations).all(axis=1)],
            crs=self.crs,
            source=source,
        )
