"""What a criterion limits, and how large it is on a deformation."""

from enum import StrEnum

import numpy as np

from pipecore.types import Deformation, DeformationKind, Element


class Measure(StrEnum):
    """What a criterion limits."""

    DEPTH_MM = "depth_mm"
    DEPTH_PCT_OD = "depth_pct_od"
    DEPTH_PCT_LENGTH = "depth_pct_length"
    OVALITY_PCT = "ovality_pct"
    OVALITY_MM = "ovality_mm"
    RADIUS_DEVIATION_MM = "radius_deviation_mm"
    STRAIN_PCT = "strain_pct"
    LENGTH_PCT_OD = "length_pct_od"


MEASURE_TEXTS = {
    Measure.DEPTH_MM: "depth at most {:g} mm",
    Measure.DEPTH_PCT_OD: "depth at most {:g} % of the outside diameter",
    Measure.DEPTH_PCT_LENGTH: "at most {:g} % of the length",
    Measure.OVALITY_PCT: "ovality at most {:g} %",
    Measure.OVALITY_MM: "Dmax − Dmin at most {:g} mm",
    Measure.RADIUS_DEVIATION_MM: "radius at most {:g} mm off",
    Measure.STRAIN_PCT: "strain at most {:g} %",
    Measure.LENGTH_PCT_OD: "length at most {:g} % of the outside diameter",
}
"""What a criterion asks for, with a field for its limit."""

OF_DEPTH = Measure.DEPTH_MM, Measure.DEPTH_PCT_OD, Measure.DEPTH_PCT_LENGTH
"""Measures that are a depth in some unit."""
STRAIN_SD = 0.2
"""Relative standard deviation of a strain: curvatures of a scan carry no better (DOMAIN)."""


def outside_diameter(element: Element, chainage: float | None = None) -> float:
    """Return the outside diameter that limits in percent refer to.

    The nominal one where a person confirmed it; else the measured one, on a reducer at the
    place itself, so that no tolerance of a setting moves a verdict.

    Parameters
    ----------
    element : Element
    chainage : float, optional
        Of the place, metres; without it the diameter at the element's start.

    Returns
    -------
    float
        Metres.
    """
    if element.nominal is not None and element.is_nominal_confirmed:
        return element.nominal.outside_diameter
    if chainage is None or element.radius == element.radius_end:
        return 2 * element.radius
    within = min(max(chainage, 0.0), element.axis.length)
    return 2 * float(element.radius_at(within))


WITHOUT_PCT_OD = (
    DeformationKind.OVALITY,
    DeformationKind.TWIST,
    DeformationKind.BOW,
    DeformationKind.KINK,
)
"""Kinds whose size is no share of the diameter: of a section as a whole, or of the axis."""


def depth_pct_od(deformation: Deformation, element: Element) -> tuple[float, float]:
    """Return a depth in percent of the outside diameter there, and its standard deviation.

    Parameters
    ----------
    deformation : Deformation
    element : Element

    Returns
    -------
    value, sd : float
        nan for kinds that it says nothing of: ovality, twist, bow and kink.
    """
    if deformation.kind in WITHOUT_PCT_OD:
        return np.nan, np.nan
    return measure_of(Measure.DEPTH_PCT_OD, deformation, element)


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


def in_metres(measure: Measure, element: Element, chainage: float | None = None) -> float:
    """Return what one unit of a measure of depth is in metres.

    Parameters
    ----------
    measure : Measure
        One of `OF_DEPTH`.
    element : Element
    chainage : float, optional
        Of the place, metres.

    Returns
    -------
    float
    """
    return {
        Measure.DEPTH_MM: 1e-3,
        Measure.DEPTH_PCT_OD: outside_diameter(element, chainage) / 100,
        Measure.DEPTH_PCT_LENGTH: element.axis.length / 100,
    }[measure]


def measure_of(measure: Measure, deformation: Deformation, element: Element) -> tuple[float, float]:
    """Return a measure of a deformation and its standard deviation, in the measure's unit.

    Parameters
    ----------
    measure : Measure
    deformation : Deformation
    element : Element

    Returns
    -------
    value, sd : float
    """
    d, diameter = deformation, outside_diameter(element, deformation.chainage)
    if measure in OF_DEPTH:
        unit = in_metres(measure, element, d.chainage)
        return d.depth / unit, d.depth_sd / unit
    if measure is Measure.RADIUS_DEVIATION_MM:
        off, off_sd = 0.0, 0.0
        if element.nominal is not None and element.is_nominal_confirmed:
            off = abs(element.radius - element.nominal.outside_diameter / 2)
            off_sd = element.radius_sd
        return 1e3 * (d.depth + off), 1e3 * float(np.hypot(d.depth_sd, off_sd))
    if measure is Measure.STRAIN_PCT:
        return 100 * d.strain, 100 * d.strain * STRAIN_SD
    if measure is Measure.LENGTH_PCT_OD:
        # Its ends are where the depth sinks below its noise: a tenth is what draws move them.
        return 100 * d.length / diameter, 10 * d.length / diameter
    scale = 100.0 if measure is Measure.OVALITY_PCT else 1e3 * diameter
    return scale * d.ovality, scale * ovality_sd(d)
