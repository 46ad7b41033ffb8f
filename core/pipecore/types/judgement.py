"""What a rule says of a deformation, what it has to ask a person, and what a person said."""

from collections.abc import Mapping
from enum import StrEnum


class Verdict(StrEnum):
    """What the chosen rules say of a deformation; the values are those of the report."""

    ACCEPT = "accept"
    ACCEPT_IF = "accept if"
    """Accept if the open questions have the right answers."""
    REVIEW = "review"
    REJECT = "reject"
    NOT_MEASURABLE = "not measurable"


class Condition(StrEnum):
    """How soon a code asks for a repair, the most urgent first."""

    IMMEDIATE = "immediate"
    DAYS_60 = "60 days"
    DAYS_180 = "180 days"
    MONITOR = "monitor"


class Question(StrEnum):
    """What a code asks of a deformation or an element, and a scan cannot answer."""

    WELD = "weld"
    STRESS_RAISER = "stress raiser"
    HIGH_STRESS = "high stress"
    PRESSURISED = "pressurised"
    RESTRAINED = "restrained"
    WHOLE_JOINT = "whole joint"
    BENT_PIPE = "bent pipe"
    EXTERNAL_PRESSURE = "external pressure"
    CLAD = "clad"
    WALL = "wall thickness"
    """Answered by the setting of that name, not by yes or no."""


Answers = Mapping[Question, bool]
"""Answers to questions; one that is not there is open."""
