"""Pipe coordinates of points, against the frames of the axes."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from pipecore._kernels.pipe_coordinates import across_axis, place_on_axis, polar, tangent
from pipecore.geometry import ArcAxis, LineAxis
from tests.core.shapes import bowed_axis, random_direction, random_rotation

pytestmark = pytest.mark.kernels


def axes(rng):
    q = random_rotation(rng)
    yield LineAxis(rng.normal(size=3), random_direction(rng), 0.9)
    yield LineAxis(rng.normal(size=3), np.array([0.0, 0.0, 1.0]), 0.9)
    yield ArcAxis(rng.normal(size=3), q[2], q[0], 0.3, 1.2)
    yield ArcAxis(rng.normal(size=3), q[2], q[0], 0.3, 4.0)
    yield bowed_axis(rng)


def test_that_clock_angles_run_from_twelve_to_three_and_on(rng):
    for up, right, clock in ((1, 0, 0), (0, 1, 0.5), (-1, 0, 1), (0, -1, 1.5)):
        assert polar(2.0 * up, 2.0 * right) == pytest.approx((2.0, clock * np.pi))
    for theta in rng.uniform(0, 2 * np.pi, 50):
        assert polar(0.3 * np.cos(theta), 0.3 * np.sin(theta)) == pytest.approx((0.3, theta))


def test_that_a_hair_before_twelve_is_no_full_turn():
    distance, clock = polar(1.0, -1e-20)
    assert (distance, clock) == (1.0, 0.0)
    assert polar(0.0, 0.0) == (0.0, 0.0)


def test_that_offsets_are_those_in_the_frame_abreast(rng):
    for axis in axes(rng):
        for s, up, right in rng.uniform([0.0, -0.1, -0.1], [axis.length, 0.1, 0.1], (20, 3)):
            to_12, to_3 = axis.frame(s)
            place = axis.at(s) + up * to_12 + right * to_3
            assert_allclose(across_axis(axis.numbers, *place), [s, up, right], atol=1e-12)


def test_that_points_of_the_axis_have_no_offset(rng):
    for axis in axes(rng):
        for s in (0.0, 0.5 * axis.length, axis.length):
            assert_allclose(across_axis(axis.numbers, *axis.at(s)), [s, 0.0, 0.0], atol=1e-12)


def test_that_places_and_tangents_are_those_of_the_axes_beyond_their_ends_too(rng):
    for axis in axes(rng):
        for s in rng.uniform(-0.1, axis.length + 0.1, 20):
            assert_allclose(place_on_axis(axis.numbers, s), axis.at(s), atol=1e-12)
            assert_allclose(tangent(axis.numbers, s), axis.tangent(s), atol=1e-12)


def test_that_an_arc_is_cut_opposite_its_middle(rng):
    q = random_rotation(rng)
    axis = ArcAxis(np.zeros(3), q[2], q[0], 0.3, 1.0)
    for beyond in (-0.01, 0.01):
        angle = 0.5 + np.pi + beyond
        place = 0.35 * (np.cos(angle) * q[0] + np.sin(angle) * np.cross(q[2], q[0]))
        chainage, _, _ = across_axis(axis.numbers, *place)
        # Counted on from the end up to there, and back from the start beyond it.
        expected = angle - 2 * np.pi * (beyond > 0)
        assert chainage == pytest.approx(0.3 * expected)
