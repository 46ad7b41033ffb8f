"""Reducers looked for where straight pipes say they must be.

Two straights on one line but of different radii are joined by a reducer. It is proposed
from the straights and then has to hold against the points like any other piece.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipecore.elements.pieces import Piece
from pipecore.elements.refine import Fitted
from pipecore.elements.surfaces import LineSurface

Array = NDArray[np.float64]
End = tuple[int, int]
"""An end of a fitted straight: its number, and 0 for its start or 1 for its end."""
NO_ELLIPSES: NDArray[np.intp] = np.empty(0, np.intp)

ON_AXIS = 0.12
"""Axes of straights joined by a reducer are within this share of the radius of each other."""
MAX_REDUCER = 5.0
"""Longest reducer, in radii of its wider end."""


class StraightEnd(NamedTuple):
    """An end of a straight: which, where, the direction out of it, and its radius."""

    which: End
    point: Array
    outward: Array
    radius: float


def straight_ends(fitted: list[Fitted], first: int = 0) -> list[StraightEnd]:
    """Ends of the cylinders, from the piece with the number `first` on."""
    ends = []
    for i, f in enumerate(fitted[first:], start=first):
        if isinstance(f.fit.model, LineSurface) and not f.fit.model.is_tapered:
            direction, radius = f.fit.model.direction, f.fit.model.radius
            ends.append(StraightEnd((i, 0), f.axis.start, -direction, radius))
            ends.append(StraightEnd((i, 1), f.axis.end, direction, radius))
    return ends


def propose_reducers(fitted: list[Fitted]) -> Iterator[tuple[Piece, tuple[End, End]]]:
    """Cones between straights on one line but of different radii."""
    ends = straight_ends(fitted)
    if not ends:
        return
    points, radii = np.stack([e.point for e in ends]), np.array([e.radius for e in ends])
    for a, (i, p, u, r) in enumerate(ends):
        furthest = 1.1 * MAX_REDUCER * np.maximum(r, radii[a + 1 :])
        is_near = np.square(points[a + 1 :] - p).sum(axis=1) < furthest**2
        for b in (np.flatnonzero(is_near) + a + 1).tolist():
            j, q, v, s = ends[b]
            wide, narrow = max(r, s), min(r, s)
            if i[0] == j[0] or -(u @ v) < np.cos(np.deg2rad(6.0)) or not 0.4 < narrow / wide < 0.96:
                continue
            gap = q - p
            along = float(gap @ u)
            across = float(np.linalg.norm(gap - along * u))
            if not 0.1 * wide < along < MAX_REDUCER * wide or across > ON_AXIS * wide:
                continue
            direction = gap / np.linalg.norm(gap)
            length = float(np.linalg.norm(gap))
            model = LineSurface(
                0.5 * (p + q), direction, 0.5 * (r + s), (s - r) / length, is_tapered=True
            )
            yield Piece(model, NO_ELLIPSES, -0.5 * length, 0.5 * length), (i, j)
