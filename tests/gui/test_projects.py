"""Saving and opening projects in a real window; crashes, and what is left behind."""

import sys
import threading
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import QMimeData, QPointF, Qt, QUrl
from PySide6.QtGui import QDropEvent
from PySide6.QtWidgets import QDialog, QFileDialog, QMessageBox, QPlainTextEdit

from pipecore.io import read, write_laz
from pipecore.types import ReviewState
from pipegui.connections import connect_crash_guard
from pipegui.model import element_commands
from pipegui.model.document import Document
from pipegui.project.cloud_reference import CloudState
from pipegui.project.project_file import read_project
from pipegui.work.crash_guard import CrashGuard
from tests.factories import make_scan

N = 3000
CONTROL = Qt.KeyboardModifier.ControlModifier
SHIFT = Qt.KeyboardModifier.ShiftModifier
Button = QMessageBox.StandardButton


@pytest.fixture
def laz(tmp_path) -> Path:
    path = tmp_path / "plant.laz"
    write_laz(path, make_scan(N)[0])
    return path


def read_file(path, settings, progress):
    return read(path, length_unit=settings.length_unit, progress=progress)


def detect(cloud, settings, progress):
    return replace(make_scan(N)[1], origin=cloud.origin, source=cloud.source)


@pytest.fixture
def make(make_app):
    return lambda **options: make_app(read=read_file, detect=detect, **options)


@pytest.fixture
def worked(make, qtbot, laz):
    """A window with work that is not saved."""
    app = make()
    work_on(app, qtbot, laz)
    return app


def work_on(app, qtbot, laz) -> None:
    app.controllers.scans.open_files([laz])
    qtbot.waitUntil(app.window.actions_["detect"].isEnabled)
    app.controllers.scans.detect()
    qtbot.waitUntil(
        lambda: app.session.document.result is not None and not app.session.jobs.is_busy
    )


@pytest.fixture
def detecting(make_app, qtbot, laz):
    """A window in the midst of a detection, and the event that lets it end."""
    go = threading.Event()

    def slow(cloud, settings, progress):
        while not go.wait(0.01):
            progress.update("ellipses", 0.5)
        return detect(cloud, settings, progress)

    app = make_app(read=read_file, detect=slow)
    app.controllers.scans.open_files([laz])
    qtbot.waitUntil(app.window.actions_["detect"].isEnabled)
    app.controllers.scans.detect()
    yield app, go
    go.set()


def is_idle(app) -> bool:
    return not app.session.jobs.is_busy and not app.controllers.project.saving.is_busy


def save_to(app, qtbot, monkeypatch, path: Path) -> None:
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: (str(path), ""))
    qtbot.keyClick(app.window, Qt.Key.Key_S, CONTROL)
    qtbot.waitUntil(lambda: path.is_file() and is_idle(app))


def question(app) -> QMessageBox:
    boxes = [b for b in app.window.findChildren(QMessageBox, "question") if b.isVisible()]
    assert len(boxes) == 1
    return boxes[0]


def press(app, qtbot, text: str) -> None:
    box = question(app)
    button = next(b for b in box.buttons() if b.text().replace("&", "") == text)
    qtbot.mouseClick(button, Qt.MouseButton.LeftButton)


def test_that_work_is_saved_reopened_and_the_same(worked, qtbot, tmp_path, monkeypatch, make):
    app, path = worked, tmp_path / "job 7.pipegui"
    app.session.do(element_commands.delete_elements, [9])
    app.session.do(element_commands.rename_element, 2, "Feed line")
    app.window.panels.table.chosen.emit(1)
    app.window.actions_["reject"].trigger()
    assert app.window.isWindowModified()
    save_to(app, qtbot, monkeypatch, path)
    assert not app.window.isWindowModified()
    assert app.window.windowTitle() == "job 7[*] – PipeGUI"

    again = make()
    again.controllers.scans.open_files([path])
    qtbot.waitUntil(lambda: again.session.document.scan is not None and is_idle(again))
    assert [e.label for e in again.session.document.result.elements] == [
        e.label for e in app.session.document.result.elements
    ]
    assert again.session.document.scan.review(1).state is ReviewState.REJECTED
    assert again.session.document.selection.deformation_id == 1
    assert again.session.document.view == app.session.document.view
    assert again.window.views.scene.camera_set == app.window.views.scene.camera()
    assert again.window.windowTitle() == "job 7[*] – PipeGUI"
    assert not again.window.isWindowModified()
    assert not again.session.history.steps
    recent = [a.text() for a in again.window.recent_files.actions()]
    assert recent[0] == "job 7.pipegui"


def test_that_the_mark_of_unsaved_work_follows_undo_and_redo(worked, qtbot, tmp_path, monkeypatch):
    save_to(worked, qtbot, monkeypatch, tmp_path / "a.pipegui")
    worked.session.do(element_commands.delete_elements, [9])
    assert worked.window.isWindowModified()
    worked.session.history.undo()
    assert not worked.window.isWindowModified()
    worked.session.history.redo()
    qtbot.keyClick(worked.window, Qt.Key.Key_S, CONTROL)
    qtbot.waitUntil(lambda: not worked.window.isWindowModified())
    assert 9 not in [
        e.element_id for e in read_project(tmp_path / "a.pipegui").scans[0].result.elements
    ]


def test_that_save_as_makes_another_file_and_goes_on_with_it(worked, qtbot, tmp_path, monkeypatch):
    save_to(worked, qtbot, monkeypatch, tmp_path / "a.pipegui")
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: (str(tmp_path / "b"), ""))
    qtbot.keyClick(worked.window, Qt.Key.Key_S, CONTROL | SHIFT)
    qtbot.waitUntil(lambda: (tmp_path / "b.pipegui").is_file() and is_idle(worked))
    assert worked.controllers.project.path == tmp_path / "b.pipegui"


def test_that_saving_need_not_wait_for_a_detection(detecting, qtbot, tmp_path, monkeypatch):
    app, go = detecting
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: (str(tmp_path / "a"), ""))
    app.window.actions_["save"].trigger()
    qtbot.waitUntil((tmp_path / "a.pipegui").is_file)
    assert app.session.jobs.is_busy
    go.set()
    qtbot.waitUntil(lambda: app.session.document.result is not None)
    assert app.window.isWindowModified(), "what was detected meanwhile is not in the file"


def test_that_a_scan_only_looked_at_closes_without_a_question(make, qtbot, laz):
    app = make()
    app.controllers.scans.open_files([laz])
    qtbot.waitUntil(lambda: app.session.document.scan is not None and is_idle(app))
    assert app.window.close()


@pytest.mark.parametrize(("answer", "is_open"), [("Cancel", True), ("Discard", False)])
def test_that_closing_asks_for_unsaved_work(worked, qtbot, answer, is_open):
    assert not worked.window.close()
    press(worked, qtbot, answer)
    qtbot.waitUntil(lambda: worked.window.isVisible() is is_open)


def test_that_closing_saves_first_if_asked_to(worked, qtbot, tmp_path, monkeypatch):
    path = tmp_path / "a.pipegui"
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: (str(path), ""))
    worked.window.close()
    press(worked, qtbot, "Save")
    qtbot.waitUntil(lambda: not worked.window.isVisible())
    assert len(read_project(path).scans[0].result.elements) > 0


def test_that_a_save_that_fails_keeps_the_window_open_and_says_why(
    worked, qtbot, tmp_path, monkeypatch
):
    path = tmp_path / "none" / "a.pipegui"
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: (str(path), ""))
    worked.window.close()
    press(worked, qtbot, "Save")
    qtbot.waitUntil(lambda: "cannot be written" in worked.window.panels.message.text.text())
    assert worked.window.isVisible()
    assert worked.window.isWindowModified()


def test_that_opening_a_project_asks_for_unsaved_work_first(
    worked, qtbot, tmp_path, monkeypatch, make
):
    save_to(worked, qtbot, monkeypatch, tmp_path / "a.pipegui")
    worked.session.do(element_commands.delete_elements, [9])
    document = worked.session.document
    worked.controllers.scans.open_files([tmp_path / "a.pipegui"])
    press(worked, qtbot, "Cancel")
    assert worked.session.document is document
    worked.controllers.scans.open_files([tmp_path / "a.pipegui"])
    press(worked, qtbot, "Discard")
    qtbot.waitUntil(lambda: worked.session.document is not document and is_idle(worked))
    assert 9 in [e.element_id for e in worked.session.document.result.elements]


def test_that_a_dropped_project_is_opened(make, qtbot, worked, tmp_path, monkeypatch):
    path = tmp_path / "a.pipegui"
    save_to(worked, qtbot, monkeypatch, path)
    app = make()
    data = QMimeData()
    data.setUrls([QUrl.fromLocalFile(str(path))])
    app.window.dropEvent(
        QDropEvent(
            QPointF(5, 5),
            Qt.DropAction.CopyAction,
            data,
            Qt.MouseButton.LeftButton,
            Qt.KeyboardModifier.NoModifier,
        )
    )
    qtbot.waitUntil(lambda: app.controllers.project.path == path)


def test_that_a_scan_that_was_moved_is_located_by_the_user(
    worked, qtbot, laz, tmp_path, monkeypatch, make
):
    path, elsewhere = tmp_path / "a.pipegui", tmp_path / "other" / "renamed.laz"
    save_to(worked, qtbot, monkeypatch, path)
    elsewhere.parent.mkdir()
    laz.rename(elsewhere)
    app = make()
    app.controllers.scans.open_files([path])
    qtbot.waitUntil(lambda: bool(app.window.findChildren(QMessageBox, "question")))
    assert "plant.laz” is not there" in question(app).text()
    assert str(laz) in question(app).informativeText()
    monkeypatch.setattr(QFileDialog, "getOpenFileName", lambda *_: (str(elsewhere), ""))
    press(app, qtbot, "Locate…")
    qtbot.waitUntil(lambda: app.session.document.scan is not None and is_idle(app))
    assert app.session.document.scan.cloud.source == elsewhere
    assert app.session.document.result is not None


def test_that_a_scan_left_out_does_not_cost_the_file(
    worked, qtbot, laz, tmp_path, monkeypatch, make
):
    path = tmp_path / "a.pipegui"
    save_to(worked, qtbot, monkeypatch, path)
    laz.unlink()
    app = make()
    app.controllers.scans.open_files([path])
    qtbot.waitUntil(lambda: bool(app.window.findChildren(QMessageBox, "question")))
    press(app, qtbot, "Leave it out")
    qtbot.waitUntil(lambda: "left out" in app.window.panels.message.text.text())
    assert app.controllers.project.path is None, "saving will not overwrite what has more in it"


def test_that_another_scan_in_its_place_is_refused_and_nothing_is_lost(
    worked, qtbot, laz, tmp_path, monkeypatch
):
    save_to(worked, qtbot, monkeypatch, tmp_path / "a.pipegui")
    document = worked.session.document
    write_laz(laz, make_scan(N + 500)[0])
    worked.controllers.scans.open_files([tmp_path / "a.pipegui"])
    qtbot.waitUntil(lambda: bool(worked.window.findChildren(QMessageBox, "question")))
    press(worked, qtbot, "Use it all the same")
    qtbot.waitUntil(lambda: "another scan" in worked.window.panels.message.text.text())
    assert worked.session.document is document


def test_that_a_damaged_project_is_told_and_nothing_is_lost(worked, qtbot, tmp_path, monkeypatch):
    save_to(worked, qtbot, monkeypatch, tmp_path / "sound.pipegui")
    path = tmp_path / "a.pipegui"
    path.write_bytes(b"PK nonsense")
    worked.controllers.scans.open_files([path])
    qtbot.waitUntil(lambda: "damaged" in worked.window.panels.message.text.text())
    assert worked.session.document.result is not None


# Crashes


@pytest.fixture
def silent_hooks(monkeypatch):
    """Exceptions that reach Python's hooks are not printed."""
    monkeypatch.setattr(sys, "excepthook", lambda *_: None)
    monkeypatch.setattr(threading, "excepthook", lambda *_: None)


def test_that_an_exception_in_a_slot_is_told_with_details_and_the_work_kept(
    make, qtbot, laz, tmp_path, silent_hooks
):
    app = make(copies=tmp_path / "unsaved")
    work_on(app, qtbot, laz)
    qtbot.waitUntil(lambda: app.controllers.autosave.path.is_file() and is_idle(app))
    app.session.do(element_commands.delete_elements, [9])
    guard = CrashGuard(app.window)
    connect_crash_guard(guard, app.session, app.controllers)
    guard.install()
    try:
        raise RuntimeError("oh no")
    except RuntimeError:
        sys.excepthook(*sys.exc_info())
    finally:
        guard.uninstall()
    message = app.window.panels.message
    assert "RuntimeError" in message.text.text()
    assert message.isVisible()
    message.details_button.click()
    dialog = app.window.findChild(QDialog, "details")
    details = dialog.findChild(QPlainTextEdit).toPlainText()
    assert "oh no" in details
    assert "PipeGUI" in details
    dialog.close()
    kept = app.controllers.autosave.path
    qtbot.waitUntil(lambda: is_idle(app))
    assert 9 not in [e.element_id for e in read_project(kept).scans[0].result.elements]


def test_that_the_guard_takes_exceptions_of_slots_and_threads_and_gives_the_hooks_back(
    qapp, silent_hooks
):
    before = sys.excepthook, threading.excepthook
    guard = CrashGuard()
    told = []
    guard.happened.connect(lambda message, details: told.append(details), Qt.DirectConnection)
    guard.install()
    try:
        thread = threading.Thread(target=lambda: 1 / 0)
        thread.start()
        thread.join()
        sys.excepthook(ValueError, ValueError("a"), None)
        sys.excepthook(KeyboardInterrupt, KeyboardInterrupt(), None)
    finally:
        guard.uninstall()
    assert [d.splitlines()[-1].split(":")[0] for d in told] == ["ZeroDivisionError", "ValueError"]
    assert (sys.excepthook, threading.excepthook) == before


def test_that_a_proper_end_leaves_nothing_and_a_crash_leaves_what_can_be_restored(
    make, qtbot, laz, tmp_path
):
    folder = tmp_path / "unsaved"
    app = make(copies=folder)
    work_on(app, qtbot, laz)
    qtbot.waitUntil(lambda: app.controllers.autosave.path.is_file() and is_idle(app))
    app.session.do(element_commands.rename_element, 2, "Feed line")
    app.controllers.autosave.save_copy()
    qtbot.waitUntil(lambda: is_idle(app))
    # What a process leaves that was killed: the copy, and a lock whose process is gone.
    left = folder / "left.pipegui"
    left.write_bytes(app.controllers.autosave.path.read_bytes())
    app.controllers.project.discard_changes()
    app.window.close()
    assert list(folder.iterdir()) == [left]

    again = make(copies=folder)
    again.controllers.autosave.offer_recovery()
    assert again.window.panels.message.isVisible()
    restore, _ = again.window.panels.message.answer_buttons
    qtbot.mouseClick(restore, Qt.MouseButton.LeftButton)
    qtbot.waitUntil(lambda: again.session.document.scan is not None and is_idle(again))
    assert again.session.document.result.element(2).label == "Feed line"
    assert again.window.isWindowModified()
    assert again.controllers.project.path is None
    qtbot.waitUntil(lambda: not left.exists())
    assert again.controllers.autosave.path.is_file()


def test_that_what_was_left_can_be_deleted_and_a_living_session_is_left_alone(
    make, qtbot, tmp_path
):
    folder = tmp_path / "unsaved"
    first = make(copies=folder)
    first.controllers.autosave.path.write_bytes(b"of a window that is open")
    second = make(copies=folder)
    second.controllers.autosave.offer_recovery()
    assert not second.window.panels.message.isVisible()
    left = folder / "left.pipegui"
    left.write_bytes(b"anything")
    second.controllers.autosave.offer_recovery()
    _, delete = second.window.panels.message.answer_buttons
    qtbot.mouseClick(delete, Qt.MouseButton.LeftButton)
    assert not left.exists()
    assert first.controllers.autosave.path.exists()


def test_that_nothing_is_kept_while_there_is_nothing_to_lose(make, qtbot, laz, tmp_path):
    app = make(copies=tmp_path / "unsaved")
    app.controllers.autosave.save_copy()
    app.controllers.scans.open_files([laz])
    qtbot.waitUntil(lambda: app.session.document.scan is not None and is_idle(app))
    app.controllers.autosave.save_copy()
    assert is_idle(app)
    assert not app.controllers.autosave.path.exists()
    assert np.isfinite(app.session.document.scan.cloud.xyz).all()
    assert app.session.document.settings == Document().settings


# Clouds that change


def change(path: Path) -> None:
    """Write another scan of as many points into a file."""
    cloud = make_scan(N)[0]
    write_laz(path, replace(cloud, xyz=cloud.xyz + np.float32(0.25)))


def test_that_a_scan_that_changed_after_it_was_read_is_noticed_when_reopened(
    worked, qtbot, laz, tmp_path, monkeypatch, make
):
    change(laz)
    path = tmp_path / "job.pipegui"
    save_to(worked, qtbot, monkeypatch, path)
    again = make()
    again.controllers.scans.open_files([path])
    qtbot.waitUntil(lambda: bool(again.window.findChildren(QMessageBox, "question")))
    assert "has changed" in question(again).text()
    press(again, qtbot, "Use it all the same")
    qtbot.waitUntil(lambda: again.session.document.scan is not None and is_idle(again))
    # What is saved from here on knows the scan as it was read now.
    again.session.do(element_commands.rename_element, 2, "Feed line")
    again.controllers.project.save()
    qtbot.waitUntil(lambda: is_idle(again) and not again.window.isWindowModified())
    assert [state for _, state in read_project(path).located()] == [CloudState.FOUND]


def test_that_work_is_saved_although_its_scan_is_gone(worked, qtbot, laz, tmp_path, monkeypatch):
    laz.unlink()
    path = tmp_path / "job.pipegui"
    save_to(worked, qtbot, monkeypatch, path)
    assert [state for _, state in read_project(path).located()] == [CloudState.MISSING]


# Meanwhile


def test_that_a_project_need_not_wait_for_a_detection(
    detecting, make, qtbot, laz, tmp_path, monkeypatch
):
    first, path = make(), tmp_path / "job.pipegui"
    work_on(first, qtbot, laz)
    save_to(first, qtbot, monkeypatch, path)
    app, go = detecting
    cloud = app.session.document.scan.cloud
    app.controllers.scans.open_files([path])
    assert question(app).text() == "Stop “Detecting” and open job.pipegui?"
    press(app, qtbot, "Cancel")
    assert app.session.jobs.title == "Detecting"
    app.controllers.scans.open_files([path])
    press(app, qtbot, "Stop and open")
    qtbot.waitUntil(lambda: app.session.document.result is not None and is_idle(app))
    assert not go.is_set()
    assert app.session.document.scan.cloud is not cloud
    assert app.window.windowTitle() == "job[*] – PipeGUI"
    assert app.window.panels.message.text.text().startswith("Opened")


def test_that_another_scan_is_opened_looked_at_and_closed_while_one_is_detected(
    detecting, qtbot, tmp_path
):
    (app, go), other = detecting, tmp_path / "other.laz"
    write_laz(other, make_scan(N + 100)[0])
    app.controllers.scans.open_files([other])
    qtbot.waitUntil(lambda: len(app.session.document.scans) == 2)
    assert app.session.jobs.is_busy
    assert "Detecting" in app.window.status.job.text()
    assert app.session.document.active == 1
    assert len(app.window.views.scene.state.cloud) == N + 100
    # Back to the first by a click in the tree, and to the other with the keyboard.
    tree = app.window.panels.tree
    for row in (0, 1):
        index = tree.model.index(row, 0)
        tree.view.scrollTo(index)
        place = tree.view.visualRect(index).center()
        qtbot.mouseClick(tree.view.viewport(), Qt.MouseButton.LeftButton, pos=place)
        assert app.session.document.active == row
    go.set()
    qtbot.waitUntil(lambda: app.session.document.scans[0].result is not None)
    assert app.session.document.active == 1
    assert app.session.document.result is None
    assert app.window.panels.message.text.text().startswith("plant.laz: ")


def test_that_a_scan_that_cannot_be_read_beside_a_detection_is_told(detecting, qtbot, tmp_path):
    app, go = detecting
    app.controllers.scans.open_files([tmp_path / "none.laz"])
    qtbot.waitUntil(lambda: "none.laz" in app.window.panels.message.text.text())
    assert app.session.jobs.is_busy
    assert not app.window.status.currentMessage()
    go.set()
    qtbot.waitUntil(lambda: app.session.document.result is not None)
