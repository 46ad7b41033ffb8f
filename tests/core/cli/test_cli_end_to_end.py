"""From a scene to a report with the real detection, as a user would."""

import csv
from pathlib import Path

import numpy as np
import pytest

from pipecore import io
from pipecore.cli import main
from pipecore.simulate import Scanner, Scene, save_scene
from pipecore.simulate.scene import Box, Dent, Run, Straight
from pipecore.types import PointCloud

RADIUS_MM = 84.15
DENT = Dent(chainage=0.7, clock_deg=60.0, depth=0.014, length=0.24, width=0.18)
SCENE = Scene(
    runs=(Run((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), RADIUS_MM / 1000, (Straight(1.4, (DENT,)),)),),
    stations=((0.5, -3.0, 1.2), (0.8, 3.0, 2.2)),
    clutter=(Box((0.7, 0.0, -0.05), (4.0, 4.0, 0.1)),),
    scanner=Scanner(spacing=0.01),
    origin=(432_100.0, 6_201_870.0, 110.0),
)


@pytest.fixture(scope="module")
def scan_file(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("simulated")
    save_scene(SCENE, folder / "scene.toml")
    assert main(["simulate", str(folder / "scene.toml"), "-o", str(folder / "scan.laz")]) == 0
    return folder / "scan.laz"


def detect(scan_file: Path, report: Path, *more: str) -> Path:
    assert main(["detect", str(scan_file), "-o", str(report), *more]) == 0
    return report


def table(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def test_that_a_simulated_dent_is_in_the_report_where_it_was_made(scan_file, tmp_path, capsys):
    report = detect(scan_file, tmp_path / "report")
    (pipe,) = (e for e in table(report / "elements.csv") if e["kind"] == "cylinder")
    assert float(pipe["radius_mm"]) == pytest.approx(RADIUS_MM, abs=1.0)
    assert pipe["nominal_size"] == "DN 150 / NPS 6"
    (dent,) = table(report / "deformations.csv")
    assert dent["kind"] == "dent"
    assert dent["element_id"] == pipe["element_id"]
    assert float(dent["depth_mm"]) == pytest.approx(14.0, abs=2.0)
    assert dent["verdict"] == "reject"
    peak = np.array([float(dent[f"peak_{axis}"]) for axis in "xyz"])
    # 60° from the top, towards 3:00 as one looks along +X: to the south.
    across = (RADIUS_MM / 1000 - DENT.depth) * np.array([0.0, -np.sin(np.pi / 3), 0.5])
    true = np.array(SCENE.origin) + np.array([0.7, 0.0, 1.0]) + across
    assert np.linalg.norm(peak - true) < 0.025
    assert "1 deformation, 1 to reject." in capsys.readouterr().out


def test_that_the_number_of_threads_changes_no_digit(scan_file, tmp_path, own_threads):
    one = detect(scan_file, tmp_path / "one", "--threads", "1", "--quiet")
    two = detect(scan_file, tmp_path / "two", "--threads", "2", "--quiet")
    for name in ("elements.csv", "profiles.csv", "deformations.csv", "segments.laz"):
        assert (one / name).read_bytes() == (two / name).read_bytes(), name


def test_that_a_scan_without_pipes_gives_a_report_that_says_so(tmp_path, capsys, rng):
    floor = rng.uniform([0.0, 0.0, 0.0], [2.0, 2.0, 0.0], (20_000, 3))
    floor[:, 2] = rng.normal(0.0, 0.002, len(floor))
    io.write_laz(tmp_path / "floor.laz", PointCloud(np.zeros(3), floor.astype(np.float32)))
    report = detect(tmp_path / "floor.laz", tmp_path / "report")
    assert capsys.readouterr().out.startswith("No pipes found.")
    assert table(report / "elements.csv") == []
