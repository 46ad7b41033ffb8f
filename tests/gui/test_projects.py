"""Saving and opening projects in a real window; crashes, and what is left behind."""

import sys
import threading
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import QMimeData, QPointF, Qt, QUrl
from PySide6.QtGui import QDropEvent
from PySide6.QtWidgets import QDialog, QFileDialog, QMessageBox

from pipecore.io import read, write_laz
from pipecore.types import ReviewState
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
    return read(path, length_unit=settings.input.length_unit, progress=progress)


def detect(cloud, settings, progress):
    return replace(make_scan(N)[1], origin=cloud.origin, source=cloud.source)


@pytest.fixture
def make(make_window):
    return lambda **options: make_window(read=read_file, detect=detect, **options)


@pytest.fixture
def worked(make, qtbot, laz):
    """A window with work that is not saved."""
    window = make()
    work_on(window, qtbot, laz)
    return window


def work_on(window, qtbot, laz) -> None:
    window.open_files([laz])
    qtbot.waitUntil(window.actions_["detect"].isEnabled)
    window.detect()
    qtbot.waitUntil(lambda: window.document.result is not None and not window.jobs.is_busy)


@pytest.fixture
def detecting(make_window, qtbot, laz):
    """A window in the midst of a detection, and the event that lets it end."""
    go = threading.Event()

    def slow(cloud, settings, progress):
        while not go.wait(0.01):
            progress.update("ellipses", 0.5)
        return detect(cloud, settings, progress)

    window = make_window(read=read_file, detect=slow)
    window.open_files([laz])
    qtbot.waitUntil(window.actions_["detect"].isEnabled)
    window.detect()
    yield window, go
    go.set()


def is_idle(window) -> bool:
    return not window.jobs.is_busy and not window.projects.saving.is_busy


def save_to(window, qtbot, monkeypatch, path: Path) -> None:
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: (str(path), ""))
    qtbot.keyClick(window, Qt.Key.Key_S, CONTROL)
    qtbot.waitUntil(lambda: path.is_file() and is_idle(window))


def question(window) -> QMessageBox:
    boxes = [b for b in window.findChildren(QMessageBox, "question") if b.isVisible()]
    assert len(boxes) == 1
    return boxes[0]


def press(window, qtbot, text: str) -> None:
    box = question(window)
    button = next(b for b in box.buttons() if b.text().replace("&", "") == text)
    qtbot.mouseClick(button, Qt.MouseButton.LeftButton)


def test_that_work_is_saved_reopened_and_the_same(worked, qtbot, tmp_path, monkeypatch, make):
    window, path = worked, tmp_path / "job 7.pipegui"
    window.do(element_commands.delete_elements, [9])
    window.do(element_commands.rename_element, 2, "Feed line")
    window.panels.table.chosen.emit(1)
    window.actions_["reject"].trigger()
    assert window.isWindowModified()
    save_to(window, qtbot, monkeypatch, path)
    assert not window.isWindowModified()
    assert window.windowTitle() == "job 7[*] – PipeGUI"

    again = make()
    again.open_files([path])
    qtbot.waitUntil(lambda: again.document.scan is not None and is_idle(again))
    assert [e.label for e in again.document.result.elements] == [
        e.label for e in window.document.result.elements
    ]
    assert again.document.scan.review(1).state is ReviewState.REJECTED
    assert again.document.selection.deformation_id == 1
    assert again.document.view == window.document.view
    assert again.parts.scene.camera_set == window.parts.scene.camera()
    assert again.windowTitle() == "job 7[*] – PipeGUI"
    assert not again.isWindowModified()
    assert not again.history.steps
    recent = [a.text() for a in again.menu_actions._recent_menu.actions()]
    assert recent[0] == "job 7.pipegui"


def test_that_the_mark_of_unsaved_work_follows_undo_and_redo(worked, qtbot, tmp_path, monkeypatch):
    save_to(worked, qtbot, monkeypatch, tmp_path / "a.pipegui")
    worked.do(element_commands.delete_elements, [9])
    assert worked.isWindowModified()
    worked.history.undo()
    assert not worked.isWindowModified()
    worked.history.redo()
    qtbot.keyClick(worked, Qt.Key.Key_S, CONTROL)
    qtbot.waitUntil(lambda: not worked.isWindowModified())
    assert 9 not in [
        e.element_id for e in read_project(tmp_path / "a.pipegui").scans[0].result.elements
    ]


def test_that_save_as_makes_another_file_and_goes_on_with_it(worked, qtbot, tmp_path, monkeypatch):
    save_to(worked, qtbot, monkeypatch, tmp_path / "a.pipegui")
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: (str(tmp_path / "b"), ""))
    qtbot.keyClick(worked, Qt.Key.Key_S, CONTROL | SHIFT)
    qtbot.waitUntil(lambda: (tmp_path / "b.pipegui").is_file() and is_idle(worked))
    assert worked.projects.path == tmp_path / "b.pipegui"


def test_that_saving_need_not_wait_for_a_detection(detecting, qtbot, tmp_path, monkeypatch):
    window, go = detecting
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: (str(tmp_path / "a"), ""))
    window.actions_["save"].trigger()
    qtbot.waitUntil((tmp_path / "a.pipegui").is_file)
    assert window.jobs.is_busy
    go.set()
    qtbot.waitUntil(lambda: window.document.result is not None)
    assert window.isWindowModified(), "what was detected meanwhile is not in the file"


def test_that_a_scan_only_looked_at_closes_without_a_question(make, qtbot, laz):
    window = make()
    window.open_files([laz])
    qtbot.waitUntil(lambda: window.document.scan is not None and is_idle(window))
    assert window.close()


@pytest.mark.parametrize(("answer", "is_open"), [("Cancel", True), ("Discard", False)])
def test_that_closing_asks_for_unsaved_work(worked, qtbot, answer, is_open):
    assert not worked.close()
    press(worked, qtbot, answer)
    qtbot.waitUntil(lambda: worked.isVisible() is is_open)


def test_that_closing_saves_first_if_asked_to(worked, qtbot, tmp_path, monkeypatch):
    path = tmp_path / "a.pipegui"
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: (str(path), ""))
    worked.close()
    press(worked, qtbot, "Save")
    qtbot.waitUntil(lambda: not worked.isVisible())
    assert len(read_project(path).scans[0].result.elements) > 0


def test_that_a_save_that_fails_keeps_the_window_open_and_says_why(
    worked, qtbot, tmp_path, monkeypatch
):
    path = tmp_path / "none" / "a.pipegui"
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: (str(path), ""))
    worked.close()
    press(worked, qtbot, "Save")
    qtbot.waitUntil(lambda: "cannot be written" in worked.panels.message.text.text())
    assert worked.isVisible()
    assert worked.isWindowModified()


def test_that_opening_a_project_asks_for_unsaved_work_first(
    worked, qtbot, tmp_path, monkeypatch, make
):
    save_to(worked, qtbot, monkeypatch, tmp_path / "a.pipegui")
    worked.do(element_commands.delete_elements, [9])
    document = worked.document
    worked.open_files([tmp_path / "a.pipegui"])
    press(worked, qtbot, "Cancel")
    assert worked.document is document
    worked.open_files([tmp_path / "a.pipegui"])
    press(worked, qtbot, "Discard")
    qtbot.waitUntil(lambda: worked.document is not document and is_idle(worked))
    assert 9 in [e.element_id for e in worked.document.result.elements]


def test_that_a_dropped_project_is_opened(make, qtbot, worked, tmp_path, monkeypatch):
    path = tmp_path / "a.pipegui"
    save_to(worked, qtbot, monkeypatch, path)
    window = make()
    data = QMimeData()
    data.setUrls([QUrl.fromLocalFile(str(path))])
    window.dropEvent(
        QDropEvent(
            QPointF(5, 5),
            Qt.DropAction.CopyAction,
            data,
            Qt.MouseButton.LeftButton,
            Qt.KeyboardModifier.NoModifier,
        )
    )
    qtbot.waitUntil(lambda: window.projects.path == path)


def test_that_a_scan_that_was_moved_is_located_by_the_user(
    worked, qtbot, laz, tmp_path, monkeypatch, make
):
    path, elsewhere = tmp_path / "a.pipegui", tmp_path / "other" / "renamed.laz"
    save_to(worked, qtbot, monkeypatch, path)
    elsewhere.parent.mkdir()
    laz.rename(elsewhere)
    window = make()
    window.open_files([path])
    qtbot.waitUntil(lambda: bool(window.findChildren(QMessageBox, "question")))
    assert "plant.laz” is not there" in question(window).text()
    assert str(laz) in question(window).informativeText()
    monkeypatch.setattr(QFileDialog, "getOpenFileName", lambda *_: (str(elsewhere), ""))
    press(window, qtbot, "Locate…")
    qtbot.waitUntil(lambda: window.document.scan is not None and is_idle(window))
    assert window.document.scan.cloud.source == elsewhere
    assert window.document.result is not None


def test_that_a_scan_left_out_does_not_cost_the_file(
    worked, qtbot, laz, tmp_path, monkeypatch, make
):
    path = tmp_path / "a.pipegui"
    save_to(worked, qtbot, monkeypatch, path)
    laz.unlink()
    window = make()
    window.open_files([path])
    qtbot.waitUntil(lambda: bool(window.findChildren(QMessageBox, "question")))
    press(window, qtbot, "Leave it out")
    qtbot.waitUntil(lambda: "left out" in window.panels.message.text.text())
    assert window.projects.path is None, "saving will not overwrite what has more in it"


def test_that_another_scan_in_its_place_is_refused_and_nothing_is_lost(
    worked, qtbot, laz, tmp_path, monkeypatch
):
    save_to(worked, qtbot, monkeypatch, tmp_path / "a.pipegui")
    document = worked.document
    write_laz(laz, make_scan(N + 500)[0])
    worked.open_files([tmp_path / "a.pipegui"])
    qtbot.waitUntil(lambda: bool(worked.findChildren(QMessageBox, "question")))
    press(worked, qtbot, "Use it all the same")
    qtbot.waitUntil(lambda: "another scan" in worked.panels.message.text.text())
    assert worked.document is document


def test_that_a_damaged_project_is_told_and_nothing_is_lost(worked, qtbot, tmp_path):
    path = tmp_path / "a.pipegui"
    path.write_bytes(b"PK nonsense")
    worked.projects._saved = (worked.document.scans, worked.document.settings)
    worked.open_files([path])
    qtbot.waitUntil(lambda: "damaged" in worked.panels.message.text.text())
    assert worked.document.result is not None


# Crashes


def test_that_an_exception_in_a_slot_is_told_with_details_and_the_work_kept(
    make, qtbot, laz, tmp_path
):
    window = make(rescue=tmp_path / "unsaved")
    work_on(window, qtbot, laz)
    qtbot.waitUntil(lambda: window.projects.rescue.path.is_file() and is_idle(window))
    window.do(element_commands.delete_elements, [9])
    guard = CrashGuard(window)
    guard.happened.connect(window.tell_crash)
    guard._hooks = (lambda *_: None, lambda *_: None)
    try:
        raise RuntimeError("oh no")
    except RuntimeError:
        guard.take(*sys.exc_info())
    message = window.panels.message
    assert "RuntimeError" in message.text.text()
    assert message.isVisible()
    message.details_button.click()
    dialog = window.findChild(QDialog, "details")
    assert "oh no" in message._details
    assert "PipeGUI" in message._details
    dialog.close()
    kept = window.projects.rescue.path
    qtbot.waitUntil(lambda: is_idle(window))
    assert 9 not in [e.element_id for e in read_project(kept).scans[0].result.elements]


def test_that_the_guard_takes_exceptions_of_slots_and_threads_and_gives_the_hooks_back(qapp):
    before = sys.excepthook, threading.excepthook
    guard = CrashGuard()
    told = []
    guard.happened.connect(lambda message, details: told.append(details), Qt.DirectConnection)
    guard.install()
    guard._hooks = (lambda *_: None, lambda *_: None)
    try:
        thread = threading.Thread(target=lambda: 1 / 0)
        thread.start()
        thread.join()
        sys.excepthook(ValueError, ValueError("a"), None)
        sys.excepthook(KeyboardInterrupt, KeyboardInterrupt(), None)
    finally:
        guard._hooks = before
        guard.uninstall()
    assert [d.splitlines()[-1].split(":")[0] for d in told] == ["ZeroDivisionError", "ValueError"]
    assert (sys.excepthook, threading.excepthook) == before


def test_that_a_proper_end_leaves_nothing_and_a_crash_leaves_what_can_be_restored(
    make, qtbot, laz, tmp_path
):
    folder = tmp_path / "unsaved"
    window = make(rescue=folder)
    work_on(window, qtbot, laz)
    qtbot.waitUntil(lambda: window.projects.rescue.path.is_file() and is_idle(window))
    window.do(element_commands.rename_element, 2, "Feed line")
    window.projects.rescue.keep()
    qtbot.waitUntil(lambda: is_idle(window))
    # What a process leaves that was killed: the copy, and a lock whose process is gone.
    left = folder / "left.pipegui"
    left.write_bytes(window.projects.rescue.path.read_bytes())
    window.projects.discard()
    window.close()
    assert list(folder.iterdir()) == [left]

    again = make(rescue=folder)
    again.projects.rescue.offer()
    assert again.panels.message.isVisible()
    restore, _ = again.panels.message.answer_buttons
    qtbot.mouseClick(restore, Qt.MouseButton.LeftButton)
    qtbot.waitUntil(lambda: again.document.scan is not None and is_idle(again))
    assert again.document.result.element(2).label == "Feed line"
    assert again.isWindowModified()
    assert again.projects.path is None
    qtbot.waitUntil(lambda: not left.exists())
    assert again.projects.rescue.path.is_file()


def test_that_what_was_left_can_be_deleted_and_a_living_session_is_left_alone(
    make, qtbot, tmp_path
):
    folder = tmp_path / "unsaved"
    first = make(rescue=folder)
    first.projects.rescue.path.write_bytes(b"of a window that is open")
    second = make(rescue=folder)
    second.projects.rescue.offer()
    assert not second.panels.message.isVisible()
    left = folder / "left.pipegui"
    left.write_bytes(b"anything")
    second.projects.rescue.offer()
    _, delete = second.panels.message.answer_buttons
    qtbot.mouseClick(delete, Qt.MouseButton.LeftButton)
    assert not left.exists()
    assert first.projects.rescue.path.exists()


def test_that_nothing_is_kept_while_there_is_nothing_to_lose(make, qtbot, laz, tmp_path):
    window = make(rescue=tmp_path / "unsaved")
    window.projects.rescue.keep()
    window.open_files([laz])
    qtbot.waitUntil(lambda: window.document.scan is not None and is_idle(window))
    window.projects.rescue.keep()
    assert is_idle(window)
    assert not window.projects.rescue.path.exists()
    assert np.isfinite(window.document.scan.cloud.xyz).all()
    assert window.document.settings == Document().settings


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
    again.open_files([path])
    qtbot.waitUntil(lambda: bool(again.findChildren(QMessageBox, "question")))
    assert "has changed" in question(again).text()
    press(again, qtbot, "Use it all the same")
    qtbot.waitUntil(lambda: again.document.scan is not None and is_idle(again))
    # What is saved from here on knows the scan as it was read now.
    again.do(element_commands.rename_element, 2, "Feed line")
    again.projects.save()
    qtbot.waitUntil(lambda: is_idle(again) and not again.isWindowModified())
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
    window, go = detecting
    cloud = window.document.scan.cloud
    window.open_files([path])
    assert question(window).text() == "Stop “Detecting” and open job.pipegui?"
    press(window, qtbot, "Cancel")
    assert window.jobs.title == "Detecting"
    window.open_files([path])
    press(window, qtbot, "Stop and open")
    qtbot.waitUntil(lambda: window.document.result is not None and is_idle(window))
    assert not go.is_set()
    assert window.document.scan.cloud is not cloud
    assert window.windowTitle() == "job[*] – PipeGUI"
    assert window.panels.message.text.text().startswith("Opened")


def test_that_another_scan_is_opened_looked_at_and_closed_while_one_is_detected(
    detecting, qtbot, tmp_path
):
    (window, go), other = detecting, tmp_path / "other.laz"
    write_laz(other, make_scan(N + 100)[0])
    window.open_files([other])
    qtbot.waitUntil(lambda: len(window.document.scans) == 2)
    assert window.jobs.is_busy
    assert "Detecting" in window.status.job.text()
    assert window.document.active == 1
    assert len(window.parts.scene.state.cloud) == N + 100
    # Back to the first by a click in the tree, and to the other with the keyboard.
    tree = window.panels.tree
    for row in (0, 1):
        index = tree.model.index(row, 0)
        tree.view.scrollTo(index)
        place = tree.view.visualRect(index).center()
        qtbot.mouseClick(tree.view.viewport(), Qt.MouseButton.LeftButton, pos=place)
        assert window.document.active == row
    go.set()
    qtbot.waitUntil(lambda: window.document.scans[0].result is not None)
    assert window.document.active == 1
    assert window.document.result is None
    assert window.panels.message.text.text().startswith("plant.laz: ")


def test_that_a_scan_that_cannot_be_read_beside_a_detection_is_told(detecting, qtbot, tmp_path):
    window, go = detecting
    window.open_files([tmp_path / "none.laz"])
    qtbot.waitUntil(lambda: "none.laz" in window.panels.message.text.text())
    assert window.jobs.is_busy
    assert not window.status.currentMessage()
    go.set()
    qtbot.waitUntil(lambda: window.document.result is not None)
