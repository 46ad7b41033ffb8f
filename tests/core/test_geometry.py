"""Pipe coordinates of straight and bent axes, and the clock as inspectors read it."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from pipecore.geometry import (
    ArcAxis,
    Axis,
    CurveAxis,
    LineAxis,
    offsets_from_chord,
    surface_points,
    twelve_o_clock,
    unit,
)

NORTH, EAST, UP = np.array([0.0, 1.0, 0.0]), np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])
QUARTER = math.pi / 2

vectors = st.tuples(*[st.floats(-100.0, 100.0)] * 3).map(np.array)
directions = vectors.filter(lambda v: np.linalg.norm(v) > 1e-3).map(unit)


@st.composite
def lines(draw: st.DrawFn) -> LineAxis:
    return LineAxis(draw(vectors), draw(directions), draw(st.floats(0.05, 50.0)))


@st.composite
def arcs(draw: st.DrawFn) -> ArcAxis:
    normal, other = draw(directions), draw(directions)
    across = np.cross(normal, other)
    assume(np.linalg.norm(across) > 0.05)
    return ArcAxis(
        centre=draw(vectors),
        normal=normal,
        towards_start=unit(across),
        bend_radius=draw(st.floats(0.05, 10.0)),
        bend_angle=draw(st.floats(0.05, 6.0)),
    )


@st.composite
def curves(draw: st.DrawFn) -> CurveAxis:
    """A pipe bowed by up to a twentieth of its length, in one bow or two."""
    chord = draw(lines())
    t = np.linspace(0.0, 1.0, 9)
    bow, other, turn = (draw(st.floats(-0.05, 0.05)) for _ in range(3))
    up, right = chord.frame(0.0)
    across = bow * np.sin(np.pi * t)[:, None] * up + other * np.sin(2 * np.pi * t)[:, None] * right
    across = across + turn * (t * (1 - t))[:, None] * right
    return CurveAxis.through(chord.at(t * chord.length) + chord.length * across)


axes = st.one_of(lines(), arcs(), curves())
fractions = st.floats(0.0, 1.0)
clocks = st.floats(0.0, 2 * math.pi)


def clock_of(axis: Axis, point: np.ndarray) -> float:
    return float(axis.pipe_coordinates(point[None])[2][0])


def angle_between(a: float, b: float) -> float:
    """Difference of two clock angles, however they wrap."""
    return abs((a - b + math.pi) % (2 * math.pi) - math.pi)


@given(axes, fractions, st.floats(0.05, 0.9), clocks)
def test_that_pipe_coordinates_undo_surface_points(
    axis: Axis, fraction: float, relative_radius: float, clock: float
) -> None:
    # Within the bend radius, as on every real bend: beyond it a point has two positions.
    radius = relative_radius * (axis.bend_radius if isinstance(axis, ArcAxis) else 1.0)
    if isinstance(axis, CurveAxis):
        radius *= 0.1 * axis.length
    point = surface_points(axis, fraction * axis.length, radius, clock)
    chainage, distance, angle = (float(c[0]) for c in axis.pipe_coordinates(point[None]))
    assert chainage == pytest.approx(fraction * axis.length, abs=1e-9)
    assert distance == pytest.approx(radius, abs=1e-9)
    assert angle_between(angle, clock) < 1e-8
    assert 0.0 <= angle < 2 * math.pi


@given(lines(), vectors)
def test_that_surface_points_undo_pipe_coordinates(axis: LineAxis, point: np.ndarray) -> None:
    np.testing.assert_allclose(
        surface_points(axis, *axis.pipe_coordinates(point[None]))[0], point, atol=1e-9
    )


@given(axes, fractions)
def test_that_the_frame_is_right_handed_and_orthonormal(axis: Axis, fraction: float) -> None:
    chainage = fraction * axis.length
    up, right = axis.frame(chainage)
    frame = np.stack([axis.tangent(chainage), up, right])
    np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-12)
    # Looking ahead with 12:00 up, 3:00 is on the right hand.
    np.testing.assert_allclose(np.cross(frame[0], up), right, atol=1e-12)


@given(axes, fractions)
def test_that_the_tangent_is_the_slope_of_the_axis(axis: Axis, fraction: float) -> None:
    step = 1e-5 * axis.length
    s = fraction * axis.length
    slope = (axis.at(s + step) - axis.at(s - step)) / (2 * step)
    # A curve counts chainage evenly within each of its pieces: the direction alone is exact.
    rate = float(np.linalg.norm(slope))
    assert rate == pytest.approx(1.0, abs=0.01 if isinstance(axis, CurveAxis) else 1e-4)
    np.testing.assert_allclose(slope / rate, axis.tangent(s), atol=1e-4)


@given(axes)
def test_that_an_axis_runs_from_its_start_to_its_end(axis: Axis) -> None:
    np.testing.assert_allclose(axis.at(0.0), axis.start, atol=1e-9)
    np.testing.assert_allclose(axis.at(axis.length), axis.end, atol=1e-9)
    s = np.linspace(0.0, axis.length, 2001)
    walked = np.linalg.norm(np.diff(axis.at(s), axis=0), axis=1).sum()
    assert walked == pytest.approx(axis.length, rel=1e-5)


@given(axes, fractions, clocks)
def test_that_reversing_mirrors_the_clock_and_counts_from_the_other_end(
    axis: Axis, fraction: float, clock: float
) -> None:
    back = axis.reversed()
    np.testing.assert_allclose(back.start, axis.end, atol=1e-9)
    np.testing.assert_allclose(back.end, axis.start, atol=1e-9)
    # 12:00 and 6:00 stay where they are, 3:00 and 9:00 change sides.
    there = surface_points(axis, fraction * axis.length, 0.01, clock)
    here = surface_points(back, (1 - fraction) * axis.length, 0.01, -clock)
    np.testing.assert_allclose(there, here, atol=1e-9)


@given(axes, st.floats(0.0, 0.4), st.floats(0.6, 1.0))
def test_that_a_part_lies_on_the_whole(axis: Axis, low: float, high: float) -> None:
    first, last = low * axis.length, high * axis.length
    part = axis.part(first, last)
    # A spline through another one is as near as its pieces are short.
    atol = 2e-4 * axis.length if isinstance(axis, CurveAxis) else 1e-9
    np.testing.assert_allclose(part.start, axis.at(first), atol=1e-9)
    np.testing.assert_allclose(part.end, axis.at(last), atol=1e-9)
    assert part.length == pytest.approx(last - first, abs=atol)
    s = np.linspace(0.0, last - first, 7)
    np.testing.assert_allclose(part.at(s), axis.at(first + s), atol=atol)


@given(axes, vectors, fractions, clocks)
def test_that_moving_an_axis_moves_all_about_it(
    axis: Axis, shift: np.ndarray, fraction: float, clock: float
) -> None:
    s = fraction * axis.length
    there = surface_points(axis, s, 0.02, clock) + shift
    np.testing.assert_allclose(surface_points(axis.moved(shift), s, 0.02, clock), there, atol=1e-9)


@given(curves())
def test_that_a_curve_goes_through_its_points_and_knows_its_bow(axis: CurveAxis) -> None:
    s = np.linspace(0.0, axis.length, 400)
    offset = offsets_from_chord(axis, s)
    assert np.hypot(*offset.T).max() == pytest.approx(axis.bow, abs=0.02 * axis.bow + 1e-9)
    _, distance, _ = axis.chord.pipe_coordinates(axis.at(s))
    np.testing.assert_allclose(np.hypot(*offset.T), distance, atol=1e-9)
    # Beyond its ends it goes on straight.
    for end, tangent in ((axis.start, axis.tangent(0.0)), (axis.end, axis.tangent(axis.length))):
        ahead = 0.3 * (1 if tangent @ (axis.end - axis.start) > 0 else -1)
        sign = -ahead if end is axis.start else ahead
        _, off, _ = axis.pipe_coordinates((end + sign * tangent)[None])
        assert off[0] == pytest.approx(0.0, abs=1e-9)


@given(axes)
def test_that_many_chainages_give_what_each_gives_alone(axis: Axis) -> None:
    many = np.linspace(0.0, axis.length, 4)
    for method in (axis.at, axis.tangent, lambda s: axis.frame(s)[0], lambda s: axis.frame(s)[1]):
        np.testing.assert_allclose(method(many), [method(s) for s in many], atol=1e-12)


@pytest.mark.parametrize(
    ("heading", "three_o_clock"),
    [(NORTH, EAST), (EAST, -NORTH), (-NORTH, -EAST), (-EAST, NORTH)],
)
def test_that_twelve_is_up_and_three_is_right_on_a_level_pipe(
    heading: np.ndarray, three_o_clock: np.ndarray
) -> None:
    pipe = LineAxis.between((5.0, 5.0, 5.0), 5.0 + 2 * heading)
    up, right = pipe.frame(1.0)
    np.testing.assert_allclose(up, UP, atol=1e-15)
    np.testing.assert_allclose(right, three_o_clock, atol=1e-15)
    assert clock_of(pipe, pipe.at(1.0) - 0.1 * UP) == pytest.approx(math.pi)
    assert clock_of(pipe, pipe.at(1.0) - 0.1 * three_o_clock) == pytest.approx(3 * QUARTER)


@pytest.mark.parametrize(("heading", "three_o_clock"), [(UP, -EAST), (-UP, EAST)])
def test_that_twelve_is_grid_north_on_a_vertical_pipe(
    heading: np.ndarray, three_o_clock: np.ndarray
) -> None:
    up, right = LineAxis(np.zeros(3), heading, 3.0).frame(0.0)
    np.testing.assert_allclose(up, NORTH, atol=1e-15)
    np.testing.assert_allclose(right, three_o_clock, atol=1e-15)


@given(st.floats(0.0, 14.9), clocks)
def test_that_a_nearly_vertical_pipe_still_has_north_at_twelve(
    tilt_deg: float, azimuth: float
) -> None:
    tilt = math.radians(tilt_deg)
    tangent = np.array(
        [math.sin(tilt) * math.cos(azimuth), math.sin(tilt) * math.sin(azimuth), math.cos(tilt)]
    )
    assert twelve_o_clock(tangent) @ NORTH > math.cos(math.radians(15.0))


@given(st.floats(15.1, 90.0), clocks)
def test_that_a_sloping_pipe_has_its_top_at_twelve(tilt_deg: float, azimuth: float) -> None:
    tilt = math.radians(tilt_deg)
    tangent = np.array(
        [math.sin(tilt) * math.cos(azimuth), math.sin(tilt) * math.sin(azimuth), math.cos(tilt)]
    )
    across = twelve_o_clock(tangent)
    # Of all directions across the pipe, none rises more steeply.
    assert across @ UP == pytest.approx(math.sin(tilt))


def test_that_a_clock_angle_never_reaches_a_full_turn() -> None:
    pipe = LineAxis(np.zeros(3), NORTH, 1.0)
    hair_before_twelve = np.array([-1e-20, 0.5, 0.1])
    assert clock_of(pipe, hair_before_twelve) == 0.0


@given(arcs())
def test_that_intrados_and_extrados_keep_their_clock_through_a_bend(bend: ArcAxis) -> None:
    s = np.linspace(0.0, bend.length, 7)
    outward = (bend.at(s) - bend.centre) / bend.bend_radius
    r = 0.3 * bend.bend_radius
    extrados = bend.pipe_coordinates(bend.at(s) + r * outward)[2]
    intrados = bend.pipe_coordinates(bend.at(s) - r * outward)[2]
    for out, inside in zip(extrados, intrados, strict=True):
        assert angle_between(float(out), float(extrados[0])) < 1e-8
        assert angle_between(float(inside), float(extrados[0]) + math.pi) < 1e-8


def test_that_a_level_left_hand_bend_has_its_extrados_at_three() -> None:
    bend = ArcAxis(np.zeros(3), UP, EAST, bend_radius=1.0, bend_angle=QUARTER)
    np.testing.assert_allclose(bend.tangent(0.0), NORTH, atol=1e-15)
    assert clock_of(bend, np.array([1.1, 0.0, 0.0])) == pytest.approx(QUARTER)
    assert clock_of(bend, np.array([0.9, 0.0, 0.0])) == pytest.approx(3 * QUARTER)
    assert angle_between(clock_of(bend, np.array([1.0, 0.0, 0.1])), 0.0) < 1e-12


def test_that_a_bend_from_riser_to_level_pipe_takes_its_clock_from_its_middle() -> None:
    bend = ArcAxis(np.zeros(3), -EAST, -NORTH, bend_radius=1.0, bend_angle=QUARTER)
    np.testing.assert_allclose(bend.tangent(0.0), UP, atol=1e-15)
    np.testing.assert_allclose(bend.tangent(bend.length), NORTH, atol=1e-15)
    # At the level end it agrees with the pipe that follows; at the riser's end the
    # extrados, which lies south, stays at 12:00.
    np.testing.assert_allclose(bend.frame(bend.length)[0], UP, atol=1e-15)
    np.testing.assert_allclose(bend.frame(0.0)[0], -NORTH, atol=1e-15)


@given(arcs(), st.floats(0.0, 0.4))
def test_that_points_beyond_the_ends_of_a_bend_have_chainages_beyond_them(
    bend: ArcAxis, beyond: float
) -> None:
    # Half of the free part of the circle belongs to either end.
    step = beyond * (2 * math.pi - bend.bend_angle) * bend.bend_radius
    s = np.array([-step, bend.length + step])
    np.testing.assert_allclose(bend.pipe_coordinates(bend.at(s))[0], s, atol=1e-8)


@given(directions, directions, st.floats(0.2, 5.0), fractions, clocks)
def test_that_a_bend_of_huge_radius_is_a_straight_pipe(
    direction: np.ndarray, other: np.ndarray, length: float, fraction: float, clock: float
) -> None:
    across = np.cross(direction, other)
    assume(np.linalg.norm(across) > 0.05)
    # Away from the tilt at which 12:00 turns from up to north.
    assume(abs(abs(math.degrees(math.acos(min(1.0, abs(direction[2])))) - 15.0)) > 0.1)
    towards_start, huge = unit(across), 1e6
    bend = ArcAxis(
        centre=-huge * towards_start,
        normal=np.cross(towards_start, direction),
        towards_start=towards_start,
        bend_radius=huge,
        bend_angle=length / huge,
    )
    pipe = LineAxis(np.zeros(3), direction, length)
    np.testing.assert_allclose(
        surface_points(bend, fraction * length, 0.1, clock),
        surface_points(pipe, fraction * length, 0.1, clock),
        atol=1e-4,
    )
