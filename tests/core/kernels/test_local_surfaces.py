"""The parts of the fits of local planes, against plain numpy."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from pipecore._kernels import local_surfaces as kernels
from pipecore.surface.sorting import CellGrid

# Hashing wraps around on purpose, which plain numpy warns of.
pytestmark = [pytest.mark.kernels, pytest.mark.filterwarnings("ignore:overflow encountered")]


def test_that_copied_ranges_are_relative_to_a_point_and_filled_up_by_what_is_far_off(rng):
    xyz = rng.uniform(0, 1, (60, 3))
    first, last = np.array([3, 20, 40]), np.array([10, 31, 40])
    near = np.empty((3, 64), np.float32)
    n = kernels.copy_ranges(xyz, 5, 3, first, last, near)
    rows = np.concatenate([np.arange(a, b) for a, b in zip(first, last, strict=True)])
    assert n % kernels.LANES == 0
    assert n - kernels.LANES < len(rows) <= n
    assert_allclose(near[:, : len(rows)].T, xyz[rows] - xyz[5], atol=1e-7)
    assert (near[:, len(rows) : n] == kernels.FAR_OFF).all()
    assert kernels.copy_ranges(xyz, 5, 0, first, last, near) == 0


@pytest.mark.parametrize("reach", [1, 2, 3, 4])
def test_that_listed_ranges_hold_the_points_of_the_cells_around(rng, reach):
    xyz = rng.uniform(0, 1, (200, 3))
    grid = CellGrid.build(xyz, 0.17)
    cells = np.floor(xyz[grid.order] / 0.17).astype(int)
    begins = np.zeros(164, np.int64)
    first, last = np.empty(81, np.int64), np.empty(81, np.int64)
    for c in range(len(grid.cell_keys)):
        n = kernels.list_ranges(c, reach, grid.rows, begins, first, last)
        found = np.concatenate([np.arange(first[k], last[k]) for k in range(n)])
        here = cells[grid.cell_starts[c]]
        assert n <= (2 * reach + 1) ** 2
        assert_array_equal(found, np.flatnonzero(np.abs(cells - here).max(axis=1) <= reach))


def test_that_solved_planes_are_those_of_the_points(rng):
    clouds = [rng.normal(size=(n, 3)) * [1.0, 0.6, 0.02] + 0.1 for n in (7, 20, 50)]
    sums = np.empty((kernels.N_SUMS, 3))
    for k, xyz in enumerate(clouds):
        x, y, z = xyz.T
        sums[:, k] = [
            len(xyz), x.sum(), y.sum(), z.sum(), x @ x, x @ y, x @ z, y @ y, y @ z, z @ z,
        ]  # fmt: skip
    reaches, planes = np.array([0.5, 1.0, 2.0]), np.empty((5, 3))
    kernels.solve_planes(3, sums, reaches, planes)
    normals, residuals, spacings = np.full((5, 3), np.nan), np.full(5, np.nan), np.full(5, np.nan)
    places = np.array([4, 0, 2])
    kernels.write_planes(3, planes, places, normals, residuals, spacings)
    for k, xyz in enumerate(clouds):
        n = len(xyz)
        values, vectors = np.linalg.eigh(np.cov(xyz.T, bias=True))
        assert abs(normals[places[k]] @ vectors[:, 0]) == pytest.approx(1.0, abs=1e-9)
        assert residuals[places[k]] == pytest.approx(np.sqrt(values[0] * n / (n - 3)), rel=1e-6)
        # As many points as lie in a disc of the reach, one to a square of the spacing.
        assert np.pi * reaches[k] ** 2 / spacings[places[k]] ** 2 == pytest.approx(n)
    # Nothing is written to the places of others.
    assert np.isnan(normals[[1, 3]]).all()
    assert np.isnan([*residuals[[1, 3]], *spacings[[1, 3]]]).all()


def test_that_points_on_one_place_have_no_normal():
    sums, planes = np.zeros((kernels.N_SUMS, 1)), np.empty((5, 1))
    sums[0] = 9.0
    kernels.solve_planes(1, sums, np.array([0.5]), planes)
    assert np.isnan(planes[:3]).all()
    assert planes[3] == 0.0
