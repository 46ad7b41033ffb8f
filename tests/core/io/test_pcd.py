from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipecore import io
from pipecore.errors import ReadError
from pipecore.io.formats import lzf
from tests.core.io.writers import write_pcd


@pytest.mark.parametrize("data", ["ascii", "binary", "binary_compressed"])
@pytest.mark.parametrize("kind", ["F", "U"])
def test_that_points_come_back_within_a_tenth_of_a_millimetre_at_ten_thousand_kilometres(
    tmp_path: Path, points: Any, data: str, kind: str
) -> None:
    cloud = io.read(write_pcd(tmp_path / "scan.pcd", points, data, kind))
    assert points.hold(cloud)
    np.testing.assert_array_equal(cloud.intensity, points.intensity)
    np.testing.assert_array_equal(cloud.rgb, points.rgb)
    assert len(cloud.stations) == 0


def test_that_the_viewpoint_is_the_station(tmp_path: Path, points: Any) -> None:
    cloud = io.read(write_pcd(tmp_path / "a.pcd", points, "binary", station="10000001 5400002 3"))
    np.testing.assert_allclose(cloud.world(cloud.stations), [[10000001, 5400002, 3]])


@pytest.mark.parametrize("compressed", [True, False])
@pytest.mark.parametrize("write_ascii", [True, False])
def test_that_files_of_open3d_are_read(
    tmp_path: Path, rng: np.random.Generator, compressed: bool, write_ascii: bool
) -> None:
    import open3d as o3d

    # Much repetition, so that compression has back-references to make.
    xyz = np.round(rng.uniform(-5, 5, (5000, 3)), 1)
    other = o3d.t.geometry.PointCloud(xyz)
    other.point["intensity"] = np.arange(5000, dtype=np.float32)[:, None] % 100
    path = tmp_path / "o3d.pcd"
    o3d.t.io.write_point_cloud(str(path), other, write_ascii=write_ascii, compressed=compressed)
    cloud = io.read(path)
    np.testing.assert_allclose(cloud.xyz, xyz, atol=1e-6)
    np.testing.assert_array_equal(cloud.intensity, np.arange(5000) % 100)


def test_that_files_of_pdal_are_read(shared_data: Path) -> None:
    comma = io.read(shared_data / "formats" / "pdal_utm17_comma.pcd")
    first = comma.world(comma.xyz[0].astype(float))
    np.testing.assert_allclose(first, [289814.15, 4320978.61, 170.76], atol=1e-4)
    utm = io.read(shared_data / "formats" / "pdal_autzen-utm.pcd")
    assert len(utm) == 1065
    assert utm.rgb is not None
    assert utm.intensity is not None


def test_that_decimal_commas_are_understood(tmp_path: Path, points: Any) -> None:
    path = write_pcd(tmp_path / "scan.pcd", points, "ascii", "U")
    header, rows = path.read_text().split("DATA ascii\n")
    path.write_text(header + "DATA ascii\n" + rows.replace(".", ","))
    assert points.hold(io.read(path))


def test_that_a_broken_header_is_told(shared_data: Path) -> None:
    with pytest.raises(ReadError, match=r"pdal_missingheader\.pcd.*header"):
        io.read(shared_data / "formats" / "pdal_missingheader.pcd")


@pytest.mark.parametrize("data", ["ascii", "binary", "binary_compressed"])
@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("POINTS 1000", "POINTS 0"),
        ("POINTS 1000", "POINTS -5"),
        ("POINTS 1000", "POINTS " + "9" * 40),
        ("COUNT 1 1 1 1 1", "COUNT 1 1 1 1 1000000000"),
        ("COUNT 1 1 1 1 1", "COUNT 1 1 1 1 0"),
        ("SIZE 8 8 8 4 4", "SIZE 8 8 8 4 3"),
        ("SIZE 8 8 8 4 4", "SIZE 8 8 8"),
        ("FIELDS x y z", "FIELDS x y w"),
        ("DATA ", "DATA un"),
        ("POINTS 1000\n", "POINTS\nWIDTH\n"),
        ("VIEWPOINT 0", "VIEWPOINT none"),
    ],
)
def test_that_a_lying_header_is_refused(
    tmp_path: Path, points: Any, data: str, old: str, new: str
) -> None:
    path = write_pcd(tmp_path / "scan.pcd", points, data)
    path.write_bytes(path.read_bytes().replace(old.encode(), new.encode(), 1))
    with pytest.raises(ReadError, match=r"scan\.pcd"):
        io.read(path)


@pytest.mark.parametrize("announced", [1001, 4 * 10**12])
def test_that_the_whole_points_of_a_truncated_file_are_read(
    tmp_path: Path, points: Any, announced: int
) -> None:
    path = write_pcd(tmp_path / "scan.pcd", points, "binary")
    path.write_bytes(path.read_bytes().replace(b"POINTS 1000", b"POINTS %d" % announced))
    cloud = io.read(path)
    assert points.hold(cloud)
    assert f"announces {announced:,} points; the 1,000 that are whole" in str(cloud.notes[0])
    for data in ("ascii", "binary_compressed"):
        path = write_pcd(tmp_path / "scan.pcd", points, data)
        path.write_bytes(path.read_bytes().replace(b"POINTS 1000", b"POINTS %d" % announced))
        with pytest.raises(ReadError, match=r"scan\.pcd"):
            io.read(path)


def test_that_a_compressed_size_beyond_what_its_stream_can_hold_is_refused(
    tmp_path: Path, points: Any
) -> None:
    path = write_pcd(tmp_path / "scan.pcd", points, "binary_compressed")
    raw = path.read_bytes()
    at = raw.index(b"compressed\n") + len(b"compressed\n") + 4
    path.write_bytes(raw[:at] + b"\xff\xff\xff\xff" + raw[at + 4 :])
    with pytest.raises(ReadError, match="more than it can hold"):
        io.read(path)


def test_that_the_compiled_decompression_is_that_of_its_plain_twin(
    rng: np.random.Generator,
) -> None:
    for _ in range(200):
        stream = rng.integers(0, 256, rng.integers(0, 60), dtype=np.uint8)
        stream[::3] %= 40  # Else hardly any stream is valid for long.
        outcomes = []
        for function in (lzf.decompress, lzf.decompress.py_func):
            plain = np.zeros(400, dtype=np.uint8)
            outcomes.append((*function(stream, plain, 0, 0, 400), plain.tolist()))
        assert outcomes[0] == outcomes[1]


def test_that_overlapping_back_references_repeat() -> None:
    # “ab”, then 6 bytes from 2 back.
    stream = np.array([1, ord("a"), ord("b"), 4 << 5, 1], dtype=np.uint8)
    plain = np.zeros(8, dtype=np.uint8)
    assert lzf.decompress(stream, plain, 0, 0, 8) == (5, 8)
    assert plain.tobytes() == b"abababab"
