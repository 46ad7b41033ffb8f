"""Judging a result anew: other rules, other sizes, answers of a person. Needs no points."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from pipecore.catalogues import with_sizes
from pipecore.editing.changes import find, judged, noted, with_element
from pipecore.errors import EditError, SettingsError
from pipecore.reasons import Reason
from pipecore.rules import QUESTIONS
from pipecore.settings import JUDGING_KEYS
from pipecore.types import Answers, Deformation, Question, Result

OTHER_WALL = Reason("It was computed for another wall thickness: detect again.")


def judge_again(result: Result, changes: Mapping[str, Any]) -> Result:
    """Judge all deformations by other rules, wall thickness or catalogues.

    Parameters
    ----------
    result : Result
    changes : mapping of str to object
        New values of `JUDGING_KEYS`, by dotted key; for all elements.

    Returns
    -------
    Result
        With the settings changed, nominal sizes looked up anew (confirmed ones are kept) and
        new verdicts. Strains of another wall thickness are taken away.

    Raises
    ------
    SettingsError
        If a setting is none of these or does not fit, or a rule cannot be read.
    """
    for key in changes:
        if key not in JUDGING_KEYS:
            raise SettingsError("The setting “{key}” needs a detection.", key=key)
    settings = result.settings.replace(changes)
    own = {i: s.replace(changes) for i, s in result.own_settings.items()}
    changed = replace(result, settings=settings, own_settings=own)
    is_thicker = {
        e.element_id: result.settings_of(e.element_id).deformation.wall_thickness_mm
        != changed.settings_of(e.element_id).deformation.wall_thickness_mm
        for e in result.elements
    }
    sized = tuple(
        with_sizes(e, changed.settings_of(e.element_id).elements) for e in result.elements
    )
    deformations = tuple(
        _without_strain(d) if is_thicker[d.element_id] else d for d in result.deformations
    )
    return judged(replace(changed, elements=sized, deformations=deformations))


def _without_strain(deformation: Deformation) -> Deformation:
    if not np.isfinite(deformation.strain):
        return deformation
    why = {**deformation.not_measurable, "strain": OTHER_WALL}
    return replace(deformation, strain=np.nan, not_measurable=why)


def answer_for_deformation(
    result: Result, deformation_id: int, question: Question, answer: bool | None
) -> Result:
    """Record what a person says of a deformation, and judge it anew.

    Parameters
    ----------
    result : Result
    deformation_id : int
    question : Question
    answer : bool or None
        None for open again.

    Returns
    -------
    Result
        With the change noted in `edits`.

    Raises
    ------
    EditError
        If there is no such deformation, or a setting answers the question.
    """
    _check(question)
    try:
        deformation = result.deformation(deformation_id)
    except KeyError as error:
        raise EditError("There is no deformation {number}.", number=deformation_id) from error
    told = replace(deformation, answers=_answered(deformation.answers, question, answer))
    changed = replace(
        result,
        deformations=tuple(
            told if d.deformation_id == deformation_id else d for d in result.deformations
        ),
    )
    what = f"deformation {deformation_id}: {_words(question, answer)}"
    return noted(changed, what)


def answer_for_element(
    result: Result, element_id: int, question: Question, answer: bool | None
) -> Result:
    """Record what a person says of an element, and judge its deformations anew.

    Parameters
    ----------
    result : Result
    element_id : int
    question : Question
    answer : bool or None
        None for open again.

    Returns
    -------
    Result
        With the change noted in `edits`.

    Raises
    ------
    EditError
        If there is no such element, or a setting answers the question.
    """
    _check(question)
    element = find(result, element_id)
    told = replace(element, answers=_answered(element.answers, question, answer))
    return noted(with_element(result, told), f"{element.label}: {_words(question, answer)}")


def _check(question: Question) -> None:
    if question is Question.WALL:
        raise EditError("The wall thickness is a setting.")


def _answered(answers: Answers, question: Question, answer: bool | None) -> Answers:
    others = {q: a for q, a in answers.items() if q is not question}
    known = others if answer is None else others | {question: answer}
    return {q: known[q] for q in Question if q in known}


def _words(question: Question, answer: bool | None) -> str:
    if answer is None:
        return f"“{question}” is open"
    return QUESTIONS[question].yes if answer else QUESTIONS[question].no
