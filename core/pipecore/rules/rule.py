"""Acceptance rules and their criteria: to what they apply, and what they allow."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from scipy.special import ndtri

from pipecore.formatting import format_clock
from pipecore.rules.measures import MEASURE_TEXTS, OF_DEPTH, Measure, in_metres, measure_of
from pipecore.rules.questions import QUESTIONS
from pipecore.types import (
    KIND_LABELS,
    Answers,
    Condition,
    Deformation,
    DeformationKind,
    Element,
    ElementKind,
    Question,
    Verdict,
)

NO_ANSWERS: Answers = {}
SAME_SIZE_SD = 2.0
"""A measured diameter this many SDs beside the end of a range may lie on either side of it."""
NO_TOP = math.sin(math.radians(45.0))
"""Steepness (upward part of the tangent) from which a pipe has no top and no bottom."""
CERTAINTY_PCT = 97.72
"""Probability with which a measure is beyond a limit, or within it: two standard deviations."""


@dataclass(frozen=True)
class Situation:
    """A deformation where it is, with what is known of it besides the scan.

    Parameters
    ----------
    deformation : Deformation
    element : Element
    wall_thickness : float
        Metres; 0 if it is not known.
    """

    deformation: Deformation
    element: Element
    wall_thickness: float = 0.0

    def answer(self, question: Question) -> bool | None:
        """Return what a person said: of the place, else of its element; None if nothing.

        Parameters
        ----------
        question : Question

        Returns
        -------
        bool or None
        """
        if question is Question.WALL:
            return True if self.wall_thickness > 0 else None
        of_element = self.element.answers.get(question)
        return self.deformation.answers.get(question, of_element)

    @property
    def is_steep(self) -> bool:
        """Whether the pipe is too steep there to have a top."""
        axis = self.element.axis
        within = min(max(self.deformation.chainage, 0.0), axis.length)
        return abs(float(axis.tangent(within)[2])) >= NO_TOP


@dataclass(frozen=True)
class Criterion:
    """A limit on one measure of some kinds of deformation.

    Parameters
    ----------
    kinds : tuple of DeformationKind
    measure : Measure
    limit : float
        In the measure's unit; more is rejected. 0 rejects whatever the criterion applies to.
    element_kinds : tuple of ElementKind
        Elements it applies to; empty means all.
    od_above_mm, od_up_to_mm : float
        Outside diameters it applies to; the upper bound belongs to it. A measured diameter
        within `SAME_SIZE_SD` of a bound belongs to both sides.
    d_over_t_above, d_over_t_up_to : float
        Ratios of outside diameter to wall thickness that it applies to.
    clock : tuple of float
        From where to where around it applies, clockwise, radians from 12:00; empty: all round.
    when : mapping of Question to bool
        It applies only if the questions are answered so.
    unless : mapping of Question to bool
        It applies unless one of the questions is answered so.
    needs : mapping of Question to bool
        It accepts only if the questions are answered so.
    condition : Condition, optional
        How soon a repair is asked for beyond the limit.
    verdict : Verdict
        What is said beyond the limit: reject, or review.
    """

    kinds: tuple[DeformationKind, ...]
    measure: Measure
    limit: float
    element_kinds: tuple[ElementKind, ...] = ()
    od_above_mm: float = 0.0
    od_up_to_mm: float = math.inf
    d_over_t_above: float = 0.0
    d_over_t_up_to: float = math.inf
    clock: tuple[float, float] | None = None
    when: Mapping[Question, bool] = field(default_factory=dict)
    unless: Mapping[Question, bool] = field(default_factory=dict)
    needs: Mapping[Question, bool] = field(default_factory=dict)
    condition: Condition | None = None
    verdict: Verdict = Verdict.REJECT

    def covers(self, kind: DeformationKind, element: Element) -> bool:
        """Return whether this criterion may apply to deformations of a kind on an element.

        Parameters
        ----------
        kind : DeformationKind
        element : Element

        Returns
        -------
        bool
        """
        return (
            kind in self.kinds
            and (not self.element_kinds or element.kind in self.element_kinds)
            and self._has_size(element)
        )

    def _has_size(self, element: Element) -> bool:
        if element.nominal is not None:
            diameter, slack = 1e3 * element.nominal.outside_diameter, 0.0
        else:
            diameter = 2e3 * element.radius
            slack = 2e3 * SAME_SIZE_SD * element.radius_sd
            slack = slack if math.isfinite(slack) else 0.0
        return self.od_above_mm - slack < diameter <= self.od_up_to_mm + slack

    def applies(self, situation: Situation) -> tuple[bool, Answers]:
        """Return whether this criterion applies, and the answers that would make it not apply.

        Parameters
        ----------
        situation : Situation

        Returns
        -------
        applies : bool
        ruled_out_by : mapping of Question to bool
            Empty if it applies for certain; else what is not answered yet.
        """
        element, deformation = situation.element, situation.deformation
        if not self.covers(deformation.kind, element):
            return False, NO_ANSWERS
        if self.clock is not None and not situation.is_steep:
            low, high = self.clock
            if (deformation.clock - low) % math.tau > (high - low) % math.tau:
                return False, NO_ANSWERS
        ruled_out_by: dict[Question, bool] = {}
        if self.d_over_t_above > 0 or math.isfinite(self.d_over_t_up_to):
            if not situation.wall_thickness > 0:
                ruled_out_by[Question.WALL] = True
            else:
                ratio = 2 * element.radius / situation.wall_thickness
                if not self.d_over_t_above < ratio <= self.d_over_t_up_to:
                    return False, NO_ANSWERS
        for question, wanted in self.when.items():
            answer = situation.answer(question)
            if answer is None:
                ruled_out_by[question] = not wanted
            elif answer != wanted:
                return False, NO_ANSWERS
        if any(situation.answer(question) == so for question, so in self.unless.items()):
            return False, NO_ANSWERS
        return True, ruled_out_by

    def judge(self, situation: Situation, certainty_pct: float = CERTAINTY_PCT) -> Verdict:
        """Return what the measure alone says, as if the criterion applied.

        Parameters
        ----------
        situation : Situation
        certainty_pct : float
            Probability with which the measure has to be within the limit, or beyond it.

        Returns
        -------
        Verdict
        """
        if self.limit == 0:
            return self.verdict
        value, sd = measure_of(self.measure, situation.deformation, situation.element)
        if not math.isfinite(value) or not math.isfinite(sd):
            return Verdict.NOT_MEASURABLE
        band = float(ndtri(certainty_pct / 100)) * sd
        if value - band > self.limit:
            return self.verdict
        if value + band < self.limit:
            return Verdict.ACCEPT
        return Verdict.REVIEW

    def __str__(self) -> str:
        """Return the criterion in words."""
        parts = [", ".join(self.kinds)]
        if self.element_kinds:
            parts.append("on " + ", ".join(KIND_LABELS[k].lower() for k in self.element_kinds))
        if self.od_above_mm > 0:
            parts.append(f"OD above {self.od_above_mm:g} mm")
        if math.isfinite(self.od_up_to_mm):
            parts.append(f"OD up to {self.od_up_to_mm:g} mm")
        if self.d_over_t_above > 0:
            parts.append(f"D/t above {self.d_over_t_above:g}")
        if math.isfinite(self.d_over_t_up_to):
            parts.append(f"D/t up to {self.d_over_t_up_to:g}")
        if self.clock is not None:
            parts.append("from {} to {} o'clock".format(*map(format_clock, self.clock)))
        parts += [_phrase(q, wanted) for q, wanted in self.when.items()]
        parts += ["unless " + _phrase(q, wanted) for q, wanted in self.unless.items()]
        allowed = MEASURE_TEXTS[self.measure].format(self.limit) if self.limit else "none allowed"
        allowed += "".join(f", if {_phrase(q, wanted)}" for q, wanted in self.needs.items())
        if self.condition is not None:
            allowed += f" (else: {self.condition})"
        elif self.verdict is Verdict.REVIEW:
            allowed += " (else: review)"
        return " · ".join(parts) + ": " + allowed


def _phrase(question: Question, answer: bool) -> str:
    return QUESTIONS[question].yes if answer else QUESTIONS[question].no


@dataclass(frozen=True)
class Rule:
    """An acceptance rule with its source.

    Parameters
    ----------
    name : str
        What the setting calls it: its file's name without ending.
    title : str
        What a person calls it.
    source : str
        The code or standard that the limits are from.
    note : str
    criteria : tuple of Criterion
    edition, paragraph : str
        Of the code, where the rule is of one.
    certainty_pct : float
        Probability with which a measure has to be within a limit to be accepted, or beyond
        it to be rejected; between them a person has to look.
    """

    name: str
    title: str
    source: str
    note: str
    criteria: tuple[Criterion, ...]
    edition: str = ""
    paragraph: str = ""
    certainty_pct: float = CERTAINTY_PCT

    @property
    def citation(self) -> str:
        """The source with its paragraph and edition."""
        return ", ".join(filter(None, (self.source, self.paragraph, self.edition)))


@dataclass(frozen=True)
class DentLimit:
    """How deep a dent of an element may be, and what says so.

    Parameters
    ----------
    depth : float
        Metres; a deeper dent is rejected.
    criterion : Criterion
    rule : Rule
        The rule that it is of.
    """

    depth: float
    criterion: Criterion
    rule: Rule


def dent_limit(element: Element, rules: Iterable[Rule]) -> DentLimit | None:
    """Return the strictest limit that rules set on the depth of any dent of an element.

    Limits that depend on where a dent is, or on what nobody has answered, are left out.

    Parameters
    ----------
    element : Element
    rules : iterable of Rule

    Returns
    -------
    DentLimit or None
        None if the rules set no such limit.
    """
    limits = [
        DentLimit(criterion.limit * in_metres(criterion.measure, element), criterion, rule)
        for rule in rules
        for criterion in rule.criteria
        if criterion.measure in OF_DEPTH
        and criterion.limit > 0
        and criterion.clock is None
        and criterion.covers(DeformationKind.DENT, element)
        and all(element.answers.get(q) == wanted for q, wanted in criterion.when.items())
        and not any(element.answers.get(q) == so for q, so in criterion.unless.items())
    ]
    return min(limits, key=lambda limit: limit.depth, default=None)
