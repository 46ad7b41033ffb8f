import numpy as np
import pytest

from pipecore.inspection.points import ElementPoints, element_points, profile_points
from pipecore.measurement.sections import cut_normal_stack
from tests.factories import make_scan

CLOUD, RESULT = make_scan()
PIPE, BEND = 2, 4


@pytest.mark.parametrize("element_id", [PIPE, BEND])
def test_that_the_points_of_an_element_lie_on_its_surface(element_id):
    element, points = RESULT.element(element_id), element_points(CLOUD, RESULT, element_id)
    assert (RESULT.element_id[points.index] == element_id).all()
    assert len(points) == (RESULT.element_id == element_id).sum()
    off = points.distance - element.radius_at(points.chainage)
    assert np.median(np.abs(off)) < 0.005
    some = element_points(CLOUD, RESULT, element_id, points.index[:7])
    assert some.clock == pytest.approx(points.clock[:7])


@pytest.mark.parametrize("width", [0.02, 0.0337])
def test_that_each_profile_has_the_points_it_was_fitted_to(width):
    """Every profile across the axis has as many points as its table says, and no point is in
    two: also next to a gap, where profiles are missing.
    """
    element, points = RESULT.element(PIPE), element_points(CLOUD, RESULT, PIPE)
    seen = (points.chainage < 0.5) | (points.chainage > 0.62)
    points = ElementPoints(
        *(getattr(points, f)[seen] for f in ("index", "chainage", "distance", "clock", "deviation"))
    )
    places = points.chainage, points.distance, points.clock
    profiles = cut_normal_stack(element, places, width, 0.02)
    assert len(profiles) > 5
    found = [
        profile_points(CLOUD, RESULT, profiles[i : i + 1], points) for i in range(len(profiles))
    ]
    assert [len(index) for index in found] == profiles.n_points.tolist()
    every = np.concatenate(found)
    assert len(np.unique(every)) == len(every)


def test_that_points_of_a_stacks_profile_lie_in_its_slab_and_near_its_place():
    points = element_points(CLOUD, RESULT, BEND)
    n_found = 0
    for stack in RESULT.stacks:
        profiles = RESULT.profiles.of_element(BEND, stack.stack_id)
        for i in range(len(profiles)):
            profile = profiles[i : i + 1]
            index = profile_points(CLOUD, RESULT, profile, points)
            slab = stack.profile_index(CLOUD.xyz[index])
            assert (slab == profile.profile_index[0]).all()
            away = np.linalg.norm(CLOUD.xyz[index] - profile.centre[0], axis=1)
            assert (away < 6 * profile.semi_major[0]).all()
            n_found += len(index)
    assert n_found > 50


def test_that_an_element_that_is_not_there_is_an_error():
    with pytest.raises(KeyError):
        element_points(CLOUD, RESULT, 999)
