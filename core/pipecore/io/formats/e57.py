"""E57, by libE57 through pye57: all scans of a file, each in its pose."""

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from pipecore.io.crs import NO_SYSTEM, ReferenceSystem, from_wkt
from pipecore.io.left_out import NO_RETURN
from pipecore.io.source import (
    CHUNK_POINTS,
    DEFAULT,
    Chunk,
    OpenOptions,
    ScanInfo,
    Source,
    damaged,
    raise_read_errors,
)
from pipecore.io.storage import KEY, Extras, parse_extras
from pipecore.notes import Note
from pipecore.types import Array

_CARTESIAN = ("cartesianX", "cartesianY", "cartesianZ")
_SPHERICAL = ("sphericalRange", "sphericalAzimuth", "sphericalElevation")
_INVALID = {_CARTESIAN: "cartesianInvalidState", _SPHERICAL: "sphericalInvalidState"}
_COLOURS = ("Red", "Green", "Blue")
_CLASSES, _STATION = f"{KEY}:classification", f"{KEY}:station"
"""Of files that this program has written; stations are numbered from 1 on."""


@dataclass(frozen=True, eq=False)
class _Scan:
    """One scan: its points' node, and what its header says."""

    points: Any
    name: str
    fields: tuple[str, ...]
    coordinates: tuple[str, str, str]
    rotation: Array
    translation: Array
    position: Array
    """Of the scanner; nan where it is not known."""
    colour_limits: Array
    kinds: dict[str, np.dtype[Any]]
    """Of values that are kept as they are: the narrowest that hold what the header allows."""

    @property
    def n_points(self) -> int:
        return int(self.points.childCount())


@contextmanager
def open_source(path: Path, options: OpenOptions = DEFAULT) -> Iterator[Source]:
    """Open an E57 file; see `pipecore.io.registry.Format.open`."""
    with raise_read_errors(path, "E57"):
        # Not pye57.E57: on an error its constructor may delete the file.
        from pye57 import libe57  # noqa: PLC0415

        image = libe57.ImageFile(str(path), "r")
    try:
        with raise_read_errors(path, "E57"):
            root = image.root()
            notes: list[Note] = []
            left_out: Counter[str] = Counter()
            scans = _scans(root, path, notes)
            n_points = sum(scan.n_points for scan in scans)
            # No scan stores a point in less than a bit.
            if n_points > 8 * path.stat().st_size:
                raise damaged(path, "E57", f"it cannot hold the {n_points:,} points it announces")
            extras = _extras(image)
            system = NO_SYSTEM
            if root.isDefined("coordinateMetadata"):
                system = _in_metres(from_wkt(root["coordinateMetadata"].value()), path, notes)
            if extras is not None:
                system = replace(system, name=extras.system.name)
        yield Source(
            chunks=_chunks(libe57, image, scans, path, options, left_out, extras),
            fields=tuple(dict.fromkeys(name for scan in scans for name in scan.fields)),
            n_points=n_points,
            system=system,
            scans=_stations(scans, extras),
            storage=None if extras is None else extras.storage,
            field_infos=extras.infos() if extras is not None else {},
            notes=notes,
            left_out=left_out,
        )
    finally:
        image.close()


def _extras(image: Any) -> Extras | None:
    """What this program has written besides the points."""
    # To ask for an extension that the file does not have is an error to libE57.
    extensions = [image.extensionsPrefix(i) for i in range(image.extensionsCount())]
    place = f"{KEY}:description"
    if KEY not in extensions or not image.root().isDefined(place):
        return None
    return parse_extras(image.root()[place].value())


def _stations(scans: list[_Scan], extras: Extras | None) -> list[ScanInfo]:
    """The scans, or the stations of points that are all in one scan."""
    if extras is not None and len(scans) == 1 and _STATION in scans[0].fields:
        return extras.scans
    return [ScanInfo(scan.name, scan.position) for scan in scans]


def _scans(root: Any, path: Path, notes: list[Note]) -> list[_Scan]:
    """All scans that hold points; the others are noted."""
    if not root.isDefined("data3D"):
        raise damaged(path, "E57", "it holds no scans, perhaps only pictures")
    data = root["data3D"]
    scans: list[_Scan] = []
    for i in range(len(data)):
        node = data[i]
        name = node["name"].value() if node.isDefined("name") else ""
        if not node.isDefined("points") or node["points"].childCount() == 0:
            notes.append(
                Note(
                    "Scan {number} of “{name}” holds no points; the others were read.",
                    number=i + 1,
                    name=path.name,
                )
            )
            continue
        scans.append(_scan(node, path, name or f"scan {i + 1}"))
    return scans


def _in_metres(system: ReferenceSystem, path: Path, notes: list[Note]) -> ReferenceSystem:
    """The system with metres, in which all E57 are, whatever the system's own unit."""
    if system.plan is not None and abs(system.plan[1] - 1) > 1e-9:
        notes.append(
            Note(
                "“{name}” names a reference system in {unit}; as in every E57 file, its "
                "coordinates are taken as metres.",
                name=path.name,
                unit=system.plan[0],
            )
        )
    return replace(system, plan=("m", 1.0), height=("m", 1.0))


def _scan(node: Any, path: Path, name: str) -> _Scan:
    from pye57 import libe57  # noqa: PLC0415

    points = node["points"]
    if points.childCount() < 0:
        raise damaged(path, "E57", "it announces less than no points")
    prototype = libe57.StructureNode(points.prototype())
    fields = tuple(prototype.get(i).elementName() for i in range(prototype.childCount()))
    for coordinates in (_CARTESIAN, _SPHERICAL):
        if set(coordinates) <= set(fields):
            break
    else:
        raise damaged(path, "E57", "a scan has neither Cartesian nor spherical coordinates")
    rotation, translation = _pose(node)
    is_posed = node.isDefined("pose") or coordinates is _SPHERICAL
    return _Scan(
        points,
        name,
        fields,
        coordinates,
        rotation,
        translation,
        translation if is_posed else np.full(3, np.nan),
        np.array([_colour_limits(node, prototype, f"color{c}") for c in _COLOURS]),
        {name: kind for name in fields if (kind := _kind_of(libe57, prototype[name])) is not None},
    )


def _kind_of(libe57: Any, node: Any) -> np.dtype[Any] | None:
    """The narrowest kind of number that holds what a value may be; None for text."""
    if isinstance(node, libe57.IntegerNode):
        low, high = node.minimum(), node.maximum()
        if low < 0:
            return np.promote_types(np.min_scalar_type(low), np.min_scalar_type(-high - 1))
        return np.min_scalar_type(high)
    if isinstance(node, libe57.FloatNode):
        is_single = node.precision() == libe57.FloatPrecision.E57_SINGLE
        return np.dtype(np.float32 if is_single else np.float64)
    return np.dtype(np.float64) if isinstance(node, libe57.ScaledIntegerNode) else None


def _pose(node: Any) -> tuple[Array, Array]:
    """Return the rotation matrix and translation from a scan's frame to the file's."""
    rotation, translation = np.eye(3), np.zeros(3)
    if node.isDefined("pose/rotation"):
        quaternion = np.array([node[f"pose/rotation/{k}"].value() for k in "xyzw"])
        if quaternion.any():  # Four zeros stand for "none" in some files.
            rotation = Rotation.from_quat(quaternion).as_matrix()
    if node.isDefined("pose/translation"):
        translation = np.array([node[f"pose/translation/{k}"].value() for k in "xyz"])
    return rotation, translation


def _colour_limits(node: Any, prototype: Any, name: str) -> tuple[float, float]:
    """Return the values that stand for none and all of a colour."""
    if not prototype.isDefined(name):
        return 0.0, 255.0
    place = f"colorLimits/{name}"
    if node.isDefined(f"{place}Minimum") and node.isDefined(f"{place}Maximum"):
        low = float(node[f"{place}Minimum"].value())
        high = float(node[f"{place}Maximum"].value())
    else:
        kind = prototype[name]
        is_scaled = hasattr(kind, "scaledMinimum")
        low = float(kind.scaledMinimum() if is_scaled else kind.minimum())
        high = float(kind.scaledMaximum() if is_scaled else kind.maximum())
    return (low, high) if np.isfinite(high - low) and 0 < high - low < 2**32 else (0.0, 255.0)


def _chunks(
    libe57: Any,
    image: Any,
    scans: list[_Scan],
    path: Path,
    options: OpenOptions,
    left_out: Counter[str],
    extras: Extras | None,
) -> Iterator[Chunk]:
    with raise_read_errors(path, "E57"):
        n_total = sum(scan.n_points for scan in scans)
        n_before = 0
        for number, scan in enumerate(scans):
            more = _more_fields(scan) if options.has_fields else ()
            for values, n_read in _values(libe57, image, scan, more):
                with np.errstate(over="ignore", invalid="ignore"):
                    chunk = _chunk(scan, values, (n_before + n_read) / n_total)
                left_out[NO_RETURN] += len(next(iter(values.values()))) - len(chunk)
                if extras is not None and chunk.fields:
                    own = {k.removeprefix(f"{KEY}:"): v for k, v in chunk.fields.items()}
                    chunk = replace(chunk, fields=extras.joined(own))
                yield chunk if chunk.station is not None else replace(chunk, station=number)
            n_before += scan.n_points


def _wanted(scan: _Scan) -> list[str]:
    """What a cloud has arrays of its own for."""
    names = [*scan.coordinates, _INVALID[scan.coordinates], "intensity", _CLASSES, _STATION]
    names += [f"color{c}" for c in _COLOURS]
    return [name for name in names if name in scan.fields]


def _more_fields(scan: _Scan) -> tuple[str, ...]:
    """The other values; what is text cannot be read as a number."""
    from pye57 import libe57  # noqa: PLC0415

    wanted = _wanted(scan)
    prototype = libe57.StructureNode(scan.points.prototype())
    return tuple(
        name
        for name in scan.fields
        if name not in wanted and not isinstance(prototype.get(name), libe57.StringNode)
    )


def _values(
    libe57: Any, image: Any, scan: _Scan, more: tuple[str, ...]
) -> Iterator[tuple[dict[str, NDArray[Any]], int]]:
    """Yield the wanted values of a scan by their names, and how many are read with them."""
    wanted = _wanted(scan)
    buffers = libe57.VectorSourceDestBuffer()
    size = min(CHUNK_POINTS, scan.n_points)
    arrays = {name: np.empty(size) for name in wanted}
    arrays |= {name: np.empty(size, _buffer_kind(libe57, scan, name)) for name in more}
    for name, array in arrays.items():
        buffers.append(libe57.SourceDestBuffer(image, name, array, size, True, True))
    reader = scan.points.reader(buffers)
    try:
        n_read = 0
        while n := reader.read():
            n_read += n
            yield {name: array[:n] for name, array in arrays.items()}, n_read
    finally:
        reader.close()


def _buffer_kind(libe57: Any, scan: _Scan, name: str) -> type:
    """As what values that a cloud has no array of its own for are read: whole, or not."""
    node = libe57.StructureNode(scan.points.prototype())[name]
    return np.longlong if isinstance(node, libe57.IntegerNode) else np.float64


def _chunk(scan: _Scan, values: dict[str, NDArray[Any]], fraction: float) -> Chunk:
    invalid = values.get(_INVALID[scan.coordinates])
    if invalid is not None:
        # 1 means that only the direction is known, 2 not even that.
        values = {name: array[invalid == 0] for name, array in values.items()}
    a, b, c = (values[name] for name in scan.coordinates)
    if scan.coordinates is _SPHERICAL:
        level = a * np.cos(c)
        a, b, c = level * np.cos(b), level * np.sin(b), a * np.sin(c)
    xyz = np.stack([a, b, c], axis=1)
    xyz = xyz @ scan.rotation.T + scan.translation
    intensity = rgb = None
    if "intensity" in values:
        intensity = values["intensity"].astype(np.float32)
    if all(f"color{c}" in values for c in _COLOURS):
        low, high = scan.colour_limits.T
        colours = np.stack([values[f"color{c}"] for c in _COLOURS], axis=1)
        shares = np.clip(np.nan_to_num((colours - low) / (high - low)), 0.0, 1.0)
        rgb = np.round(shares * 255).astype(np.uint8)
    classes = values[_CLASSES].astype(np.uint8) if _CLASSES in values else None
    taken = _wanted(scan)
    # Copies: the buffers are filled anew for the next points.
    fields = {
        name: array.astype(scan.kinds.get(name, array.dtype))
        for name, array in values.items()
        if name not in taken
    }
    station = values[_STATION].astype(np.int64) - 1 if _STATION in values else None
    return Chunk(xyz, fraction, intensity, rgb, classes, station, fields)
