"""What was nearly accepted is kept with its reason, can be accepted, and survives a file."""

from dataclasses import replace

import numpy as np
import pytest

import pipecore
from pipecore import editing
from pipecore.elements.gates import refusals
from pipecore.errors import EditError
from pipecore.geometry import LineAxis
from pipecore.report import load, result_from_dict, result_to_dict
from pipecore.settings import ElementSettings, Settings
from pipecore.types import ElementKind
from tests.core.shapes import cloud_of, tube

LONG = LineAxis(np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0]), 2.0)
SHORT = LineAxis(np.array([0.0, 1.0, 1.0]), np.array([0.0, 1.0, 0.0]), 0.25)
SHORT_RADIUS = 0.1
LEAST = 0.4
"""Shortest pipe of these settings, metres: the short piece misses it, within twice."""
SETTINGS = Settings(elements=ElementSettings(min_length_mm=1e3 * LEAST))


@pytest.fixture(scope="module")
def scan():
    rng = np.random.default_rng(5)
    parts = (
        tube(rng, LONG, 0.08, spacing=0.005, noise=0.0005),
        tube(rng, SHORT, SHORT_RADIUS, spacing=0.005, noise=0.0005),
    )
    cloud = cloud_of(*parts)
    return cloud, pipecore.detect(cloud, SETTINGS)


def test_that_a_short_piece_is_told_with_its_length_and_the_limit(scan):
    _, result = scan
    (element,) = result.elements
    assert element.radius == pytest.approx(0.08, abs=0.0005)
    (candidate,) = result.candidates
    assert candidate.kind is ElementKind.CYLINDER
    assert candidate.radius == pytest.approx(SHORT_RADIUS, abs=0.0005)
    assert candidate.reason.template == refusals.TOO_SHORT
    assert candidate.value == pytest.approx(1e3 * SHORT.length, abs=20)
    assert (candidate.limit, candidate.unit) == (1e3 * LEAST, "mm")
    table = result.candidates_table()
    assert table["reason"][0] == str(candidate.reason)
    assert table["length_m"][0] == pytest.approx(SHORT.length, abs=0.02)


def test_that_an_accepted_one_is_measured_like_any_other(scan):
    cloud, result = scan
    changed = editing.accept_candidate(cloud, result, 1)
    assert not changed.candidates
    element = changed.elements[-1]
    assert (element.element_id, element.run_id, element.accepted_by) == (2, 2, "person")
    assert element.radius == pytest.approx(SHORT_RADIUS, abs=0.0005)
    on_it = np.flatnonzero(changed.element_id == 2)
    assert len(on_it) == element.n_points > 1000
    assert np.isfinite(changed.deviation[on_it]).all()
    assert len(changed.profiles.of_element(2, 0)) == element.n_profiles > 0
    assert element.ovality < 0.01
    assert len(result.candidates) == 1
    table = changed.elements_table()
    assert table["accepted_by"].tolist() == ["", "person"]


def test_that_a_dismissed_one_is_gone_and_a_missing_one_refused(scan):
    cloud, result = scan
    dismissed = editing.dismiss_candidates(result, [1])
    assert dismissed.candidates == ()
    assert len(dismissed.elements) == 1
    with pytest.raises(EditError, match="no candidate 1"):
        editing.accept_candidate(cloud, dismissed, 1)


def test_that_candidates_are_in_files_and_files_without_them_open(scan, tmp_path):
    cloud, result = scan
    result.save(tmp_path / "report", cloud)
    again = load(tmp_path / "report")
    ((before,), (after,)) = result.candidates, again.candidates
    assert str(after.reason) == str(before.reason)
    assert (after.reason.template, after.value) == (before.reason.template, before.value)
    page = (tmp_path / "report" / "report.html").read_text(encoding="utf-8")
    assert "Not accepted" in page
    assert str(before.reason) in page
    lines = (tmp_path / "report" / "candidates.csv").read_text(encoding="utf-8").splitlines()
    assert len(lines) == 2
    plain = result_to_dict(replace(result))
    del plain["candidates"], plain["n_more_candidates"]
    assert result_from_dict(plain).candidates == ()


def test_that_what_is_accepted_is_no_candidate_too(scan):
    _, result = scan
    on_element = result.elements[0]
    for candidate in result.candidates:
        _, rho, _ = on_element.axis.pipe_coordinates(candidate.axis.at(0.1)[None])
        assert rho[0] > 0.5


def test_that_every_gate_says_what_it_compares():
    from pipecore.elements.gates.acceptance import GATES

    names = {gate.__name__ for gates in GATES.values() for gate in gates}
    assert names == set(refusals.SHORTFALLS)
