"""Sections that may be oval, and how sections change along an axis."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from pipecore._kernels import oval_sections, section_models

pytestmark = pytest.mark.kernels

TOLERANCE, GAP = 0.004, 0.05


def section(rng, shape, n=120, noise=0.0, arc=2 * np.pi, centre=(0.3, -0.2)):
    angles = rng.uniform(0, 2 * np.pi) + np.linspace(0, arc, n, endpoint=False)
    r = shape[0] + sum(
        shape[2 * k - 3] * np.cos(k * angles) + shape[2 * k - 2] * np.sin(k * angles)
        for k in (2, 3)
    )
    r = r + noise * rng.normal(size=n)
    return centre[0] + r * np.cos(angles), centre[1] + r * np.sin(angles)


def fit(x, y):
    weights, shape = np.empty(len(x)), np.empty(5)
    centre = oval_sections.fit_section(x, y, TOLERANCE, GAP, 8, weights, shape)
    return np.array(centre), shape, weights


@pytest.mark.parametrize("radius", [0.06, 0.2, 1.0])
@pytest.mark.parametrize("ovality", [0.02, 0.06, 0.12])
def test_that_an_oval_section_is_found_with_its_centre_and_shape(rng, radius, ovality):
    turn = rng.uniform(0, np.pi)
    amplitude = ovality / 2 * radius
    true = np.array([radius, amplitude * np.cos(turn), amplitude * np.sin(turn), 0.0, 0.0])
    x, y = section(rng, true)
    centre, shape, weights = fit(x, y)
    if amplitude > 1.5 * TOLERANCE:
        # What keeps the untold near zero draws a told one by a little.
        assert_allclose(shape, true, atol=0.02 * amplitude)
    elif amplitude < 0.5 * TOLERANCE:
        # The circle does; its radius and centre are the oval's mean.
        assert_allclose(shape[1:], 0.0)
    assert_allclose(centre, [0.3, -0.2], atol=0.02 * amplitude + 1e-9)
    assert shape[0] == pytest.approx(radius, rel=0.004)
    assert (weights > 0.4).mean() > 0.9


def test_that_a_round_section_stays_a_circle(rng):
    x, y = section(rng, np.array([0.2, 0, 0, 0, 0]), noise=0.001)
    centre, shape, _ = fit(x, y)
    assert (shape[1:] == 0.0).all()
    assert_allclose(centre, [0.3, -0.2], atol=5e-4)


def test_that_what_is_flatter_than_pipes_are_gets_no_oval(rng):
    """An ellipse of semi-axes 2 : 1 is no deformed pipe."""
    angles = np.linspace(0, 2 * np.pi, 160, endpoint=False)
    _, shape, _ = fit(0.4 * np.cos(angles), 0.2 * np.sin(angles))
    assert (shape[1:] == 0.0).all()


def test_that_an_arc_too_short_to_tell_an_oval_gets_a_circle(rng):
    x, y = section(rng, np.array([0.5, 0.03, 0, 0, 0]), arc=np.deg2rad(120))
    _, shape, _ = fit(x, y)
    assert (shape[1:] == 0.0).all()


def test_that_points_off_the_section_do_not_bend_it(rng):
    true = np.array([0.4, 0.02, 0.01, 0.0, 0.0])
    x, y = section(rng, true, n=200)
    x[:12], y[:12] = 0.3 + 1.4 * (x[:12] - 0.3), -0.2 + 1.4 * (y[:12] + 0.2)
    centre, shape, weights = fit(x, y)
    assert_allclose(shape, true, atol=5e-4)
    assert_allclose(centre, [0.3, -0.2], atol=5e-4)
    assert (weights[:12] < 0.1).all()


def test_that_no_section_comes_of_points_in_one_place():
    centre, _, _ = fit(np.zeros(20), np.zeros(20))
    assert np.isnan(centre).all()


def legendre(x):
    return [np.ones_like(x), x, (3 * x**2 - 1) / 2, (5 * x**3 - 3 * x) / 2]


def test_that_terms_are_harmonics_times_legendre_polynomials(rng):
    n_powers = np.array([2, 3, 4, 1])
    row = np.empty(section_models.MOST_TERMS)
    for x, clock in rng.uniform([-1, 0], [1, 6.28], (10, 2)):
        n = section_models.fill_terms(x, clock, n_powers, row)
        expected = []
        for k, count in enumerate(n_powers):
            for polynomial in legendre(np.array(x))[:count]:
                expected.append(polynomial * np.cos(k * clock))
                if k:
                    expected.append(polynomial * np.sin(k * clock))
        assert n == len(expected)
        assert_allclose(row[:n], expected, atol=1e-12)


def test_that_the_terms_are_found_again_in_spite_of_a_dent(rng):
    n_powers = np.array([2, 3, 3])
    p = 2 + 6 + 6
    true = rng.normal(0, 0.003, p)
    chainage, clock = rng.uniform(0, 2.0, 20_000), rng.uniform(0, 2 * np.pi, 20_000)
    height = np.empty(20_000)
    section_models.heights(chainage, clock, 0.0, 2.0, n_powers, true, height)
    dent = np.exp(-(((chainage - 1.2) / 0.1) ** 2) - ((clock - 2.0) / 0.3) ** 2)
    cells = section_models.mean_cells(chainage, clock, height - 0.03 * dent, 0.0, 2.0, 20, 36)
    found = np.empty(p)
    assert section_models.fit_terms(cells, 0.0, 2.0, n_powers, 0.01, 0.05, 8, found)
    assert_allclose(found, true, atol=3e-4)


def test_that_too_few_cells_carry_no_terms(rng):
    cells = np.column_stack([rng.uniform(0, 1, 10), rng.uniform(0, 6, 10), np.zeros(10)])
    assert not section_models.fit_terms(
        cells, 0.0, 1.0, np.array([2, 3]), 0.01, 0.05, 8, np.empty(8)
    )
