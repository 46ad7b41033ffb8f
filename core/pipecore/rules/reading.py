"""Reading acceptance rules from data files, and checking them in full."""

import math
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pipecore.errors import SettingsError
from pipecore.resources import resource
from pipecore.rules.measures import Measure
from pipecore.rules.rule import Criterion, Rule
from pipecore.types import Condition, DeformationKind, ElementKind, Question, Verdict

NUMBERS = "od_above_mm", "od_up_to_mm", "d_over_t_above", "d_over_t_up_to"
ANSWERS = "when", "unless", "needs"
CLOCK = re.compile(r"(\d{1,2}):([0-5]\d)")
TEXTS = "title", "source", "note", "edition", "paragraph"


def list_rules() -> tuple[Rule, ...]:
    """Return the rules that come with the program, by name.

    Returns
    -------
    tuple of Rule
    """
    rules = (_read(path) for path in resource("rules").glob("*.toml"))
    return tuple(sorted(rules, key=lambda rule: rule.name))


def load_rules(names: str) -> tuple[Rule, ...]:
    """Read several rules.

    Parameters
    ----------
    names : str
        Their names or files, separated by commas; see `load_rule`.

    Returns
    -------
    tuple of Rule
        At least one, each once.

    Raises
    ------
    SettingsError
        If one is not there or not valid, or none is named.
    """
    given = list(dict.fromkeys(name.strip() for name in names.split(",") if name.strip()))
    return tuple(load_rule(name) for name in given or [names])


def load_rule(name: str) -> Rule:
    """Read an acceptance rule by its name or from a file.

    Parameters
    ----------
    name : str
        Name of a rule that comes with the program, or path of a file that ends in ``.toml``.

    Returns
    -------
    Rule

    Raises
    ------
    SettingsError
        If there is no such rule, or its file is not a valid rule.
    """
    is_path = name.endswith(".toml")
    path = Path(name) if is_path else resource("rules", f"{name}.toml")
    if not path.is_file():
        known = ", ".join(rule.name for rule in list_rules())
        if is_path:
            raise SettingsError("There is no rule file {path}.", path=path)
        raise SettingsError(
            "There is no acceptance rule “{name}”; choose one of {known}, or a .toml file.",
            name=name,
            known=known,
        )
    return _read(path)


def _read(path: Path) -> Rule:
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8-sig"))
        criteria = tuple(_criterion(c) for c in data.pop("criteria"))
        if not criteria:
            raise ValueError("it has no criteria")
        for name in TEXTS:
            if name in data and not isinstance(data[name], str):
                raise ValueError(f"{name} is not a text")
        certainty = data.pop("certainty_pct", Rule.certainty_pct)
        if not _is_number(certainty) or not 50 <= certainty < 100:
            raise ValueError(f"certainty_pct is {certainty!r}, not from 50 to below 100")
        return Rule(name=path.stem, criteria=criteria, certainty_pct=float(certainty), **data)
    except KeyError as error:
        raise SettingsError("The rule {path} lacks {error}.", path=path, error=error) from error
    except (OSError, ValueError, TypeError, AttributeError) as error:
        raise SettingsError(
            "Cannot read the rule {path}: {error}.", path=path, error=error
        ) from error


def _criterion(data: Mapping[str, Any]) -> Criterion:
    data = dict(data)
    limit = data.pop("limit")
    if not _is_number(limit) or limit < 0:
        raise ValueError(f"the limit {limit!r} is not a positive number or 0")
    for name in NUMBERS:
        if name in data and (not _is_number(data[name]) or data[name] < 0):
            raise ValueError(f"{name} is {data[name]!r}, not a positive number")
    for name in ANSWERS:
        if name in data:
            data[name] = _answers(name, data[name])
    if "clock" in data:
        data["clock"] = _clock(data["clock"])
    if "condition" in data:
        data["condition"] = Condition(data["condition"])
    verdict = Verdict(data.pop("verdict", Verdict.REJECT))
    if verdict not in (Verdict.REJECT, Verdict.REVIEW):
        raise ValueError(f"the verdict beyond a limit is reject or review, not {verdict}")
    kinds = tuple(DeformationKind(k) for k in data.pop("kinds"))
    if not kinds:
        raise ValueError("a criterion names no kinds")
    return Criterion(
        kinds=kinds,
        measure=Measure(data.pop("measure")),
        limit=float(limit),
        element_kinds=tuple(ElementKind(k) for k in data.pop("element_kinds", ())),
        verdict=verdict,
        **data,
    )


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _answers(name: str, given: object) -> dict[Question, bool]:
    if not isinstance(given, dict) or not all(isinstance(a, bool) for a in given.values()):
        raise ValueError(f"{name} is not a table of questions with true or false")
    return {Question(question): answer for question, answer in given.items()}


def _clock(given: object) -> tuple[float, float]:
    if not isinstance(given, list) or len(given) != 2:
        raise ValueError('clock is not two times such as ["8:00", "4:00"]')
    matches = [CLOCK.fullmatch(str(time)) for time in given]
    hours = [int(m[1]) % 12 + int(m[2]) / 60 for m in matches if m is not None]
    if len(hours) != len(given):
        raise ValueError('clock is not two times such as ["8:00", "4:00"]')
    return hours[0] / 12 * math.tau, hours[1] / 12 * math.tau
