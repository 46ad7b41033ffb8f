"""Acceptance: what a fitted element must show before it is reported, a table of gates.

Each gate is a predicate named by what it demands. What fails one is no pipe element but a
corner, a bundle, a person or a chance fit. See `GATES` at the end.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pipecore.elements.gates.waviness import waviness
from pipecore.elements.refinement.fitted_element import FittedElement
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
"""A straight may show less than `MIN_ARC` where the radius is determined to this share."""
SURE_ARC, SHARP_RADIUS_SD, LONG_RADIUS_SD = np.deg2rad(100.0), 0.010, 0.035
"""On shorter arcs the radius must be determined to this share of it, or to the latter ..."""
LONG = 3.0
"""... where a straight is longer than this many radii: no corner and no chance is."""
MIN_BEND_RADIUS, MIN_BEND_LENGTH = 1.02, 0.4
"""In radii: a torus with less of a hole or a shorter axis is a chance."""
SCATTER = 0.010, 0.035
WAVINESS = 0.010, 0.026
"""Largest standard deviations of the points about the surface's shape, and of its cells beyond
noise, in radii: of what is seen narrowly and short, and widely and long."""
MIN_SCORE = -1.4
SCORE_AT_ZERO, OF_RADIUS_SD, OF_WAVINESS, OF_MISFIT = -7.3, -5.1, -250.0, -50.0
"""Weights of the common logarithm of the radius's standard deviation, of the waviness and of the
excess misfit, all in radii. Rounded from a logistic regression on 3049 pieces of 25 simulated
plants, 150 lone pipes (oval, wavy, dented, seen from one side) and 60 scenes of clutter, judged on
the same pieces: area under the ROC 0.986, two in a hundred true pieces and 84 of false ones below
the least score. It had the scatter over the noise as a fourth term, which counted little, and the
whole misfit in place of its excess."""
MAX_COUNTED_WAVINESS, MAX_COUNTED_MISFIT = 0.05, 0.08
"""In radii; more counts as much."""
MAX_BEND_RADIUS_SD = 0.3
"""Largest standard deviation of a bend radius, as a share of it."""
MIN_TAPER_CHANGE, MIN_TAPER_LENGTH = 0.06, 0.3
"""A cone's radius changes at least by this share; its axis has so many radii."""
MIN_VOXELS = 2.0
"""Shortest cylinder, in voxels."""
WIDE, WHOLE_ARC, MIN_WIDE_LENGTH = 0.18, np.deg2rad(200.0), 0.6
"""Wide cylinders that are not seen all round are longer than this many radii: heads are not."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """A fitted element before its gates.

    Parameters
    ----------
    found : FittedElement
    settings : ElementSettings
    surface : Surface
        The downsampled points.
    slack : float
        At least 1; relaxes the limits of what a last round of fitting can improve.
    """

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
        """Standard deviation of the radius as a share of it, relaxed by the slack."""
        return self.found.fit.radius_sd / self.slack**2 / self.radius

    @property
    def misfit(self) -> float:
        """Root mean square by which the section leaves its shape, relaxed by the slack, metres."""
        return self.found.misfit / self.slack

    @cached_property
    def waviness(self) -> float:
        """How far the surface leaves its shape all over, metres; nan with too few points."""
        xyz = self.surface.xyz[self.found.inliers]
        residual, _, _ = self.found.fit.model.residuals(xyz)
        chainage, _, clock = self.found.axis.pipe_coordinates(xyz)
        if self.found.section is not None:
            residual = residual - self.found.section.height(chainage, clock)
        return waviness(chainage, clock, residual, self.radius, self.arc)

    @property
    def arc(self) -> float:
        """Median arc that the points cover, radians."""
        return self.found.extent.arc


def radius_is_within_limits(candidate: Candidate) -> bool:
    """Whether the radius is within the settings' limits."""
    return (
        candidate.settings.min_radius_mm
        <= candidate.radius * 1e3
        <= candidate.settings.max_radius_mm
    )


def scatter_is_low(candidate: Candidate) -> bool:
    """Whether the points scatter about the surface hardly more than about their local planes."""
    return bool(candidate.found.fit.sigma <= candidate.slack * scatter_limit(candidate))


def scatter_limit(candidate: Candidate) -> float:
    """Largest scatter of the points about the surface, metres."""
    wavy = _allowed_waviness(candidate, *SCATTER)
    return min(max(4.0 * candidate.surface.noise, 0.004, wavy), 0.08 * candidate.radius)


def _allowed_waviness(candidate: Candidate, least: float, most: float) -> float:
    """How far a surface may leave its shape, metres: what is seen widely and long may more.

    From 100° to 200° of arc and from one to four radii of length it rises from the least to
    the most share of the radius.
    """
    wide = (candidate.arc - np.deg2rad(100.0)) / np.deg2rad(100.0)
    long = (candidate.lengths - 1.0) / 3.0
    share = float(np.clip(wide, 0.0, 1.0) * np.clip(long, 0.0, 1.0))
    return (least + (most - least) * share) * candidate.radius


def radius_is_well_determined(candidate: Candidate) -> bool:
    """Whether the standard deviation of the radius is small enough for any kind."""
    return candidate.relative_sd <= MAX_RADIUS_SD


def has_enough_points(candidate: Candidate) -> bool:
    """Whether a sphere has enough points."""
    return len(candidate.found.inliers) >= MIN_SPHERE_POINTS


def sphere_fits_everywhere(candidate: Candidate) -> bool:
    """Whether every patch of a sphere is on it."""
    return candidate.misfit < sphere_misfit_limit(candidate)


def sphere_misfit_limit(candidate: Candidate) -> float:
    """Largest misfit of a sphere, metres."""
    share, more = MAX_SPHERE_MISFIT
    return share * candidate.radius + more


def section_is_round(candidate: Candidate) -> bool:
    """Whether the mean section is a circle or an oval."""
    return candidate.misfit < misfit_limit(candidate)


def misfit_limit(candidate: Candidate) -> float:
    """Largest misfit of a section, metres."""
    return MAX_MISFIT * candidate.radius + MAX_NOISE_MISFIT * candidate.found.fit.sigma


def axis_is_covered(candidate: Candidate) -> bool:
    """Whether points lie along most of the axis."""
    return candidate.found.extent.coverage >= MIN_COVERAGE / candidate.slack


def arc_is_wide_enough(candidate: Candidate) -> bool:
    """Whether points lie around enough of the axis; less for a straight of precise radius."""
    return bool(candidate.arc >= arc_limit(candidate) / candidate.slack)


def arc_limit(candidate: Candidate) -> float:
    """Least arc that a tube shows, radians."""
    is_straight = isinstance(candidate.found.fit.model, LineSurface)
    is_very_sharp = is_straight and candidate.relative_sd < VERY_SHARP_RADIUS_SD
    return float(MIN_SHARP_ARC if is_very_sharp else MIN_ARC)


def radius_is_precise_for_its_arc(candidate: Candidate) -> bool:
    """Whether the radius is precise, where the arc is short."""
    return candidate.arc >= SURE_ARC or candidate.relative_sd < precision_limit(candidate)


def precision_limit(candidate: Candidate) -> float:
    """Largest standard deviation of the radius on a short arc, as a share of it."""
    is_long = isinstance(candidate.found.fit.model, LineSurface) and candidate.lengths > LONG
    return LONG_RADIUS_SD if is_long else SHARP_RADIUS_SD


def surface_is_smooth(candidate: Candidate) -> bool:
    """Whether a final fit leaves its shape in places only, not all over as cloth does."""
    if candidate.slack > 1.0:
        return True
    return not candidate.waviness > waviness_limit(candidate)


def waviness_limit(candidate: Candidate) -> float:
    """Largest waviness of the surface, metres."""
    return _allowed_waviness(candidate, *WAVINESS)


def is_surface_of_revolution(candidate: Candidate) -> bool:
    """Whether a final fit is more than the chance surface of a corner, a fold or a limb."""
    return candidate.slack > 1.0 or revolution_score(candidate) >= MIN_SCORE


def revolution_score(candidate: Candidate) -> float:
    """Log odds that a fitted surface is one of revolution, not one that chance finds.

    Of corners, folds and limbs the radius is uncertain, the sections leave circle and oval, or the
    surface is wavy all over. Each says it unsurely, so they are weighed together.
    """
    radius = candidate.radius
    sharpness = np.log10(max(candidate.found.radius_sd / radius, 1e-5))
    wavy = min(np.nan_to_num(candidate.waviness) / radius, MAX_COUNTED_WAVINESS)
    off_round = min(candidate.found.excess_misfit / radius, MAX_COUNTED_MISFIT)
    return float(
        SCORE_AT_ZERO + OF_RADIUS_SD * sharpness + OF_WAVINESS * wavy + OF_MISFIT * off_round
    )


def bend_arc_is_wide_enough(candidate: Candidate) -> bool:
    """Whether a bend shows more arc than a cylinder must: it has more parameters."""
    return bool(candidate.arc >= MIN_BEND_ARC)


def bend_radius_is_well_determined(candidate: Candidate) -> bool:
    """Whether the standard deviation of the bend radius is small enough."""
    model, sd = (
        candidate.found.fit.model,
        np.sqrt(candidate.found.fit.covariance[5, 5]) / candidate.slack**2,
    )
    return isinstance(model, ArcSurface) and bool(sd < MAX_BEND_RADIUS_SD * model.bend_radius)


def bend_radius_exceeds_radius(candidate: Candidate) -> bool:
    """Whether a bend turns about a point outside itself."""
    model = candidate.found.fit.model
    return isinstance(model, ArcSurface) and model.bend_radius > MIN_BEND_RADIUS * candidate.radius


def bend_is_long_enough(candidate: Candidate) -> bool:
    """Whether a bend is longer than a chance fit."""
    return candidate.lengths > MIN_BEND_LENGTH


def cone_tapers_clearly(candidate: Candidate) -> bool:
    """Whether a cone's radius changes clearly, over some length."""
    start, end = candidate.found.radii
    return (
        abs(end - start) > MIN_TAPER_CHANGE * candidate.radius
        and candidate.lengths > MIN_TAPER_LENGTH
    )


def cylinder_is_long_enough(candidate: Candidate) -> bool:
    """Whether a cylinder is longer than a few points, and than a slice of a vessel's head."""
    return candidate.found.axis.length > length_limit(candidate)


def length_limit(candidate: Candidate) -> float:
    """Least length of a cylinder, metres."""
    is_wide = candidate.radius > WIDE and candidate.arc < WHOLE_ARC
    shortest = MIN_WIDE_LENGTH * candidate.radius if is_wide else 0.0
    return max(MIN_VOXELS * candidate.surface.voxel, shortest)


Gate = Callable[[Candidate], bool]

GATES_OF_ALL: tuple[Gate, ...] = (
    radius_is_within_limits,
    scatter_is_low,
    radius_is_well_determined,
)
GATES_OF_TUBES = (
    *GATES_OF_ALL,
    section_is_round,
    axis_is_covered,
    arc_is_wide_enough,
    radius_is_precise_for_its_arc,
    surface_is_smooth,
    is_surface_of_revolution,
)
GATES: dict[str, tuple[Gate, ...]] = {
    "sphere": (*GATES_OF_ALL, has_enough_points, sphere_fits_everywhere),
    "bend": (
        *GATES_OF_TUBES,
        bend_arc_is_wide_enough,
        bend_radius_is_well_determined,
        bend_radius_exceeds_radius,
        bend_is_long_enough,
    ),
    "cone": (*GATES_OF_TUBES, cone_tapers_clearly),
    "cylinder": (*GATES_OF_TUBES, cylinder_is_long_enough),
}
"""The gates of each shape, in the order in which they are evaluated."""


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
    """Name of the first gate that a fitted element fails, or None.

    Parameters
    ----------
    found : FittedElement
    surface : Surface
        The downsampled points.
    settings : ElementSettings
    slack : float
        At least 1; relaxes the limits of what a last round of fitting can improve.

    Returns
    -------
    str or None
    """
    candidate = Candidate(found, settings, surface, slack)
    for gate in GATES[_shape(found)]:
        if not gate(candidate):
            return gate.__name__
    return None


def passes_gates(
    found: FittedElement, surface: Surface, settings: ElementSettings, slack: float = 1.0
) -> bool:
    """Whether a fitted element passes all gates of its shape; see `failed_gate`."""
    return failed_gate(found, surface, settings, slack) is None
