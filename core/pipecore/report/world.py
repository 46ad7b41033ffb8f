"""From local coordinates back to those of the input file."""

from dataclasses import dataclass

import numpy as np

from pipecore.formatting import format_coordinate
from pipecore.types import Array, Result
from pipecore.units import FileUnit


@dataclass(frozen=True, eq=False)
class FileCoordinates:
    """World coordinates in the unit of the input file, with digits for 0.1 mm."""

    origin: Array
    unit: FileUnit

    @classmethod
    def of(cls, result: Result) -> "FileCoordinates":
        """Return those of the file that `result` was detected in."""
        return cls(result.origin, result.file_unit)

    @property
    def decimals(self) -> int:
        """Digits after the point that keep 0.1 mm."""
        return max(0, int(np.ceil(4 + np.log10(self.unit.metres))))

    def of_local(self, local: Array) -> Array:
        """File coordinates of local ones (metres), any shape (..., 3)."""
        return np.asarray((np.asarray(local, np.float64) + self.origin) / self.unit.factors)

    def display(self, local: Array) -> str:
        """The three coordinates of a local point for people, to the millimetre or so."""
        decimals = max(0, self.decimals - 1)
        return ", ".join(format_coordinate(c, decimals) for c in self.of_local(local).tolist())
