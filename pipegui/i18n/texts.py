"""What the window says, in the language that was chosen. Qt-free.

Texts stand in the code in English; `tr` looks their translation up when they are shown, `mark`
marks those of tables for it. Numbers keep the decimal point in every language, so that they
can be compared with the tables of a report.
"""

import gettext
from enum import StrEnum
from types import SimpleNamespace
from typing import Any

from pipecore.errors import PipecoreError
from pipecore.formatting import NOT_MEASURABLE
from pipecore.formatting import format_measure as _format_measure
from pipecore.resources import resource
from pipecore.types import KIND_LABELS, Candidate, Element, Result

LANGUAGES = {"": "System", "en": "English", "de": "Deutsch"}
"""Names of the languages by their codes, each in its own; "" is the system's."""
DOMAIN = "pipegui"
TRANSLATED_VALUES = ("cause", "reason", "shape")
"""What the core's errors call values that are texts of the core too; the others are names."""
KEEPS_CAPITALS = ("de",)
"""Languages that write nouns with a capital within a sentence too."""


class _ChosenLanguage:
    """The language in use; the tests and the library speak English."""

    code = "en"
    catalogue: gettext.NullTranslations = gettext.NullTranslations()


def use_language(chosen: str, system: str = "") -> None:
    """Speak a language from now on: the chosen one, else the system's (such as "de-AT")."""
    code = chosen or system[:2].lower()
    _ChosenLanguage.code = code if code in LANGUAGES and code else "en"
    _ChosenLanguage.catalogue = gettext.NullTranslations()
    if _ChosenLanguage.code != "en":
        _ChosenLanguage.catalogue = gettext.translation(
            DOMAIN, resource("locale"), [_ChosenLanguage.code]
        )


def language() -> str:
    """Return the code of the language in use."""
    return _ChosenLanguage.code


def mark(text: str) -> str:
    """Mark a text for translation that is looked up only where it is shown."""
    return text


def tr(text: str) -> str:
    """Return a text in the language in use."""
    return _ChosenLanguage.catalogue.gettext(text) if text else ""


def trn(singular: str, plural: str, number: int) -> str:
    """Return the form of a text that goes with a number."""
    return _ChosenLanguage.catalogue.ngettext(singular, plural, number)


def count(singular: str, plural: str, number: int) -> str:
    """Return a counted noun, such as "1,204 points", from two forms with "{n:,}"."""
    return trn(singular, plural, number).format(n=number)


def plain_title(title: str) -> str:
    """Return the title of a menu without the mark of its key."""
    return title.replace("&", "")


def inside(text: str) -> str:
    """Return a name as it is written within a sentence."""
    return text if _ChosenLanguage.code in KEEPS_CAPITALS else text[:1].lower() + text[1:]


def first_capital(text: str) -> str:
    """Return a text as it is written at the start of a line."""
    return text[:1].upper() + text[1:]


def label_of(element: Element) -> str:
    """Return the name of an element: its own, else such as "Pipe 3"."""
    kind = element.label.removesuffix(f" {element.element_id}")
    return element.name or f"{tr(kind)} {element.element_id}"


def candidate_label(candidate: Candidate) -> str:
    """Return the name of a candidate, such as "Pipe 3?"."""
    return f"{tr(KIND_LABELS[candidate.kind])} {candidate.candidate_id}?"


def run_label(result: Result, run_id: int) -> str:
    """Return the name of a run: its own, else such as "Run 3"."""
    return result.run_names.get(run_id) or tr("Run {run_id}").format(run_id=run_id)


def error_text(error: Exception) -> str:
    """Return the message of an error in the language in use."""
    if not isinstance(error, PipecoreError):
        return str(error)
    values = {name: _display_value(name, value) for name, value in error.values.items()}
    return tr(error.template).format(**values) if values else tr(error.template)


def _display_value(name: str, value: object) -> object:
    match value:
        case PipecoreError():
            return error_text(value)
        case Element():
            return SimpleNamespace(label=label_of(value))
        case tuple() if all(isinstance(item, Element) for item in value):
            *others, last = [label_of(element) for element in value]
            return ", ".join(others) + tr(" and ") + last if others else last
        case str() if isinstance(value, StrEnum) or name in TRANSLATED_VALUES:
            return tr(value)
    return value


def format_measure(*args: Any, **options: Any) -> str:
    """Return a number with its uncertainty and unit as the reports do, or why there is none."""
    text = _format_measure(*args, **options)
    return tr(text) if text == NOT_MEASURABLE else text
