"""Nominal sizes: which catalogue size a measured pipe is, if any."""

import tomllib
from functools import cache

from pipecore.resources import resource
from pipecore.types import NominalSize


@cache
def sizes_of(catalogue: str) -> tuple[NominalSize, ...]:
    """Return all sizes of a catalogue.

    Parameters
    ----------
    catalogue : str
        Its name, such as "EN 10220".

    Returns
    -------
    tuple of NominalSize

    Raises
    ------
    KeyError
        If there is no such catalogue.
    """
    for path in sorted(resource("sizes").glob("*.toml")):
        data = tomllib.loads(path.read_text(encoding="utf-8"))
        if data["name"] == catalogue:
            return tuple(NominalSize(s["name"], s["od_mm"] / 1000) for s in data["sizes"])
    raise KeyError(f"no size catalogue {catalogue!r} in {resource('sizes')}")


def nominal_size(
    outside_diameter: float, catalogue: str, tolerance_pct: float
) -> NominalSize | None:
    """Return the catalogue size nearest to a measured outside diameter.

    Parameters
    ----------
    outside_diameter : float
        In metres.
    catalogue : str
        A `SizeCatalogue` or its name.
    tolerance_pct : float
        Largest difference in percent of the nominal outside diameter.

    Returns
    -------
    NominalSize or None
        None if no size lies within the tolerance, as for an insulated pipe.
    """
    nearest = min(
        sizes_of(str(catalogue)), key=lambda s: abs(s.outside_diameter - outside_diameter)
    )
    difference = abs(nearest.outside_diameter - outside_diameter)
    # A nan compares false: no size.
    return nearest if difference <= tolerance_pct / 100 * nearest.outside_diameter else None
