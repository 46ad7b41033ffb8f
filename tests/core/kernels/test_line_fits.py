"""Fits of lines through ellipses, against weighted least squares of numpy."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from pipecore._kernels.chain_links import do_follow
from pipecore._kernels.line_search import (
    N_LINE_COLUMNS,
    AxisEllipses,
    PieceLimits,
    fit_line,
    taper_of,
    weight_of,
    weighted_median,
)
from tests.core.shapes import random_direction

pytestmark = pytest.mark.kernels


def along_a_line(rng, n=40, slope=0.0, noise=1e-3):
    """Ellipses along a line, of unlike precision."""
    place, direction = rng.normal(size=3), random_direction(rng)
    s = rng.uniform(-0.6, 0.6, n)
    centre = place + s[:, None] * direction + noise * rng.normal(size=(n, 3))
    sd = rng.uniform(0.2e-3, 2e-3, n)
    radius = 0.1 + slope * s + sd * rng.normal(size=n)
    return AxisEllipses(centre, np.tile(direction, (n, 1)), radius, sd)


def test_that_a_weight_is_the_inverse_variance_with_a_floor():
    assert weight_of(0.0) == pytest.approx(1e8)
    assert weight_of(0.01) == pytest.approx(1 / (1e-4 + 1e-8))


@pytest.mark.parametrize("slope", [0.0, 0.2])
def test_that_a_fitted_line_is_the_main_axis_of_the_weighted_centres(rng, slope):
    ellipses = along_a_line(rng, slope=slope)
    chosen = np.flatnonzero(rng.random(40) < 0.8)
    line, along = np.full(N_LINE_COLUMNS, np.nan), np.empty(len(chosen))
    fit_line(ellipses, chosen, bool(slope), line, along)
    weight = 1 / (ellipses.radius_sd[chosen] ** 2 + 1e-8)
    centre, radius = ellipses.centre[chosen], ellipses.radius[chosen]
    middle = np.average(centre, axis=0, weights=weight)
    values, vectors = np.linalg.eigh(np.cov(centre.T, aweights=weight))
    assert_allclose(line[:3], middle, atol=1e-12)
    assert abs(line[3:6] @ vectors[:, -1]) == pytest.approx(1.0, abs=1e-12)
    assert values[-1] > 100 * values[0]
    assert_allclose(along, (centre - middle) @ line[3:6], atol=1e-12)
    if slope:
        taper, start = np.polyfit(along, radius, 1, w=np.sqrt(weight))
        assert_allclose(line[6:8], [start, taper], atol=1e-12)
    else:
        assert line[6] == weighted_median(radius, weight)
        assert line[7] == 0.0
    # The extent is not known yet.
    assert np.isnan(line[8:]).all()


def test_that_the_taper_is_that_of_a_weighted_regression_with_its_deviation(rng):
    n = 40
    ellipses = along_a_line(rng, n=n, slope=0.1)
    chosen, along = np.arange(n), rng.uniform(-0.5, 0.5, n)
    taper, sd = taper_of(ellipses, chosen, along)
    weight = 1 / (ellipses.radius_sd**2 + 1e-8)
    coefficients = np.polyfit(along, ellipses.radius, 1, w=np.sqrt(weight))
    residual = ellipses.radius - np.polyval(coefficients, along)
    run = weight @ (along - np.average(along, weights=weight)) ** 2
    assert taper == pytest.approx(coefficients[0])
    assert sd == pytest.approx(np.sqrt(weight @ residual**2 / (n - 2) / run))


def test_that_an_even_pipe_has_no_taper(rng):
    ellipses = along_a_line(rng)._replace(radius=np.full(40, 0.1))
    taper, sd = taper_of(ellipses, np.arange(40), rng.uniform(-0.5, 0.5, 40))
    assert taper == pytest.approx(0.0, abs=1e-12)
    assert sd == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize(
    ("change", "follows"),
    [
        ({}, True),
        ({"turn_deg": 14.0}, True),
        ({"turn_deg": 16.0}, False),
        ({"turn_deg": 166.5}, True),
        ({"radius": 0.1059}, True),
        ({"radius": 0.1061}, False),
        ({"radius": 0.1061, "sd": 0.001}, True),
        ({"offset": 0.0099}, True),
        ({"offset": 0.0101}, False),
        ({"offset": 0.0101, "sd": 0.001}, True),
    ],
)
def test_that_ellipses_follow_up_to_each_limit_and_no_further(change, follows):
    turn = np.deg2rad(change.get("turn_deg", 0.0))
    offset, sd = change.get("offset", 0.0), change.get("sd", 0.0)
    # Turned about the axis across which it may be off, so that only one limit is touched.
    axis = np.array([[1.0, 0.0, 0.0], [np.cos(turn), np.sin(turn), 0.0]])
    bisector = axis[0] + np.sign(np.cos(turn)) * axis[1]
    centre = np.stack([np.zeros(3), 0.02 * bisector / np.linalg.norm(bisector) + [0, 0, offset]])
    ellipses = AxisEllipses(
        centre, axis, np.array([0.1, change.get("radius", 0.1)]), np.full(2, sd)
    )
    limits = PieceLimits(np.cos(np.deg2rad(15.0)), 0.1, 0.06)
    assert do_follow(ellipses, 0, 1, limits) == follows
    assert do_follow(ellipses, 1, 0, limits) == follows


def test_that_ellipses_that_are_not_known_follow_none():
    nowhere = AxisEllipses(np.zeros((2, 3)), np.full((2, 3), np.nan), np.full(2, 0.1), np.zeros(2))
    assert not do_follow(nowhere, 0, 1, PieceLimits(0.9, 0.1, 0.06))
