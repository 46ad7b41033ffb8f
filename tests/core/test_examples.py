"""The examples run as they are written, on a small scan, and say what is true of it."""

import csv
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from pipecore import PointCloud
from pipecore.io import write_laz

EXAMPLES = Path(__file__).parents[2] / "examples"
DENT_MM = 12.0


def run(script: str, *arguments: str | Path, code: int = 0) -> str:
    """What an example prints."""
    command = [sys.executable, "-W", "error", EXAMPLES / script, *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=600)
    assert done.returncode == code, done.stderr
    return done.stdout + done.stderr


@pytest.fixture(scope="module")
def scan(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A scan of one pipe, radius 100 mm, with a dent of 12 mm on top."""
    rng = np.random.default_rng(7)
    along, around = rng.uniform(0, 2, 50_000), rng.uniform(-np.pi, np.pi, 50_000)
    fade = np.cos(np.clip((along - 0.8) / 0.15, -1, 1) * np.pi / 2) ** 2
    fade *= np.cos(np.clip(around / 0.9, -1, 1) * np.pi / 2) ** 2
    radius = 0.1 - DENT_MM / 1000 * fade + rng.normal(0, 0.001, len(along))
    points = np.column_stack([along, radius * np.sin(around), 1 + radius * np.cos(around)])
    path = tmp_path_factory.mktemp("scans") / "pipe.laz"
    write_laz(path, PointCloud.from_points(points + np.array([1000.0, 2000.0, 0.0])))
    return path


@pytest.fixture(scope="module")
def report(scan: Path) -> Path:
    folder = scan.parent.parent / "report"
    said = run("first_detection.py", scan, folder)
    found = re.search(r"dent on Pipe 1, ([\d.]+) ± [\d.]+ mm, at ([\d.]+) m", said)
    assert found is not None, said
    assert float(found[1]) == pytest.approx(DENT_MM, abs=0.8)
    return folder


def test_that_a_first_detection_finds_the_dent_and_saves_a_report(report: Path) -> None:
    assert {"report.html", "elements.csv", "segments.laz"} <= {p.name for p in report.iterdir()}


def test_that_a_radius_is_plotted_from_a_saved_report(report: Path, tmp_path: Path) -> None:
    picture = tmp_path / "radius.png"
    run("plot_radius_profile.py", report, 1, picture)
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_that_arrays_go_in_and_tables_come_out() -> None:
    said = run("arrays_in_tables_out.py")
    radius = re.search(r"element 1: cylinder, radius ([\d.]+) ±", said)
    deepest = re.search(r"deepest: ([\d.]+) mm", said)
    assert radius is not None
    assert deepest is not None
    assert float(radius[1]) == pytest.approx(100.0, abs=0.3)
    assert float(deepest[1]) == pytest.approx(DENT_MM, abs=0.8)


def test_that_an_own_rule_judges(scan: Path) -> None:
    said = run("own_rule.py", scan)
    assert said.startswith("Works standard 12")
    assert re.search(
        r"dent \d+ on Pipe 1: .*: reject\n    limit for dents there: [78]\.\d mm", said
    )


def test_that_a_folder_is_done_though_one_of_its_scans_is_damaged(
    scan: Path, tmp_path: Path
) -> None:
    folder, reports = tmp_path / "scans", tmp_path / "reports"
    folder.mkdir()
    (folder / "a-damaged.laz").write_bytes(scan.read_bytes()[:500])
    (folder / "pipe.laz").write_bytes(scan.read_bytes())
    (folder / "notes.txt").write_text("no scan", encoding="utf-8")
    said = run("batch_over_a_folder.py", folder, reports, code=1)
    assert "a-damaged.laz: " in said
    with (reports / "deformations.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert {row["scan"] for row in rows} == {"pipe.laz"}
    assert float(rows[0]["depth_mm"]) == pytest.approx(DENT_MM, abs=0.8)
    before = (reports / "pipe.laz" / "result.json").stat().st_mtime_ns
    run("batch_over_a_folder.py", folder, reports, code=1)
    assert (reports / "pipe.laz" / "result.json").stat().st_mtime_ns == before
