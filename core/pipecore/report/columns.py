"""Columns of a report's tables, in the units and with the digits that their files have."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipecore.report.world import FileCoordinates
from pipecore.types import Array

Column = tuple[str, NDArray[Any], int | None]


def integers(name: str, values: ArrayLike) -> Column:
    """A column of whole numbers."""
    return name, np.array(values, np.int32), None


def texts(name: str, values: Sequence[str]) -> Column:
    """A column of texts."""
    return name, np.array(values, object), None


def floats(name: str, values: ArrayLike, scale: float, decimals: int) -> Column:
    """A column in the unit of its name, rounded as its file has it; nan for what is none."""
    # Adding zero takes the sign off a zero.
    rounded = np.round(scale * np.asarray(values, np.float64), decimals) + 0.0
    return name, np.where(np.isfinite(rounded), rounded, np.nan), decimals


def angles(name: str, radians: ArrayLike) -> Column:
    """A column in degrees."""
    return floats(name, np.rad2deg(np.asarray(radians, np.float64)), 1, 2)


def positions(name: str, local: ArrayLike, place: FileCoordinates) -> Iterator[Column]:
    """The three columns of positions, in the coordinates of the input file."""
    points: Array = place.of_local(np.asarray(local, np.float64).reshape(-1, 3))
    for i, axis in enumerate("xyz"):
        yield floats(f"{name}_{axis}", points[:, i], 1, place.decimals)
