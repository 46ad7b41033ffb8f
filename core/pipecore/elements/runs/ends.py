"""Ends of elements that follow each other, and straights near a point."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipecore.geometry import AnyAxis, CurveAxis, LineAxis

Array = NDArray[np.float64]
End = tuple[int, int]
"""An end of an element: its number, and 0 for its start or 1 for its end."""
Link = tuple[int, int]
"""Numbers of two elements that belong together: of a fitting first, then of a straight."""

MEET_COS = float(np.cos(np.deg2rad(20.0)))
"""Elements follow each other if their axes turn by less than this angle where they meet."""
MEET_RADII = 3.0
"""Ends meet within this many radii along the axis …"""
MEET_OFFSET = 0.25
"""… and this share of a radius across it."""
COLLINEAR_GAP = 12.0
"""Straight pipes on one line and of one radius follow each other across this many radii."""


@dataclass(frozen=True, eq=False)
class AxisSpan:
    """What matters of an element for its neighbours: its axis and the radii at both ends."""

    axis: AnyAxis
    radii: tuple[float, float]


def _line_of(axis: AnyAxis) -> LineAxis | None:
    """A straight axis, or the chord of a bowed one."""
    if isinstance(axis, CurveAxis):
        return axis.chord
    return axis if isinstance(axis, LineAxis) else None


class LineIndex:
    """Straight axes and chords of bowed ones, to find those near a place among many."""

    def __init__(self, axes: Sequence[AnyAxis]) -> None:
        lines = {i: line for i, a in enumerate(axes) if (line := _line_of(a)) is not None}
        self._which = np.array(list(lines), np.intp)
        self._start = np.array([a.start for a in lines.values()]).reshape(-1, 3)
        self._direction = np.array([a.direction for a in lines.values()]).reshape(-1, 3)
        self._length = np.array([a.length for a in lines.values()])

    def near(self, place: Array, reach: Array) -> list[int]:
        """Numbers of the axes that pass a place within `reach` (metres, one of each axis)."""
        q = place - self._start
        along = np.einsum("ij,ij->i", q, self._direction)
        rho = np.linalg.norm(q - along[:, None] * self._direction, axis=1)
        r = reach[self._which]
        there = (rho < r) & (along > -r) & (along < self._length + r)
        return [int(i) for i in self._which[there]]


def meeting_ends(spans: list[AxisSpan]) -> list[tuple[int, int, int, int]]:
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
