"""Cells of a deviation map, against numpy and scipy."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy import ndimage
from scipy.interpolate import RegularGridInterpolator

from pipecore._kernels import map_filters

pytestmark = pytest.mark.kernels


def test_that_medians_of_groups_are_numpys(rng):
    group, values = rng.integers(0, 12, 90), rng.normal(size=90)
    group[group == 7] = 8
    group[:30] = 3  # more than are sorted
    medians, counts = np.empty((2, 12))
    map_filters.group_medians(group, values, medians, counts)
    assert_array_equal(counts, np.bincount(group, minlength=12))
    for k in range(12):
        own = values[group == k]
        assert_array_equal(medians[k], np.median(own) if len(own) else np.nan)


def test_that_values_lie_between_those_of_cells_round_the_clock(rng):
    table, angle = rng.normal(size=(7, 9)), 2 * np.pi / 9
    chainage, clock = rng.uniform(-0.2, 1.6, 80), rng.uniform(0, 2 * np.pi, 80)
    values = np.empty(80)
    map_filters.interpolate(table, 0.2, angle, chainage, clock, values)
    whole = np.concatenate([table[:, -1:], table, table[:, :1]], axis=1)
    places = (np.arange(7) + 0.5) * 0.2, (np.arange(-1, 10) + 0.5) * angle
    held = np.clip(chainage, 0.1, 1.3)
    assert_allclose(values, RegularGridInterpolator(places, whole)(np.stack([held, clock], axis=1)))


def test_that_the_strongest_of_the_free_cells_is_found(rng):
    z, free = rng.normal(size=(8, 11)), rng.random((8, 11)) < 0.5
    most, place = map_filters.strongest(z, free)
    assert most == np.abs(z[free]).max()
    assert free.ravel()[place]
    assert abs(z.ravel()[place]) == most
    assert map_filters.strongest(z, np.zeros_like(free)) == (0.0, 0)


@pytest.mark.parametrize("taps", [(3, 5), (7, 1), (21, 25)])
def test_that_correlations_are_scipys(rng, taps):
    table = rng.normal(size=(8, 11))
    along, around = (rng.normal(size=n) for n in taps)
    found = np.empty(table.shape)
    map_filters.correlate(table, along, around, found)
    expected = ndimage.correlate1d(table, along, axis=0, mode="constant")
    assert_allclose(found, ndimage.correlate1d(expected, around, axis=1, mode="wrap"), atol=1e-12)


def test_that_heights_are_scored_by_their_noise(rng):
    pull, contour_sd = rng.normal(size=(2, 8, 11))
    precision = rng.uniform(1, 3, (8, 11))
    is_told, allowed = rng.random((2, 8, 11)) < 0.8
    height, z = pull.copy(), np.empty((8, 11))
    spread = map_filters.score(height, precision, is_told, contour_sd, allowed, z)
    assert_allclose(height[is_told], (pull / precision)[is_told])
    expected = np.where(is_told, height / np.hypot(precision**-0.5, contour_sd), 0.0)
    assert_allclose(z, expected)
    assert spread == pytest.approx(1.4826 * np.median(np.abs(z[is_told & allowed])))
    allowed[2:] = False
    assert map_filters.score(pull.copy(), precision, is_told, contour_sd, allowed, z) == 1.0
