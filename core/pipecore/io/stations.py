"""From which station each point was scanned."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipecore.io.source import Source
from pipecore.settings import StationSource
from pipecore.types import Array

MOST_STATIONS = 65_535
ZERO_GUID = "00000000-0000-0000-0000-000000000000"

Ids = NDArray[np.uint16]


@dataclass(frozen=True)
class _Origin:
    """Where points with one provisional id come from: a file, and a number in it."""

    file: int
    number: int


@dataclass(frozen=True, eq=False)
class _File:
    name: str
    source: Source


@dataclass
class StationTable:
    """Collects stations file by file and says in the end which of them are stations.

    Points first get provisional ids, one for each number that a file gives; only the whole
    file shows whether these vary, and only all files whether they belong together.
    """

    choice: StationSource = StationSource.AUTO
    _files: list[_File] = field(default_factory=list)
    _ids: dict[_Origin, int] = field(default_factory=dict)
    is_full: bool = False

    def begin_file(self, path: Path, source: Source) -> None:
        """Take a file; the points that follow are its."""
        self._files.append(_File(path.name, source))

    def provisional(self, numbers: NDArray[Any] | int | None, n_points: int) -> Ids | int:
        """Return provisional ids of points of the current file, or one for all of them."""
        if numbers is None or self.choice is not StationSource.AUTO or n_points == 0:
            return self._id(0)
        if not isinstance(numbers, np.ndarray):
            return self._id(int(numbers))
        if numbers[0] == numbers[-1] and (numbers == numbers[0]).all():
            return self._id(int(numbers[0]))
        there, place = np.unique(numbers, return_inverse=True)
        return np.array([self._id(int(n)) for n in there], np.uint16)[place]

    def _id(self, number: int) -> int:
        origin = _Origin(len(self._files) - 1, number)
        if origin not in self._ids:
            if len(self._ids) >= MOST_STATIONS:
                self.is_full = True
                return MOST_STATIONS
            self._ids[origin] = len(self._ids) + 1
        return self._ids[origin]

    def finish(self) -> tuple[Ids | None, tuple[str, ...], Array]:
        """Return the final id of each provisional one (by its place), names and positions.

        The ids are None where nothing tells stations apart and none is known: one file
        whose points all have the same number. Positions are in files' coordinates.
        """
        if self.is_full:
            return None, (), np.empty((0, 3))
        if self.choice is StationSource.ONE:
            return self._one()
        keys: dict[Any, int] = {}
        names: list[str] = []
        positions: list[Array] = []
        final = np.zeros(len(self._ids) + 1, np.uint16)
        is_known = len(self._files) > 1
        for i, file in enumerate(self._files):
            own = [(o.number, k) for o, k in self._ids.items() if o.file == i]
            tells = self._tells(file.source, [number for number, _ in own])
            is_known |= tells
            for number, provisional in sorted(own):
                key = self._key(i, file.source, number if tells else None, own)
                if key not in keys:
                    keys[key] = len(keys) + 1
                    names.append(_name(file, number if tells else None))
                    positions.append(_position(file.source, number, tells))
                final[provisional] = keys[key]
        if not is_known:
            return None, (), np.empty((0, 3))
        return final, tuple(names), np.array(positions).reshape(-1, 3)

    def _one(self) -> tuple[Ids | None, tuple[str, ...], Array]:
        known = [scan.position for f in self._files for scan in f.source.scans]
        position = known[0] if len(known) == 1 else np.full(3, np.nan)
        final = np.minimum(np.arange(len(self._ids) + 1), 1).astype(np.uint16)
        return final, (self._files[0].name,), np.reshape(position, (1, 3))

    def _tells(self, source: Source, numbers: Sequence[int]) -> bool:
        """Whether a file's own numbers are stations: those of its scans, or any that vary."""
        if self.choice is not StationSource.AUTO:
            return False
        return (bool(source.scans) and bool(numbers)) or len(numbers) > 1

    def _key(self, i: int, source: Source, number: int | None, own: Sequence[Any]) -> Any:
        """What points of one station have in common; tiles of one project share stations."""
        if self.choice is StationSource.FILES or source.scans:
            return i, number
        is_project = source.guid not in ("", ZERO_GUID)
        if is_project:
            return source.guid, own[0][0] if number is None else number
        return i, number


def _name(file: _File, number: int | None) -> str:
    if number is None:
        return file.name
    scans = file.source.scans
    if number < len(scans):
        return f"{file.name}: {scans[number].name}"
    return f"{file.name}: {number}"


def _position(source: Source, number: int, tells: bool) -> Array:
    if tells and number < len(source.scans):
        return source.scans[number].position
    if len(source.scans) == 1 and not tells:
        return source.scans[0].position
    return np.full(3, np.nan)
