"""Which ellipses make a straight pipe, a bend, a reducer or a sphere."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from pipecore.elements.proposals import (
    MIN_ELLIPSES,
    Proposal,
    arc_angles,
    arc_direction,
    arc_extent,
    find_spheres,
    propose_surfaces,
)
from pipecore.elements.refinement.surface_fits import ArcSurface, LineSurface, SphereSurface
from pipecore.ellipses import Ellipses
from pipecore.geometry import ArcAxis, LineAxis
from pipecore.progress import NoProgress
from tests.core.sections import WIDTH, along
from tests.core.shapes import angle_between, random_direction, random_rotation, unit_rows

RADIUS = 0.08


def proposals_of(*parts: Ellipses) -> list[Proposal]:
    """Proposals for ellipses that are all of one chain."""
    ellipses = Ellipses.concatenate(parts)
    return propose_surfaces(ellipses, np.zeros(len(ellipses), np.int32), NoProgress())


def straight(rng, length=1.0):
    return LineAxis(rng.uniform(-3, 3, 3), random_direction(rng), length)


def slices(centre, radius, direction, offsets) -> Ellipses:
    """Ellipses of a sphere cut across a direction at offsets from its centre."""
    n = len(offsets)
    e = along(LineAxis(centre, direction, n), np.sqrt(radius**2 - offsets**2), step=1.0)
    return replace(
        e,
        centre=centre + offsets[:, None] * direction,
        meeting_point=np.tile(centre, (n, 1)),
        meeting_distance=np.full(n, radius),
    )


def turned(e: Ellipses, rotation, shift) -> Ellipses:
    """Ellipses after a rotation about the origin and a shift."""
    return replace(
        e,
        centre=e.centre @ rotation.T + shift,
        meeting_point=e.meeting_point @ rotation.T + shift,
        **{name: getattr(e, name) @ rotation.T for name in ("normal", "axis", "major_direction")},
    )


def test_that_a_straight_pipe_is_one_line_of_all_its_ellipses(rng):
    axis = straight(rng)
    e = along(axis, RADIUS, rng=rng)
    (line,) = proposals_of(e)
    assert isinstance(line.model, LineSurface)
    assert not line.model.is_tapered
    assert_array_equal(line.ellipses, np.arange(len(e)))
    assert line.model.radius == pytest.approx(RADIUS, abs=0.0002)
    # 50 centres of 0.2 mm over a metre: a standard deviation of 0.1 mm/m across two axes.
    assert angle_between(line.model.direction, axis.direction) < 0.0007
    # From the first face of its profiles to the last one.
    assert line.length == pytest.approx(axis.length, abs=0.001)


def test_that_too_few_ellipses_or_scattered_ones_make_nothing(rng):
    e = along(straight(rng), RADIUS, rng=rng)
    assert proposals_of(e[: MIN_ELLIPSES - 1]) == []
    assert len(proposals_of(e[:MIN_ELLIPSES])) == 1
    n = len(e)
    scattered = replace(
        e, centre=rng.uniform(-2, 2, (n, 3)), axis=unit_rows(rng.normal(size=(n, 3)))
    )
    assert proposals_of(scattered) == []


def test_that_ellipses_of_two_chains_are_never_one_piece(rng):
    e = along(straight(rng), RADIUS, rng=rng)
    chain = np.repeat([1, 0], [20, len(e) - 20]).astype(np.int32)
    found = propose_surfaces(e, chain, NoProgress())
    assert sorted(p.ellipses.tolist() for p in found) == [
        list(range(20)),
        list(range(20, len(e))),
    ]


def test_that_each_radius_on_one_axis_is_a_line_of_its_own(rng):
    wide = straight(rng)
    narrow = LineAxis(wide.end, wide.direction, 0.6)
    one, other = along(wide, 0.1, rng=rng), along(narrow, 0.08, rng=rng)
    first, second = proposals_of(one, other)
    assert_array_equal(first.ellipses, np.arange(len(one)))
    assert_array_equal(second.ellipses, len(one) + np.arange(len(other)))
    assert [p.model.radius for p in (first, second)] == pytest.approx([0.1, 0.08], abs=0.0002)


@pytest.mark.parametrize("bend_angle", [np.pi / 2, np.pi])
def test_that_a_bend_between_its_straights_is_an_arc_between_lines(rng, bend_angle):
    """Bounds are ten standard deviations and more, from 100 draws."""
    q = random_rotation(rng)
    bend = ArcAxis(rng.uniform(-3, 3, 3), q[2], q[0], 0.3, bend_angle)
    into = LineAxis(bend.start - 0.6 * bend.tangent(0.0), bend.tangent(0.0), 0.6)
    out = LineAxis(bend.end, bend.tangent(bend.length), 0.6)
    first, second, arc = proposals_of(*(along(a, RADIUS, rng=rng) for a in (into, bend, out)))
    for line, axis in ((first, into), (second, out)):
        assert isinstance(line.model, LineSurface)
        assert np.degrees(angle_between(line.model.direction, axis.direction)) < 0.3
    assert isinstance(arc.model, ArcSurface)
    assert_allclose(arc.model.centre, bend.centre, atol=0.003)
    assert arc.model.bend_radius == pytest.approx(0.3, abs=0.003)
    assert arc.model.radius == pytest.approx(RADIUS, abs=0.0004)
    assert np.degrees(angle_between(arc.model.normal, bend.normal)) < 0.01
    # The lines take what of its ends turns by less than 12° and a little beyond.
    assert np.degrees(bend_angle - arc.length) == pytest.approx(30.0, abs=3.0)


def test_that_a_reducer_between_its_straights_is_a_tapered_line(rng):
    wide = straight(rng)
    cone = LineAxis(wide.end, wide.direction, 0.3)
    narrow = LineAxis(cone.end, wide.direction, 0.6)
    s = np.arange(0.0, cone.length, WIDTH)
    taper = along(cone, 0.1 - 0.04 * s / cone.length, rng=rng)
    found = proposals_of(along(wide, 0.1, rng=rng), taper, along(narrow, 0.06, rng=rng))
    lines = [p for p in found if not p.model.is_tapered]
    (reducer,) = (p for p in found if p.model.is_tapered)
    assert sorted(p.model.radius for p in lines) == pytest.approx([0.06, 0.1], abs=0.0005)
    for place, radius in ((cone.at(0.05), 0.1 - 0.04 / 6), (cone.at(0.25), 0.06 + 0.04 / 6)):
        assert reducer.model.radius_at(place) == pytest.approx(radius, abs=0.001)
    assert reducer.length == pytest.approx(cone.length, abs=0.05)


def test_that_slices_of_a_sphere_make_it_and_their_axis_is_no_matter(rng):
    centre, radius = rng.uniform(-3, 3, 3), 0.4
    offsets = np.linspace(-0.3, 0.3, 31)
    parts = [slices(centre, radius, d, offsets) for d in random_rotation(rng)]
    (sphere,) = find_spheres(Ellipses.concatenate(parts))
    assert isinstance(sphere.model, SphereSurface)
    assert_array_equal(sphere.ellipses, np.arange(93))
    assert_allclose(sphere.model.centre, centre, atol=1e-12)
    assert sphere.model.radius == pytest.approx(radius)
    assert sphere.length == 0.0


def test_that_a_pipe_and_a_thin_slice_of_a_ball_are_no_spheres(rng):
    assert find_spheres(along(straight(rng), RADIUS, rng=rng)) == []
    # As a bead of weld or a fold: all cuts near one place.
    bead = slices(np.zeros(3), 0.4, random_direction(rng), np.linspace(0.1, 0.2, 20))
    assert find_spheres(bead) == []


def test_that_two_spheres_in_one_place_are_told_by_their_radii(rng):
    direction, offsets = random_direction(rng), np.linspace(-0.7, 0.7, 29)
    parts = [slices(np.zeros(3), r, direction, r * offsets) for r in (0.3, 0.4)]
    found = find_spheres(Ellipses.concatenate(parts))
    assert sorted(p.model.radius for p in found) == pytest.approx([0.3, 0.4])
    assert_array_equal(np.sort(np.concatenate([p.ellipses for p in found])), np.arange(58))


@pytest.mark.parametrize(
    ("n", "shift", "n_found"), [(7, 0, 0), (8, 0, 1), (8, 0.055, 1), (8, 0.065, 0)]
)
def test_that_a_sphere_has_eight_slices_whose_normals_meet(rng, n, shift, n_found):
    direction, radius = random_direction(rng), 0.4
    e = slices(np.zeros(3), radius, direction, np.resize([-0.3, 0.3], n) + 0.01 * np.arange(n))
    meeting = e.meeting_point.copy()
    # Half of them beside the others, as a share of the radius.
    meeting[::2] += shift * radius * random_direction(rng)
    assert len(find_spheres(replace(e, meeting_point=meeting))) == n_found


@pytest.mark.parametrize(("off", "belongs"), [(0.0, True), (0.055, True), (0.065, False)])
def test_that_a_centre_off_the_axis_by_six_percent_is_of_another_piece(rng, off, belongs):
    axis = straight(rng)
    up, _ = axis.frame(0.0)
    e = along(axis, RADIUS, sd=1e-7)
    e.centre[25] += off * RADIUS * up
    (line,) = proposals_of(e)
    assert (25 in line.ellipses) == belongs
    assert len(line.ellipses) == 49 + belongs


@pytest.mark.parametrize(("change", "belongs"), [(0.02, True), (0.03, False)])
def test_that_a_radius_off_by_two_and_a_half_percent_is_of_another_piece(rng, change, belongs):
    e = along(straight(rng), RADIUS, sd=1e-7)
    e.radius[25] *= 1 + change
    (line,) = proposals_of(e)
    assert (25 in line.ellipses) == belongs
    assert len(line.ellipses) == 49 + belongs


@pytest.mark.parametrize(("length", "n_found"), [(0.45, 0), (0.55, 1)])
def test_that_a_straight_is_half_a_radius_long_at_least(rng, length, n_found):
    # From the first centre to the last one.
    e = along(straight(rng, 4.9 * WIDTH), 4 * WIDTH / length, rng=rng)
    assert len(e) == MIN_ELLIPSES
    assert len(proposals_of(e)) == n_found


@pytest.mark.parametrize(("slope", "is_tapered"), [(0.045, True), (0.035, False)])
def test_that_a_reducer_tapers_by_four_percent_at_least(rng, slope, is_tapered):
    axis = straight(rng, 0.5)
    s = np.arange(0.0, axis.length, WIDTH)
    found = proposals_of(along(axis, 0.1 - slope * s, sd=1e-7))
    assert any(p.model.is_tapered for p in found) == is_tapered


def test_that_proposals_turn_with_the_ellipses(rng):
    q = random_rotation(rng)
    bend = ArcAxis(np.zeros(3), q[2], q[0], 0.3, np.pi / 2)
    out = LineAxis(bend.end, bend.tangent(bend.length), 0.6)
    parts = [along(a, RADIUS, rng=rng) for a in (bend, out)]
    rotation, shift = random_rotation(rng), rng.uniform(-5, 5, 3)
    before = proposals_of(*parts)
    after = proposals_of(*(turned(e, rotation, shift) for e in parts))
    assert len(before) == len(after) == 2
    for one, other in zip(before, after, strict=True):
        assert type(one.model) is type(other.model)
        assert_array_equal(one.ellipses, other.ellipses)
        assert_allclose(other.model.position, rotation @ one.model.position + shift, atol=1e-8)
        assert other.model.radius == pytest.approx(one.model.radius)
        assert other.length == pytest.approx(one.length)


def test_that_the_extent_of_an_arc_is_its_longest_part_without_a_gap(rng):
    model = ArcSurface(rng.uniform(-1, 1, 3), random_direction(rng), 0.5, 0.05)
    # Over the place where angles start again; the gap is of 17°, two radii are 11°.
    first = rng.uniform(0, 2 * np.pi)
    angles = first + np.radians(np.concatenate([np.arange(0, 20, 2), np.arange(35, 90, 2)]))
    points = np.array([model.centre + 0.5 * arc_direction(model, a) for a in angles])
    assert_allclose(arc_angles(model, points), np.mod(angles, 2 * np.pi), atol=1e-9)
    order = rng.permutation(len(points))
    low, high, part = arc_extent(model, points[order])
    assert_array_equal(order[part], np.arange(10, len(points)))
    assert np.degrees(high - low) == pytest.approx(54.0)
    assert_allclose(
        arc_direction(model, low), arc_direction(model, first + np.radians(35)), atol=1e-9
    )
