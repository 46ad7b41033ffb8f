"""Writing LAS and LAZ, by laspy and lazrs."""

import uuid
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from pipecore.io.crs import from_wkt
from pipecore.io.formats.las import ORIGINAL_INTENSITY
from pipecore.io.placing import Place
from pipecore.io.source import CHUNK_POINTS
from pipecore.io.storage import safe_name
from pipecore.notes import Note
from pipecore.progress import Progress, in_chunks
from pipecore.types import Array, Field, PointCloud

if TYPE_CHECKING:
    import laspy

POINTS_AT_A_TIME = 600_000
"""A dozen of LAZ's own chunks of 50,000, so that threads that compress them end together."""
FILLED_AT_ONCE = 40_000
"""Their values are put together for so many at once, which stay in a processor's own memory."""
MOST_STEPS = 2**31 - 2
"""Coordinates are 32-bit numbers of steps; the largest stands for what is beyond them."""
LONGEST_RECORD, LONGEST_NAME = 65_535, 32
_WKT = 2112
_HELD_ELSEWHERE = {"X", "Y", "Z", "intensity", "classification"}
_OF_OLD, _OF_NEW = {"scan_angle_rank"}, {"scan_angle", "overlap", "scanner_channel", "nir"}
_COLOURS = ("red", "green", "blue")
MOST_OLD_CLASSES = 31


@dataclass(frozen=True, eq=False)
class Extra:
    """More values of each point, and how to write them.

    Parameters
    ----------
    values : mapping of str to ndarray
        Integer, boolean or floating, shape (n,), by names of up to 32 characters.
    factors : mapping of str to float
        What some of them are multiplied by.
    kinds : mapping of str to dtype
        As what some of them are written, where that is not what they are.
    """

    values: Mapping[str, NDArray[Any]]
    factors: Mapping[str, float]
    kinds: Mapping[str, DTypeLike]

    def rows(self, name: str, rows: slice) -> NDArray[Any]:
        """Some of the values, multiplied."""
        own = self.values[name][rows]
        factor = self.factors.get(name)
        return _storable(own if factor is None else factor * own)

    def kind(self, name: str) -> np.dtype[Any]:
        """As what values are written."""
        return np.dtype(self.kinds.get(name, _storable(self.values[name][:0]).dtype))


NO_EXTRA = Extra({}, {}, {})


@dataclass(frozen=True, eq=False)
class _Layout:
    """Which values go where: into LAS's own, by name, or into extra bytes."""

    point_format: int
    own: dict[str, NDArray[Any]]
    extra: dict[str, Field]


def write_las(
    path: Path,
    cloud: PointCloud,
    place: Place,
    extra: Extra,
    progress: Progress,
    *,
    is_packed: bool = True,
) -> tuple[Note, ...]:
    """Write a cloud into a file.

    Parameters
    ----------
    path : Path
    cloud : PointCloud
    place : Place
        Unit and steps of the coordinates.
    extra : Extra
    progress : Progress
        Told about the stage "writing"; may cancel.
    is_packed : bool
        Whether to write LAZ.

    Returns
    -------
    tuple of Note
        What LAS cannot hold.
    """
    import laspy  # noqa: PLC0415

    layout = _layout_of(cloud, extra)
    steps, offsets = _steps_and_offsets(cloud, place)
    header = _header(cloud, place, layout, extra)
    header.scales, header.offsets = steps, offsets
    intensity = _LasIntensity(cloud)
    has_original = intensity.is_changed
    if has_original:
        header.add_extra_dims([laspy.ExtraBytesParams(ORIGINAL_INTENSITY, np.dtype("f4"))])
    colours = [layout.own.pop(name, None) if cloud.rgb is not None else None for name in _COLOURS]
    with (
        path.open("wb") as file,
        laspy.LasWriter(file, header, do_compress=is_packed, closefd=False) as writer,
    ):
        size = min(len(cloud), POINTS_AT_A_TIME)
        records = laspy.ScaleAwarePointRecord.zeros(size, header=header)
        for start, stop in in_chunks(len(cloud), POINTS_AT_A_TIME, "writing", progress):
            for first in range(start, stop, FILLED_AT_ONCE):
                rows = slice(first, min(first + FILLED_AT_ONCE, stop))
                points = records[first - start : rows.stop - start]
                counted = np.round((place.coordinates(cloud, rows) - offsets) / steps)
                for axis, name in enumerate("XYZ"):
                    points[name] = counted[:, axis].astype(np.int32)
                if cloud.intensity is not None:
                    points["intensity"] = intensity.stretched(cloud.intensity[rows])
                    if has_original:
                        points[ORIGINAL_INTENSITY] = cloud.intensity[rows]
                if cloud.rgb is not None:
                    for i, (name, own) in enumerate(zip(_COLOURS, colours, strict=True)):
                        points[name] = (
                            cloud.rgb[rows, i].astype(np.uint16) * 257 if own is None else own[rows]
                        )
                if cloud.classification is not None:
                    points["classification"] = cloud.classification[rows]
                for name, values in layout.own.items():
                    points[name] = values[rows]
                for name, field in layout.extra.items():
                    points.array[name] = field.values[rows]
                for name in extra.values:
                    points[name] = extra.rows(name, rows)
            writer.write_points(records[: stop - start])
    return _notes(path, cloud, place, steps)


def _layout_of(cloud: PointCloud, extra: Extra) -> _Layout:
    fields = {name: f for name, f in cloud.fields.items() if name not in extra.values}
    point_format = _point_format(cloud, fields)
    own: dict[str, NDArray[Any]] = {}
    more: dict[str, Field] = {}
    import laspy  # noqa: PLC0415

    of_las = {d.name: d for d in laspy.PointFormat(point_format).dimensions}
    taken = {name.casefold() for f in range(11) for name in laspy.PointFormat(f).dimension_names}
    taken |= {"x", "y", "z", ORIGINAL_INTENSITY, *(name.casefold() for name in extra.values)}
    if cloud.station is not None:
        own["point_source_id"] = cloud.station
    for name, field in fields.items():
        values = field.values
        if name == "point_source_id" and cloud.station is not None:
            if _tells_the_same(values, cloud.station):
                own[name] = values
                continue
            if not values.any():
                continue
        elif name in of_las and name not in _HELD_ELSEWHERE and _fits(values, of_las[name]):
            own[name] = values
            continue
        for key, part in _as_extra_bytes(name, field).items():
            more[_extra_name(key, taken)] = part
    return _Layout(point_format, own, more)


def _point_format(cloud: PointCloud, fields: Mapping[str, Field]) -> int:
    """The point format from which the fields come, or the simplest that holds them."""
    classes = 0 if cloud.classification is None else int(cloud.classification.max(initial=0))
    has_colours = cloud.rgb is not None
    if fields.keys() & _OF_OLD and not fields.keys() & _OF_NEW and classes <= MOST_OLD_CLASSES:
        return 2 * has_colours + ("gps_time" in fields)
    if has_colours and "nir" in fields:
        return 8
    return 7 if has_colours else 6


def _fits(values: NDArray[Any], dimension: "laspy.point.dims.DimensionInfo") -> bool:
    """Whether a value of LAS's own holds these without a change."""
    if values.ndim > 1 or dimension.num_elements > 1:
        return False
    if dimension.kind is dimension.kind.FloatingPoint:
        return np.can_cast(values.dtype, np.dtype("f8"))
    if values.dtype.kind == "f" and (values != np.trunc(values)).any():
        return False
    low, high = values.min(initial=0), values.max(initial=0)
    return bool(dimension.min <= low and high <= dimension.max)


def _tells_the_same(numbers: NDArray[Any], station: NDArray[np.uint16]) -> bool:
    """Whether a file's own numbers tell stations apart as the cloud does."""
    if numbers.dtype.kind not in "iu" or not len(numbers):
        return False
    if numbers.min() < 0 or numbers.max() > np.iinfo(np.uint16).max:
        return False
    pairs = np.unique(numbers.astype(np.int64) << 16 | station)
    return len(pairs) == len(np.unique(pairs >> 16)) == len(np.unique(pairs & 0xFFFF))


def _as_extra_bytes(name: str, field: Field) -> dict[str, Field]:
    """A field as extra bytes hold it: of kinds they have, and of up to three values."""
    values = _storable(field.values)
    n = 1 if values.ndim == 1 else values.shape[1]
    if n == 1:
        values = values.reshape(len(values))
    if n <= 3 or values.dtype == np.uint8:
        return {name: _with_values(field, values)}
    return {f"{name}_{i}": _with_values(field, values[:, i]) for i in range(n)}


def _with_values(field: Field, values: NDArray[Any]) -> Field:
    return Field(values, field.scale, field.offset, field.no_data, field.description)


def _extra_name(name: str, taken: set[str]) -> str:
    # NumPy lets no colons into buffers.
    is_plain = name.isascii() and name.isprintable() and ":" not in name
    if is_plain and 0 < len(name) <= LONGEST_NAME and name.casefold() not in taken:
        taken.add(name.casefold())
        return name
    return safe_name(name, taken, LONGEST_NAME)


def _storable(values: NDArray[Any]) -> NDArray[Any]:
    if values.dtype == np.bool_:
        return values.astype(np.uint8)
    return values.astype(np.float32) if values.dtype == np.float16 else values


def _header(cloud: PointCloud, place: Place, layout: _Layout, extra: Extra) -> "laspy.LasHeader":
    import laspy  # noqa: PLC0415

    records, is_new = _projection(cloud, place), layout.point_format >= 6
    has_wkt = any(number == _WKT for number, _ in records)
    header = laspy.LasHeader(
        version="1.4" if is_new or has_wkt else "1.2", point_format=layout.point_format
    )
    # Without any record too, the newer point formats ask for it.
    header.global_encoding.wkt = has_wkt or (is_new and not records)
    header.generating_software = "PipeGUI"
    header.system_identifier = "PipeGUI"
    if place.storage is not None and place.storage.guid:
        header.uuid = uuid.UUID(place.storage.guid)
    for number, data in records:
        header.vlrs.append(laspy.VLR("LASF_Projection", number, "", data))
    header.add_extra_dims(
        [
            *(_extra_bytes(name, field) for name, field in layout.extra.items()),
            *(laspy.ExtraBytesParams(name, extra.kind(name)) for name in extra.values),
        ]
    )
    return header


def _extra_bytes(name: str, field: Field) -> "laspy.ExtraBytesParams":
    import laspy  # noqa: PLC0415

    values = field.values
    n = 1 if values.ndim == 1 else values.shape[1]
    kind = values.dtype.newbyteorder("=")
    is_scaled = field.scale != 1.0 or field.offset != 0.0
    no_data = None
    if field.no_data is not None and n <= 3:
        whole = kind.kind in "iu" and np.isfinite(field.no_data)
        no_data = np.full(n, field.no_data, kind if whole else np.float64)
    return laspy.ExtraBytesParams(
        name,
        kind if n == 1 else np.dtype((kind, (n,))),
        description=field.description.encode("ascii", "replace").decode()[:LONGEST_NAME],
        offsets=np.full(n, field.offset) if is_scaled else None,
        scales=np.full(n, field.scale) if is_scaled else None,
        no_data=no_data,
    )


def _projection(cloud: PointCloud, place: Place) -> list[tuple[int, bytes]]:
    """Records that name the reference system, or at least the unit."""
    if place.storage is not None and place.storage.projection:
        records = list(place.storage.projection)
        return records if all(len(data) <= LONGEST_RECORD for _, data in records) else []
    unit = place.unit
    if cloud.crs_wkt:
        system = from_wkt(cloud.crs_wkt)
        agrees = system.plan is None or unit.is_of(system.plan, system.height or system.plan)
        data = cloud.crs_wkt.encode()
        if agrees and len(data) < LONGEST_RECORD:
            return [(_WKT, data + b"\0")]
    is_plain = unit.metres == unit.height_metres == 1.0
    if unit.metres != unit.height_metres or (is_plain and not cloud.crs):
        return []
    name = cloud.crs.replace('"', "'")
    return [(_WKT, f'LOCAL_CS["{name}",UNIT["{unit.name}",{unit.metres!r}]]'.encode() + b"\0")]


def _steps_and_offsets(cloud: PointCloud, place: Place) -> tuple[Array, Array]:
    """The place's steps, or as many times ten of them as 32 bits ask for."""
    steps, offsets = place.steps.copy(), place.offsets.copy()
    low, high = place.extremes(cloud)
    if not np.isfinite([low, high]).all():
        return steps, offsets
    for axis in range(3):
        middle = (low[axis] + high[axis]) / 2
        while max(high[axis] - offsets[axis], offsets[axis] - low[axis]) > MOST_STEPS * steps[axis]:
            if high[axis] - low[axis] > 1.99 * MOST_STEPS * steps[axis]:
                steps[axis] *= 10
            # A whole number of steps on: coordinates stay on the same ones.
            offsets[axis] += np.round((middle - offsets[axis]) / steps[axis]) * steps[axis]
    return steps, offsets


def _notes(path: Path, cloud: PointCloud, place: Place, steps: Array) -> tuple[Note, ...]:
    del cloud
    if not (steps > place.steps).any():
        return ()
    return (
        Note(
            "The cloud is too wide for LAS to keep coordinates as finely as they came: in “{name}” "
            "they are rounded to {step:.3g} mm.",
            name=path.name,
            step=1000 * float((steps * place.unit.factors).max()),
        ),
    )


def _has_fractions(values: NDArray[np.float32]) -> bool:
    return bool((values != np.trunc(values)).any())  # a tenth of the time of a remainder


class _LasIntensity:
    """Intensities as LAS holds them: 0 to 65,535."""

    def __init__(self, cloud: PointCloud) -> None:
        self.low, self.factor, self.is_changed = 0.0, 1.0, False
        values = cloud.intensity
        if values is None or not len(values):
            return
        low, high = float(np.nanmin(values)), float(np.nanmax(values))
        blocks = range(0, len(values), CHUNK_POINTS)
        if not (low >= 0 and high <= 65535) or any(
            _has_fractions(values[b : b + CHUNK_POINTS]) for b in blocks
        ):
            self.low, self.is_changed = low if np.isfinite(low) else 0.0, True
            self.factor = 65535 / (high - low) if high > low else 0.0

    def stretched(self, values: NDArray[np.float32]) -> NDArray[np.uint16]:
        scaled = np.nan_to_num((values.astype(np.float64) - self.low) * self.factor)
        return np.round(np.clip(scaled, 0, 65535)).astype(np.uint16)
