"""The steps of the sort by cells, against numpy's own."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from pipecore._kernels import cell_sorting as kernels
from pipecore.surface.grid import GridFrame

pytestmark = pytest.mark.kernels

SHIFT = 4


@pytest.fixture
def sorted_points(rng):
    xyz = rng.uniform(0, 1, (150, 3))
    frame = GridFrame.of(xyz, 0.13)
    return xyz, frame, frame.keys(xyz)


def test_that_bins_count_the_points_of_their_numbers(sorted_points):
    xyz, frame, keys = sorted_points
    counts = np.zeros((keys.max() >> SHIFT) + 1, np.int64)
    for start, stop in ((0, 40), (40, 40), (40, 150)):
        kernels.count_bins(xyz, start, stop, frame.numbers, SHIFT, counts)
    assert_array_equal(counts, np.bincount(keys >> SHIFT, minlength=len(counts)))


def test_that_points_go_to_their_buckets_in_their_order(sorted_points):
    xyz, frame, keys = sorted_points
    bins = (keys.max() >> SHIFT) + 1
    bucket_of_bin = np.arange(bins) * 5 // bins
    bucket = bucket_of_bin[keys >> SHIFT]
    ends = np.cumsum(np.bincount(bucket, minlength=5))
    places, order = np.concatenate([[0], ends[:-1]]), np.empty(150, np.int64)
    for start, stop in ((0, 70), (70, 150)):
        kernels.put_in_buckets(xyz, start, stop, frame.numbers, SHIFT, bucket_of_bin, places, order)
    assert_array_equal(order, np.argsort(bucket, kind="stable"))
    assert_array_equal(places, ends)


@pytest.mark.parametrize("n", [0, 1, 60])
def test_that_a_bucket_is_sorted_by_cell_with_a_mark_at_each_first_point(sorted_points, rng, n):
    xyz, frame, keys = sorted_points
    order = rng.permutation(150)[:n]
    expected = order[np.argsort(keys[order], kind="stable")]
    begins = np.zeros(n, np.bool_)
    kernels.sort_bucket(xyz, frame.numbers, order, begins)
    assert_array_equal(order, expected)
    assert_array_equal(begins, np.diff(keys[order], prepend=-1) != 0)
