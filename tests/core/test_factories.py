"""The made installation that other tests stand on agrees with itself."""

import numpy as np
import pytest

from pipecore.rules import judge, load_rules
from pipecore.types import NO_ID, OWN_STACK, ElementKind
from tests.factories import NOISE, make_scan


@pytest.fixture(scope="module")
def scan():
    return make_scan()


def test_that_points_lie_where_their_deviation_says(scan):
    cloud, result = scan
    for element in result.elements:
        on_it = result.element_id == element.element_id
        assert on_it.sum() == element.n_points
        points = cloud.xyz[on_it].astype(float)
        if element.kind is ElementKind.SPHERE:
            distance = np.linalg.norm(points - element.centre, axis=1) - element.radius
        else:
            chainage, rho, _ = element.axis.pipe_coordinates(points)
            distance = rho - element.radius_at(np.clip(chainage, 0, element.axis.length))
        assert distance == pytest.approx(result.deviation[on_it], abs=1e-6)
    assert np.isnan(result.deviation[result.element_id == NO_ID]).all()


def test_that_profiles_show_the_deformations(scan):
    _, result = scan
    for d in result.deformations:
        own = result.profiles.of_element(d.element_id, OWN_STACK)
        inside = np.abs(own.chainage - d.chainage) < d.length / 4
        outside = np.abs(own.chainage - d.chainage) > d.length / 2
        assert own.flattening[inside].mean() > 2 * own.flattening[outside].mean()


def test_that_deformations_peak_on_the_deformed_surface(scan):
    _, result = scan
    for d in result.deformations:
        element = result.element(d.element_id)
        chainage, rho, clock = element.axis.pipe_coordinates(d.peak[None])
        assert chainage[0] == pytest.approx(d.chainage)
        assert clock[0] == pytest.approx(d.clock)
        departure = abs(rho[0] - element.radius_at(d.chainage))
        assert departure == pytest.approx(d.depth, abs=NOISE / 10)


def test_that_the_verdicts_are_those_of_the_rule(scan):
    _, result = scan
    for d in result.deformations:
        assert judge(d, result.element(d.element_id), load_rules(d.rule)).verdict is d.verdict


def test_that_the_number_of_points_is_as_asked_and_the_scan_is_the_same_each_time():
    for n_points in (500, 12_345):
        cloud, result = make_scan(n_points)
        assert len(cloud) == len(result.element_id) == n_points
    make_scan.cache_clear()
    assert np.array_equal(make_scan(500)[0].xyz, make_scan(500, seed=1)[0].xyz)
    assert not np.array_equal(make_scan(500)[0].xyz, make_scan(500, seed=2)[0].xyz)
