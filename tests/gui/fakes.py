"""Stand-ins for the views that draw, for tests of the window around them: fast, without GL.

They keep the states they were given and have the real views' signals.
"""

from typing import Any

import numpy as np
from PySide6.QtCore import Signal
from PySide6.QtGui import QImage
from PySide6.QtWidgets import QWidget

from pipegui.window.views import Views


class FakeView(QWidget):
    save_requested = Signal(str)

    def __init__(self) -> None:
        super().__init__()
        self.states: list[Any] = []

    def apply(self, state: Any) -> None:
        self.states.append(state)

    @property
    def state(self) -> Any:
        return self.states[-1]


class FakeScene(FakeView):
    picked = Signal(int)
    hovered = Signal(int)
    station_hovered = Signal(int)
    deformation_picked = Signal(int)
    measurement_closed = Signal(int)
    clip_dragged = Signal(object)

    def __init__(self) -> None:
        super().__init__()
        self.standard_views: list[str] = []
        self.partial_clouds: list[Any] = []

    def show_partial_cloud(self, part: Any) -> None:
        self.partial_clouds.append(part)

    def hide_partial_cloud(self) -> None:
        self.partial_clouds.append(None)

    shades_edges = False

    def set_standard_view(self, name: str) -> None:
        self.standard_views.append(name)

    spot: Any = None

    def mark_spot(self, spot: Any) -> None:
        self.spot = spot

    profile: Any = None

    def mark_profile(self, profile: Any) -> None:
        self.profile = profile

    def fit(self) -> None:
        self.standard_views.append("fit")

    def show_selection(self) -> None:
        self.standard_views.append("selection")

    def camera(self) -> dict[str, list[float]]:
        return {"focus": [1.0, 2.0, 3.0], "look": [4.0, 0.5, 0.25]}

    def set_camera(self, camera: Any) -> None:
        self.camera_set = camera

    def view_direction(self) -> np.ndarray:
        return np.array([0.0, 0.6, -0.8])

    def screenshot(self) -> QImage:
        return self.grab().toImage()


class FakeChooser(FakeView):
    choices_changed = Signal()

    def choices(self) -> dict[str, Any]:
        return {}

    def choose(self, choices: Any) -> None:
        raise AssertionError("nothing was chosen")


class FakeRadiusPlot(FakeChooser):
    profile_clicked = Signal(int, int)
    profile_hovered = Signal(object)
    stack_chosen = Signal(int)
    pin_toggled = Signal()
    pins_cleared = Signal()


class FakeSection(FakeChooser):
    step_requested = Signal(int)
    spot_hovered = Signal(object)


class FakePreview(FakeView):
    seen = Signal(bool)
    chosen = Signal(int, object)
    step_requested = Signal(int)


class FakeMap(FakeView):
    spot_clicked = Signal(float, float)
    spot_hovered = Signal(object)
    deformation_clicked = Signal(int)
    cursor: Any = None

    def show_cursor(self, place: Any) -> None:
        self.cursor = place


def make_fake_views() -> Views:
    return Views(FakeScene(), FakeRadiusPlot(), FakeSection(), FakeMap(), FakePreview())
