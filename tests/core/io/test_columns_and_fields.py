"""Text with any columns, and the other values that files have of each point."""

from pathlib import Path
from typing import Any

import laspy
import numpy as np
import pytest

from pipecore import io
from pipecore.errors import ReadError
from tests.core.io.cases import columns_of, pipe, text
from tests.core.io.writers import cartesian, write_e57, write_las, write_pcd
from tests.ply import write_ply

XYZ = "{0:.4f}", "{1:.4f}", "{2:.4f}"


def holds(cloud: Any, xyz: Any) -> bool:
    return bool(np.abs(cloud.world(cloud.xyz.astype(float)) - xyz).max() < 1e-4)


@pytest.mark.parametrize(
    ("form", "header"),
    [
        ("P{3} {0:.4f} {1:.4f} {2:.4f}", ""),
        ("{3},{0:.4f},{1:.4f},{2:.4f}", ""),
        ("{3},{0:.4f},{1:.4f},{2:.4f},PIPE", ""),
        ("{0:.4f}\t{1:.4f}\t{2:.4f}", ""),
        ("{0:.4f};{1:.4f};{2:.4f}", "POINT_X;POINT_Y;POINT_Z\n"),
        ("{0:.4f},{1:.4f},{2:.4f}", '"Points:0","Points:1","Points:2"\n'),
        ("{0:.4f} {1:.4f} {2:.4f} 0.25 0.5 0.75", ""),
    ],
)
def test_that_the_columns_are_found(tmp_path: Path, form: str, header: str) -> None:
    xyz = pipe(300)
    rows = [(*p, i + 1) for i, p in enumerate(xyz)]
    assert holds(io.read(text(tmp_path / "a.txt", rows, form, header)), xyz)


def test_that_columns_can_be_named(tmp_path: Path) -> None:
    xyz = pipe(300)
    rows = [(*p, i % 7) for i, p in enumerate(xyz)]
    path = text(tmp_path / "a.txt", rows, "7 {3} {2:.4f} {0:.4f} {1:.4f} x", "any a b c d e\n")
    cloud = io.read(path, columns="-,intensity,z,x,y")
    assert holds(cloud, xyz)
    np.testing.assert_array_equal(cloud.intensity, np.arange(300) % 7)
    assert io.info(path, columns="-,intensity,z,x,y").n_points == 300
    with pytest.raises(ReadError, match="7 columns are named, line 2 has 6"):
        io.read(path, columns="-,intensity,z,x,y,-,-")
    for wrong in ("x,y", "x,y,z,z"):
        with pytest.raises(ReadError, match="must name x, y and z"):
            io.read(path, columns=wrong)


def test_that_all_values_of_las_are_kept_as_they_are_stored(tmp_path: Path, points: Any) -> None:
    path = write_las(tmp_path / "a.laz", points)
    las = laspy.read(path)
    las.add_extra_dim(
        laspy.ExtraBytesParams("width", "i2", "of echoes", np.array([3.0]), np.array([0.01]), [-1])
    )
    raw = np.arange(1000, dtype=np.int16) - 1
    las.points.array["width"] = raw
    las.gps_time = np.linspace(1e9, 2e9, 1000)
    las.return_number = np.arange(1000) % 3 + 1
    las.write(path)
    assert not io.read(path).fields
    fields = io.read(path, has_fields=True).fields
    np.testing.assert_array_equal(fields["gps_time"].values, np.linspace(1e9, 2e9, 1000))
    np.testing.assert_array_equal(fields["return_number"].values, np.arange(1000) % 3 + 1)
    width = fields["width"]
    np.testing.assert_array_equal(width.values, raw)
    assert (width.scale, width.offset, width.no_data) == (0.01, 3.0, -1)
    assert np.isnan(width.scaled()[0])
    np.testing.assert_allclose(width.scaled()[1:], 0.01 * raw[1:] + 3.0)


def test_that_fields_of_other_formats_are_kept(tmp_path: Path, points: Any) -> None:
    values = np.arange(1000, dtype=np.int32)
    rows = columns_of(points.xyz, scalar_time=values)
    ply = write_ply(tmp_path / "a.ply", {"vertex": rows})
    scan = {"columns": cartesian(points.xyz) | {"timeStamp": values}}
    e57 = write_e57(tmp_path / "a.e57", [scan])
    table = [(*p, i) for p, i in zip(points.xyz, values, strict=True)]
    named = text(tmp_path / "a.txt", table, "{:.4f} {:.4f} {:.4f} {}", "x y z time\n")
    for path, name in ((ply, "scalar_time"), (e57, "timeStamp"), (named, "time")):
        fields = io.read(path, has_fields=True).fields
        assert list(fields) == [name]
        np.testing.assert_array_equal(fields[name].values, values)
    pcd = write_pcd(tmp_path / "a.pcd", points, "binary")
    pcd.write_bytes(pcd.read_bytes().replace(b"z intensity", b"z curvature"))
    fields = io.read(pcd, has_fields=True).fields
    np.testing.assert_array_equal(fields["curvature"].values, points.intensity)


def test_that_fields_follow_the_points_that_are_kept(tmp_path: Path) -> None:
    xyz = np.insert(pipe(300), 100, 1e7, axis=0)
    rows = columns_of(xyz, number=np.arange(301, dtype=np.int32))
    cloud = io.read(write_ply(tmp_path / "a.ply", {"vertex": rows}), has_fields=True)
    np.testing.assert_array_equal(cloud.fields["number"].values, np.delete(np.arange(301), 100))
