"""Cubes, their look-up, and what neighbours tell, against dictionaries and brute force."""

from collections import defaultdict

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial import cKDTree

from pipecore._kernels import local_surfaces, nearest_neighbours, voxel_hash
from pipecore._kernels.grouping import argsort_keys, group_by_label, group_from, group_large
from pipecore.surface.grid import GridFrame, VoxelCounter, empty_table, table_of
from pipecore.surface.sorting import CellGrid

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
    frame = GridFrame.of(xyz, edge)
    ids = np.empty(len(xyz), np.int32)
    # A crowded table makes keys collide.
    table = voxel_hash.HashTable(np.full(256, voxel_hash.EMPTY), np.empty(256, np.int32))
    keys = np.empty(200, np.int64)
    n = 0
    for start, stop in ((0, 70), (70, 150)):
        reached, n = voxel_hash.number_voxels(xyz, start, stop, frame.numbers, table, n, keys, ids)
        assert reached == stop
    cells = cells_of(xyz, edge)
    assert_array_equal(keys[ids], frame.keys(xyz))
    assert n == len(cells)
    assert {tuple(np.flatnonzero(ids == k)) for k in range(n)} == set(map(tuple, cells.values()))


def test_that_a_full_table_tells_where_to_go_on(rng):
    xyz, edge = rng.normal(size=(50, 3)), 0.1
    frame = GridFrame.of(xyz, edge)
    ids, keys = np.empty(50, np.int32), np.empty(50, np.int64)
    table = empty_table(8)
    reached, n = voxel_hash.number_voxels(xyz, 0, 50, frame.numbers, table, 0, keys, ids)
    assert n == len(table[0]) // 2
    assert len(cells_of(xyz[:reached], edge)) == n
    assert len(cells_of(xyz[: reached + 1], edge)) == n + 1


def test_that_a_counter_that_grows_numbers_every_cube_once(rng):
    xyz, edge = rng.normal(size=(400, 3)), 0.5
    frame = GridFrame.of(xyz, edge)
    counter = VoxelCounter(frame, room=4)
    ids = np.full(400, -1, np.int32)
    for start, stop in ((0, 150), (150, 400)):
        counter.add(xyz, start, stop, ids)
    assert counter.n_cells == len(cells_of(xyz, edge))
    assert_array_equal(counter.keys[ids], frame.keys(xyz))


def test_that_a_key_is_found_where_it_was_put_and_an_absent_one_nowhere(rng):
    keys = rng.choice(2**40, size=60, replace=False)
    table = table_keys, table_ids = empty_table(30)
    assert len(table_keys) == 64
    voxel_hash.fill_table(keys[:50], table)
    for i, key in enumerate(keys):
        slot = voxel_hash.slot_of(key, table_keys, np.int64(63))
        if i < 50:
            assert (table_keys[slot], table_ids[slot]) == (key, i)
        else:
            assert table_keys[slot] == voxel_hash.EMPTY


def test_that_the_sorted_grid_holds_every_point_in_its_cell(rng):
    xyz, edge = rng.normal(size=(80, 3)), 0.5
    grid = CellGrid.build(xyz, edge)
    keys = GridFrame.of(xyz, edge).keys(xyz[grid.order])
    assert (np.diff(keys) >= 0).all()
    assert_array_equal(np.repeat(grid.cell_keys, np.diff(grid.cell_starts)), keys)
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
    for start, stop in ((0, 7), (7, len(grid.cell_keys))):
        local_surfaces.fit_planes(
            sorted_xyz, grid.rows, radius, least_neighbours, start, stop, np.arange(n),
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
        residual = np.sqrt(values[0] * len(near) / (len(near) - 3))
        assert residuals[i] == pytest.approx(residual, rel=1e-5, abs=1e-5)
        assert spacings[i] == pytest.approx(np.sqrt(np.pi * (reach * radius) ** 2 / len(near)))
    assert {1, None} < set(reaches)
    assert max(r or 0 for r in reaches) >= 2


def test_that_grouping_lists_the_items_of_each_label_in_order(rng):
    labels = rng.choice([0, 2, 3, 6], size=50).astype(np.int32)
    members, starts = group_by_label(labels, 8)
    for k in range(8):
        assert list(members[starts[k] : starts[k + 1]]) == [
            i for i, label in enumerate(labels) if label == k
        ]


def test_that_grouping_from_a_label_on_leaves_out_the_smaller_ones(rng):
    labels = rng.choice([-9, -2, 0, 3], size=50).astype(np.int32)
    members, starts = group_from(labels, -2, 6)
    for k in range(6):
        assert list(members[starts[k] : starts[k + 1]]) == list(np.flatnonzero(labels == k - 2))


def test_that_only_large_groups_are_kept_in_order_of_their_label(rng):
    labels = rng.permutation(np.repeat([5, 1, 4, 0], [6, 2, 9, 3]))
    members, starts = group_large(labels, 7, 3)
    groups = [list(part) for part in np.split(members, starts[1:-1])]
    assert groups == [list(np.flatnonzero(labels == k)) for k in (0, 4, 5)]
    assert len(group_large(labels, 7, 20)[0]) == 0


@pytest.mark.parametrize("largest", [1, 700, 2**40])
def test_that_the_radix_sort_is_stable(rng, largest):
    keys = rng.integers(0, largest, size=120)
    keys[::3] = keys[0]
    assert_array_equal(argsort_keys(keys), np.argsort(keys, kind="stable"))


def test_that_a_hash_of_places_is_that_of_the_coordinates_bits(rng):
    xyz = rng.normal(size=(20, 3)).astype(np.float32)
    hashes = np.empty(12, np.uint64)
    nearest_neighbours.hash_places(xyz, 5, 17, hashes)
    factors = (0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9)
    for row, p in zip(hashes, xyz[5:17].astype(np.float64), strict=True):
        bits = map(int, p.view(np.uint64))
        mixed = sum(b * f for b, f in zip(bits, factors, strict=True)) % 2**64
        assert row == (mixed ^ (mixed >> 31)) * factors[0] % 2**64


def test_that_places_are_drawn_by_their_hashes(rng):
    xyz = rng.normal(size=(3000, 3))
    hashes = np.empty(2900, np.uint64)
    nearest_neighbours.hash_places(xyz, 50, 2950, hashes)
    bound, drawn = np.sort(hashes)[99], np.empty(2900, np.int64)
    n = nearest_neighbours.draw_places(xyz, 50, 2950, bound, drawn)
    assert_array_equal(drawn[:n], 50 + np.flatnonzero(hashes <= bound))
    assert n == 100


def test_that_the_nearest_in_the_cells_are_those_of_a_tree(rng):
    xyz, edge, k = rng.uniform(0, 1, (90, 3)), 0.2, 4
    sample = xyz[::6].copy()
    frame = GridFrame.of(xyz, edge)
    steps = np.stack(np.meshgrid(*[[-1, 0, 1]] * 3), axis=-1).reshape(-1, 3)
    around = (steps[:, 0] * frame.n_y + steps[:, 1]) * frame.n_z + steps[:, 2]
    marked = np.unique(frame.keys(sample)[:, None] + around)
    table = table_of(marked)
    found, cells = np.empty(90, np.int64), np.empty(90, np.int32)
    n = nearest_neighbours.collect_marked(xyz, 0, 90, frame.numbers, table, found, cells)
    assert {*found[:n]} == {*np.flatnonzero(np.isin(frame.keys(xyz), marked))}
    order, starts = group_by_label(cells[:n], len(marked))
    reach = np.empty(len(sample))
    nearest_neighbours.nearest_in_cells(
        xyz, sample, frame.numbers, table, found[:n][order], starts, k, reach
    )
    true = cKDTree(xyz).query(sample, k)[0][:, -1]
    assert_allclose(reach, np.where(true <= edge, true, np.nan))
    assert np.isfinite(reach).sum() > 0


def test_that_sums_are_those_of_the_points_within_reach(rng):
    xyz, reach = rng.uniform(0, 1, (200, 3)), 0.4
    xyz[7] = [0.4, 0.5, 0.6]
    near = xyz[np.linalg.norm(xyz - xyz[7], axis=1) <= reach] - xyz[7]
    products = near.T @ near
    expected = [len(near), *near.sum(axis=0), *products[np.triu_indices(3)]]
    assert len(near) > 5
    columns, place = xyz.T.astype(np.float32), xyz[7].astype(np.float32)
    sums = np.full(10, np.nan)
    local_surfaces.sums_within(*columns, *place, np.float32(reach**2), sums)
    assert_allclose(sums, expected, atol=1e-5)
    local_surfaces.sum_ranges(xyz, 7, 2, np.array([0, 90]), np.array([90, 200]), reach, sums)
    assert_allclose(sums, expected, atol=1e-12)


def test_that_the_first_key_from_a_place_on_is_found(rng):
    keys = np.unique(rng.integers(0, 3000, 400))
    for begin in (0, 3, 200, len(keys) - 1, len(keys)):
        for low in (0, *rng.integers(0, 3100, 30), 4000):
            expected = max(begin, np.searchsorted(keys, low))
            assert local_surfaces.first_from(keys, begin, low) == expected
