"""Fittings known by the straights they belong to: flanges, tees, bends, and what follows an end."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from pipecore.elements.fittings.bends import Corner, fit_bend, pipe_residuals
from pipecore.elements.fittings.flanges import find_flanges, longest_run, pair_flanges
from pipecore.elements.fittings.open_ends import extend_open_end
from pipecore.elements.fittings.straight_ends import StraightEnd
from pipecore.elements.fittings.tees import cut_tees, find_junctions, tee_ends
from pipecore.elements.refinement.extent import Extent
from pipecore.elements.refinement.fitted_element import FittedElement
from pipecore.elements.refinement.nearby_points import NearbyPoints
from pipecore.elements.refinement.surface_fits import LineSurface, SurfaceFit
from pipecore.elements.runs.ends import AxisSpan
from pipecore.geometry import ArcAxis, LineAxis, unit
from tests.core.shapes import cloud_of, jittered, plane, random_rotation, sampled, tube

NOISE, SPACING = 0.0015, 0.009
HALF_SEEN = float(np.deg2rad(150))


def straight(axis, radius, n_own=0):
    """A straight that is known well, as the refinement leaves it."""
    model = LineSurface(axis.at(axis.length / 2), axis.direction, radius)
    fit = SurfaceFit(model, np.eye(5) * 1e-8, NOISE, 1000)
    return FittedElement(fit, axis, np.arange(n_own), Extent(0, axis.length, np.pi, 1.0, ()), 0.0)


def scanned(*parts):
    """Points around axes, all of them free, as the refinement looks them up."""
    nearby = NearbyPoints(cloud_of(*parts), sampled(*parts))
    return nearby, np.ones(len(nearby.surface.xyz), np.bool_)


def part_of_pipe(rng, axis, radius, arc=HALF_SEEN, middle_clock=0.0):
    return tube(rng, axis, radius, spacing=SPACING, noise=NOISE, arc=arc, middle_clock=middle_clock)


def face(rng, axis, radius_in, radius_out, arc=HALF_SEEN):
    """The flat face of a flange at the start of an axis."""
    rho, around = jittered(rng, radius_out - radius_in, arc * radius_out, SPACING)
    clock = around / radius_out - arc / 2
    up, right = axis.frame(np.zeros(len(clock)))
    out = np.cos(clock)[:, None] * up + np.sin(clock)[:, None] * right
    xyz = axis.start + (radius_in + rho)[:, None] * out
    return xyz + NOISE * rng.normal(size=(len(xyz), 1)) * axis.direction, np.tile(
        axis.direction, (len(xyz), 1)
    )


@pytest.fixture
def frame(rng):
    """Some place and attitude."""
    return rng.uniform(-3, 3, 3), random_rotation(rng)


def rings_of(pipe, *parts):
    nearby, is_free = scanned(*parts)
    found = []
    for ring in find_flanges([pipe], nearby, is_free):
        is_free[ring.inliers] = False
        found.append(ring)
    return found


@pytest.mark.parametrize(("radius", "flange"), [(0.024, 0.075), (0.084, 0.1425), (0.203, 0.29)])
@pytest.mark.parametrize("place", [0.5, 1.02])
def test_that_a_flange_on_a_pipe_or_at_its_end_is_found_by_its_rim(
    rng, frame, radius, flange, place
):
    origin, (along, *_) = frame
    length = max(1.0, 6 * radius)
    pipe = LineAxis(origin, along, length)
    disc = LineAxis(pipe.at(place * length), along, 0.045)
    (ring,) = rings_of(
        straight(pipe, radius),
        part_of_pipe(rng, pipe, radius),
        part_of_pipe(rng, disc, flange),
        face(rng, disc, radius, flange),
    )
    assert ring.fit.model.radius == pytest.approx(flange, abs=max(6 * ring.fit.radius_sd, 0.0008))
    chainage, rho, _ = disc.pipe_coordinates(np.stack([ring.axis.start, ring.axis.end]))
    assert_allclose(sorted(chainage), [0.0, 0.045], atol=0.008)
    assert_allclose(rho, 0.0, atol=0.001)
    assert pair_flanges([straight(pipe, radius), ring]) == [(1, 0)]


def test_that_a_wider_pipe_and_a_wall_beside_a_pipe_are_no_flanges(rng, frame):
    origin, (along, across, up) = frame
    pipe, radius = LineAxis(origin, along, 1.0), 0.06
    own = part_of_pipe(rng, pipe, radius)
    sleeve = part_of_pipe(rng, LineAxis(pipe.at(0.3), along, 0.4), 0.1)
    wall = plane(rng, origin + 0.09 * across - 0.3 * up, along, 0.6 * up, SPACING, NOISE)
    for other in ([sleeve], [wall]):
        assert rings_of(straight(pipe, radius), own, *other) == []


def test_that_the_longest_run_of_sectors_goes_round_and_closes_single_gaps():
    seen = np.zeros((3, 12), np.bool_)
    seen[0, [10, 11, 0, 1]] = True
    seen[1, [2, 3, 5, 6]] = True
    seen[2, [2, 3, 6, 7]] = True
    assert longest_run(seen).tolist() == [4, 5, 2]
    assert longest_run(np.ones((1, 12), np.bool_)).tolist() == [12]


def spans_of(*pipes):
    return [AxisSpan(axis, (radius, radius)) for axis, radius in pipes]


@pytest.mark.parametrize("lean_deg", [90.0, 45.0])
def test_that_a_branch_in_the_side_of_a_run_makes_a_junction_where_the_axes_meet(
    rng, frame, lean_deg
):
    origin, (along, across, _) = frame
    run = LineAxis(origin, along, 3.0)
    at = rng.uniform(0.8, 2.2)
    out = np.cos(np.deg2rad(lean_deg)) * along + np.sin(np.deg2rad(lean_deg)) * across
    begin = 0.1 / np.sin(np.deg2rad(lean_deg))
    branch = LineAxis(run.at(at) + begin * out, out, 0.6)
    for axis in (branch, branch.reversed()):
        (found,) = find_junctions(spans_of((run, 0.1), (axis, 0.06)), set())
        assert (found.branch, found.run, found.is_wide) == (1, 0, True)
        assert found.chainage == pytest.approx(at, abs=1e-6)
    (nozzle,) = find_junctions(spans_of((run, 0.1), (branch, 0.03)), set())
    assert not nozzle.is_wide


def test_that_pipes_that_pass_cross_or_end_elsewhere_make_no_junction(rng, frame):
    origin, (along, across, up) = frame
    run = LineAxis(origin, along, 3.0)
    middle = run.at(rng.uniform(1, 2))
    crossing = LineAxis(middle + 0.16 * up - 1.0 * across, across, 2.0)
    beside = LineAxis(middle + 0.1 * up + 0.06 * across, up, 0.5)
    far = LineAxis(middle + 0.5 * up, up, 0.5)
    away = LineAxis(middle - 0.05 * up, -along, 0.5)
    for other in (crossing, beside, far, away):
        assert find_junctions(spans_of((run, 0.1), (other, 0.06)), set()) == []


def test_that_a_branch_with_a_hidden_foot_is_believed_if_nothing_else_follows_it(frame):
    origin, (along, _, up) = frame
    run = LineAxis(origin, along, 3.0)
    branch = LineAxis(run.at(1.5) + 0.28 * up, up, 0.5)
    spans = spans_of((run, 0.1), (branch, 0.06))
    assert len(find_junctions(spans, set())) == 1
    assert find_junctions(spans, {(1, 0)}) == []


def test_that_tees_have_the_length_of_standard_ones():
    # ASME B16.9: centre to end of straight tees DN 50, 100, 200, 400, millimetres.
    for od, centre_to_end in ((60.3, 64), (114.3, 105), (219.1, 178), (406.4, 305)):
        ((low, high),) = tee_ends([2.0], 4.0, od / 2000)
        assert_allclose([2.0 - low, high - 2.0], centre_to_end / 1000, atol=0.005)


def test_that_tees_share_what_is_between_them_and_take_in_short_ends():
    radius = 0.1
    (a, b), (c, d) = tee_ends([1.0, 1.25], 3.0, radius)
    assert (b, c) == (1.125, 1.125)
    assert (a, d) == pytest.approx((1.0 - 0.165, 1.25 + 0.165))
    ((low, high),) = tee_ends([0.2], 3.0, radius)
    assert (low, high) == pytest.approx((0.0, 0.365))
    assert len(tee_ends([1.0, 1.01], 3.0, radius)) == 1


def test_that_the_parts_of_a_cut_run_are_the_run(rng, frame):
    origin, (along, across, _) = frame
    run = LineAxis(origin, along, 3.0)
    xyz = run.at(rng.uniform(-0.01, 3.01, 500)) + 0.1 * across
    branch = LineAxis(run.at(1.3) + 0.1 * across, across, 0.5)
    tees = find_junctions(spans_of((run, 0.1), (branch, 0.06)), set())
    pipes = [straight(run, 0.1, 500), straight(branch, 0.06)]
    parts = cut_tees(pipes, [run, branch], tees, xyz)
    assert [p.is_tee for p in parts] == [False, True, False, False]
    assert [p.whole for p in parts] == [0, 0, 0, 1]
    first, tee, last, _ = parts
    assert_allclose(first.axis.start, run.start)
    assert_allclose(first.axis.end, tee.axis.start, atol=1e-12)
    assert_allclose(tee.axis.end, last.axis.start, atol=1e-12)
    assert_allclose(last.axis.end, run.end, atol=1e-12)
    own = np.concatenate([p.found.inliers for p in parts[:3]])
    assert sorted(own) == list(range(500))
    for part in (tee, first, last):
        chainage, _, _ = part.axis.pipe_coordinates(xyz[part.found.inliers])
        assert chainage.min() > -0.011
        assert chainage.max() < part.axis.length + 0.011


def corner_in(frame, turn, radius):
    place, (along, across, _) = frame
    onward = np.cos(turn) * along + np.sin(turn) * across
    return Corner(place, (along, -onward), turn, radius)


def pipe_around(rng, corner, bend_radius, arc, length=0.5):
    """Points of a bend and of its straights, each seen over an arc around 12:00."""
    axis = corner.axis(bend_radius)
    before = LineAxis(axis.start - length * corner.towards[0], corner.towards[0], length)
    after = LineAxis(axis.end, -corner.towards[1], length)
    return [part_of_pipe(rng, a, corner.radius, arc) for a in (before, axis, after)]


@pytest.mark.parametrize("turn_deg", [30.0, 45.0, 90.0])
@pytest.mark.parametrize("arc_deg", [130.0, 360.0])
def test_that_a_bend_between_straights_has_its_bend_radius_within_its_uncertainty(
    rng, turn_deg, arc_deg
):
    level = np.array([unit([1.0, rng.normal(), 0.0]), [0, 0, 0], [0, 0, 1.0]])
    level[1] = np.cross(level[2], level[0])
    radius = rng.uniform(0.04, 0.1)
    bend_radius = rng.uniform(2.5, 5.0) * radius
    corner = corner_in((np.array([1.0, 2.0, 3.0]), level), np.deg2rad(turn_deg), radius)
    nearby, free = scanned(*pipe_around(rng, corner, bend_radius, np.deg2rad(arc_deg)))
    found = fit_bend(corner, 1.15 * bend_radius, nearby, free)
    sd = np.sqrt(found.fit.covariance[5, 5])
    assert abs(found.fit.model.bend_radius - bend_radius) < 5.5 * sd + 0.002 * bend_radius
    assert found.axis.bend_angle == pytest.approx(np.deg2rad(turn_deg), rel=0.1)
    assert abs(found.fit.model.radius - radius) < 5.0 * found.fit.radius_sd + 0.001
    # A bend by 30° has a few dozen points at the least.
    assert sd < 0.3 * bend_radius


def test_that_no_bend_is_fitted_where_only_straights_cross(rng, frame):
    corner = corner_in(frame, np.deg2rad(60), 0.05)
    place, _ = frame
    parts = [
        part_of_pipe(rng, LineAxis(place - 0.8 * t, t, 0.45), 0.05, 6.0) for t in corner.towards
    ]
    nearby, free = scanned(*parts)
    assert fit_bend(corner, 0.2, nearby, free) is None


def test_that_distances_from_a_pipe_with_a_bend_vanish_on_it_and_grow_off_it(rng, frame):
    corner = corner_in(frame, rng.uniform(0.4, 1.8), 0.06)
    bend_radius = rng.uniform(0.1, 0.3)
    axis: ArcAxis = corner.axis(bend_radius)
    pieces = [
        LineAxis(axis.start - 0.4 * corner.towards[0], corner.towards[0], 0.399),
        axis,
        LineAxis(axis.end - 0.001 * corner.towards[1], -corner.towards[1], 0.4),
    ]
    for piece, is_bend in zip(pieces, (False, True, False), strict=True):
        xyz, normals = tube(rng, piece, 0.06, spacing=0.02)
        for off in (0.0, 0.004):
            residual, slope, outward, in_bend = pipe_residuals(
                corner, bend_radius, 0.06, xyz + off * normals
            )
            inner = slice(None) if not is_bend else in_bend
            assert_allclose(residual[inner], off, atol=1e-9)
            assert_allclose(outward[inner], normals[inner], atol=1e-9)
        assert in_bend.mean() > 0.99 if is_bend else not in_bend.any()
        step = 1e-6
        further, *_ = pipe_residuals(corner, bend_radius + step, 0.06, xyz + off * normals)
        same = np.abs(further - residual) < 1e-4
        assert_allclose(((further - residual) / step)[same], slope[same], atol=1e-3)


def follows_as_built(rng, turn_deg):
    """Whether bend and straight beyond an open end are followed as they were built."""
    radius, bend_radius = 0.05, 0.19
    frame = rng.uniform(-5, 5, 3), random_rotation(rng)
    corner = corner_in(frame, np.deg2rad(turn_deg), radius)
    parts = pipe_around(rng, corner, bend_radius, np.deg2rad(200))
    nearby, free = scanned(*parts)
    axis = corner.axis(bend_radius)
    # The straight itself has been found already.
    ahead = (nearby.surface.xyz - axis.start) @ corner.towards[0]
    end = StraightEnd((0, 1), axis.start, corner.towards[0], radius)
    bend, beyond = extend_open_end(end, nearby, free & (ahead > 0))
    assert bend.model.radius == pytest.approx(radius)
    near = np.cos(np.deg2rad(12))
    return (
        abs(bend.model.normal @ corner.normal) > near
        and bend.model.bend_radius == pytest.approx(bend_radius, rel=0.4)
        and -(beyond.model.direction @ corner.towards[1]) > near
    )


@pytest.mark.parametrize("turn_deg", [30.0, 60.0, 90.0])
def test_that_what_follows_an_open_end_is_a_bend_and_the_straight_beyond(rng, turn_deg):
    # At 90° one of twelve is followed wrongly; nine of sixteen come once in a million seeds.
    assert sum(follows_as_built(rng, turn_deg) for _ in range(16)) >= 8


def test_that_nothing_follows_an_end_at_a_wall_or_in_the_air(rng, frame):
    origin, (along, across, up) = frame
    pipe = LineAxis(origin, along, 1.0)
    own = part_of_pipe(rng, pipe, 0.05)
    wall = plane(rng, pipe.end - 0.5 * (across + up), across, up, SPACING, NOISE)
    end = StraightEnd((0, 1), pipe.end, along, 0.05)
    for parts in ([own], [own, wall]):
        nearby, free = scanned(*parts)
        is_ahead = (nearby.surface.xyz - pipe.end) @ along > -0.005
        assert extend_open_end(end, nearby, free & is_ahead) is None
