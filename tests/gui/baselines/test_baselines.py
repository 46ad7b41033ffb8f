"""The main views look as they did when somebody last looked at them and found them good.

Pictures are compared small, so that fonts, which differ between machines, do not matter.
`PIPEGUI_NEW_BASELINES=1` takes them anew: look at them before they are committed.
"""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtGui import QImage

from pipegui.scene.canvas import SETTLED_SECONDS
from pipegui.window.views import make_views
from tests.factories import make_cloud, make_result
from tests.gui.patience import wait_until_still

BASELINES = Path(__file__).parents[2] / "data" / "baselines"
SMALL = 64, 40
MAX_DIFFERENCE, MAX_SHARE = 24, 0.02
"""Grey levels by which small pixels may differ, and the share that may differ by more."""
VIEWS = ("scene", "radius_plot", "section", "map")
MANY = 60_000

pytestmark = pytest.mark.baseline


@pytest.fixture
def app(colours_of_the_system, make_app, qtbot):
    cloud, result = make_cloud(MANY), make_result(MANY)
    app = make_app(read=lambda *_: cloud, detect=lambda *_: replace(result), views=make_views())
    app.window.actions_["fly"].setChecked(False)
    app.controllers.scans.open_files([Path("plant.laz")])
    qtbot.waitUntil(app.window.actions_["detect"].isEnabled)
    app.controllers.scans.detect()
    qtbot.waitUntil(lambda: app.session.document.result is not None)
    app.window.panels.message.hide()
    return app


def look(app, name, qtbot):
    """The view's picture, once it is drawn."""
    view = getattr(app.window.views, name)
    if name != "scene":
        app.window.panels.show_plot(view)
    take = view.screenshot if name == "scene" else lambda: view.grab().toImage()
    canvas = app.window.views.scene.canvas
    return wait_until_still(qtbot, take, lambda: canvas.seconds_to_draw == SETTLED_SECONDS)


def small(image):
    """Small pixels of an image, shape (height, width, 3)."""
    image = image.convertToFormat(QImage.Format.Format_RGB32).scaled(
        *SMALL, Qt.AspectRatioMode.IgnoreAspectRatio, Qt.TransformationMode.SmoothTransformation
    )
    flat = np.frombuffer(image.constBits(), np.uint8).reshape(image.height(), -1, 4)
    return flat[:, : image.width(), :3].astype(int)


def share_that_differs(one, other):
    return float((np.abs(small(one) - small(other)).max(axis=2) > MAX_DIFFERENCE).mean())


@pytest.mark.parametrize("appearance", ["light", "dark"])
def test_that_the_main_views_look_as_they_did(app, qtbot, appearance):
    app.window.actions_[f"appearance_{appearance}"].trigger()
    seen = {name: look(app, name, qtbot) for name in VIEWS}
    if os.environ.get("PIPEGUI_NEW_BASELINES"):
        BASELINES.mkdir(parents=True, exist_ok=True)
        for name, image in seen.items():
            assert image.save(str(BASELINES / f"{name}-{appearance}.png"))
    for name, image in seen.items():
        baseline = QImage(str(BASELINES / f"{name}-{appearance}.png"))
        assert not baseline.isNull(), f"{name} has no baseline"
        assert share_that_differs(image, baseline) <= MAX_SHARE, name


@pytest.mark.parametrize("name", VIEWS)
def test_that_another_selection_looks_different(app, qtbot, name):
    """What the comparison lets through is less than what a user would see change."""
    app.window.actions_["appearance_light"].trigger()
    before = look(app, name, qtbot)
    app.window.actions_["next_deformation"].trigger()
    app.window.actions_["next_deformation"].trigger()
    assert share_that_differs(look(app, name, qtbot), before) > MAX_SHARE
