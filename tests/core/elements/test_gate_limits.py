"""Each gate of the acceptance table on an element just inside its limit and just outside."""

from dataclasses import replace

import numpy as np
import pytest

from pipecore.elements.gates import acceptance
from pipecore.elements.gates.acceptance import GATES, failed_gate
from pipecore.elements.refinement.extent import Extent
from pipecore.elements.refinement.fitted_element import FittedElement
from pipecore.elements.refinement.surface_fits import (
    ArcSurface,
    LineSurface,
    SphereSurface,
    SurfaceFit,
)
from pipecore.geometry import LineAxis, surface_points
from pipecore.settings import ElementSettings
from tests.core.shapes import FULL, known

RADIUS, NOISE, VOXEL = 0.1, 0.001, 0.01
INSIDE, OUTSIDE = 0.97, 1.03
X, Z = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])
NOTHING = known((np.zeros((1, 3)), Z[None]), spacing=VOXEL, noise=NOISE)


def fit_of(model, radius_sd, bend_radius_sd=0.001):
    n = {LineSurface: 6 if model.is_conical else 5, ArcSurface: 7, SphereSurface: 4}[type(model)]
    covariance = np.zeros((n, n))
    covariance[model.radius_parameter, model.radius_parameter] = radius_sd**2
    if isinstance(model, ArcSurface):
        covariance[5, 5] = bend_radius_sd**2
    return SurfaceFit(model, covariance, NOISE, 1000)


def pipe(lengths=12.0, arc=np.pi, relative_sd=0.001, slope=None, **changes):
    """A cylinder, or a cone, of so many radii of length, seen over an arc."""
    axis = LineAxis(np.zeros(3), X, lengths * RADIUS)
    middle = axis.at(axis.length / 2)
    model = LineSurface(middle, X, RADIUS, slope or 0.0, is_tapered=slope is not None)
    extent = Extent(0.0, axis.length, arc, changes.pop("coverage", 1.0), ())
    found = FittedElement(fit_of(model, relative_sd * RADIUS), axis, np.arange(0), extent, 0.0)
    return replace(found, **changes), NOTHING, ElementSettings()


def bend(bend_radius=3.0 * RADIUS, arc=np.pi, lengths=4.0, bend_radius_sd=0.001):
    model = ArcSurface(np.zeros(3), Z, bend_radius, RADIUS)
    axis = model.axis_from(X, lengths * RADIUS / bend_radius)
    fit = fit_of(model, 0.001 * RADIUS, bend_radius_sd)
    extent = Extent(0.0, axis.length, arc, 1.0, ())
    return FittedElement(fit, axis, np.arange(0), extent, 0.0), NOTHING, ElementSettings()


def sphere(n_points=500, misfit=0.0):
    model = SphereSurface(np.zeros(3), RADIUS)
    axis = LineAxis(-RADIUS * Z, Z, 2 * RADIUS)
    extent = Extent(0.0, axis.length, FULL, 1.0, ())
    fit = fit_of(model, 0.001 * RADIUS)
    return FittedElement(fit, axis, np.arange(n_points), extent, misfit), NOTHING, ElementSettings()


def wavy_pipe(sd):
    """A half-seen pipe whose cells of 40 mm by 18° leave its shape at random."""
    found, _, settings = pipe()
    rng = np.random.default_rng(5)
    chainage, clock = np.meshgrid(np.arange(0.005, 1.2, 0.006), np.arange(0.03, np.pi, 0.06))
    chainage, clock = chainage.ravel(), clock.ravel()
    height = sd * rng.normal(size=(31, 20))
    row = ((chainage - chainage.min()) / 0.04).astype(int)
    residual = height[row, (clock / FULL * 20).astype(int)] + 1e-4 * rng.normal(size=len(row))
    xyz = surface_points(found.axis, chainage, RADIUS + residual, clock)
    surface = known((xyz, np.tile(Z, (len(xyz), 1))), spacing=VOXEL, noise=NOISE)
    return replace(found, inliers=np.arange(len(xyz))), surface, settings


def of_settings(factor):
    found, surface, settings = pipe()
    return found, surface, replace(settings, max_radius_mm=1e3 * RADIUS / factor)


def scattered(factor):
    # Seen over less than 100° a pipe may scatter by 4 mm, at this noise.
    found, *rest = pipe(lengths=12.0, arc=np.deg2rad(95.0))
    return replace(found, fit=replace(found.fit, sigma=factor * 0.004)), *rest


SHORT_ARC = np.deg2rad(80.0)
EXAMPLES = {
    "radius_is_within_limits": of_settings,
    "scatter_is_low": scattered,
    "radius_is_well_determined": lambda f: pipe(relative_sd=f * acceptance.MAX_RADIUS_SD),
    "section_is_round": lambda f: pipe(
        misfit=f * (acceptance.MAX_MISFIT * RADIUS + acceptance.MAX_NOISE_MISFIT * NOISE)
    ),
    "axis_is_covered": lambda f: pipe(coverage=acceptance.MIN_COVERAGE / f),
    # The radius is well determined, though not as well as lets a straight show still less.
    "arc_is_wide_enough": lambda f: pipe(arc=acceptance.MIN_ARC / f, relative_sd=0.008),
    "radius_is_precise_for_its_arc": lambda f: pipe(
        lengths=2.5, arc=SHORT_ARC, relative_sd=f * acceptance.SHARP_RADIUS_SD
    ),
    "bend_arc_is_wide_enough": lambda f: bend(arc=acceptance.MIN_BEND_ARC / f),
    "bend_radius_is_well_determined": lambda f: bend(
        bend_radius_sd=f * acceptance.MAX_BEND_RADIUS_SD * 3.0 * RADIUS
    ),
    "bend_radius_exceeds_radius": lambda f: bend(acceptance.MIN_BEND_RADIUS * RADIUS / f),
    "bend_is_long_enough": lambda f: bend(lengths=acceptance.MIN_BEND_LENGTH / f),
    "cone_tapers_clearly": lambda f: pipe(
        lengths=4.0, slope=acceptance.MIN_TAPER_CHANGE / (4.0 * f)
    ),
    "cylinder_is_long_enough": lambda f: pipe(lengths=acceptance.MIN_VOXELS * VOXEL / (RADIUS * f)),
    "has_enough_points": lambda f: sphere(round(acceptance.MIN_SPHERE_POINTS / f)),
    "sphere_fits_everywhere": lambda f: sphere(
        misfit=f * (acceptance.MAX_SPHERE_MISFIT[0] * RADIUS + acceptance.MAX_SPHERE_MISFIT[1])
    ),
}


@pytest.mark.parametrize("gate", EXAMPLES)
def test_that_a_gate_lets_pass_what_is_just_inside_its_limit_and_no_more(gate):
    assert failed_gate(*EXAMPLES[gate](INSIDE)) is None
    assert failed_gate(*EXAMPLES[gate](OUTSIDE)) == gate


def test_that_a_surface_may_be_as_wavy_as_its_arc_and_length_allow():
    # Half of it is seen and it is long: four fifths of the way from the least to the most.
    least, most = acceptance.WAVINESS
    limit = (least + 0.8 * (most - least)) * RADIUS
    assert failed_gate(*wavy_pipe(0.75 * limit)) is None
    assert failed_gate(*wavy_pipe(1.35 * limit)) == "surface_is_smooth"


def test_that_a_wavy_surface_of_an_uncertain_radius_is_taken_for_chance():
    """Either alone is within its limit; together they are what folds and limbs show."""
    least, most = acceptance.WAVINESS
    wavy, surface, settings = wavy_pipe(0.7 * (least + 0.8 * (most - least)) * RADIUS)
    uncertain = fit_of(wavy.fit.model, 0.95 * acceptance.MAX_RADIUS_SD * RADIUS)
    smooth, nothing, _ = pipe(fit=uncertain)
    assert failed_gate(wavy, surface, settings) is None
    assert failed_gate(smooth, nothing, settings) is None
    both = replace(wavy, fit=uncertain)
    assert failed_gate(both, surface, settings) == "is_surface_of_revolution"


def test_that_every_gate_of_the_table_has_an_example():
    gates = {gate.__name__ for of_shape in GATES.values() for gate in of_shape}
    assert gates == {*EXAMPLES, "surface_is_smooth", "is_surface_of_revolution"}
