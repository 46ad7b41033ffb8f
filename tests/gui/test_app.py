"""Starting from the command line, and the picture without anybody at the screen."""

import subprocess
import sys

import numpy as np
import pytest
from PySide6.QtGui import QImage

from pipecore.errors import ReadError
from pipegui import app
from pipegui.work.job_queue import JobQueue
from tests.factories import make_cloud, make_result
from tests.gui.fakes import make_fake_views


@pytest.fixture
def faked(qapp, monkeypatch):
    """The app over fakes, as `main` finds them."""
    monkeypatch.setattr("pipegui.window.views.make_views", make_fake_views)
    monkeypatch.setattr(JobQueue.__init__, "__defaults__", (_read, _detect, _plan, None))


def _read(path, settings, progress):
    progress.update("reading", 0.5)
    if not path[0].is_file():
        raise ReadError(f"There is no file “{path[0]}”.")
    return make_cloud()


def _plan(cloud, settings, progress):
    return None


def _detect(cloud, settings, progress):
    progress.update("profiles", 0.5)
    return make_result()


def test_that_help_comes_without_waiting_for_qt():
    told = subprocess.run(
        [sys.executable, "-X", "importtime", "-m", "pipegui", "--help"],
        capture_output=True,
        text=True,
        check=True,
        timeout=600,
    )
    assert "--screenshot PNG" in told.stdout
    assert "PySide6" not in told.stderr
    assert "vtk" not in told.stderr


def test_that_a_screenshot_is_taken_of_the_detected_scan(faked, qtbot, tmp_path):
    scan, picture = tmp_path / "plant.laz", tmp_path / "window.png"
    scan.touch()
    assert app.main([str(scan), "--screenshot", str(picture)]) == 0
    image = QImage(str(picture))
    assert (image.width(), image.height()) >= (1000, 700)
    shades = {image.pixel(x, y) for x in range(0, image.width(), 16) for y in range(0, 600, 16)}
    assert len(shades) > 10
    assert np.array([image.width(), image.height()]).min() > 0


def test_that_a_screenshot_of_a_missing_scan_fails_and_says_why(faked, qtbot, tmp_path, capsys):
    picture = tmp_path / "window.png"
    assert app.main([str(tmp_path / "none.laz"), "--screenshot", str(picture)]) == 1
    assert "There is no file" in capsys.readouterr().err
    assert not picture.exists()


def test_that_a_screenshot_that_cannot_be_written_fails(faked, qtbot, tmp_path, capsys):
    scan = tmp_path / "plant.laz"
    scan.touch()
    assert app.main([str(scan), "--screenshot", str(tmp_path / "missing" / "a.png")]) == 1
    assert "could not be written" in capsys.readouterr().err
