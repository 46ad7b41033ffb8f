from pathlib import Path
from typing import Any

import numpy as np
import pytest
from plyfile import PlyData, PlyElement

from pipecore import io
from pipecore.errors import ReadError
from tests.core.io.writers import vertices

ENCODINGS = [(True, "="), (False, "<"), (False, ">")]


@pytest.mark.parametrize(("text", "byte_order"), ENCODINGS)
@pytest.mark.parametrize("intensity", ["intensity", "scalar_Intensity"])
def test_that_points_come_back_within_a_tenth_of_a_millimetre_at_ten_thousand_kilometres(
    tmp_path: Path, points: Any, text: bool, byte_order: str, intensity: str
) -> None:
    path = tmp_path / "scan.ply"
    PlyData([vertices(points, "f8", intensity)], text, byte_order, ["by a test"]).write(path)
    cloud = io.read(path)
    assert points.hold(cloud)
    np.testing.assert_array_equal(cloud.intensity, points.intensity)
    np.testing.assert_array_equal(cloud.rgb, points.rgb)


@pytest.mark.parametrize(("text", "byte_order"), ENCODINGS)
def test_that_single_precision_coordinates_are_read_as_they_are(
    tmp_path: Path, rng: np.random.Generator, text: bool, byte_order: str
) -> None:
    xyz = rng.uniform(-5, 5, (100, 3)).astype(np.float32)
    data = np.array([tuple(p) for p in xyz], dtype=[("x", "f4"), ("y", "f4"), ("z", "f4")])
    PlyData([PlyElement.describe(data, "vertex")], text, byte_order).write(tmp_path / "a.ply")
    np.testing.assert_allclose(io.read(tmp_path / "a.ply").xyz, xyz, atol=1e-6)


@pytest.mark.parametrize(("text", "byte_order"), ENCODINGS)
@pytest.mark.parametrize("vertices_first", [True, False])
def test_that_other_elements_are_passed_over(
    tmp_path: Path, points: Any, text: bool, byte_order: str, vertices_first: bool
) -> None:
    other = PlyElement.describe(np.array([(1.5, 2)] * 7, dtype=[("a", "f8"), ("b", "i2")]), "other")
    faces = PlyElement.describe(np.array([([0, 1, 2],)], dtype=[("vertex_indices", "O")]), "face")
    elements = [vertices(points), other, faces] if vertices_first else [other, vertices(points)]
    PlyData(elements, text, byte_order).write(tmp_path / "mesh.ply")
    assert points.hold(io.read(tmp_path / "mesh.ply"))


def test_that_colours_as_fractions_become_bytes(tmp_path: Path, points: Any) -> None:
    fields = [(name, "f8") for name in "xyz"] + [(name, "f4") for name in ("red", "green", "blue")]
    rows = [(*row[:3], *(c / 255 for c in row[4:])) for row in points.rows()]
    element = PlyElement.describe(np.array(rows, dtype=fields), "vertex")
    PlyData([element]).write(tmp_path / "a.ply")
    np.testing.assert_array_equal(io.read(tmp_path / "a.ply").rgb, points.rgb)


@pytest.mark.parametrize(("text", "byte_order"), ENCODINGS)
@pytest.mark.parametrize("announced", ["1001", "1000000000000", "9" * 30, "-1", "many"])
def test_that_a_count_beyond_the_file_is_refused(
    tmp_path: Path, points: Any, text: bool, byte_order: str, announced: str
) -> None:
    path = tmp_path / "scan.ply"
    PlyData([vertices(points)], text, byte_order).write(path)
    path.write_bytes(path.read_bytes().replace(b"vertex 1000", b"vertex " + announced.encode()))
    with pytest.raises(ReadError, match=r"scan\.ply"):
        io.read(path)


def test_that_empty_lines_are_no_points(tmp_path: Path) -> None:
    rows = "1 2 3\n\n1 2 4\n\n\n1 2 5\n0 0 0\n"
    (tmp_path / "a.ply").write_text(
        HEADER.replace("vertex 1", "vertex 3") + XYZ + "end_header\n" + rows
    )
    assert io.read(tmp_path / "a.ply").xyz[:, 2].tolist() == [3, 4, 5]


HEADER = "ply\nformat ascii 1.0\nelement vertex 1\n"
XYZ = "property float x\nproperty float y\nproperty float z\n"


@pytest.mark.parametrize(
    ("text", "cause"),
    [
        ("ply\n", "header"),
        ("ply\nformat ascii 1.0\nend_header\n", "no vertices"),
        ("ply\nelement vertex 1\n" + XYZ + "end_header\n1 2 3\n", "no format"),
        (HEADER + "property float x\nend_header\n1\n", "no x, y and z"),
        (HEADER + XYZ + "property list uchar int k\nend_header\n1 2 3 0\n", "lists"),
        (HEADER + XYZ + "property vast w\nend_header\n1 2 3 4\n", "line 7"),
        (HEADER + XYZ + "end_header\n1 2\n", "line 8"),
        (HEADER + XYZ + "end_header\n1 2 x\n", "line 8"),
        (HEADER.replace("vertex 1", "vertex 0") + XYZ + "end_header\n", "no valid points"),
        (HEADER + XYZ + "end_header\n", "announces 1 points but holds 0"),
        (HEADER + XYZ + "end_header\nnan 2 inf\n", "no valid points"),
    ],
)
def test_that_the_error_says_what_is_wrong(tmp_path: Path, text: str, cause: str) -> None:
    path = tmp_path / "odd.ply"
    path.write_text(text)
    with pytest.raises(ReadError, match=cause) as caught:
        io.read(path)
    assert "odd.ply" in str(caught.value)
