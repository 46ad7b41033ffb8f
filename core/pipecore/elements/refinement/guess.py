"""What a round of refinement starts from: a surface, its extent and its section."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipecore.elements.proposals import arc_direction
from pipecore.elements.refinement.section_model import SectionModel
from pipecore.elements.refinement.surface_fits import ArcSurface, LineSurface, SurfaceFit
from pipecore.geometry import ArcAxis, LineAxis, cross

Array = NDArray[np.float64]

MIN_SIGMA_M = 0.0005
"""No guess of the scatter is smaller."""
BAND_SIGMAS, MIN_BAND_M = 5.0, 0.0025
"""Points are on a surface up to so many standard deviations from it, at least this far."""


@dataclass(frozen=True, eq=False)
class Guess:
    """What a round of refinement begins with: a surface, how far it reaches, its section.

    The section model, if any, is counted along `axis`; `sigma` is the points' scatter about it.
    """

    model: LineSurface | ArcSurface
    axis: LineAxis | ArcAxis
    sigma: float
    section: SectionModel | None = None

    def after(self, fit: SurfaceFit[Any], low: float, high: float) -> "Guess":
        """The fitted surface between two chainages of the old axis, still without a section."""
        axis = axis_through(fit.model, self.axis.at(np.array([low, high])))
        return Guess(fit.model, axis, max(fit.sigma, MIN_SIGMA_M))


def axis_between(model: LineSurface | ArcSurface, low: float, high: float) -> LineAxis | ArcAxis:
    """The axis of a model between two of its chainages (lines) or angles (arcs)."""
    if isinstance(model, ArcSurface):
        return model.axis_from(arc_direction(model, low), high - low)
    return model.axis_between(low, high)


def axis_through(model: LineSurface | ArcSurface, ends: Array) -> LineAxis | ArcAxis:
    """The model's axis between the places nearest to two points."""
    if isinstance(model, LineSurface):
        low, high = (ends - model.middle) @ model.direction
        return model.axis_between(float(low), float(high))
    start, end = (e - model.centre for e in ends)
    axis = model.axis_from(start, 0.0)
    ahead = cross(axis.normal, axis.towards_start)
    angle = float(np.mod(np.arctan2(end @ ahead, end @ axis.towards_start), 2 * np.pi))
    return model.axis_from(start, angle)


def band_of(sigma: float) -> float:
    """Distance up to which points are on a surface, for their standard deviation; metres."""
    return max(BAND_SIGMAS * sigma, MIN_BAND_M)
