"""How far surfaces reach, whether sections are round, and how elements join to runs."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from pipecore._kernels.axis_rows import normal_turning
from pipecore.elements.refinement.extent import find_extent, section_misfit
from pipecore.elements.runs.ends import AxisSpan, LineIndex, meeting_ends
from pipecore.elements.runs.numbering import number_runs
from pipecore.elements.runs.trimming import trim_to_reducer, trim_to_tangent
from pipecore.geometry import ArcAxis, LineAxis
from tests.core.shapes import random_direction, random_rotation

RADIUS, NOISE, VOXEL = 0.1, 0.001, 0.01


def wall_points(rng, low, high, arc=np.pi, spacing=VOXEL):
    """Chainage, clock, residual and normal_angle of points of a pipe between two chainages."""
    n = round((high - low) * arc * RADIUS / spacing**2)
    clock = rng.uniform(0, arc, n)
    normal_angle = np.radians(5.0) * rng.normal(size=n)
    return rng.uniform(low, high, n), clock, NOISE * rng.normal(size=n), normal_angle


def floor_points(rng, low, high):
    """The same of the strip of floor that a pipe lies on, at 6:00."""
    aside = 0.5 * RADIUS
    n = round((high - low) * 2 * aside / VOXEL**2)
    clock = np.pi + np.arctan(rng.uniform(-aside, aside, n) / RADIUS)
    residual = RADIUS / -np.cos(clock) - RADIUS + NOISE * rng.normal(size=n)
    normal_angle = np.pi - clock + np.radians(5.0) * rng.normal(size=n)
    return rng.uniform(low, high, n), clock, residual, normal_angle


NOTHING = np.empty(0), np.empty(0)


def extent_of(*parts, length=1.0, inside=NOTHING):
    chainage, clock, residual, normal_angle = (np.concatenate(p) for p in zip(*parts, strict=True))

    def find_inside(begin, end):
        within = (inside[0] > begin) & (inside[0] < end)
        return np.stack(inside)[:, within]

    return find_extent(
        chainage, clock, residual, normal_angle, find_inside, length, RADIUS, VOXEL, NOISE
    )


def test_that_the_extent_grows_to_where_the_points_end(rng):
    extent = extent_of(wall_points(rng, -0.33, 1.21))
    assert extent.low == pytest.approx(-0.33, abs=0.02)
    assert extent.high == pytest.approx(1.21, abs=0.02)
    assert np.degrees(extent.arc) == pytest.approx(180.0, abs=25.0)
    assert extent.coverage > 0.95
    assert extent.gaps == ()


def test_that_a_gap_is_reported_with_its_place(rng):
    extent = extent_of(wall_points(rng, 0.0, 0.3), wall_points(rng, 0.6, 1.0))
    assert (extent.low, extent.high) == pytest.approx((0.0, 1.0), abs=0.02)
    ((a, b),) = extent.gaps
    assert (a, b) == pytest.approx((0.3, 0.6), abs=0.04)


def bent_points(rng, low, high, arc, waves, amplitude=0.0045):
    """Points of a wall that leaves the circle by so many waves around it."""
    chainage, clock, residual, normal_angle = wall_points(rng, low, high, arc)
    return chainage, clock, residual + amplitude * np.cos(waves * clock), normal_angle


def test_that_an_oval_stretch_is_still_the_pipe_where_the_arc_can_tell(rng):
    def end_of(arc, waves):
        round_part = wall_points(rng, 0.0, 1.0, arc)
        return extent_of(round_part, bent_points(rng, 1.0, 1.8, arc, waves)).high

    # 9 % of ovality.
    assert end_of(2 * np.pi, 2) == pytest.approx(1.8, abs=0.02)
    assert end_of(np.radians(240.0), 2) == pytest.approx(1.8, abs=0.03)
    # Half of it could as well be something else, and what is square or three-sided is.
    assert end_of(np.pi, 2) == pytest.approx(1.0, abs=0.05)
    assert end_of(2 * np.pi, 3) == pytest.approx(1.0, abs=0.05)
    assert end_of(2 * np.pi, 4) == pytest.approx(1.0, abs=0.05)


def test_that_another_radius_is_not_taken_for_ovality(rng):
    arc = 2 * np.pi
    wider = bent_points(rng, 1.0, 1.8, arc, 0)
    assert extent_of(wall_points(rng, 0.0, 1.0, arc), wider).high == pytest.approx(1.0, abs=0.05)


def test_that_points_beyond_a_long_gap_are_of_something_else(rng):
    extent = extent_of(wall_points(rng, 0.0, 1.0), wall_points(rng, 1.7, 2.5))
    assert extent.high == pytest.approx(1.0, abs=0.02)


def test_that_the_pipe_ends_where_the_points_leave_its_surface(rng):
    chainage, clock, residual, normal_angle = wall_points(rng, 0.0, 1.6)
    beyond = chainage > 1.2
    residual[beyond] += 0.05 * (chainage[beyond] - 1.2)
    extent = extent_of((chainage, clock, residual, normal_angle))
    assert extent.high == pytest.approx(1.23, abs=0.06)


def test_that_two_flanges_are_not_one_pipe_with_a_gap_but_a_dented_pipe_is_one(rng):
    one, other = wall_points(rng, 0.0, 0.06), wall_points(rng, 0.12, 0.17)
    narrower = wall_points(rng, 0.05, 0.13)[:2]
    assert extent_of(one, other, length=0.17).high == pytest.approx(0.17, abs=0.02)
    assert extent_of(one, other, length=0.17, inside=narrower).high < 0.08
    # The middle of a dent lies inside too, but around less of the pipe.
    dent = wall_points(rng, 0.45, 0.55, arc=np.radians(50))[:2]
    halves = wall_points(rng, 0.0, 0.45), wall_points(rng, 0.55, 1.0)
    assert extent_of(*halves, inside=dent).high == pytest.approx(1.0, abs=0.02)


def test_that_a_pipe_ends_where_only_the_floor_goes_on(rng):
    # The floor touches the pipe's surface from below all along: near, but flat.
    pipe, floor = wall_points(rng, 0.0, 1.0, arc=np.radians(240)), floor_points(rng, -1.0, 2.0)
    chainage, clock, residual, normal_angle = floor
    near = np.abs(residual) < 0.012
    extent = extent_of(pipe, (chainage[near], clock[near], residual[near], normal_angle[near]))
    assert (extent.low, extent.high) == pytest.approx((0.0, 1.0), abs=0.04)


def test_that_normals_turn_with_the_clock_on_a_pipe_and_not_on_a_floor(rng):
    for points, turning in ((wall_points(rng, 0, 1), 1.0), (floor_points(rng, 0, 1), 0.0)):
        _, clock, _, normal_angle = points
        row = rng.integers(0, 2, len(clock))
        found = np.empty(3)
        normal_turning(clock, normal_angle, row, found)
        assert_allclose(found, [turning, turning, 0.0], atol=0.1)


def test_that_a_surface_without_points_has_no_extent(rng):
    nothing = np.empty(0)
    assert (
        find_extent(nothing, nothing, nothing, nothing, lambda *_: None, 1.0, RADIUS, VOXEL, NOISE)
        is None
    )
    assert extent_of(wall_points(rng, 5.0, 6.0)) is None


def test_that_a_pipe_has_a_round_section_even_off_centre_or_oval_and_a_post_has_not(rng):
    clock = rng.uniform(0, 2 * np.pi, 3000)
    noise = NOISE * rng.normal(size=3000)
    off_centre = 0.003 * np.cos(clock - 1.0) + 0.001
    oval = 0.004 * np.cos(2 * clock)
    for shape in (0 * clock, off_centre, off_centre + oval):
        assert section_misfit(clock, shape + noise, 2 * np.pi) < 0.3 * NOISE
    # A square post of the same mean radius: 10 % of it between side and corner.
    side = np.abs((clock + np.pi / 4) % (np.pi / 2) - np.pi / 4)
    square = 0.09 / np.cos(side)
    misfit = section_misfit(clock, square - square.mean() + noise, 2 * np.pi)
    assert misfit > 0.05 * RADIUS


def test_that_ovality_of_a_half_seen_pipe_is_not_excused(rng):
    # On less than 200° the second harmonic would explain nearly anything.
    clock = rng.uniform(0, np.radians(150), 3000)
    flat = 0.09 / np.cos(clock - np.radians(75)).clip(0.6) - RADIUS
    assert section_misfit(clock, flat, np.radians(150)) > 0.03 * RADIUS


def chain(rng):
    """A straight, its bend and the next straight, meeting exactly."""
    q = random_rotation(rng)
    bend = ArcAxis(rng.uniform(-1, 1, 3), q[2], q[0], 0.3, np.pi / 2)
    into = LineAxis(bend.start - 0.8 * bend.tangent(0.0), np.array(bend.tangent(0.0)), 0.8)
    out = LineAxis(bend.end, np.array(bend.tangent(bend.length)), 0.6)
    return into, bend, out


@pytest.mark.parametrize("is_turned", [False, True])
def test_that_a_straight_a_bend_and_a_straight_meet_at_their_ends(rng, is_turned):
    into, bend, out = chain(rng)
    axes = [into, bend.reversed() if is_turned else bend, out]
    found = meeting_ends([AxisSpan(a, (RADIUS, RADIUS)) for a in axes])
    expected = {(0, 1, 1, int(is_turned)), (1, 1 - is_turned, 2, 0)}
    assert {min(f, (*f[2:], *f[:2])) for f in found} == expected
    assert_array_equal(number_runs(3, [(i, j) for i, _, j, _ in found]), [0, 0, 0])


def test_that_ends_beside_each_other_do_not_meet(rng):
    d = random_direction(rng)
    one = LineAxis(np.zeros(3), d, 1.0)
    up, _ = one.frame(0.0)
    beside = LineAxis(one.at(1.1) + 2.2 * RADIUS * up, d, 1.0)
    across = LineAxis(one.end, np.array(up), 1.0)
    thick = LineAxis(one.at(1.1), d, 1.0)
    spans = [AxisSpan(one, (RADIUS, RADIUS))]
    assert meeting_ends([*spans, AxisSpan(beside, (RADIUS, RADIUS))]) == []
    assert meeting_ends([*spans, AxisSpan(across, (RADIUS, RADIUS))]) == []
    assert meeting_ends([*spans, AxisSpan(thick, (3 * RADIUS, 3 * RADIUS))]) == []
    assert_array_equal(number_runs(3, []), [0, 1, 2])


def test_that_an_end_meets_only_the_nearest(rng):
    d = random_direction(rng)
    one, near, far = (LineAxis(s * d, d, 0.3) for s in (0.0, 0.35, 0.7))
    found = meeting_ends([AxisSpan(a, (RADIUS, RADIUS)) for a in (one, near, far)])
    assert {frozenset((i, j)) for i, _, j, _ in found} == {frozenset((0, 1)), frozenset((1, 2))}


@pytest.mark.parametrize("is_turned", [False, True])
def test_that_a_straight_and_a_bend_are_trimmed_to_their_tangent_point(rng, is_turned):
    into, bend, _ = chain(rng)
    # As scanned, the straight goes on too far and the bend begins too early.
    line = LineAxis(into.start, into.direction, into.length + 0.05)
    early = -0.1
    turned = np.cos(early) * bend.towards_start + np.sin(early) * np.cross(
        bend.normal, bend.towards_start
    )
    arc = ArcAxis(bend.centre, bend.normal, turned, bend.bend_radius, bend.bend_angle - early)
    line_end, arc_end = 1, 0
    if is_turned:
        line, arc = line.reversed(), arc.reversed()
        line_end, arc_end = 0, 1
    line, arc = trim_to_tangent(line, line_end, arc, arc_end, 0.2)
    meeting = bend.start
    assert_allclose((line.end if line_end else line.start), meeting, atol=1e-12)
    assert_allclose((arc.end if arc_end else arc.start), meeting, atol=1e-12)
    other_end = arc.start if arc_end else arc.end
    assert_allclose(other_end, bend.end, atol=1e-12)
    assert arc.bend_angle == pytest.approx(np.pi / 2)


def test_that_nothing_is_trimmed_where_the_tangent_point_is_out_of_reach(rng):
    into, bend, _ = chain(rng)
    longer = LineAxis(into.start, into.direction, into.length + 0.5)
    line, arc = trim_to_tangent(longer, 1, bend, 0, 0.2)
    assert line is longer
    assert arc is bend


def test_that_lines_near_a_place_are_those_that_pass_it(rng):
    axes = [LineAxis(rng.uniform(-1, 1, 3), random_direction(rng), 0.8) for _ in range(40)]
    axes[7] = ArcAxis(np.zeros(3), np.eye(3)[2], np.eye(3)[0], 0.3, 1.0)
    lines, reach = LineIndex(axes), rng.uniform(0.1, 0.6, 40)
    n_found = 0
    for place in rng.uniform(-1, 1, (20, 3)):
        expected = []
        for i, axis in enumerate(axes):
            (s,), (rho,), _ = axis.pipe_coordinates(place[None])
            beside = -reach[i] < s < axis.length + reach[i]
            if isinstance(axis, LineAxis) and rho < reach[i] and beside:
                expected.append(i)
        assert lines.near(place, reach) == expected
        n_found += len(expected)
    assert n_found > 5
    assert LineIndex([]).near(np.zeros(3), np.empty(0)) == []


@pytest.mark.parametrize("at_start", [False, True])
@pytest.mark.parametrize("short", [-0.03, 0.0, 0.04])
def test_that_a_straight_ends_where_the_reducer_on_its_line_begins(rng, at_start, short):
    origin, direction = rng.uniform(-2, 2, 3), random_direction(rng)
    pipe = LineAxis(origin, direction, 1.0)
    reducer = LineAxis(pipe.at(1.0 + short), direction, 0.15)
    if rng.uniform() < 0.5:
        reducer = reducer.reversed()
    trimmed = trim_to_reducer(pipe.reversed() if at_start else pipe, reducer)
    near, far = (trimmed.start, trimmed.end) if at_start else (trimmed.end, trimmed.start)
    assert_allclose(near, pipe.at(1.0 + short), atol=1e-12)
    assert_allclose(far, pipe.start, atol=1e-12)


def test_that_a_straight_that_is_hidden_up_to_its_reducer_stays_as_it_was_seen(rng):
    pipe = LineAxis(rng.uniform(-2, 2, 3), random_direction(rng), 1.0)
    reducer = LineAxis(pipe.at(1.4), pipe.direction, 0.15)
    assert trim_to_reducer(pipe, reducer) is pipe
