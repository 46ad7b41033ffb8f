"""Sums and weights of a contour over its cells, against plain matrices."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.interpolate import BSpline

from pipecore._kernels import contour as kernels

pytestmark = pytest.mark.kernels

ROWS, COLUMNS, INTERVALS = 14, 10, 3


@pytest.fixture(params=[3, 5])
def parts(request, rng):
    """Splines as a table and by rows, harmonics, heights, and weights that are zero at places."""
    at = np.sort(rng.uniform(0, INTERVALS, ROWS))
    table = BSpline.design_matrix(at, np.arange(-3.0, INTERVALS + 4), 3)
    first = table.indices.reshape(-1, 4)[:, 0].astype(np.int64)
    phi = rng.normal(size=(COLUMNS, request.param))
    height = rng.normal(size=(ROWS, COLUMNS))
    weight = rng.uniform(0, 1, (ROWS, COLUMNS)) * (rng.random((ROWS, COLUMNS)) < 0.7)
    return table.toarray(), (first, table.data.reshape(-1, 4), phi), height, weight


def test_that_the_normal_equations_are_those_of_the_whole_design(parts, rng):
    table, splines, height, weight = parts
    phi = splines[2]
    size = table.shape[1] * phi.shape[1]
    design = np.einsum("rs,ct->rcst", table, phi).reshape(-1, size)
    expected = design.T @ (weight.ravel()[:, None] * design)
    band, right = np.zeros((4 * phi.shape[1], size)), np.empty(size)
    kernels.normal_equations(*splines, height, weight, band, right)
    for i in range(len(band)):
        assert_allclose(band[i, : size - i], np.diagonal(expected, -i), atol=1e-12)
        assert_allclose(band[i, size - i :], 0.0)
    assert_allclose(np.tril(expected, -len(band)), 0.0, atol=1e-12)
    assert_allclose(right, design.T @ (weight * height).ravel(), atol=1e-12)


def test_that_heights_and_residuals_are_those_of_the_coefficients(parts, rng):
    table, splines, height, weight = parts
    coefficients = rng.normal(size=(table.shape[1], splines[2].shape[1]))
    expected = table @ coefficients @ splines[2].T
    found = np.empty(height.shape)
    kernels.heights(*splines, coefficients, found)
    assert_allclose(found, expected, atol=1e-12)
    spread = kernels.scaled_residuals(*splines, coefficients, height, weight, found)
    used = weight > 0
    scaled = ((height - expected) * np.sqrt(weight))[used]
    assert_allclose(found[used], scaled, atol=1e-12)
    assert spread == pytest.approx(1.4826 * np.median(np.abs(scaled)))
    assert kernels.scaled_residuals(*splines, coefficients, height, 0 * weight, found) == 1.0


def test_that_weights_fall_by_the_loss(rng):
    residuals, weight = rng.normal(size=(2, 6, 5))
    weight = np.maximum(weight, 0.0)
    cauchy, tukey = np.empty((2, 6, 5))
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
