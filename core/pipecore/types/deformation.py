"""Deformations of elements, what a rule says of them, and what a person does."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np

from pipecore.display import Summarised
from pipecore.formatting import format_clock, format_measure
from pipecore.reasons import Reason
from pipecore.types.arrays import Array
from pipecore.types.ids import NO_ID
from pipecore.types.judgement import Answers, Condition, Question, Verdict


class DeformationKind(StrEnum):
    """What a deformation is; the values are those of the report."""

    DENT = "dent"
    BULGE = "bulge"
    OVALITY = "ovality"
    BOW = "bow"
    KINK = "kink"
    CRUMPLE = "crumple"
    """Rings of larger and smaller radius in turn."""
    TWIST = "twist"
    """Ovality whose direction turns along the pipe."""
    CRUSHED = "crushed"
    """Too far gone to be one of the others."""


class SeenBy(StrEnum):
    """What saw a deformation; the values are those of the report."""

    MAP = "map"
    """The deviation map."""
    CENTRES = "centres"
    """Centres of profiles that leave the axis (paper, figure 8)."""
    AXES = "axes"
    """Semi-axes that shrink or grow against the element's pattern (paper, figures 7 and 13)."""
    CURVATURE = "curvature"
    """Curvature that varies around the section (paper, figures 14 and 15)."""
    GAP = "gap"
    """Profiles that are missing inside the pipe (paper, figure 11)."""


@dataclass(frozen=True, eq=False, repr=False)
class Deformation(Summarised):
    """A place where an element leaves its shape.

    Parameters
    ----------
    deformation_id, element_id : int
    kind : DeformationKind
    chainage, chainage_start, chainage_end : float
        Of the peak and of the extent, metres from the element's start.
    clock : float
        Clock angle of the peak, radians, 0 = 12:00, clockwise looking along the chainage.
    peak : ndarray
        The peak on the surface, shape (3,).
    depth, depth_sd : float
        Magnitude (outward for a bulge) against the undented contour, metres.
    length, width : float
        Extent along the axis and around the circumference, metres.
    ovality, strain : float
        As ratios; nan where they do not apply or cannot be measured.
    n_points : int
    rule : str
        Name of the rule that gave the verdict, or of those that did, joined by +.
    verdict : Verdict
    significance : float
        Depth in units of its own noise.
    area, volume : float
        Of a dent or bulge: what it covers of the undented surface (m²), and what lies
        between the two surfaces (m³); nan for the other kinds.
    fitting_id : int
        The nearest flange, bend or other fitting of the run, `NO_ID` if it has none; the
        own element's id if the deformation lies on a fitting.
    fitting_distance : float
        Distance along the run from the peak to where that begins, metres; 0 on a fitting.
    next_id : int
        The nearest other dent or bulge of the run, `NO_ID` if there is none.
    next_distance : float
        Distance over the surface from edge to edge of the two, metres; 0 if they overlap.
    interacts : bool
        Whether that is at most one outside diameter.
    seen_by : tuple of SeenBy
        What saw it, in the order of `SeenBy`.
    dmax, dmin : float
        Largest and smallest diameter in its profiles, metres; nan where the arc cannot carry them.
    not_measurable : mapping of str to Reason
        Why what is nan could not be measured, by the name of the field; what does not
        apply to the kind is not in it. Empty where all was measured.
    condition : Condition, optional
        How soon the rule asks for a repair, if it says so.
    open_questions : mapping of Question to bool
        Of `Verdict.ACCEPT_IF`: the answers that would make it an acceptance.
    verdict_reason : Reason
        Why a person has to look although the measures would be accepted, or "".
    answers : mapping of Question to bool
        What a person said of this place; it goes before what is said of its element.
    """

    deformation_id: int
    element_id: int
    kind: DeformationKind
    chainage: float
    chainage_start: float
    chainage_end: float
    clock: float
    peak: Array
    depth: float
    depth_sd: float
    length: float
    width: float
    ovality: float = np.nan
    strain: float = np.nan
    n_points: int = 0
    rule: str = ""
    verdict: Verdict = Verdict.NOT_MEASURABLE
    significance: float = np.nan
    area: float = np.nan
    volume: float = np.nan
    fitting_id: int = NO_ID
    fitting_distance: float = np.nan
    next_id: int = NO_ID
    next_distance: float = np.nan
    interacts: bool = False
    seen_by: tuple[SeenBy, ...] = ()
    dmax: float = np.nan
    dmin: float = np.nan
    not_measurable: Mapping[str, Reason] = field(default_factory=dict)
    condition: Condition | None = None
    open_questions: Mapping[Question, bool] = field(default_factory=dict)
    verdict_reason: Reason = Reason()
    answers: Answers = field(default_factory=dict)

    def _title(self) -> str:
        return f"Deformation {self.deformation_id}"

    def _facts(self) -> dict[str, str]:
        size = "height" if self.kind is DeformationKind.BULGE else "depth"
        facts = {
            "kind": str(self.kind),
            "element": str(self.element_id),
            size: format_measure(1000 * self.depth, 1000 * self.depth_sd, "mm"),
            "chainage": f"{self.chainage:.3f} m",
            "clock": format_clock(self.clock),
            "verdict": str(self.verdict),
        }
        return {name: text for name, text in facts.items() if text}


class ReviewState(StrEnum):
    """What a person decided about a deformation; the values are those of the report."""

    OPEN = "open"
    ACCEPTED = "accepted"
    REJECTED = "rejected"


@dataclass(frozen=True)
class Review:
    """A person's word on a deformation, beside the rule's verdict.

    Parameters
    ----------
    state : ReviewState
    comment : str
    """

    state: ReviewState = ReviewState.OPEN
    comment: str = ""
