import json
from pathlib import Path

import numpy as np
import pytest

from pipecore import io
from pipecore.cli import main
from pipecore.simulate import Scanner, Scene, save_scene
from pipecore.simulate.scene import Dent, Run, Straight

DENT = Dent(chainage=0.5, clock_deg=90.0, depth=0.012, length=0.2, width=0.15)
SCENE = Scene(
    runs=(Run((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), 0.08415, (Straight(1.0, (DENT,)),)),),
    stations=((0.5, -3.0, 1.2),),
    scanner=Scanner(spacing=0.02),
    origin=(432_100.0, 6_201_870.0, 110.0),
)


@pytest.fixture
def scene_file(tmp_path) -> Path:
    path = tmp_path / "scene.toml"
    save_scene(SCENE, path)
    return path


def simulate(scene: object, scan: Path, *more: str) -> int:
    return main(["simulate", str(scene), "-o", str(scan), *more])


def test_that_a_scene_becomes_a_scan_with_its_truth_beside_it(scene_file, tmp_path, capsys):
    scan = tmp_path / "scan.laz"
    assert simulate(scene_file, scan) == 0
    cloud = io.read(scan)
    world = cloud.world(cloud.xyz)
    on_pipe = np.hypot(world[:, 1] - 6_201_870.0, world[:, 2] - 111.0) < 0.1
    assert on_pipe.mean() > 0.9
    truth = json.loads((tmp_path / "truth.json").read_text(encoding="utf-8"))
    assert "0.012" in json.dumps(truth)
    said = capsys.readouterr().out
    assert f"{len(cloud):,} points on 1 element with 1 deformation." in said
    assert str(scan) in said


def test_that_the_seed_decides_the_errors_of_a_scan(scene_file, tmp_path):
    scans = {}
    for name, seed in (("a", "7"), ("b", "7"), ("c", "8")):
        assert simulate(scene_file, tmp_path / f"{name}.laz", "--seed", seed, "--quiet") == 0
        scans[name] = io.read(tmp_path / f"{name}.laz").xyz
    assert np.array_equal(scans["a"], scans["b"])
    assert not np.array_equal(scans["a"], scans["c"])


def test_that_an_unknown_scene_is_one_clear_line_and_leaves_nothing(tmp_path, capsys):
    assert simulate("atlantis", tmp_path / "scan.laz") == 1
    error = capsys.readouterr().err
    assert "atlantis" in error
    assert error.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_that_a_scan_is_written_as_laz_or_not_at_all(scene_file, tmp_path, capsys):
    assert simulate(scene_file, tmp_path / "scan.e57") == 1
    assert "must end with .laz" in capsys.readouterr().err
    assert simulate(scene_file, tmp_path / "gone" / "scan.laz") == 1
    assert "gone" in capsys.readouterr().err
    assert [p.name for p in tmp_path.iterdir()] == ["scene.toml"]
