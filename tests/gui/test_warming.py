"""Compiling the kernels once, in a process beside the window."""

import subprocess
import sys
from pathlib import Path

import pytest
from PySide6.QtCore import QSettings

from pipegui.work.kernel_warmup import KernelWarmup, detect_demo


@pytest.fixture
def stored(tmp_path):
    return QSettings(str(tmp_path / "kept.ini"), QSettings.Format.IniFormat)


def command(path: Path, code: int = 0) -> list[str]:
    done = f"import pathlib, sys; pathlib.Path({str(path)!r}).touch(); sys.exit({code})"
    return [sys.executable, "-c", done]


def test_that_kernels_are_compiled_once_and_not_again(qtbot, stored, tmp_path):
    for _ in range(2):
        warming = KernelWarmup(stored, command(tmp_path / "ran"))
        told = []
        warming.started.connect(lambda told=told: told.append("started"))
        if not stored.allKeys():
            with qtbot.waitSignal(warming.ended):
                warming.start()
            assert told == ["started"]
            (tmp_path / "ran").unlink()
        else:
            warming.start()
            assert told == []
        warming.close()
    assert stored.allKeys()
    assert not (tmp_path / "ran").exists()


def test_that_a_warming_that_failed_is_tried_again(qtbot, stored, tmp_path):
    for _ in range(2):
        warming = KernelWarmup(stored, command(tmp_path / "ran", code=1))
        with qtbot.waitSignal(warming.ended):
            warming.start()
        warming.close()
        (tmp_path / "ran").unlink()


def test_that_closing_the_window_ends_it(qtbot, stored):
    warming = KernelWarmup(stored, [sys.executable, "-c", "import time; time.sleep(600)"])
    warming.start()
    qtbot.waitUntil(lambda: warming.is_running)
    warming.close()
    assert not warming.is_running
    assert not stored.allKeys()


def test_that_the_command_is_one_that_detects(tmp_path):
    words = detect_demo(str(tmp_path))
    assert words[1:4] == ["-m", "pipecore", "detect"]
    assert Path(words[4]).is_file()


def test_that_the_window_says_what_it_does_at_the_first_run(app):
    status = app.window.status
    assert not status.warming.isVisible()
    status.start_warming()
    assert status.warming.isVisible()
    assert "once" in status.warming.text()
    status.end_warming()
    assert not status.warming.isVisible()


def test_that_the_window_is_there_before_what_only_a_detection_needs():
    heavy = ("matplotlib", "numba", "open3d", "scipy.spatial", "scipy.ndimage", "laspy")
    program = (
        "import sys, pipegui.composition, pipegui.scene.view, pipegui.plots.section_view\n"
        "import pipegui.plots.radius_plot, pipegui.plots.deviation_map_view\n"
        "import pipegui.plots.preview_view\n"
        f"print([name for name in {heavy} if name in sys.modules])"
    )
    told = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True, timeout=600
    )
    assert told.stdout.strip() == "[]"
