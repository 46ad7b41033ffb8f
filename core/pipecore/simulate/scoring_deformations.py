"""Which reported deformations stand for which true ones."""

from dataclasses import dataclass, replace
from typing import TypedDict

import numpy as np

from pipecore.geometry import Array
from pipecore.simulate import TrueDeformation, TrueElement, Truth
from pipecore.types import Deformation, DeformationKind, Result

WHOLE_AXIS = (DeformationKind.BOW, DeformationKind.KINK)
"""Kinds that move the axis of the whole piece."""


@dataclass(frozen=True)
class DeformationMatch:
    """A true deformation with the reported one that stands for it."""

    true: TrueDeformation
    reported: Deformation

    @property
    def is_kind_right(self) -> bool:
        """Whether the reported kind is the true one."""
        return self.true.kind == self.reported.kind

    @property
    def depth_error(self) -> float:
        """Reported less true depth, metres."""
        return self.reported.depth - self.true.depth

    @property
    def length_ratio(self) -> float:
        """Reported over true length of the footprint."""
        return self.reported.length / self.true.length

    @property
    def width_ratio(self) -> float:
        """Reported over true width."""
        return self.reported.width / self.true.width

    @property
    def position_error(self) -> float:
        """Distance of the peaks, metres."""
        return float(np.linalg.norm(self.reported.peak - self.true.peak))

    @property
    def ovality_error(self) -> float:
        """Reported less true ovality, as a fraction."""
        return self.reported.ovality - self.true.ovality


class MatchedDeformations(TypedDict):
    """What `match_deformations` returns."""

    deformations: tuple[DeformationMatch, ...]
    missed_deformations: tuple[TrueDeformation, ...]
    false_deformations: tuple[Deformation, ...]
    duplicate_deformations: tuple[Deformation, ...]


def match_deformations(
    result: Result, truth: Truth, shift: Array, min_depth: float, min_seen: float
) -> MatchedDeformations:
    """Match each true deformation to the nearest reported one on it, of its kind if any is."""
    reported = [replace(d, peak=d.peak + shift) for d in result.deformations]
    pairs = [
        (t.kind is not d.kind, float(np.linalg.norm(t.peak - d.peak)), i, j)
        for i, t in enumerate(truth.deformations)
        for j, d in enumerate(reported)
        if _is_on(d, t, truth.element(t.element_id))
    ]
    reported_of: dict[int, int] = {}
    for _, _, i, j in sorted(pairs):
        if i not in reported_of and j not in reported_of.values():
            reported_of[i] = j
    on_something = {j for _, _, _, j in pairs}
    unmatched = [j for j in range(len(reported)) if j not in reported_of.values()]
    return {
        "deformations": tuple(
            DeformationMatch(truth.deformations[i], reported[j])
            for i, j in sorted(reported_of.items())
        ),
        "missed_deformations": tuple(
            t
            for i, t in enumerate(truth.deformations)
            if i not in reported_of and t.depth >= min_depth and t.seen >= min_seen
        ),
        "false_deformations": tuple(reported[j] for j in unmatched if j not in on_something),
        "duplicate_deformations": tuple(reported[j] for j in unmatched if j in on_something),
    }


def _is_on(reported: Deformation, true: TrueDeformation, element: TrueElement) -> bool:
    """Whether a reported peak lies on the footprint of a true deformation, or just beside."""
    if (reported.kind in WHOLE_AXIS) != (true.kind in WHOLE_AXIS):
        return False
    (chainage,), (offset,), (clock,) = element.axis.pipe_coordinates(reported.peak[None])
    radius = float(element.radius_at(true.chainage))
    margin = max(0.02, 0.25 * true.length)
    if not true.chainage_start - margin <= chainage <= true.chainage_end + margin:
        return False
    if abs(offset - radius) > 0.5 * radius:
        return False
    if true.kind not in (DeformationKind.DENT, DeformationKind.BULGE):
        return True
    around = radius * abs(np.mod(clock - true.clock + np.pi, 2 * np.pi) - np.pi)
    return bool(around <= true.width / 2 + max(0.02, 0.25 * true.width))
