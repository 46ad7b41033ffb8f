"""What a refined piece must show before it counts as an element: a table of gates.

Each gate is a sentence that a piece fulfils or not. A piece that fails one is no pipe
element but a corner, a bundle, a person or a chance. See `GATES` at the end.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pipecore.elements.gates.waviness import waviness
from pipecore.elements.refinement.refine import FittedElement
from pipecore.elements.refinement.surface_fits import ArcSurface, LineSurface, SphereSurface
from pipecore.settings import ElementSettings
from pipecore.surface import Surface

MAX_RADIUS_SD = 0.04
"""Largest standard deviation of a radius, as a share of it."""
MIN_SPHERE_POINTS = 60
MAX_SPHERE_MISFIT = 0.001, 0.0003
"""Largest root mean square by which patches leave a sphere, in radii and in metres more:
vessel heads are flatter on top."""
MAX_MISFIT, MAX_NOISE_MISFIT = 0.015, 0.35
"""Largest root mean square by which a section leaves circle and oval, in radii and in noise."""
MIN_COVERAGE = 0.5
"""Share of an element's length that must be covered by points."""
MIN_ARC, MIN_BEND_ARC = np.deg2rad(55.0), np.deg2rad(75.0)
MIN_SHARP_ARC, VERY_SHARP_RADIUS_SD = np.deg2rad(36.0), 0.005
"""A straight may show less than `MIN_ARC` where the points carry the radius to this share."""
SURE_ARC, SHARP_RADIUS_SD, LONG_RADIUS_SD = np.deg2rad(100.0), 0.010, 0.035
"""On shorter arcs the points must carry the radius to this share of it, or to the latter ..."""
LONG = 3.0
"""... where a straight is longer than this many radii: no corner and no chance is."""
MIN_BEND_RADIUS, MIN_BEND_LENGTH = 1.02, 0.4
"""In radii: a torus with less of a hole or a shorter axis is a chance."""
SCATTER = 0.010, 0.035
WAVINESS = 0.010, 0.026
"""Largest standard deviations of the points about the surface's shape, and of its cells beyond
noise, in radii: of what is seen narrowly and short, and widely and long."""
MAX_BEND_RADIUS_SD = 0.3
"""Largest standard deviation of a bend radius, as a share of it."""
MIN_TAPER_CHANGE, MIN_TAPER_LENGTH = 0.06, 0.3
"""A cone's radius changes at least by this share; its axis has so many radii."""
MIN_VOXELS = 2.0
"""Shortest cylinder, in voxels."""
WIDE, WHOLE_ARC, MIN_WIDE_LENGTH = 0.18, np.deg2rad(200.0), 0.6
"""Wide cylinders that are not seen all round are longer than this many radii: heads are not."""


@dataclass(frozen=True, eq=False)
class Trial:
    """A refined piece before its gates; `slack` eases what a last round of fitting can mend."""

    found: FittedElement
    settings: ElementSettings
    surface: Surface
    slack: float = 1.0

    @property
    def radius(self) -> float:
        """Radius of the fitted surface, metres."""
        return self.found.fit.model.radius

    @property
    def lengths(self) -> float:
        """Length of the axis, in radii."""
        return self.found.axis.length / self.radius

    @property
    def relative_sd(self) -> float:
        """Standard deviation of the radius as a share of it, eased."""
        return self.found.fit.radius_sd / self.slack**2 / self.radius

    @property
    def misfit(self) -> float:
        """How far the section leaves its shape, eased, metres."""
        return self.found.misfit / self.slack

    @property
    def arc(self) -> float:
        """Median arc that is seen, radians."""
        return self.found.extent.arc


def radius_is_within_limits(t: Trial) -> bool:
    """The radius is within the settings' limits."""
    return t.settings.min_radius_mm <= t.radius * 1e3 <= t.settings.max_radius_mm


def scatter_is_low(t: Trial) -> bool:
    """The points scatter about the surface hardly more than they do about their planes."""
    wavy = _allowed_waviness(t, *SCATTER)
    limit = min(max(4.0 * t.surface.noise, 0.004, wavy), 0.08 * t.radius)
    return bool(t.found.fit.sigma <= t.slack * limit)


def _allowed_waviness(t: Trial, least: float, most: float) -> float:
    """How far a surface may leave its shape, metres: what is seen widely and long may more.

    From 100° to 200° of arc and from one to four radii of length it rises from the least to
    the most share of the radius.
    """
    wide = (t.arc - np.deg2rad(100.0)) / np.deg2rad(100.0)
    long = (t.lengths - 1.0) / 3.0
    share = float(np.clip(wide, 0.0, 1.0) * np.clip(long, 0.0, 1.0))
    return (least + (most - least) * share) * t.radius


def radius_is_well_determined(t: Trial) -> bool:
    """The points carry the radius at all."""
    return t.relative_sd <= MAX_RADIUS_SD


def has_enough_points(t: Trial) -> bool:
    """A sphere shows more than a handful of points."""
    return len(t.found.inliers) >= MIN_SPHERE_POINTS


def sphere_fits_everywhere(t: Trial) -> bool:
    """Every patch of a sphere is on it."""
    share, more = MAX_SPHERE_MISFIT
    return t.misfit < share * t.radius + more


def is_round(t: Trial) -> bool:
    """The mean section is a circle or an oval."""
    return t.misfit < MAX_MISFIT * t.radius + MAX_NOISE_MISFIT * t.found.fit.sigma


def axis_is_covered(t: Trial) -> bool:
    """Points lie along most of the axis."""
    return t.found.extent.coverage >= MIN_COVERAGE / t.slack


def arc_is_wide_enough(t: Trial) -> bool:
    """Points lie around enough of the axis; less is enough for a straight known sharply."""
    is_straight = isinstance(t.found.fit.model, LineSurface)
    is_very_sharp = is_straight and t.relative_sd < VERY_SHARP_RADIUS_SD
    return bool(t.arc >= (MIN_SHARP_ARC if is_very_sharp else MIN_ARC) / t.slack)


def radius_is_precise_for_its_arc(t: Trial) -> bool:
    """A short arc is believed only where the radius is known well."""
    is_long = isinstance(t.found.fit.model, LineSurface) and t.lengths > LONG
    return t.arc >= SURE_ARC or t.relative_sd < (LONG_RADIUS_SD if is_long else SHARP_RADIUS_SD)


def surface_is_smooth(t: Trial) -> bool:
    """The surface does not leave its shape all over; asked of finished fits only."""
    if t.slack > 1.0:
        return True
    xyz = t.surface.xyz[t.found.inliers]
    residual, _, _ = t.found.fit.model.residuals(xyz)
    chainage, _, clock = t.found.axis.pipe_coordinates(xyz)
    if t.found.section is not None:
        residual = residual - t.found.section.height(chainage, clock)
    wave = waviness(chainage, clock, residual, t.radius, t.arc)
    return not wave > _allowed_waviness(t, *WAVINESS)


def bend_arc_is_wide_enough(t: Trial) -> bool:
    """A torus has more parameters to satisfy than a cylinder."""
    return bool(t.arc >= MIN_BEND_ARC)


def bend_radius_is_well_determined(t: Trial) -> bool:
    """The points carry the bend radius."""
    model, sd = t.found.fit.model, np.sqrt(t.found.fit.covariance[5, 5]) / t.slack**2
    return isinstance(model, ArcSurface) and bool(sd < MAX_BEND_RADIUS_SD * model.bend_radius)


def bend_radius_exceeds_radius(t: Trial) -> bool:
    """A bend turns about a point outside itself."""
    model = t.found.fit.model
    return isinstance(model, ArcSurface) and model.bend_radius > MIN_BEND_RADIUS * t.radius


def bend_is_long_enough(t: Trial) -> bool:
    """A bend has some length."""
    return t.lengths > MIN_BEND_LENGTH


def cone_tapers_clearly(t: Trial) -> bool:
    """A cone's radius changes clearly over some length."""
    start, end = t.found.radii
    return abs(end - start) > MIN_TAPER_CHANGE * t.radius and t.lengths > MIN_TAPER_LENGTH


def cylinder_is_long_enough(t: Trial) -> bool:
    """A cylinder is longer than a few points, and than a slice of a vessel's head."""
    is_wide = t.radius > WIDE and t.arc < WHOLE_ARC
    shortest = MIN_WIDE_LENGTH * t.radius if is_wide else 0.0
    return t.found.axis.length > max(MIN_VOXELS * t.surface.voxel, shortest)


Gate = Callable[[Trial], bool]

OF_ALL: tuple[Gate, ...] = (radius_is_within_limits, scatter_is_low, radius_is_well_determined)
OF_TUBES = (
    *OF_ALL,
    is_round,
    axis_is_covered,
    arc_is_wide_enough,
    radius_is_precise_for_its_arc,
    surface_is_smooth,
)
GATES: dict[str, tuple[Gate, ...]] = {
    "sphere": (*OF_ALL, has_enough_points, sphere_fits_everywhere),
    "bend": (
        *OF_TUBES,
        bend_arc_is_wide_enough,
        bend_radius_is_well_determined,
        bend_radius_exceeds_radius,
        bend_is_long_enough,
    ),
    "cone": (*OF_TUBES, cone_tapers_clearly),
    "cylinder": (*OF_TUBES, cylinder_is_long_enough),
}
"""What each shape must fulfil, in the order in which it is asked."""


def _shape(found: FittedElement) -> str:
    match found.fit.model:
        case SphereSurface():
            return "sphere"
        case ArcSurface():
            return "bend"
        case LineSurface(is_tapered=True):
            return "cone"
    return "cylinder"


def failed_gate(
    found: FittedElement, surface: Surface, settings: ElementSettings, slack: float = 1.0
) -> str | None:
    """Name of the first gate that a refined piece fails, or None.

    Parameters
    ----------
    found : FittedElement
    surface : Surface
        The downsampled points.
    settings : ElementSettings
    slack : float
        Multiplies the limits of what a last round of fitting can mend.
    """
    trial = Trial(found, settings, surface, slack)
    for gate in GATES[_shape(found)]:
        if not gate(trial):
            return gate.__name__
    return None


def passes_gates(
    found: FittedElement, surface: Surface, settings: ElementSettings, slack: float = 1.0
) -> bool:
    """Whether a refined piece is a pipe element; see `failed_gate`."""
    return failed_gate(found, surface, settings, slack) is None
