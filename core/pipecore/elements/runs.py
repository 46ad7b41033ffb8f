"""Runs: elements whose ends meet, with straights and bends trimmed to their tangent points."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from pipecore.geometry import ArcAxis, LineAxis

Array = NDArray[np.float64]

MEET_COS = float(np.cos(np.deg2rad(20.0)))
"""Elements follow each other if their axes turn by less than this angle where they meet."""
MEET_RADII = 3.0
"""Ends meet within this many radii along the axis …"""
MEET_OFFSET = 0.25
"""… and this share of a radius across it."""
COLLINEAR_GAP = 12.0
"""Straight pipes on one line and of one radius follow each other across this many radii."""


@dataclass(frozen=True, eq=False)
class Span:
    """What matters of an element for its neighbours: its axis and the radii at both ends."""

    axis: LineAxis | ArcAxis
    radii: tuple[float, float]


class Lines:
    """Straight axes, to find those near a place among many."""

    def __init__(self, axes: Sequence[LineAxis | ArcAxis]) -> None:
        self._which = np.array([i for i, a in enumerate(axes) if isinstance(a, LineAxis)], np.intp)
        lines = [a for a in axes if isinstance(a, LineAxis)]
        self._start = np.array([a.start for a in lines]).reshape(-1, 3)
        self._direction = np.array([a.direction for a in lines]).reshape(-1, 3)
        self._length = np.array([a.length for a in lines])

    def near(self, place: Array, reach: Array) -> list[int]:
        """Numbers of the axes that pass a place within `reach` (metres, one of each axis)."""
        q = place - self._start
        along = np.einsum("ij,ij->i", q, self._direction)
        rho = np.linalg.norm(q - along[:, None] * self._direction, axis=1)
        r = reach[self._which]
        there = (rho < r) & (along > -r) & (along < self._length + r)
        return [int(i) for i in self._which[there]]


def meeting_ends(spans: list[Span]) -> list[tuple[int, int, int, int]]:
    """Pairs of ends that follow each other, as (element, end, element, end); end 0 is the start."""
    ends, outward, radii, owner = [], [], [], []
    for i, span in enumerate(spans):
        for end in (0, 1):
            ends.append(span.axis.end if end else span.axis.start)
            tangent = span.axis.tangent(span.axis.length if end else 0.0)
            outward.append(tangent if end else -tangent)
            radii.append(span.radii[end])
            owner.append(i)
    found = []
    taken: set[int] = set()
    candidates = []
    position, direction, radius = np.array(ends), np.array(outward), np.array(radii)
    for a in range(len(ends)):
        gap = position - position[a]
        along = gap @ direction[a]
        across = np.linalg.norm(gap - along[:, None] * direction[a], axis=1)
        turn = -(direction @ direction[a])
        smaller = np.minimum(radius, radius[a])
        same = np.abs(radius - radius[a]) < 0.15 * smaller
        reach = np.where(same, COLLINEAR_GAP, MEET_RADII) * smaller
        # On a long gap a bend would have left the line: only what is on it follows.
        offset = MEET_OFFSET * smaller
        fits = (along < reach) & (along > -1.5 * smaller) & (across < offset) & (turn > MEET_COS)
        fits &= np.abs(radius - radius[a]) < 0.8 * smaller
        candidates += [
            (abs(float(along[b])) + float(across[b]), a, b)
            for b in map(int, np.flatnonzero(fits))
            if owner[b] != owner[a]
        ]
    for _, a, b in sorted(candidates):
        if a not in taken and b not in taken:
            taken |= {a, b}
            found.append((owner[a], a % 2, owner[b], b % 2))
    return found


def number_runs(n_elements: int, links: list[tuple[int, int]]) -> NDArray[np.int32]:
    """Number of the run of each element, from 0: the components of the linked elements."""
    if not links:
        return np.arange(n_elements, dtype=np.int32)
    i, j = np.array(links).T
    graph = coo_array((np.ones(len(i), np.int8), (i, j)), shape=(n_elements, n_elements))
    _, label = connected_components(graph, directed=False)
    return np.asarray(label, np.int32)


def trim_to_tangent(
    line: LineAxis, line_end: int, arc: ArcAxis, arc_end: int, reach: float
) -> tuple[LineAxis, ArcAxis]:
    """End a straight and a bend where the bend's centre is abreast of the straight.

    Nothing changes if that place is further than `reach` from either end.
    """
    along = float((arc.centre - line.start) @ line.direction)
    corner = line.at(along)
    spoke = corner - arc.centre
    ahead = np.cross(arc.normal, arc.towards_start)
    angle = float(np.arctan2(spoke @ ahead, spoke @ arc.towards_start))
    half = arc.bend_angle / 2
    angle = half + np.mod(angle - half + np.pi, 2 * np.pi) - np.pi
    line_change = abs(along - (line.length if line_end else 0.0))
    arc_change = abs(angle - (arc.bend_angle if arc_end else 0.0)) * arc.bend_radius
    if line_change > reach or arc_change > reach:
        return line, arc
    low, high = (0.0, along) if line_end else (along, line.length)
    first, last = (0.0, angle) if arc_end else (angle, arc.bend_angle)
    if high - low < 0.1 * reach or last - first < np.deg2rad(5.0):
        return line, arc
    turned = np.cos(first) * arc.towards_start + np.sin(first) * ahead
    return (
        LineAxis(line.at(low), line.direction, high - low),
        ArcAxis(arc.centre, arc.normal, turned, arc.bend_radius, last - first),
    )


def trim_to_reducer(line: LineAxis, reducer: LineAxis) -> LineAxis:
    """End a straight where a reducer on its line begins.

    Nothing changes if that place is further from its end than the reducer is long, so that
    what is hidden of it stays so.
    """
    low, high = sorted(
        float((end - line.start) @ line.direction) for end in (reducer.start, reducer.end)
    )
    is_ahead = low + high > line.length
    place = low if is_ahead else high
    change = abs(place - (line.length if is_ahead else 0.0))
    if change > reducer.length:
        return line
    first, last = (0.0, place) if is_ahead else (place, line.length)
    return LineAxis(line.at(first), line.direction, last - first) if last > first else line
