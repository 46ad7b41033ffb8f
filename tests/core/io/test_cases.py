"""Files with quirks are read as they are meant, and what was left out or assumed is said."""

import re
from pathlib import Path
from typing import Any

import laspy
import numpy as np
import pytest

from pipecore import io
from pipecore.errors import ReadError
from pipecore.settings import FlaggedPoints, LengthUnit
from tests.core.io.cases import (
    CASES,
    DEGREES,
    US_FOOT,
    UTM,
    WKT_DEGREES,
    Case,
    class_7,
    columns_of,
    keys,
    las_with,
    pipe,
    text,
    withheld,
)
from tests.core.io.writers import cartesian, write_e57
from tests.ply import write_ply


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_that_the_pipe_is_read_and_its_quirks_are_said(tmp_path: Path, case: Case) -> None:
    xyz = pipe()
    path = case.write(tmp_path / case.name, xyz)
    cloud = io.read(path)
    world = cloud.world(cloud.xyz.astype(float))
    expected = np.resize(xyz, (len(world), 3)) + case.shift
    assert len(world) % len(xyz) == 0
    assert np.abs(world - expected).max() <= case.tolerance
    assert cloud.xyz.dtype == np.float32
    assert cloud.crs == case.crs
    assert_said(cloud.notes, case.notes)
    if case.intensity is not None:
        assert (cloud.intensity == case.intensity).all()
    assert (cloud.rgb is not None and cloud.rgb.any()) == (case.rgb is not None)
    if case.rgb is not None:
        assert (cloud.rgb == case.rgb).all()


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_that_info_counts_and_says_what_read_does(tmp_path: Path, case: Case) -> None:
    path = case.write(tmp_path / case.name, pipe())
    cloud, info = io.read(path), io.info(path)
    assert info.n_points == len(cloud)
    assert info.crs == cloud.crs
    assert info.notes == cloud.notes
    world = cloud.world(cloud.xyz.astype(float)) / cloud.unit.factors
    np.testing.assert_allclose(info.minimum, world.min(axis=0), atol=2e-4)
    np.testing.assert_allclose(info.maximum, world.max(axis=0), atol=2e-4)


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_that_the_files_of_these_kinds_are_read(shared_data: Path, case: Case) -> None:
    path = shared_data.parent / "cases" / case.name
    cloud, info = io.read(path), io.info(path)
    assert info.n_points == len(cloud) >= 14_602
    patterns = [re.sub(r"^[\d,]+ ", "", pattern) for pattern in case.notes]
    assert_said([n for n in cloud.notes if "rounded to 50" not in str(n)], patterns)
    world = cloud.world(cloud.xyz.astype(float))
    if "usft_wkt" not in case.name and "600k" not in case.name:
        # The same pipe: 1.5 m long, from about (10, 20, 3) m on.
        size = world.max(axis=0) - world.min(axis=0)
        np.testing.assert_allclose(size, [1.4, 0.704, 0.339], atol=0.012)
        np.testing.assert_allclose(world.min(axis=0) - case.shift, [9.98, 19.95, 2.94], atol=0.01)


def assert_said(notes: Any, patterns: Any) -> None:
    said = [str(note) for note in notes]
    assert len(said) == len(patterns), said
    for text_of, pattern in zip(said, patterns, strict=True):
        assert re.search(pattern, text_of), text_of


def test_that_a_header_without_an_extent_is_said(tmp_path: Path) -> None:
    case = next(case for case in CASES if case.name == "laz_header_box_zero_600k.laz")
    xyz = pipe()
    info = io.info(case.write(tmp_path / "a.laz", xyz))
    assert_said(info.notes, ["gives a wrong extent"])
    np.testing.assert_allclose(info.maximum - info.minimum, np.ptp(xyz, axis=0), atol=1e-9)


@pytest.mark.parametrize("write", [class_7, withheld, lambda p, x: withheld(p, x, 1)])
@pytest.mark.parametrize("name", ["a.las", "a.laz"])
def test_that_flagged_points_can_be_kept(tmp_path: Path, write: Any, name: str) -> None:
    path = write(tmp_path / name, pipe())
    assert len(io.read(path)) == 2000
    kept = io.read(path, flagged_points=FlaggedPoints.KEEP)
    assert len(kept) == io.info(path, flagged_points=FlaggedPoints.KEEP).n_points == 4000
    assert not kept.notes


def test_that_a_file_of_nothing_but_noise_says_so(tmp_path: Path) -> None:
    path = las_with(tmp_path / "a.las", pipe(), classification=np.full(2000, 7, np.uint8))
    for act in (io.read, io.info):
        with pytest.raises(ReadError, match="all 2,000 are marked"):
            act(path)


def test_that_two_systems_are_refused_by_name(tmp_path: Path) -> None:
    west, east = (
        las_with(
            tmp_path / f"{code}.las", pipe() + np.array(UTM),
            vlrs=((34735, keys((1024, 0, 1, 1), (3072, 0, 1, code))),),
        )
        for code in (25832, 25833)
    )  # fmt: skip
    with pytest.raises(ReadError, match=r"25832\.las” is in “EPSG:25832”.*25833\.las” in “EPSG:25"):
        io.read([west, east])
    plain = text(tmp_path / "a.xyz", pipe() + np.array(UTM), "{:.4f} {:.4f} {:.4f}")
    assert len(io.read([plain, west])) == 4000


def test_that_one_system_by_code_and_by_text_is_one(tmp_path: Path) -> None:
    from pyproj import CRS

    by_text = CRS.from_epsg(25832).to_wkt("WKT1_GDAL").encode()
    paths = [
        las_with(tmp_path / "a.las", pipe(), vlrs=((34735, keys((3072, 0, 1, 25832))),)),
        las_with(tmp_path / "b.las", pipe(), point_format=6, vlrs=((2112, by_text),)),
    ]
    assert io.read(paths).crs == "EPSG:25832"
    assert io.read(paths[::-1]).crs == "ETRS89 / UTM zone 32N"


@pytest.mark.parametrize(
    ("vlrs", "name"),
    [
        (((2112, WKT_DEGREES.encode()),), r"\(WGS 84\)"),
        (((34735, keys((1024, 0, 1, 2), (2048, 0, 1, 4326))),), r"\(EPSG:4326\)"),
        ((), "look like degrees"),
    ],
)
def test_that_degrees_are_said(tmp_path: Path, vlrs: Any, name: str) -> None:
    xyz = [11, 48, 0] + (pipe() - [10, 20, 0]) * DEGREES
    path = las_with(tmp_path / "a.las", xyz, scales=(1e-9, 1e-9, 1e-4), vlrs=vlrs, point_format=6)
    cloud, info = io.read(path), io.info(path)
    assert_said(cloud.notes, [f"degrees.*{name}" if vlrs else name])
    assert info.notes == cloud.notes


def test_that_steps_of_32_bit_numbers_are_said(tmp_path: Path) -> None:
    xyz = (pipe() + np.array(UTM)).astype(np.float32)
    cloud = io.read(write_ply(tmp_path / "a.ply", {"vertex": columns_of(xyz, "f4")}))
    assert_said(cloud.notes, ["32-bit numbers.*step by 0.5 m"])
    assert cloud.step == 0.5


def test_that_fine_coordinates_and_regular_grids_are_no_rounded_ones(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    x, y = np.divmod(np.arange(10_000), 100)
    grid = np.stack([x * 0.01, y * 0.01, rng.normal(0, 0.001, 10_000)], axis=1)
    for name, xyz in (("grid", grid), ("fine", pipe())):
        cloud = io.read(write_ply(tmp_path / f"{name}.ply", {"vertex": columns_of(xyz)}))
        assert not cloud.notes
        assert cloud.step == 0


def test_that_a_unit_that_makes_no_sense_is_said(tmp_path: Path) -> None:
    path = write_ply(tmp_path / "a.ply", {"vertex": columns_of(1000 * pipe())})
    assert_said(io.read(path).notes, ["is in m, its points are .* such as mm"])
    right = io.read(path, length_unit=LengthUnit.MILLIMETRE)
    assert not right.notes
    assert np.abs(right.world(right.xyz.astype(float)) - pipe()).max() < 1e-4
    wrong = write_ply(tmp_path / "b.ply", {"vertex": columns_of(pipe())})
    assert_said(io.read(wrong, length_unit=LengthUnit.MILLIMETRE).notes, ["is in mm.* such as m"])


def test_that_a_given_unit_wins_over_the_system(tmp_path: Path) -> None:
    feet = next(case for case in CASES if case.name == "las_usft_wkt.las")
    cloud = io.read(feet.write(tmp_path / "a.las", pipe()), length_unit=LengthUnit.METRE)
    world = cloud.world(cloud.xyz.astype(float))
    assert np.abs(world - pipe() / US_FOOT).max() < 1e-4
    assert not cloud.notes


@pytest.mark.parametrize("stray", [(0, 0, 0), (-9999, -9999, -9999), (1e7, 1e7, 1e7)])
@pytest.mark.parametrize("at", [0, 1000, 2000])
@pytest.mark.parametrize("in_files", [False, True])
def test_that_stray_points_are_left_out_wherever_they_stand(
    tmp_path: Path, stray: Any, at: int, in_files: bool
) -> None:
    xyz = pipe() + np.array(UTM)
    path = write_ply(tmp_path / "a.ply", {"vertex": columns_of(np.insert(xyz, at, stray, axis=0))})
    cloud = io.read(path, folder=tmp_path if in_files else None)
    assert np.abs(cloud.world(cloud.xyz.astype(float)) - xyz).max() < 1e-4
    assert cloud.xyz.dtype == np.float32
    assert len(cloud.notes) == 1
    assert ": 1 of its points" in str(cloud.notes[0])
    info = io.info(path)
    assert (info.n_points, info.notes) == (2000, cloud.notes)
    np.testing.assert_allclose(info.minimum, xyz.min(axis=0), atol=1e-6)


def test_that_a_second_place_is_no_stray(tmp_path: Path) -> None:
    xyz = np.vstack([pipe(), pipe(100) + np.array([20_000, 0, 0])])
    cloud = io.read(write_ply(tmp_path / "a.ply", {"vertex": columns_of(xyz)}))
    assert len(cloud) == 2100
    assert cloud.xyz.dtype == np.float64


def test_that_many_points_at_zero_are_no_measurements_but_one_amid_others_is(
    tmp_path: Path,
) -> None:
    around = pipe() - pipe().mean(axis=0)
    for n, n_kept in ((1, 2001), (50, 2000)):
        xyz = np.vstack([np.zeros((n, 3)), around])
        path = write_ply(tmp_path / "a.ply", {"vertex": columns_of(xyz)})
        assert len(io.read(path)) == io.info(path).n_points == n_kept


def test_that_an_empty_scan_beside_a_full_one_is_said(tmp_path: Path) -> None:
    xyz = pipe()
    scans = [{"columns": cartesian(np.empty((0, 3)))}, {"columns": cartesian(xyz)}]
    cloud = io.read(write_e57(tmp_path / "a.e57", scans))
    assert np.abs(cloud.world(cloud.xyz.astype(float)) - xyz).max() < 1e-4
    assert_said(cloud.notes, ["Scan 1 of “a.e57” holds no points"])


@pytest.mark.parametrize(("version", "point_format"), [("1.2", 1), ("1.4", 1), ("1.4", 6)])
def test_that_points_which_no_header_announces_are_read(
    tmp_path: Path, version: str, point_format: int
) -> None:
    header = laspy.LasHeader(version=version, point_format=point_format)
    header.scales = np.full(3, 1e-4)
    las = laspy.LasData(header)
    las.xyz = pipe()
    las.write(tmp_path / "a.las")
    raw = bytearray((tmp_path / "a.las").read_bytes())
    raw[107:111] = bytes(4)
    if version == "1.4":
        raw[247:255] = bytes(8)
    (tmp_path / "a.las").write_bytes(raw)
    cloud = io.read(tmp_path / "a.las")
    np.testing.assert_allclose(cloud.world(cloud.xyz), pipe(), atol=1e-4)
    assert_said(cloud.notes, ["announces no points; the 2,000 that it holds were read"])
    assert io.info(tmp_path / "a.las").n_points == 2000


def test_that_lists_before_coordinates_in_text_are_passed_over(tmp_path: Path) -> None:
    header = "ply\nformat ascii 1.0\nelement vertex 2000\nproperty list uchar int a\n"
    header += "property double x\nproperty double y\nproperty list uchar int b\n"
    header += "property double z\nproperty uchar red\nproperty uchar green\n"
    header += "property uchar blue\nend_header\n"
    rows = [
        f"{i % 3}{' 7' * (i % 3)} {x:.4f} {y:.4f} 1 9 {z:.4f} 10 20 30\n"
        for i, (x, y, z) in enumerate(pipe())
    ]
    (tmp_path / "a.ply").write_text(header + "".join(rows))
    cloud = io.read(tmp_path / "a.ply")
    np.testing.assert_allclose(cloud.world(cloud.xyz), pipe(), atol=1e-5)
    assert (cloud.rgb == [10, 20, 30]).all()
    (tmp_path / "a.ply").write_text(header + "".join(rows)[:-12])
    with pytest.raises(ReadError, match="truncated"):
        io.read(tmp_path / "a.ply")


def test_that_gaps_next_to_nothing_are_no_steps(tmp_path: Path) -> None:
    xyz = np.repeat(pipe(), 2, axis=0)
    xyz[:50] *= 5e-320
    path = write_ply(tmp_path / "a.ply", {"vertex": columns_of(xyz)})
    assert len(io.read(path)) == io.info(path).n_points
