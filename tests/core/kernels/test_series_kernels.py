"""Fourier series of sections, against numpy's least squares and finite differences."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from pipecore._kernels import series

pytestmark = pytest.mark.kernels


def terms_of(theta, order, derivative=0):
    terms = np.empty((len(theta), 2 * order + 1))
    for i, angle in enumerate(theta):
        series.write_terms(angle, order, derivative, terms[i])
    return terms


def test_that_terms_are_waves_and_their_derivatives(rng):
    theta = rng.uniform(0, 7, 20)
    terms = terms_of(theta, 3)
    assert_allclose(terms[:, 0], 1.0)
    for k in (1, 2, 3):
        assert_allclose(terms[:, 2 * k - 1], np.cos(k * theta))
        assert_allclose(terms[:, 2 * k], np.sin(k * theta))
    h = 1e-5
    slopes = (terms_of(theta + h, 3) - terms_of(theta - h, 3)) / (2 * h)
    assert_allclose(terms_of(theta, 3, 1), slopes, atol=1e-8)
    bends = (terms_of(theta + h, 3, 1) - terms_of(theta - h, 3, 1)) / (2 * h)
    assert_allclose(terms_of(theta, 3, 2), bends, atol=1e-8)


def test_that_strays_are_those_far_from_a_weighted_fit(rng):
    basis, weight = terms_of(rng.uniform(0, 2 * np.pi, 60), 2), rng.uniform(0.5, 2.0, 60)
    r = basis @ rng.normal(size=5) + 0.01 * rng.normal(size=60)
    plain, scale = series.find_strays(basis, r, weight, 1, 4.7)
    root = np.sqrt(weight)
    solution = np.linalg.lstsq(root[:, None] * basis, root * r, rcond=None)[0]
    expected = np.abs(r - basis @ solution) * root
    assert_allclose(plain, expected, atol=1e-6)
    assert scale == pytest.approx(1.4826 * np.median(plain) / np.sqrt(55 / 60))
    r[:6] += 0.5
    residual, scale = series.find_strays(basis, r, weight, 5, 4.7)
    assert set(np.flatnonzero(residual > 4 * scale)) >= set(range(6))
    assert scale < 0.02


def test_that_a_positive_definite_system_is_solved(rng):
    design = rng.normal(size=(9, 4))
    normal, right = design.T @ design, rng.normal(size=4)
    expected = np.linalg.solve(normal, right)
    series.solve_in_place(normal, right)
    assert_allclose(right, expected, rtol=1e-8)


def test_that_the_triangle_solves_least_squares(rng):
    a, b = rng.normal(size=(30, 5)), rng.normal(size=30)
    upper = np.empty((5, 6))
    series.orthogonalise(np.column_stack([a, b]), upper)
    assert_allclose(np.tril(upper[:, :5], -1), 0.0)
    assert_allclose(upper[:, :5].T @ upper[:, :5], a.T @ a, atol=1e-10)
    expected = np.linalg.lstsq(a, b, rcond=None)[0]
    assert_allclose(np.linalg.solve(upper[:, :5], upper[:, 5]), expected)


def test_that_the_curvature_of_a_circle_and_of_an_ellipse_are_theirs(rng):
    theta = rng.uniform(0, 2 * np.pi, 40)
    values, variances = np.empty((2, 40))
    mean = series.curvature(theta, np.array([0.2]), np.zeros((1, 1)), values, variances)
    assert mean == pytest.approx(0.2)
    assert_allclose(values, 5.0)
    assert_allclose(variances, 0.0)
    # A long series for an ellipse's r(θ) = b / √(1 - (e cos θ)²), whose curvature is known.
    a, b, order = 1.0, 0.8, 30
    grid = np.arange(400) * (2 * np.pi / 400)
    r = b / np.sqrt(1 - (1 - b**2 / a**2) * np.cos(grid) ** 2)
    coefficients = np.linalg.lstsq(terms_of(grid, order), r, rcond=None)[0]
    root = 1e-3 * rng.normal(size=(2 * order + 1, 2 * order + 1))
    series.curvature(theta, coefficients, root, values, variances)
    r = b / np.sqrt(1 - (1 - b**2 / a**2) * np.cos(theta) ** 2)
    x, y = r * np.cos(theta), r * np.sin(theta)
    expected = 1 / (a**2 * b**2 * (x**2 / a**4 + y**2 / b**4) ** 1.5)
    assert_allclose(values, expected, rtol=1e-6)
    spread = np.linalg.norm(terms_of(theta, order, 2) @ root, axis=1) / r**2
    assert_allclose(np.sqrt(variances), spread, rtol=1e-6)
