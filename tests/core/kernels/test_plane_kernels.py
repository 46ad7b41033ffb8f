"""Flat cells and their patches, against plain numpy."""

import itertools

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.sparse.csgraph import connected_components

from pipecore._kernels import plane_patches
from pipecore.surface.grid import GridFrame
from tests.core.shapes import unit_rows

pytestmark = pytest.mark.kernels

EDGE = 0.5
COS, OFF = np.cos(np.deg2rad(30.0)), 0.3


def crowd(rng, n=250):
    """Points with normals about one direction in a small, crowded grid."""
    xyz = rng.uniform(0.0, 3.0, (n, 3)) * [1.0, 1.0, 0.4]
    normals = unit_rows(np.array([0.2, 0.3, 1.0]) + 0.15 * rng.normal(size=(n, 3)))
    normals[::17] = np.nan
    return xyz, normals


@pytest.fixture
def grid(rng):
    """Cells with their keys, sums and what is told of them, and the points behind."""
    xyz, normals = crowd(rng)
    frame = GridFrame.of(xyz, EDGE)
    keys, ids = np.unique(frame.keys(xyz), return_inverse=True)
    cells = frame.cells_of_keys(keys)
    assert_array_equal(frame.keys_of_cells(cells), keys)
    sums = np.zeros((len(keys), plane_patches.N_SUMS), np.int64)
    plane_patches.add_to_cells(xyz, normals, ids, EDGE, sums)
    is_flat = np.empty(len(keys), bool)
    mean_normals, means = np.empty((2, len(keys), 3))
    plane_patches.describe_cells(
        keys, cells, sums, frame.n_y, frame.n_z, 8, 0.03, 0.015, is_flat, mean_normals, means
    )
    size = frame.n_y, frame.n_z
    return xyz, normals, ids, keys, cells, sums, size, is_flat, mean_normals, means


def are_neighbours(cells):
    return np.abs(cells[:, None] - cells).max(axis=2) <= 1


def test_that_places_are_flat_as_the_eigenvalues_of_their_normals_say(grid):
    xyz, normals, ids, _, cells, sums, _, is_flat, mean_normals, means = grid
    known = ~np.isnan(normals[:, 0])
    near = are_neighbours(cells)
    for c in range(len(cells)):
        own = known & (ids == c)
        assert sums[c, 0] == own.sum()
        around = normals[known & near[c][ids]]
        flat = False
        if own.any():
            assert_allclose(means[c] * EDGE, xyz[own].mean(axis=0), atol=1e-5)
            values, vectors = np.linalg.eigh(around.T @ around / max(len(around), 1))
            flat = len(around) >= 8 and values[1] <= 0.03 and values[1] - values[0] <= 0.015
        assert is_flat[c] == flat
        if flat:
            assert abs(mean_normals[c] @ vectors[:, 2]) == pytest.approx(1.0, abs=1e-6)
    assert 0 < is_flat.sum() < len(cells)


@pytest.mark.parametrize("block", [0, 3])
def test_that_patches_are_the_components_of_flat_cells_that_go_on(grid, block):
    _, _, _, keys, cells, _, size, is_flat, normals, means = grid
    roots = np.arange(len(keys), dtype=np.int32)
    plane_patches.unite_flat(keys, cells, *size, block, 1, is_flat, normals, means, COS, OFF, roots)
    joined = are_neighbours(cells) & is_flat & is_flat[:, None]
    for i, j in itertools.combinations(range(len(cells)), 2):
        chord = means[j] - means[i]
        off = max(abs(chord @ normals[i]), abs(chord @ normals[j]))
        same = block == 0 or ((cells[i] - 1) // block == (cells[j] - 1) // block).all()
        goes_on = same and abs(normals[i] @ normals[j]) >= COS and off <= OFF
        joined[i, j] = joined[j, i] = joined[i, j] and goes_on
    _, label = connected_components(joined)
    # The same partition: each root is one component.
    assert_array_equal(roots[:, None] == roots, label[:, None] == label)


def test_that_cells_are_inner_where_all_around_are_of_planes(rng, grid):
    _, _, _, keys, cells, sums, size, *_ = grid
    is_plane = rng.random(len(keys)) < 0.97
    is_inner = np.empty(len(keys), bool)
    plane_patches.mark_inner(keys, *size, is_plane, sums[:, 0].copy(), is_inner)
    other = (sums[:, 0] > 0) & ~is_plane
    assert_array_equal(is_inner, is_plane & ~(are_neighbours(cells) & other).any(axis=1))


@pytest.mark.parametrize("bend", [0.0, 0.5, 2.0])
def test_that_a_patch_is_plane_if_it_bends_little_for_its_width(bend):
    x, y = (k.ravel() - 4.5 for k in np.indices((10, 10)).astype(float))
    # The cylinder of this radius would have a ratio of 1.
    max_ratio, width2 = 0.01, (x**2).mean()
    z = x**2 - width2
    z *= bend * max_ratio * width2 / np.sqrt((z**2).mean())
    means = np.stack([x, y, z], axis=1)
    is_plane = np.zeros(100, bool)
    roots = np.zeros(100, np.int32)
    plane_patches.mark_planes(means, np.ones(100, bool), roots, max_ratio, is_plane)
    assert is_plane.all() == (bend < 1.0)
    narrow = (y > 0) & (y < 3)
    is_plane[:] = False
    plane_patches.mark_planes(means, narrow, np.full(100, np.flatnonzero(narrow)[0]), 1.0, is_plane)
    assert not is_plane.any()
