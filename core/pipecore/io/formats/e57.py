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
from pipecore.notes import Note
from pipecore.types import Array

_CARTESIAN = ("cartesianX", "cartesianY", "cartesianZ")
_SPHERICAL = ("sphericalRange", "sphericalAzimuth", "sphericalElevation")
_INVALID = {_CARTESIAN: "cartesianInvalidState", _SPHERICAL: "sphericalInvalidState"}
_COLOURS = ("Red", "Green", "Blue")


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
            system = NO_SYSTEM
            if root.isDefined("coordinateMetadata"):
                system = _in_metres(from_wkt(root["coordinateMetadata"].value()), path, notes)
        yield Source(
            chunks=_chunks(libe57, image, scans, path, options, left_out),
            fields=tuple(dict.fromkeys(name for scan in scans for name in scan.fields)),
            n_points=n_points,
            system=system,
            scans=[ScanInfo(scan.name, scan.position) for scan in scans],
            notes=notes,
            left_out=left_out,
        )
    finally:
        image.close()


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
    )


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
                yield replace(chunk, station=number)
            n_before += scan.n_points


def _wanted(scan: _Scan) -> list[str]:
    """What a cloud has arrays of its own for."""
    names = [*scan.coordinates, _INVALID[scan.coordinates], "intensity"]
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
) -> Iterator[tuple[dict[str, NDArray[np.float64]], int]]:
    """Yield the wanted values of a scan by their names, and how many are read with them."""
    names = [*_wanted(scan), *more]
    buffers = libe57.VectorSourceDestBuffer()
    size = min(CHUNK_POINTS, scan.n_points)
    arrays = {name: np.empty(size) for name in names}
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


def _chunk(scan: _Scan, values: dict[str, NDArray[np.float64]], fraction: float) -> Chunk:
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
    taken = _wanted(scan)
    # Copies: the buffers are filled anew for the next points.
    fields = {name: array.copy() for name, array in values.items() if name not in taken}
    return Chunk(xyz, fraction, intensity, rgb, fields=fields)
