"""The 3D view on screens with more than one pixel to a pixel.

Qt takes the scale when it starts, so each has a process of its own: `main` below.
"""

import json
import os
import subprocess
import sys

import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QSignalSpy, QTest
from PySide6.QtWidgets import QApplication

from tests.gui.patience import PATIENCE

SIZE = (520, 400)
ELEMENTS = (2, 4, 7)


def main() -> None:
    """Click points in a view, look at its picture, and say what came of it."""
    from tests.gui.test_scene_view import STILL, SceneView, on_screen, scene_state, seen_points

    app = QApplication([])
    scene = SceneView()
    scene.resize(*SIZE)
    scene.show()
    assert QTest.qWaitForWindowExposed(scene, PATIENCE)
    scene.apply(scene_state(view=STILL))
    while scene.canvas.is_moving or scene.canvas.is_stale or not scene.points.n_shown:
        app.processEvents()
    meant = [index for element in ELEMENTS for index in seen_points(scene, element, 3)]
    picked = []
    for index in meant:
        spy = QSignalSpy(scene.picked)
        QTest.mouseClick(scene.canvas, Qt.MouseButton.LeftButton, pos=on_screen(scene, index))
        picked.append(spy.at(0)[0])
    image = scene.screenshot()
    image = image.convertToFormat(image.Format.Format_RGB888)
    rows = np.frombuffer(image.constBits(), np.uint8).reshape(image.height(), -1)
    colours = rows[:, : 3 * image.width()].reshape(image.height(), image.width(), 3).astype(int)
    told = {
        "meant": meant,
        "picked": picked,
        "size": [image.width(), image.height()],
        "coloured": float((np.ptp(colours, axis=2) > 40).mean()),
        "point_px": scene.points.point_px,
    }
    scene.close()
    print(json.dumps(told))


def at_scale(scale: float) -> dict:
    said = subprocess.run(
        [sys.executable, "-m", "tests.gui.test_high_dpi"],
        env=os.environ | {"QT_SCALE_FACTOR": str(scale)},
        capture_output=True,
        text=True,
        timeout=600,
        check=True,
    )
    return json.loads(said.stdout.splitlines()[-1])


@pytest.fixture(scope="module")
def plain() -> dict:
    return at_scale(1)


@pytest.mark.parametrize("scale", [1.5, 2])
def test_that_a_fine_screen_shows_the_same_and_a_click_means_the_same(plain, scale):
    fine = at_scale(scale)
    assert fine["size"] == [round(scale * s) for s in SIZE]
    assert len(fine["meant"]) == 3 * len(ELEMENTS)
    assert fine["picked"] == fine["meant"]
    # Points as large as on any screen, not a quarter of it.
    assert fine["point_px"] == pytest.approx(plain["point_px"], rel=1e-6)
    assert fine["coloured"] == pytest.approx(plain["coloured"], rel=0.2)


if __name__ == "__main__":
    main()
