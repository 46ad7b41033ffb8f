"""The numbers behind the plots, without a window."""

import numpy as np
import pytest

from pipegui.plots.exaggeration import deviations, ellipse_points, exaggerate
from pipegui.plots.pattern import index_at, pattern_of
from pipegui.plots.unrolled import from_clock, unroll
from pipegui.states.section import Ellipse
from tests.factories import make_scan

CLOUD, RESULT = make_scan()
DENTED, CONE, SPHERE, HALF_SEEN = 2, 5, 8, 9


@pytest.mark.parametrize("element_id", [DENTED, CONE, SPHERE])
def test_that_the_fitted_pattern_is_the_elements_radius(element_id):
    element = RESULT.element(element_id)
    profiles = RESULT.profiles.of_element(element_id, 0)
    pattern = pattern_of(element, profiles)
    assert pattern.fitted == pytest.approx(1000 * element.radius_at(profiles.chainage))
    shape = np.diff(pattern.fitted)
    assert np.ptp(pattern.moved - pattern.fitted) == pytest.approx(0, abs=1e-9)
    if element_id == DENTED:
        assert shape == pytest.approx(0, abs=1e-9)
    elif element_id == CONE:
        assert shape == pytest.approx(shape[0])
        assert shape[0] < 0
    else:  # up and down again, as a semicircle
        assert shape[0] > 0 > shape[-1]


def test_that_a_dent_widens_the_band_of_its_pipe_hardly_at_all():
    element = RESULT.element(DENTED)
    profiles = RESULT.profiles.of_element(DENTED, 0)
    pattern = pattern_of(element, profiles)
    clean = np.abs(profiles.chainage - 0.8) > 0.15
    spread = 1000 * np.std(profiles.semi_minor[clean])
    assert pattern.spread == pytest.approx(spread, rel=0.4)
    assert pattern.values.min() < pattern.moved.min() - 10 * pattern.spread


def test_that_an_index_lies_between_its_neighbours():
    profiles = RESULT.profiles.of_element(DENTED, 0)
    middle = profiles.chainage[[10, 11]].mean()
    assert index_at(middle, profiles) == pytest.approx(10.5)
    assert index_at(profiles.chainage, profiles) == pytest.approx(profiles.profile_index)


def test_that_the_map_has_twelve_o_clock_in_the_middle():
    assert from_clock(0.0) == 0
    assert from_clock(np.deg2rad(90)) == pytest.approx(np.pi / 2)
    assert from_clock(np.deg2rad(270)) == pytest.approx(-np.pi / 2)


def element_map(element_id, deviation=None):
    index = np.flatnonzero(RESULT.element_id == element_id)
    element = RESULT.element(element_id)
    chainage, _, clock = element.axis.pipe_coordinates(CLOUD.xyz[index])
    values = RESULT.deviation[index] if deviation is None else np.full(len(index), deviation)
    return unroll(element, chainage, clock, values.astype(float))


def test_that_the_map_keeps_every_point_and_their_mean():
    unrolled = element_map(DENTED, 0.0034)
    assert unrolled.n_points.sum() == (RESULT.element_id == DENTED).sum()
    filled = unrolled.n_points > 0
    assert unrolled.deviation_mm[filled] == pytest.approx(3.4)
    assert np.isnan(unrolled.deviation_mm[~filled]).all()


def test_that_the_deepest_part_of_the_map_is_the_dent():
    dent = RESULT.deformation(1)
    unrolled = element_map(DENTED)
    along, around = np.unravel_index(
        np.nanargmin(unrolled.deviation_mm), unrolled.deviation_mm.shape
    )
    n_along, n_around = unrolled.deviation_mm.shape
    chainage = unrolled.start + (along + 0.5) / n_along * unrolled.length
    clock = (around + 0.5) / n_around * 2 * np.pi - np.pi
    assert abs(chainage - dent.chainage) < 0.05
    assert abs(clock - dent.clock) < np.deg2rad(30)
    assert unrolled.cell(chainage, clock) == (along, around)
    assert unrolled.cell(chainage + 10, clock) is None


def test_that_what_no_station_saw_stays_empty():
    unrolled = element_map(HALF_SEEN)
    n_around = unrolled.n_points.shape[1]
    share_seen = (unrolled.n_points.sum(axis=0) > 0).sum() / n_around
    assert share_seen == pytest.approx(140 / 360, abs=2.5 / n_around)


def test_that_points_without_deviation_are_left_out():
    element = RESULT.element(DENTED)
    places = np.array([0.1, 0.2, 0.3]), np.array([0.0, 1.0, 2.0])
    unrolled = unroll(element, *places, np.array([0.001, np.nan, 0.002]))
    assert unrolled.n_points.sum() == 2


REFERENCE = Ellipse((3.0, -2.0), 80.0, 80.0, 0.0)
TILTED = Ellipse((3.0, -2.0), 110.0, 80.0, 0.7)


@pytest.mark.parametrize("reference", [REFERENCE, TILTED])
def test_that_points_on_the_reference_stay_however_exaggerated(reference):
    points = ellipse_points(reference)
    assert deviations(points, reference) == pytest.approx(0, abs=1e-9)
    assert exaggerate(points, reference, 20) == pytest.approx(points)


@pytest.mark.parametrize("reference", [REFERENCE, TILTED])
def test_that_exaggeration_multiplies_the_deviation_and_nothing_else(reference, rng):
    points = ellipse_points(reference) + rng.normal(0, 2, (181, 2))
    drawn = exaggerate(points, reference, 7)
    assert deviations(drawn, reference) == pytest.approx(7 * deviations(points, reference))
    assert exaggerate(points, reference, 1) == pytest.approx(points)


def test_that_deviation_from_a_circle_is_the_distance_beyond_its_radius():
    points = np.array([[3.0 + 82.5, -2.0], [3.0, -2.0 - 79.0]])
    assert deviations(points, REFERENCE) == pytest.approx([2.5, -1.0])


def test_that_an_ellipse_has_its_axes():
    reach = np.linalg.norm(ellipse_points(TILTED, 361) - TILTED.centre_uv, axis=1)
    assert reach.max() == pytest.approx(110, rel=1e-4)
    assert reach.min() == pytest.approx(80, rel=1e-4)
