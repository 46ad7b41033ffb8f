"""Segments: connected components of all stacks laid over each other (paper, section 3.1)."""

import numpy as np
from numpy.typing import NDArray

from pipecore._kernels import disjoint_sets
from pipecore.allocation import BLOCK, Allocate, in_memory
from pipecore.progress import NoProgress, Progress, in_chunks
from pipecore.types import NO_ID

MIN_SEGMENT = 20
"""Components of fewer downsampled points are no segments."""


class StackOverlay:
    """Stacks laid over each other: points that share a curve in any stack are one component.

    Stacks are added one by one, so that no two need be held at a time.

    Parameters
    ----------
    n_points : int
        Number of points of the surface.
    allocate : callable, optional
        Makes the arrays with a value for each of them.
    """

    def __init__(self, n_points: int, allocate: Allocate = in_memory) -> None:
        self._allocate = allocate
        self._parents: NDArray[np.int32] = allocate("parents", (n_points,), np.int32)
        self._first_of_plane = np.empty(0, np.int64)
        for start in range(0, n_points, BLOCK):
            stop = min(start + BLOCK, n_points)
            self._parents[start:stop] = np.arange(start, stop)

    def add(self, points: NDArray[np.int32], starts: NDArray[np.int64]) -> None:
        """Join the points that share a curve: rows starts[c] … starts[c + 1] of `points`.

        Parameters
        ----------
        points : ndarray of int32
            Indices of points, one curve after another.
        starts : ndarray of int64
            Where each curve starts in `points`, with the end of the last, shape (n + 1,).
        """
        disjoint_sets.unite_groups(points, starts, self._parents)

    def add_planes(self, start: int, plane: NDArray[np.int32]) -> None:
        """Join the points of each plane: `plane` has the numbers of those from `start` on.

        Numbers count from 0; points with lower ones are of no plane.

        Parameters
        ----------
        start : int
        plane : ndarray of int32
            Number of each point's plane, shape (n,).
        """
        n_more = int(plane.max(initial=-1)) + 1 - len(self._first_of_plane)
        if n_more > 0:
            unknown = np.full(n_more, -1, np.int64)
            self._first_of_plane = np.concatenate([self._first_of_plane, unknown])
        disjoint_sets.unite_labelled(plane, start, self._first_of_plane, self._parents)

    def number_segments(self, progress: Progress = NoProgress()) -> NDArray[np.int32]:
        """Return the segment of each point, 1 for the largest; `NO_ID` for points of none.

        Parameters
        ----------
        progress : Progress
            May cancel.

        Returns
        -------
        ndarray of int32
            Shape (n,).
        """
        n = len(self._parents)
        progress.update("segments", 0.0)
        disjoint_sets.flatten(self._parents)
        sizes = self._allocate("sizes", (n,), np.int32)
        roots = [np.empty(0, np.intp)]
        for start, stop in in_chunks(n, BLOCK, "segments", progress):
            disjoint_sets.count_members(self._parents[start:stop], sizes)
        for start, stop in in_chunks(n, BLOCK, "segments", progress):
            roots.append(start + np.flatnonzero(sizes[start:stop] >= MIN_SEGMENT))
        by_size = np.concatenate(roots)
        by_size = by_size[np.lexsort((by_size, -sizes[by_size]))]
        # From here on a root's size is replaced by its number.
        sizes[:] = NO_ID
        sizes[by_size] = np.arange(1, len(by_size) + 1)
        segments = self._allocate("segments", (n,), np.int32)
        for start, stop in in_chunks(n, BLOCK, "segments", progress):
            segments[start:stop] = sizes[self._parents[start:stop]]
        return segments
