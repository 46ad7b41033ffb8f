"""How files keep what a cloud came from, and what formats are told of it besides the points.

PLY and E57 have no place for the steps of LAS, for stations or for the scale of a field. They
are told in one line of JSON, which other programs pass over and `parse_extras` reads again.
"""

import base64
import json
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipecore.io.crs import ReferenceSystem, from_wkt
from pipecore.io.source import FieldInfo, ScanInfo
from pipecore.types import Array, Field, PointCloud, Storage
from pipecore.units import FileUnit, is_unit

KEY = "pipegui"


def common_storage(
    storages: Sequence[Storage | None], unit: FileUnit, crs_from: int = 0
) -> Storage | None:
    """Return how files keep coordinates, if all do so in the same steps; else None.

    Parameters
    ----------
    storages : sequence of Storage or None
        Of each file.
    unit : FileUnit
        That in which the files were taken.
    crs_from : int
        Place of the file that names the reference system.
    """
    known = [s for s in storages if s is not None]
    if not known or len(known) < len(storages):
        return None
    first = known[0]
    for other in known[1:]:
        if not np.array_equal(first.steps, other.steps):
            return None
        shift = (other.offsets - first.offsets) / first.steps
        if np.abs(shift - np.round(shift)).max() > 1e-3:
            return None
    return replace(
        first,
        unit=first.unit or unit,
        projection=known[crs_from].projection,
        guid=first.guid if all(s.guid == first.guid for s in known) else "",
    )


@dataclass(frozen=True, eq=False)
class Column:
    """One value of each point as a format holds it: a field, or one of several in a field.

    Parameters
    ----------
    name : str
        Safe in any format: letters, digits and “_”.
    values : ndarray
        Shape (n,).
    field : str
        The name of the field.
    part, n_parts : int
        Which of the field's values; 0 of 1 for a field of one.
    """

    name: str
    values: NDArray[Any]
    field: str
    part: int = 0
    n_parts: int = 1


def columns_of(
    cloud: PointCloud, reserved: Sequence[str], rename: Callable[[str], str] = str
) -> list[Column]:
    """Return the fields of a cloud as columns of one value, by names that a format can hold.

    Parameters
    ----------
    cloud : PointCloud
    reserved : sequence of str
        Names that the format gives to other values.
    rename : callable
        Gives what the format calls a field of some name.
    """
    taken = {name.casefold() for name in reserved}
    columns = []
    for name, field in cloud.fields.items():
        if is_colour_again(cloud, name):
            continue
        n = 1 if field.values.ndim == 1 else field.values.shape[1]
        parts = field.values.reshape(len(field.values), n)
        for i in range(n):
            plain = safe_name(rename(f"{name}_{i}" if n > 1 else name), taken)
            columns.append(Column(plain, parts[:, i], name, i, n))
    return columns


def is_colour_again(cloud: PointCloud, name: str) -> bool:
    """Whether a field is a colour of 16 bits that says no more than the cloud's of 8."""
    colours = ("red", "green", "blue")
    if name not in colours or cloud.rgb is None:
        return False
    values, eight = cloud.fields[name].values, cloud.rgb[:, colours.index(name)]
    return bool(np.array_equal(values, eight.astype(np.uint16) * 257))


def safe_name(name: str, taken: set[str], longest: int = 100) -> str:
    """Return a name of letters, digits and “_” that is not taken yet, and take it."""
    plain = re.sub(r"[^A-Za-z0-9_]", "_", name)[:longest] or "value"
    plain = plain if plain[0].isalpha() else f"f_{plain}"[:longest]
    unique, k = plain, 1
    while unique.casefold() in taken:
        k += 1
        unique = f"{plain[: longest - 1 - len(str(k))]}_{k}"
    taken.add(unique.casefold())
    return unique


def describe(
    cloud: PointCloud, columns: Sequence[Column], unit: FileUnit, storage: Storage | None
) -> str:
    """Return what a file has no other place for, as one line of JSON.

    Parameters
    ----------
    cloud : PointCloud
    columns : sequence of Column
        As they are written.
    unit : FileUnit
        Of the coordinates written.
    storage : Storage, optional
        How the cloud's own file keeps coordinates.
    """
    stations = zip(cloud.station_names, cloud.stations + cloud.origin, strict=False)
    told: dict[str, Any] = {
        "crs": cloud.crs,
        "wkt": cloud.crs_wkt,
        "unit": _unit_row(unit),
        "stations": [
            [own_name(name), place.tolist() if np.isfinite(place).all() else None]
            for name, place in stations
        ],
        "fields": {c.name: _column_row(c, cloud.fields[c.field]) for c in columns},
    }
    if storage is not None:
        told["storage"] = {
            "steps": storage.steps.tolist(),
            "offsets": storage.offsets.tolist(),
            "unit": _unit_row(storage.unit or unit),
            "guid": storage.guid,
            "projection": [
                [number, base64.b64encode(data).decode()] for number, data in storage.projection
            ],
        }
    # No spaces: formats may take several for one.
    return json.dumps(told, separators=(",", ":")).replace(" ", "\\u0020")


def own_name(station: str) -> str:
    """Name of a station without that of the file it came from."""
    return station.partition(": ")[2] or station


def _unit_row(unit: FileUnit) -> list[Any]:
    return [unit.name, unit.metres, unit.height_name, unit.height_metres]


def _column_row(column: Column, field: Field) -> dict[str, Any]:
    row = {
        "name": column.field,
        "kind": column.values.dtype.newbyteorder("=").str[1:],
        "part": [column.part, column.n_parts],
        "scale": field.scale,
        "offset": field.offset,
        "no_data": field.no_data if field.no_data == field.no_data else "nan",
        "description": field.description,
    }
    plain = {"part": [0, 1], "scale": 1.0, "offset": 0.0, "no_data": None, "description": ""}
    return {k: v for k, v in row.items() if k not in plain or v != plain[k]}


@dataclass(frozen=True, eq=False)
class Extras:
    """What a file says besides its points; see `describe`.

    Parameters
    ----------
    system : ReferenceSystem
        With the unit of the coordinates.
    storage : Storage or None
    scans : list of ScanInfo
        The stations, by their ids from 1 on; positions in world coordinates, metres.
    fields : dict of str to dict
        What is said of each column, by its name.
    """

    system: ReferenceSystem
    storage: Storage | None
    scans: list[ScanInfo]
    fields: dict[str, dict[str, Any]]

    def infos(self) -> dict[str, FieldInfo]:
        """How fields are stored, by their names."""
        return {
            row["name"]: FieldInfo(
                float(row.get("scale", 1.0)),
                float(row.get("offset", 0.0)),
                None if row.get("no_data") is None else float(row["no_data"]),
                str(row.get("description", "")),
            )
            for row in self.fields.values()
        }

    def joined(self, columns: dict[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
        """Return fields, with the names and kinds they had, from columns by their names."""
        parts: dict[str, list[tuple[int, NDArray[Any]]]] = {}
        for name, column in columns.items():
            row = self.fields.get(name, {"name": name})
            part, n_parts = row.get("part", [0, 1])
            kind = np.dtype(row.get("kind", column.dtype))
            with np.errstate(invalid="ignore"):
                values = column.astype(kind, copy=False)
            parts.setdefault(row["name"], []).append((part if n_parts > 1 else -1, values))
        return {
            name: own[0][1]
            if own[0][0] < 0
            else np.stack([v for _, v in sorted(own, key=lambda p: p[0])], axis=1)
            for name, own in parts.items()
        }


def parse_extras(text: str) -> Extras | None:
    """Return what `describe` has said; None of a text that is no longer whole."""
    try:
        told = json.loads(text)
        unit = _unit(told["unit"])
        system = from_wkt(told["wkt"]) if told["wkt"] else ReferenceSystem()
        system = replace(
            system,
            name=str(told["crs"]),
            plan=None if system.is_geographic else (unit.name, float(unit.metres)),
            height=(unit.height_name, float(unit.height_metres)),
        )
        scans = [ScanInfo(str(name), _place(place)) for name, place in told["stations"]]
        fields = {
            str(name): dict(row, name=str(row["name"])) for name, row in told["fields"].items()
        }
        for row in fields.values():
            part, n_parts = row.get("part", [0, 1])
            if np.dtype(row["kind"]).kind not in "iufb" or not 0 <= part < n_parts:
                return None
        return Extras(system, _storage(told.get("storage")), scans, fields)
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError):
        return None


def _place(place: list[float] | None) -> Array:
    return np.full(3, np.nan) if place is None else np.array(place, np.float64).reshape(3)


def _unit(row: list[Any]) -> FileUnit:
    name, metres, height_name, height_metres = row
    if not (is_unit(metres) and is_unit(height_metres)):
        raise ValueError("no unit of length")
    return FileUnit(str(name), float(metres), str(height_name), float(height_metres))


def _storage(told: dict[str, Any] | None) -> Storage | None:
    if told is None:
        return None
    steps = np.array(told["steps"], np.float64).reshape(3)
    offsets = np.array(told["offsets"], np.float64).reshape(3)
    if not (np.isfinite([steps, offsets]).all() and (steps > 0).all()):
        raise ValueError("no steps")
    return Storage(
        steps,
        offsets,
        tuple((int(number), base64.b64decode(data)) for number, data in told["projection"]),
        str(told["guid"]),
        _unit(told["unit"]),
    )
