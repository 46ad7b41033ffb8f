"""A whole task with the real detection and the real views: from the scan to the table."""

import csv
import subprocess
import sys
import textwrap
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QFileDialog, QInputDialog

from pipecore.io import write_laz
from pipecore.simulate import Scanner, Scene, scan
from pipecore.simulate.scene import Dent, Run, Straight
from pipegui.model.document import Selection
from pipegui.window.views import make_views
from pipegui.work.job_queue import detect_pipes, read_files

CONTROL = Qt.KeyboardModifier.ControlModifier
LEFT = Qt.MouseButton.LeftButton


@pytest.fixture(scope="module")
def laz(tmp_path_factory) -> Path:
    """A dented pipe and a straight one, seen from three sides."""
    pipes = (
        Run((0, 0, 0.9), (1, 0, 0), 0.11, (Straight(2.0, (Dent(1.4, 270, 0.015, 0.3, 0.2),)),)),
        Run((0, 0.8, 0.9), (1, 0, 0), 0.057, (Straight(2.0),)),
    )
    stations = ((1.0, -2.5, 1.5), (1.0, 3.0, 1.5), (3.6, 0.3, 0.4))
    made = scan(Scene(pipes, stations, (), Scanner(spacing=0.012, noise=0.001), (5e5, 6e6, 50.0)))
    path = tmp_path_factory.mktemp("scan") / "two pipes.laz"
    write_laz(path, made.cloud)
    return path


def is_idle(app) -> bool:
    return not app.session.jobs.is_busy and not app.controllers.project.saving.is_busy


def click(app, qtbot, element_id: int, modifier=Qt.KeyboardModifier.NoModifier) -> None:
    view = app.window.panels.tree.view
    index = app.window.panels.tree.model.index_of(0, Selection(element_id=element_id))
    view.scrollTo(index)
    qtbot.mouseClick(view.viewport(), LEFT, modifier, view.visualRect(index).center())


def test_that_a_scan_becomes_a_reviewed_report_over_two_sessions(
    make_app, qtbot, laz, tmp_path, monkeypatch
):
    def opened():
        app = make_app(read=read_files, detect=detect_pipes, views=make_views())
        app.window.actions_["fly"].setChecked(False)
        return app

    app = opened()
    app.controllers.scans.open_files([laz])
    qtbot.waitUntil(app.window.actions_["detect"].isEnabled)
    qtbot.keyClick(app.window, Qt.Key.Key_D, CONTROL)
    qtbot.waitUntil(lambda: app.session.document.result is not None and is_idle(app))
    result = app.session.document.result
    [dent] = [d for d in result.deformations if d.kind == "dent"]
    dented = dent.element_id
    [thin] = [e.element_id for e in result.elements if e.radius < 0.08]
    assert app.session.document.selection.deformation_id == dent.deformation_id

    # Split the dented pipe, see that the dent is still there, and make it one again.
    click(app, qtbot, dented)
    app.window.actions_["split"].trigger()
    dialog = app.window.findChild(QInputDialog, "ask")
    dialog.setDoubleValue(0.6)
    dialog.accept()
    qtbot.waitUntil(lambda: app.session.history.undo_text.startswith("Split"))
    parts = [e.element_id for e in app.session.document.result.elements if e.radius > 0.08]
    assert len(parts) == 2
    depths = [1000 * d.depth for d in app.session.document.result.deformations if d.kind == "dent"]
    assert depths == pytest.approx([1000 * dent.depth], rel=0.1)
    click(app, qtbot, parts[0])
    click(app, qtbot, parts[1], CONTROL)
    qtbot.keyClick(app.window, Qt.Key.Key_M, CONTROL)
    qtbot.waitUntil(lambda: app.session.history.undo_text.startswith("Merge"))
    merged = app.session.document.result.element(parts[0])
    assert merged.radius == pytest.approx(result.element(dented).radius, abs=0.0003)
    for _ in range(2):
        qtbot.keyClick(app.window, Qt.Key.Key_Z, CONTROL)
    assert app.session.document.result is result

    # Delete the other pipe, reject the dent with a word, and save.
    click(app, qtbot, thin)
    qtbot.keyClick(app.window.panels.tree.view, Qt.Key.Key_Delete)
    app.window.panels.table.chosen.emit(dent.deformation_id)
    app.window.actions_["reject"].trigger()
    app.window.panels.table.commented.emit(dent.deformation_id, "cut out")
    path = tmp_path / "job.pipegui"
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: (str(path), ""))
    app.window.views.scene.set_standard_view("top")
    camera = app.window.views.scene.camera()
    qtbot.keyClick(app.window, Qt.Key.Key_S, CONTROL)
    qtbot.waitUntil(lambda: path.is_file() and is_idle(app))
    assert app.window.close()

    # Another day.
    again = opened()
    again.controllers.scans.open_files([path])
    qtbot.waitUntil(lambda: again.session.document.scan is not None and is_idle(again))
    assert [e.element_id for e in again.session.document.result.elements] == [
        e.element_id for e in result.elements if e.element_id != thin
    ]
    now = again.window.views.scene.camera()
    assert {k: np.round(v, 6).tolist() for k, v in now.items()} == {
        k: np.round(v, 6).tolist() for k, v in camera.items()
    }
    table = tmp_path / "deformations.csv"
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: (str(table), ""))
    again.window.actions_["export_deformations"].trigger()
    with table.open(encoding="utf-8", newline="") as file:
        rows = {int(r["deformation_id"]): r for r in csv.DictReader(file)}
    row = rows[dent.deformation_id]
    assert (row["review"], row["comment"]) == ("rejected", "cut out")
    assert float(row["depth_mm"]) == pytest.approx(1000 * dent.depth, abs=0.01)


KILLED = """
    import os, signal, sys
    from dataclasses import replace
    from pathlib import Path
    from PySide6.QtCore import QSettings, QTimer
    from PySide6.QtWidgets import QApplication
    from pipecore.io import read
    from pipegui.model import element_commands
    from pipegui.model.document import Scan
    from pipegui.composition import compose
    from pipegui.work.job_queue import JobQueue
    from tests.factories import make_scan
    from tests.gui.fakes import make_fake_views

    laz, folder = map(Path, sys.argv[1:])
    qt = QApplication([])
    stored = QSettings(str(folder / "layout.ini"), QSettings.Format.IniFormat)
    app = compose(make_fake_views(), JobQueue(), stored, folder)
    cloud = read(laz)
    result = replace(make_scan(len(cloud))[1], source=laz, origin=cloud.origin)
    app.controllers.scans.on_scan_read(Scan(laz.name, cloud))
    app.controllers.scans.on_detected(cloud, result)
    app.session.do(element_commands.rename_element, 2, "Feed line")
    app.controllers.autosave.save_copy(then=lambda: os.kill(os.getpid(), signal.SIGKILL))
    qt.exec()
"""


def test_that_work_outlives_a_process_that_was_killed(make_app, qtbot, tmp_path):
    from tests.factories import make_scan

    laz, folder = tmp_path / "plant.laz", tmp_path / "unsaved"
    write_laz(laz, make_scan(2000)[0])
    killed = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(KILLED), str(laz), str(folder)],
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    assert killed.returncode == -9, killed.stderr
    app = make_app(read=read_files, copies=folder)
    app.controllers.autosave.offer_recovery()
    restore, _ = app.window.panels.message.answer_buttons
    qtbot.mouseClick(restore, LEFT)
    qtbot.waitUntil(lambda: app.session.document.result is not None)
    assert app.session.document.result.element(2).label == "Feed line"
    assert app.window.isWindowModified()
    qtbot.waitUntil(lambda: len(list(folder.glob("*.pipegui"))) == 1)
