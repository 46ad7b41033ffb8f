"""Writing clouds as E57, by libE57: a scan for each station, in its scanner's frame."""

import errno
import uuid
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipecore.io.placing import Place
from pipecore.io.source import CHUNK_POINTS
from pipecore.io.storage import KEY, Column, columns_of, describe, own_name
from pipecore.notes import Note
from pipecore.progress import Progress
from pipecore.types import Array, PointCloud

NAMESPACE = "urn:pipegui:fields"
_AXES = ("cartesianX", "cartesianY", "cartesianZ")
_COLOURS = ("colorRed", "colorGreen", "colorBlue")
_STANDARD = {
    *("rowIndex", "columnIndex", "returnIndex", "returnCount"),
    *("timeStamp", "isTimeStampInvalid", "isIntensityInvalid", "isColorInvalid"),
}
"""Fields that the format itself has; others are those of an extension."""
POSITION_STEP = 2.0**-20
"""Positions of scanners are rounded to this, a micrometre, so that taking them off and adding
them again changes no bit of a coordinate."""


def write_scans(
    path: Path, cloud: PointCloud, place: Place, progress: Progress
) -> tuple[Note, ...]:
    """Write a cloud into a file.

    Parameters
    ----------
    path : Path
    cloud : PointCloud
    place : Place
        Unit and steps of the coordinates in the cloud's own file; E57 is in metres.
    progress : Progress
        Told about the stage "writing"; may cancel.

    Returns
    -------
    tuple of Note
        What E57 cannot hold.
    """
    from pye57 import libe57  # noqa: PLC0415

    path.touch()  # for an error of the operating system's own, if there is one
    image = libe57.ImageFile(str(path), "w")
    try:
        _write_root(libe57, image, cloud, place, progress)
        image.close()
    except libe57.E57Exception as error:
        raise OSError(errno.EIO, str(error).partition("\n")[0]) from error
    finally:
        if image.isOpen():
            image.cancel()
    return ()


def _write_root(
    libe57: Any, image: Any, cloud: PointCloud, place: Place, progress: Progress
) -> None:
    columns = columns_of(cloud, ("classification", "station"))
    image.extensionsAdd("", libe57.E57_V1_0_URI)
    image.extensionsAdd(KEY, NAMESPACE)
    root = image.root()
    for name, text in (
        ("formatName", "ASTM E57 3D Imaging Data File"),
        ("guid", f"{{{uuid.uuid4()}}}"),
        ("e57LibraryVersion", "PipeGUI"),
        ("coordinateMetadata", cloud.crs_wkt or cloud.crs),
        (f"{KEY}:description", describe(cloud, columns, place.unit, place.storage)),
    ):
        root.set(name, libe57.StringNode(image, text))
    root.set("versionMajor", libe57.IntegerNode(image, 1))
    root.set("versionMinor", libe57.IntegerNode(image, 0))
    data = libe57.VectorNode(image, True)
    root.set("data3D", data)
    done = 0
    for name, position, rows in _scans(cloud):
        scan = _Scan(libe57, image, cloud, place, columns, position)
        data.append(scan.node(name, rows))
        for start in range(0, len(rows), CHUNK_POINTS):
            progress.update("writing", (done + start) / max(len(cloud), 1))
            scan.write(rows[start : start + CHUNK_POINTS])
        scan.close()
        done += len(rows)
    progress.update("writing", 1.0)


def _is_one_scan(cloud: PointCloud) -> bool:
    """Whether all points are written as one scan: they are of one, or in no order of stations.

    Points of stations whose positions are known are put in order.
    """
    if cloud.station is None:
        return True
    if np.isfinite(cloud.stations).all(axis=1).any():
        return False
    return bool((cloud.station[1:] < cloud.station[:-1]).any())


def _scans(cloud: PointCloud) -> Iterator[tuple[str, Array, NDArray[np.intp]]]:
    """Name, position (world coordinates; nan if not known) and points of each scan."""
    positions = cloud.stations + cloud.origin
    names = [own_name(name) for name in cloud.station_names]
    if _is_one_scan(cloud):
        is_known = len(positions) == 1
        position = positions[0] if is_known else np.full(3, np.nan)
        yield names[0] if len(names) == 1 else "scan", position, np.arange(len(cloud))
        return
    assert cloud.station is not None
    for i in range(int(cloud.station.max(initial=0)) + 1):
        rows = np.flatnonzero(cloud.station == i)
        if len(rows):
            has_name, has_place = 0 < i <= len(names), 0 < i <= len(positions)
            yield (
                names[i - 1] if has_name else f"scan {i}",
                positions[i - 1] if has_place else np.full(3, np.nan),
                rows,
            )


class _Scan:
    """A scan that is written."""

    def __init__(
        self,
        libe57: Any,
        image: Any,
        cloud: PointCloud,
        place: Place,
        columns: list[Column],
        position: Array,
    ) -> None:
        self._libe57, self._image, self._cloud, self._place = libe57, image, cloud, place
        self._is_posed = bool(np.isfinite(position).all())
        self._position = np.round(position / POSITION_STEP) * POSITION_STEP
        self._shift = self._position if self._is_posed else np.zeros(3)
        self._values: dict[str, NDArray[Any]] = {}
        if cloud.intensity is not None:
            self._values["intensity"] = cloud.intensity
        if cloud.rgb is not None:
            self._values |= {name: cloud.rgb[:, i] for i, name in enumerate(_COLOURS)}
        if cloud.classification is not None:
            self._values[f"{KEY}:classification"] = cloud.classification
        if cloud.station is not None and _is_one_scan(cloud):
            self._values[f"{KEY}:station"] = cloud.station
        for column in columns:
            is_standard = column.field in _STANDARD
            self._values[column.name if is_standard else f"{KEY}:{column.name}"] = column.values
        self._buffers: dict[str, NDArray[Any]] = {}
        self._writer: Any = None

    def node(self, name: str, rows: NDArray[np.intp]) -> Any:
        """The scan's node, before its points."""
        e57, image = self._libe57, self._image
        scan = e57.StructureNode(image)
        scan.set("guid", e57.StringNode(image, f"{{{uuid.uuid4()}}}"))
        scan.set("name", e57.StringNode(image, name))
        if self._is_posed:
            pose = e57.StructureNode(image)
            scan.set("pose", pose)
            pose.set("rotation", self._floats(dict(zip("wxyz", (1, 0, 0, 0), strict=True))))
            pose.set("translation", self._floats(dict(zip("xyz", self._position, strict=True))))
        if self._cloud.rgb is not None:
            limits = e57.StructureNode(image)
            for colour in _COLOURS:
                limits.set(f"{colour}Minimum", e57.IntegerNode(image, 0))
                limits.set(f"{colour}Maximum", e57.IntegerNode(image, 255))
            scan.set("colorLimits", limits)
        if self._cloud.intensity is not None and len(self._cloud):
            low, high = np.nanmin(self._cloud.intensity), np.nanmax(self._cloud.intensity)
            if np.isfinite([low, high]).all():
                limits = {"intensityMinimum": low, "intensityMaximum": high}
                scan.set("intensityLimits", self._floats(limits))
        bounds = self._bounds(rows)
        if np.isfinite(bounds).all():
            names = [f"{axis}{end}" for end in ("Minimum", "Maximum") for axis in "xyz"]
            limits = dict(zip(names, bounds.ravel(), strict=True))
            scan.set("cartesianBounds", self._floats(limits))
        self._points(scan)
        return scan

    def _bounds(self, rows: NDArray[np.intp]) -> Array:
        """Lowest and highest coordinates in the scanner's frame, shape (2, 3)."""
        low, high = np.full(3, np.inf), np.full(3, -np.inf)
        for start in range(0, len(rows), CHUNK_POINTS):
            xyz = self._xyz(rows[start : start + CHUNK_POINTS])
            low, high = np.minimum(low, xyz.min(axis=0)), np.maximum(high, xyz.max(axis=0))
        return np.array([low, high])

    def _xyz(self, rows: NDArray[np.intp]) -> Array:
        """Coordinates of some points in the scanner's frame, metres."""
        # Rows are ascending: a slice of the cloud holds them, often nothing else.
        span = slice(int(rows[0]), int(rows[-1]) + 1)
        xyz = self._place.coordinates(self._cloud, span) * self._place.unit.factors
        return np.asarray(xyz[rows - span.start] - self._shift)

    def _points(self, scan: Any) -> None:
        e57, image = self._libe57, self._image
        prototype, buffers = e57.StructureNode(image), e57.VectorSourceDestBuffer()
        for axis in _AXES:
            prototype.set(axis, e57.FloatNode(image))
            self._buffers[axis] = np.empty(CHUNK_POINTS)
        for name, values in self._values.items():
            node, kind = self._node_of(values)
            prototype.set(name, node)
            self._buffers[name] = np.empty(CHUNK_POINTS, kind)
        for name, array in self._buffers.items():
            buffers.append(e57.SourceDestBuffer(image, name, array, CHUNK_POINTS, True, True))
        points = e57.CompressedVectorNode(image, prototype, e57.VectorNode(image, True))
        scan.set("points", points)
        self._keep = points, buffers

    def _node_of(self, values: NDArray[Any]) -> tuple[Any, type]:
        e57, image = self._libe57, self._image
        # libE57 takes what NumPy calls int64 on Linux for 32 bits.
        if values.dtype.kind in "iub":
            low, high = int(values.min(initial=0)), int(values.max(initial=0))
            if high < 2**63:
                return e57.IntegerNode(image, 0, low, max(high, low + 1)), np.longlong
        if values.dtype.itemsize <= 4:
            return e57.FloatNode(image, 0.0, e57.FloatPrecision.E57_SINGLE), np.float32
        return e57.FloatNode(image), np.float64

    def _floats(self, values: dict[str, Any]) -> Any:
        node = self._libe57.StructureNode(self._image)
        for name, value in values.items():
            node.set(name, self._libe57.FloatNode(self._image, float(value)))
        return node

    def write(self, rows: NDArray[np.intp]) -> None:
        """Write some points."""
        if self._writer is None:
            points, buffers = self._keep
            self._writer = points.writer(buffers)
        n = len(rows)
        xyz = self._xyz(rows)
        for i, axis in enumerate(_AXES):
            self._buffers[axis][:n] = xyz[:, i]
        for name, values in self._values.items():
            self._buffers[name][:n] = values[rows]
        self._writer.write(n)

    def close(self) -> None:
        """End the scan."""
        if self._writer is not None:
            self._writer.close()
