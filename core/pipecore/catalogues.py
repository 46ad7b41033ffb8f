"""Nominal sizes: which catalogue size a measured pipe is, if any."""

import math
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache

from pipecore.resources import resource
from pipecore.settings import ElementSettings
from pipecore.types import Element, ElementKind, NominalSize

DOUBT_SD = 2.0
"""A size is given, or ruled out, where this many standard deviations say so."""
KINDS_WITH_SIZE = ElementKind.CYLINDER, ElementKind.CONE, ElementKind.TORUS, ElementKind.TEE
"""Kinds of elements that have a nominal size; a cone has one at each end."""
SAME_SIZE = 0.4e-3
"""Sizes of two catalogues that differ by no more (metres) are one: 323.8 and 323.9 mm."""


@dataclass(frozen=True)
class SizeMatch:
    """Which nominal size a measured outside diameter may have.

    Parameters
    ----------
    size : NominalSize or None
        None if no size lies surely within the tolerance, as for an insulated pipe.
    other : NominalSize or None
        The nearest size of another diameter that the measurement does not rule out.
    """

    size: NominalSize | None = None
    other: NominalSize | None = None


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
            return tuple(
                NominalSize(s["name"], s["od_mm"] / 1000, catalogue) for s in data["sizes"]
            )
    raise KeyError(f"no size catalogue {catalogue!r} in {resource('sizes')}")


def sizes_of_all(catalogues: Sequence[str]) -> tuple[NominalSize, ...]:
    """Return the sizes of several catalogues by diameter; what two have is the first one's.

    Parameters
    ----------
    catalogues : sequence of str
        `SizeCatalogue` values or their names.

    Returns
    -------
    tuple of NominalSize
    """
    found: list[NominalSize] = []
    for catalogue in catalogues:
        found += [
            size
            for size in sizes_of(str(catalogue))
            if not any(_is_same(size, other) for other in found)
        ]
    return tuple(sorted(found, key=lambda size: size.outside_diameter))


def match_size(
    outside_diameter: float,
    outside_diameter_sd: float,
    catalogues: Sequence[str],
    tolerance_pct: float,
) -> SizeMatch:
    """Return which catalogue size a measured outside diameter is, and which it may be besides.

    Parameters
    ----------
    outside_diameter, outside_diameter_sd : float
        In metres.
    catalogues : sequence of str
        `SizeCatalogue` values or their names; the first goes before the others.
    tolerance_pct : float
        Largest difference in percent of the nominal outside diameter. A size is given only
        where two standard deviations lie inside, and ruled out where they lie outside.

    Returns
    -------
    SizeMatch
    """
    # A nan compares false: no size.
    if not math.isfinite(outside_diameter):
        return SizeMatch()
    doubt = DOUBT_SD * outside_diameter_sd if math.isfinite(outside_diameter_sd) else 0.0
    near = sorted(
        sizes_of_all(catalogues), key=lambda s: abs(s.outside_diameter - outside_diameter)
    )

    def off(size: NominalSize) -> float:
        allowed = tolerance_pct / 100 * size.outside_diameter
        return abs(size.outside_diameter - outside_diameter) - allowed

    nearest = near[0] if near and off(near[0]) + doubt <= 0 else None
    others = (s for s in near if s != nearest and off(s) - doubt <= 0)
    return SizeMatch(nearest, next(others, None))


def with_sizes(element: Element, settings: ElementSettings) -> Element:
    """Return an element with its nominal sizes as measured; a confirmed one is kept.

    Parameters
    ----------
    element : Element
    settings : ElementSettings

    Returns
    -------
    Element
    """
    if element.is_nominal_confirmed:
        return element
    if element.kind not in KINDS_WITH_SIZE:
        return replace(element, nominal=None, nominal_end=None, other_nominal=None)

    def match(radius: float) -> SizeMatch:
        return match_size(
            2 * radius, 2 * element.radius_sd, settings.catalogue, settings.size_tolerance_pct
        )

    found = match(element.radius)
    is_cone = element.kind is ElementKind.CONE
    return replace(
        element,
        nominal=found.size,
        nominal_end=match(element.radius_end).size if is_cone else None,
        other_nominal=found.other,
    )


def _is_same(size: NominalSize, other: NominalSize) -> bool:
    return abs(size.outside_diameter - other.outside_diameter) <= SAME_SIZE
