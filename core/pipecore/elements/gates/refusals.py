"""Refusals: why a fitted element was not accepted, with what was measured and the limit."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pipecore.elements.gates import acceptance as gates
from pipecore.elements.refinement.fitted_element import FittedElement
from pipecore.elements.refinement.surface_fits import ArcSurface
from pipecore.reasons import Reason
from pipecore.settings import ElementSettings
from pipecore.surface import Surface

Fitted = gates.Candidate
NEAR_SCORE = 3.0
"""A score this much below the least, as log odds, is as far off as twice a limit."""


@dataclass(frozen=True)
class Shortfall:
    """What a gate compared.

    Parameters
    ----------
    reason : Reason
    value, limit : float
        In `unit`; nan where nothing is compared.
    unit : str
    excess : float
        How many times the limit is missed; 1 is just there.
    """

    reason: Reason
    value: float = np.nan
    limit: float = np.nan
    unit: str = ""
    excess: float = 1.0


def _shortfall(
    template: str, value: float, limit: float, unit: str, is_most: bool, decimals: int = 1
) -> Shortfall:
    """A value above the most, or below the least, that is allowed."""
    value, limit = float(value), float(limit)
    over, under = (value, limit) if is_most else (limit, value)
    excess = over / under if under > 0 else np.inf
    reason = Reason(template, value=round(value, decimals), limit=round(limit, decimals))
    return Shortfall(reason, value, limit, unit, excess)


def _most(template: str, value: float, limit: float, unit: str, decimals: int = 1) -> Shortfall:
    return _shortfall(template, value, limit, unit, True, decimals)


def _least(template: str, value: float, limit: float, unit: str, decimals: int = 1) -> Shortfall:
    return _shortfall(template, value, limit, unit, False, decimals)


TOO_THIN = "Its radius of {value} mm is below the smallest radius of the settings, {limit} mm."
TOO_WIDE = "Its radius of {value} mm is above the largest radius of the settings, {limit} mm."
SCATTERS = "Its points scatter by {value} mm about the surface; {limit} mm at most are a pipe's."
UNSURE_RADIUS = "Its radius is only known to {value} %; it must be to {limit} %."
FEW_POINTS = "It has only {value} points; at least {limit} are needed."
NOT_ROUND = "Its section is off circle and oval by {value} mm; {limit} mm are allowed."
GAPS = "Points cover only {value} % of its length; at least {limit} % are needed."
NARROW = "It is seen over only {value}° of its round; at least {limit}° are needed."
UNEVEN = "Its surface is uneven by {value} mm all over; {limit} mm are allowed."
UNLIKELY = (
    "It looks too little like a round body: its score is {value}, and at least {limit} is needed."
)
UNSURE_BEND = "Its bend radius is only known to {value} %; it must be to {limit} %."
TIGHT_BEND = "Its bend radius is {value} times its radius; at least {limit} times is possible."
SHORT_BEND = "It is only {value} radii long; a bend has at least {limit}."
LITTLE_TAPER = "Its radius changes by only {value} %; a reducer's by at least {limit} %."
TOO_SHORT = "It is only {value} mm long; a piece with nothing beside it has at least {limit} mm."
CORNER = "It looks like the rounded corner between two flat faces."
TEXTS = (
    *(TOO_THIN, TOO_WIDE, SCATTERS, UNSURE_RADIUS, FEW_POINTS, NOT_ROUND, GAPS, NARROW),
    *(UNEVEN, UNLIKELY, UNSURE_BEND, TIGHT_BEND, SHORT_BEND, LITTLE_TAPER, TOO_SHORT, CORNER),
)
"""All reasons, for the translations."""


def _radius(c: Fitted) -> Shortfall:
    low, high = c.settings.min_radius_mm, c.settings.max_radius_mm
    radius = 1e3 * c.radius
    if radius < low:
        return _least(TOO_THIN, radius, low, "mm", 2)
    return _most(TOO_WIDE, radius, high, "mm", 2)


def _taper(c: Fitted) -> Shortfall:
    start, end = c.found.radii
    change = abs(end - start) / c.radius
    return _least(LITTLE_TAPER, 100 * change, 100 * gates.MIN_TAPER_CHANGE, "%")


def _score(c: Fitted) -> Shortfall:
    score = gates.revolution_score(c)
    reason = Reason(UNLIKELY, value=round(score, 1), limit=gates.MIN_SCORE)
    excess = 1.0 + max(gates.MIN_SCORE - score, 0.0) / NEAR_SCORE
    return Shortfall(reason, score, gates.MIN_SCORE, "", excess)


def _precision(c: Fitted) -> Shortfall:
    return _most(UNSURE_RADIUS, 100 * c.relative_sd, 100 * gates.precision_limit(c), "%", 2)


def _bend_precision(c: Fitted) -> Shortfall:
    model = c.found.fit.model
    assert isinstance(model, ArcSurface)
    sd = np.sqrt(c.found.fit.covariance[5, 5]) / model.bend_radius
    return _most(UNSURE_BEND, 100 * sd, 100 * gates.MAX_BEND_RADIUS_SD, "%")


def _bend_ratio(c: Fitted) -> Shortfall:
    model = c.found.fit.model
    assert isinstance(model, ArcSurface)
    return _least(TIGHT_BEND, model.bend_radius / c.radius, gates.MIN_BEND_RADIUS, "r", 2)


SHORTFALLS: dict[str, Callable[[Fitted], Shortfall]] = {
    gates.radius_is_within_limits.__name__: _radius,
    gates.scatter_is_low.__name__: lambda c: _most(
        SCATTERS, 1e3 * c.found.fit.sigma, 1e3 * gates.scatter_limit(c), "mm"
    ),
    gates.radius_is_well_determined.__name__: lambda c: _most(
        UNSURE_RADIUS, 100 * c.relative_sd, 100 * gates.MAX_RADIUS_SD, "%"
    ),
    gates.has_enough_points.__name__: lambda c: _least(
        FEW_POINTS, len(c.found.inliers), gates.MIN_SPHERE_POINTS, "", 0
    ),
    gates.sphere_fits_everywhere.__name__: lambda c: _most(
        NOT_ROUND, 1e3 * c.misfit, 1e3 * gates.sphere_misfit_limit(c), "mm", 2
    ),
    gates.section_is_round.__name__: lambda c: _most(
        NOT_ROUND, 1e3 * c.misfit, 1e3 * gates.misfit_limit(c), "mm", 2
    ),
    gates.axis_is_covered.__name__: lambda c: _least(
        GAPS, 100 * c.found.extent.coverage, 100 * gates.MIN_COVERAGE, "%", 0
    ),
    gates.arc_is_wide_enough.__name__: lambda c: _least(
        NARROW, np.rad2deg(c.arc), np.rad2deg(gates.arc_limit(c)), "°", 0
    ),
    gates.radius_is_precise_for_its_arc.__name__: _precision,
    gates.surface_is_smooth.__name__: lambda c: _most(
        UNEVEN, 1e3 * c.waviness, 1e3 * gates.waviness_limit(c), "mm"
    ),
    gates.is_surface_of_revolution.__name__: _score,
    gates.bend_arc_is_wide_enough.__name__: lambda c: _least(
        NARROW, np.rad2deg(c.arc), np.rad2deg(gates.MIN_BEND_ARC), "°", 0
    ),
    gates.bend_radius_is_well_determined.__name__: _bend_precision,
    gates.bend_radius_exceeds_radius.__name__: _bend_ratio,
    gates.bend_is_long_enough.__name__: lambda c: _least(
        SHORT_BEND, c.lengths, gates.MIN_BEND_LENGTH, "r", 2
    ),
    gates.cone_tapers_clearly.__name__: _taper,
    gates.cylinder_is_long_enough.__name__: lambda c: _least(
        TOO_SHORT, 1e3 * c.found.axis.length, 1e3 * gates.length_limit(c), "mm", 0
    ),
}
"""What each gate compares, by its name."""


def shortfall(
    found: FittedElement, gate: str, surface: Surface, settings: ElementSettings
) -> Shortfall:
    """What a gate compared when it refused a fitted element, with the limits of a last fit.

    Parameters
    ----------
    found : FittedElement
    gate : str
        As `failed_gate` names it.
    surface : Surface
    settings : ElementSettings

    Returns
    -------
    Shortfall
        A plain "not like a round body" for a gate that compares nothing.
    """
    compare = SHORTFALLS.get(gate)
    candidate = Fitted(found, settings, surface)
    return _score(candidate) if compare is None else compare(candidate)


def too_short(length: float, least: float) -> Shortfall:
    """A lone piece that is shorter than what is reported, metres."""
    return _least(TOO_SHORT, 1e3 * length, 1e3 * least, "mm", 0)


def rounded_corner() -> Shortfall:
    """A surface that is the rounded corner between two faces."""
    return Shortfall(Reason(CORNER), excess=1.5)
