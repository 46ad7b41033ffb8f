"""LAS and LAZ read in parts by their chunk tables, against reading them in order."""

import itertools
from dataclasses import fields
from pathlib import Path

import laspy
import lazrs
import numpy as np
import pytest
from laspy._compression import lazrsbackend
from numpy.testing import assert_array_equal

from pipecore import io
from pipecore.errors import ReadError
from pipecore.io import parts
from pipecore.io.formats import las
from pipecore.progress import NoProgress
from pipecore.settings import InputSettings, LengthUnit
from pipecore.tiling.engine import start_engine
from pipecore.tiling.parallel_reading import read_into_store
from pipecore.tiling.store import temporary_store
from pipecore.types import PointCloud
from tests.core.io.writers import make_points, write_las


class UnequalChunks(lazrsbackend.LazrsPointWriter):
    """Ends a chunk with each call, as writers of COPC do for each node of their octree."""

    def __init__(self, dest, point_format, parallel):
        super().__init__(dest, point_format, False)
        self.vlr = lazrs.LazVlr.new_for_compression(
            point_format.id, point_format.num_extra_bytes, True
        )

    def write_points(self, points):
        super().write_points(points)
        self.compressor.finish_current_chunk()


def write_unequal(path: Path, source: Path, sizes: list[int]) -> None:
    """Write a LAS file's points anew as LAZ with chunks of these sizes."""
    read = laspy.read(source)
    with laspy.open(path, "w", header=read.header, laz_backend=laspy.LazBackend.Lazrs) as writer:
        for start, stop in zip(np.cumsum([0, *sizes[:-1]]), np.cumsum(sizes), strict=True):
            writer.write_points(read.points[start:stop])


@pytest.fixture(params=["las", "laz", "unequal chunks"])
def scan(request, rng, tmp_path, monkeypatch):
    """A file of 5,000 points, read in parts of a thousand or more."""
    monkeypatch.setattr(parts, "PART_POINTS", 1_000)
    folder = tmp_path / "scans"
    folder.mkdir()
    points = make_points(rng, 5_000)
    if request.param != "unequal chunks":
        monkeypatch.setattr(las, "CHUNK_POINTS", 700)
        return write_las(folder / f"scan.{request.param}", points)
    plain = write_las(folder / "plain.las", points)
    monkeypatch.setattr(lazrsbackend, "LazrsPointWriter", UnequalChunks)
    sizes = [*rng.multinomial(4_990, np.full(9, 1 / 9)).tolist(), 10]
    write_unequal(folder / "scan.laz", plain, sizes)
    assert las.chunk_starts(folder / "scan.laz") == np.cumsum([0, *sizes]).tolist()
    return folder / "scan.laz"


def read_in_tiles(paths, folder, unit=LengthUnit.METRE) -> dict[str, object]:
    with temporary_store(folder) as store, start_engine("", store) as engine:
        cloud = read_into_store(engine, paths, InputSettings(length_unit=unit), NoProgress())
        # Copied, since the files go when the store does.
        return {
            f.name: np.array(v) if isinstance(v := getattr(cloud, f.name), np.ndarray) else v
            for f in fields(PointCloud)
        }


def assert_read_alike(paths, folder, unit=LengthUnit.METRE):
    expected = io.read(paths, length_unit=unit)
    found = read_in_tiles(paths, folder, unit)
    for name, value in found.items():
        wanted = getattr(expected, name)
        if isinstance(wanted, np.ndarray):
            assert value.dtype == wanted.dtype, name
            assert_array_equal(value, wanted, err_msg=name)
        elif name == "storage" and wanted is not None:
            assert_array_equal([value.steps, value.offsets], [wanted.steps, wanted.offsets])
        elif name == "reading":
            assert (value.paths, value.arguments) == (wanted.paths, wanted.arguments)
        else:
            assert value == wanted, name


def test_that_parts_are_whole_chunks_and_read_as_the_whole_file(scan, tmp_path):
    planned = parts.plan_parts([scan], tmp_path)
    assert planned is not None
    rows = [part.rows for part in planned.parts]
    assert rows[0][0] == 0
    assert rows[-1][1] == 5_000
    assert all(a[1] == b[0] for a, b in itertools.pairwise(rows))
    starts = las.chunk_starts(scan)
    assert {row for pair in rows for row in pair} <= set(starts)
    if len(starts) > 3:
        assert len(rows) > 2
    assert_read_alike([scan], tmp_path)


def test_that_several_files_in_feet_are_read_alike(scan, tmp_path):
    assert_read_alike([scan, scan], tmp_path, LengthUnit.FOOT)


def test_that_a_file_whose_header_lies_is_read_in_order(rng, tmp_path):
    points = make_points(rng, 3_000)
    path = write_las(tmp_path / "scan.las", points)
    with laspy.open(path) as reader:
        header = reader.header
    with path.open("r+b") as file:
        # Only the last point is far away: the header does not say so.
        file.seek(header.offset_to_point_data + 2_999 * header.point_format.size)
        file.write(np.int32(2_000_000_000).tobytes())
    planned = parts.plan_parts([path], tmp_path)
    assert planned is not None
    assert not all(parts.read_part(tmp_path, part) for part in planned.parts)
    parts.remove_parts(tmp_path)
    assert_read_alike([path], tmp_path)


def test_that_colours_of_eight_bits_and_other_formats_are_read_in_order(rng, tmp_path):
    narrow = write_las(tmp_path / "narrow.laz", make_points(rng, 500), colour_factor=1)
    assert parts.plan_parts([narrow], tmp_path) is None
    text = tmp_path / "points.xyz"
    np.savetxt(text, rng.normal(size=(50, 3)))
    assert parts.plan_parts([narrow, text], tmp_path) is None
    assert_read_alike([narrow, text], tmp_path)


def test_that_a_truncated_file_gives_its_whole_points(scan, tmp_path):
    size = scan.stat().st_size
    scan.write_bytes(scan.read_bytes()[: size * 2 // 3])
    try:
        assert 0 < len(io.read(scan)) < 5_000
    except ReadError:
        assert "laz" in scan.name  # one chunk, which is not whole
        return
    assert_read_alike([scan], tmp_path)


@pytest.mark.parametrize("mark", ["station", "noise"])
def test_that_stations_and_points_left_out_are_those_of_reading_in_order(rng, tmp_path, mark):
    path = write_las(tmp_path / "scan.las", make_points(rng, 3_000))
    las_data = laspy.read(path)
    if mark == "station":
        las_data.point_source_id = np.repeat([3, 1, 3], 1_000)
    else:
        las_data.classification[2_000:2_005] = 7
    las_data.write(path)
    assert_read_alike([path], tmp_path)
    cloud = io.read(path)
    if mark == "station":
        assert cloud.station_names == ("scan.las: 1", "scan.las: 3")
        assert_array_equal(cloud.station, np.repeat([2, 1, 2], 1_000))
    else:
        assert len(cloud) == 2_995
        assert cloud.station is None
