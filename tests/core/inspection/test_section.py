from dataclasses import replace

import numpy as np
import pytest

from pipecore.geometry import surface_points
from pipecore.inspection.section import SectionEllipse, cut_section, radius_is_measurable
from tests.core.inspection.sections import (
    CHAINAGE,
    ONE_SIDE,
    PIPE,
    PROFILE,
    RESULT,
    SD,
    cut,
    dented,
)

CIRCLE = SectionEllipse((0.003, -0.002), 0.080, 0.080, 0.0)
TILTED = SectionEllipse((0.003, -0.002), 0.110, 0.080, 0.7)


def test_that_deviation_from_a_circle_is_the_distance_beyond_its_radius():
    points = np.array([[0.003 + 0.0825, -0.002], [0.003, -0.002 - 0.079]])
    assert CIRCLE.deviation(points) == pytest.approx([0.0025, -0.0010])


def test_that_points_on_an_ellipse_have_no_deviation():
    t = np.linspace(0, 2 * np.pi, 50)
    cos, sin = np.cos(TILTED.angle), np.sin(TILTED.angle)
    along, across = TILTED.semi_major * np.cos(t), TILTED.semi_minor * np.sin(t)
    points = np.stack([along * cos - across * sin, along * sin + across * cos], axis=1)
    assert TILTED.deviation(points + TILTED.centre_uv) == pytest.approx(0, abs=1e-12)


def test_that_the_clock_of_a_place_counts_from_above_to_the_right():
    right_and_below = np.add(CIRCLE.centre_uv, [[0.1, 0.0], [0.0, -0.1]])
    assert CIRCLE.clock(right_and_below) == pytest.approx([np.pi / 2, np.pi])


@pytest.mark.parametrize("stack_id", [0, 1])
def test_that_points_of_the_surface_keep_their_clock_and_their_distance(stack_id):
    """In the pipe's own profiles and in those that cut it obliquely."""
    profile = RESULT.profiles.of_element(2, stack_id)
    if not len(profile):
        pytest.skip("this stack does not cut the pipe")
    profile = profile[len(profile) // 2 :][:1]
    clock = np.linspace(0, 2 * np.pi, 90, endpoint=False)
    chainage = float(profile.chainage[0])
    xyz = surface_points(PIPE.axis, chainage, PIPE.radius + 0.004, clock)
    section = cut_section(PIPE, profile, xyz)
    around = np.hypot(*(section.points_uv - section.reference.centre_uv).T)
    assert section.reference.semi_minor == pytest.approx(PIPE.radius)
    assert around.min() == pytest.approx(PIPE.radius + 0.004, rel=1e-6)
    # Along the ray through a point of an ellipse this is at least its distance across the axis.
    assert (section.reference.deviation(section.points_uv) > 0.004 - 1e-9).all()


def test_that_a_circle_beside_the_pipe_through_a_short_arc_is_not_the_pipes():
    radius = PROFILE.semi_minor
    for arc_deg, offset, is_measurable in (
        (90, 0.4, False),
        (90, 0.1, True),
        (300, 0.4, True),
    ):
        profile = replace(
            PROFILE, centre_deviation=offset * radius, arc=np.array([np.deg2rad(arc_deg)])
        )
        assert radius_is_measurable(profile).tolist() == [is_measurable]
        section = cut(dented(0.01), ONE_SIDE, profile=profile)
        assert section.is_radius_measurable == is_measurable


def test_that_the_curve_lies_on_the_true_section_and_ends_where_nothing_was_seen():
    shape = dented(0.01)
    section = cut(shape, ONE_SIDE)
    assert section.curve.noise == pytest.approx(SD, rel=0.2)
    drawn = np.concatenate(section.curve_pieces())
    clocks = section.reference.clock(drawn)
    assert clocks.min() == pytest.approx(ONE_SIDE[0], abs=0.03)
    assert clocks.max() == pytest.approx(ONE_SIDE[1], abs=0.03)
    inside = (clocks > ONE_SIDE[0] + 0.2) & (clocks < ONE_SIDE[1] - 0.2)
    truth = shape(np.full(len(clocks), CHAINAGE), clocks)
    assert np.abs((section.reference.deviation(drawn) - truth)[inside]).max() < 0.0012


def test_that_points_too_few_for_a_curve_are_reported():
    section = cut(dented(0.01), n=8)
    assert section.curve is None
    assert section.curve_pieces() == []
    assert section.no_curve.startswith("only 8 points")
