"""Slabs, quantiles, the store and the engine, each by itself."""

import errno
import itertools
import os
import time

import numpy as np
import psutil
import pytest
from numpy.testing import assert_array_equal

from pipecore import io
from pipecore.errors import WriteError
from pipecore.geometry import LineAxis
from pipecore.io import mapped
from pipecore.io.mapped import drop_pages
from pipecore.progress import NoProgress
from pipecore.settings import Settings, TilingSettings
from pipecore.surface import WIDEST_NEIGHBOURHOOD, average_voxels, fit_planes
from pipecore.tiling import detect_in_tiles, estimate_need, memory
from pipecore.tiling.memory import (
    BASE_BYTES,
    BYTES_PER_POINT_UNTILED,
    GIB,
    keeping_within,
    tile_bytes,
)
from pipecore.tiling.quantile import quantile
from pipecore.tiling.slabs import MARGIN_PLANES, parts_of, slab_bounds
from pipecore.tiling.store import temporary_store
from pipecore.types import PointCloud
from tests.core.shapes import cloud_of, parents, plane, tube


def pipe_cloud(rng) -> PointCloud:
    axis = LineAxis(np.array([0.1, 0.2, 0.5]), np.array([0.8, 0.6, 0.0]), 0.8)
    pipe = tube(rng, axis, 0.06, spacing=0.008, noise=0.001)
    floor = plane(rng, np.zeros(3), [1, 0, 0], [0, 1, 0], 0.012, 0.001)
    return cloud_of(pipe, floor)


@pytest.fixture
def scanned(rng, tmp_path):
    path = tmp_path / "scan" / "pipe.laz"
    path.parent.mkdir()
    io.write_laz(path, pipe_cloud(rng))
    return path


def test_that_a_slab_with_its_margin_has_the_normals_of_the_whole(rng):
    downsampled = average_voxels(pipe_cloud(rng).xyz, 0.009)
    whole = fit_planes(downsampled.xyz, downsampled.voxel)
    x = downsampled.xyz[:, 0]
    low, high = np.quantile(x, np.sort(rng.random(2)))
    margin = WIDEST_NEIGHBOURHOOD * downsampled.voxel
    near = (x >= low - margin) & (x <= high + margin)
    own = (x >= low) & (x <= high)
    for part, all_values in zip(
        fit_planes(downsampled.xyz[near], downsampled.voxel), whole, strict=True
    ):
        assert_array_equal(part[own[near]], all_values[own])


def test_that_the_voxels_of_a_part_are_those_of_the_whole(rng):
    xyz = pipe_cloud(rng).xyz
    edge = 0.011
    whole = average_voxels(xyz, edge)
    part = np.floor(xyz[:, 0].astype(np.float64) / edge) < 30
    assert_array_equal(
        average_voxels(xyz[part], edge).xyz,
        whole.xyz[np.unique(parents(whole.full_resolution_points)[part])],
    )


@pytest.mark.parametrize("n", [1, 2, 7, 5_000])
@pytest.mark.parametrize("q", [0.0, 0.25, 0.5, 0.9, 1.0])
def test_that_a_quantile_in_blocks_is_numpys_to_the_last_bit(rng, n, q):
    # Heavy tails and ties, so that ranges narrow slowly and ranks share values.
    values = np.concatenate([rng.standard_cauchy(n), np.round(rng.normal(size=n), 1)])
    values[rng.random(len(values)) < 0.1] = np.nan
    values[0] = 1.0
    assert quantile(values, q, "normals", NoProgress(), few=10) == np.nanquantile(values, q)


def test_that_a_quantile_of_nothing_is_not_a_number():
    assert np.isnan(quantile(np.full(5, np.nan), 0.5, "normals", NoProgress()))
    assert np.isnan(quantile(np.empty(0), 0.5, "normals", NoProgress()))


def test_that_slabs_with_their_margins_hold_no_more_than_they_may(rng):
    planes = np.unique(rng.integers(-300, 3_000, 2_500))
    counts = rng.integers(1, 50, len(planes))
    per_slab = 5_000
    firsts = slab_bounds(planes, counts, per_slab)
    assert firsts[0] == 0
    assert len(firsts) > 5
    ends = [*firsts[1:], len(planes)]
    for first, end in zip(firsts, ends, strict=True):
        low, high = planes[first] - MARGIN_PLANES, planes[end - 1] + MARGIN_PLANES
        held = counts[(planes >= low) & (planes <= high)].sum()
        assert held <= per_slab or planes[end - 1] - planes[first] < MARGIN_PLANES


def test_that_no_slab_is_thinner_than_its_margin():
    firsts = slab_bounds(np.arange(100), np.full(100, 1_000), 1)
    assert (np.diff(firsts) == MARGIN_PLANES).all()


@pytest.mark.parametrize("n", [1, 999, 10_000_001])
def test_that_parts_cover_all_points_once(n):
    parts = parts_of(n)
    assert parts[0][0] == 0
    assert parts[-1][1] == n
    assert all(a[1] == b[0] for a, b in itertools.pairwise(parts))


def test_that_mapped_arrays_keep_what_is_written_when_their_memory_is_given_back(tmp_path):
    with temporary_store(tmp_path) as store:
        array = store.create("numbers", (1000, 3), np.float64)
        assert (array == 0).all()
        array[:] = np.arange(3000).reshape(1000, 3)
        drop_pages()
        assert_array_equal(array, np.arange(3000).reshape(1000, 3))
        assert_array_equal(store.open("numbers"), array)
        assert len(store.create("nothing", (0, 3), np.float32)) == 0
    assert not list(tmp_path.iterdir())


def test_that_memory_of_files_is_given_back_near_the_limit(tmp_path):
    n_bytes = 64 * 2**20
    process = psutil.Process()
    with temporary_store(tmp_path) as store:
        array = store.create("numbers", (n_bytes,), np.uint8)
        array[:] = 1
        before = process.memory_info().rss
        with keeping_within(before - n_bytes // 4):
            for _ in range(200):
                if before - process.memory_info().rss > 0.8 * n_bytes:
                    break
                time.sleep(0.05)
            else:
                pytest.fail("the memory was kept")
        assert (array == 1).all()


def test_that_memory_is_left_alone_far_from_the_limit(tmp_path, monkeypatch):
    monkeypatch.setattr(memory, "POLL_SECONDS", 0.01)
    monkeypatch.setattr(memory, "drop_pages", lambda: pytest.fail("it was far"))
    with keeping_within(2**50):
        time.sleep(0.1)


def test_that_a_full_disk_is_told_before_anything_is_lost(scanned, tmp_path, monkeypatch):
    taken = 0

    def fallocate(descriptor: int, start: int, n_bytes: int) -> None:
        nonlocal taken
        taken += n_bytes
        if taken > 300_000:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        os.ftruncate(descriptor, start + n_bytes)

    monkeypatch.setattr(mapped.os, "posix_fallocate", fallocate, raising=False)
    room = tmp_path / "room"
    room.mkdir()
    with (
        pytest.raises(WriteError, match=r"The disk is full: in .*room.*GiB are free"),
        detect_in_tiles([scanned], folder=room),
    ):
        pytest.fail("there was room")
    assert not list(room.iterdir())


def test_that_a_folder_that_is_not_there_is_told(scanned, tmp_path):
    settings = Settings(tiling=TilingSettings(folder=str(tmp_path / "nowhere")))
    with pytest.raises(WriteError, match="nowhere"), detect_in_tiles([scanned], settings):
        pytest.fail("there is no such folder")


def test_that_the_need_is_told_from_the_headers_alone(scanned):
    n = len(io.read(scanned))
    need = estimate_need([scanned, scanned], TilingSettings(memory_gib=0.25))
    assert need.n_points == 2 * n
    assert need.limit == 0.25 * GIB
    assert need.bytes_in_one_piece == BASE_BYTES + 2 * n * BYTES_PER_POINT_UNTILED
    assert need.is_too_large
    assert not estimate_need([scanned], TilingSettings(memory_gib=4.0)).is_too_large
    assert not estimate_need([scanned], TilingSettings()).is_too_large


def test_that_tiles_of_several_workers_share_the_limit():
    alone, shared = (tile_bytes(10**7, 4 * GIB, n) for n in (1, 4))
    assert alone == pytest.approx(4 * shared, rel=1e-6)
    assert BASE_BYTES + 4 * shared < 4 * GIB
