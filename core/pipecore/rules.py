"""Acceptance rules: what a code says of a deformation, from data files that users can edit.

A rule is a TOML file, see ``resources/rules``. It holds criteria; each sets a limit on
one measure of some kinds of deformation. A verdict respects the measurement's
uncertainty: within two standard deviations of the limit a person has to look.
"""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any

import numpy as np

from pipecore.errors import SettingsError
from pipecore.resources import resource
from pipecore.types import (
    KIND_LABELS,
    Deformation,
    DeformationKind,
    Element,
    ElementKind,
    Verdict,
)

BAND_SD = 2.0
"""Half width of the band around a limit, in standard deviations, that is to be reviewed."""


class Measure(StrEnum):
    """What a criterion limits."""

    DEPTH_MM = "depth_mm"
    DEPTH_PCT_OD = "depth_pct_od"
    DEPTH_PCT_LENGTH = "depth_pct_length"
    OVALITY_PCT = "ovality_pct"
    OVALITY_MM = "ovality_mm"


MEASURE_TEXTS = {
    Measure.DEPTH_MM: "depth at most {:g} mm",
    Measure.DEPTH_PCT_OD: "depth at most {:g} % of the outside diameter",
    Measure.DEPTH_PCT_LENGTH: "at most {:g} % of the length",
    Measure.OVALITY_PCT: "ovality at most {:g} %",
    Measure.OVALITY_MM: "Dmax − Dmin at most {:g} mm",
}
"""What a criterion asks for, with a field for its limit."""


@dataclass(frozen=True)
class Criterion:
    """A limit on one measure of some kinds of deformation.

    Parameters
    ----------
    kinds : tuple of DeformationKind
    measure : Measure
    limit : float
        In the measure's unit; more is rejected.
    element_kinds : tuple of ElementKind
        Elements it applies to; empty means all.
    od_above_mm, od_up_to_mm : float
        Outside diameters it applies to; the upper bound belongs to it.
    """

    kinds: tuple[DeformationKind, ...]
    measure: Measure
    limit: float
    element_kinds: tuple[ElementKind, ...] = ()
    od_above_mm: float = 0.0
    od_up_to_mm: float = np.inf

    def covers(self, kind: DeformationKind, element: Element) -> bool:
        """Return whether this criterion applies to deformations of a kind on an element.

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
            and self.od_above_mm < 1000 * outside_diameter(element) <= self.od_up_to_mm
        )

    def value(self, deformation: Deformation, element: Element) -> tuple[float, float]:
        """Return the limited measure and its standard deviation, in the limit's unit.

        Parameters
        ----------
        deformation : Deformation
        element : Element

        Returns
        -------
        value, sd : float
        """
        diameter = outside_diameter(element)
        scale = {
            Measure.DEPTH_MM: 1000.0,
            Measure.DEPTH_PCT_OD: 100 / diameter,
            Measure.DEPTH_PCT_LENGTH: 100 / element.axis.length,
            Measure.OVALITY_PCT: 100.0,
            Measure.OVALITY_MM: 1000 * diameter,
        }[self.measure]
        if self.measure in (Measure.OVALITY_PCT, Measure.OVALITY_MM):
            return scale * deformation.ovality, scale * ovality_sd(deformation)
        return scale * deformation.depth, scale * deformation.depth_sd

    def judge(self, deformation: Deformation, element: Element) -> Verdict:
        """Return the verdict of this criterion alone.

        Parameters
        ----------
        deformation : Deformation
        element : Element

        Returns
        -------
        Verdict
        """
        value, sd = self.value(deformation, element)
        if not np.isfinite(value) or not np.isfinite(sd):
            return Verdict.NOT_MEASURABLE
        if value - BAND_SD * sd > self.limit:
            return Verdict.REJECT
        if value + BAND_SD * sd < self.limit:
            return Verdict.ACCEPT
        return Verdict.REVIEW

    def __str__(self) -> str:
        """Return the criterion in words."""
        parts = [", ".join(self.kinds)]
        if self.element_kinds:
            parts.append("on " + ", ".join(KIND_LABELS[k].lower() for k in self.element_kinds))
        if self.od_above_mm > 0:
            parts.append(f"OD above {self.od_above_mm:g} mm")
        if np.isfinite(self.od_up_to_mm):
            parts.append(f"OD up to {self.od_up_to_mm:g} mm")
        return " · ".join(parts) + ": " + MEASURE_TEXTS[self.measure].format(self.limit)


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
    """

    name: str
    title: str
    source: str
    note: str
    criteria: tuple[Criterion, ...]


def outside_diameter(element: Element) -> float:
    """Return the outside diameter that limits in percent refer to: the nominal one where known.

    Parameters
    ----------
    element : Element

    Returns
    -------
    float
        Metres.
    """
    return element.nominal.outside_diameter if element.nominal else 2 * element.radius


def ovality_sd(deformation: Deformation) -> float:
    """Return the standard deviation of a deformation's ovality, as a ratio.

    Depth and ovality of one stretch are the same amplitude in two forms, and so have the
    same relative uncertainty.

    Parameters
    ----------
    deformation : Deformation

    Returns
    -------
    float
        nan where there is no depth.
    """
    if not deformation.depth > 0:
        return np.nan
    return deformation.ovality * deformation.depth_sd / deformation.depth


def judge(deformation: Deformation, element: Element, rule: Rule) -> Verdict:
    """Return the verdict of a rule on a deformation: the worst of those of its criteria.

    A deformation that no criterion covers is to be reviewed by a person.

    Parameters
    ----------
    deformation : Deformation
    element : Element
        On which it is.
    rule : Rule

    Returns
    -------
    Verdict
    """
    verdicts = {
        criterion.judge(deformation, element)
        for criterion in rule.criteria
        if criterion.covers(deformation.kind, element)
    }
    for verdict in (Verdict.REJECT, Verdict.NOT_MEASURABLE, Verdict.REVIEW, Verdict.ACCEPT):
        if verdict in verdicts:
            return verdict
    return Verdict.REVIEW


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


def dent_limit(element: Element, rule: Rule) -> DentLimit | None:
    """Return the strictest limit that a rule sets on the depth of an element's dents.

    Parameters
    ----------
    element : Element
    rule : Rule

    Returns
    -------
    DentLimit or None
        None if the rule sets no such limit.
    """
    in_metres = {
        Measure.DEPTH_MM: 1e-3,
        Measure.DEPTH_PCT_OD: outside_diameter(element) / 100,
        Measure.DEPTH_PCT_LENGTH: element.axis.length / 100,
    }
    limits = [
        DentLimit(criterion.limit * in_metres[criterion.measure], criterion, rule)
        for criterion in rule.criteria
        if criterion.measure in in_metres and criterion.covers(DeformationKind.DENT, element)
    ]
    return min(limits, key=lambda limit: limit.depth, default=None)


def list_rules() -> tuple[Rule, ...]:
    """Return the rules that come with the program, by name.

    Returns
    -------
    tuple of Rule
    """
    rules = (_read(path) for path in resource("rules").glob("*.toml"))
    return tuple(sorted(rules, key=lambda rule: rule.name))


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
        data = tomllib.loads(path.read_text(encoding="utf-8"))
        criteria = tuple(_criterion(c) for c in data.pop("criteria"))
        return Rule(name=path.stem, criteria=criteria, **data)
    except KeyError as error:
        raise SettingsError("The rule {path} lacks {error}.", path=path, error=error) from error
    except (OSError, ValueError, TypeError, AttributeError) as error:
        raise SettingsError(
            "Cannot read the rule {path}: {error}.", path=path, error=error
        ) from error


def _criterion(data: Mapping[str, Any]) -> Criterion:
    data = dict(data)
    limit = data.pop("limit")
    if isinstance(limit, bool) or not isinstance(limit, int | float) or limit <= 0:
        raise ValueError(f"the limit {limit!r} is not a positive number")
    return Criterion(
        kinds=tuple(DeformationKind(k) for k in data.pop("kinds")),
        measure=Measure(data.pop("measure")),
        limit=float(limit),
        element_kinds=tuple(ElementKind(k) for k in data.pop("element_kinds", ())),
        **data,
    )
