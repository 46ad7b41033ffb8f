"""The bars below the 3D view: the clip box in numbers, the profiles one by one."""

import numpy as np
import pytest
from PySide6.QtCore import Qt

LEFT = Qt.MouseButton.LeftButton


def test_that_the_clip_box_is_typed_in_world_coordinates(detected, qtbot):
    bar = detected.panels.clip
    assert not bar.isVisible()
    qtbot.keyClick(detected, Qt.Key.Key_B)
    assert bar.isVisible()
    assert detected.actions_["clip"].isChecked()
    origin = detected.document.scan.cloud.origin
    field = bar.ends[2][1]
    field.setFocus()
    field.selectAll()
    qtbot.keyClicks(field, f"{origin[2] + 1.5:.3f}")
    qtbot.keyClick(field, Qt.Key.Key_Return)
    box = detected.parts.scene.state.view.clip_box
    assert box.high[2] == pytest.approx(1.5, abs=1e-6)
    assert bar.ends[0][0].value() == pytest.approx(origin[0] + box.low[0], abs=0.001)


def test_that_the_bar_clips_to_the_selection_and_back_and_off(detected, qtbot):
    bar = detected.panels.clip
    qtbot.keyClick(detected, Qt.Key.Key_B)
    whole = detected.document.view.clip_box
    qtbot.mouseClick(bar.selection, LEFT)
    near = detected.document.view.clip_box
    assert np.subtract(near.high, near.low).prod() < np.subtract(whole.high, whole.low).prod()
    qtbot.mouseClick(bar.whole, LEFT)
    assert detected.document.view.clip_box == whole
    qtbot.mouseClick(bar.close_, LEFT)
    assert detected.document.view.clip_box is None
    assert not bar.isVisible()
