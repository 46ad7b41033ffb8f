"""Small systems, against numpy's solutions."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from pipecore._kernels import linear

pytestmark = pytest.mark.kernels


def test_that_a_matrix_is_mirrored(rng):
    matrix = rng.normal(size=(5, 5))
    below = np.tril(matrix)
    linear.mirror(matrix)
    assert_allclose(matrix, below + np.tril(below, -1).T)


def test_that_a_positive_definite_system_is_solved(rng):
    design = rng.normal(size=(9, 4))
    normal, right = design.T @ design, rng.normal(size=4)
    expected = np.linalg.solve(normal, right)
    linear.solve_in_place(normal, right)
    assert_allclose(right, expected, rtol=1e-8)


def test_that_a_step_is_not_solved_for_where_the_points_carry_none(rng):
    step = np.empty(4)
    design = rng.normal(size=(20, 4))
    normal, right = design.T @ design, rng.normal(size=4)
    assert linear.solve_step(normal, right, step)
    assert_allclose(normal @ step, -right, atol=1e-9)
    design[:, 3] = design[:, 0] - design[:, 1]
    assert not linear.solve_step(design.T @ design, right, step)
    normal[0, 0] = np.nan
    assert not linear.solve_step(normal, right, step)


def test_that_a_band_is_factorised_and_solved(rng):
    root = np.tril(np.triu(rng.normal(size=(9, 9)), -3)) + 3 * np.eye(9)
    matrix, right = root @ root.T, rng.normal(size=9)
    band = np.zeros((9, 4))
    for i in range(4):
        band[: 9 - i, i] = np.diagonal(matrix, -i)
    expected = np.linalg.solve(matrix, right)
    linear.factorise_band(band)
    for i in range(4):
        assert_allclose(band[: 9 - i, i], np.diagonal(np.linalg.cholesky(matrix), -i))
    linear.solve_by_band(band, right)
    assert_allclose(right, expected)
    inverse = np.empty((9, 9))
    linear.inverse_by_band(band, inverse)
    assert_allclose(inverse, np.linalg.inv(matrix), atol=1e-12)
