"""What codes ask and a scan cannot answer, in words."""

from dataclasses import dataclass

from pipecore.types import Answers, Deformation, Question, Verdict


@dataclass(frozen=True)
class QuestionText:
    """A question in words.

    Parameters
    ----------
    question : str
        As a person is asked it.
    yes, no : str
        What is so if the answer is yes, or no: ends a sentence that begins with "accept if".
    is_of_element : bool
        Whether it is asked of the whole element, not of each place.
    """

    question: str
    yes: str
    no: str
    is_of_element: bool = False


QUESTIONS = {
    Question.WELD: QuestionText("Is it on a weld, or close to one?", "on a weld", "not on a weld"),
    Question.STRESS_RAISER: QuestionText(
        "Is there a gouge, groove, crack or corrosion in it?",
        "with a gouge, crack or corrosion",
        "without gouge, crack and corrosion",
    ),
    Question.HIGH_STRESS: QuestionText(
        "Is the pipe operated at 40 % of its yield strength (SMYS) or more?",
        "operated at 40 % SMYS or more",
        "operated below 40 % SMYS",
        is_of_element=True,
    ),
    Question.PRESSURISED: QuestionText(
        "Was the pipe under pressure when it was scanned?",
        "under pressure when scanned",
        "without pressure when scanned",
        is_of_element=True,
    ),
    Question.RESTRAINED: QuestionText(
        "Is what dented the pipe still there and holds the dent?", "held in place", "free to move"
    ),
    Question.WHOLE_JOINT: QuestionText(
        "Is this piece a whole joint, from weld to weld?",
        "a whole joint",
        "a piece of a joint",
        is_of_element=True,
    ),
    Question.BENT_PIPE: QuestionText(
        "Was this bend made of pipe, not bought as a fitting?",
        "bent of pipe",
        "a fitting",
        is_of_element=True,
    ),
    Question.EXTERNAL_PRESSURE: QuestionText(
        "Is the pipe under external pressure?",
        "under external pressure",
        "not under external pressure",
        is_of_element=True,
    ),
    Question.CLAD: QuestionText(
        "Was cladding or insulation scanned instead of the pipe?",
        "clad or insulated",
        "bare",
        is_of_element=True,
    ),
    Question.WALL: QuestionText(
        "How thick is the wall? (a setting)",
        "the wall thickness is set",
        "the wall thickness is set",
        is_of_element=True,
    ),
}
"""Every question in words."""


def accept_if(open_questions: Answers) -> str:
    """Return a verdict that depends on answers, in words.

    Parameters
    ----------
    open_questions : mapping of Question to bool
        The answers that would make it an acceptance.

    Returns
    -------
    str
        Such as "accept if not on a weld, without gouge, crack and corrosion".
    """
    return "accept if " + ", ".join(
        QUESTIONS[q].yes if answer else QUESTIONS[q].no for q, answer in open_questions.items()
    )


def verdict_words(deformation: Deformation) -> str:
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
        return accept_if(deformation.open_questions)
    soon = f", {deformation.condition}" if deformation.condition else ""
    return f"{deformation.verdict}{soon}"
