"""What is read and written again is unchanged, in whichever formats it was on its way."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import laspy
import numpy as np
import pye57
import pyproj
import pytest

from pipecore import io
from pipecore.cli import main
from pipecore.errors import CancelledError, ReadError, WriteError
from pipecore.settings import LengthUnit
from pipecore.types import Field, PointCloud
from tests.core.io.writers import cartesian, integers, write_e57, write_pcd
from tests.ply import write_ply

N = 3_000
FEET = 1200 / 3937
ENDS = "Minimum", "Maximum"


def random() -> np.random.Generator:
    return np.random.default_rng(7)


def xyz(unit: float = 1.0) -> Any:
    return np.round(
        (np.array([412_345.0, 5_654_321.0, 87.0]) + random().uniform(-40, 40, (N, 3))) / unit, 3
    )


def las14(path: Path) -> Path:
    rng = random()
    header = laspy.LasHeader(point_format=8, version="1.4")
    header.scales, header.offsets = np.array([1e-3, 1e-3, 2e-4]), np.array([4e5, 5.6e6, -1.5])
    header.global_encoding.wkt = True
    text = pyproj.CRS.from_epsg(25832).to_wkt(pyproj.enums.WktVersion.WKT1_GDAL)
    header.vlrs.append(laspy.VLR("LASF_Projection", 2112, "", text.encode() + b"\0"))
    extra = laspy.ExtraBytesParams
    header.add_extra_dims(
        [
            extra("width", "i2", "of echoes", np.array([3.0]), np.array([0.01]), [-1]),
            extra("Reflectance [dB]", "f4"),
            extra("normal", "3f8"),
            extra("far", "u8"),
        ]
    )
    las = laspy.LasData(header)
    las.xyz = xyz()
    for name in ("intensity", "red", "green", "blue", "nir"):
        las[name] = rng.integers(0, 65536, N)
    las.classification = rng.integers(19, 256, N)
    las.user_data = rng.integers(0, 256, N)
    las.scan_angle = rng.integers(-30_000, 30_001, N)
    las.return_number, las.number_of_returns = rng.integers(1, 16, N), rng.integers(1, 16, N)
    las.scanner_channel, las.overlap = rng.integers(0, 4, N), rng.integers(0, 2, N)
    las.edge_of_flight_line, las.synthetic = rng.integers(0, 2, N), rng.integers(0, 2, N)
    las.gps_time = rng.uniform(1e8, 4e8, N)
    las.point_source_id = rng.choice([17, 4, 300], N)
    las.points.array["width"] = rng.integers(-1, 900, N)
    las["Reflectance [dB]"] = rng.normal(size=N)
    las["normal"] = rng.normal(size=(N, 3))
    las["far"] = rng.integers(0, 2**53, N)
    las.write(path)
    return path


def las12(path: Path) -> Path:
    """As American surveyors have it: GeoTIFF keys, feet."""
    rng = random()
    header = laspy.LasHeader(point_format=3, version="1.2")
    header.scales, header.offsets = np.full(3, 0.001), np.array([1_350_000.0, 1.8e7, 0])
    keys = np.array([[1, 1, 0, 2], [1024, 0, 1, 1], [3072, 0, 1, 2903]], "<u2")
    directory = np.vstack([keys, [[3076, 0, 1, 9003]]]).astype("<u2")
    directory[0, 3] = 3
    header.vlrs.append(laspy.VLR("LASF_Projection", 34735, "", directory.tobytes()))
    las = laspy.LasData(header)
    las.xyz = xyz(FEET)
    las.intensity, las.red = rng.integers(0, 4096, N), rng.integers(0, 256, N) * 256
    las.classification, las.scan_angle_rank = rng.integers(8, 32, N), rng.integers(-90, 91, N)
    las.return_number, las.key_point = rng.integers(0, 8, N), rng.integers(0, 2, N)
    las.gps_time, las.point_source_id = rng.uniform(0, 6e5, N), np.full(N, 12)
    las.write(path)
    return path


def ply(path: Path) -> Path:
    rng = random()
    kinds = ("i1", "u1", "i2", "u2", "i4", "u4", "f4", "f8")
    fields = [(axis, "f8") for axis in "xyz"] + [(f"scalar_of {k}", k) for k in kinds]
    rows = np.empty(N, fields)
    for axis, values in zip("xyz", xyz().T + rng.uniform(0, 1e-3, (3, N)), strict=True):
        rows[axis] = values
    for kind in kinds:
        is_whole = kind[0] in "iu"
        low, high = (np.iinfo(kind).min, np.iinfo(kind).max) if is_whole else (0, 1)
        values = rng.integers(low, high, N, endpoint=True) if is_whole else rng.normal(size=N)
        rows[f"scalar_of {kind}"] = values
    rows["scalar_of f8"][::7] = np.nan
    return write_ply(path, {"vertex": rows})


def e57(path: Path) -> Path:
    rng = random()
    parts = np.split(xyz(), [1_000])
    colours = dict.fromkeys(("colorRed", "colorGreen", "colorBlue"), integers(0, 255))
    more = {"rowIndex": integers(0, 5_000), "columnIndex": integers(0, 900)}
    scans = []
    for i, part in enumerate(parts):
        place = np.array([412_300.0 + 9 * i, 5_654_300.25, 88.123456])
        columns = cartesian(part - place) | {"intensity": rng.uniform(-1, 1, len(part))}
        columns |= {name: rng.integers(0, 256, len(part)) for name in colours}
        columns |= {"rowIndex": rng.integers(0, 5_001, len(part))}
        columns |= {"columnIndex": rng.integers(0, 901, len(part))}
        columns |= {"timeStamp": rng.uniform(0, 1e5, len(part))}
        scans.append({"columns": columns, "nodes": colours | more, "translation": place})
    return write_e57(path, scans, crs=pyproj.CRS.from_epsg(25832).to_wkt())


def pcd(path: Path) -> Path:
    class Points:
        pass

    points: Any = Points()
    points.xyz, points.intensity = xyz() - [4e5, 5.6e6, 0], random().uniform(0, 1, N)
    points.rgb = random().integers(0, 256, (N, 3), dtype=np.uint8)
    return write_pcd(path, points, "binary", station="1.5 2.5 3.5")


MAKERS: dict[str, Callable[[Path], Path]] = {
    "14.laz": las14,
    "12.las": las12,
    "scan.ply": ply,
    "scans.e57": e57,
    "scan.pcd": pcd,
}
WAYS = ("las", "laz", "ply", "e57", "ply las", "e57 laz", "laz e57 ply las")


def carried(cloud: PointCloud, way: str, folder: Path) -> PointCloud:
    """Write and read a cloud in several formats."""
    for step, ending in enumerate(way.split()):
        path = folder / f"{step}.{ending}"
        io.write(cloud, path)
        cloud = io.read(path, has_fields=True)
    return cloud


def names_in_las(name: str) -> str:
    return name.replace(":", "_")


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("source", MAKERS)
def test_that_points_come_back_with_all_that_they_had(
    tmp_path: Path, source: str, way: str
) -> None:
    before = io.read(MAKERS[source](tmp_path / source), has_fields=True)
    after = carried(before, way, tmp_path)
    old, new = before.world(before.xyz), after.world(after.xyz)
    if before.storage is not None or way in ("ply", "e57"):
        np.testing.assert_array_equal(new, old)
    else:
        # Doubles and decimals: LAS has them in steps of a micrometre, or in their own.
        np.testing.assert_allclose(new, old, rtol=0, atol=0.51e-6)
    for name in ("intensity", "rgb", "station"):
        values = getattr(before, name)
        if values is not None and len(np.unique(values)) > 1:
            np.testing.assert_array_equal(getattr(after, name), values)
    if before.classification is not None:
        np.testing.assert_array_equal(after.classification, before.classification)
    through_las = "las" in way or "laz" in way
    for name, field in before.fields.items():
        if name in ("red", "green", "blue") and name not in after.fields:
            continue  # No more than colours of 8 bits say.
        again = after.fields[names_in_las(name) if through_las else name]
        np.testing.assert_array_equal(again.values, field.values)
        assert again.values.dtype == field.values.dtype
        assert (again.scale, again.offset) == (field.scale, field.offset)
        assert (again.no_data, again.description) == (field.no_data, field.description)
    assert (after.crs, after.crs_wkt) == (before.crs, before.crs_wkt)


@pytest.mark.parametrize("maker", [las14, las12])
@pytest.mark.parametrize("way", ["las", "laz", "ply las", "e57 laz", "laz e57 ply las"])
def test_that_a_las_file_is_the_same_after(
    tmp_path: Path, maker: Callable[[Path], Path], way: str
) -> None:
    was = laspy.read(maker(tmp_path / "was.las"))
    carried(io.read(tmp_path / "was.las", has_fields=True), way, tmp_path)
    last = len(way.split()) - 1
    now = laspy.read(tmp_path / f"{last}.{way.rsplit(maxsplit=1)[-1]}")
    assert now.header.point_format == was.header.point_format
    assert now.header.version == was.header.version
    np.testing.assert_array_equal(now.header.scales, was.header.scales)
    np.testing.assert_array_equal(now.header.offsets, was.header.offsets)
    np.testing.assert_array_equal(now.points.array, was.points.array)

    def of(las: Any) -> list[tuple[int, bytes]]:
        own = [v for v in las.header.vlrs if v.user_id == "LASF_Projection"]
        return [(v.record_id, v.record_data_bytes().rstrip(b"\0")) for v in own]

    assert of(now) == of(was)


@pytest.mark.parametrize("way", ["ply", "e57", "e57 ply"])
def test_that_scanner_positions_are_kept_where_the_format_has_them(
    tmp_path: Path, way: str
) -> None:
    before = io.read(e57(tmp_path / "scans.e57"))
    after = carried(before, way, tmp_path)
    world = before.world(before.stations)
    np.testing.assert_allclose(after.world(after.stations), world, rtol=0, atol=1e-6)
    assert [n.split(": ")[1] for n in after.station_names] == ["scan 1", "scan 2"]


def test_that_las_says_that_it_holds_no_positions(tmp_path: Path) -> None:
    cloud = io.read(e57(tmp_path / "scans.e57"))
    (note,) = io.write(cloud, tmp_path / "a.las")
    assert str(note) == "“a.las” does not hold where the scanners stood: LAS cannot."


@pytest.mark.parametrize("ending", ["las", "laz", "ply", "e57"])
@pytest.mark.parametrize("rows", [slice(100, 200), np.arange(N) % 3 == 0, np.array([7, 3, 5])])
def test_that_a_part_has_all_of_the_whole(tmp_path: Path, ending: str, rows: Any) -> None:
    whole = io.read(las14(tmp_path / "14.laz"), has_fields=True)
    part = whole.take(rows)
    io.write(part, tmp_path / f"part.{ending}")
    after = io.read(tmp_path / f"part.{ending}", has_fields=True)
    np.testing.assert_array_equal(after.world(after.xyz), whole.world(whole.xyz[rows]))
    np.testing.assert_array_equal(
        after.fields["gps_time"].values, whole.fields["gps_time"].values[rows]
    )
    np.testing.assert_array_equal(after.fields["width"].scaled(), part.fields["width"].scaled())


@pytest.mark.parametrize("ending", ["las", "ply", "e57"])
def test_that_a_cloud_read_without_fields_keeps_its_coordinates(
    tmp_path: Path, ending: str
) -> None:
    path = las14(tmp_path / "14.laz")
    io.write(io.read(path), tmp_path / f"a.{ending}")
    after = io.read(tmp_path / f"a.{ending}", has_fields=True)
    np.testing.assert_array_equal(after.world(after.xyz), laspy.read(path).xyz)


@pytest.mark.parametrize(("decimals", "step"), [(1, 0.1), (2, 0.01), (4, 1e-4), (6, 1e-6)])
def test_that_las_gets_the_coarsest_steps_that_carry_all_digits(
    tmp_path: Path, decimals: int, step: float
) -> None:
    points = np.round(random().uniform(-50, 50, (500, 3)) + np.array([1e5, 5e6, 0]), decimals)
    cloud = PointCloud.from_points(points)
    io.write(replace(cloud, xyz=points - cloud.origin), tmp_path / "a.las")
    las = laspy.read(tmp_path / "a.las")
    np.testing.assert_allclose(las.header.scales, step)
    np.testing.assert_array_equal(np.round(las.xyz, decimals), points)


def test_that_points_too_far_for_their_own_offset_stay_on_their_steps(tmp_path: Path) -> None:
    cloud = io.read(las14(tmp_path / "14.laz"), has_fields=True)
    far = replace(cloud, xyz=cloud.xyz + np.array([3_000_000.0, 0, 0]))
    assert not io.write(far, tmp_path / "far.las")
    las = laspy.read(tmp_path / "far.las")
    np.testing.assert_array_equal(las.header.scales, [1e-3, 1e-3, 2e-4])
    np.testing.assert_allclose(las.xyz, far.world(far.xyz), rtol=0, atol=1e-8)


def test_that_moved_points_are_not_put_back_on_the_steps_of_their_file(tmp_path: Path) -> None:
    cloud = io.read(las14(tmp_path / "14.laz"), has_fields=True)
    moved = replace(cloud, xyz=cloud.xyz + 0.0004567)
    io.write(moved, tmp_path / "moved.ply")
    after = io.read(tmp_path / "moved.ply", has_fields=True)
    np.testing.assert_array_equal(after.world(after.xyz), moved.world(moved.xyz))


@pytest.mark.parametrize("ending", ["las", "laz", "ply"])
def test_that_a_unit_which_only_the_user_knew_is_in_the_file(tmp_path: Path, ending: str) -> None:
    points = np.round(random().uniform(0, 30, (500, 3)), 3)
    (tmp_path / "a.xyz").write_text("\n".join(f"{x:.3f} {y:.3f} {z:.3f}" for x, y, z in points))
    cloud = io.read(tmp_path / "a.xyz", length_unit=LengthUnit.FOOT, has_fields=True)
    io.write(cloud, tmp_path / f"a.{ending}")
    after = io.read(tmp_path / f"a.{ending}", has_fields=True)
    assert after.unit == cloud.unit
    np.testing.assert_allclose(after.world(after.xyz), points * 0.3048, rtol=0, atol=1e-9)


def test_that_e57_of_feet_is_in_metres_and_las_of_it_in_feet_again(tmp_path: Path) -> None:
    before = io.read(las12(tmp_path / "12.las"), has_fields=True)
    io.write(before, tmp_path / "a.e57")
    between = io.read(tmp_path / "a.e57", has_fields=True)
    assert str(between.unit) == "m"
    for cloud in (between, replace(between, storage=None)):
        io.write(cloud, tmp_path / "b.las")
        after = io.read(tmp_path / "b.las", has_fields=True)
        assert str(after.unit) == "us-ft"
        np.testing.assert_allclose(
            after.world(after.xyz), before.world(before.xyz), rtol=0, atol=1e-6
        )


def test_that_fields_of_any_kind_and_name_are_kept(tmp_path: Path) -> None:
    rng = random()
    fields = {
        "x": rng.normal(size=N),
        "Größe (m²) of what was scanned by night": rng.normal(size=N).astype("f4"),
        "half": rng.normal(size=N).astype("f2"),
        "yes": rng.random(N) < 0.5,
        "33": rng.integers(0, 255, (N, 33), dtype=np.uint8),
        "five": rng.normal(size=(N, 5)),
        "long": rng.integers(-(2**53), 2**53, N),
        "i": rng.normal(size=N),
        "station": rng.integers(0, 9, N),
    }
    cloud = PointCloud.from_points(xyz())
    cloud = replace(cloud, fields={k: Field(v, 2.0, 1.0, 5.0, "say") for k, v in fields.items()})
    for ending in ("ply", "e57"):
        io.write(cloud, tmp_path / f"a.{ending}")
        after = io.read(tmp_path / f"a.{ending}", has_fields=True)
        assert after.intensity is None
        for name, field in cloud.fields.items():
            again = after.fields[name]
            np.testing.assert_array_equal(again.values, field.values)
            assert again.values.dtype == field.values.dtype
            assert (again.scale, again.offset, again.no_data) == (2.0, 1.0, 5.0)
    io.write(cloud, tmp_path / "a.laz")
    after = io.read(tmp_path / "a.laz", has_fields=True)
    np.testing.assert_array_equal(after.fields["33"].values, fields["33"])
    np.testing.assert_array_equal(after.fields["half"].values, fields["half"])
    for i in range(5):
        np.testing.assert_array_equal(after.fields[f"five_{i}"].values, fields["five"][:, i])


def test_that_whole_numbers_beyond_doubles_are_said(tmp_path: Path) -> None:
    cloud = PointCloud.from_points(xyz())
    cloud = replace(cloud, fields={"far": Field(np.full(N, 2**60 + 1))})
    (note,) = io.write(cloud, tmp_path / "a.ply")
    assert "“a.ply” holds “far” as doubles" in note
    assert not io.write(cloud, tmp_path / "a.laz")
    again = io.read(tmp_path / "a.laz", has_fields=True).fields["far"].values
    np.testing.assert_array_equal(again, 2**60 + 1)


@pytest.mark.parametrize("ending", ["las", "laz", "ply", "e57"])
def test_that_a_cloud_without_points_is_written(tmp_path: Path, ending: str) -> None:
    cloud = io.read(las14(tmp_path / "14.laz"), has_fields=True).take(np.array([], int))
    io.write(cloud, tmp_path / f"a.{ending}")
    with pytest.raises(ReadError, match="no valid points"):
        io.read(tmp_path / f"a.{ending}")


@pytest.mark.parametrize("ending", ["las", "laz", "ply", "e57"])
def test_that_what_is_cancelled_or_fails_leaves_what_was_there(tmp_path: Path, ending: str) -> None:
    class Stop:
        def update(self, stage: str, fraction: float) -> None:
            if fraction > 0:
                raise CancelledError

    cloud = PointCloud.from_points(xyz())
    (tmp_path / f"a.{ending}").write_text("before")
    with pytest.raises(CancelledError):
        io.write(cloud, tmp_path / f"a.{ending}", progress=Stop())
    with pytest.raises(WriteError, match="no folder"):
        io.write(cloud, tmp_path / "none" / f"a.{ending}")
    assert [p.name for p in tmp_path.iterdir()] == [f"a.{ending}"]
    assert (tmp_path / f"a.{ending}").read_text() == "before"


def test_that_other_endings_are_refused_with_those_that_are_written(tmp_path: Path) -> None:
    with pytest.raises(WriteError, match=r"as \.las, \.laz, \.ply or \.e57"):
        io.write(PointCloud.from_points(xyz()), tmp_path / "a.pcd")


def test_that_fields_are_read_anew_for_a_cloud_without_them(tmp_path: Path) -> None:
    path = las14(tmp_path / "14.laz")
    box = [[412_330, 5_654_300, 0], [412_360, 5_654_350, 200]]
    cloud = io.read(path, box=box)
    again = io.with_fields(cloud)
    assert len(again) == len(cloud) > 100
    assert "gps_time" in again.fields
    np.testing.assert_array_equal(again.xyz.astype(np.float32), cloud.xyz)
    with pytest.raises(ReadError, match="not read from a file"):
        io.with_fields(cloud.take(slice(5)))
    las = laspy.read(path)
    las.x = las.x + 1.0
    las.write(path)
    with pytest.raises(ReadError, match=r"14\.laz.*changed"):
        io.with_fields(cloud)


@pytest.mark.parametrize(
    "told",
    [
        b'{"crs":',
        b"[]",
        b'{"crs":"","wkt":"","unit":["m",0,"m",1],"stations":[],"fields":{}}',
        b'{"crs":"","wkt":"","unit":["m",1,"m",1],"stations":[],"fields":{},"storage":{"steps":[0,0,0],'
        b'"offsets":[0,0,0],"unit":["m",1,"m",1],"guid":"","projection":[]}}',
        b'{"crs":"","wkt":"","unit":["m",1,"m",1],"stations":[],"fields":{"nx":{"name":"n",'
        b'"kind":"O8"}}}',
    ],
)
def test_that_damaged_descriptions_are_passed_over(tmp_path: Path, told: bytes) -> None:
    cloud = PointCloud.from_points(xyz())
    io.write(cloud, tmp_path / "a.ply")
    raw = (tmp_path / "a.ply").read_bytes()
    start = raw.index(b"comment pipegui")
    end = raw.index(b"\n", start)
    (tmp_path / "a.ply").write_bytes(raw[:start] + b"comment pipegui " + told + raw[end:])
    assert len(io.read(tmp_path / "a.ply", has_fields=True)) == N


def test_that_the_command_line_converts(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    e57(tmp_path / "scans.e57")
    assert main(["convert", str(tmp_path / "scans.e57"), "-o", str(tmp_path / "a.laz")]) == 0
    said = capsys.readouterr()
    assert said.out == f"3,000 points: {tmp_path / 'a.laz'}\n"
    assert "does not hold where the scanners stood" in said.err
    assert np.bincount(laspy.read(tmp_path / "a.laz").point_source_id).tolist() == [0, 1000, 2000]
    assert main(["convert", str(tmp_path / "a.laz"), "-o", str(tmp_path / "a.xyz")]) == 1
    assert "must end in one of .las, .laz, .ply, .e57" in capsys.readouterr().err


def test_that_another_reader_of_e57_finds_poses_rows_and_bounds(tmp_path: Path) -> None:
    cloud = io.read(e57(tmp_path / "scans.e57"), has_fields=True)
    io.write(cloud, tmp_path / "a.e57")
    file = pye57.E57(str(tmp_path / "a.e57"))
    assert file.scan_count == 2
    n = 0
    for i in range(2):
        header = file.get_header(i)
        data = file.read_scan(
            i, intensity=True, colors=True, row_column=True, ignore_missing_fields=True
        )
        found = np.stack([data[f"cartesian{axis}"] for axis in "XYZ"], axis=1)
        rows = slice(n, n + len(found))
        np.testing.assert_allclose(found, cloud.world(cloud.xyz[rows]), rtol=0, atol=1e-8)
        np.testing.assert_array_equal(data["rowIndex"], cloud.fields["rowIndex"].values[rows])
        bounds = [header.cartesianBounds[f"{a}{e}"].value() for e in ENDS for a in "xyz"]
        local = found - header.translation
        expected = [*local.min(axis=0), *local.max(axis=0)]
        np.testing.assert_allclose(bounds, expected, rtol=0, atol=1e-8)
        n += len(found)
    assert n == N
