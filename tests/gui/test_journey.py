"""The whole window with its real 3D view and plots: a surveyor's first five minutes."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import QPoint, Qt

from pipegui.model.document import ColourBy, Selection
from pipegui.scene.canvas import SETTLED_SECONDS
from pipegui.scene.colouring import PROFILE_COLOURS
from pipegui.window.views import make_views
from tests.factories import make_cloud, make_result
from tests.gui.patience import wait_until_still

LEFT = Qt.MouseButton.LeftButton
MANY = 60_000


@pytest.fixture
def real_app(make_app):
    cloud, result = make_cloud(MANY), make_result(MANY)
    app = make_app(read=lambda *_: cloud, detect=lambda *_: replace(result), views=make_views())
    # A flight takes its time on a machine without a GPU.
    app.window.actions_["fly"].setChecked(False)
    return app


def wait_until_drawn(app, qtbot):
    """Wait until the camera has settled and the 3D view looks the same for a while."""
    scene = app.window.views.scene
    return wait_until_still(
        qtbot, scene.screenshot, lambda: scene.canvas.seconds_to_draw == SETTLED_SECONDS
    )


def pixels(image):
    image = image.convertToFormat(image.Format.Format_RGB32)
    flat = np.frombuffer(image.constBits(), np.uint8).reshape(image.height(), -1, 4)
    return flat[:, : image.width(), :3].astype(int)


def test_that_a_window_without_a_scan_opens_and_closes(real_app):
    assert real_app.window.panels.welcome.isVisible()


def test_that_open_detect_click_plot_and_table_show_one_thing(real_app, qtbot):
    app, scene = real_app, real_app.window.views.scene
    app.controllers.scans.open_files([Path("plant.laz")])
    qtbot.waitUntil(app.window.actions_["detect"].isEnabled)
    opened = pixels(wait_until_drawn(app, qtbot))
    assert len(np.unique(opened.reshape(-1, 3), axis=0)) > 50, "the cloud is drawn"

    app.controllers.scans.detect()
    qtbot.waitUntil(lambda: app.session.document.result is not None)
    app.window.panels.message.hide()
    detected = pixels(wait_until_drawn(app, qtbot))
    # The panels may have taken some room for what they now show.
    height, width = np.minimum(detected.shape, opened.shape)[:2]
    change = np.abs(detected[:height, :width] - opened[:height, :width]).max(axis=2)
    assert (change > 20).mean() > 0.05, "coloured by deviation"
    assert app.session.document.selection.deformation_id == 1

    # Nothing selected; then a click where the dent is looked at takes its pipe.
    for _ in range(3):
        qtbot.keyClick(app.window, Qt.Key.Key_Escape)
    assert app.session.document.selection == Selection()
    wait_until_drawn(app, qtbot)
    index = make_result(MANY).element_id == 2
    near = (
        np.linalg.norm(make_cloud(MANY).xyz - make_result(MANY).deformation(1).peak, axis=1) < 0.15
    )
    place = next(
        QPoint(x, y)
        for x in range(scene.width() // 2 - 90, scene.width() // 2 + 90, 6)
        for y in range(scene.height() // 2 - 90, scene.height() // 2 + 90, 6)
        if (hit := scene.pick(QPoint(x, y).toPointF())) >= 0 and index[hit] and near[hit]
    )
    qtbot.mouseClick(scene.canvas, LEFT, pos=place)
    qtbot.waitUntil(lambda: app.session.document.selection.element_id == 2)
    assert app.window.panels.docks["Element"].windowTitle() == "Pipe 2"

    # A row of the table takes camera, plot and tree to its deformation.
    before = pixels(wait_until_drawn(app, qtbot))
    view = app.window.panels.table.view
    row = app.window.panels.table.proxy.index(1, 3)
    qtbot.mouseClick(view.viewport(), LEFT, pos=view.visualRect(row).center())
    assert app.session.document.selection.deformation_id == 3
    after = pixels(wait_until_drawn(app, qtbot))
    assert (np.abs(after - before).max(axis=2) > 20).mean() > 0.05, "the camera went there"
    assert app.window.panels.tree.model.what(app.window.panels.tree.view.currentIndex())[2] == 3


def test_that_colours_stacks_and_hiding_change_the_picture_and_undo_brings_it_back(real_app, qtbot):
    app = real_app
    app.controllers.scans.open_files([Path("plant.laz")])
    qtbot.waitUntil(app.window.actions_["detect"].isEnabled)
    app.controllers.scans.detect()
    qtbot.waitUntil(lambda: app.session.document.result is not None)
    app.window.panels.message.hide()  # else the view grows when the undo takes it away
    for _ in range(3):
        qtbot.keyClick(app.window, Qt.Key.Key_Escape)
    qtbot.keyClick(app.window, Qt.Key.Key_F)
    first = pixels(wait_until_drawn(app, qtbot))
    app.window.panels.tree.visibility_changed.emit((7,), True)
    hidden = pixels(wait_until_drawn(app, qtbot))
    assert (first != hidden).any(axis=2).mean() > 0.01
    qtbot.keyClick(app.window, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    assert (pixels(wait_until_drawn(app, qtbot)) == first).all(axis=2).mean() > 0.999
    app.window.panels.stacks.list.topLevelItem(0).setCheckState(0, Qt.CheckState.Checked)
    assert app.session.document.view.colour_by is ColourBy.PROFILE

    def share_of(colour, picture):
        return (np.abs(picture.astype(int) - colour).max(axis=2) < 12).mean()

    # The view is lower now, by the slider over the profiles.
    shown = pixels(wait_until_drawn(app, qtbot))
    blue_to_red = PROFILE_COLOURS[1][::-1]
    assert share_of(blue_to_red, first) < 0.001
    assert share_of(blue_to_red, shown) > 0.005
