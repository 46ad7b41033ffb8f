"""Elements: pipes, bends, reducers and whatever else a run is made of."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Protocol

import numpy as np

from pipecore.display import Summarised
from pipecore.formatting import format_measure
from pipecore.geometry import AnyAxis
from pipecore.reasons import Reason
from pipecore.types.arrays import Array
from pipecore.types.judgement import Answers, Question


class ElementKind(StrEnum):
    """What an element is; the values are those of the report."""

    CYLINDER = "cylinder"
    CONE = "cone"
    SPHERE = "sphere"
    TORUS = "torus"
    FLANGE = "flange"
    TEE = "tee"
    OTHER = "other"


KIND_LABELS = {
    ElementKind.CYLINDER: "Pipe",
    ElementKind.CONE: "Reducer",
    ElementKind.SPHERE: "Sphere",
    ElementKind.TORUS: "Bend",
    ElementKind.FLANGE: "Flange",
    ElementKind.TEE: "Tee",
    ElementKind.OTHER: "Element",
}
"""Label of an element of a kind that has no name of its own, such as "Pipe"."""


@dataclass(frozen=True)
class NominalSize:
    """A catalogue size: its name (such as "DN 150 / NPS 6") and outside diameter in metres.

    Parameters
    ----------
    name : str
        Such as "DN 150 / NPS 6".
    outside_diameter : float
        Metres.
    catalogue : str
        The catalogue that it is from, or "".
    """

    name: str
    outside_diameter: float
    catalogue: str = ""


@dataclass(frozen=True, eq=False, repr=False)
class Element(Summarised):
    """One piece of a pipe run with one kind of surface about one axis.

    Parameters
    ----------
    element_id, run_id : int
    kind : ElementKind
    axis : LineAxis or ArcAxis
        As scanned: it starts and ends where the points do. A sphere's axis is the
        straight line along which its profiles were cut; see `centre`.
    radius, radius_sd : float
        Radius (at the start for a cone) and its standard deviation, metres.
    radius_end : float
        Radius at the end of a cone; equal to `radius` for the other kinds.
    centre : ndarray
        Centre of a sphere or of a torus's bend, shape (3,); nan for the other kinds.
    n_points, n_profiles : int
        Points of the full cloud on it; profiles with an accepted ellipse.
    arc : float
        Median arc around the axis that its profiles see, radians.
    rms : float
        Root mean square of the points' distances from the fitted surface, metres.
    ovality, ovality_sd : float
        (Dmax - Dmin) / Dnom as a ratio; nan where the arc cannot carry it.
    straightness : float
        Largest distance of the measured axis from the chord of its ends, metres.
    nominal : NominalSize, optional
        The catalogue size within tolerance, if any; of a cone that of its start.
    gaps : tuple of (float, float)
        Chainage ranges without profiles (paper, figure 11).
    not_measurable : mapping of str to Reason
        Why what is nan could not be measured, by the name of the field; what does not
        apply to the kind is not in it.
    name : str
        What the user calls it, or "".
    nominal_end : NominalSize, optional
        Of a cone: the catalogue size of its end.
    other_nominal : NominalSize, optional
        Another size that the measured diameter does not rule out, the nearest one.
    is_nominal_confirmed : bool
        Whether a person chose the size; then limits in percent refer to its diameter.
    answers : mapping of Question to bool
        What a person said of the whole element: whether it is clad, a whole joint, …
    accepted_by : str
        "person" if a person accepted it among the candidates, else "".
    """

    element_id: int
    run_id: int
    kind: ElementKind
    axis: AnyAxis
    radius: float
    radius_sd: float
    radius_end: float
    centre: Array
    n_points: int
    n_profiles: int
    arc: float
    rms: float
    ovality: float = np.nan
    ovality_sd: float = np.nan
    straightness: float = np.nan
    nominal: NominalSize | None = None
    gaps: tuple[tuple[float, float], ...] = ()
    not_measurable: Mapping[str, Reason] = field(default_factory=dict)
    name: str = ""
    nominal_end: NominalSize | None = None
    other_nominal: NominalSize | None = None
    is_nominal_confirmed: bool = False
    answers: Answers = field(default_factory=dict)
    accepted_by: str = ""

    @property
    def is_clad(self) -> bool:
        """Whether a person said that what was scanned is cladding or insulation."""
        return self.answers.get(Question.CLAD, False)

    @property
    def label(self) -> str:
        """What people call it: its own name, else such as "Pipe 3" or "Bend 4"."""
        return self.name or f"{KIND_LABELS[self.kind]} {self.element_id}"

    def _title(self) -> str:
        return f"Element {self.label}"

    def _facts(self) -> dict[str, str]:
        facts = {
            "run": str(self.run_id),
            "size": self.nominal.name if self.nominal else "",
            "radius": format_measure(1000 * self.radius, 1000 * self.radius_sd, "mm"),
            "length": f"{self.axis.length:.3f} m",
            "arc": f"{np.rad2deg(self.arc):.0f}°",
            "ovality": format_measure(100 * self.ovality, 100 * self.ovality_sd, "%"),
            "points": f"{self.n_points:,}",
        }
        return {name: text for name, text in facts.items() if text}

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


class SurfaceOfRevolution(Protocol):
    """What elements and candidates have in common: a radius along an axis."""

    @property
    def kind(self) -> ElementKind:
        """What it is."""

    @property
    def axis(self) -> AnyAxis:
        """As far as the surface goes."""

    @property
    def radius(self) -> float:
        """At the start of the axis, metres."""

    @property
    def radius_end(self) -> float:
        """At its end, metres."""

    @property
    def centre(self) -> Array:
        """Of a sphere or a bend, shape (3,)."""

    def radius_at(self, chainage: Array | float, /) -> Array:
        """Radius at `chainage`, metres.

        Parameters
        ----------
        chainage : array_like
            Along the axis, metres.

        Returns
        -------
        ndarray
            Shape as of `chainage`.
        """


def radius_along(surface: SurfaceOfRevolution, chainage: Array | float) -> Array:
    """Radius about the axis at `chainage`, metres, of an element or a candidate."""
    s = np.asarray(chainage, dtype=np.float64)
    if surface.kind is ElementKind.SPHERE:
        along = (surface.centre - surface.axis.start) @ surface.axis.tangent(0.0)
        return np.sqrt(np.maximum(surface.radius**2 - (s - along) ** 2, 0.0))
    slope = (surface.radius_end - surface.radius) / surface.axis.length
    return np.asarray(surface.radius + slope * s)
