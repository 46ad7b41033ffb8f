"""Points in the order of their cells, against numpy's own sorts."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from pipecore._kernels import cell_sorting as kernels
from pipecore._kernels.grouping import spread_to_members
from pipecore.surface import sorting
from pipecore.surface.grid import GridFrame, bounds
from pipecore.surface.sorting import sort_into_cells, take_points

# Plain numpy warns of what wraps around on purpose.
pytestmark = [pytest.mark.kernels, pytest.mark.filterwarnings("ignore:overflow encountered")]


def places(rng, case):
    xyz = rng.normal(size=(300, 3)) * [1.0, 3.0, 0.2]
    match case:
        case "single precision":
            return xyz.astype(np.float32)
        case "far outlier":
            return np.concatenate([xyz, [[3e4, -2e4, 1e3]]])
        case "one cell":
            return np.full((90, 3), 0.25)
        case "one point":
            return xyz[:1]
    return xyz


@pytest.mark.parametrize(
    "case", ["plain", "single precision", "far outlier", "one cell", "one point"]
)
@pytest.mark.parametrize("bucket", [7, 100_000])
def test_that_points_are_sorted_by_cell_and_within_by_their_order(rng, monkeypatch, case, bucket):
    monkeypatch.setattr(sorting, "BUCKET", bucket)
    monkeypatch.setattr(sorting, "CHUNK", 90)
    monkeypatch.setattr(sorting, "BIN_BITS", 10)
    xyz = places(rng, case)
    frame = GridFrame.of(xyz, 0.1)
    order, starts = sort_into_cells(xyz, frame)
    keys = frame.keys(xyz)
    assert_array_equal(order, np.argsort(keys, kind="stable"))
    _, counts = np.unique(keys, return_counts=True)
    assert_array_equal(np.diff(starts), counts)
    assert (starts[0], starts[-1]) == (0, len(xyz))


def test_that_no_points_have_no_cells(rng):
    order, starts = sort_into_cells(np.empty((0, 3)), GridFrame.of(rng.normal(size=(5, 3)), 0.1))
    assert len(order) == 0
    assert_array_equal(starts, [0])


def test_that_means_are_those_of_the_points_in_the_cells(rng):
    xyz = rng.normal(size=(200, 3))
    order, starts = sort_into_cells(xyz, GridFrame.of(xyz, 0.7))
    means = np.empty((len(starts) - 1, 3))
    for first, last in ((0, 9), (9, len(means))):
        kernels.mean_points(xyz, order, starts, first, last, means)
    for mean, own in zip(means, np.split(order, starts[1:-1]), strict=True):
        assert_allclose(mean, xyz[own].mean(axis=0), atol=0.51e-6)


def test_that_points_are_taken_in_the_order_given(rng):
    xyz, order = rng.normal(size=(50, 3)), rng.permutation(50)
    assert_array_equal(take_points(xyz, order), xyz[order])


def test_that_bounds_are_the_lowest_and_highest_coordinates(rng):
    xyz = rng.normal(size=(70, 3)).astype(np.float32)
    corners = np.empty((2, 3))
    kernels.find_bounds(xyz, 10, 60, corners)
    assert_array_equal(corners, [xyz[10:60].min(axis=0), xyz[10:60].max(axis=0)])
    assert_array_equal(bounds(xyz), [xyz.min(axis=0), xyz.max(axis=0)])


def test_that_members_get_the_values_of_their_groups():
    members, starts = np.array([3, 0, 5, 1]), np.array([0, 2, 2, 4])
    found = np.full(6, -1)
    spread_to_members(np.array([7, 8, 9]), members, starts, 0, 2, found)
    assert_array_equal(found, [7, -1, -1, 7, -1, -1])
    spread_to_members(np.array([7, 8, 9]), members, starts, 2, 3, found)
    assert_array_equal(found, [7, 9, -1, 7, -1, 9])
