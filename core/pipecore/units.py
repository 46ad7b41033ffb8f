"""The unit of a file's coordinates."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipecore.settings import LengthUnit

SAME = 1e-7
"""Relative difference up to which two lengths are the same unit; feet differ by 2e-6."""

MIN_METRES, MAX_METRES = 1e-9, 1e9
"""Metres in a unit of length; what is shorter or longer is none, but a damaged number."""


def is_unit(metres: float) -> bool:
    """Return whether a number can be the metres in a unit of length; nan cannot.

    Parameters
    ----------
    metres : float

    Returns
    -------
    bool
    """
    return MIN_METRES < metres < MAX_METRES


@dataclass(frozen=True)
class FileUnit:
    """Unit of the coordinates in a file, which heights may have of their own.

    Parameters
    ----------
    name : str
        As in `LengthUnit`, or the unit's own name.
    metres : float
        Metres in one unit of x and y.
    height_name : str
    height_metres : float
        Metres in one unit of z.
    """

    name: str = "m"
    metres: float = 1.0
    height_name: str = "m"
    height_metres: float = 1.0

    @classmethod
    def of(cls, unit: LengthUnit) -> "FileUnit":
        """Return the unit of all three coordinates; `unit` is not AUTO.

        Parameters
        ----------
        unit : LengthUnit

        Returns
        -------
        FileUnit
        """
        return cls(str(unit), unit.metres, str(unit), unit.metres)

    @classmethod
    def of_lengths(cls, plan: tuple[str, float], height: tuple[str, float]) -> "FileUnit":
        """Return the unit of x and y, and that of z, each by name and metres.

        Units that `LengthUnit` knows get its names and exact values: files round feet.

        Parameters
        ----------
        plan, height : (str, float)
            Name and metres in one unit.

        Returns
        -------
        FileUnit
        """
        return cls(*_known(*plan), *_known(*height))

    def is_of(self, plan: tuple[str, float], height: tuple[str, float]) -> bool:
        """Return whether units of plan and height, by name and metres, are these.

        Parameters
        ----------
        plan, height : (str, float)

        Returns
        -------
        bool
        """
        other = FileUnit.of_lengths(plan, height)
        return (self.metres, self.height_metres) == (other.metres, other.height_metres)

    @property
    def factors(self) -> NDArray[np.float64]:
        """Metres in one unit of x, y and z, shape (3,)."""
        return np.array([self.metres, self.metres, self.height_metres])

    def __str__(self) -> str:
        """Return its name, both names where heights have another."""
        if self.height_name == self.name:
            return self.name
        return f"{self.name} (heights {self.height_name})"


def _known(name: str, metres: float) -> tuple[str, float]:
    for unit in LengthUnit:
        if unit is not LengthUnit.AUTO and abs(metres / unit.metres - 1) < SAME:
            return str(unit), unit.metres
    return name, metres
