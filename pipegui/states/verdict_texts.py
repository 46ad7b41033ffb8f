"""Verdicts and what the rules ask, in the words of the window."""

from pipecore.rules import QUESTIONS
from pipecore.types import Answers, Deformation, Question, Verdict
from pipegui.i18n.reason_texts import reason_text
from pipegui.i18n.texts import tr


def verdict_text(deformation: Deformation) -> str:
    """Return a verdict with how soon a repair is asked for, or with what it depends on.

    Parameters
    ----------
    deformation : Deformation

    Returns
    -------
    str
        Such as "reject, 60 days" or "accept if not on a weld".
    """
    if deformation.verdict is Verdict.ACCEPT_IF:
        return f"{tr(deformation.verdict)} {conditions_text(deformation.open_questions)}"
    if deformation.condition is not None:
        return f"{tr(deformation.verdict)}, {tr(deformation.condition)}"
    return tr(deformation.verdict)


def conditions_text(answers: Answers) -> str:
    """Return answers as conditions: "not on a weld, without gouge, crack and corrosion".

    Parameters
    ----------
    answers : mapping of Question to bool

    Returns
    -------
    str
    """
    return ", ".join(answer_text(question, answer) for question, answer in answers.items())


def answer_text(question: Question, answer: bool) -> str:
    """Return an answer to a question in words, such as "not on a weld".

    Parameters
    ----------
    question : Question
    answer : bool

    Returns
    -------
    str
    """
    text = QUESTIONS[question]
    return tr(text.yes if answer else text.no)


def why_text(deformation: Deformation) -> str:
    """Return by which rule a verdict is, and why a person has to look.

    Parameters
    ----------
    deformation : Deformation

    Returns
    -------
    str
    """
    by = tr("By the rule “{rule}”").format(rule=deformation.rule)
    why = reason_text(deformation.verdict_reason) if deformation.verdict_reason else ""
    return f"{by}. {why}" if why else by
