"""What is measured of a section: its largest and smallest diameter, its deepest place."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from pipecore.geometry import Array
from pipecore.inspection.section import Section

MIN_SIGNIFICANCE = 3.0
"""A deviation is a depth if it is more than this many times its standard deviation."""
N_DIAMETERS = 360
"""Directions in which the diameter is measured: one for every half degree."""


class DimensionKind(StrEnum):
    """What a dimension of a section is."""

    DMAX = "Dmax"
    DMIN = "Dmin"
    DEPTH = "depth"
    HEIGHT = "height"


@dataclass(frozen=True, eq=False)
class Dimension:
    """A distance between two places in a section.

    Parameters
    ----------
    kind : DimensionKind
    value, sd : float
        Metres, and its standard deviation.
    ends_uv : ndarray, shape (2, 2)
        Its ends in the section's plane, metres; of a depth or height first the place on
        the undeformed contour, then that on the pipe's surface.
    """

    kind: DimensionKind
    value: float
    sd: float
    ends_uv: Array

    @property
    def is_diameter(self) -> bool:
        """Whether it goes through the section."""
        return self.kind in (DimensionKind.DMAX, DimensionKind.DMIN)


def measure_dimensions(section: Section) -> list[Dimension]:
    """Measure the diameters and the deepest place of a section.

    Diameters come from the smooth curve where that is closed, else from the profile's own
    ellipse where one was fitted freely; shorter arcs carry none. The depth is the largest
    distance of the smooth curve from the undeformed contour, of those at least
    `MIN_SIGNIFICANCE` times their standard deviation.

    Parameters
    ----------
    section : Section

    Returns
    -------
    list of Dimension
        Largest and smallest diameter, then depth (or height, where the surface lies
        outside of the contour), as far as they are measurable.
    """
    return [*_diameters(section), *_depth(section)]


def _diameters(section: Section) -> list[Dimension]:
    curve = section.curve
    if curve is None or not curve.is_closed:
        return _diameters_of_ellipse(section)
    clock = np.linspace(0, np.pi, N_DIAMETERS, endpoint=False)
    diameter = curve.radius_at(clock) + curve.radius_at(clock + np.pi)
    found = []
    for kind, row in (
        (DimensionKind.DMAX, int(np.argmax(diameter))),
        (DimensionKind.DMIN, int(np.argmin(diameter))),
    ):
        ends = np.array([clock[row], clock[row] + np.pi])
        sd = float(np.linalg.norm(curve.radius_sd_at(ends)))
        found.append(Dimension(kind, float(diameter[row]), sd, section.on_curve(ends)))
    return found


def _diameters_of_ellipse(section: Section) -> list[Dimension]:
    # An ovality says that the ellipse was fitted freely, across the axis.
    if not np.isfinite(section.profile.ovality[0]):
        return []
    ellipse, found = section.fitted, []
    sd = 2 * float(section.profile.semi_minor_sd[0])
    for kind, semi_axis, angle in (
        (DimensionKind.DMAX, ellipse.semi_major, ellipse.angle),
        (DimensionKind.DMIN, ellipse.semi_minor, ellipse.angle + np.pi / 2),
    ):
        reach = semi_axis * np.array([np.cos(angle), np.sin(angle)])
        ends = np.asarray(ellipse.centre_uv) + np.stack([reach, -reach])
        found.append(Dimension(kind, 2 * semi_axis, sd, ends))
    return found


def _depth(section: Section) -> list[Dimension]:
    curve = section.curve
    if curve is None:
        return []
    clock = np.concatenate(curve.clocks())
    places = section.on_curve(clock)
    direction, distance, on_contour = section.reference.rays(places)
    deviation, sd = distance - on_contour, curve.radius_sd_at(clock)
    # The ends of an open curve swing: the place is chosen by what is surely there.
    row = int(np.argmax(np.abs(deviation) - MIN_SIGNIFICANCE * sd))
    if not abs(deviation[row]) > MIN_SIGNIFICANCE * sd[row]:
        return []
    kind = DimensionKind.DEPTH if deviation[row] < 0 else DimensionKind.HEIGHT
    ends = np.stack([places[row] - deviation[row] * direction[row], places[row]])
    return [Dimension(kind, abs(float(deviation[row])), float(sd[row]), ends)]
