"""The parts of the fit of oval sections, against their formulas."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from pipecore._kernels.oval_sections import (
    MIN_OVAL_ARC,
    fit_oval,
    lies_on_section,
    radius_towards,
    refine_section,
)

pytestmark = pytest.mark.kernels

SHAPE = np.array([0.2, 0.008, -0.004, 0.002, 0.001])
CENTRE = np.array([0.3, -0.1])


def radius(shape, angle):
    a = np.exp(1j * np.asarray(angle))
    return (
        shape[0]
        + (np.conj(shape[1] + 1j * shape[2]) * a**2).real
        + (np.conj(shape[3] + 1j * shape[4]) * a**3).real
    )


def points(angle, shape=SHAPE):
    r = radius(shape, angle)
    return CENTRE[0] + r * np.cos(angle), CENTRE[1] + r * np.sin(angle)


def test_that_the_radius_is_a_sum_of_harmonics(rng):
    for angle in rng.uniform(0, 2 * np.pi, 30):
        found = radius_towards(SHAPE, np.cos(angle), np.sin(angle))
        assert found == pytest.approx(radius(SHAPE, angle))
    circle = np.array([0.2, 0.0, 0.0, 0.0, 0.0])
    assert radius_towards(circle, 1.0, 0.0) == 0.2


def test_that_points_are_on_a_section_up_to_the_distance_with_normals_to_the_centre(rng):
    for angle in rng.uniform(0, 2 * np.pi, 20):
        x, y = points(angle)
        c, s = np.cos(angle), np.sin(angle)
        args = CENTRE[0], CENTRE[1], SHAPE
        for off, is_on in ((0.0009, True), (-0.0009, True), (0.0011, False), (-0.0011, False)):
            assert lies_on_section(x + off * c, y + off * s, c, s, *args, 0.001, 0.9) == is_on
        for turn, is_on in ((20.0, True), (160.0, True), (30.0, False)):
            t = angle + np.deg2rad(turn)
            assert lies_on_section(x, y, np.cos(t), np.sin(t), *args, 0.001, 0.9) == is_on
    assert not lies_on_section(*CENTRE, 1.0, 0.0, *CENTRE, SHAPE, 1.0, 0.0)


def test_that_refining_leads_to_the_section_that_points_are_on(rng):
    x, y = points(np.linspace(0, 2 * np.pi, 80, endpoint=False))
    weights, shape = np.empty(80), np.array([0.205, 0.0, 0.0, 0.0, 0.0])
    found = refine_section(x, y, CENTRE[0] + 0.004, CENTRE[1], 0.05, 1e-9, weights, shape, 30)
    assert_allclose(found, CENTRE, atol=1e-6)
    assert_allclose(shape, SHAPE, atol=1e-6)
    assert_allclose(weights, 1.0, atol=1e-6)


def test_that_a_strong_prior_leaves_the_circle(rng):
    x, y = points(np.linspace(0, 2 * np.pi, 80, endpoint=False))
    weights, shape = np.empty(80), np.array([0.2, 0.0, 0.0, 0.0, 0.0])
    refine_section(x, y, *CENTRE, 0.5, 1e6, weights, shape, 30)
    assert_allclose(shape[1:], 0.0, atol=1e-9)


def test_that_points_in_one_place_refine_to_nothing():
    weights, shape = np.empty(9), np.array([0.2, 0.0, 0.0, 0.0, 0.0])
    found = refine_section(np.ones(9), np.ones(9), 0.9, 1.0, 0.5, 0.0, weights, shape, 5)
    assert np.isnan(found).all()


@pytest.mark.parametrize(
    ("arc", "n", "ovality", "is_fitted"),
    [
        (2 * np.pi, 80, 0.05, True),
        (MIN_OVAL_ARC + 0.3, 80, 0.05, True),
        (MIN_OVAL_ARC - 0.1, 80, 0.05, False),
        (2 * np.pi, 12, 0.05, False),
        (2 * np.pi, 80, 0.12, False),
    ],
    ids=["all round", "enough arc", "short arc", "few points", "flatter than pipes"],
)
def test_that_an_oval_is_fitted_where_enough_of_one_that_pipes_have_is_seen(
    arc, n, ovality, is_fitted
):
    true = np.array([0.2, 0.2 * ovality, 0.0, 0.0, 0.0])
    x, y = points(np.linspace(0, arc, n, endpoint=arc < 6), true)
    weights, shape = np.empty(n), np.empty(5)
    found = fit_oval(x, y, *CENTRE, 0.2, 0.002, 0.05, weights, shape)
    assert np.isfinite(found).all() == is_fitted
    if is_fitted and arc > 6:
        assert_allclose(found, CENTRE, atol=1e-3)
        assert_allclose(shape, true, atol=1e-3)
