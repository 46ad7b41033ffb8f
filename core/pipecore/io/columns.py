"""Which column of a table holds which value of a point, and chunks made from them."""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipecore.errors import ReadError
from pipecore.io.source import Chunk

# In order of preference: a table may hold both “z” and “height”.
_NAMES = {
    "x": (
        *("x", "e", "east", "easting", "rechtswert", "point_x", "x_coord", "xcoord"),
        *("coord_x", "coordinate_x", "x_coordinate", "points:0", "points_0", "cartesianx"),
    ),
    "y": (
        *("y", "n", "north", "northing", "hochwert", "point_y", "y_coord", "ycoord"),
        *("coord_y", "coordinate_y", "y_coordinate", "points:1", "points_1", "cartesiany"),
    ),
    "z": (
        *("z", "h", "height", "elev", "elevation", "altitude", "höhe", "hoehe", "point_z"),
        *("z_coord", "zcoord", "coord_z", "coordinate_z", "z_coordinate", "points:2", "points_2"),
        "cartesianz",
    ),
    "intensity": ("intensity", "i", "int", "reflectance", "reflectivity", "remission"),
    "red": ("red", "r", "diffuse_red", "rf"),
    "green": ("green", "g", "diffuse_green", "gf"),
    "blue": ("blue", "b", "diffuse_blue", "bf"),
    "classification": ("classification", "class"),
    "station": (
        *("station", "station_id", "scan", "scan_id", "scanid", "pointsourceid"),
        *("point_source_id", "point source id", "scan index", "original cloud index"),
    ),
}
_COLOURS = ("red", "green", "blue")
SKIPPED = ("-", "_", "skip")

Values = NDArray[Any]


def find_columns(names: Sequence[str]) -> dict[str, int]:
    """Return the index of the column for each of x, y, z, intensity, red, … that is there.

    Colours are found only if all three are; units behind a name (“X [m]”) and
    CloudCompare's “scalar_” before it do not matter.
    """
    plain = [_plain(name) for name in names]
    found = {
        role: plain.index(match)
        for role, known in _NAMES.items()
        if (match := next((name for name in known if name in plain), None)) is not None
    }
    if not all(colour in found for colour in _COLOURS):
        found = {role: i for role, i in found.items() if role not in _COLOURS}
    return found


def has_coordinates(columns: dict[str, int]) -> bool:
    """Return whether x, y and z are among the columns found."""
    return {"x", "y", "z"} <= columns.keys()


def parse_columns(text: str) -> tuple[str, ...]:
    """Return the names in a list of columns such as “x,y,z,-,intensity”.

    Raises
    ------
    ReadError
        If it does not name x, y and z, or a name twice.
    """
    names = tuple(name.strip() for name in re.split(r"[,;\s]+", text.strip()))
    plain = [_plain(name) for name in names if name not in SKIPPED]
    if not has_coordinates(find_columns(names)) or "" in names or len(set(plain)) < len(plain):
        raise ReadError(
            "The columns “{columns}” must name x, y and z, each name once; “-” skips a column.",
            columns=text,
        )
    return names


def _plain(name: str) -> str:
    name = name.strip().strip("\"'").strip().casefold().removeprefix("scalar_")
    return re.sub(r"\s*[\[(].*|_m$", "", name)


@dataclass
class ChunkMaker:
    """Makes chunks of one file's columns.

    Parameters
    ----------
    roles : collection of str
        Those of x, y, z, intensity, red, green, blue, classification, station that are there.
    """

    roles: Sequence[str]
    _colour_factor: float | None = field(default=None, init=False)

    def chunk(
        self,
        column: Callable[[str], Values],
        fraction: float,
        fields: dict[str, Values] | None = None,
    ) -> Chunk:
        """Return the chunk of the columns that `column` gives by role, and of more fields."""
        with np.errstate(over="ignore", invalid="ignore"):  # Of a damaged file's values.
            return self._chunk(column, fraction, fields or {})

    def _chunk(
        self, column: Callable[[str], Values], fraction: float, fields: dict[str, Values]
    ) -> Chunk:
        first = column("x")
        xyz = np.empty((len(first), 3))
        for axis, role in enumerate("xyz"):
            xyz[:, axis] = column(role)
        intensity = rgb = classification = station = None
        if "intensity" in self.roles:
            intensity = column("intensity").astype(np.float32)
        if "red" in self.roles:
            rgb = self._rgb(np.stack([column(colour) for colour in _COLOURS], axis=1))
        if "classification" in self.roles:
            classification = _clipped(column("classification"), np.uint8)
        if "station" in self.roles:
            station = _whole(column("station"))
        return Chunk(xyz, fraction, intensity, rgb, classification, station, fields)

    def _rgb(self, colours: Values) -> Values:
        if colours.dtype.kind == "f":
            if self._colour_factor is None:
                # Colours as fractions of one are told by the first points of the file.
                is_fraction = colours.max(initial=0) <= 1 and (colours % 1 != 0).any()
                self._colour_factor = 255.0 if is_fraction else 1.0
            colours = colours * self._colour_factor + 0.5
        return colours if colours.dtype == np.uint8 else _clipped(colours, np.uint16)


def _clipped(values: Values, dtype: type) -> Values:
    """Return integers of a type, as near to the values as it can hold; 0 for nan."""
    if values.dtype.kind == "f":
        values = np.nan_to_num(values)
    return np.clip(values, 0, np.iinfo(dtype).max).astype(dtype)


def _whole(values: Values) -> NDArray[np.int64]:
    """Return whole numbers; 0 for what is none."""
    if values.dtype.kind != "f":
        return values.astype(np.int64)
    whole: NDArray[np.int64] = np.nan_to_num(np.clip(values, -(2.0**53), 2.0**53)).astype(np.int64)
    return whole
