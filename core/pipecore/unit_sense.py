"""Whether measured radii speak for another unit than the one a file was read in."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from pipecore.catalogues import sizes_of_all
from pipecore.notes import Note
from pipecore.settings import LengthUnit, Settings
from pipecore.types import Element, ElementKind, PointCloud

OTHERS = LengthUnit.FOOT, LengthUnit.INCH, LengthUnit.MILLIMETRE
TIGHTEST, TIGHT, WIDE = 0.002, 0.005, 0.01
"""Diameters are of a nominal size if they differ by no more than these shares of it: makers keep
1 %, most pipes half of that."""
SAME_SIZE = 0.02
"""Radii that differ by less than this share may be of one size, and count once."""
MOST_BY_CHANCE = 0.06
"""A unit is named if radii of no nominal size would fit it so rarely (probability)."""


def unit_notes(
    cloud: PointCloud, elements: Iterable[Element], settings: Settings
) -> tuple[Note, ...]:
    """Return a note if no pipe has a nominal size, but in another unit all have.

    Nothing is said where a reference system or the user names the unit.

    Parameters
    ----------
    cloud : PointCloud
    elements : iterable of Element
    settings : Settings

    Returns
    -------
    tuple of Note
        None or one.
    """
    if cloud.crs or cloud.unit.name != "m" or settings.input.length_unit is not LengthUnit.AUTO:
        return ()
    radii = _different([e.radius for e in elements if e.kind is ElementKind.CYLINDER])
    sizes = np.array([s.outside_diameter for s in sizes_of_all(settings.elements.catalogue)])
    unit = _unit_of(2 * radii, sizes)
    if unit is None:
        return ()
    return (
        Note(
            "If “{name}” is in {unit}, none of its pipes has a nominal size; in {other} all have: "
            "check the length unit.",
            name=cloud.source.name if cloud.source is not None else "the cloud",
            unit=cloud.unit.name,
            other=str(unit),
        ),
    )


def _different(radii: Iterable[float]) -> NDArray[np.float64]:
    """Radii that are not of one size, ascending."""
    found: list[float] = []
    for radius in sorted(r for r in radii if np.isfinite(r)):
        if not found or radius > found[-1] * (1 + SAME_SIZE):
            found.append(radius)
    return np.array(found)


def _unit_of(diameters: NDArray[np.float64], sizes: NDArray[np.float64]) -> LengthUnit | None:
    """The unit in which all diameters (metres, if read as such) are of nominal sizes."""
    if not len(diameters):
        return None
    for tolerance in (TIGHTEST, TIGHT, WIDE):
        if _fits(diameters, sizes, tolerance).any():
            return None
        by_chance = _share_by_chance(sizes, tolerance) ** len(diameters)
        for unit in OTHERS:
            if _fits(diameters * unit.metres, sizes, tolerance).all():
                return unit if by_chance <= MOST_BY_CHANCE else None
    return None


def _fits(
    diameters: NDArray[np.float64], sizes: NDArray[np.float64], tolerance: float
) -> NDArray[np.bool_]:
    off = np.abs(diameters[:, None] / sizes - 1).min(axis=1)
    return np.asarray(off <= tolerance)


def _share_by_chance(sizes: NDArray[np.float64], tolerance: float) -> float:
    """Share of all diameters (as their logarithms lie) that are of a nominal size."""
    ordered = np.sort(sizes)
    return float(2 * tolerance * len(ordered) / np.log(ordered[-1] / ordered[0]))
