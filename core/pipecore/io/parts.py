"""Reading LAS and LAZ in parts, in any order and by several processes, into files.

A part is some whole chunks of a LAZ file. What comes out is what `pipecore.io.read` makes of
the files with a folder; where its points must be looked at in their order, nothing comes out.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipecore.io.formats import las
from pipecore.io.mapped import MappedFile
from pipecore.io.reading import FARTHEST, FLOAT32_REACH, first_origin
from pipecore.io.registry import identify
from pipecore.io.source import CHUNK_POINTS
from pipecore.settings import LengthUnit
from pipecore.types import Array, PointCloud

PART_POINTS = 1_000_000
_COLUMNS: dict[str, tuple[type, int | None]] = {
    "xyz": (np.float32, 3),
    "intensity": (np.float32, None),
    "rgb": (np.uint8, 3),
    "classification": (np.uint8, None),
}


@dataclass(frozen=True, eq=False)
class Part:
    """Some points of a file and where they go.

    Parameters
    ----------
    path : Path
    rows : (int, int)
        The first point in the file, and the one behind the last.
    place : int
        Row of the cloud of the first one.
    origin : ndarray
    metres_per_unit : float
    has_wide_colours : bool
        Whether the file's colours use all of their 16 bits.
    """

    path: Path
    rows: tuple[int, int]
    place: int
    origin: Array
    metres_per_unit: float
    has_wide_colours: bool


def plan_parts(
    paths: Sequence[Path], length_unit: LengthUnit, folder: Path
) -> tuple[list[Part], PointCloud] | None:
    """Make room for the points of LAS and LAZ files and tell in which parts to read them.

    Returns
    -------
    (list of Part, PointCloud) or None
        The cloud is filled by `read_part`. None where the files must be read in order: if
        one has another format, if float32 does not carry their extent, or if it shows
        late which bits its colours use.
    """
    metres = length_unit.metres
    origin: Array | None = None
    parts: list[Part] = []
    n_points, crs, has_colours = 0, "", False
    for path in paths:
        if identify(path).module != "las":
            return None
        starts = las.chunk_starts(path)
        if len(starts) < 2:
            return None
        with las.open_source(path, (0, min(CHUNK_POINTS, starts[-1]))) as source:
            crs = crs or source.crs
            first = next(iter(source.chunks))
            bounds = source.bounds
        if origin is None:
            origin = first_origin(first.xyz * metres)
        if bounds is None:
            return None
        if not np.abs(bounds * metres - origin).max() <= FLOAT32_REACH:
            return None
        is_coloured = first.rgb is not None
        is_wide = first.rgb is not None and bool(first.rgb.max(initial=0) > 255)
        if is_coloured and not is_wide:
            return None
        has_colours |= is_coloured
        parts += [
            Part(path, rows, n_points + rows[0], origin, metres, is_wide)
            for rows in _grouped(starts)
        ]
        n_points += starts[-1]
    assert origin is not None
    arrays = {
        name: MappedFile(_path(folder, name), dtype, width).resized(n_points)
        for name, (dtype, width) in _COLUMNS.items()
        if name != "rgb" or has_colours
    }
    return parts, PointCloud(origin=origin, crs=crs, source=paths[0], **arrays)  # type: ignore[arg-type]


def read_part(folder: Path, part: Part) -> bool:
    """Read a part into the files of a folder.

    Returns
    -------
    bool
        False where the file's header lied, or points are invalid: then the files have to
        be read in order.
    """
    with las.open_source(part.path, part.rows) as source:
        place = part.place
        for chunk in source.chunks:
            xyz = chunk.xyz * part.metres_per_unit
            local = xyz - part.origin
            with np.errstate(invalid="ignore"):
                is_valid = np.abs(xyz).max() <= FARTHEST and np.abs(local).max() <= FLOAT32_REACH
            if not is_valid:
                return False
            rows = slice(place, place + len(local))
            _open(folder, "xyz")[rows] = local
            assert chunk.intensity is not None
            assert chunk.classification is not None
            _open(folder, "intensity")[rows] = chunk.intensity
            _open(folder, "classification")[rows] = chunk.classification
            if chunk.rgb is not None:
                _open(folder, "rgb")[rows] = chunk.rgb >> 8
            place = rows.stop
    return True


def remove_parts(folder: Path) -> None:
    """Delete what `plan_parts` made, so that the files can be read in order."""
    for name in _COLUMNS:
        _path(folder, name).unlink(missing_ok=True)


def _grouped(starts: list[int]) -> list[tuple[int, int]]:
    """Ranges of whole chunks of at least `PART_POINTS` points, but for the last."""
    groups, first = [], starts[0]
    for end in starts[1:]:
        if end - first >= PART_POINTS or end == starts[-1]:
            groups.append((first, end))
            first = end
    return groups


def _path(folder: Path, name: str) -> Path:
    return folder / f"{name}.{np.dtype(_COLUMNS[name][0]).name}"


def _open(folder: Path, name: str) -> NDArray[Any]:
    dtype, width = _COLUMNS[name]
    array = np.asarray(np.memmap(_path(folder, name), dtype, "r+"))
    return array if width is None else array.reshape(-1, width)
