"""Ends of straights, which tell of the fittings between them."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipecore.elements.refinement.refine import FittedElement
from pipecore.elements.refinement.surface_fits import LineSurface
from pipecore.elements.runs.ends import End

Array = NDArray[np.float64]
NO_ELLIPSES: NDArray[np.intp] = np.empty(0, np.intp)


class StraightEnd(NamedTuple):
    """An end of a straight: which, where, the direction out of it, and its radius."""

    which: End
    point: Array
    outward: Array
    radius: float


def straight_ends(fitted: list[FittedElement], first: int = 0) -> list[StraightEnd]:
    """Ends of the cylinders, from the piece with the number `first` on."""
    ends = []
    for i, f in enumerate(fitted[first:], start=first):
        if isinstance(f.fit.model, LineSurface) and not f.fit.model.is_tapered:
            direction, radius = f.fit.model.direction, f.fit.model.radius
            ends.append(StraightEnd((i, 0), f.axis.start, -direction, radius))
            ends.append(StraightEnd((i, 1), f.axis.end, direction, radius))
    return ends


def normal_angle(normals: Array, outward: Array, tangent: Array) -> Array:
    """Angle from the surface's outward normals to the points' own, towards increasing clock."""
    clockwise = np.cross(tangent, outward)
    ahead = np.einsum("ij,ij->i", normals, clockwise)
    out = np.einsum("ij,ij->i", normals, outward)
    return np.asarray(np.arctan(ahead / np.where(out == 0.0, np.inf, out)))
