"""LAZ and COPC by writers whose code is not the reader's; see tests/data/scans/README.md."""

import struct
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from pipecore import io
from pipecore.io import parts
from pipecore.io.formats import las
from pipecore.io.registry import identify
from pipecore.pipeline import detect
from pipecore.settings import Settings
from pipecore.tiling import detect_in_tiles
from pipecore.types import PointCloud

SCANS = Path(__file__).parents[2] / "data" / "scans"
COPC = "copclib.copc.laz", "converter.copc.laz"
ALL = (*COPC, "uneven.laz", "laszip.laz")
RADIUS, LENGTH = 0.060, 0.9
ALONG = np.array([0.8, 0.6, 0.0])
NOISE = 0.001


def table_of(cloud: PointCloud) -> np.ndarray:
    """All that is known of the points, in an order of their own."""
    assert cloud.intensity is not None
    assert cloud.classification is not None
    assert cloud.rgb is not None
    world = np.round(cloud.world(cloud.xyz.astype(np.float64)), 4)
    table = np.column_stack([world, cloud.intensity, cloud.classification, cloud.rgb])
    return table[np.lexsort(table.T[::-1])]


@pytest.mark.parametrize("name", ALL)
def test_that_all_writers_are_read_to_the_same_points(name):
    cloud = io.read(SCANS / name)
    assert len(cloud) == 7_000
    assert set(np.unique(cloud.classification)) == {2, 6}
    # Steps of the file; the origin, from which places are kept, may be another.
    assert_allclose(table_of(cloud), table_of(io.read(SCANS / ALL[-1])), atol=1.01e-4)


@pytest.mark.parametrize("name", COPC)
def test_that_the_octree_is_trusted_and_finds_a_box(name, rng):
    path = SCANS / name
    with identify(path).open(path) as source:
        assert source.within is not None
        bounds = source.bounds
    whole = io.read(path)
    assert len(io.read(path, box=bounds)) == len(whole)
    # Between the file's steps, so that nobody's rounding matters.
    size = bounds[1] - bounds[0]
    low = np.round(bounds[0] + rng.uniform([0.1, 0.1, -0.2], [0.3, 0.3, -0.1]) * size, 4) + 5e-5
    box = np.array([low, np.round(low + size * [0.6, 0.6, 1.0], 4) + 5e-5])
    expected = in_box(table_of(whole), box)
    assert 500 < len(expected) < 6_000
    assert_array_equal(table_of(io.read(path, box=box)), expected)


def in_box(table: np.ndarray, box: np.ndarray) -> np.ndarray:
    return table[((table[:, :3] >= box[0]) & (table[:, :3] <= box[1])).all(axis=1)]


def test_that_nodes_on_several_pages_and_uneven_chunks_are_told_from_each_other():
    n_chunks = {name: len(las.chunk_starts(SCANS / name)) - 1 for name in ALL}
    assert n_chunks["copclib.copc.laz"] > 20
    assert las.chunk_starts(SCANS / "uneven.laz") == [0, 2_000, 2_001, 2_778, 6_278, 7_000]


@pytest.mark.parametrize("name", ["uneven.laz", "laszip.laz"])
def test_that_chunks_are_found_in_a_file_that_was_written_without_going_back(name, tmp_path):
    # Then the place of the table of chunks stands at the end, and -1 where it should be.
    data = bytearray((SCANS / name).read_bytes())
    (start,) = struct.unpack_from("<I", data, 96)
    place = data[start : start + 8]
    data[start : start + 8] = struct.pack("<q", -1)
    path = tmp_path / "streamed.laz"
    path.write_bytes(data + place)
    assert las.chunk_starts(path) == las.chunk_starts(SCANS / name)
    assert_array_equal(io.read(path).xyz, io.read(SCANS / name).xyz)


@pytest.mark.parametrize("name", ALL)
def test_that_tiles_find_in_them_what_the_whole_shows(name, monkeypatch):
    monkeypatch.setattr(parts, "PART_POINTS", 1_000)
    path = SCANS / name
    cloud = io.read(path)
    expected = detect(cloud, Settings())
    (pipe,) = expected.elements
    # 5 standard deviations of the mean of its 4,000 points, and what thinning adds.
    assert pipe.radius == pytest.approx(RADIUS, abs=5 * NOISE / np.sqrt(4_000) + 5e-5)
    assert abs((pipe.axis.at(pipe.axis.length) - pipe.axis.at(0.0)) @ ALONG) == pytest.approx(
        LENGTH, abs=0.02
    )
    settings = Settings().replace({"tiling.memory_gib": 0.5, "tiling.tile_mpoints": 0.002})
    with detect_in_tiles([path], settings) as (tiled_cloud, found):
        assert_array_equal(tiled_cloud.xyz, cloud.xyz)
        assert_array_equal(found.element_id, expected.element_id)
        assert_array_equal(found.segment_id, expected.segment_id)
        assert_array_equal(found.deviation, expected.deviation)
        assert [e.radius for e in found.elements] == [pipe.radius]
