"""Candidates: what looked like a pipe and was not accepted."""

from dataclasses import dataclass, field

import numpy as np

from pipecore.geometry import AnyAxis
from pipecore.reasons import Reason
from pipecore.types.arrays import Array
from pipecore.types.element import KIND_LABELS, ElementKind, radius_along


def _no_centre() -> Array:
    return np.full(3, np.nan)


@dataclass(frozen=True, eq=False)
class Candidate:
    """A fitted surface that was nearly accepted as an element; nothing of it is measured yet.

    Parameters
    ----------
    candidate_id : int
        From 1, the nearest to acceptance first.
    kind : ElementKind
        What it would be.
    axis : LineAxis, CurveAxis or ArcAxis
        As far as it was followed.
    radius, radius_sd, radius_end : float
        Radius (at the start for a cone), its standard deviation, and the one at the end, metres.
    arc : float
        Median arc around the axis that its points cover, radians.
    rms : float
        Of the points about the surface, metres.
    n_points : int
        Downsampled points on it.
    reason : Reason
        Why it was not accepted, one sentence.
    value, limit : float
        What the reason compares, in `unit`; nan where it compares nothing.
    unit : str
        Such as "mm", "°", "%"; "" for a score.
    centre : ndarray
        Of a sphere or a bend, shape (3,); nan for the other kinds.
    """

    candidate_id: int
    kind: ElementKind
    axis: AnyAxis
    radius: float
    radius_sd: float
    radius_end: float
    arc: float
    rms: float
    n_points: int
    reason: Reason
    value: float
    limit: float
    unit: str
    centre: Array = field(default_factory=_no_centre)

    @property
    def label(self) -> str:
        """What people call it, such as "Pipe?" with its number."""
        return f"{KIND_LABELS[self.kind]} {self.candidate_id}?"

    def radius_at(self, chainage: Array | float) -> Array:
        """Radius of the fitted surface about the axis at `chainage`, metres.

        Parameters
        ----------
        chainage : array_like
            Metres.

        Returns
        -------
        ndarray
            Shape as of `chainage`.
        """
        return radius_along(self, chainage)
