from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipecore import io
from pipecore.errors import ReadError
from tests.core.io.writers import vertices
from tests.ply import write_ply

ENCODINGS = [(True, "<"), (False, "<"), (False, ">")]


@pytest.mark.parametrize(("text", "byte_order"), ENCODINGS)
@pytest.mark.parametrize("intensity", ["intensity", "scalar_Intensity"])
def test_that_points_come_back_within_a_tenth_of_a_millimetre_at_ten_thousand_kilometres(
    tmp_path: Path, points: Any, text: bool, byte_order: str, intensity: str
) -> None:
    path = tmp_path / "scan.ply"
    rows = vertices(points, "f8", intensity)
    write_ply(path, {"vertex": rows}, text=text, byte_order=byte_order, comments=("by a test",))
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
    write_ply(tmp_path / "a.ply", {"vertex": data}, text=text, byte_order=byte_order)
    np.testing.assert_allclose(io.read(tmp_path / "a.ply").xyz, xyz, atol=1e-6)


@pytest.mark.parametrize(("text", "byte_order"), ENCODINGS)
@pytest.mark.parametrize("vertices_first", [True, False])
def test_that_other_elements_are_passed_over(
    tmp_path: Path, points: Any, text: bool, byte_order: str, vertices_first: bool
) -> None:
    other = np.array([(1.5, 2)] * 7, dtype=[("a", "f8"), ("b", "i2")])
    faces = np.array([([0, 1, 2],)], dtype=[("vertex_indices", "i4", (3,))])
    elements = {"other": other, "face": faces}
    own = {"vertex": vertices(points)}
    elements = own | elements if vertices_first else elements | own
    write_ply(tmp_path / "mesh.ply", elements, text=text, byte_order=byte_order)
    assert points.hold(io.read(tmp_path / "mesh.ply"))


def test_that_colours_as_fractions_become_bytes(tmp_path: Path, points: Any) -> None:
    fields = [(name, "f8") for name in "xyz"] + [(name, "f4") for name in ("red", "green", "blue")]
    rows = [(*row[:3], *(c / 255 for c in row[4:])) for row in points.rows()]
    write_ply(tmp_path / "a.ply", {"vertex": np.array(rows, dtype=fields)})
    np.testing.assert_array_equal(io.read(tmp_path / "a.ply").rgb, points.rgb)


@pytest.mark.parametrize(("text", "byte_order"), ENCODINGS)
@pytest.mark.parametrize("announced", ["9" * 30, "-1", "many"])
def test_that_a_count_that_is_none_is_refused(
    tmp_path: Path, points: Any, text: bool, byte_order: str, announced: str
) -> None:
    path = tmp_path / "scan.ply"
    write_ply(path, {"vertex": vertices(points)}, text=text, byte_order=byte_order)
    path.write_bytes(path.read_bytes().replace(b"vertex 1000", b"vertex " + announced.encode()))
    with pytest.raises(ReadError, match=r"scan\.ply"):
        io.read(path)


@pytest.mark.parametrize("byte_order", ["<", ">"])
@pytest.mark.parametrize("announced", [1001, 10**12])
def test_that_the_whole_points_of_a_truncated_file_are_read(
    tmp_path: Path, points: Any, byte_order: str, announced: int
) -> None:
    path = write_ply(tmp_path / "scan.ply", {"vertex": vertices(points)}, byte_order=byte_order)
    path.write_bytes(path.read_bytes().replace(b"vertex 1000", b"vertex %d" % announced))
    cloud = io.read(path)
    assert points.hold(cloud)
    assert f"announces {announced:,} points; the 1,000 that are whole" in str(cloud.notes[0])


@pytest.mark.parametrize("byte_order", ["<", ">"])
@pytest.mark.parametrize("is_before", [True, False])
def test_that_lists_among_the_vertices_are_passed_over(
    tmp_path: Path, points: Any, byte_order: str, is_before: bool
) -> None:
    # Each list has as many values as its row says, one to three.
    rows = vertices(points)
    fields = [f"property {'double' if n in 'xyz' else 'uchar'} {n}" for n in ("x", "y", "z")]
    fields.insert(0 if is_before else 3, "property list ushort float view")
    kind = {"<": "little", ">": "big"}[byte_order]
    head = ["ply", f"format binary_{kind}_endian 1.0", "element vertex 1000", *fields, "end_header"]
    body = b""
    for i, row in enumerate(rows):
        view = np.full(i % 3, 1.5, byte_order + "f4")
        listed = np.array(len(view), byte_order + "u2").tobytes() + view.tobytes()
        xyz = np.array([row["x"], row["y"], row["z"]], byte_order + "f8").tobytes()
        body += listed + xyz if is_before else xyz + listed
    path = tmp_path / "scan.ply"
    path.write_bytes(("\n".join(head) + "\n").encode() + body)
    assert points.hold(io.read(path))
    path.write_bytes(path.read_bytes()[:-40])
    with pytest.raises(ReadError, match="truncated"):
        io.read(path)


def test_that_lists_behind_the_coordinates_of_text_are_passed_over(tmp_path: Path) -> None:
    lists = XYZ + "property list uchar int k\nend_header\n"
    text = HEADER.replace("vertex 1", "vertex 2") + lists + "1 2 3 0\n1 2 4 2 7 8\n"
    (tmp_path / "a.ply").write_text(text)
    assert io.read(tmp_path / "a.ply").xyz[:, 2].tolist() == [3, 4]


@pytest.mark.parametrize("ending", ["\n", "\r\n", "\r"])
def test_that_headers_may_have_blank_lines_and_any_line_ends(
    tmp_path: Path, points: Any, ending: str
) -> None:
    path = write_ply(tmp_path / "scan.ply", {"vertex": vertices(points)})
    head, _, body = path.read_bytes().partition(b"end_header\n")
    head = head.replace(b"element", b"\ncomment a\n\nelement") + b"end_header\n"
    path.write_bytes(head.replace(b"\n", ending.encode()) + body)
    assert points.hold(io.read(path))


def test_that_a_mesh_is_no_scan(tmp_path: Path, points: Any) -> None:
    faces = np.array([([0, 1, 2],)] * 1999, dtype=[("vertex_indices", "i4", (3,))])
    elements = {"vertex": vertices(points), "face": faces}
    with pytest.raises(ReadError, match=r"is a mesh.*open3d"):
        io.read(write_ply(tmp_path / "mesh.ply", elements))
    cloud = io.read(write_ply(tmp_path / "few.ply", elements | {"face": faces[:9]}))
    assert "holds 9 faces" in str(cloud.notes[0])


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
        (HEADER + "property list uchar int k\n" + XYZ + "end_header\n2 1 2 3\n", "truncated"),
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
