"""Sums for direct ellipses, against numpy."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from pipecore._kernels import conics

pytestmark = pytest.mark.kernels

STARTS = np.array([0, 12, 13, 40])


@pytest.fixture
def scaled(rng):
    """Points, and what the kernel makes of them."""
    points = rng.normal(size=(40, 2)) + 5.0
    mean, scale, moments = np.empty((3, 2)), np.empty(3), np.empty((3, 15))
    conics.scaled_moments(points, STARTS, mean, scale, moments)
    return points, mean, scale, moments


def groups(points):
    return np.split(points, STARTS[1:-1])


def test_that_groups_are_centred_scaled_and_their_powers_summed(scaled):
    points, mean, scale, moments = scaled
    for g, own in enumerate(groups(points)):
        assert_allclose(mean[g], own.mean(axis=0))
        centred = own - own.mean(axis=0)
        spread = np.sqrt((centred**2).sum(axis=1).mean()) if len(own) > 1 else 1.0
        assert scale[g] == pytest.approx(spread)
        x, y = centred.T / spread
        powers = [x ** (d - j) * y**j for d in range(5) for j in range(d + 1)]
        assert_allclose(moments[g], np.sum(powers, axis=1), atol=1e-10)


def test_that_distances_from_conics_are_those_to_first_order(scaled, rng):
    points, mean, scale, _ = scaled
    conic, sums = rng.normal(size=(3, 6)), np.empty(3)
    conic[1] = np.nan
    conics.sampson_sums(points, STARTS, mean, scale, conic, sums)
    assert np.isnan(sums[1])
    for g in (0, 2):
        x, y = ((groups(points)[g] - mean[g]) / scale[g]).T
        a, b, c, d, e, f = conic[g]
        value = a * x * x + b * x * y + c * y * y + d * x + e * y + f
        gradient = np.hypot(2 * a * x + b * y + d, b * x + 2 * c * y + e)
        assert sums[g] == pytest.approx(((value / gradient) ** 2).sum())
