"""Ends of straights, from which the fittings between them are found."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipecore.elements.refinement.fitted_element import FittedElement
from pipecore.elements.refinement.surface_fits import LineSurface
from pipecore.elements.runs.ends import End

Array = NDArray[np.float64]
NO_ELLIPSES: NDArray[np.intp] = np.empty(0, np.intp)


class StraightEnd(NamedTuple):
    """An end of a fitted straight.

    Parameters
    ----------
    which : (int, int)
        Number of the straight; 0 for its start, 1 for its end.
    point, outward : ndarray, shape (3,)
        Where it is, metres, and the unit vector along the axis out of the pipe.
    radius : float
        Metres.
    """

    which: End
    point: Array
    outward: Array
    radius: float


def straight_ends(fitted: list[FittedElement], first: int = 0) -> list[StraightEnd]:
    """List the ends of the cylinders among some elements.

    Parameters
    ----------
    fitted : list of FittedElement
    first : int
        Elements with lower numbers are skipped.

    Returns
    -------
    list of StraightEnd
        Start and end of each, in the order of the elements.
    """
    ends = []
    for i, f in enumerate(fitted[first:], start=first):
        if isinstance(f.fit.model, LineSurface) and not f.fit.model.is_tapered:
            radius, axis = f.fit.model.radius, f.axis
            ends.append(StraightEnd((i, 0), axis.start, -axis.tangent(0.0), radius))
            ends.append(StraightEnd((i, 1), axis.end, axis.tangent(axis.length), radius))
    return ends


def normal_angle(normals: Array, outward: Array, tangent: Array) -> Array:
    """Angle from the surface's normals to the points', towards increasing clock.

    Parameters
    ----------
    normals, outward, tangent : ndarray, shape (n, 3)
        Unit normals of the points, of either sign; outward unit normals of the surface; unit
        tangents of the axis.

    Returns
    -------
    ndarray, shape (n,)
        Radians, in (-π/2, π/2).
    """
    clockwise = np.cross(tangent, outward)
    ahead = np.einsum("ij,ij->i", normals, clockwise)
    out = np.einsum("ij,ij->i", normals, outward)
    return np.asarray(np.arctan(ahead / np.where(out == 0.0, np.inf, out)))
