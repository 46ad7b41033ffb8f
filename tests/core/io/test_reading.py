import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipecore import io
from pipecore.errors import CancelledError, ReadError
from pipecore.io import reading
from pipecore.io.formats import las
from pipecore.settings import LengthUnit
from pipecore.types import PointCloud


class Recorder:
    def __init__(self, stop_after: int | None = None) -> None:
        self.fractions: list[float] = []
        self.stop_after = stop_after

    def update(self, stage: str, fraction: float) -> None:
        assert stage == "reading"
        self.fractions.append(fraction)
        if self.stop_after is not None and len(self.fractions) > self.stop_after:
            raise CancelledError


def write_text(path: Path, xyz: Any, more: str = "") -> Path:
    path.write_text("".join(f"{x!r} {y!r} {z!r}{more}\n" for x, y, z in np.asarray(xyz).tolist()))
    return path


def test_that_several_files_become_one_cloud_in_one_frame(tmp_path: Path, points: Any) -> None:
    paths = [
        write_text(tmp_path / "a.xyz", points.xyz[:300], " 7"),
        write_text(tmp_path / "b.xyz", points.xyz[300:]),
    ]
    cloud = io.read(paths)
    assert points.hold(cloud)
    # What only one file has is zero for the other.
    np.testing.assert_array_equal(cloud.intensity, np.repeat([7, 0], [300, 700]))
    swapped = io.read(paths[::-1])
    np.testing.assert_array_equal(swapped.intensity, np.repeat([0, 7], [700, 300]))


@pytest.mark.parametrize("unit", list(LengthUnit)[1:])
def test_that_the_length_unit_makes_metres(tmp_path: Path, points: Any, unit: LengthUnit) -> None:
    path = write_text(tmp_path / "a.xyz", points.xyz / unit.metres)
    assert points.hold(io.read(path, length_unit=unit))


def test_that_the_origin_is_round_and_near(tmp_path: Path, points: Any) -> None:
    cloud = io.read(write_text(tmp_path / "a.xyz", points.xyz))
    assert (cloud.origin % 100 == 0).all()
    assert np.abs(cloud.xyz).max() < 200
    assert cloud.xyz.flags.c_contiguous
    assert cloud.source == tmp_path / "a.xyz"


@pytest.mark.parametrize(("extent", "dtype"), [(900, np.float32), (9000, np.float64)])
def test_that_precision_follows_the_extent(
    tmp_path: Path, rng: np.random.Generator, extent: float, dtype: type
) -> None:
    # The wide part comes last, when the first is stored already.
    near = 1e7 + rng.uniform(-5, 5, (100_000, 3))
    # Not so far from each other that they would be stray.
    wide = 1e7 + np.outer(np.linspace(-0.5, 0.5, 60) * extent, [1, 0, 0]) + [0, 0, 0.1234]
    xyz = np.vstack([near, wide])
    cloud = io.read(write_text(tmp_path / "a.xyz", xyz))
    assert cloud.xyz.dtype == dtype
    world = cloud.world(cloud.xyz.astype(np.float64))
    assert np.abs(world - xyz).max() < 1e-4


def test_that_progress_rises_to_one(tmp_path: Path, rng: np.random.Generator) -> None:
    paths = [write_text(tmp_path / f"{i}.xyz", rng.uniform(0, 9, (40_000, 3))) for i in range(3)]
    recorder = Recorder()
    io.read(paths, progress=recorder)
    assert recorder.fractions[0] == 0
    assert recorder.fractions[-1] == 1
    assert recorder.fractions == sorted(recorder.fractions)
    assert len(recorder.fractions) > 5


@pytest.mark.parametrize("name", ["a.las", "a.laz", "a.xyz"])
def test_that_a_chunk_is_read_in_less_than_half_a_second(
    tmp_path: Path, rng: np.random.Generator, name: str
) -> None:
    import time

    n = 260_000
    xyz = rng.uniform(0, 50, (n, 3)).astype(np.float32)
    if name == "a.xyz":
        np.savetxt(tmp_path / name, xyz, "%.4f")
    else:
        io.write_laz(tmp_path / "a.laz", PointCloud(np.zeros(3), xyz))
        if name == "a.las":
            import laspy

            laspy.read(tmp_path / "a.laz").write(tmp_path / name)
    io.read(tmp_path / name)  # Libraries are loaded.
    gaps: list[float] = []

    class Clock:
        last = time.process_time()

        def update(self, stage: str, fraction: float) -> None:
            gaps.append(time.process_time() - self.last)
            self.last = time.process_time()

    io.read(tmp_path / name, progress=Clock())
    assert max(gaps) < 0.5


@pytest.mark.parametrize("stop_after", [0, 1, 2])
def test_that_cancelling_passes_through(
    tmp_path: Path, rng: np.random.Generator, stop_after: int
) -> None:
    path = write_text(tmp_path / "a.xyz", rng.uniform(0, 9, (120_000, 3)))
    with pytest.raises(CancelledError):
        io.read(path, progress=Recorder(stop_after))
    with pytest.raises(CancelledError):
        io.info(path, progress=Recorder(stop_after))


def test_that_an_error_of_the_caller_is_not_taken_for_one_of_the_file(
    tmp_path: Path, points: Any
) -> None:
    class Broken:
        def update(self, stage: str, fraction: float) -> None:
            if fraction > 0:
                raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        io.read(write_text(tmp_path / "a.xyz", points.xyz), progress=Broken())


@pytest.mark.parametrize("function", [io.read, io.info])
@pytest.mark.parametrize(
    ("make", "cause"),
    [
        (lambda p: None, "There is no file"),
        (lambda p: p.mkdir(), "is a folder"),
        (lambda p: p.write_bytes(b""), "is empty"),
        (lambda p: p.write_bytes(b"\x89PNG\r\n\x1a\n\0\0"), "does not begin like one"),
        (lambda p: p.write_bytes(b"LASF"), "damaged"),
        (lambda p: p.write_bytes(b"ASTM-E57" + bytes(40)), "damaged"),
    ],
)
def test_that_what_is_no_point_cloud_is_told(
    tmp_path: Path, function: Any, make: Any, cause: str
) -> None:
    path = tmp_path / "thing.las"
    make(path)
    with pytest.raises(ReadError, match=cause) as caught:
        function(path)
    assert "thing.las" in str(caught.value)


def test_that_an_unknown_kind_is_told_with_the_known_ones(tmp_path: Path) -> None:
    path = tmp_path / "notes.doc"
    path.write_bytes(b"\xd0\xcf\x11\xe0 some document\0")
    with pytest.raises(ReadError, match=r"notes\.doc.*LAS/LAZ, E57, PLY, PCD"):
        io.read(path)


@pytest.mark.skipif(
    not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may read everything"
)
def test_that_a_file_without_permission_is_told(tmp_path: Path) -> None:
    path = tmp_path / "secret.xyz"
    path.write_text("1 2 3\n")
    path.chmod(0)
    with pytest.raises(ReadError, match=r"permission.*secret\.xyz"):
        io.read(path)


def test_that_a_missing_permission_is_told_to_whoever_runs_the_tests(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write_text(tmp_path / "secret.xyz", [[1.0, 2.0, 3.0]])

    def refuse(*args: Any, **kwargs: Any) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "open", refuse)
    with pytest.raises(ReadError, match=r"permission.*secret\.xyz"):
        io.read(path)


def test_that_no_file_at_all_is_told() -> None:
    with pytest.raises(ReadError, match="No file"):
        io.read([])


@pytest.mark.parametrize("ending", [".las", ".e57", ".ply", "", ".dat", ".PTS"])
def test_that_contents_count_and_not_the_ending(tmp_path: Path, points: Any, ending: str) -> None:
    assert points.hold(io.read(write_text(tmp_path / f"scan{ending}", points.xyz)))


def test_that_las_is_read_under_a_text_files_name(tmp_path: Path, rng: np.random.Generator) -> None:
    xyz = rng.uniform(0, 9, (10, 3)).astype(np.float32)
    io.write_laz(tmp_path / "scan.laz", PointCloud(np.zeros(3), xyz))
    (tmp_path / "scan.laz").rename(tmp_path / "scan.txt")
    assert len(io.read(tmp_path / "scan.txt")) == 10


def test_that_the_file_filter_names_every_ending() -> None:
    endings = {ending for f in io.formats() for ending in f.endings}
    assert {".las", ".laz", ".e57", ".ply", ".pcd", ".pts", ".xyz", ".csv"} <= endings
    every = io.file_filter().split(";;")[0]
    assert all(f"*{ending}" in every for ending in endings)


def test_that_importing_loads_no_library_of_any_format() -> None:
    code = (
        "import sys, pipecore.io; print(*({'laspy', 'lazrs', 'pye57', 'open3d', 'pyproj', "
        "'numba', 'scipy.spatial'} & set(sys.modules)))"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.split() == []


def test_that_parts_are_shown_as_soon_as_they_are_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(las, "CHUNK_POINTS", 500)
    monkeypatch.setattr(reading, "LOOK_POINTS", 50)
    rng = np.random.default_rng(0)
    world = np.array([432_100.0, 6_201_870.0, 110.0])
    rgb = rng.integers(0, 255, (2000, 3), np.uint8)
    made = PointCloud(world, rng.uniform(0, 5, (2000, 3)).astype(np.float32), rgb=rgb)
    io.write_laz(tmp_path / "scan.laz", made)
    parts: list[PointCloud] = []
    done: list[int] = []

    class Listening:
        def update(self, stage: str, fraction: float) -> None:
            done.append(len(parts))

    cloud = io.read(tmp_path / "scan.laz", look=parts.append, progress=Listening())
    assert [len(part) for part in parts] == [50] * 4
    assert 1 in done  # the first came before the second was read
    rows = np.concatenate([np.arange(start, start + 500, 10) for start in range(0, 2000, 500)])
    assert all((part.origin == cloud.origin).all() for part in parts)
    assert np.array_equal(np.concatenate([part.xyz for part in parts]), cloud.xyz[rows])
    assert cloud.rgb is not None
    shown = [part.rgb for part in parts if part.rgb is not None]
    assert np.array_equal(np.concatenate(shown), cloud.rgb[rows])


def test_that_a_wide_text_is_kept_in_files_too(tmp_path: Path, rng: np.random.Generator) -> None:
    # Its number of points is not known, and its first chunk already needs float64.
    xyz = rng.uniform(0, 3000, (500, 3))
    folder = tmp_path / "kept"
    folder.mkdir()
    cloud = io.read(write_text(tmp_path / "a.xyz", xyz), folder=folder)
    assert cloud.xyz.dtype == np.float64
    assert np.abs(cloud.world(cloud.xyz) - xyz).max() < 1e-4
