from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pye57 import libe57

from pipecore import io
from pipecore.errors import ReadError
from tests.core.io.writers import CARTESIAN, SPHERICAL, cartesian, integers, write_e57

PAGE = 1024
"""Bytes of a page of E57; its last four are the checksum of the others."""


def test_that_points_come_back_within_a_tenth_of_a_millimetre_at_ten_thousand_kilometres(
    tmp_path: Path, points: Any
) -> None:
    columns = cartesian(points.xyz) | {"intensity": points.intensity}
    cloud = io.read(write_e57(tmp_path / "a.e57", [{"columns": columns}], crs="My grid"))
    assert points.hold(cloud)
    np.testing.assert_array_equal(cloud.intensity, points.intensity)
    assert cloud.crs == "My grid"
    assert np.isnan(cloud.stations).all()


def test_that_scans_come_together_in_their_poses(tmp_path: Path, points: Any) -> None:
    half = np.sqrt(0.5)
    places = np.array([[1e7, 5.4e6, 100.0], [1e7 + 20, 5.4e6 - 7, 102.0]])
    turns = [np.eye(3), np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])]  # A quarter about z.
    scans = [
        {
            "columns": cartesian((points.xyz - place) @ turn),
            "rotation": quaternion,
            "translation": place,
        }
        for place, turn, quaternion in zip(
            places, turns, [(1, 0, 0, 0), (half, 0, 0, half)], strict=True
        )
    ]
    cloud = io.read(write_e57(tmp_path / "two.e57", scans))
    world = cloud.world(cloud.xyz.astype(float))
    np.testing.assert_allclose(world, np.vstack([points.xyz, points.xyz]), rtol=0, atol=1e-4)
    np.testing.assert_allclose(cloud.world(cloud.stations), places, rtol=0, atol=1e-6)


def test_that_spherical_coordinates_are_the_same_points(tmp_path: Path, points: Any) -> None:
    place = np.array([1e7, 5.4e6, 100.0])
    x, y, z = (points.xyz - place).T
    reach = np.sqrt(x * x + y * y + z * z)
    values = (reach, np.arctan2(y, x), np.arcsin(z / reach))
    scan = {"columns": dict(zip(SPHERICAL, values, strict=True)), "translation": place}
    cloud = io.read(write_e57(tmp_path / "a.e57", [scan]))
    assert points.hold(cloud)
    np.testing.assert_allclose(cloud.world(cloud.stations), [place])


def test_that_a_scan_without_pose_shows_its_station_only_in_spherical_coordinates(
    tmp_path: Path,
) -> None:
    scan = {"columns": dict(zip(SPHERICAL, np.ones((3, 5)), strict=True))}
    cloud = io.read(write_e57(tmp_path / "a.e57", [scan]))
    np.testing.assert_allclose(cloud.world(cloud.stations), [[0, 0, 0]])


@pytest.mark.parametrize("names", [CARTESIAN, SPHERICAL])
def test_that_points_marked_invalid_are_left_out(
    tmp_path: Path, rng: np.random.Generator, names: tuple[str, ...]
) -> None:
    state = rng.integers(0, 3, 500)
    state[0] = 0
    kind = names[0].removesuffix("X").removesuffix("Range")
    columns = dict(zip(names, rng.uniform(0.1, 1, (3, 500)), strict=True))
    columns |= {f"{kind}InvalidState": state, "intensity": np.arange(500)}
    nodes = {f"{kind}InvalidState": integers(0, 2)}
    scan = {"columns": columns, "nodes": nodes}
    cloud = io.read(write_e57(tmp_path / "a.e57", [scan]))
    np.testing.assert_array_equal(cloud.intensity, np.flatnonzero(state == 0))


def test_that_scaled_integers_are_scaled(tmp_path: Path, points: Any) -> None:
    def scaled(offset: float) -> Any:
        return lambda image: libe57.ScaledIntegerNode(image, 0, -(2**30), 2**30, 1e-4, offset)

    offsets = np.round(points.xyz.mean(axis=0))
    nodes = {name: scaled(o) for name, o in zip(CARTESIAN, offsets, strict=True)}
    scan = {"columns": cartesian(points.xyz), "nodes": nodes}
    assert points.hold(io.read(write_e57(tmp_path / "a.e57", [scan])))


@pytest.mark.parametrize("high", [255, 65535])
@pytest.mark.parametrize("has_limits", [True, False])
def test_that_colours_are_scaled_by_their_limits(
    tmp_path: Path, points: Any, high: int, has_limits: bool
) -> None:
    names = ("colorRed", "colorGreen", "colorBlue")
    columns = cartesian(points.xyz)
    columns |= dict(zip(names, points.rgb.T.astype(float) * (high // 255), strict=True))
    limits = {n + end: v for n in names for end, v in (("Minimum", 0), ("Maximum", high))}
    scan = {
        "columns": columns,
        "nodes": {name: integers(0, high) for name in names},
        "limits": limits if has_limits else None,
    }
    cloud = io.read(write_e57(tmp_path / "a.e57", [scan]))
    np.testing.assert_array_equal(cloud.rgb, points.rgb)


def test_that_a_scan_without_points_does_not_hide_the_others(tmp_path: Path, points: Any) -> None:
    empty = {"columns": cartesian(np.empty((0, 3)))}
    path = write_e57(tmp_path / "a.e57", [empty, {"columns": cartesian(points.xyz)}, empty])
    assert points.hold(io.read(path))
    info = io.info(path)
    assert info.n_scans == 1
    assert sum("holds no points" in str(note) for note in info.notes) == 2


def test_that_a_scan_without_points_alone_is_told(tmp_path: Path) -> None:
    path = write_e57(tmp_path / "a.e57", [{"columns": cartesian(np.empty((0, 3)))}])
    with pytest.raises(ReadError, match=r"a\.e57.*no valid points"):
        io.read(path)


def test_that_a_page_that_does_not_fit_its_checksum_is_told(tmp_path: Path, points: Any) -> None:
    path = write_e57(tmp_path / "a.e57", [{"columns": cartesian(points.xyz)}])
    raw = bytearray(path.read_bytes())
    raw[PAGE + 100] ^= 0xFF
    path.write_bytes(raw)
    with pytest.raises(ReadError, match=r"a\.e57.*checksum"):
        io.read(path)
    assert path.exists()


def test_that_a_file_that_cannot_be_opened_stays_where_it_is(shared_data: Path) -> None:
    path = shared_data / "formats" / "corrupt_crc.e57"
    with pytest.raises(ReadError, match=r"corrupt_crc\.e57.*checksum"):
        io.read(path)
    assert path.exists()


@pytest.mark.parametrize(
    ("name", "n_points"),
    [
        ("bunnyInt24.e57", 30571),
        ("cartesian_invalid_state_single.e57", 1),
        ("pdal_A_moved_B.e57", 6),
        ("tinyCartesianFloatRgb.e57", 2090),
        ("tiny_spherical.e57", 180),
    ],
)
def test_that_odd_files_of_other_programs_are_read(
    shared_data: Path, name: str, n_points: int
) -> None:
    assert len(io.read(shared_data / "formats" / name)) == n_points


def test_that_a_translation_without_rotation_is_applied(shared_data: Path) -> None:
    cloud = io.read(shared_data / "formats" / "pye57_translationWithoutRotation.e57")
    np.testing.assert_allclose(cloud.world(cloud.stations), [[4, 5, 6]])
    world = cloud.world(cloud.xyz.astype(float))
    assert world.min(axis=0) == pytest.approx([4, 5, 6], abs=1e-5)


def test_that_an_empty_scan_is_told(shared_data: Path) -> None:
    with pytest.raises(ReadError, match=r"empty_pc\.e57.*no valid points"):
        io.read(shared_data / "formats" / "empty_pc.e57")


def test_that_the_pump_is_read_whole(shared_data: Path) -> None:
    cloud = io.read(shared_data / "pump_visual_ref.e57")
    assert len(cloud) == 155_201
    np.testing.assert_allclose(np.ptp(cloud.xyz, axis=0), [4.6, 4.5, 3.7], atol=0.1)
    assert cloud.intensity is not None
    assert cloud.rgb is not None
    assert np.ptp(cloud.rgb) > 100
