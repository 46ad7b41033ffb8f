import re
import struct
from pathlib import Path
from typing import Any

import laspy
import numpy as np
import pytest

from pipecore import io
from pipecore.errors import ReadError
from tests.core.io.writers import write_las

COUNT_AT, START_AT, N_VLRS_AT = 247, 96, 100
WKT = 'COMPD_CS["ETRS89 / UTM 32N + DHHN2016",PROJCS["ETRS89 / UTM zone 32N",GEOGCS["x"]]]'


@pytest.mark.parametrize("name", ["scan.las", "scan.laz"])
def test_that_points_come_back_within_a_tenth_of_a_millimetre_at_ten_thousand_kilometres(
    tmp_path: Path, points: Any, name: str
) -> None:
    cloud = io.read(write_las(tmp_path / name, points))
    assert points.hold(cloud)
    assert cloud.xyz.dtype == np.float32
    np.testing.assert_array_equal(cloud.intensity, points.intensity)
    np.testing.assert_array_equal(cloud.classification, points.intensity % 32)


@pytest.mark.parametrize("colour_factor", [1, 256, 257])
def test_that_colours_are_the_same_whichever_bits_their_writer_used(
    tmp_path: Path, points: Any, colour_factor: int
) -> None:
    cloud = io.read(write_las(tmp_path / "a.las", points, colour_factor=colour_factor))
    np.testing.assert_array_equal(cloud.rgb, points.rgb)


def test_that_dark_first_points_do_not_make_16_bit_colours_8_bit_ones(tmp_path: Path) -> None:
    n = 600_000  # More than one chunk.
    las = laspy.create(point_format=2, file_version="1.2")
    las.header.scales = np.full(3, 0.001)
    las.xyz = np.zeros((n, 3))
    las.red = np.where(np.arange(n) < n - 10, 200, 200 * 256)
    las.write(tmp_path / "dark.las")
    red = io.read(tmp_path / "dark.las").rgb[:, 0]
    assert (red[:-10] == 0).all()
    assert (red[-10:] == 200).all()


def test_that_there_are_no_colours_where_the_file_has_none(tmp_path: Path, points: Any) -> None:
    assert io.read(write_las(tmp_path / "grey.laz", points, point_format=6)).rgb is None


def test_that_the_coordinate_system_is_named_from_its_well_known_text(
    tmp_path: Path, points: Any
) -> None:
    path = write_las(tmp_path / "a.las", points)
    las = laspy.read(path)
    las.vlrs.append(laspy.VLR("LASF_Projection", 2112, "", WKT.encode() + b"\0"))
    las.write(path)
    assert io.read(path).crs == "ETRS89 / UTM 32N + DHHN2016"


@pytest.mark.parametrize("is_cited", [True, False])
def test_that_the_coordinate_system_is_named_from_geotiff_keys(
    tmp_path: Path, points: Any, is_cited: bool
) -> None:
    keys = [(3072, 0, 1, 25832), (3073, 34737, 10, 3)] if is_cited else [(3072, 0, 1, 25832)]
    directory = struct.pack("<4H", 1, 1, 0, len(keys)) + b"".join(
        struct.pack("<4H", *key) for key in keys
    )
    path = write_las(tmp_path / "a.las", points)
    las = laspy.read(path)
    las.vlrs.append(laspy.VLR("LASF_Projection", 34735, "", directory))
    las.vlrs.append(laspy.VLR("LASF_Projection", 34737, "", b"xx|My grid 7|\0"))
    las.write(path)
    assert io.read(path).crs == ("My grid 7" if is_cited else "EPSG:25832")


@pytest.mark.parametrize("name", ["scan.las", "scan.laz"])
@pytest.mark.parametrize("announced", [1001, 10**6, 2**40, 2**64 - 1])
def test_that_a_count_beyond_the_file_is_refused(
    tmp_path: Path, points: Any, name: str, announced: int
) -> None:
    path = write_las(tmp_path / name, points)
    overwrite(path, COUNT_AT, struct.pack("<Q", announced))
    with pytest.raises(ReadError, match=re.escape(name)):
        io.read(path)


def test_that_the_error_of_a_short_file_says_how_many_points_it_holds(
    tmp_path: Path, points: Any
) -> None:
    path = write_las(tmp_path / "scan.las", points)
    record = header_of(path).point_format.size
    path.write_bytes(path.read_bytes()[: -10 * record])
    with pytest.raises(ReadError, match="announces 1,000 points but holds 990"):
        io.read(path)


@pytest.mark.parametrize("at", [START_AT, N_VLRS_AT, 235, 243])
@pytest.mark.parametrize("name", ["scan.las", "scan.laz"])
def test_that_places_and_counts_beyond_the_file_are_refused(
    tmp_path: Path, points: Any, name: str, at: int
) -> None:
    path = write_las(tmp_path / name, points)
    overwrite(path, 243, struct.pack("<I", 1))  # One extended record, at a place of nothing.
    overwrite(path, at, struct.pack("<I", 2**32 - 1))
    with pytest.raises(ReadError):
        io.read(path)


def test_that_a_table_of_chunks_larger_than_the_file_is_refused(
    tmp_path: Path, points: Any
) -> None:
    path = write_las(tmp_path / "scan.laz", points)
    start = header_of(path).offset_to_point_data
    (table,) = struct.unpack_from("<q", path.read_bytes(), start)
    overwrite(path, table + 4, struct.pack("<I", 2**32 - 1))
    with pytest.raises(ReadError):
        io.read(path)


def test_that_an_ordinary_file_of_another_program_is_read(shared_data: Path) -> None:
    path = shared_data / "formats" / "pdal_sample_c.las"
    with laspy.open(path) as reader:
        las = reader.read()
    cloud = io.read(path)
    np.testing.assert_allclose(cloud.world(cloud.xyz.astype(float)), las.xyz, atol=1e-4)
    np.testing.assert_array_equal(cloud.rgb, np.stack([las.red, las.green, las.blue], 1) >> 8)


def header_of(path: Path) -> laspy.LasHeader:
    with laspy.open(path) as reader:
        return reader.header


def overwrite(path: Path, at: int, data: bytes) -> None:
    raw = bytearray(path.read_bytes())
    raw[at : at + len(data)] = data
    path.write_bytes(raw)
