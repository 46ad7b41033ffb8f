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
        The segment of each point, 1 for the largest; `NO_ID` for points of none.
    """
    parents = np.arange(n_points)
    for i, stack_curves in enumerate(curves):
        progress.update("segments", i / len(curves))
        components.unite_groups(stack_curves.points, stack_curves.starts, parents)
    components.flatten(parents)
    roots, component, sizes = np.unique(parents, return_inverse=True, return_counts=True)
    by_size = np.lexsort((roots, -sizes))
    number = np.empty(len(roots), np.int32)
    number[by_size] = np.arange(1, len(roots) + 1)
    number[sizes < MIN_SEGMENT] = NO_ID
    progress.update("segments", 1.0)
    return number[component]
