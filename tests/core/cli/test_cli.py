"""The command line in one process, with the detection replaced by a made result."""

import argparse
import re
import tomllib
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from pipecore import io, parallel
from pipecore.cli import main
from pipecore.cli.detect import deformation_lines
from pipecore.cli.parser import SETTING, make_parser
from pipecore.errors import CancelledError
from pipecore.settings import Settings, iterate_fields
from pipecore.types import Verdict
from tests.factories import make_cloud, make_result, make_scan


@pytest.fixture(scope="module")
def scan_file(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("scans") / "plant.laz"
    io.write_laz(path, make_cloud(2000))
    return path


@pytest.fixture
def detections(monkeypatch) -> list[Settings]:
    """Replace the detection by a made result; the settings of each call."""
    calls: list[Settings] = []

    def detect(cloud, settings, progress):
        calls.append(settings)
        for step in range(3):
            progress.update("profiles", step / 2)
            progress.update("ellipses", step / 2)
        assert len(cloud) % 2000 == 0
        result = make_scan(len(cloud))[1]
        return replace(result, settings=settings, origin=cloud.origin)

    monkeypatch.setattr("pipecore.cli.detect.detect", detect)
    # Figures take most of a report's time, and have their own tests.
    monkeypatch.setattr("pipecore.report.figures.draw_deformation", lambda *_: "<svg></svg>")
    return calls


def run(*arguments: object) -> int:
    return main([str(a) for a in arguments])


def test_that_detect_writes_a_report_and_says_what_was_found(
    scan_file, detections, tmp_path, capsys
):
    assert run("detect", scan_file, "-o", tmp_path / "report") == 0
    said = capsys.readouterr()
    lines = said.out.splitlines()
    assert lines[0] == "5 pipes in 3 runs, 4 deformations, 1 to reject, 3 to review."
    assert re.search(r"1 +dent +Pipe 2 +0\.80 m +1:20 +12\.1 ± 0\.3 +7\.2 +reject", lines[2])
    assert str(tmp_path / "report") in lines[-1]
    assert (tmp_path / "report" / "deformations.csv").is_file()


def test_that_away_from_a_terminal_each_stage_is_one_line(scan_file, detections, tmp_path, capsys):
    assert run("detect", scan_file, "-o", tmp_path / "report") == 0
    lines = capsys.readouterr().err.splitlines()
    # Whether the kernels have still to be compiled depends on what ran before.
    stages = [line.split("  ")[0] for line in lines if "compiles its kernels" not in line]
    assert len(stages) == len(set(stages))
    assert stages[:3] == ["Reading", "Profiles", "Ellipses"]
    assert "\r" not in "".join(stages)


def test_that_quiet_is_silent(scan_file, detections, tmp_path, capsys):
    assert run("detect", scan_file, "-o", tmp_path / "report", "--quiet") == 0
    assert capsys.readouterr() == ("", "")


def test_that_every_setting_is_a_flag():
    args = vars(make_parser().parse_args(["detect", "a.laz", "-o", "b"]))
    assert {name.removeprefix(SETTING) for name in args if name.startswith(SETTING)} == {
        key for key, _ in iterate_fields()
    }


def test_that_a_flag_reaches_the_detection_and_the_report(scan_file, detections, tmp_path):
    report = tmp_path / "report"
    flags = ("--stacks-width-mm", "20", "--profiles-method", "proximity")
    directions = "--stacks-directions=-1,0,0;0,0,1,15"
    assert run("detect", scan_file, "-o", report, *flags, directions) == 0
    (settings,) = detections
    assert settings.stacks.width_mm == 20.0
    assert settings.profiles.method == "proximity"
    assert settings.stacks.directions == ((-1.0, 0.0, 0.0), (0.0, 0.0, 1.0, 15.0))
    assert Settings.from_toml(report / "settings.toml") == settings


def test_that_flags_win_over_the_settings_file(scan_file, detections, tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text("[stacks]\nwidth_mm = 30\n[elements]\nmin_radius_mm = 25\n", encoding="utf-8")
    arguments = ("detect", scan_file, "-o", tmp_path / "report", "--settings", file)
    assert run(*arguments, "--stacks-width-mm", "12.5") == 0
    (settings,) = detections
    assert settings.stacks.width_mm == 12.5
    assert settings.elements.min_radius_mm == 25.0


def test_that_the_settings_of_a_report_make_the_same_report(scan_file, detections, tmp_path):
    first, second = tmp_path / "first", tmp_path / "second"
    assert run("detect", scan_file, "-o", first, "--thinning-voxel-mm", "7") == 0
    assert run("detect", scan_file, "-o", second, "--settings", first / "settings.toml") == 0
    for name in ("settings.toml", "elements.csv", "profiles.csv", "deformations.csv"):
        assert (first / name).read_bytes() == (second / name).read_bytes()


def test_that_several_inputs_are_one_cloud(scan_file, detections, tmp_path):
    assert run("detect", scan_file, scan_file, "-o", tmp_path / "report") == 0
    assert tomllib.loads((tmp_path / "report" / "settings.toml").read_text(encoding="utf-8"))
    assert io.info(tmp_path / "report" / "segments.laz").n_points == 4000


def test_that_the_number_of_threads_can_be_set(scan_file, detections, tmp_path, own_threads):
    parallel.set_threads(2)
    assert run("detect", scan_file, "-o", tmp_path / "report", "--threads", "1") == 0
    assert parallel.threads() == 1


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--stacks-width-mm", "-3"], "stacks.width_mm"),
        (["--stacks-width-mm", "wide"], "wide"),
        (["--profiles-method", "magic"], "proximity"),
        (["--settings", "gone.toml"], "gone.toml"),
        (["--deformation-rule", "asme-7pct"], "asme-6pct"),
    ],
)
def test_that_wrong_settings_are_one_clear_line_before_any_work(
    arguments, said, *, scan_file, detections, tmp_path, capsys
):
    # "--stacks-width-mm -3" is a number to argparse, so it needs no "=".
    assert run("detect", scan_file, "-o", tmp_path / "report", *arguments) == 1
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1
    assert error.startswith("pipecore: ")
    assert detections == []
    assert list(tmp_path.iterdir()) == []


def test_that_a_missing_input_is_named(detections, tmp_path, capsys):
    assert run("detect", tmp_path / "gone.laz", "-o", tmp_path / "report") == 1
    assert "gone.laz" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_that_a_full_folder_is_refused_before_any_work(scan_file, detections, tmp_path, capsys):
    report = tmp_path / "report"
    report.mkdir()
    (report / "notes.txt").write_text("mine", encoding="utf-8")
    assert run("detect", scan_file, "-o", report) == 1
    assert "--overwrite" in capsys.readouterr().err
    assert detections == []
    assert run("detect", scan_file, "-o", report, "--overwrite") == 0
    assert (report / "notes.txt").read_text(encoding="utf-8") == "mine"
    assert (report / "report.html").is_file()


def test_that_an_output_that_cannot_be_is_refused_before_any_work(
    scan_file, detections, tmp_path, capsys
):
    assert run("detect", scan_file, "-o", scan_file) == 1
    assert "is a file" in capsys.readouterr().err
    assert run("detect", scan_file, "-o", tmp_path / "a" / "b") == 1
    assert "there is no folder" in capsys.readouterr().err
    assert detections == []


def test_that_cancelling_is_no_error_and_leaves_nothing(scan_file, tmp_path, monkeypatch, capsys):
    def detect(cloud, settings, progress):
        raise CancelledError

    monkeypatch.setattr("pipecore.cli.detect.detect", detect)
    assert run("detect", scan_file, "-o", tmp_path / "report") == 130
    said = capsys.readouterr()
    assert said.err.splitlines()[-1] == "pipecore: Cancelled; nothing was written."
    assert said.out == ""
    assert list(tmp_path.iterdir()) == []


def test_that_too_little_memory_is_said_plainly(scan_file, tmp_path, monkeypatch, capsys):
    def detect(cloud, settings, progress):
        raise MemoryError

    monkeypatch.setattr("pipecore.cli.detect.detect", detect)
    assert run("detect", scan_file, "-o", tmp_path / "report") == 1
    assert "not enough memory" in capsys.readouterr().err


def test_that_a_developer_gets_the_traceback(tmp_path, monkeypatch):
    monkeypatch.setenv("PIPECORE_DEBUG", "1")
    with pytest.raises(io.reading.ReadError):
        run("detect", tmp_path / "gone.laz", "-o", tmp_path / "report")


@pytest.mark.parametrize(
    "arguments",
    [
        [],
        ["dtect"],
        ["detect", "a.laz"],
        ["detect", "-o", "b"],
        ["detect", "a.laz", "-o", "b", "--stacks-width-m", "20"],
        ["detect", "a.laz", "-o", "b", "--threads", "0"],
        ["simulate", "demo"],
        ["simulate", "demo", "-o", "a.laz", "--seed", "-1"],
        ["info"],
    ],
)
def test_that_wrong_usage_is_exit_code_2(arguments, capsys):
    with pytest.raises(SystemExit) as caught:
        run(*arguments)
    assert caught.value.code == 2
    assert "usage: pipecore" in capsys.readouterr().err


def test_that_the_help_names_units_bounds_and_defaults(capsys):
    with pytest.raises(SystemExit) as caught:
        run("detect", "--help")
    assert caught.value.code == 0
    words = re.sub(r"\s+", " ", capsys.readouterr().out)
    assert "(30 to 360 °; default 35)" in words
    assert "(0 to 1000 mm; 0: automatic; default 0)" in words
    assert "(one of proximity, curve fitting; default curve fitting)" in words
    assert "(0.1 to 20 %; default 2)" in words
    for _, spec in iterate_fields():
        assert re.sub(r"\s+", " ", spec.help) in words


def test_that_info_says_what_is_in_a_file(scan_file, capsys):
    assert run("info", scan_file) == 0
    said = capsys.readouterr()
    facts = dict(re.split(r"\s{2,}", line, maxsplit=1) for line in said.out.splitlines()[:-1])
    cloud = make_cloud(2000)
    low = cloud.world(cloud.xyz).min(axis=0)
    assert facts["Format"] == "LAS/LAZ"
    assert facts["Points"] == "2,000"
    assert np.array(facts["Lowest x, y, z"].split(), float) == pytest.approx(low, abs=2e-4)
    extent = np.array(facts["Extent"].split(" × "), float)
    assert extent == pytest.approx(np.ptp(cloud.xyz, axis=0), abs=1e-3)
    assert "intensity" in facts["Fields"]
    assert {"CRS", "Spacing", "Scans"} <= facts.keys()
    assert said.err == ""


def test_that_info_on_what_is_no_scan_is_one_clear_line(tmp_path, capsys):
    path = tmp_path / "letter.docx"
    path.write_bytes(b"PK\x03\x04\0\0\0\0")
    assert run("info", path) == 1
    error = capsys.readouterr().err
    assert "letter.docx" in error
    assert error.count("\n") == 1


def test_that_the_table_shows_the_worst_first_and_blanks_for_the_unknown():
    result = make_result(2000)
    unknown = replace(
        result.deformations[3],
        deformation_id=5,
        depth=np.nan,
        clock=np.nan,
        verdict=Verdict.NOT_MEASURABLE,
    )
    lines = deformation_lines(replace(result, deformations=(*result.deformations, unknown)))
    assert [line.split()[0] for line in lines] == ["#", "1", "3", "4", "2", "5"]
    assert lines[-1].count("not measurable") == 2
    assert "nan" not in lines[-1]
    assert deformation_lines(replace(result, deformations=())) == []


def test_that_the_parser_leaves_settings_that_were_not_given_alone():
    args = make_parser().parse_args(["detect", "a.laz", "-o", "b"])
    assert isinstance(args, argparse.Namespace)
    assert all(v is None for name, v in vars(args).items() if name.startswith(SETTING))


@pytest.mark.parametrize("is_first", [True, False])
def test_that_only_a_first_detection_says_that_it_compiles(
    scan_file, detections, tmp_path, capsys, monkeypatch, is_first
):
    store = tmp_path / "store"
    store.mkdir()
    if not is_first:
        (store / "local_surfaces.fit_planes-12.py311.nbi").touch()
    kernel = SimpleNamespace(stats=SimpleNamespace(cache_path=str(store)))
    monkeypatch.setattr("pipecore.cli.detect.fit_planes", kernel)
    assert run("detect", scan_file, "-o", tmp_path / "report") == 0
    assert ("compiles its kernels" in capsys.readouterr().err) == is_first
