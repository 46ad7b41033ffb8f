"""A contour's sums and weights over cells and its robust fit, against plain matrices."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.interpolate import BSpline

from pipecore._kernels import contour_fit as kernels

pytestmark = pytest.mark.kernels

ROWS, COLUMNS, INTERVALS = 14, 10, 3


@pytest.fixture(params=[3, 5])
def parts(request, rng):
    """Splines as a table and by rows, harmonics, heights, and variances inf at places."""
    at = np.sort(rng.uniform(0, INTERVALS, ROWS))
    table = BSpline.design_matrix(at, np.arange(-3.0, INTERVALS + 4), 3)
    first = table.indices.reshape(-1, 4)[:, 0].astype(np.int64)
    phi = rng.normal(size=(COLUMNS, request.param))
    height = rng.normal(size=(ROWS, COLUMNS))
    variance = rng.uniform(0.5, 2, (ROWS, COLUMNS))
    variance[rng.random((ROWS, COLUMNS)) < 0.3] = np.inf
    return (
        table.toarray(),
        kernels.ContourTerms(first, table.data.reshape(-1, 4), phi),
        height,
        variance,
    )


def listed(height, variance):
    return kernels.list_cells(height, variance, np.ones(len(height), bool), 0.0)


def test_that_cells_are_listed_row_by_row(parts):
    _, _, height, variance = parts
    height[2, 3] = np.nan
    used = np.ones(ROWS, bool)
    used[[0, 5]] = False
    starts, column, values, weights = kernels.list_cells(height, variance, used, 0.5)
    some = np.isfinite(height) & np.isfinite(variance) & used[:, None]
    assert_array_equal(np.diff(starts), some.sum(axis=1))
    assert_array_equal(column, np.nonzero(some)[1])
    assert_array_equal(values, height[some])
    assert_allclose(weights, 1 / (variance[some] + 0.25))


def test_that_the_normal_equations_are_those_of_the_whole_design(parts):
    table, splines, height, variance = parts
    phi = splines[2]
    size = table.shape[1] * phi.shape[1]
    design = np.einsum("rs,ct->rcst", table, phi).reshape(-1, size)
    weight = 1 / variance
    expected = design.T @ (weight.ravel()[:, None] * design)
    band, right = np.zeros((size, 4 * phi.shape[1])), np.empty(size)
    cells = listed(height, variance)
    kernels.normal_equations(splines, cells, cells.weight, band, right)
    for i in range(band.shape[1]):
        assert_allclose(band[: size - i, i], np.diagonal(expected, -i), atol=1e-12)
        assert_allclose(band[size - i :, i], 0.0)
    assert_allclose(np.tril(expected, -band.shape[1]), 0.0, atol=1e-12)
    assert_allclose(right, design.T @ (weight * height).ravel(), atol=1e-12)


def test_that_heights_and_residuals_are_those_of_the_coefficients(parts, rng):
    table, splines, height, variance = parts
    coefficients = rng.normal(size=(table.shape[1], splines[2].shape[1]))
    expected = table @ coefficients @ splines[2].T
    found = np.empty(height.shape)
    kernels.heights(splines, coefficients, found)
    assert_allclose(found, expected, atol=1e-12)
    some = np.isfinite(variance)
    scaled = (height - expected)[some] / np.sqrt(variance[some])
    for share in (1.0, 1e-3):  # of wide and of narrow residuals
        cells = listed(expected + share * (height - expected), variance)
        residuals = np.empty(len(scaled))
        spread = kernels.scaled_residuals(splines, coefficients, cells, residuals)
        assert_allclose(residuals, share * scaled, atol=1e-9)
        assert spread == pytest.approx(max(1.4826 * np.median(np.abs(share * scaled)), 1.0))
    none = listed(height, np.full_like(variance, np.inf))
    assert kernels.scaled_residuals(splines, coefficients, none, np.empty(0)) == 1.0


def test_that_the_robust_fit_is_that_of_its_weights(parts, rng):
    """Of the first 13 rounds if they may all differ, and nearly the same where it stops early."""
    table, splines, height, variance = parts
    phi = splines[2]
    size = table.shape[1] * phi.shape[1]
    height[3, 4] += 50.0
    some = np.isfinite(variance).ravel()
    design = np.einsum("rs,ct->rcst", table, phi).reshape(-1, size)[some]
    y, base = height.ravel()[some], 1 / variance.ravel()[some]
    weight = base.copy()
    for loss in [*[2.4] * 6, *[0.0] * 6, None]:
        normal = design.T @ (weight[:, None] * design) + 0.1 * np.eye(size)
        expected = np.linalg.solve(normal, design.T @ (weight * y))
        t = (y - design @ expected) * np.sqrt(base)
        t /= max(1.4826 * np.median(np.abs(t)), 1.0)
        weight = base * (
            1 / (1 + (t / 2.4) ** 2) if loss else np.clip(1 - (t / 4.7) ** 2, 0, 1) ** 2
        )
    prior = np.zeros((size, 4 * phi.shape[1]))
    prior[:, 0] = 0.1
    for tolerance, apart in ((-1.0, 1e-8), (1e-2, 0.2)):
        band, coefficients = np.empty_like(prior), np.empty((table.shape[1], phi.shape[1]))
        n_solved = kernels.fit_robustly(
            splines,
            listed(height, variance),
            prior,
            kernels.RobustLoss(2.4, 4.7, 6, tolerance),
            band,
            coefficients,
        )
        assert_allclose(coefficients.ravel(), expected, atol=apart)
        assert n_solved == 13 if tolerance < 0 else n_solved <= 13


def test_that_weights_fall_by_the_loss(rng):
    residuals, weight = rng.normal(size=(2, 30))
    weight = np.maximum(weight, 0.0)
    cauchy, tukey = np.empty((2, 30))
    kernels.reweight(residuals, weight, 0.5, 2.0, 3.0, cauchy)
    kernels.reweight(residuals, weight, 0.5, 0.0, 3.0, tukey)
    assert_allclose(cauchy, weight / (1 + (residuals / 1.0) ** 2))
    assert_allclose(tukey, weight * np.clip(1 - (residuals / 1.5) ** 2, 0, None) ** 2)


def test_that_covariances_of_rows_are_those_of_their_splines(parts, rng):
    table, (first, values, phi), _, _ = parts
    n_splines, n_terms = table.shape[1], phi.shape[1]
    root = rng.normal(size=(n_splines * n_terms, n_splines * n_terms))
    covariance = (root @ root.T).reshape(n_splines, n_terms, n_splines, n_terms)
    found = np.empty((ROWS, n_terms, n_terms))
    kernels.row_covariances(first, values, covariance, found)
    assert_allclose(found, np.einsum("ra,akbm,rb->rkm", table, covariance, table), atol=1e-9)


def test_that_deviations_of_heights_are_those_of_their_terms(parts, rng):
    phi = parts[1][2]
    root = rng.normal(size=(ROWS, phi.shape[1], phi.shape[1]))
    covariance = root @ root.transpose(0, 2, 1)
    found = np.empty((ROWS, COLUMNS))
    kernels.standard_deviations(phi, covariance, found)
    assert_allclose(found**2, np.einsum("ck,rkm,cm->rc", phi, covariance, phi))
