from pathlib import Path

import laspy
import numpy as np
import pytest

from pipecore import io
from pipecore.errors import CancelledError
from pipecore.settings import LengthUnit
from pipecore.types import PointCloud
from pipecore.units import FileUnit
from tests.core.io.writers import FAR, Points


def make_cloud(points: Points) -> PointCloud:
    return PointCloud(
        origin=FAR,
        xyz=(points.xyz - FAR).astype(np.float32),
        intensity=points.intensity.astype(np.float32),
        rgb=points.rgb,
        classification=(points.intensity % 7).astype(np.uint8),
    )


@pytest.mark.parametrize("unit", list(LengthUnit)[1:])
def test_that_a_cloud_comes_back_as_it_was(
    tmp_path: Path, points: Points, unit: LengthUnit
) -> None:
    path = tmp_path / "segments.laz"
    io.write_laz(path, make_cloud(points), unit=FileUnit.of(unit))
    cloud = io.read(path, length_unit=unit)
    assert points.hold(cloud)
    np.testing.assert_array_equal(cloud.intensity, points.intensity)
    np.testing.assert_array_equal(cloud.rgb, points.rgb)
    np.testing.assert_array_equal(cloud.classification, points.intensity % 7)


def test_that_other_programs_see_world_coordinates_and_the_extra_values(
    tmp_path: Path, points: Points, rng: np.random.Generator
) -> None:
    n = len(points.xyz)
    extra = {
        "segment": rng.integers(0, 2**31 - 1, n).astype(np.int32),
        "deviation_mm": rng.normal(size=n).astype(np.float32),
        "is_pipe": rng.random(n) < 0.5,
        "time": rng.normal(size=n),
    }
    io.write_laz(tmp_path / "segments.laz", make_cloud(points), extra)
    las = laspy.read(tmp_path / "segments.laz")
    assert np.abs(las.xyz - points.xyz).max() <= 1e-4
    for name, values in extra.items():
        np.testing.assert_array_equal(las[name], values)
    np.testing.assert_allclose(las.header.mins, points.xyz.min(axis=0), atol=1e-4)
    np.testing.assert_allclose(las.header.maxs, points.xyz.max(axis=0), atol=1e-4)
    assert las.header.global_encoding.wkt


@pytest.mark.parametrize(
    ("values", "written"),
    [([-2048, 0, 2047], [0, 32776, 65535]), ([0, 0.5, 1], [0, 32768, 65535]), ([3, 3], [3, 3])],
)
def test_that_intensities_that_las_cannot_hold_are_stretched(
    tmp_path: Path, values: list[float], written: list[int]
) -> None:
    intensity = np.array(values, dtype=np.float32)
    xyz = np.zeros((len(values), 3), dtype=np.float32)
    io.write_laz(tmp_path / "a.laz", PointCloud(np.zeros(3), xyz, intensity=intensity))
    assert laspy.read(tmp_path / "a.laz").intensity.tolist() == pytest.approx(written, abs=1)


def test_that_a_cloud_without_points_can_be_written(tmp_path: Path) -> None:
    cloud = PointCloud(np.zeros(3), np.empty((0, 3), dtype=np.float32))
    io.write_laz(tmp_path / "a.laz", cloud, {"segment": np.empty(0, dtype=np.int32)})
    assert len(laspy.read(tmp_path / "a.laz")) == 0


@pytest.mark.parametrize("width", [3e6, 2e9])
def test_that_a_cloud_too_wide_for_las_is_written_in_coarser_steps(
    tmp_path: Path, width: float
) -> None:
    xyz = np.array([[0, 0, 0], [width, 0, 0]])
    (note,) = io.write_laz(tmp_path / "a.laz", PointCloud(np.zeros(3), xyz))
    step = laspy.read(tmp_path / "a.laz").header.scales[0]
    assert f"“a.laz” they are rounded to {1000 * step:.3g} mm" in note
    assert np.abs(laspy.read(tmp_path / "a.laz").xyz - xyz).max() <= step / 2
    assert width / 2**32 < step <= 10 * width / 2**32


def test_that_cancelling_leaves_nothing(tmp_path: Path, points: Points) -> None:
    class Stop:
        def update(self, stage: str, fraction: float) -> None:
            assert stage == "writing"
            if fraction == 1:
                raise CancelledError

    with pytest.raises(CancelledError):
        io.write_laz(tmp_path / "a.laz", make_cloud(points), progress=Stop())
    assert list(tmp_path.iterdir()) == []


def test_that_extra_values_of_another_number_are_a_mistake(tmp_path: Path, points: Points) -> None:
    with pytest.raises(ValueError, match="segment"):
        io.write_laz(tmp_path / "a.laz", make_cloud(points), {"segment": np.zeros(3)})
