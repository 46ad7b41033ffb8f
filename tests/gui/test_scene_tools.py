"""Measuring and clipping in the 3D view, with a real mouse and the commands behind it."""

import numpy as np
import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtWidgets import QApplication

from pipegui import view_commands
from pipegui.document import Document, Measurement, Scan, Tool, ViewOptions
from pipegui.scene.measure_marks import lines_of
from pipegui.scene.view import SceneView
from pipegui.view_state import resolve
from tests.factories import ORIGIN, make_scan
from tests.gui.test_scene_view import drag, on_screen, seen_points, settle

CLOUD, RESULT = make_scan()
LEFT = Qt.MouseButton.LeftButton
STILL = ViewOptions(fly=False, show_labels=False)


class Desk:
    """A scene with a document behind it, as the window has."""

    def __init__(self, qtbot):
        self.qtbot = qtbot
        self.scene = SceneView()
        self.document = Document(scans=(Scan("plant.laz", CLOUD, RESULT),), view=STILL)
        self.scene.picked.connect(lambda i: self.do(view_commands.click_point, i))
        self.scene.measurement_closed.connect(
            lambda i: self.do(view_commands.delete_measurement, i)
        )

    def do(self, command, *args):
        self.document = command(self.document, *args)
        self.scene.apply(resolve(self.document).scene)

    def click(self, position):
        self.qtbot.mouseClick(self.scene.canvas, LEFT, pos=position)
        settle(self.qtbot, self.scene)

    @property
    def view(self):
        return self.document.view


@pytest.fixture
def desk(qtbot, no_leaks):
    desk = Desk(qtbot)
    qtbot.addWidget(desk.scene)
    desk.scene.resize(640, 480)
    with qtbot.waitExposed(desk.scene):
        desk.scene.show()
    desk.do(view_commands.set_view)
    settle(qtbot, desk.scene)
    yield desk
    desk.scene.close()


def test_that_two_clicks_measure_between_the_very_points(desk):
    first, second = seen_points(desk.scene, 2)[0], seen_points(desk.scene, 7)[0]
    desk.do(view_commands.choose_tool, Tool.MEASURE)
    desk.click(on_screen(desk.scene, first))
    assert desk.view.measuring_from == tuple(CLOUD.xyz[first].tolist())
    assert desk.view.measurements == ()
    desk.click(on_screen(desk.scene, second))
    (made,) = desk.view.measurements
    assert (made.start, made.end) == tuple(tuple(CLOUD.xyz[i].tolist()) for i in (first, second))
    # The next click begins another one; nothing was selected by any of them.
    desk.click(on_screen(desk.scene, second))
    assert desk.view.measuring_from is not None
    assert desk.document.selection.element_id == 0


def test_that_a_measurement_tells_the_distance_and_its_parts_along_the_worlds_axes():
    made = Measurement((0.0, 0.0, 0.0), (3.0, -4.0, 12.0))
    assert lines_of(made, CLOUD) == (
        "13.000 m",
        "ΔE +3.000  ΔN −4.000  ΔH +12.000",
        "horizontal 5.000 m",
    )


def test_that_a_picked_point_tells_world_coordinates(desk):
    (index, *_) = seen_points(desk.scene, 4)
    desk.do(view_commands.choose_tool, Tool.COORDINATES)
    desk.click(on_screen(desk.scene, index))
    (made,) = desk.view.measurements
    assert made.end is None
    east, _, height = CLOUD.xyz[index] + ORIGIN
    lines = [line.replace("\u2009", "") for line in lines_of(made, CLOUD)]
    assert lines[0] == f"E {east:.3f}"
    assert lines[2] == f"H {height:.3f}"


def test_that_the_cross_of_a_measurement_deletes_it_and_no_other(desk):
    points = [tuple(CLOUD.xyz[seen_points(desk.scene, i)[0]].tolist()) for i in (2, 7)]
    two = tuple(Measurement(p) for p in points)
    desk.do(lambda d: view_commands.set_view(d, measurements=two))
    settle(desk.qtbot, desk.scene)
    desk.scene.screenshot()
    box, number = desk.scene.overlay._crosses[1]
    assert number == 1
    desk.click(box.center().toPoint())
    assert desk.view.measurements == two[:1]


def test_that_the_line_follows_the_cursor_to_the_second_point(desk, qtbot):
    first, second = seen_points(desk.scene, 2)[0], seen_points(desk.scene, 7)[0]
    desk.do(view_commands.choose_tool, Tool.MEASURE)
    desk.click(on_screen(desk.scene, first))
    with qtbot.waitSignal(desk.scene.hovered):
        qtbot.mouseMove(desk.scene.canvas, on_screen(desk.scene, second) + QPoint(1, 0))
        qtbot.mouseMove(desk.scene.canvas, on_screen(desk.scene, second))
    QApplication.processEvents()
    (mark,) = desk.scene.overlay.marks
    distance = np.linalg.norm(np.array(mark.measurement.end) - CLOUD.xyz[first])
    assert mark.lines[0] == f"{distance:.3f} m"


def test_that_escape_gives_up_the_point_then_the_tool_then_goes_up():
    document = Document(scans=(Scan("plant.laz", CLOUD, RESULT),), view=STILL)
    document = view_commands.select_point(document, int(np.flatnonzero(RESULT.element_id == 2)[0]))
    document = view_commands.choose_tool(document, Tool.MEASURE)
    document = view_commands.click_point(document, 5)
    document = view_commands.escape(document)
    assert (document.view.measuring_from, document.view.tool) == (None, Tool.MEASURE)
    document = view_commands.escape(document)
    assert document.view.tool is Tool.SELECT
    assert document.selection.element_id == 2
    assert view_commands.escape(document).selection.element_id == 0


def test_that_a_drag_still_orbits_while_measuring(desk, qtbot):
    desk.do(view_commands.choose_tool, Tool.MEASURE)
    before = desk.scene.view_direction()
    drag(qtbot, desk.scene, LEFT, QPoint(320, 240), QPoint(420, 240))
    assert before @ desk.scene.view_direction() < 0.99
    assert desk.view.measuring_from is None
