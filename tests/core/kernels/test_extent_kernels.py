"""Medians, sectors and turning of normals by group, against loops over the groups."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from pipecore._kernels import extent

pytestmark = pytest.mark.kernels


def test_that_the_median_of_a_group_is_its_upper_one(rng):
    values, group = rng.normal(size=80), rng.integers(0, 9, 80)
    group[group == 4] = 5
    medians = np.empty(9)
    extent.upper_medians(values, group, medians)
    for k in range(9):
        own = np.sort(values[group == k])
        assert medians[k] == (own[len(own) // 2] if len(own) else np.inf)


def test_that_sectors_are_marked_where_a_group_has_points(rng):
    group, clock = rng.integers(-2, 8, 60), rng.uniform(0, 2 * np.pi, 60)
    seen = np.empty((6, 12), np.bool_)
    extent.mark_sectors(group, clock, seen)
    expected = {(g, int(c // (np.pi / 6))) for g, c in zip(group, clock, strict=True) if 0 <= g < 6}
    assert set(zip(*np.nonzero(seen), strict=True)) == expected


def test_that_turning_is_one_more_than_the_slope_of_the_lean(rng):
    group = rng.integers(0, 4, 200)
    # Around 12:00 as well, where the clock starts anew.
    around = rng.uniform(-1.0, 1.0, 200)
    lean = -0.3 * group * around + 0.01 * rng.normal(size=200)
    clock = np.mod(around + 0.1 * group, 2 * np.pi)
    turning = np.empty(5)
    extent.turn_of_normals(clock, lean, group, turning)
    for k in range(4):
        slope = np.polyfit(around[group == k], lean[group == k], 1)[0]
        assert turning[k] == pytest.approx(1.0 + slope, abs=1e-9)
    assert turning[4] == 0.0
    assert_allclose(turning[:4], 1.0 - 0.3 * np.arange(4), atol=0.02)


def test_that_one_point_or_one_place_does_not_turn():
    turning = np.empty(2)
    group = np.array([0, 1, 1])
    extent.turn_of_normals(np.array([1.0, 2.0, 2.0]), np.zeros(3), group, turning)
    assert_array_equal(turning, [0.0, 0.0])
