"""Ellipses of curves: which are believed, and that they move with the cloud."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from pipecore.ellipses import FREE_FIT_ARC, Ellipses, fit_ellipses
from pipecore.geometry import LineAxis, unit
from pipecore.profiles import segment_profiles
from pipecore.settings import ElementSettings, EllipseSettings, ProfileSettings
from pipecore.surface import Surface
from pipecore.types import Stack
from tests.core.shapes import (
    angle_between,
    ball,
    known,
    plane,
    random_direction,
    random_rotation,
    sampled,
    tube,
)

R = 0.09
ALL = EllipseSettings()


def ellipses_of(surface: Surface, direction, settings=ALL, width=0.02) -> Ellipses:
    stack = Stack(1, unit(direction), width)
    curves = segment_profiles(surface, stack, ProfileSettings(), max_radius=5.0)
    return fit_ellipses(curves, surface, settings, ElementSettings())


def tilted(rng, axis: LineAxis, tilt_deg: float):
    """A direction that makes this angle with the axis."""
    up, right = axis.frame(0.0)
    t, a = np.radians(tilt_deg), rng.uniform(0, 2 * np.pi)
    return np.cos(t) * axis.direction + np.sin(t) * (np.cos(a) * up + np.sin(a) * right)


def pipe(rng, length=0.5, **kwargs):
    axis = LineAxis(rng.uniform(-1, 1, 3), random_direction(rng), length)
    return axis, tube(rng, axis, R, **kwargs)


@pytest.mark.parametrize("tilt_deg", [0.0, 25.0, 40.0])
def test_that_the_ellipses_of_a_pipe_have_its_axis_and_radius(rng, tilt_deg):
    axis, points = pipe(rng, noise=0.001)
    found = ellipses_of(sampled(points), tilted(rng, axis, tilt_deg))
    chainage, rho, _ = axis.pipe_coordinates(found.centre)
    whole = (chainage > R) & (chainage < axis.length - R)
    assert whole.sum() >= 10
    # The thinned points' noise, and what an axis off by a few degrees adds to it.
    assert np.quantile(rho[whole], 0.9) < 0.004
    assert np.degrees(np.median(angle_between(found.axis[whole], axis.direction))) < 3.0
    assert np.quantile(np.abs(found.radius[whole] - R), 0.9) < 0.003
    assert np.median(found.semi_minor[whole]) == pytest.approx(R, abs=0.001)
    assert np.median(found.semi_major[whole]) == pytest.approx(
        R / np.cos(np.radians(tilt_deg)), rel=0.04
    )
    # The major axis lies in the plane, towards the tilt.
    assert_allclose(np.einsum("ij,ij->i", found.major_direction, found.normal), 0.0, atol=1e-9)
    if tilt_deg:
        normal = found.normal[0]
        towards = unit(axis.direction - (axis.direction @ normal) * normal)
        angle = angle_between(found.major_direction[whole], towards)
        assert np.degrees(np.median(angle)) < 10.0


def test_that_ellipses_turn_and_move_with_the_cloud(rng):
    axis, (xyz, normals) = pipe(rng, noise=0.001, arc=np.radians(200))
    direction = tilted(rng, axis, 20.0)
    q, shift = random_rotation(rng), 0.02 * 7 * direction
    once = ellipses_of(known((xyz, normals), noise=0.001), direction)
    turned = ellipses_of(known(((xyz + shift) @ q.T, normals @ q.T), noise=0.001), direction @ q.T)
    by_profile = np.argsort(once.profile_index), np.argsort(turned.profile_index)
    once, turned = once[by_profile[0]], turned[by_profile[1]]
    both = np.isin(once.profile_index + 7, turned.profile_index)
    again = np.isin(turned.profile_index - 7, once.profile_index)
    assert both.mean() > 0.9
    # Rounding moves a point between profiles now and then; nothing else differs.
    off = np.linalg.norm((once.centre[both] + shift) @ q.T - turned.centre[again], axis=1)
    assert np.median(off) < 1e-7
    assert np.median(np.abs(once.radius[both] - turned.radius[again])) < 1e-8


def test_that_ellipses_grow_with_the_cloud(rng):
    axis, (xyz, normals) = pipe(rng, noise=0.0012, spacing=0.01)
    scale = 2.0
    once = ellipses_of(known((xyz, normals), noise=0.0012), axis.direction)
    grown = ellipses_of(
        known((scale * xyz, normals), spacing=scale * 0.01, noise=scale * 0.0012),
        axis.direction,
        width=scale * 0.02,
    )
    assert len(grown) == len(once)
    assert_allclose(grown.radius, scale * once.radius, rtol=1e-6)
    assert_allclose(grown.centre, scale * once.centre, atol=1e-6)
    assert_allclose(grown.rms, scale * once.rms, rtol=1e-4)


def test_that_cuts_flatter_than_the_gate_are_not_used(rng):
    # 1 - cos of the tilt is the flattening; the gate of the paper is 45°.
    axis, points = pipe(rng, length=0.8, spacing=0.005)
    surface = known(points, spacing=0.005)
    assert len(ellipses_of(surface, tilted(rng, axis, 35.0))) > 10
    strict = EllipseSettings(max_flattening=0.1)
    assert len(ellipses_of(surface, tilted(rng, axis, 35.0), strict)) == 0
    assert len(ellipses_of(surface, tilted(rng, axis, 20.0), strict)) > 10


def test_that_short_arcs_are_not_used_unless_they_carry_the_radius(rng):
    axis = LineAxis(np.zeros(3), random_direction(rng), 0.5)
    for arc_deg, is_used in ((40.0, False), (110.0, True)):
        points = tube(rng, axis, R, noise=0.001, arc=np.radians(arc_deg))
        found = ellipses_of(known(points, noise=0.001), axis.direction)
        assert (len(found) >= 15) == is_used
    # A vessel's arc of 70° holds many points.
    vessel = tube(rng, axis, 1.0, noise=0.001, arc=np.radians(70.0))
    found = ellipses_of(known(vessel, noise=0.001), axis.direction)
    assert len(found) >= 15
    assert np.abs(found.radius / 1.0 - 1).max() < 0.04


def test_that_a_wall_is_a_line(rng):
    q = random_rotation(rng)
    wall = plane(rng, np.zeros(3), 1.0 * q[0], 1.0 * q[1], noise=0.002)
    for direction in (q[0], q[1], q[0] + q[1]):
        assert len(ellipses_of(sampled(wall), direction)) == 0


def test_that_the_criterion_prefers_ellipse_or_line_as_the_points_do(rng):
    axis, points = pipe(rng, noise=0.001)
    found = ellipses_of(sampled(points), axis.direction)
    # Far from a draw: hundreds of units of information.
    assert np.median(found.aic_line - found.aic_ellipse) > 50
    assert (found.aic_line > found.aic_ellipse).all()


def test_that_half_seen_pipes_keep_their_radius_where_a_free_ellipse_would_not(rng):
    noise = 0.0015
    axis, points = pipe(rng, length=1.0, noise=noise, arc=np.radians(130))
    found = ellipses_of(known(points, noise=noise), axis.direction)
    assert len(found) >= 30
    assert (found.arc < FREE_FIT_ARC).all()
    assert abs(np.median(found.radius) - R) < 0.0015
    assert_allclose(found.semi_minor, found.radius)
    # The scatter is what is claimed.
    off = (found.radius - R) / found.radius_sd
    assert 0.5 < np.sqrt(np.mean(off**2)) < 1.6


def test_that_the_normals_of_a_sphere_meet_in_its_centre_and_those_of_a_pipe_on_its_axis(rng):
    centre = rng.uniform(-1, 1, 3)
    sphere = ellipses_of(sampled(ball(rng, centre, 0.2, noise=0.001)), [0.0, 0.0, 1.0])
    assert len(sphere) >= 5
    off = np.linalg.norm(sphere.meeting_point - centre, axis=1)
    assert np.median(off) < 0.006
    assert np.median(sphere.meeting_distance) == pytest.approx(0.2, abs=0.006)
    height = (sphere.centre - centre)[:, 2]
    # Near the poles a cut is more of a cone.
    is_low = np.abs(height) < 0.08
    assert_allclose(sphere.radius[is_low], np.sqrt(0.2**2 - height[is_low] ** 2), atol=0.006)
    assert np.ptp(height) > 0.12


def test_that_sizes_out_of_bounds_are_not_used(rng):
    axis, points = pipe(rng)
    stack = Stack(1, axis.direction, 0.02)
    surface = known(points)
    curves = segment_profiles(surface, stack, ProfileSettings(), max_radius=5.0)
    for sizes in (ElementSettings(max_radius_mm=60.0), ElementSettings(min_radius_mm=150.0)):
        assert len(fit_ellipses(curves, surface, EllipseSettings(), sizes)) == 0
