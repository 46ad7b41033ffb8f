"""Scans read anew: in another unit with one click, and several as one cloud."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import QMimeData, Qt, QUrl
from PySide6.QtGui import QDragEnterEvent, QDropEvent, QGuiApplication
from PySide6.QtWidgets import QApplication

from pipecore.io import write_laz
from pipecore.notes import Note
from pipecore.settings import LengthUnit
from pipegui.controllers.rereading import Rereading
from pipegui.model.document import ColourBy
from pipegui.project.project_file import ProjectError, read_project
from pipegui.work.job_queue import read_files
from tests.core.io.cases import pipe
from tests.factories import make_scan

N = 3000


@pytest.fixture
def app(make_app):
    return make_app(read=read_files)


@pytest.fixture
def in_mm(tmp_path) -> Path:
    path = tmp_path / "pipe.xyz"
    np.savetxt(path, 1000 * pipe(2000), fmt="%.2f")
    return path


@pytest.fixture
def two(tmp_path) -> list[Path]:
    """Two files, the same scan twice."""
    paths = [tmp_path / "north.laz", tmp_path / "south.laz"]
    for path in paths:
        write_laz(path, make_scan(N)[0])
    return paths


def open_files(app, qtbot, paths):
    app.controllers.scans.open_files(paths)
    wait_until_idle(app, qtbot)


def wait_until_idle(app, qtbot):
    qtbot.waitUntil(lambda: not app.session.jobs.is_busy)


def button(app, text):
    [found] = [b for b in app.window.panels.message.answer_buttons if b.text() == text]
    return found


def extent(app):
    return np.ptp(app.session.document.scan.cloud.xyz, axis=0).max()


def test_that_a_file_in_millimetres_is_read_in_them_with_one_click(app, qtbot, in_mm):
    open_files(app, qtbot, [in_mm])
    assert extent(app) > 1000
    assert "another length unit" in app.window.panels.message.text.text()
    button(app, "Read in millimetres").click()
    wait_until_idle(app, qtbot)
    assert extent(app) == pytest.approx(1.4, abs=0.1)
    assert len(app.session.document.scans) == 1
    assert not app.window.panels.message.isVisible()
    assert app.window.status.scan.text().endswith(" · millimetres")
    assert app.window.actions_["unit_mm"].isChecked()
    # The next file is read as files are.
    assert app.session.document.settings.input.length_unit is LengthUnit.AUTO
    app.session.undo()
    assert extent(app) > 1000


def test_that_the_menu_reads_in_any_unit_and_properties_name_it(app, qtbot, in_mm):
    open_files(app, qtbot, [in_mm])
    app.window.actions_["unit_us-ft"].trigger()
    wait_until_idle(app, qtbot)
    assert extent(app) == pytest.approx(1400 * 1200 / 3937, rel=0.1)
    app.window.panels.properties.copy()
    assert "Unit\tus-ft" in QGuiApplication.clipboard().text()


def test_that_choosing_the_unit_it_has_reads_nothing(app, qtbot, in_mm):
    open_files(app, qtbot, [in_mm])
    before = app.session.document.scan
    app.window.actions_["unit_auto"].trigger()
    wait_until_idle(app, qtbot)
    assert app.session.document.scan is before
    assert app.window.actions_["unit_auto"].isChecked()


def test_that_scans_opened_together_are_joined_with_one_click(app, qtbot, two):
    open_files(app, qtbot, two)
    assert [s.name for s in app.session.document.scans] == ["north.laz", "south.laz"]
    button(app, "Join to one cloud").click()
    wait_until_idle(app, qtbot)
    [scan] = app.session.document.scans
    assert scan.cloud.station_names == ("north.laz", "south.laz")
    assert np.bincount(scan.cloud.station).tolist() == [0, N, N]
    assert scan.files == tuple(two)
    assert app.session.document.view.colour_by is ColourBy.STATION
    app.session.undo()
    assert len(app.session.document.scans) == 2


def test_that_a_joined_scan_comes_back_with_its_project(app, qtbot, two, tmp_path):
    open_files(app, qtbot, two)
    app.window.actions_["join_scans"].trigger()
    wait_until_idle(app, qtbot)
    project = tmp_path / "work.pipegui"
    app.controllers.project._write(project, lambda: None)
    qtbot.waitUntil(project.exists)
    qtbot.waitUntil(lambda: app.controllers.project.path == project)
    before = app.session.document.scan
    app.controllers.project.open(project)
    qtbot.waitUntil(lambda: app.session.document.scan is not before)
    assert len(app.session.document.scan.cloud) == 2 * N
    assert app.session.document.scan.others == (two[1],)


def test_that_a_project_without_a_part_of_its_scan_says_which(app, qtbot, two, tmp_path):
    open_files(app, qtbot, two)
    app.window.actions_["join_scans"].trigger()
    wait_until_idle(app, qtbot)
    project = tmp_path / "work.pipegui"
    app.controllers.project._write(project, lambda: None)
    qtbot.waitUntil(lambda: app.controllers.project.path == project)
    # Moved together, they are found together.
    moved = tmp_path / "moved"
    moved.mkdir()
    for path in two:
        path.rename(moved / path.name)
    saved = read_project(project)
    assert saved.other_files(0, moved / "north.laz") == (moved / "south.laz",)
    (moved / "south.laz").unlink()
    with pytest.raises(ProjectError, match=r"south\.laz.*a part of"):
        saved.other_files(0, moved / "north.laz")


def test_that_scans_closed_meanwhile_are_not_replaced(app, qtbot, in_mm):
    open_files(app, qtbot, [in_mm])
    rereading: Rereading = app.controllers.rereading
    scan = app.session.document.scan
    app.controllers.scans.close_active()
    rereading.on_read_again([scan.cloud], scan)
    assert app.session.document.scans == ()


def test_that_many_notes_are_told_in_few_lines_and_kept_with_the_scan(app, qtbot, tmp_path):
    paths = [tmp_path / f"{i}.xyz" for i in range(4)]
    for path in paths:
        np.savetxt(path, pipe(2000), fmt="%.2f")
    open_files(app, qtbot, paths)
    bar = app.window.panels.message
    assert bar.text.text().count("\n") == 3
    assert bar.details_button.isVisible()
    labels = [
        app.window.panels.properties.list.topLevelItem(i).text(0)
        for i in range(app.window.panels.properties.list.topLevelItemCount())
    ]
    assert "Notes" in labels


def test_that_sizes_that_speak_for_feet_offer_them_after_detecting(make_app, qtbot, in_mm):
    cloud, result = make_scan(N)
    note = Note("In {unit} none has a nominal size; in {other} all have.", unit="m", other="ft")
    cloud = replace(cloud, source=in_mm)
    asked = []

    def detect(_, settings, __):
        asked.append(settings.input)
        return replace(result, notes=(note,))

    app = make_app(read=lambda *_: replace(cloud), detect=detect)
    open_files(app, qtbot, [in_mm])
    app.controllers.scans.detect()
    qtbot.waitUntil(lambda: app.session.document.result is not None)
    assert "in ft all have" in app.window.panels.message.text.text()
    assert app.window.panels.message.answer_buttons[0].text() == "Read in feet"
    button(app, "Read in feet").click()
    qtbot.waitUntil(lambda: app.session.document.result is None)
    assert app.session.document.scan.reading.length_unit is LengthUnit.FOOT
    assert app.window.panels.message.text.text() == "Undo brings back what was detected."
    # A detection is told how the scan was read: its report can be made again.
    app.controllers.scans.detect()
    qtbot.waitUntil(lambda: app.session.document.result is not None)
    assert [given.length_unit for given in asked] == [LengthUnit.AUTO, LengthUnit.FOOT]


def test_that_several_files_are_dropped_and_one_is_closed(app, qtbot, two):
    mime = QMimeData()
    mime.setUrls([QUrl.fromLocalFile(str(path)) for path in two])
    where, copy = app.window.rect().center(), Qt.DropAction.CopyAction
    held = Qt.MouseButton.LeftButton, Qt.KeyboardModifier(0)
    QApplication.sendEvent(app.window, QDragEnterEvent(where, copy, mime, *held))
    drop = QDropEvent(where.toPointF(), copy, mime, *held)
    QApplication.sendEvent(app.window, drop)
    qtbot.waitUntil(lambda: len(app.session.document.scans) == 2)
    wait_until_idle(app, qtbot)
    qtbot.keyClick(app.window, Qt.Key.Key_W, Qt.KeyboardModifier.ControlModifier)
    assert [scan.name for scan in app.session.document.scans] == ["north.laz"]


def test_that_scans_are_joined_though_one_was_detected_meanwhile(make_app, qtbot, two):
    def detect(cloud, settings, progress):
        return replace(make_scan(N)[1], origin=cloud.origin, source=cloud.source)

    app = make_app(read=read_files, detect=detect)
    open_files(app, qtbot, two)
    scans = app.session.document.scans
    app.controllers.scans.detect()
    qtbot.waitUntil(lambda: app.session.document.result is not None)
    app.controllers.rereading.join(scans)
    qtbot.waitUntil(lambda: len(app.session.document.scans) == 1)


def test_that_a_file_that_cannot_be_read_is_told_though_others_are_read_after_it(
    app, qtbot, two, tmp_path
):
    broken = tmp_path / "broken.laz"
    broken.write_bytes(b"LASF" + bytes(50))
    open_files(app, qtbot, [broken, *two])
    qtbot.waitUntil(lambda: len(app.session.document.scans) == 2)
    bar = app.window.panels.message
    assert "broken.laz" in bar.text.text()
    assert "2 scans were opened." in bar.text.text()
    assert bar.property("severity") == "error"
    open_files(app, qtbot, [two[0]])
    assert not bar.isVisible()
