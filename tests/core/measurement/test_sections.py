"""Profiles of elements: cut across their own axis, and the stacks' ellipses that are theirs."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from pipecore.ellipses import Ellipses
from pipecore.geometry import ArcAxis, LineAxis, surface_points
from pipecore.inspection.section import radius_is_measurable
from pipecore.measurement import cut_normal_stack, tabulate_ellipses
from pipecore.types import OWN_STACK, Element, ElementKind
from tests.core.sections import along
from tests.core.shapes import FULL, jittered, random_direction, random_rotation

RADIUS, WIDTH, SPACING, NOISE = 0.1, 0.02, 0.005, 0.001


def element_on(axis, radius=RADIUS, kind=ElementKind.CYLINDER, radius_end=None, element_id=1):
    """An element that is known exactly."""
    return Element(
        element_id=element_id,
        run_id=1,
        kind=kind,
        axis=axis,
        radius=radius,
        radius_sd=1e-5,
        radius_end=radius if radius_end is None else radius_end,
        centre=np.full(3, np.nan),
        n_points=1000,
        n_profiles=0,
        arc=FULL,
        rms=NOISE,
    )


def straight(rng, length=1.0):
    return LineAxis(rng.uniform(-3, 3, 3), random_direction(rng), length)


def seen(rng, element, arc=FULL, middle=0.0, shape=lambda s, clock: 0.0, noise=NOISE):
    """Pipe coordinates of points of an element over an arc, with its radial deviations."""
    widest = max(element.radius, element.radius_end)
    chainage, around = jittered(rng, element.axis.length, arc * widest, SPACING)
    clock = around / widest - arc / 2 + middle
    rho = element.radius_at(chainage) + shape(chainage, clock)
    return chainage, rho + noise * rng.normal(size=len(rho)), clock


def cut(element, places):
    return cut_normal_stack(element, places, WIDTH, SPACING)


@pytest.fixture
def pipe(rng):
    return element_on(straight(rng))


def test_that_a_round_pipe_has_a_round_profile_on_its_axis_every_width(rng, pipe):
    profiles = cut(pipe, seen(rng, pipe, noise=0.0))
    assert_array_equal(profiles.profile_index, np.arange(50))
    assert_array_equal(profiles.stack_id, OWN_STACK)
    assert_allclose(profiles.chainage, (np.arange(50) + 0.5) * WIDTH)
    assert_allclose(profiles.centre, pipe.axis.at(profiles.chainage), atol=1e-6)
    assert_allclose(profiles.normal, np.tile(pipe.axis.direction, (50, 1)), atol=1e-12)
    for values in (profiles.radius, profiles.semi_minor, profiles.semi_major):
        assert_allclose(values, RADIUS, atol=1e-6)
    for values in (profiles.ovality, profiles.centre_deviation, profiles.radius_deviation):
        assert_allclose(values, 0.0, atol=1e-6)
    assert_allclose(profiles.arc, FULL)


def test_that_noise_scatters_the_radii_as_their_standard_deviations_say(rng, pipe):
    long = replace(pipe, axis=replace(pipe.axis, length=8.0))
    profiles = cut(long, seen(rng, long))
    n = len(profiles)
    assert n == 400
    off = profiles.radius_deviation / profiles.radius_sd
    # The mean of n standard normal values, and their spread, by five standard deviations.
    assert abs(off.mean()) < 5 / np.sqrt(n)
    assert off.std() == pytest.approx(1.0, abs=5 / np.sqrt(2 * n))
    assert_allclose(np.median(profiles.rms), NOISE, rtol=0.05)


def test_that_an_oval_section_has_its_diameters_and_the_direction_of_the_longer_one(rng, pipe):
    major, amplitude = rng.uniform(0, np.pi), 0.003

    def shape(s, clock):
        return amplitude * np.cos(2 * (clock - major))

    profiles = cut(pipe, seen(rng, pipe, shape=shape, noise=0.0))
    # Dmax − Dmin is four amplitudes, of a diameter of two radii.
    assert_allclose(profiles.ovality, 2 * amplitude / RADIUS, rtol=0.02)
    assert_allclose(profiles.semi_major, RADIUS + amplitude, atol=2e-4)
    assert_allclose(profiles.semi_minor, RADIUS - amplitude, atol=2e-4)
    tops = surface_points(pipe.axis, profiles.chainage, 1.0, major)
    expected = tops - pipe.axis.at(profiles.chainage)
    cosines = np.abs(np.einsum("ij,ij->i", expected, profiles.major_direction))
    assert np.degrees(np.arccos(cosines.min())) < 2.0


def test_that_a_dent_shows_in_its_profiles_only(rng, pipe):
    depth, middle = 0.015, 0.5

    def dent(s, clock):
        angle = np.mod(clock + np.pi, 2 * np.pi) - np.pi
        return -depth * np.exp(-0.5 * (((s - middle) / 0.06) ** 2 + (angle / 0.4) ** 2))

    profiles = cut(pipe, seen(rng, pipe, shape=dent))
    is_dented = np.abs(profiles.chainage - middle) < 0.05
    is_far = np.abs(profiles.chainage - middle) > 0.25
    assert (profiles.rms[is_dented] > 2 * NOISE).all()
    assert (profiles.minor_drop[is_dented] > 0.002).all()
    assert (np.abs(profiles.minor_drop[is_far]) < 0.001).all()
    assert (profiles.rms[is_far] < 1.5 * NOISE).all()
    # The circle gives way, away from the dent.
    up, _ = pipe.axis.frame(profiles.chainage)
    off = np.einsum("ij,ij->i", profiles.centre - pipe.axis.at(profiles.chainage), up)
    assert (off[is_dented] < -0.0005).all()


def test_that_a_cone_has_the_radius_that_it_has_in_the_middle_of_each_profile(rng):
    cone = element_on(straight(rng, 0.4), 0.1, ElementKind.CONE, 0.06)
    profiles = cut(cone, seen(rng, cone, noise=0.0))
    assert len(profiles) == 20
    assert_allclose(profiles.radius, 0.1 - 0.1 * profiles.chainage, atol=1e-6)
    assert_allclose(profiles.radius_deviation, 0.0, atol=1e-6)
    # The taper within a profile, 2 mm, is none of its scatter.
    assert (profiles.rms < 1e-6).all()


def test_that_profiles_of_a_bend_stand_across_its_axis(rng):
    q = random_rotation(rng)
    bend = element_on(
        ArcAxis(rng.uniform(-3, 3, 3), q[2], q[0], 0.4, np.pi / 2), kind=ElementKind.TORUS
    )
    profiles = cut(bend, seen(rng, bend, noise=0.0))
    assert len(profiles) == int(bend.axis.length / WIDTH) + 1
    assert_allclose(profiles.normal, bend.axis.tangent(profiles.chainage), atol=1e-12)
    assert_allclose(profiles.centre, bend.axis.at(profiles.chainage), atol=1e-6)
    assert_allclose(profiles.radius, RADIUS, atol=1e-6)


@pytest.mark.parametrize("arc_deg", [90, 180, 220])
def test_that_short_arcs_give_the_radius_about_the_axis_and_no_ovality(rng, pipe, arc_deg):
    def bowed(s, clock):
        return 0.004 * np.cos(clock)  # 4 mm towards 12:00

    profiles = cut(pipe, seen(rng, pipe, np.radians(arc_deg), shape=bowed, noise=0.0))
    assert_allclose(np.degrees(profiles.arc), arc_deg, atol=6.0)
    assert np.isnan(profiles.ovality).all()
    assert_array_equal(profiles.semi_minor, profiles.semi_major)
    half = np.radians(arc_deg) / 2
    assert_allclose(profiles.semi_minor, RADIUS + 0.004 * np.sin(half) / half, atol=2e-4)
    # The free circle follows the section to where it is.
    assert_allclose(profiles.radius, RADIUS, atol=2e-4)
    assert_allclose(profiles.centre_deviation, 0.004, atol=2e-4)
    assert radius_is_measurable(profiles).all()


def test_that_wide_arcs_have_an_ovality(rng, pipe):
    profiles = cut(pipe, seen(rng, pipe, np.radians(270)))
    assert np.isfinite(profiles.ovality).all()


def test_that_slivers_and_points_beyond_the_ends_make_none(rng, pipe):
    assert len(cut(pipe, seen(rng, pipe, np.radians(30), noise=0.0))) == 0
    assert len(cut(pipe, (np.empty(0), np.empty(0), np.empty(0)))) == 0
    chainage, rho, clock = seen(rng, pipe)
    beyond = chainage + 1.0, rho, clock
    assert len(cut(pipe, beyond)) == 0


@pytest.mark.parametrize(("n", "is_enough"), [(7, False), (8, True)])
def test_that_a_profile_has_eight_points_at_least(pipe, n, is_enough):
    """Both cover more than 40°: neighbours lie 0.19 rad apart, gaps count from 0.2 rad."""
    places = np.full(n, 0.01), np.full(n, RADIUS), 0.19 * np.arange(n)
    assert len(cut(pipe, places)) == is_enough


def test_that_the_order_of_the_points_and_the_attitude_are_no_matter(rng, pipe):
    places = seen(rng, pipe)
    order = rng.permutation(len(places[0]))
    turned = replace(pipe, axis=straight(rng))
    one = cut(pipe, places)
    for other in (cut(pipe, [values[order] for values in places]), cut(turned, places)):
        for name in ("radius", "semi_minor", "semi_major", "ovality", "rms", "arc", "n_points"):
            assert_allclose(getattr(other, name), getattr(one, name), rtol=1e-6, atol=1e-9)


def longer(axis):
    """The axis from a centimetre before its start to one beyond its end."""
    return LineAxis(axis.at(-0.01), axis.direction, axis.length + 0.02)


def owners(elements, ellipses: Ellipses):
    """Element of each ellipse, 0 for none."""
    table = tabulate_ellipses(tuple(elements), ellipses)
    owner = np.zeros(len(ellipses), int)
    owner[table.profile_index] = table.element_id
    return owner


def numbered(*parts: Ellipses) -> Ellipses:
    """One table; the profile index is the row."""
    e = Ellipses.concatenate(parts)
    return replace(e, profile_index=np.arange(len(e), dtype=np.int32))


def test_that_each_ellipse_is_of_the_element_that_it_cuts(rng):
    q = random_rotation(rng)
    axes = [LineAxis(0.3 * i * q[1], q[0], 1.0) for i in range(2)]
    elements = [element_on(longer(a), element_id=i + 5) for i, a in enumerate(axes)]
    parts = [along(a, RADIUS, rng=rng) for a in axes]
    ellipses = numbered(*parts)
    assert_array_equal(owners(elements, ellipses), np.repeat([5, 6], 50))
    table = tabulate_ellipses(tuple(elements), ellipses)
    assert_allclose(table.chainage, np.tile(0.01 + np.arange(50) * 0.02, 2), atol=0.002)
    assert_allclose(table.radius_deviation, table.radius - RADIUS)
    assert (table.centre_deviation < 0.001).all()
    assert np.isnan(table.ovality).all()


def test_that_ellipses_off_the_axis_oblique_or_of_another_radius_are_of_no_element(rng):
    q = random_rotation(rng)
    axis = LineAxis(np.zeros(3), q[0], 1.0)
    e = along(axis, RADIUS)[20:27]
    e = replace(e, radius_sd=np.full(7, 1e-6))
    shift = RADIUS * np.array([0.24, 0.26, 0, 0, 0, 0, 0])
    turn = np.radians([0, 0, 19, 21, 0, 0, 0])
    scale = np.array([1, 1, 1, 1, 1.24, 1.26, 0.74])
    e = replace(
        numbered(e),
        centre=e.centre + shift[:, None] * q[1],
        axis=np.cos(turn)[:, None] * q[0] + np.sin(turn)[:, None] * q[1],
        radius=RADIUS * scale,
    )
    assert_array_equal(owners([element_on(axis)], e), [1, 0, 1, 0, 1, 0, 0])
    beyond = replace(e, centre=e.centre + 1.0 * q[0])
    assert_array_equal(owners([element_on(axis)], beyond), np.zeros(7))


def test_that_an_ellipse_is_of_one_element_only_the_first(rng):
    axis = straight(rng)
    elements = [element_on(longer(axis), r, element_id=i) for i, r in ((1, 0.1), (2, 0.11))]
    ellipses = numbered(along(axis, 0.105))
    assert_array_equal(owners(elements, ellipses), np.ones(50))
    assert_array_equal(owners(elements[::-1], ellipses), np.full(50, 2))


def test_that_rows_of_a_stack_are_in_order_of_chainage_and_none_makes_an_empty_table(rng):
    axis = straight(rng)
    ellipses = numbered(along(axis, RADIUS))
    mixed = ellipses[rng.permutation(50)]
    mixed = replace(mixed, stack_id=rng.integers(1, 3, 50).astype(np.int32))
    table = tabulate_ellipses((element_on(longer(axis)),), mixed)
    assert len(table) == 50
    assert (np.diff(table.stack_id) >= 0).all()
    for stack_id in (1, 2):
        assert (np.diff(table.chainage[table.stack_id == stack_id]) > 0).all()
    assert len(tabulate_ellipses((), ellipses)) == 0
    assert len(tabulate_ellipses((element_on(axis),), ellipses[:0])) == 0
