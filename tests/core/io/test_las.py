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
    np.testing.assert_array_equal(cloud.classification, points.intensity % 7)


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
    las.xyz = np.ones((n, 3))
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
def test_that_a_count_beyond_the_file_gives_what_is_there_with_a_word(
    tmp_path: Path, points: Any, name: str, announced: int
) -> None:
    path = write_las(tmp_path / name, points)
    overwrite(path, COUNT_AT, struct.pack("<Q", announced))
    cloud = io.read(path)
    assert points.hold(cloud)
    assert f"{announced:,} points; the 1,000 that are whole" in str(cloud.notes[0])


@pytest.mark.parametrize("point_format", [3, 7])
@pytest.mark.parametrize("name", ["scan.las", "scan.laz"])
def test_that_the_whole_points_of_a_truncated_file_are_read(
    tmp_path: Path, points: Any, name: str, point_format: int
) -> None:
    path = write_las(tmp_path / name, points, point_format=point_format, chunk_size=100)
    raw = path.read_bytes()
    path.write_bytes(raw[: len(raw) * 2 // 3])
    cloud = io.read(path)
    assert 500 <= len(cloud) < 1000
    world = cloud.world(cloud.xyz.astype(float))
    assert np.abs(world - points.xyz[: len(cloud)]).max() < 1e-4
    assert f"the {len(cloud):,} that are whole were read" in str(cloud.notes[0])
    assert io.info(path).n_points == len(cloud)


def test_that_points_that_are_packed_as_by_laszip_1_are_read(tmp_path: Path, points: Any) -> None:
    """One stream without chunks: what a single chunk holds, without a table."""
    path = write_las(tmp_path / "a.laz", points, point_format=3, chunk_size=2000)
    raw, start = bytearray(path.read_bytes()), header_of(path).offset_to_point_data
    (table,) = struct.unpack_from("<q", raw, start)
    raw[raw.index(b"laszip encoded") + 52] = 1  # the way of packing: pointwise
    path.write_bytes(raw[:start] + raw[start + 8 : table])
    cloud = io.read(path)
    assert points.hold(cloud)
    assert not any("order" in str(note) for note in cloud.notes)


@pytest.mark.parametrize("is_streamed", [True, False])
def test_that_a_place_of_the_chunk_table_may_stand_at_the_end(
    tmp_path: Path, points: Any, is_streamed: bool
) -> None:
    path = write_las(tmp_path / "a.laz", points, chunk_size=100)
    raw, start = bytearray(path.read_bytes()), header_of(path).offset_to_point_data
    if is_streamed:
        raw += raw[start : start + 8]
    raw[start : start + 8] = b"\xff" * 8
    path.write_bytes(raw)
    cloud = io.read(path)
    assert points.hold(cloud)
    assert ("in order" in str(cloud.notes[0])) != is_streamed


@pytest.mark.parametrize("name", ["scan.las", "scan.laz"])
def test_that_saturated_coordinates_are_left_out(tmp_path: Path, points: Any, name: str) -> None:
    path = write_las(tmp_path / name, points)
    las = laspy.read(path)
    las.X[[3, 500]] = 2**31 - 1
    las.Z[7] = -(2**31)
    las.write(path)
    cloud = io.read(path)
    assert len(cloud) == io.info(path).n_points == 997
    assert "3 of its points, at the end of the range" in str(cloud.notes[0])


@pytest.mark.parametrize("at", [START_AT, N_VLRS_AT])
@pytest.mark.parametrize("name", ["scan.las", "scan.laz"])
def test_that_places_and_counts_beyond_the_file_are_refused(
    tmp_path: Path, points: Any, name: str, at: int
) -> None:
    path = write_las(tmp_path / name, points)
    overwrite(path, at, struct.pack("<I", 2**32 - 1))
    with pytest.raises(ReadError):
        io.read(path)


@pytest.mark.parametrize("at", [235, 243])
@pytest.mark.parametrize("name", ["scan.las", "scan.laz"])
def test_that_extended_records_beyond_the_file_cost_no_point(
    tmp_path: Path, points: Any, name: str, at: int
) -> None:
    path = write_las(tmp_path / name, points)
    overwrite(path, 243, struct.pack("<I", 1))  # One extended record, at a place of nothing.
    overwrite(path, at, struct.pack("<I", 2**32 - 1))
    cloud = io.read(path)
    assert points.hold(cloud)
    assert "behind its points is damaged" in str(cloud.notes[0])


def test_that_a_header_of_las_15_is_read(tmp_path: Path, points: Any) -> None:
    path = write_las(tmp_path / "a.las", points)
    raw = bytearray(path.read_bytes())
    raw[25] = 5
    (start,) = struct.unpack_from("<I", raw, START_AT)
    path.write_bytes(raw)  # as some write it, with the header of 1.4
    assert points.hold(io.read(path))
    struct.pack_into("<H", raw, 94, 393)
    struct.pack_into("<I", raw, START_AT, start + 18)
    path.write_bytes(raw[:375] + bytes(18) + raw[375:])
    assert points.hold(io.read(path))


def test_that_a_table_of_chunks_larger_than_the_file_is_not_needed(
    tmp_path: Path, points: Any
) -> None:
    path = write_las(tmp_path / "scan.laz", points)
    start = header_of(path).offset_to_point_data
    (table,) = struct.unpack_from("<q", path.read_bytes(), start)
    overwrite(path, table + 4, struct.pack("<I", 2**32 - 1))
    cloud = io.read(path)
    assert points.hold(cloud)
    assert "table of chunks" in str(cloud.notes[0])


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
