"""What was nearly accepted becomes an element by a person's word, or goes."""

import numpy as np
import pytest

import pipecore
from pipecore.editing import accept_candidate, dismiss_candidates
from pipecore.errors import EditError
from pipecore.geometry import LineAxis
from pipecore.settings import ElementSettings, Settings
from pipecore.types import ElementKind
from tests.core.shapes import cloud_of, tube

RADIUS, LENGTH = 0.08, 0.5


@pytest.fixture(scope="module")
def short():
    """A pipe that the settings call too short."""
    axis = LineAxis(np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0]), LENGTH)
    points = tube(np.random.default_rng(8), axis, RADIUS, spacing=0.005, noise=0.0005)
    cloud = pipecore.PointCloud.from_points(cloud_of(points).xyz)
    settings = Settings(elements=ElementSettings(min_length_mm=800))
    return cloud, pipecore.detect(cloud, settings)


def test_that_a_short_pipe_is_a_candidate_with_its_length_and_the_limit(short):
    _, result = short
    (candidate,) = result.candidates
    assert candidate.kind is ElementKind.CYLINDER
    assert candidate.radius == pytest.approx(RADIUS, rel=0.005)
    assert (candidate.value, candidate.limit) == pytest.approx((1e3 * LENGTH, 800.0), abs=10)
    table = result.candidates_table()
    assert table["unit"][0] == "mm"
    assert "shortest" not in table["reason"][0]
    assert "800" in table["reason"][0]


def test_that_an_accepted_one_is_measured_like_any_other(short):
    cloud, result = short
    accepted = accept_candidate(cloud, result, 1)
    (pipe,) = accepted.elements
    assert accepted.candidates == ()
    assert pipe.accepted_by == "person"
    assert pipe.radius == pytest.approx(RADIUS, rel=0.003)
    assert pipe.axis.length == pytest.approx(LENGTH, abs=0.02)
    assert pipe.n_profiles > 10
    assert pipe.n_points > 0.9 * len(cloud)
    assert "accepted" in accepted.edits[-1]


def test_that_a_dismissed_one_is_gone_and_an_unknown_one_is_none(short):
    cloud, result = short
    assert dismiss_candidates(result, [1]).candidates == ()
    with pytest.raises(EditError, match="no candidate 7"):
        dismiss_candidates(result, [7])
    with pytest.raises(EditError, match="no candidate 7"):
        accept_candidate(cloud, result, 7)
