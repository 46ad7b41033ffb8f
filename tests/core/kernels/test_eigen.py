"""Eigenvalues and eigenvectors in scalars, against numpy's."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from pipecore._kernels.eigen import eigenvalues, eigenvector, least_eigenpair

pytestmark = pytest.mark.kernels


def upper(matrix):
    return matrix[0, 0], matrix[0, 1], matrix[0, 2], matrix[1, 1], matrix[1, 2], matrix[2, 2]


@pytest.mark.parametrize("scale", [1e-8, 1.0, 1e6])
@pytest.mark.parametrize("shape", [(1.0, 1.0, 1.0), (1.0, 0.5, 1e-4), (1.0, 1e-3, 1e-3)])
def test_that_eigenvalues_and_vectors_are_those_of_numpy(rng, scale, shape):
    for _ in range(20):
        a = rng.normal(size=(3, 10)) * np.array(shape)[:, None]
        q = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        matrix = scale * q @ a @ a.T @ q.T
        values, vectors = np.linalg.eigh(matrix)
        found = eigenvalues(*upper(matrix))
        # The closed form loses digits as two eigenvalues meet, at worst half of them.
        spread = min(np.diff(values)) / values[2]
        atol = min(1e-15 / max(spread, 1e-16) + 1e-14, 2e-8) * values[2]
        assert_allclose(found, values, atol=atol, rtol=0)
        for k, value in enumerate(found):
            gap = np.min(np.abs(np.delete(values, k) - values[k])) / values[2]
            if gap < 1e-4:
                continue
            v = np.array(eigenvector(*upper(matrix), value))
            assert np.linalg.norm(v) == pytest.approx(1.0)
            assert abs(v @ vectors[:, k]) > 1 - 1e-12 / gap**2


def test_that_a_multiple_eigenvalue_has_no_vector_of_its_own():
    assert eigenvalues(2.0, 0.0, 0.0, 2.0, 0.0, 2.0) == (2.0, 2.0, 2.0)
    assert np.isnan(eigenvector(2.0, 0.0, 0.0, 2.0, 0.0, 2.0, 2.0)).all()
    assert np.isnan(eigenvector(1.0, 0.0, 0.0, 1.0, 0.0, 5.0, 1.0)).all()


def test_that_the_smallest_eigenvalue_of_points_in_a_plane_is_nothing_and_its_vector_the_normal(
    rng,
):
    q = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    points = rng.normal(size=(20, 2)) @ q[:2]
    matrix = points.T @ points
    least, _, largest = eigenvalues(*upper(matrix))
    assert abs(least) < 1e-14 * largest
    assert abs(np.array(eigenvector(*upper(matrix), least)) @ q[2]) > 1 - 1e-12


@pytest.mark.parametrize("scale", [1e-8, 1.0, 1e6])
def test_that_the_least_eigenpair_is_that_of_the_closed_form(rng, scale):
    shapes = [(1.0, 1.0, 1.0), (1.0, 0.7, 0.0), (1.0, 1.0, 1e-3), (1.0, 1e-3, 1e-3)]
    for shape in shapes * 10:
        a = rng.normal(size=(3, 12)) * np.array(shape)[:, None]
        q = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        matrix = scale * q @ a @ a.T @ q.T
        values, vectors = np.linalg.eigh(matrix)
        value, *vector = least_eigenpair(*upper(matrix))
        gap = (values[1] - values[0]) / values[2]
        atol = min(1e-15 / max(gap, 1e-16) + 2e-14, 4e-8) * values[2]
        assert value == pytest.approx(values[0], abs=atol, rel=0)
        if gap > 1e-4:
            assert np.linalg.norm(vector) == pytest.approx(1.0)
            assert abs(np.array(vector) @ vectors[:, 0]) > 1 - 1e-12 / gap**2


def test_that_a_multiple_least_eigenvalue_has_no_vector():
    for matrix in ((2.0, 0.0, 0.0, 2.0, 0.0, 2.0), (0.0,) * 6):
        value, *vector = least_eigenpair(*matrix)
        assert value == matrix[0]
        assert np.isnan(vector).all()
