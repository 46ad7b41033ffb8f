"""Which points of a chunk are points: neither absurd, nor stray, nor outside of a box."""

from collections import Counter
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from pipecore.io.left_out import ABSURD, NO_NUMBER, ZERO
from pipecore.io.source import Chunk, Rows
from pipecore.local_frame import FARTHEST, FLOAT32_REACH
from pipecore.types import Array

MOST_ZEROS = 10
"""More points than this at exactly 0, 0, 0 are no measurements, wherever the others are."""

STRAY_SHARE = 0.01
"""Stray points are at most this share of all."""
STRAY_GAP, STRAY_GAP_EXTENTS = 1000.0, 5.0
"""What is stray is at least this far (metres, and extents of the cloud) from all other points."""
MOST_CUBES = 2000
"""A cloud that reaches into more cubes is no cloud with strays."""

Bounds = tuple[Array, Array]
"""Lowest and highest coordinates."""


def has_zeros(xyz: Array) -> bool:
    """Return whether a point is exactly at 0, 0, 0."""
    is_zero = xyz[:, 0] == 0
    return bool(is_zero.any()) and not bool(xyz[is_zero, 1:].any(axis=1).all())


def extremes(xyz: Array) -> Bounds:
    """Lowest and highest coordinates of points, shape (m, 3); infinite if there are none."""
    # An axis at a time: a third of the time of all three along the rows.
    axes = [xyz[:, i] for i in range(3)]
    low = np.array([a.min(initial=np.inf) for a in axes])
    return low, np.array([a.max(initial=-np.inf) for a in axes])


@dataclass
class Screen:
    """Takes the valid points of chunks, and counts what it leaves out.

    Parameters
    ----------
    corners : ndarray, optional
        Box in the files' coordinates, shape (2, 3); points outside of it are not counted.
    """

    corners: Array | None = None
    factors: Array = field(default_factory=lambda: np.ones(3))
    """Metres in one unit of x, y, z of the current file."""
    zeros: list[Chunk] = field(default_factory=list)
    """Points at 0, 0, 0 of the current file, held back until it is read."""
    n_zeros: int = 0

    def begin_file(self, factors: Array) -> None:
        """Take a file's unit; the chunks that follow are its."""
        self.factors, self.zeros, self.n_zeros = factors, [], 0

    def world(self, xyz: Array) -> Array:
        """File coordinates in metres."""
        return xyz if (self.factors == 1.0).all() else xyz * self.factors

    def valid(self, chunk: Chunk, left_out: Counter[str]) -> tuple[Array, Rows, Bounds]:
        """World coordinates in metres of the points to keep, which they are, their extremes.

        Those at 0, 0, 0 are held back: see `keep_zeros`.
        """
        raw = chunk.xyz
        is_kept: NDArray[np.bool_] | None = None
        if self.corners is not None:
            is_kept = ((raw >= self.corners[0]) & (raw <= self.corners[1])).all(axis=1)
        if has_zeros(raw):
            is_zero = (raw == 0).all(axis=1)
            self._hold_back(chunk, is_zero if is_kept is None else is_zero & is_kept)
            is_kept = ~is_zero if is_kept is None else is_kept & ~is_zero
        xyz = self.world(raw)
        low, high = extremes(xyz)
        if is_kept is None and (low >= -FARTHEST).all() and (high <= FARTHEST).all():
            return xyz, slice(None), (low, high)
        with np.errstate(invalid="ignore"):
            is_valid = np.all(np.abs(xyz) <= FARTHEST, axis=1)
        if not is_valid.all():
            n_bad = len(xyz) - int(np.count_nonzero(is_valid))
            n_nan = int(np.count_nonzero(~np.isfinite(raw).all(axis=1)))
            left_out[NO_NUMBER] += n_nan
            left_out[ABSURD] += n_bad - n_nan
        is_kept = is_valid if is_kept is None else is_valid & is_kept
        xyz = xyz[is_kept]
        return xyz, is_kept, extremes(xyz)

    def _hold_back(self, chunk: Chunk, is_zero: NDArray[np.bool_]) -> None:
        if not is_zero.any():
            return
        n_before, self.n_zeros = self.n_zeros, self.n_zeros + int(np.count_nonzero(is_zero))
        if n_before < MOST_ZEROS:
            self.zeros.append(chunk.take(is_zero))

    def keep_zeros(self, bounds: Bounds | None, left_out: Counter[str]) -> list[Chunk]:
        """Return the points at 0, 0, 0 that are measurements: few, amid the others.

        Parameters
        ----------
        bounds : (ndarray, ndarray), optional
            Lowest and highest coordinates of the others; None if there are none.
        """
        is_amid = bounds is not None and bool((bounds[0] <= 0).all() and (bounds[1] >= 0).all())
        if is_amid and self.n_zeros <= MOST_ZEROS:
            return self.zeros
        left_out[ZERO] += self.n_zeros
        return []


class Whereabouts:
    """Counts points by cubes, to find those that are far from all others.

    Parameters
    ----------
    origin : ndarray
        Centre of a cube, world coordinates in metres.
    """

    def __init__(self, origin: Array) -> None:
        self._origin = origin
        self._cubes: dict[tuple[int, ...], tuple[int, Array, Array]] = {}

    def add(self, xyz: Array, low: Array, high: Array) -> None:
        """Count points, world coordinates in metres, shape (m, 3), with their extremes."""
        if (np.abs(low - self._origin) < FLOAT32_REACH).all() and (
            np.abs(high - self._origin) < FLOAT32_REACH
        ).all():
            self._put((0, 0, 0), len(xyz), low, high)
            return
        cube = np.floor((xyz - self._origin) / (2 * FLOAT32_REACH) + 0.5)
        first = cube.min(axis=0)
        n_cubes = (cube.max(axis=0) - first + 1).astype(np.int64)
        keys = np.ravel_multi_index((cube - first).astype(np.int64).T, n_cubes)
        there, starts = np.unique(keys, return_index=True)
        if len(there) > MOST_CUBES or len(self._cubes) > MOST_CUBES:
            self._put((0, 0, 0), len(xyz), low, high)
            return
        for key, start in zip(there, starts, strict=True):
            own = xyz[keys == key]
            place = cube[start].astype(np.int64).tolist()
            self._put(tuple(place), len(own), own.min(axis=0), own.max(axis=0))

    def _put(self, key: tuple[int, ...], n: int, low: Array, high: Array) -> None:
        if key in self._cubes:
            m, least, most = self._cubes[key]
            n, low, high = n + m, np.minimum(low, least), np.maximum(high, most)
        self._cubes[key] = n, low, high

    def bounds(self) -> Bounds | None:
        """Lowest and highest coordinates of all points that are not stray, metres."""
        groups = self._groups()
        kept = [box for _, box, is_stray in groups if not is_stray]
        if not kept:
            return None
        return np.min([b[0] for b in kept], axis=0), np.max([b[1] for b in kept], axis=0)

    def strays(self) -> list[Bounds]:
        """Boxes, metres, whose points are far from all others and few."""
        return [box for _, box, is_stray in self._groups() if is_stray]

    def n_strays(self) -> int:
        """Number of the points that are stray."""
        return sum(n for n, _, is_stray in self._groups() if is_stray)

    def _groups(self) -> list[tuple[int, Bounds, bool]]:
        """Number of points and box of cubes that are near each other; whether they are stray."""
        cubes = list(self._cubes.values())
        if len(cubes) < 2 or len(cubes) > MOST_CUBES:
            return [(n, (low, high), False) for n, low, high in cubes]
        n = np.array([c[0] for c in cubes])
        low, high = np.array([c[1] for c in cubes]), np.array([c[2] for c in cubes])
        group = _linked(low, high)
        members = [np.flatnonzero(group == g) for g in np.unique(group)]
        counts = [int(n[m].sum()) for m in members]
        boxes = [(low[m].min(axis=0), high[m].max(axis=0)) for m in members]
        main = int(np.argmax(counts))
        extent = float(np.linalg.norm(boxes[main][1] - boxes[main][0]))
        gap = max(STRAY_GAP, STRAY_GAP_EXTENTS * extent)
        is_far = [k != main and _distance(boxes[k], boxes[main]) > gap for k in range(len(boxes))]
        n_far = sum(c for c, far in zip(counts, is_far, strict=True) if far)
        is_few = n_far <= max(1, STRAY_SHARE * n.sum())
        return [(c, box, far and is_few) for c, box, far in zip(counts, boxes, is_far, strict=True)]


def _linked(low: Array, high: Array) -> NDArray[np.intp]:
    """Number of the group of each box; boxes nearer than STRAY_GAP are of one group."""
    from scipy.sparse.csgraph import connected_components  # noqa: PLC0415

    is_near = np.empty((len(low), len(low)), np.bool_)
    for k in range(len(low)):
        gap = np.maximum(0.0, np.maximum(low - high[k], low[k] - high))
        is_near[k] = np.linalg.norm(gap, axis=1) <= STRAY_GAP
    return np.asarray(connected_components(is_near, directed=False)[1])


def _distance(a: Bounds, b: Bounds) -> float:
    gap = np.maximum(0.0, np.maximum(a[0] - b[1], b[0] - a[1]))
    return float(np.linalg.norm(gap))
