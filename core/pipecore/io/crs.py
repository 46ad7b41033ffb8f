"""Coordinate reference systems: their names and units, from well-known text or GeoTIFF keys.

pyproj knows them; it is imported for files that name one.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from pipecore.units import is_unit

if TYPE_CHECKING:
    from pyproj import CRS

LONGEST_WKT = 100_000

Length = tuple[str, float]
"""A unit of length: its name, and its metres."""


@dataclass(frozen=True)
class ReferenceSystem:
    """A coordinate reference system, as far as a file names it.

    Parameters
    ----------
    name : str
        As the file calls it, "EPSG:…" if it gives a code alone, or "".
    wkt : str
        Well-known text that pyproj understands, or "".
    plan, height : (str, float), optional
        Unit of x and y, and of z: its name, and its metres.
    is_geographic : bool
        Whether x and y are angles.
    """

    name: str = ""
    wkt: str = ""
    plan: Length | None = None
    height: Length | None = None
    is_geographic: bool = False

    def agrees_with(self, other: "ReferenceSystem") -> bool:
        """Whether coordinates in both may be taken as one: the same plan, and the same units."""
        if not self.name or not other.name:
            return True
        ours, theirs = ((_metres(s.plan), _metres(s.height)) for s in (self, other))
        return ours == theirs and self._same_plan(other)

    def _same_plan(self, other: "ReferenceSystem") -> bool:
        ours, theirs = _horizontal(_understood(self.wkt)), _horizontal(_understood(other.wkt))
        if ours is None or theirs is None:
            return self.name.casefold() == other.name.casefold()
        if ours.equals(theirs, ignore_axis_order=True):
            return True
        code = ours.to_epsg()
        if code is not None and theirs.to_epsg() is not None:
            return code == theirs.to_epsg()
        return ours.name.casefold() == theirs.name.casefold()


NO_SYSTEM = ReferenceSystem()


def from_wkt(text: str) -> ReferenceSystem:
    """Return the system of a well-known text, or of a plain name."""
    text = text.strip("\0 \t\r\n")
    name = name_in_wkt(text)
    system = _understood(text) if "[" in text or "(" in text else None
    if system is None:
        length = _outermost_unit(text)
        is_geographic = re.match(r"(GEOGCS|GEOGCRS|GEODCRS)\b", text, re.I) is not None
        length = None if is_geographic else length
        return ReferenceSystem(name, "", length, length, is_geographic)
    plan, height = _lengths(system)
    return ReferenceSystem(name, text, plan, height, _horizontal_is_geographic(system))


def name_in_wkt(text: str) -> str:
    """Return the outermost name in a well-known text, or the text if it is a plain name."""
    text = text.strip("\0 \t\r\n")
    match = re.match(r"[A-Za-z_]+\s*[\[(]\s*\"([^\"]*)\"", text)
    if match:
        return match.group(1).strip()
    return text if len(text) <= 80 and text.isprintable() else ""


_MODEL, _GEOGRAPHIC, _PROJECTED, _PLAN_UNIT, _VERTICAL, _HEIGHT_UNIT = (
    1024,
    2048,
    3072,
    3076,
    4096,
    4099,
)
_CITATIONS = (3073, 1026, 2049)
_TEXTS = 34737
_NO_NAMES = ("", "unknown", "unnamed", "undefined", "user-defined")
_USER_DEFINED = 32767


def from_geotiff_keys(directory: bytes, texts: bytes) -> ReferenceSystem:
    """Return the system of GeoTIFF keys.

    Parameters
    ----------
    directory, texts : bytes
        The contents of the tags 34735 and 34737.

    Notes
    -----
    Codes count where the citation is empty or says “unknown”, as GDAL writes; unit keys
    (of user-defined systems, and of heights) win over the codes' own units, as in libgeotiff.
    """
    entries = np.frombuffer(directory[: len(directory) // 8 * 8], dtype="<u2").reshape(-1, 4)[1:]
    keys = {int(key): (int(where), int(n), int(at)) for key, where, n, at in entries}

    def code(key: int) -> int:
        where, _, value = keys.get(key, (0, 0, 0))
        return value if where == 0 and 0 < value < _USER_DEFINED else 0

    def citation(key: int) -> str:
        where, n, at = keys.get(key, (0, 0, 0))
        name = texts[at : at + n].decode("latin-1").split("|", maxsplit=1)[0].strip("\0 ")
        return name if where == _TEXTS and name.casefold() not in _NO_NAMES else ""

    horizontal = code(_PROJECTED) or code(_GEOGRAPHIC)
    is_geographic = not keys.get(_PROJECTED) and bool(code(_GEOGRAPHIC) or code(_MODEL) == 2)
    system = _of_code(horizontal)
    plan = None if is_geographic else _unit_of_code(code(_PLAN_UNIT))
    if plan is None and not is_geographic and system is not None:
        plan = _lengths(system)[0]
    vertical = _of_code(code(_VERTICAL))
    height = _unit_of_code(code(_HEIGHT_UNIT))
    if vertical is not None and not vertical.is_vertical:
        vertical = None
    if height is None and vertical is not None:
        height = _lengths(vertical)[1]
    name = next(filter(None, map(citation, _CITATIONS)), "")
    if not name and horizontal:
        name = f"EPSG:{horizontal}"
    return ReferenceSystem(
        name, system.to_wkt() if system else "", plan, height or plan, is_geographic
    )


def _understood(text: str) -> "CRS | None":
    from pyproj import CRS  # noqa: PLC0415
    from pyproj.exceptions import ProjError  # noqa: PLC0415

    if not text or len(text) > LONGEST_WKT:
        return None
    try:
        return CRS.from_wkt(text)
    except ProjError:
        return None


def _of_code(code: int) -> "CRS | None":
    from pyproj import CRS  # noqa: PLC0415
    from pyproj.exceptions import ProjError  # noqa: PLC0415

    try:
        return CRS.from_epsg(code) if code else None
    except ProjError:
        return None


def _unit_of_code(code: int) -> Length | None:
    """A unit of length by its EPSG code; None if there is none of it."""
    if not code:
        return None
    from pyproj.database import get_units_map  # noqa: PLC0415

    units = get_units_map("EPSG", category="linear", allow_deprecated=True)
    return next(
        ((unit.name, unit.conv_factor) for unit in units.values() if unit.code == str(code)), None
    )


def _parts(system: "CRS") -> Sequence["CRS"]:
    """The systems of which a compound one consists, without the frames that bind them."""
    if system.is_bound and system.source_crs is not None:
        return _parts(system.source_crs)
    if system.is_compound:
        return [part for sub in system.sub_crs_list for part in _parts(sub)]
    return [system]


def _horizontal(system: "CRS | None") -> "CRS | None":
    if system is None:
        return None
    return next((part for part in _parts(system) if not part.is_vertical), None)


def _horizontal_is_geographic(system: "CRS") -> bool:
    horizontal = _horizontal(system)
    return horizontal is not None and horizontal.is_geographic


def _lengths(system: "CRS") -> tuple[Length | None, Length | None]:
    """Units of plan and height; the height's is the plan's where the system has no height."""

    def length(axis: Any) -> Length:
        return axis.unit_name, float(axis.unit_conversion_factor)

    parts = _parts(system)
    flat = [part for part in parts if not part.is_vertical]
    upright = [part for part in parts if part.is_vertical]
    plan = height = None
    if flat and flat[0].axis_info:
        axes = flat[0].axis_info
        if not flat[0].is_geographic:
            plan = length(axes[0])
        height = length(axes[2]) if len(axes) > 2 else plan
    if upright and upright[0].axis_info:
        height = length(upright[0].axis_info[0])
    return _sound(plan), _sound(height)


def _sound(length: Length | None) -> Length | None:
    return length if length is not None and is_unit(length[1]) else None


def _outermost_unit(text: str) -> Length | None:
    """The last unit of length in a text that pyproj does not understand."""
    found = re.findall(r"(?:LENGTH)?UNIT\s*\[\s*\"([^\"]+)\"\s*,\s*([0-9.eE+-]+)", text)
    lengths = []
    for name, factor in found:
        if name.casefold().startswith(("deg", "rad", "grad", "gon")):
            continue
        try:
            lengths.append((name, float(factor)))
        except ValueError:
            continue
    return _sound(lengths[-1]) if lengths else None


def _metres(length: Length | None) -> float | None:
    return None if length is None else round(length[1], 9)
