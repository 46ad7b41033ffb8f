"""Points written as files: the cloud, what is shown of it, and the selection."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtWidgets import QFileDialog

from pipecore.io import read, write_laz
from pipegui.model import commands, selection_commands
from pipegui.work.job_queue import read_files
from tests.core.io.cases import pipe, ptx
from tests.factories import make_scan

N = 3000


@pytest.fixture
def target(monkeypatch):
    """Answers the dialog with a path, and keeps what it proposed."""
    asked = []

    def answer(path: Path | None, kind: str = "") -> list:
        def ask(parent, title, proposed, kinds, first):
            asked.append((title, Path(proposed), kinds, first))
            return ("" if path is None else str(path), kind or first)

        monkeypatch.setattr(QFileDialog, "getSaveFileName", ask)
        return asked

    return answer


@pytest.fixture
def opened(make_app, qtbot, tmp_path):
    """A scan of a LAZ file, detected."""
    path = tmp_path / "plant.laz"
    write_laz(path, make_scan(N)[0])

    def detect(cloud, settings, progress):
        return replace(make_scan(N)[1], origin=cloud.origin, source=cloud.source)

    app = make_app(read=read_files, detect=detect)
    app.controllers.scans.open_files([path])
    qtbot.waitUntil(app.window.actions_["detect"].isEnabled)
    app.controllers.scans.detect()
    qtbot.waitUntil(lambda: app.session.document.result is not None)
    qtbot.waitUntil(lambda: not app.session.jobs.is_busy)
    return app


def export(app, qtbot, name):
    app.window.panels.message.hide()
    app.window.actions_[name].trigger()
    qtbot.waitUntil(lambda: not app.session.jobs.is_busy)


def worlds(cloud):
    return cloud.world(cloud.xyz.astype(float))


@pytest.mark.parametrize("ending", [".las", ".laz", ".ply", ".e57"])
def test_that_a_cloud_is_written_in_each_format_and_is_the_same(
    opened, qtbot, target, tmp_path, ending
):
    path = tmp_path / f"out{ending}"
    asked = target(path)
    export(opened, qtbot, "export_cloud")
    [(title, name, kinds, first)] = asked
    assert (title, name) == ("Export cloud", tmp_path / "plant copy.laz")
    assert first == "LAZ (*.laz)"
    assert kinds.count(";;") == 3
    again = read(path)
    assert np.abs(worlds(again) - worlds(opened.session.document.scan.cloud)).max() < 1e-6
    assert f"Saved {N:,} points as" in opened.window.panels.message.text.text()


def test_that_what_is_hidden_is_not_written(opened, qtbot, target, tmp_path):
    assert not opened.window.actions_["export_shown"].isEnabled()
    opened.session.do(commands.set_hidden, [2], True)
    asked = target(tmp_path / "shown.las")
    export(opened, qtbot, "export_shown")
    assert asked[0][1].name == "plant part.laz"
    element_id = opened.session.document.result.element_id
    assert len(read(tmp_path / "shown.las")) == (element_id != 2).sum()


def test_that_the_selected_element_is_written(opened, qtbot, target, tmp_path):
    opened.session.do(selection_commands.select_element, 4)
    asked = target(tmp_path / "element.ply")
    export(opened, qtbot, "export_selection")
    assert asked[0][1].name.startswith("plant ")
    element_id = opened.session.document.result.element_id
    assert len(read(tmp_path / "element.ply")) == (element_id == 4).sum()


def test_that_a_name_without_ending_gets_that_of_the_format_and_overwrites_nothing(
    opened, qtbot, target, tmp_path
):
    (tmp_path / "out 1.2.ply").write_text("")
    target(tmp_path / "out 1.2", "PLY (*.ply)")
    export(opened, qtbot, "export_cloud")
    assert len(read(tmp_path / "out 1.2 2.ply")) == N


def test_that_an_open_scan_is_not_overwritten(opened, qtbot, target, tmp_path):
    before = (tmp_path / "plant.laz").read_bytes()
    target(tmp_path / "plant.laz")
    export(opened, qtbot, "export_cloud")
    assert "open as a scan" in opened.window.panels.message.text.text()
    assert (tmp_path / "plant.laz").read_bytes() == before


def test_that_a_dialog_that_is_cancelled_writes_nothing(opened, qtbot, target):
    target(None)
    export(opened, qtbot, "export_cloud")
    assert not opened.window.panels.message.isVisible()


def test_that_what_a_format_cannot_hold_is_said(make_app, qtbot, target, tmp_path, german):
    app = make_app(read=read_files)
    app.controllers.scans.open_files([ptx(tmp_path / "a.ptx", pipe(500))])
    qtbot.waitUntil(lambda: app.session.document.scan is not None)
    target(tmp_path / "a.las")
    export(app, qtbot, "export_cloud")
    text, *notes = app.window.panels.message.text.text().split("\n")
    assert text.startswith("500 Punkte gespeichert")
    assert any("Scanner" in note for note in notes)
    assert app.window.panels.message.property("severity") == "warning"


def test_that_a_cloud_whose_file_has_gone_is_written_with_a_word(opened, qtbot, target, tmp_path):
    (tmp_path / "plant.laz").unlink()
    target(tmp_path / "out.las")
    export(opened, qtbot, "export_cloud")
    assert "its file has gone" in opened.window.panels.message.text.text()
    assert len(read(tmp_path / "out.las")) == N
