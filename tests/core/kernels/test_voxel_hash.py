"""Numbers of cubes, and their look-up, against whole numbers of Python."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from pipecore._kernels.voxel_hash import VoxelFrame, hash_of, rename_voxels, voxel_key

# Hashing wraps around on purpose, which plain numpy warns of.
pytestmark = [pytest.mark.kernels, pytest.mark.filterwarnings("ignore:overflow encountered")]


def test_that_a_cube_is_numbered_row_by_row_from_the_first(rng):
    frame = VoxelFrame(np.array([-8, -9, -7]), 0.3, 17, 19)
    for x, y, z in rng.uniform(-2, 2, (60, 3)):
        ix, iy, iz = (int(np.floor(v / 0.3)) for v in (x, y, z))
        assert voxel_key(x, y, z, frame) == ((ix + 8) * 17 + iy + 9) * 19 + iz + 7


def test_that_cubes_begin_at_multiples_of_their_edge():
    frame = VoxelFrame(np.array([-2, -2, -2]), 0.5, 10, 10)
    assert voxel_key(0.0, 0.0, 0.0, frame) == 222
    assert voxel_key(-1e-12, 0.0, 0.0, frame) == 122
    assert voxel_key(0.0, 0.5, 0.5, frame) == 233


def test_that_a_hash_is_the_product_modulo_the_word():
    for key in (0, 1, 2**40 + 17, 2**62):
        assert int(hash_of(np.int64(key))) == key * 0x9E3779B97F4A7C15 % 2**64


def test_that_the_upper_bits_spread_neighbouring_keys():
    slots = {int(hash_of(np.int64(key)) >> np.uint64(20)) & 1023 for key in range(512)}
    assert len(slots) > 350


def test_that_only_the_points_of_the_range_get_new_numbers():
    ids = np.array([2, 0, 1, 2, 0])
    rename_voxels(ids, 1, 4, np.array([10, 11, 12]))
    assert_array_equal(ids, [2, 10, 11, 12, 0])
    rename_voxels(ids, 2, 2, np.array([7, 7, 7]))
    assert_array_equal(ids, [2, 10, 11, 12, 0])
