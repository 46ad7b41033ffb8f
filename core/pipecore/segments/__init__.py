"""Segments: connected components of all stacks laid over each other (paper, section 3.1)."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pipecore._kernels import components
from pipecore.profiles import Curves
from pipecore.progress import Progress
from pipecore.types import NO_ID

MIN_SEGMENT = 20
"""Components of fewer thinned points are no segments."""


class Overlay:
    """Stacks laid over each other: points that share a curve in any stack are one component.

    Stacks are added one by one, so that no two need be held at a time.
    """

    def __init__(self, n_points: int) -> None:
        self._parents = np.arange(n_points, dtype=np.int32)

    def add(self, curves: Curves) -> None:
        """Join the points that share a curve of this stack."""
        components.unite_groups(curves.points, curves.starts, self._parents)

    def number_segments(self) -> NDArray[np.int32]:
        """Return the segment of each point, 1 for the largest; `NO_ID` for points of none."""
        components.flatten(self._parents)
        sizes = np.bincount(self._parents)
        roots = np.flatnonzero(sizes >= MIN_SEGMENT)
        roots = roots[np.lexsort((roots, -sizes[roots]))]
        number = np.full(len(sizes), NO_ID, np.int32)
        number[roots] = np.arange(1, len(roots) + 1)
        return number[self._parents]


def overlay_stacks(
    curves: Sequence[Curves], n_points: int, progress: Progress
) -> NDArray[np.int32]:
    """Join the points that share a curve in any stack; number the components.

    Parameters
    ----------
    curves : sequence of Curves
        One per stack.
    n_points : int
        Number of points of the surface.
    progress : Progress

    Returns
    -------
    ndarray of int32, shape (n_points,)
        As `Overlay.number_segments`.
    """
    overlay = Overlay(n_points)
    for i, stack_curves in enumerate(curves):
        progress.update("segments", i / len(curves))
        overlay.add(stack_curves)
    progress.update("segments", 1.0)
    return overlay.number_segments()
