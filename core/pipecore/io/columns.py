"""Which column of a table holds which value of a point, and chunks made from them."""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipecore.io.source import Chunk

# In order of preference: a table may hold both “z” and “height”.
_NAMES = {
    "x": ("x", "e", "east", "easting", "rechtswert"),
    "y": ("y", "n", "north", "northing", "hochwert"),
    "z": ("z", "h", "height", "elev", "elevation", "altitude", "höhe"),
    "intensity": ("intensity", "i", "int", "reflectance", "reflectivity"),
    "red": ("red", "r", "diffuse_red"),
    "green": ("green", "g", "diffuse_green"),
    "blue": ("blue", "b", "diffuse_blue"),
    "classification": ("classification", "class"),
}
_COLOURS = ("red", "green", "blue")

Column = NDArray[Any]


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
    """Tell whether x, y and z are among the columns found."""
    return {"x", "y", "z"} <= columns.keys()


def _plain(name: str) -> str:
    name = name.strip().strip("\"'").strip().casefold().removeprefix("scalar_")
    return re.sub(r"\s*[\[(].*|_m$", "", name)


@dataclass
class ChunkMaker:
    """Makes chunks of one file's columns.

    Parameters
    ----------
    roles : collection of str
        Those of x, y, z, intensity, red, green, blue, classification that are there.
    """

    roles: Sequence[str]
    _colour_factor: float | None = field(default=None, init=False)

    def chunk(self, column: Callable[[str], Column], fraction: float) -> Chunk:
        """Return the chunk of the columns that `column` gives by role."""
        with np.errstate(over="ignore", invalid="ignore"):  # Of a damaged file's values.
            return self._chunk(column, fraction)

    def _chunk(self, column: Callable[[str], Column], fraction: float) -> Chunk:
        first = column("x")
        xyz = np.empty((len(first), 3))
        for axis, role in enumerate("xyz"):
            xyz[:, axis] = column(role)
        intensity = rgb = classification = None
        if "intensity" in self.roles:
            intensity = column("intensity").astype(np.float32)
        if "red" in self.roles:
            rgb = self._rgb(np.stack([column(colour) for colour in _COLOURS], axis=1))
        if "classification" in self.roles:
            classification = _clipped(column("classification"), np.uint8)
        return Chunk(xyz, fraction, intensity, rgb, classification)

    def _rgb(self, colours: Column) -> Column:
        if colours.dtype.kind == "f":
            if self._colour_factor is None:
                # Colours as fractions of one are told by the first points of the file.
                is_fraction = colours.max(initial=0) <= 1 and (colours % 1 != 0).any()
                self._colour_factor = 255.0 if is_fraction else 1.0
            colours = colours * self._colour_factor + 0.5
        return colours if colours.dtype == np.uint8 else _clipped(colours, np.uint16)


def _clipped(values: Column, dtype: type) -> Column:
    """Return integers of a type, as near to the values as it can hold; 0 for nan."""
    if values.dtype.kind == "f":
        values = np.nan_to_num(values)
    return np.clip(values, 0, np.iinfo(dtype).max).astype(dtype)
