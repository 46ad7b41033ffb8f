"""Verdicts: what rules say of a deformation, with what they ask and why a person has to look."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace

from pipecore.reasons import Reason
from pipecore.rules.measures import outside_diameter
from pipecore.rules.questions import QUESTIONS
from pipecore.rules.reading import load_rules
from pipecore.rules.rule import Criterion, Rule, Situation
from pipecore.settings import Settings
from pipecore.types import (
    NO_ID,
    Answers,
    Condition,
    Deformation,
    DeformationKind,
    Element,
    ElementKind,
    Question,
    Verdict,
)

WORST_FIRST = (Verdict.REJECT, Verdict.NOT_MEASURABLE, Verdict.REVIEW, Verdict.ACCEPT)
NOT_COVERED = Reason("No criterion of the rule says anything of it.")
ON_FITTING = Reason("It lies on a fitting or within one diameter of it.")
NO_TOP = Reason("The pipe is steep there: it has no top, and the limit is one for the top.")
CLAD = Reason("The cladding was scanned, not the pipe.")


@dataclass(frozen=True)
class Judgement:
    """What rules say of a deformation.

    Parameters
    ----------
    verdict : Verdict
    rule : str
        Names of the rules that say it, joined by +.
    condition : Condition, optional
        How soon a repair is asked for.
    open_questions : mapping of Question to bool
        The answers that would make it an acceptance.
    reason : Reason
        Why a person has to look although the measures would be accepted, or "".
    """

    verdict: Verdict
    rule: str
    condition: Condition | None = None
    open_questions: Answers = field(default_factory=dict)
    reason: Reason = Reason()


def judge(
    deformation: Deformation,
    element: Element,
    rules: Sequence[Rule],
    wall_thickness: float = 0.0,
) -> Judgement:
    """Return what rules say of a deformation: the worst that one of their criteria says.

    A criterion that depends on what nobody has answered never rejects: if it would, the
    verdict is "accept if" at best, and its questions are open.

    Parameters
    ----------
    deformation : Deformation
        With its neighbours (`relate_deformations`): dents that interact, or lie beside a
        fitting, are for a person.
    element : Element
        On which it is.
    rules : sequence of Rule
        Those that say nothing of its kind are passed over.
    wall_thickness : float
        Metres; 0 if it is not known.

    Returns
    -------
    Judgement
    """
    situation = Situation(deformation, element, wall_thickness)
    found = [
        (rule, criterion, ruled_out_by)
        for rule in rules
        for criterion in rule.criteria
        for applies, ruled_out_by in (criterion.applies(situation),)
        if applies
    ]
    names = "+".join(dict.fromkeys(r.name for r, _, _ in found) or [r.name for r in rules])
    if element.is_clad:
        return Judgement(Verdict.NOT_MEASURABLE, names, reason=CLAD)
    if not found:
        return Judgement(Verdict.REVIEW, names, reason=NOT_COVERED)

    verdict, open_questions = Verdict.ACCEPT, dict[Question, bool]()
    conditions: list[Condition] = []
    reason = _reason_to_look(deformation, element)
    if reason:
        verdict = Verdict.REVIEW
    for rule, criterion, ruled_out_by in found:
        said = criterion.judge(situation, rule.certainty_pct)
        if said is Verdict.ACCEPT:
            said = _needed(criterion, situation, open_questions)
        elif ruled_out_by:
            open_questions |= ruled_out_by
            continue
        elif criterion.clock is not None and situation.is_steep:
            said, reason = Verdict.REVIEW, reason or NO_TOP
        if said is criterion.verdict and criterion.condition is not None:
            conditions.append(criterion.condition)
        verdict = min(verdict, said, key=WORST_FIRST.index)
    if verdict is Verdict.ACCEPT:
        verdict = Verdict.ACCEPT_IF if open_questions else Verdict.ACCEPT
    is_open = verdict in (Verdict.ACCEPT_IF, Verdict.REVIEW)
    return Judgement(
        verdict,
        names,
        condition=min(conditions, key=list(Condition).index, default=None),
        open_questions=open_questions if is_open else {},
        reason=reason if verdict is Verdict.REVIEW else Reason(),
    )


def _needed(
    criterion: Criterion, situation: Situation, open_questions: dict[Question, bool]
) -> Verdict:
    """What an acceptance is worth with the answers that it needs; open ones are added."""
    for question, wanted in criterion.needs.items():
        answer = situation.answer(question)
        if answer is None:
            open_questions[question] = wanted
        elif answer != wanted:
            return Verdict.REVIEW
    return Verdict.ACCEPT


def _reason_to_look(deformation: Deformation, element: Element) -> Reason:
    """Why a dent is for a person whatever its depth; "" if nothing speaks for that."""
    d = deformation
    if d.kind is not DeformationKind.DENT:
        return Reason()
    if d.interacts:
        return Reason("It interacts with deformation {number}.", number=d.next_id)
    diameter = outside_diameter(element, d.chainage)
    beside = d.fitting_id != NO_ID and d.fitting_distance <= diameter
    on_pipe = element.kind in (ElementKind.CYLINDER, ElementKind.OTHER, ElementKind.SPHERE)
    return ON_FITTING if beside or not on_pipe else Reason()


def judge_all(
    deformations: Iterable[Deformation],
    elements: Iterable[Element],
    settings_of: Callable[[int], Settings],
) -> tuple[Deformation, ...]:
    """Judge deformations by the rules of the settings of their elements.

    Parameters
    ----------
    deformations : iterable of Deformation
        With their neighbours; see `judge`.
    elements : iterable of Element
    settings_of : callable
        Settings of an element by its id.

    Returns
    -------
    tuple of Deformation
        With rule, verdict, condition, open questions and reason.

    Raises
    ------
    SettingsError
        If a rule is not there or not valid.
    """
    by_id = {element.element_id: element for element in elements}
    loaded: dict[str, tuple[Rule, ...]] = {}
    judged = []
    for deformation in deformations:
        settings = settings_of(deformation.element_id).deformation
        if settings.rule not in loaded:
            loaded[settings.rule] = load_rules(settings.rule)
        said = judge(
            deformation,
            by_id[deformation.element_id],
            loaded[settings.rule],
            settings.wall_thickness_mm / 1e3,
        )
        judged.append(
            replace(
                deformation,
                rule=said.rule,
                verdict=said.verdict,
                condition=said.condition,
                open_questions=said.open_questions,
                verdict_reason=said.reason,
            )
        )
    return tuple(judged)


def questions_of(rules: Iterable[Rule], kind: DeformationKind, element: Element) -> list[Question]:
    """Return what rules ask of a kind of deformation on an element, in the order of `Question`.

    Parameters
    ----------
    rules : iterable of Rule
    kind : DeformationKind
    element : Element

    Returns
    -------
    list of Question
        Without those that a setting answers.
    """
    asked = {
        question
        for rule in rules
        for criterion in rule.criteria
        if criterion.covers(kind, element)
        for question in (*criterion.when, *criterion.unless, *criterion.needs)
    }
    return [question for question in QUESTIONS if question in asked - {Question.WALL}]
