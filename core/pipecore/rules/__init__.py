"""Acceptance rules: what codes say of a deformation, from data files that users can edit.

A rule is a TOML file, see ``resources/rules`` and ``docs/rules.md``. It holds criteria; each
sets a limit on one measure of some kinds of deformation. A verdict respects the
measurement's uncertainty, and what a scan cannot know is asked for, never assumed.
"""

from pipecore.rules.judging import Judgement, judge, judge_all, questions_of
from pipecore.rules.measures import (
    MEASURE_TEXTS,
    Measure,
    depth_pct_od,
    outside_diameter,
    ovality_sd,
)
from pipecore.rules.questions import QUESTIONS, QuestionText, accept_if, verdict_words
from pipecore.rules.reading import list_rules, load_rule, load_rules
from pipecore.rules.rule import Criterion, DentLimit, Rule, Situation, dent_limit

__all__ = [
    "MEASURE_TEXTS",
    "QUESTIONS",
    "Criterion",
    "DentLimit",
    "Judgement",
    "Measure",
    "QuestionText",
    "Rule",
    "Situation",
    "accept_if",
    "dent_limit",
    "depth_pct_od",
    "judge",
    "judge_all",
    "list_rules",
    "load_rule",
    "load_rules",
    "outside_diameter",
    "ovality_sd",
    "questions_of",
    "verdict_words",
]
