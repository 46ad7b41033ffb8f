"""Fourier series of sections, against numpy's least squares and finite differences."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from pipecore._kernels import fourier_series

pytestmark = pytest.mark.kernels


def terms_of(theta, order, derivative=0):
    terms = np.empty((len(theta), 2 * order + 1))
    for i, angle in enumerate(theta):
        fourier_series.write_terms(angle, order, derivative, terms[i])
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


@pytest.mark.parametrize("order", [0, 1, 4])
def test_that_normal_equations_come_from_sums_of_twice_as_many_terms(rng, order):
    waves, weight = terms_of(rng.uniform(0, 7, 30), 2 * order), rng.uniform(0.5, 2.0, 30)
    basis = waves[:, : 2 * order + 1]
    normal = np.zeros((2 * order + 1, 2 * order + 1))
    fourier_series.write_normal(weight @ waves, order, normal)
    expected = basis.T @ (weight[:, None] * basis)
    assert_allclose(np.tril(normal), np.tril(expected), atol=1e-12)


def test_that_strays_are_those_far_from_a_weighted_fit(rng):
    waves, weight = terms_of(rng.uniform(0, 2 * np.pi, 60), 4), rng.uniform(0.5, 2.0, 60)
    basis = waves[:, :5]
    r = basis @ rng.normal(size=5) + 0.01 * rng.normal(size=60)
    plain, scale = fourier_series.find_outliers(waves, r, weight, 1, 4.7)
    root = np.sqrt(weight)
    solution = np.linalg.lstsq(root[:, None] * basis, root * r, rcond=None)[0]
    expected = np.abs(r - basis @ solution) * root
    assert_allclose(plain, expected, atol=1e-6)
    assert scale == pytest.approx(1.4826 * np.median(plain) / np.sqrt(55 / 60))
    r[:6] += 0.5
    residual, scale = fourier_series.find_outliers(waves, r, weight, 5, 4.7)
    assert set(np.flatnonzero(residual > 4 * scale)) >= set(range(6))
    assert scale < 0.03  # 0.012 ± 0.002


def test_that_the_triangle_solves_least_squares(rng):
    a, b = rng.normal(size=(30, 5)), rng.normal(size=30)
    upper = np.empty((5, 6))
    fourier_series.orthogonalise(np.column_stack([a, b]).T.copy(), upper)
    assert_allclose(np.tril(upper[:, :5], -1), 0.0)
    assert_allclose(upper[:, :5].T @ upper[:, :5], a.T @ a, atol=1e-10)
    expected = np.linalg.lstsq(a, b, rcond=None)[0]
    assert_allclose(np.linalg.solve(upper[:, :5], upper[:, 5]), expected)


def test_that_the_curvature_of_a_circle_and_of_an_ellipse_are_theirs(rng):
    theta = rng.uniform(0, 2 * np.pi, 40)
    values, variances = np.empty((2, 40))
    mean = fourier_series.curvature(theta, np.array([0.2]), np.zeros((1, 1)), values, variances)
    assert mean == pytest.approx(0.2)
    assert_allclose(values, 5.0)
    assert_allclose(variances, 0.0)
    # A long series for an ellipse's r(θ) = b / √(1 - (e cos θ)²), whose curvature is known.
    a, b, order = 1.0, 0.8, 30
    grid = np.arange(400) * (2 * np.pi / 400)
    r = b / np.sqrt(1 - (1 - b**2 / a**2) * np.cos(grid) ** 2)
    coefficients = np.linalg.lstsq(terms_of(grid, order), r, rcond=None)[0]
    root = 1e-3 * rng.normal(size=(2 * order + 1, 2 * order + 1))
    fourier_series.curvature(theta, coefficients, root, values, variances)
    r = b / np.sqrt(1 - (1 - b**2 / a**2) * np.cos(theta) ** 2)
    x, y = r * np.cos(theta), r * np.sin(theta)
    expected = 1 / (a**2 * b**2 * (x**2 / a**4 + y**2 / b**4) ** 1.5)
    assert_allclose(values, expected, rtol=1e-6)
    spread = np.linalg.norm(terms_of(theta, order, 2) @ root, axis=1) / r**2
    assert_allclose(np.sqrt(variances), spread, rtol=1e-6)


@pytest.mark.parametrize("width", [0.0, 0.5, 4.0])
def test_that_spans_lie_between_wide_gaps_and_go_on_over_noon(rng, width):
    # One span from 5 to 7 (over noon), one of `width` from 2 on, and a lone point.
    theta = np.concatenate([np.arange(5, 7.001, 0.1), np.arange(2, 2.001 + width, 0.1), [1.2]])
    theta = np.sort(np.mod(theta, 2 * np.pi))
    spans = np.empty((9, 2))
    spans = spans[: fourier_series.spans_of(theta, 0.3, 0.05, spans)]
    if width == 4.0:  # up to 6, where the other has begun
        assert_allclose(spans, [[2.0, 7.0]])
    elif width == 0.0:
        assert_allclose(spans, [[5.0, 7.0]])
    else:
        assert_allclose(spans[np.argsort(spans[:, 0])], [[2.0, 2.5], [5.0, 7.0]])
    assert fourier_series.spans_of(np.arange(0.1, 2 * np.pi, 0.1), 0.3, 0.05, np.empty((9, 2))) == 1


def test_that_cells_hold_means_and_what_they_hide(rng):
    theta, r = rng.uniform(0, 2 * np.pi, 200), rng.normal(size=200)
    middle, mean, count, hidden = fourier_series.in_cells(theta, r, 16)
    cell = (theta / (2 * np.pi) * 16).astype(int)
    for k, own in enumerate(np.unique(cell)):
        assert count[k] == (cell == own).sum()
        assert middle[k] == pytest.approx(theta[cell == own].mean())
        assert mean[k] == pytest.approx(r[cell == own].mean())
    assert (count * mean**2).sum() + hidden == pytest.approx((r**2).sum())


def test_that_the_order_is_chosen_by_what_least_squares_leave(rng):
    n, order = 80, 4
    a, b = terms_of(rng.uniform(0, 2 * np.pi, n), order), rng.normal(size=n)
    b += 3.0 * a[:, 3] - 2.0 * a[:, 4]
    aic, upper = np.empty(order + 1), np.empty((2 * order + 1, 2 * order + 2))
    best, left = fourier_series.choose_order(
        np.column_stack([a, b]).T.copy(), float(n), 0.5, aic, upper
    )
    expected = []
    for k in range(order + 1):
        part = a[:, : 2 * k + 1]
        rss = ((b - part @ np.linalg.lstsq(part, b, rcond=None)[0]) ** 2).sum() + 0.5
        p = 2 * k + 2
        expected.append(n * np.log(rss / n) + 2 * p + 2 * p * (p + 1) / (n - p - 1))
        if k == best:
            assert left == pytest.approx(rss)
    assert_allclose(aic, expected)
    assert best == np.argmin(expected) >= 2
    triangle = upper[:5, :5]
    assert_allclose(fourier_series.inverted(upper, 5) @ triangle, np.eye(5), atol=1e-12)


def test_that_many_sections_vary_as_each_alone(rng):
    parts = []
    for n, oval in ((200, 0.0), (300, 0.05), (8, 0.0), (400, 0.0)):
        theta = rng.uniform(0, 2 * np.pi, n)
        parts.append((theta, 0.1 * (1 + oval * np.cos(2 * theta)) + 2e-4 * rng.normal(size=n)))
    parts[3] = tuple(x[np.abs(parts[3][0] - 3) < 0.3] for x in parts[3])  # too short an arc
    last = np.cumsum([len(t) for t, _ in parts])
    first = last - [len(t) for t, _ in parts]
    theta, r = (np.concatenate(x) for x in zip(*parts, strict=True))
    limits = fourier_series.SeriesLimits(3, 0.03, 1.0, 250, 100, 5, 4.7, 4.0)
    variation = np.empty(4)
    fourier_series.variations(theta, r, first, last, 12, 6, 0.4, limits, 0.03, variation)
    for k in (0, 1):
        spans, _, _, _, coefficients, root = fourier_series.fit_series(*parts[k], 6, 0.4, limits)
        clocks = np.concatenate(
            [np.linspace(a, b, int(np.ceil((b - a) / 0.03)) + 1) for a, b in spans]
        )
        assert_allclose(fourier_series.clocks_of(spans, 0.03), clocks)
        values, variances = np.empty((2, len(clocks)))
        radius = fourier_series.curvature(clocks, coefficients, root, values, variances)
        weight = 1 / (variances + (0.05 / radius) ** 2)
        mean = np.average(values, weights=weight)
        spread = np.average((values - mean) ** 2 - variances, weights=weight)
        assert variation[k] == pytest.approx(radius * np.sqrt(max(spread, 0)), abs=1e-12)
    assert variation[0] < 0.03
    assert variation[1] > 0.08
    assert np.isnan(variation[2:]).all()
