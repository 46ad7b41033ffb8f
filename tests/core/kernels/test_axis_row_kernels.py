"""Medians, sectors and turning of normals by group, against loops over the groups."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from pipecore._kernels import axis_rows

pytestmark = pytest.mark.kernels


def test_that_the_median_of_a_group_is_its_upper_one(rng):
    values, group = rng.normal(size=80), rng.integers(0, 9, 80)
    group[group == 4] = 5
    medians = np.empty(9)
    axis_rows.upper_medians(values, group, medians)
    for k in range(9):
        own = np.sort(values[group == k])
        assert medians[k] == (own[len(own) // 2] if len(own) else np.inf)


def test_that_sectors_are_marked_where_a_group_has_points(rng):
    group, clock = rng.integers(-2, 8, 60), rng.uniform(0, 2 * np.pi, 60)
    seen = np.empty((6, 12), np.bool_)
    axis_rows.mark_sectors(group, clock, seen)
    expected = {(g, int(c // (np.pi / 6))) for g, c in zip(group, clock, strict=True) if 0 <= g < 6}
    assert set(zip(*np.nonzero(seen), strict=True)) == expected


def test_that_turning_is_one_more_than_the_slope_of_the_lean(rng):
    group = rng.integers(0, 4, 200)
    # Around 12:00 as well, where the clock starts anew.
    around = rng.uniform(-1.0, 1.0, 200)
    normal_angle = -0.3 * group * around + 0.01 * rng.normal(size=200)
    clock = np.mod(around + 0.1 * group, 2 * np.pi)
    turning = np.empty(5)
    axis_rows.normal_turning(clock, normal_angle, group, turning)
    for k in range(4):
        slope = np.polyfit(around[group == k], normal_angle[group == k], 1)[0]
        assert turning[k] == pytest.approx(1.0 + slope, abs=1e-9)
    assert turning[4] == 0.0
    assert_allclose(turning[:4], 1.0 - 0.3 * np.arange(4), atol=0.02)


def test_that_one_point_or_one_place_does_not_turn():
    turning = np.empty(2)
    group = np.array([0, 1, 1])
    axis_rows.normal_turning(np.array([1.0, 2.0, 2.0]), np.zeros(3), group, turning)
    assert_array_equal(turning, [0.0, 0.0])


def test_that_points_between_are_told_from_those_clear_of_the_ends(rng):
    own, chainage = rng.permutation(60), rng.uniform(-1, 2, 60)
    clock, residual = rng.normal(size=(2, 60))
    for clear, least in ((0.2, 3), (0.2, 60)):
        found = axis_rows.points_between(own, chainage, clock, residual, 0.0, 1.0, clear, least)
        within = (chainage >= 0.0) & (chainage <= 1.0)
        core = (chainage >= clear) & (chainage <= 1.0 - clear)
        chosen = own[core if core.sum() > least else within]
        for one, other in zip(
            found, (own[within], clock[within], residual[within], chosen), strict=True
        ):
            assert_array_equal(one, other)


def test_that_the_arc_in_a_gap_is_that_of_all_its_rows(rng):
    covered = np.array([2, 3, 6, 9])
    chainage, clock = rng.uniform(0.0, 1.2, 40), rng.uniform(0, 2 * np.pi, 40)
    arcs = axis_rows.arcs_in_gaps(chainage, clock, 0.1, 0.1, covered, 12)
    row = np.floor((chainage - 0.1) / 0.1)
    for k in range(3):
        inside = (row > covered[k]) & (row < covered[k + 1])
        sectors = np.unique((clock[inside] // (np.pi / 6)).astype(int))
        assert arcs[k] == pytest.approx(len(sectors) * np.pi / 6)


def test_that_points_of_an_oval_section_are_not_off_it(rng):
    row, clock = np.repeat([0, 1, 2], 400), rng.uniform(0, 2 * np.pi, 1200)
    oval = 0.004 * np.cos(2 * clock - 0.7)
    off = axis_rows.off_oval(clock, oval, row, 3, 36, np.radians(200), 0.005)
    assert off.max() < 6e-4
    # Neither an oval beyond the limit nor one of which half is seen is taken off.
    assert_allclose(axis_rows.off_oval(clock, oval, row, 3, 36, 3.5, 0.003), np.abs(oval))
    half = clock < np.pi
    off = axis_rows.off_oval(clock[half], oval[half], row[half], 3, 36, np.radians(200), 0.005)
    assert_allclose(off, np.abs(oval[half]))


def test_that_the_best_part_has_most_of_what_was_proposed():
    covered, nothing = np.array([0, 1, 2, 3, 9, 10, 11, 12, 13]), np.zeros(8)
    assert axis_rows.best_part(covered, nothing, 0.0, 0.1, 1.2, 0.5, 1.0) == (0, 3)
    assert axis_rows.best_part(covered, nothing, -0.9, 0.1, 1.2, 0.5, 1.0) == (4, 8)
    assert axis_rows.best_part(covered, nothing, 0.0, 0.1, 1.2, 0.7, 1.0) == (0, 8)
    # Much of an arc in a gap parts it too.
    arcs = nothing.copy()
    arcs[3] = 1.5
    assert axis_rows.best_part(covered, arcs, 0.0, 0.1, 1.2, 0.7, 1.0) == (0, 3)
    assert axis_rows.bounds_of(np.array([0.05, 0.02, 0.31, 0.38]), 0.0, 0.1, 0, 3) == (0.02, 0.38)
