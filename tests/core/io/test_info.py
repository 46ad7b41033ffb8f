from pathlib import Path

import numpy as np
import pytest

from pipecore import io
from pipecore.types import PointCloud
from tests.core.io.writers import (
    Points,
    cartesian,
    integers,
    write_e57,
    write_las,
    write_pcd,
)

SPACING = 0.01


def write_wall(path: Path, order: np.ndarray, n: int) -> None:
    """Write a wall of n × n points, 10 mm apart, in some order."""
    y, z = np.divmod(np.arange(n * n), n)
    xyz = np.stack([np.zeros(n * n), y, z], axis=1) * SPACING
    io.write_laz(path, PointCloud(np.array([5e5, 5e6, 0.0]), xyz[order].astype(np.float32)))


@pytest.mark.parametrize("name", ["scan.las", "scan.laz", "scan.pcd"])
def test_that_a_file_is_described(tmp_path: Path, points: Points, name: str) -> None:
    path = tmp_path / name
    if name.endswith("pcd"):
        write_pcd(path, points, "binary")
    else:
        write_las(path, points)
    info = io.info(path)
    assert info.n_points == 1000
    assert info.format == ("PCD" if name.endswith("pcd") else "LAS/LAZ")
    np.testing.assert_allclose(info.minimum, points.xyz.min(axis=0), atol=1e-4)
    np.testing.assert_allclose(info.maximum, points.xyz.max(axis=0), atol=1e-4)
    assert "intensity" in info.fields
    assert info.n_scans == 1


def test_that_invalid_points_do_not_count(tmp_path: Path, points: Points) -> None:
    state = np.arange(1000) % 2
    scan = {
        "columns": cartesian(points.xyz) | {"cartesianInvalidState": state},
        "nodes": {"cartesianInvalidState": integers(0, 2)},
        "translation": (0, 0, 0),
    }
    info = io.info(write_e57(tmp_path / "a.e57", [scan, scan], crs="My grid"))
    assert info.n_points == 1000
    assert info.n_scans == 2
    assert info.n_stations == 2
    assert info.crs == "My grid"
    np.testing.assert_allclose(info.minimum, points.xyz[::2].min(axis=0))


@pytest.mark.parametrize("is_shuffled", [False, True])
@pytest.mark.parametrize("n", [300, 900])
def test_that_the_spacing_is_that_of_all_points_whatever_their_order(
    tmp_path: Path, rng: np.random.Generator, is_shuffled: bool, n: int
) -> None:
    # The larger wall has more points than are looked at.
    order = rng.permutation(n * n) if is_shuffled else np.arange(n * n)
    write_wall(tmp_path / "wall.laz", order, n)
    spacing = io.info(tmp_path / "wall.laz").spacing
    # A thinned grid is one of many; a random pattern is nearer to its neighbours than a grid.
    tolerance = 0.5 if is_shuffled and n == 900 else 0.02
    assert spacing == pytest.approx(SPACING, rel=tolerance)


def test_that_the_spacing_of_the_pump_is_known(shared_data: Path) -> None:
    assert io.info(shared_data / "pump_visual_ref.e57").spacing == pytest.approx(0.0046, rel=0.05)


def test_that_one_point_has_no_spacing(tmp_path: Path) -> None:
    (tmp_path / "a.xyz").write_text("1 2 3\n")
    assert np.isnan(io.info(tmp_path / "a.xyz").spacing)
