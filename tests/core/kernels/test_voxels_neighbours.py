"""Cubes, their look-up, and what neighbours tell, against dictionaries and brute force."""

from collections import defaultdict

import numpy as np
import pytest
from numpy.testing import assert_allclose

from pipecore._kernels import neighbours, voxels
from pipecore._kernels.grouping import group_by_label
from pipecore.surface.grid import CellGrid, cell_numbers, empty_table
from tests.core.shapes import unit_rows

# Hashing and random numbers wrap around on purpose, which plain numpy warns of.
pytestmark = [pytest.mark.kernels, pytest.mark.filterwarnings("ignore:overflow encountered")]


def cells_of(xyz, edge):
    """Points by cube: a dictionary from whole coordinates to indices."""
    cells = defaultdict(list)
    for i, p in enumerate(xyz):
        cells[tuple(np.floor(p / edge).astype(int))].append(i)
    return cells


def test_that_points_share_a_number_as_they_share_a_cube(rng):
    xyz, edge = rng.normal(size=(150, 3)), 0.7
    keys, *_ = cell_numbers(xyz, edge)
    ids = np.empty(len(xyz), np.int32)
    # A crowded table makes keys collide.
    table_keys, table_ids = np.full(256, voxels.EMPTY), np.empty(256, np.int32)
    n = voxels.number_voxels(keys[:70], table_keys, table_ids, ids[:70], 0)
    n = voxels.number_voxels(keys[70:], table_keys, table_ids, ids[70:], n)
    cells = cells_of(xyz, edge)
    assert n == len(cells)
    assert {tuple(np.flatnonzero(ids == k)) for k in range(n)} == set(map(tuple, cells.values()))

    sums, counts = np.zeros((n, 3), np.int64), np.zeros(n, np.int64)
    voxels.sum_voxels(xyz, ids, sums, counts)
    for members in cells.values():
        k = ids[members[0]]
        assert counts[k] == len(members)
        mean = sums[k] / (1e6 * counts[k])
        assert_allclose(mean, xyz[members].mean(axis=0), atol=0.6e-6)


def test_that_a_key_is_found_where_it_was_put_and_an_absent_one_nowhere(rng):
    keys = rng.choice(2**40, size=60, replace=False)
    table_keys, table_ids = empty_table(30)
    assert len(table_keys) == 64
    voxels.fill_table(keys[:50], table_keys, table_ids)
    for i, key in enumerate(keys):
        slot = voxels.slot_of(key, table_keys, np.int64(63))
        if i < 50:
            assert (table_keys[slot], table_ids[slot]) == (key, i)
        else:
            assert table_keys[slot] == voxels.EMPTY


def test_that_the_sorted_grid_holds_every_point_in_its_cell(rng):
    xyz, edge = rng.normal(size=(80, 3)), 0.5
    grid = CellGrid.build(xyz, edge)
    first = np.floor(xyz.min(axis=0) / edge) - 4
    assert_allclose(grid.cells, np.floor(xyz[grid.order] / edge) - first)
    assert sorted(grid.order) == list(range(80))
    found = {
        tuple(sorted(grid.order[a:b]))
        for a, b in zip(grid.cell_starts[:-1], grid.cell_starts[1:], strict=True)
    }
    assert found == {tuple(v) for v in cells_of(xyz, edge).values()}


def test_that_planes_are_those_of_all_points_within_reach(rng):
    # A dense sheet, a sparse one that needs a wider reach, and one point all alone.
    dense = rng.uniform(0, 1, (60, 3)) * [1.0, 1.0, 0.05]
    sparse = rng.uniform(0, 1, (25, 3)) * [2.5, 0.1, 2.5] + [0.0, 4.0, 0.0]
    xyz = np.concatenate([dense, sparse, [[20.0, 20.0, 20.0]]])
    radius, least_neighbours = 0.3, 7
    grid = CellGrid.build(xyz, radius)
    sorted_xyz = xyz[grid.order]
    n = len(xyz)
    normals, residuals, spacings = np.empty((n, 3)), np.empty(n), np.empty(n)
    for start, stop in ((0, 40), (40, n)):
        neighbours.fit_planes(
            sorted_xyz, *grid.lookup, radius, least_neighbours, start, stop,
            normals, residuals, spacings,
        )  # fmt: skip
    reaches = []
    for i, p in enumerate(sorted_xyz):
        distance = np.linalg.norm(xyz - p, axis=1)
        steps = (1, 1.25, 1.5, 1.75, 2, 2.5, 3, 4)
        reach = next((r for r in steps if (distance <= r * radius).sum() >= 7), None)
        reaches.append(reach)
        if reach is None:
            assert np.isnan([*normals[i], residuals[i], spacings[i]]).all()
            continue
        near = xyz[distance <= reach * radius]
        values, vectors = np.linalg.eigh(np.cov(near.T, bias=True))
        assert abs(normals[i] @ vectors[:, 0]) == pytest.approx(1.0, abs=1e-6)
        assert residuals[i] == pytest.approx(np.sqrt(values[0] * len(near) / (len(near) - 3)))
        assert spacings[i] == pytest.approx(np.sqrt(np.pi * (reach * radius) ** 2 / len(near)))
    assert {1, None} < set(reaches)
    assert max(r or 0 for r in reaches) >= 2


def test_that_local_axes_are_those_of_all_normals_within_reach(rng):
    xyz = rng.uniform(0, 1, (80, 3))
    normals = unit_rows(rng.normal(size=(80, 3)) * [1.0, 0.7, 0.2])
    normals[::9] = np.nan
    radius = 0.33
    grid = CellGrid.build(xyz, radius)
    xyz, normals = xyz[grid.order], normals[grid.order]
    sample = np.arange(0, 80, 2)
    axes, spreads = np.empty((40, 3)), np.empty((40, 3))
    neighbours.fit_local_axes(xyz, normals, *grid.lookup, radius, sample, 0, 40, axes, spreads)
    n_known = 0
    for k, i in enumerate(sample):
        near = (np.linalg.norm(xyz - xyz[i], axis=1) <= radius) & ~np.isnan(normals[:, 0])
        if near.sum() < 6:
            assert np.isnan(axes[k]).all()
            continue
        n_known += 1
        values, vectors = np.linalg.eigh(normals[near].T @ normals[near] / near.sum())
        assert_allclose(spreads[k], values, atol=1e-12)
        assert abs(axes[k] @ vectors[:, 0]) == pytest.approx(1.0, abs=1e-6)
    assert n_known > 10


def test_that_grouping_lists_the_items_of_each_label_in_order(rng):
    labels = rng.choice([0, 2, 3, 6], size=50).astype(np.int32)
    members, starts = group_by_label(labels, 8)
    for k in range(8):
        assert list(members[starts[k] : starts[k + 1]]) == [
            i for i, label in enumerate(labels) if label == k
        ]
