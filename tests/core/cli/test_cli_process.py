"""The command line as its own process: what only the operating system can tell."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from pipecore import io
from tests.factories import make_cloud

PIPECORE = [sys.executable, "-m", "pipecore"]


def run(*arguments: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [*PIPECORE, *map(str, arguments)],
        capture_output=True,
        text=True,
        encoding="utf-8",
        timeout=120,
        check=False,
    )


@pytest.fixture
def scan_file(tmp_path) -> Path:
    path = tmp_path / "plant.laz"
    io.write_laz(path, make_cloud(100_000))
    return path


def test_that_help_is_there_at_once():
    code = (
        "import json, sys, time\n"
        "from pipecore.cli import main\n"
        "try:\n"
        "    main(['detect', '--help'])\n"
        "except SystemExit:\n"
        "    print(json.dumps([time.process_time(), sorted(sys.modules)]))\n"
    )
    # The processor's time, so that a busy machine does not count.
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True
    )
    seconds, modules = json.loads(done.stdout.splitlines()[-1])
    assert seconds < 0.3
    assert not {"numpy", "numba", "scipy", "open3d", "laspy", "matplotlib"} & set(modules)


def test_that_what_is_wrong_is_one_line_without_a_traceback(tmp_path):
    done = run("detect", tmp_path / "gone.laz", "-o", tmp_path / "report")
    assert done.returncode == 1
    assert done.stdout == ""
    assert done.stderr.startswith("pipecore: ")
    assert done.stderr.count("\n") == 1


def test_that_wrong_usage_is_told_apart_from_wrong_input():
    assert run("detect").returncode == 2
    assert run("--version").returncode == 0


@pytest.mark.skipif(os.name == "nt", reason="Windows has no SIGINT for another process")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_that_ctrl_c_ends_the_work_in_order(number, scan_file, tmp_path):
    process = subprocess.Popen(
        [*PIPECORE, "detect", str(scan_file), "-o", str(tmp_path / "report")],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        encoding="utf-8",
    )
    assert process.stderr is not None
    assert process.stderr.readline().startswith("Reading")  # now it detects
    process.send_signal(number)
    began = time.monotonic()
    said, complaint = process.communicate(timeout=60)
    assert process.returncode == 130
    assert complaint.splitlines()[-1] == "pipecore: Cancelled; nothing was written."
    assert "Traceback" not in complaint
    assert said == ""
    assert [p.name for p in tmp_path.iterdir()] == ["plant.laz"]
    print(f"ended {time.monotonic() - began:.1f} s after the signal")


@pytest.mark.skipif(os.name == "nt", reason="pipes differ on Windows")
def test_that_a_reader_that_leaves_early_is_no_error(scan_file):
    read_end, write_end = os.pipe()
    os.close(read_end)
    with os.fdopen(write_end, "w") as nobody:
        done = subprocess.run(
            [*PIPECORE, "info", str(scan_file)],
            stdout=nobody,
            stderr=subprocess.PIPE,
            text=True,
            timeout=60,
            check=False,
        )
    assert done.returncode == 0
    assert done.stderr == ""
