"""Grouping by labels, against numpy's stable sort."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from pipecore._kernels.grouping import group_by_label, group_into

pytestmark = pytest.mark.kernels


@pytest.mark.parametrize("n", [0, 1, 200])
def test_that_items_are_in_the_order_of_their_labels_and_within_of_their_own(rng, n):
    labels = rng.integers(0, 9, n)
    members = np.empty(n, np.int32)
    starts = group_into(labels, 9, members)
    assert_array_equal(members, np.argsort(labels, kind="stable"))
    assert_array_equal(np.diff(starts), np.bincount(labels, minlength=9))
    again, same = group_by_label(labels, 9)
    assert_array_equal(again, members)
    assert_array_equal(same, starts)
