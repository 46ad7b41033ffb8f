"""Sums over cells that tell where the normal lines of a neighbourhood meet."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from pipecore._kernels import round_places as kernels
from pipecore.geometry import LineAxis
from pipecore.surface.grid import table_of
from tests.core.shapes import random_direction, tube

pytestmark = pytest.mark.kernels


ZERO = np.zeros(3)


def sums_of(xyz, normals, zero=ZERO):
    sums = np.zeros((1, kernels.N_SUMS))
    kernels.add_to_cells(xyz, normals, zero, np.zeros(len(xyz), np.int32), sums)
    return sums[0]


def axis_of(sums):
    result = np.empty(5)
    kernels.axis_of_sums(sums, 0.02, 0.25, result)
    return result


def test_that_the_sums_of_a_pipe_give_its_axis_and_radius(rng):
    d = random_direction(rng)
    xyz, normals = tube(rng, LineAxis(np.array([3.0, 1, 2]), d, 0.3), 0.1, arc=2.0)
    normals = normals * rng.choice([-1.0, 1.0], len(normals))[:, None]  # of either sign
    result = axis_of(sums_of(xyz, normals, np.array([3.0, 1, 2])))
    assert abs(result[:3] @ d) == pytest.approx(1.0, abs=1e-9)
    assert result[3] == pytest.approx(0.0, abs=1e-6)
    assert result[4] == pytest.approx(0.1, abs=1e-6)


def test_that_normal_lines_of_two_walls_miss_every_axis(rng):
    u, v = rng.uniform(0, 1, (2, 300))
    floor = np.stack([u, v, 0 * u], axis=1)
    wall = np.stack([u, 0 * u, v], axis=1)
    normals = np.repeat([[0.0, 0, 1], [0.0, 1, 0]], 300, axis=0)
    result = axis_of(sums_of(np.concatenate([floor, wall]), normals))
    assert abs(result[0]) == pytest.approx(1.0, abs=1e-9)
    assert result[3] > 0.3 * result[4]


def test_that_flat_and_unknown_and_few_points_tell_no_axis(rng):
    xyz = rng.uniform(0, 1, (50, 3))
    assert np.isnan(axis_of(sums_of(xyz, np.tile([0.0, 0, 1], (50, 1))))).all()
    assert sums_of(xyz, np.full((50, 3), np.nan))[0] == 0.0
    _, normals = tube(rng, LineAxis(np.zeros(3), np.eye(3)[0], 1.0), 0.1)
    assert np.isnan(axis_of(sums_of(xyz[:8], normals[:8]))).all()


@pytest.mark.filterwarnings("ignore:overflow encountered")  # of the hash, where it is plain Python
def test_that_the_axis_around_a_cell_is_that_of_it_and_its_neighbours(rng):
    cells = np.array([[5, 5, 5], [5, 5, 6], [6, 5, 5], [9, 9, 9]])
    keys = (cells[:, 0] * 20 + cells[:, 1]) * 20 + cells[:, 2]
    sums = rng.uniform(0, 1, (4, kernels.N_SUMS))
    parts = [tube(rng, LineAxis(np.zeros(3), np.eye(3)[0], 0.2), 0.1) for _ in cells]
    sums = np.array([sums_of(*part) for part in parts])
    found = np.empty((4, 5))
    kernels.axes_of_cells(keys, sums, table_of(keys), 20, 20, 0, 4, 0.02, 0.25, found)
    assert_allclose(found[0], axis_of(sums[:3].sum(axis=0)))
    assert_allclose(found[3], axis_of(sums[3]))
