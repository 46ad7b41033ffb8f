"""The bars below the 3D view: the clip box in numbers, the profiles one by one."""

import threading
import time
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QApplication

from pipecore.types import PointCloud
from pipegui.model.document import ClipBox
from pipegui.panels.clip_bar import ClipBar
from pipegui.states.view_state import ClipState
from tests.factories import make_cloud
from tests.gui.patience import PATIENCE_S

LEFT = Qt.MouseButton.LeftButton


def test_that_the_clip_box_is_typed_in_world_coordinates(detected, qtbot):
    bar = detected.window.panels.clip
    assert not bar.isVisible()
    qtbot.keyClick(detected.window, Qt.Key.Key_B)
    assert bar.isVisible()
    assert detected.window.actions_["clip"].isChecked()
    origin = detected.session.document.scan.cloud.origin
    before = detected.window.views.scene.state.view.clip_box
    field = bar.ends[2][1]
    field.setFocus()
    field.selectAll()
    qtbot.keyClicks(field, f"{origin[2] + 1.5:.3f}")
    qtbot.keyClick(field, Qt.Key.Key_Return)
    box = detected.window.views.scene.state.view.clip_box
    assert box.high[2] == pytest.approx(1.5, abs=1e-6)
    # Nothing else moves, not by what the fields round either.
    assert (box.low, box.high[:2]) == (before.low, before.high[:2])
    assert bar.ends[0][0].value() == pytest.approx(origin[0] + box.low[0], abs=0.006)


def test_that_the_bar_clips_to_the_selection_and_back_and_off(detected, qtbot):
    bar = detected.window.panels.clip
    qtbot.keyClick(detected.window, Qt.Key.Key_B)
    whole = detected.session.document.view.clip_box
    qtbot.mouseClick(bar.selection, LEFT)
    near = detected.session.document.view.clip_box
    assert np.subtract(near.high, near.low).prod() < np.subtract(whole.high, whole.low).prod()
    qtbot.mouseClick(bar.whole, LEFT)
    assert detected.session.document.view.clip_box == whole
    qtbot.mouseClick(bar.close_, LEFT)
    assert detected.session.document.view.clip_box is None
    assert not bar.isVisible()


def test_that_the_bar_and_the_menu_show_what_is_outside_of_the_box(detected, qtbot):
    bar = detected.window.panels.clip
    assert not detected.window.actions_["invert_clip"].isEnabled()
    qtbot.keyClick(detected.window, Qt.Key.Key_B)
    qtbot.mouseClick(bar.selection, LEFT)
    qtbot.mouseClick(bar.invert, LEFT)
    assert detected.window.views.scene.state.view.clip_box.is_inverted
    assert detected.window.actions_["invert_clip"].isChecked()
    # Typing a number keeps the side.
    field = bar.ends[0][0]
    field.setFocus()
    field.selectAll()
    qtbot.keyClicks(field, f"{field.value() - 0.5:.2f}")
    qtbot.keyClick(field, Qt.Key.Key_Return)
    assert detected.session.document.view.clip_box.is_inverted
    qtbot.keyClick(detected.window, Qt.Key.Key_B, Qt.KeyboardModifier.ControlModifier)
    assert not detected.session.document.view.clip_box.is_inverted
    assert not bar.invert.isChecked()


@pytest.mark.parametrize("width", [640, 1100])
def test_that_the_numbers_of_the_clip_box_are_whole_in_a_narrow_bar_too(qtbot, width):
    bar = ClipBar()
    qtbot.addWidget(bar)
    cloud = PointCloud(np.array([432_100.0, 6_201_870.0, 110.0]), np.zeros((1, 3), np.float32))
    bar.resize(width, 40)
    bar.apply(ClipState(ClipBox((0.91, 0.32, 0.42), (1.34, 0.66, 0.78)), cloud, has_selection=True))
    QApplication.processEvents()
    assert (bar.width(), bar.minimumSizeHint().width() < width) == (width, True)
    for field in (field for pair in bar.ends for field in pair):
        text = field.fontMetrics().horizontalAdvance(field.text())
        assert text <= field.lineEdit().contentsRect().width() - 4
    is_worded = bar.invert.toolButtonStyle() is Qt.ToolButtonStyle.ToolButtonTextOnly
    assert is_worded == (width > 1000)
    assert bar.close_.geometry().right() < width


@pytest.fixture
def sliced(detected):
    """The profiles of stack 1 are shown."""
    detected.window.panels.stacks.list.topLevelItem(0).setCheckState(0, Qt.CheckState.Checked)
    return detected


def test_that_the_slider_comes_with_a_stack_and_goes_with_it(sliced):
    bar = sliced.window.panels.profiles
    assert bar.isVisible()
    assert bar.all.isChecked()
    sliced.window.panels.stacks.list.topLevelItem(0).setCheckState(0, Qt.CheckState.Unchecked)
    assert not bar.isVisible()


def test_that_slider_buttons_and_keys_go_from_profile_to_profile(sliced, qtbot):
    bar, scene = sliced.window.panels.profiles, sliced.window.views.scene
    profiles = sliced.session.document.result.profiles
    indices = np.unique(profiles.profile_index[profiles.stack_id == 1])
    qtbot.keyClick(sliced.window, Qt.Key.Key_Period)
    assert scene.state.view.shown_profile == indices[0]
    qtbot.keyClick(sliced.window, Qt.Key.Key_Period)
    qtbot.mouseClick(bar.next, LEFT)
    assert scene.state.view.shown_profile == indices[2]
    assert bar.place.text() == f"3 of {len(indices)}"
    qtbot.keyClick(sliced.window, Qt.Key.Key_Comma)
    assert bar.slider.value() == 1
    bar.slider.setFocus()
    qtbot.keyClick(bar.slider, Qt.Key.Key_End)
    assert scene.state.view.shown_profile == indices[-1]
    qtbot.keyClick(sliced.window, Qt.Key.Key_Period)
    assert scene.state.view.shown_profile == indices[-1]
    qtbot.mouseClick(bar.all, LEFT)
    assert scene.state.view.shown_profile is None


def test_that_a_scan_is_seen_while_it_is_read(make_app, qtbot):
    go_on, cloud = threading.Event(), make_cloud()
    part = PointCloud(cloud.origin, cloud.xyz[:100])

    def read(path, settings, progress):
        progress.show_part(part)
        assert go_on.wait(PATIENCE_S)
        return cloud

    app = make_app(read=read)
    app.controllers.scans.open_files([Path("plant.laz")])
    qtbot.waitUntil(lambda: app.window.views.scene.partial_clouds == [part])
    assert app.window.centre.currentWidget() is app.window.views.scene
    go_on.set()
    qtbot.waitUntil(lambda: app.session.document.scan is not None)
    assert app.window.views.scene.partial_clouds == [part, None]


def test_that_the_welcome_comes_back_where_reading_was_cancelled(make_app, qtbot):
    cloud = make_cloud()

    def read(path, settings, progress):
        progress.show_part(cloud)
        while True:
            progress.update("reading", 0.1)
            time.sleep(0.01)

    app = make_app(read=read)
    app.controllers.scans.open_files([Path("plant.laz")])
    qtbot.waitUntil(lambda: len(app.window.views.scene.partial_clouds) == 1)
    app.session.jobs.cancel()
    qtbot.waitUntil(lambda: app.window.centre.currentWidget() is app.window.panels.welcome)
    assert app.window.views.scene.partial_clouds[-1] is None
