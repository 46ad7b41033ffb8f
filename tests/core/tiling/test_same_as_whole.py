"""Clouds that fit into memory, detected in one piece and in tiles: the same to the last bit."""

import csv
from dataclasses import fields

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from pipecore import io
from pipecore.cli import main
from pipecore.errors import CancelledError
from pipecore.pipeline import detect
from pipecore.report import result_to_dict
from pipecore.settings import Settings
from pipecore.simulate import Scanner, Scene, scan
from pipecore.simulate.scene import Box, Elbow, Run, Straight
from pipecore.tiling import detect_in_tiles, slabs
from pipecore.types import PointCloud

TILES = {"tiling.memory_gib": 0.5, "tiling.tile_mpoints": 0.01}
CSVS = ("elements.csv", "profiles.csv", "deformations.csv")


def plant(seed: int) -> Scene:
    """A bent run and a riser over a floor, askew, so that slabs cut everything."""
    rng = np.random.default_rng(seed)
    turn = rng.uniform(0.2, 1.2)
    along = (np.cos(turn), np.sin(turn), 0.0)
    across = (-np.sin(turn), np.cos(turn), 0.0)
    bent = Run(
        (0.0, 0.0, 0.8), along, 0.084, (Straight(1.1), Elbow(90, 0.25, across), Straight(0.6))
    )
    riser = Run((0.6, -0.7, 0.05), (0.0, 0.0, 1.0), 0.057, (Straight(1.4),))
    return Scene(
        (bent, riser),
        ((-0.8, -2.6, 1.4), (3.0, 0.6, 1.8)),
        (Box((0.8, 0.3, -0.05), (4.0, 4.0, 0.1)), Box((0.3, 0.1, 0.35), (0.1, 0.1, 0.7))),
        Scanner(spacing=0.013, noise=0.0015),
        (432_100.0, 6_201_870.0, 110.0),
        seed=seed,
    )


@pytest.fixture(scope="module")
def scanned(session_seed, tmp_path_factory):
    """A simulated plant as a file."""
    path = tmp_path_factory.mktemp("scan") / "plant.laz"
    io.write_laz(path, scan(plant(session_seed)).cloud)
    return path


@pytest.fixture(scope="module")
def whole(scanned):
    cloud = io.read(scanned)
    return cloud, detect(cloud, Settings())


def assert_same(found, expected):
    one, other = result_to_dict(expected), result_to_dict(found)
    for key in ("origin", "stacks", "elements", "profiles", "deformations", "n_element_points"):
        assert other[key] == one[key], key
    for name in ("segment_id", "element_id", "deviation"):
        assert_array_equal(getattr(found, name), getattr(expected, name))


def test_that_tiles_find_the_same_as_the_whole(scanned, whole, monkeypatch):
    monkeypatch.setattr(slabs, "POINTS_AT_A_TIME", 7_000)
    cloud, expected = whole
    assert len(expected.elements) >= 4
    settings = Settings().replace(TILES)
    with detect_in_tiles([scanned], settings) as (tiled_cloud, found):
        assert_same(found, expected)
        for field in fields(PointCloud):
            a, b = getattr(tiled_cloud, field.name), getattr(cloud, field.name)
            if isinstance(b, np.ndarray):
                assert_array_equal(a, b)


@pytest.mark.parametrize(
    "changes",
    [
        {"thinning.voxel_mm": 20.0, "stacks.preset": "axes+diagonals"},
        {"profiles.method": "proximity", "stacks.directions": "1,2,3,40"},
    ],
)
def test_that_tiles_find_the_same_with_other_settings(scanned, changes):
    settings = Settings().replace(changes)
    expected = detect(io.read(scanned), settings)
    with detect_in_tiles([scanned], settings.replace(TILES)) as (_, found):
        assert_same(found, expected)


def test_that_a_box_is_cut_out_of_tiles_as_of_the_whole(scanned, whole, tmp_path, capsys):
    cloud, _ = whole
    world = cloud.world(cloud.xyz.astype(np.float64))
    low, high = world.min(axis=0), world.max(axis=0)
    box = np.array([low, [low[0] + 2.4, *high[1:]]])
    part = io.read(scanned, box=box)
    assert 0.1 < len(part) / len(cloud) < 0.9
    expected = detect(part, Settings())
    assert len(expected.elements) >= 1
    with detect_in_tiles([scanned], Settings().replace(TILES), box=box) as (_, found):
        assert_same(found, expected)
    flags = ["--box", *map(str, box.ravel()), "--quiet"]
    assert main(["detect", str(scanned), "-o", str(tmp_path / "part"), *flags]) == 0
    assert len(io.read(tmp_path / "part" / "segments.laz")) == len(part)


def test_that_several_far_scans_in_any_order_are_the_same_in_tiles(rng, scanned, tmp_path):
    # Further apart than float32 carries, and in no order at all.
    cloud = io.read(scanned)
    order = rng.permutation(len(cloud))
    near, far = tmp_path / "near.xyz", tmp_path / "far.xyz"
    world = cloud.world(cloud.xyz[order].astype(np.float64))
    np.savetxt(near, world, fmt="%.4f")
    np.savetxt(far, world[::2] + np.array([3_000.0, 0.0, 0.0]), fmt="%.4f")
    expected = detect(io.read([near, far]), Settings())
    with detect_in_tiles([near, far], Settings().replace(TILES)) as (tiled_cloud, found):
        assert tiled_cloud.xyz.dtype == np.float64
        assert_same(found, expected)


def test_that_the_command_goes_over_to_tiles_by_itself_and_writes_the_same_tables(
    scanned, tmp_path, capsys
):
    limits = {"whole": [], "tiles": ["--tiling-memory-gib", "0.4", "--tiling-tile-mpoints", "0.02"]}
    for name, flags in limits.items():
        assert main(["detect", str(scanned), "-o", str(tmp_path / name), *flags]) == 0
        assert ("processed in tiles" in capsys.readouterr().err) == bool(flags)
    for name in CSVS:
        assert (tmp_path / "tiles" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()
    one, other = (io.read(tmp_path / name / "segments.laz") for name in limits)
    assert_array_equal(one.xyz, other.xyz)
    with (tmp_path / "tiles" / "elements.csv").open(encoding="utf-8") as file:
        assert len(list(csv.DictReader(file))) >= 4
    # Nothing is left beside the report.
    assert {p.name for p in tmp_path.iterdir()} == set(limits)


class CancelAt:
    """Cancels in a stage; remembers when it was asked."""

    def __init__(self, stage: str) -> None:
        self.stage = stage

    def update(self, stage: str, fraction: float) -> None:
        if stage == self.stage:
            raise CancelledError


@pytest.mark.parametrize("stage", ["reading", "normals", "profiles", "elements", "deformations"])
def test_that_a_cancelled_detection_leaves_nothing_behind(scanned, tmp_path, stage):
    settings = Settings().replace(TILES)
    with (
        pytest.raises(CancelledError),
        detect_in_tiles([scanned], settings, CancelAt(stage), tmp_path),
    ):
        pytest.fail("it was not cancelled")
    assert not list(tmp_path.iterdir())
