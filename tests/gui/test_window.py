"""Whole tasks in a real window: open, detect, select, undo, export, close."""

import threading
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import QMimeData, Qt, QUrl
from PySide6.QtGui import QDragEnterEvent, QDropEvent, QImage
from PySide6.QtWidgets import QApplication, QDialog, QDoubleSpinBox, QFileDialog, QPushButton

from pipecore.errors import CancelledError, ReadError
from pipecore.notes import Note
from pipecore.types import NO_ID
from pipegui.model import selection_commands
from pipegui.model.document import Background, ColourBy, ProfileKey, Selection, Tool
from pipegui.model.selection import selection_of_deformation
from pipegui.panels.deformation_columns import INDEX
from pipegui.states.view_state import resolve
from pipegui.window.action_table import SPECS
from tests.factories import make_cloud, make_result
from tests.gui.patience import PATIENCE_S, seen_after

LEFT = Qt.MouseButton.LeftButton
CTRL = Qt.KeyboardModifier.ControlModifier


def key(qtbot, app, *args):
    qtbot.keyClick(app.window, *args)


def press(qtbot, app, action):
    """Click the button of an action in the tool bar."""
    qtbot.mouseClick(app.window.tool_bar.widgetForAction(app.window.actions_[action]), LEFT)


def everywhere(app):
    """What each part says is selected, as (element, deformation)."""
    table_row = app.window.panels.table.view.currentIndex()
    row = app.window.panels.table.proxy.mapToSource(table_row).row()
    chosen = app.window.panels.table.view.selectionModel().hasSelection()
    in_table = app.window.panels.table.model.deformation(row).deformation_id if chosen else NO_ID
    tree = app.window.panels.tree
    _, kind, item_id = tree.model.what(tree.view.currentIndex())
    parts = app.window.views
    return {
        "scene": parts.scene.state.selection.element_id,
        "plot": getattr(parts.radius_plot.state.element, "element_id", NO_ID),
        "map": getattr(parts.map.state.element, "element_id", NO_ID),
        "section": getattr(parts.section.state.element, "element_id", NO_ID),
        "properties": app.window.panels.properties.list.topLevelItem(0).text(0),
        "tree": (kind.value, item_id),
        "table": in_table,
    }


# First steps


def test_that_an_empty_window_offers_to_open_and_nothing_that_makes_no_sense(app):
    assert app.window.panels.welcome.isVisible()
    assert app.window.panels.welcome.open_button.isEnabled()
    enabled = {s.name for s in SPECS if app.window.actions_[s.name].isEnabled()}
    assert {"open", "demo", "quit"} <= enabled
    assert enabled.isdisjoint({"detect", "cancel", "undo", "export_deformations", "fit", "go_up"})


def test_that_after_opening_the_cloud_is_shown_and_detect_is_lit(app, qtbot):
    app.controllers.scans.open_files([Path("plant.laz")])
    qtbot.waitUntil(lambda: app.session.document.scan is not None and not app.session.jobs.is_busy)
    assert app.window.views.scene.isVisible()
    assert app.window.views.scene.state.cloud is make_cloud()
    assert app.window.actions_["detect"].isEnabled()
    assert app.window.windowTitle() == "plant.laz[*] – PipeGUI"
    assert "20 k points" in app.window.status.scan.text()


def test_that_detecting_ends_with_a_summary_and_the_worst_dent_in_view(app, qtbot):
    app.controllers.scans.open_files([Path("plant.laz")])
    qtbot.waitUntil(app.window.actions_["detect"].isEnabled)
    press(qtbot, app, "detect")
    qtbot.waitUntil(lambda: app.session.document.result is not None)
    message = app.window.panels.message.text.text()
    assert message.startswith("5 pipes in 3 runs, 4 deformations, 1 to reject")
    assert everywhere(app) == {
        "scene": 2,
        "plot": 2,
        "map": 2,
        "section": 2,
        "properties": "Dent 1",
        "tree": ("deformation", 1),
        "table": 1,
    }
    assert app.window.views.scene.state.view.colour_by is ColourBy.DEVIATION


def test_that_a_dropped_file_is_opened(app, qtbot, tmp_path):
    mime = QMimeData()
    mime.setUrls([QUrl.fromLocalFile(str(tmp_path / "a.laz"))])
    where, buttons = app.window.rect().center(), LEFT
    none = Qt.KeyboardModifier.NoModifier
    enter = QDragEnterEvent(where, Qt.DropAction.CopyAction, mime, buttons, none)
    QApplication.sendEvent(app.window, enter)
    assert enter.isAccepted()
    drop = QDropEvent(where.toPointF(), Qt.DropAction.CopyAction, mime, buttons, none)
    QApplication.sendEvent(app.window, drop)
    qtbot.waitUntil(lambda: app.session.document.scan is not None and not app.session.jobs.is_busy)
    assert app.session.document.scan.name == "a.laz"


def test_that_what_reading_left_out_or_guessed_is_said(make_app, qtbot, german):
    note = Note("“{name}”: {count} points left out.", name="a.laz", count=148)
    app = make_app(read=lambda *_: replace(make_cloud(), notes=(note,)))
    app.controllers.scans.open_files([Path("a.laz")])
    qtbot.waitUntil(app.window.panels.message.isVisible)
    assert "148" in app.window.panels.message.text.text()


def test_that_several_files_become_several_scans_of_which_the_tree_chooses(app, qtbot):
    app.controllers.scans.open_files([Path("a.laz"), Path("b.laz")])
    qtbot.waitUntil(lambda: len(app.session.document.scans) == 2 and not app.session.jobs.is_busy)
    assert app.session.document.active == 1
    tree = app.window.panels.tree
    rect = tree.view.visualRect(tree.model.index(0, 0))
    qtbot.mouseClick(tree.view.viewport(), LEFT, pos=rect.center())
    assert app.session.document.active == 0
    assert app.window.windowTitle().startswith("a.laz")


# One selection everywhere


@pytest.mark.parametrize("by", ["scene", "tree", "table", "map", "label"])
def test_that_a_choice_anywhere_is_shown_everywhere(detected, qtbot, by):
    app, parts = detected, detected.window.views
    dent = make_result().deformation(4)
    if by == "scene":
        parts.scene.picked.emit(int((make_result().element_id == 9).argmax()))
        qtbot.waitUntil(lambda: app.session.document.selection.element_id == 9)
        parts.map.deformation_clicked.emit(4)
    elif by == "tree":
        tree = app.window.panels.tree
        index = tree.model.index_of(0, selection_of_deformation(make_result(), 4))
        assert index.data() == "Dent 4 · Pipe 9"
        tree.view.scrollTo(index)
        rect = tree.view.visualRect(index)
        qtbot.mouseClick(tree.view.viewport(), LEFT, pos=rect.center())
    elif by == "table":
        view = app.window.panels.table.view
        index = app.window.panels.table.proxy.index(2, 2)
        qtbot.mouseClick(view.viewport(), LEFT, pos=view.visualRect(index).center())
    elif by == "map":
        parts.scene.picked.emit(int((make_result().element_id == 9).argmax()))
        parts.map.spot_clicked.emit(dent.chainage, dent.clock)
    else:
        parts.scene.deformation_picked.emit(4)
    assert everywhere(app) == {
        "scene": 9,
        "plot": 9,
        "map": 9,
        "section": 9,
        "properties": "Dent 4",
        "tree": ("deformation", 4),
        "table": 4,
    }


def test_that_a_plot_point_selects_its_profile_and_arrows_step_on(detected):
    detected.window.views.radius_plot.profile_clicked.emit(0, 40)
    assert detected.session.document.selection == Selection(1, 2, 1, ProfileKey(0, 40))
    detected.window.views.section.step_requested.emit(1)
    assert detected.window.views.radius_plot.state.selected_index == 41
    assert detected.window.views.section.state.profile.profile_index[0] == 41


def test_that_escape_goes_up(detected, qtbot):
    detected.window.views.radius_plot.profile_clicked.emit(0, 40)
    seen = []
    for _ in range(4):
        key(qtbot, detected, Qt.Key.Key_Escape)
        seen.append(detected.session.document.selection)
    assert seen == [Selection(1, 2, 1), Selection(1, 2), Selection(1), Selection()]


def test_that_n_goes_through_the_deformations(detected, qtbot):
    key(qtbot, detected, Qt.Key.Key_N)
    assert detected.session.document.selection.deformation_id == 3


def test_that_hovering_shows_world_coordinates_and_what_is_there(detected):
    index = int((make_result().element_id == 2).argmax())
    detected.window.views.scene.hovered.emit(index)
    east = make_cloud().world(make_cloud().xyz[index])[0]
    text = detected.window.status.cursor_position.text()
    assert f"E 432\u2009{east - 432_000:.3f}" in text
    detected.window.views.scene.hovered.emit(-1)
    assert detected.window.status.cursor_position.text() == ""


# Looking


def test_that_colours_and_limits_reach_the_scene(detected, qtbot):
    bar = detected.window.tool_bar
    assert bar.limit.isVisible()
    bar.limit.setFocus()
    bar.limit.selectAll()
    qtbot.keyClicks(bar.limit, "5")
    qtbot.keyClick(bar.limit, Qt.Key.Key_Return)
    assert detected.window.views.scene.state.view.deviation_limit_mm == 5
    assert detected.window.views.map.state.limit_mm == 5
    qtbot.keyClicks(bar.colour, "Height")
    assert detected.window.views.scene.state.view.colour_by is ColourBy.HEIGHT
    qtbot.waitUntil(lambda: not bar.limit.isVisible())
    # The letters were meant for the choice, not as keys of the window.
    assert detected.session.document.view.hidden_elements == frozenset()


def test_that_showing_a_stack_colours_its_profiles_and_ticks_only_one(detected):
    stacks = detected.window.panels.stacks.list
    stacks.topLevelItem(0).setCheckState(0, Qt.CheckState.Checked)
    stacks.topLevelItem(2).setCheckState(0, Qt.CheckState.Checked)
    view = detected.window.views.scene.state.view
    assert (view.colour_by, view.shown_stack) == (ColourBy.PROFILE, 3)
    ticked = [stacks.topLevelItem(i).checkState(0) == Qt.CheckState.Checked for i in range(3)]
    assert ticked == [False, False, True]
    stacks.topLevelItem(2).setCheckState(0, Qt.CheckState.Unchecked)
    assert detected.window.views.scene.state.view.shown_stack == NO_ID


def test_that_keys_and_menus_change_the_view(detected, qtbot):
    key(qtbot, detected, Qt.Key.Key_A)
    assert not detected.window.views.scene.state.view.show_axes
    assert not detected.window.actions_["show_axes"].isChecked()
    key(qtbot, detected, Qt.Key.Key_7)
    key(qtbot, detected, Qt.Key.Key_F)
    assert detected.window.views.scene.standard_views == ["top", "fit"]


def test_that_the_view_is_changed_by_menus_and_keys(detected, qtbot):
    view = detected.window.views.scene
    qtbot.keyClick(detected.window, Qt.Key.Key_7, CTRL)
    assert view.standard_views == ["bottom"]
    key(qtbot, detected, Qt.Key.Key_5)
    assert view.state.view.is_parallel
    key(qtbot, detected, Qt.Key.Key_Plus)
    key(qtbot, detected, Qt.Key.Key_Plus)
    key(qtbot, detected, Qt.Key.Key_Minus)
    assert view.state.view.point_size == 1.3
    detected.window.actions_["background_black"].trigger()
    assert view.state.view.background is Background.BLACK
    chosen = [
        b
        for b in Background
        if detected.window.actions_[f"background_{b.name.lower()}"].isChecked()
    ]
    assert chosen == [Background.BLACK]
    detected.window.actions_["eye_dome"].trigger()
    assert view.state.view.eye_dome


@pytest.mark.parametrize("colour_by", [ColourBy.HEIGHT, ColourBy.INTENSITY])
def test_that_limits_of_heights_and_intensities_are_typed(detected, qtbot, colour_by):
    bar = detected.window.tool_bar
    bar.colour.setCurrentIndex(bar.colour.findData(colour_by))
    low, high = bar.ends
    qtbot.waitUntil(lambda: low.isVisible() and high.isVisible() and not bar.limit.isVisible())
    name = f"{colour_by.name.lower()}_limits"
    assert getattr(detected.session.document.view, name) is None
    before = resolve(detected.session.document).window.limits
    wanted = round(sum(before) / 2, 2)
    high.setFocus()
    high.selectAll()
    qtbot.keyClicks(high, f"{wanted:.2f}")
    qtbot.keyClick(high, Qt.Key.Key_Return)
    base = detected.session.document.scan.cloud.origin[2] if colour_by is ColourBy.HEIGHT else 0.0
    chosen = getattr(detected.window.views.scene.state.view, name)
    # The other end keeps what its field rounds.
    assert [c + base for c in chosen] == pytest.approx([before[0], wanted], abs=1e-3)
    detected.window.actions_["fit_limits"].trigger()
    assert getattr(detected.session.document.view, name) is None
    assert resolve(detected.session.document).window.limits == before


def test_that_limits_are_fitted_to_the_deviations(detected):
    detected.window.actions_["fit_limits"].trigger()
    limit = detected.window.views.scene.state.view.deviation_limit_mm
    deviation = detected.session.document.result.deviation
    within = np.abs(deviation[np.isfinite(deviation)]) <= limit / 1000
    assert 0.98 <= within.mean() <= 0.995


def test_that_measuring_is_reached_by_key_and_left_by_escape(detected, qtbot):
    scene = detected.window.views.scene
    element = detected.session.document.selection.element_id
    key(qtbot, detected, Qt.Key.Key_M)
    assert scene.state.view.tool is Tool.MEASURE
    assert detected.window.actions_["measure"].isChecked()
    scene.picked.emit(3)
    scene.picked.emit(400)
    assert len(scene.state.view.measurements) == 1
    key(qtbot, detected, Qt.Key.Key_Backspace)
    assert scene.state.view.measurements == ()
    key(qtbot, detected, Qt.Key.Key_Escape)
    assert scene.state.view.tool is Tool.SELECT
    assert detected.session.document.selection.element_id == element


def test_that_picked_coordinates_are_copied_as_plain_numbers(detected, qtbot):
    key(qtbot, detected, Qt.Key.Key_C)
    detected.window.views.scene.picked.emit(7)
    cloud = detected.session.document.scan.cloud
    copied = [float(v) for v in QApplication.clipboard().text().split("\t")]
    assert copied == pytest.approx(cloud.world(cloud.xyz[7]).tolist(), abs=0.0006)
    assert "Copied" in detected.window.status.currentMessage()


# Undo


def test_that_hiding_and_settings_are_undone_in_turn(detected, qtbot):
    detected.window.panels.tree.visibility_changed.emit((1, 2), True)
    detected.window.panels.settings.changed.emit("elements.min_radius_mm", 40.0)
    assert detected.window.actions_["undo"].text() == "Undo change settings"
    key(qtbot, detected, Qt.Key.Key_Z, CTRL)
    assert detected.session.document.settings.elements.min_radius_mm == 15.0
    assert detected.session.document.view.hidden_elements == {1, 2}
    key(qtbot, detected, Qt.Key.Key_Z, CTRL)
    assert detected.session.document.view.hidden_elements == frozenset()
    key(qtbot, detected, Qt.Key.Key_Z, CTRL | Qt.KeyboardModifier.ShiftModifier)
    assert detected.window.views.scene.state.view.hidden_elements == {1, 2}


def test_that_the_selection_survives_detecting_again(detected, qtbot):
    detected.window.panels.table.chosen.emit(3)
    detected.window.views.radius_plot.profile_clicked.emit(0, 12)
    before = detected.session.document.selection
    detected.controllers.scans.detect()
    qtbot.waitUntil(lambda: not detected.session.jobs.is_busy)
    assert detected.session.document.selection == before


# Work and its ends


def busy_detect(cloud, settings, progress):
    while True:
        progress.update("ellipses", 0.62)
        time.sleep(0.02)


def test_that_a_detection_can_be_cancelled_and_leaves_everything_as_it_was(make_app, qtbot):
    app = make_app(detect=busy_detect)
    app.controllers.scans.open_files([Path("plant.laz")])
    qtbot.waitUntil(app.window.actions_["detect"].isEnabled)
    before = app.session.document
    press(qtbot, app, "detect")
    qtbot.waitUntil(lambda: "ellipses 62 %" in app.window.status.job.text())
    assert not app.window.actions_["detect"].isEnabled()
    qtbot.mouseClick(app.window.status.cancel, LEFT)
    is_busy = seen_after(500, lambda: app.session.jobs.is_busy)
    assert app.window.status.job.text() == "Cancelling…"
    qtbot.waitUntil(lambda: bool(is_busy))
    assert is_busy == [False]
    assert app.session.document is before
    assert not app.window.status.bar.isVisible()
    assert app.window.panels.message.text.text() == "Detecting was cancelled."


def test_that_the_window_answers_while_it_detects(make_app, qtbot):
    app = make_app(detect=busy_detect)
    app.controllers.scans.open_files([Path("plant.laz")])
    qtbot.waitUntil(app.window.actions_["detect"].isEnabled)
    app.controllers.scans.detect()
    key(qtbot, app, Qt.Key.Key_A)
    assert not app.session.document.view.show_axes
    app.window.close()


def test_that_a_file_that_cannot_be_read_is_told_with_details_to_copy(make_app, qtbot):
    def read(path, settings, progress):
        raise ReadError(f"“{path[0].name}” is damaged: it ends after 12 of 100 points.")

    app = make_app(read=read)
    app.controllers.scans.open_files([Path("broken.laz")])
    qtbot.waitUntil(app.window.panels.message.isVisible)
    assert "broken.laz" in app.window.panels.message.text.text()
    qtbot.mouseClick(app.window.panels.message.details_button, LEFT)
    dialog = app.window.findChild(QDialog, "details")
    assert dialog.isVisible()
    assert not dialog.isModal()
    copy = next(b for b in dialog.findChildren(QPushButton) if "Copy" in b.text().replace("&", ""))
    qtbot.mouseClick(copy, LEFT)
    assert "ReadError" in QApplication.clipboard().text()
    dialog.close()


def test_that_a_bug_in_the_detection_keeps_scan_and_result(make_app, qtbot):
    results = [make_result()]
    app = make_app(detect=lambda *_: results.pop())  # the second time raises `IndexError`
    app.controllers.scans.open_files([Path("plant.laz")])
    qtbot.waitUntil(app.window.actions_["detect"].isEnabled)
    app.controllers.scans.detect()
    qtbot.waitUntil(lambda: app.session.document.result is not None)
    result = app.session.document.result
    app.controllers.scans.detect()
    told = "Your scans and earlier results are safe."
    qtbot.waitUntil(lambda: told in app.window.panels.message.text.text())
    assert app.session.document.result is result


def test_that_requests_wait_for_each_other(make_app, qtbot):
    order = []

    def read(path, settings, progress):
        order.append(path[0].name)
        progress.update("reading", 0.5)
        return make_cloud()

    app = make_app(read=read)
    app.controllers.scans.open_files([Path("a.laz"), Path("b.laz"), Path("c.laz")])
    qtbot.waitUntil(lambda: len(app.session.document.scans) == 3)
    assert order == ["a.laz", "b.laz", "c.laz"]


def test_that_cancel_forgets_what_waits(make_app, qtbot):
    def read(path, settings, progress):
        while True:
            progress.update("reading", 0.1)
            time.sleep(0.01)

    app = make_app(read=read)
    app.controllers.scans.open_files([Path("a.laz"), Path("b.laz")])
    app.session.jobs.cancel()
    qtbot.waitUntil(lambda: not app.session.jobs.is_busy)
    assert app.session.document.scans == ()


def test_that_closing_while_working_stops_the_work(make_app, qtbot):
    stopped = []

    def detect(cloud, settings, progress):
        try:
            busy_detect(cloud, settings, progress)
        except CancelledError:
            stopped.append(True)
            raise

    app = make_app(detect=detect)
    app.controllers.scans.open_files([Path("plant.laz")])
    qtbot.waitUntil(app.window.actions_["detect"].isEnabled)
    app.controllers.scans.detect()
    qtbot.waitUntil(lambda: "ellipses" in app.window.status.job.text())
    app.window.close()
    assert stopped == [True]


def test_that_a_setting_that_does_not_fit_is_told_and_shown_as_it_was(detected):
    detected.window.panels.settings.changed.emit("deformation.min_depth_mm", -1.0)
    assert detected.window.panels.message.isVisible()
    assert detected.session.document.settings.deformation.min_depth_mm == 3.0


# Files


@pytest.mark.parametrize(
    ("table", "n_rows"),
    [("deformations", 4), ("elements", 9), ("profiles", len(make_result().profiles))],
)
def test_that_tables_are_exported_whole(detected, tmp_path, monkeypatch, table, n_rows):
    target = tmp_path / f"{table}.csv"
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *a: (str(target), ""))
    detected.window.actions_[f"export_{table}"].trigger()
    lines = target.read_text(encoding="utf-8").splitlines()
    assert len(lines) == 1 + n_rows
    assert "element_id" in lines[0]
    assert str(target) in detected.window.panels.message.text.text()


def test_that_a_table_that_cannot_be_written_is_told(detected, tmp_path, monkeypatch):
    target = tmp_path / "missing" / "deformations.csv"
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *a: (str(target), ""))
    detected.window.actions_["export_deformations"].trigger()
    assert "was not saved" in detected.window.panels.message.text.text()


def test_that_a_picture_of_the_3d_view_is_saved(detected, tmp_path, monkeypatch):
    target = tmp_path / "view.png"
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *a: (str(target), ""))
    detected.window.actions_["export_picture"].trigger()
    assert QImage(str(target)).width() == detected.window.views.scene.width()


def test_that_the_report_folder_is_written_beside_the_window_and_never_over_another(
    detected, qtbot, tmp_path, monkeypatch
):
    monkeypatch.setattr(QFileDialog, "getExistingDirectory", lambda *a: str(tmp_path))
    for name in ("plant report", "plant report 2"):
        detected.window.actions_["export_report"].trigger()
        qtbot.waitUntil(lambda: not detected.session.jobs.is_busy)
        assert (tmp_path / name / "deformations.csv").is_file()
        assert (tmp_path / name / "report.html").is_file()


def test_that_settings_are_saved_and_loaded(detected, tmp_path, monkeypatch):
    target = tmp_path / "mine.toml"
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *a: (str(target), ""))
    monkeypatch.setattr(QFileDialog, "getOpenFileName", lambda *a: (str(target), ""))
    detected.window.panels.settings.changed.emit("elements.min_radius_mm", 40.0)
    detected.window.actions_["save_settings"].trigger()
    detected.window.panels.settings.changed.emit("elements.min_radius_mm", 50.0)
    detected.window.actions_["load_settings"].trigger()
    assert detected.session.document.settings.elements.min_radius_mm == 40.0


def test_that_opened_files_are_remembered(make_app, qtbot, tmp_path):
    from dataclasses import replace

    path = tmp_path / "plant.laz"
    path.touch()
    app = make_app(read=lambda p, s, g: replace(make_cloud(), source=p[0]))
    app.controllers.scans.open_files([path])
    qtbot.waitUntil(lambda: app.session.document.scan is not None and not app.session.jobs.is_busy)
    app.window.close()
    again = make_app(read=lambda p, s, g: replace(make_cloud(), source=p[0]))
    recent = again.window.recent_files.actions()
    assert [a.text() for a in recent] == ["plant.laz"]
    recent[0].trigger()
    qtbot.waitUntil(lambda: again.session.document.scan is not None)


# The window itself


def test_that_the_layout_comes_back_as_it_was_left(make_app, qtbot):
    app = make_app()
    app.window.panels.docks["Properties"].hide()
    app.window.close()
    again = make_app()
    assert not again.window.panels.docks["Properties"].isVisible()
    assert again.window.panels.docks["Project"].isVisible()


def test_that_no_key_is_given_twice():
    keys = [s.shortcut for s in SPECS if s.shortcut]
    assert len(keys) == len(set(keys))


def test_that_every_button_and_field_says_what_it_is(detected):
    """Names for screen readers: an icon alone is not one."""
    from PySide6.QtWidgets import QAbstractSpinBox, QComboBox, QToolButton

    nameless = [
        w
        for kind in (QToolButton, QComboBox, QAbstractSpinBox)
        for w in detected.window.findChildren(kind)
        if w.isVisible()
        and not w.objectName().startswith("qt_")
        and not (w.accessibleName() or w.toolTip() or getattr(w, "text", str)())
    ]
    assert nameless == []


def test_that_all_is_usable_at_1366_by_768(detected):
    assert detected.window.width() <= 1366
    assert detected.window.height() <= 768
    assert detected.window.views.scene.width() > 500
    assert detected.window.views.scene.height() > 300
    place = detected.window.panels.table.proxy.index(0, INDEX["verdict"])
    verdict = detected.window.panels.table.view.visualRect(place)
    assert verdict.isValid()
    assert detected.window.panels.table.view.viewport().rect().contains(verdict)


def test_that_silent_work_is_seen_to_go_on(make_app, qtbot, monkeypatch):
    monkeypatch.setattr("pipegui.panels.status.SILENT_MS", 100)
    go_on = threading.Event()

    def compile_first(cloud, settings, progress):
        progress.update("thinning", 0.0)
        go_on.wait(PATIENCE_S)
        progress.update("thinning", 1.0)
        return make_result()

    app = make_app(detect=compile_first)
    app.controllers.scans.open_files([Path("plant.laz")])
    qtbot.waitUntil(app.window.actions_["detect"].isEnabled)
    app.controllers.scans.detect()
    qtbot.waitUntil(lambda: "working" in app.window.status.job.text())
    assert app.window.status.bar.maximum() == 0
    go_on.set()
    qtbot.waitUntil(lambda: app.session.document.result is not None)


def test_that_a_number_still_being_typed_counts_for_the_detection(make_app, qtbot):
    used = []

    def detect(cloud, settings, progress):
        used.append(settings.elements.min_radius_mm)
        return make_result()

    app = make_app(detect=detect)
    app.controllers.scans.open_files([Path("plant.laz")])
    qtbot.waitUntil(app.window.actions_["detect"].isEnabled)
    app.window.panels.docks["Settings"].raise_()
    field = app.window.panels.settings.findChild(QDoubleSpinBox, "elements.min_radius_mm")
    field.setFocus()
    field.selectAll()
    qtbot.keyClicks(field, "40")
    press(qtbot, app, "detect")
    qtbot.waitUntil(lambda: app.session.document.result is not None)
    assert used == [40.0]


def test_that_the_plots_are_headed_by_what_they_show(detected):
    dock = detected.window.panels.docks["Element"]
    assert dock.windowTitle() == "Pipe 2 · dent 1"
    detected.window.views.scene.picked.emit(-1)
    assert dock.windowTitle() == "Element"


def test_that_the_profile_under_the_cursor_of_the_radius_plot_is_marked_in_3d(detected):
    detected.session.do(selection_commands.select_element, 2)
    parts = detected.window.views
    profiles = detected.session.document.result.profiles.of_element(2)
    key = ProfileKey(int(profiles.stack_id[5]), int(profiles.profile_index[5]))
    parts.radius_plot.profile_hovered.emit(key)
    assert parts.scene.profile.chainage == pytest.approx(profiles.chainage[5:6])
    parts.radius_plot.profile_hovered.emit(None)
    assert parts.scene.profile is None


def test_that_the_cursor_on_the_map_is_marked_in_3d_and_the_other_way_round(detected):

    detected.session.do(selection_commands.select_element, 2)
    scan, parts = detected.session.document.scan, detected.window.views
    parts.map.spot_hovered.emit((0.8, 0.5))
    distance = scan.result.element(2).axis.pipe_coordinates(parts.scene.spot[None])
    assert [float(v[0]) for v in distance] == pytest.approx([0.8, 0.08415, 0.5], abs=1e-4)
    parts.map.spot_hovered.emit(None)
    assert parts.scene.spot is None
    on_it = int(np.flatnonzero(scan.result.element_id == 2)[0])
    parts.scene.hovered.emit(on_it)
    assert parts.map.cursor is not None
    parts.scene.hovered.emit(int(np.flatnonzero(scan.result.element_id == 9)[0]))
    assert parts.map.cursor is None


def test_that_what_was_said_of_a_step_goes_when_it_is_undone(detected, qtbot):
    message = detected.window.panels.message
    assert message.isVisible()
    qtbot.keyClick(detected.window, Qt.Key.Key_Z, CTRL)
    assert detected.session.document.result is None
    assert not message.isVisible()
