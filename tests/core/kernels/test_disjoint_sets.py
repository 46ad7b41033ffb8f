"""Disjoint sets, against sets of Python."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from pipecore._kernels.disjoint_sets import count_members, find_root, flatten, unite, unite_labelled

pytestmark = pytest.mark.kernels


def merged(n, groups):
    """Smallest member of each element's set once the groups are united."""
    sets = [{i} for i in range(n)]
    for group in groups:
        whole = set().union(*(sets[i] for i in group))
        for i in whole:
            sets[i] = whole
    return np.array([min(s) for s in sets])


def test_that_the_root_is_the_least_of_those_united(rng):
    parents, pairs = np.arange(50), rng.integers(0, 50, (35, 2))
    for i, j in pairs:
        unite(parents, i, j)
    expected = merged(50, pairs)
    assert_array_equal([find_root(parents, i) for i in range(50)], expected)
    flatten(parents)
    assert_array_equal(parents, expected)


def test_that_looking_for_a_root_shortens_the_way_and_changes_no_set():
    parents = np.array([0, 0, 1, 2, 3, 4])
    assert find_root(parents, 5) == 0
    assert_array_equal(parents, [0, 0, 1, 1, 3, 3])
    assert find_root(parents, 0) == 0
    assert [find_root(parents, i) for i in range(6)] == [0] * 6


def test_that_an_element_united_with_itself_stays_alone():
    parents = np.arange(3)
    unite(parents, 1, 1)
    assert_array_equal(parents, [0, 1, 2])


def test_that_points_of_one_label_are_united_over_several_calls(rng):
    labels = rng.integers(-1, 6, 60)
    parents, first = np.arange(60), np.full(6, -1)
    for start in range(0, 60, 20):
        unite_labelled(labels[start : start + 20], start, first, parents)
    flatten(parents)
    groups = [np.flatnonzero(labels == k) for k in range(6)]
    assert_array_equal(parents, merged(60, [g for g in groups if len(g)]))
    assert_array_equal(first, [g[0] if len(g) else -1 for g in groups])
    # Points without a label stay alone.
    alone = np.flatnonzero(labels < 0)
    assert_array_equal(parents[alone], alone)


def test_that_members_are_added_to_what_was_counted(rng):
    roots, sizes = rng.integers(0, 9, 40), np.arange(9)
    count_members(roots, sizes)
    assert_array_equal(sizes, np.arange(9) + np.bincount(roots, minlength=9))
    count_members(roots[:0], sizes)
    assert sizes.sum() == 36 + 40
