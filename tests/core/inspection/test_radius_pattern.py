import numpy as np
import pytest

from pipecore.inspection.radius_pattern import profile_index_at, radius_pattern
from pipecore.types import Profiles
from tests.factories import make_result

RESULT = make_result()
DENTED, CONE, SPHERE = 2, 5, 8


@pytest.mark.parametrize("element_id", [DENTED, CONE, SPHERE])
def test_that_the_fitted_pattern_is_the_elements_radius(element_id):
    element = RESULT.element(element_id)
    profiles = RESULT.profiles.of_element(element_id, 0)
    pattern = radius_pattern(element, profiles)
    assert pattern.fitted == pytest.approx(element.radius_at(profiles.chainage))
    shape = np.diff(pattern.fitted)
    assert np.ptp(pattern.moved - pattern.fitted) == pytest.approx(0, abs=1e-12)
    if element_id == DENTED:
        assert shape == pytest.approx(0, abs=1e-12)
    elif element_id == CONE:
        assert shape == pytest.approx(shape[0])
        assert shape[0] < 0
    else:  # up and down again, as a semicircle
        assert shape[0] > 0 > shape[-1]


def test_that_a_dent_widens_the_band_of_its_pipe_hardly_at_all():
    element = RESULT.element(DENTED)
    profiles = RESULT.profiles.of_element(DENTED, 0)
    pattern = radius_pattern(element, profiles)
    sound = np.abs(profiles.chainage - 0.8) > 0.15
    assert pattern.scatter == pytest.approx(np.std(profiles.semi_minor[sound]), rel=0.4)
    assert pattern.values.min() < pattern.moved.min() - 10 * pattern.scatter


def test_that_a_scaled_pattern_is_the_same_in_another_unit():
    profiles = RESULT.profiles.of_element(DENTED, 0)
    pattern = radius_pattern(RESULT.element(DENTED), profiles)
    in_mm = pattern.scaled(1000)
    assert in_mm.middle == pytest.approx(1000 * pattern.middle)
    assert in_mm.scatter == pytest.approx(1000 * pattern.scatter)
    assert in_mm.values == pytest.approx(1000 * pattern.values)


def test_that_an_element_without_profiles_has_no_scatter():
    assert np.isnan(radius_pattern(RESULT.element(DENTED), Profiles.empty()).scatter)


def test_that_an_index_lies_between_its_neighbours():
    profiles = RESULT.profiles.of_element(DENTED, 0)
    middle = profiles.chainage[[10, 11]].mean()
    assert profile_index_at(middle, profiles) == pytest.approx(10.5)
    assert profile_index_at(profiles.chainage, profiles) == pytest.approx(profiles.profile_index)
