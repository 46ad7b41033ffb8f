"""Measuring and clipping in the 3D view, with a real mouse and the commands behind it."""

from dataclasses import replace

import numpy as np
import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtWidgets import QApplication

from pipegui.model import selection_commands, view_commands
from pipegui.model.document import ClipBox, ColourBy, Document, Measurement, Scan, Tool, ViewOptions
from pipegui.scene import clipping
from pipegui.scene.measure_marks import lines_of
from pipegui.scene.view import SceneView
from pipegui.states.view_state import resolve
from tests.factories import ORIGIN, make_scan
from tests.gui.patience import hover
from tests.gui.test_scene_view import drag, mouse_move, on_screen, picture, seen_points, settle

CLOUD, RESULT = make_scan()
NO_KEYS = Qt.KeyboardModifier.NoModifier
LEFT = Qt.MouseButton.LeftButton
STILL = ViewOptions(fly=False, show_labels=False)


class Desk:
    """A scene with a document behind it, as the window has."""

    def __init__(self, qtbot):
        self.qtbot = qtbot
        self.scene = SceneView()
        self.document = Document(scans=(Scan("plant.laz", CLOUD, RESULT),), view=STILL)
        self.scene.picked.connect(lambda i: self.do(view_commands.click_point, i))
        self.scene.clip_dragged.connect(lambda box: self.do(view_commands.set_clip_box, box))
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
    box, number = desk.scene.overlay.crosses[1]
    assert number == 1
    desk.click(box.center().toPoint())
    assert desk.view.measurements == two[:1]


def test_that_the_line_follows_the_cursor_to_the_second_point(desk, qtbot):
    first, second = seen_points(desk.scene, 2)[0], seen_points(desk.scene, 7)[0]
    desk.do(view_commands.choose_tool, Tool.MEASURE)
    desk.click(on_screen(desk.scene, first))
    told = []
    desk.scene.hovered.connect(told.append)
    hover(
        qtbot,
        desk.scene.canvas,
        lambda: on_screen(desk.scene, second),
        lambda: told[-1:] == [second],
    )
    QApplication.processEvents()
    (mark,) = desk.scene.overlay.marks
    distance = np.linalg.norm(CLOUD.xyz[second] - CLOUD.xyz[first])
    assert mark.lines[0] == f"{distance:.3f} m"


def test_that_escape_gives_up_the_point_then_the_tool_then_goes_up():
    document = Document(scans=(Scan("plant.laz", CLOUD, RESULT),), view=STILL)
    document = selection_commands.select_point(
        document, int(np.flatnonzero(RESULT.element_id == 2)[0])
    )
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


# Clipping

BOX = ClipBox((0.4, 0.2, 0.2), (2.4, 1.8, 1.2))


def pixel_of(desk, handle):
    pixels, _ = desk.scene.canvas.projection().to_screen(clipping.handles(desk.view.clip_box))
    return QPoint(*np.rint(pixels[handle]).astype(int).tolist())


def clip(desk, box=BOX):
    desk.do(view_commands.set_clip_box, box)
    settle(desk.qtbot, desk.scene)


@pytest.mark.parametrize("face", range(6))
def test_that_a_dragged_face_follows_the_mouse_and_no_other_moves(desk, face):
    clip(desk)
    axis, side = divmod(face, 2)
    start = pixel_of(desk, face)
    ends = np.array([BOX.low, BOX.high])
    wanted = clipping.handles(BOX)[face]
    wanted[axis] += (0.2, -0.2)[side]
    pixels, _ = desk.scene.canvas.projection().to_screen(wanted)
    before = desk.scene.canvas.pose
    drag(desk.qtbot, desk.scene, LEFT, start, QPoint(*np.rint(pixels[0]).astype(int).tolist()))
    box = desk.view.clip_box
    ends[side, axis] += (0.2, -0.2)[side]
    assert np.array([box.low, box.high]) == pytest.approx(ends, abs=0.02)
    assert desk.scene.canvas.pose.position == pytest.approx(before.position)
    settle(desk.qtbot, desk.scene)
    inside = np.all((CLOUD.xyz >= box.low) & (CLOUD.xyz <= box.high), axis=1)
    assert len(desk.scene.points) == inside.sum()


def test_that_the_middle_handle_moves_the_box_in_the_picture(desk, qtbot):
    clip(desk)
    start = pixel_of(desk, clipping.MIDDLE)
    drag(qtbot, desk.scene, LEFT, start, start + QPoint(40, -30))
    box = desk.view.clip_box
    size = np.subtract(box.high, box.low)
    assert size == pytest.approx(np.subtract(BOX.high, BOX.low))
    assert (pixel_of(desk, clipping.MIDDLE) - start - QPoint(40, -30)).manhattanLength() <= 3


def test_that_while_a_face_is_dragged_points_beyond_the_old_box_come_back(desk, qtbot):
    clip(desk, ClipBox((0.4, 0.2, 0.2), (0.9, 0.8, 0.8)))
    start = pixel_of(desk, 1)
    qtbot.mousePress(desk.scene.canvas, LEFT, pos=start)
    for i in range(1, 6):
        event = mouse_move((start + QPoint(12 * i, 0)).toPointF(), LEFT, NO_KEYS)
        QApplication.sendEvent(desk.scene.canvas, event)
    QApplication.processEvents()
    few = picture(desk.scene)
    qtbot.mouseRelease(desk.scene.canvas, LEFT, pos=start + QPoint(60, 0))
    settle(qtbot, desk.scene)
    assert desk.view.clip_box.high[0] > 1.0
    # What was seen during the drag is what is seen after it.
    assert np.abs(picture(desk.scene) - few).max(axis=2).mean() < 6


def test_that_an_inverted_box_shows_what_is_outside_of_it(desk):
    clip(desk)
    inside = np.all((CLOUD.xyz >= BOX.low) & (CLOUD.xyz <= BOX.high), axis=1)
    desk.do(view_commands.invert_clip)
    settle(desk.qtbot, desk.scene)
    rows = np.concatenate([s.rows for s in desk.scene.points.slices])
    assert np.array_equal(np.sort(rows), np.flatnonzero(~inside))
    desk.do(view_commands.invert_clip)
    assert desk.view.clip_box == BOX


def test_that_an_inverted_box_stays_so_while_it_is_dragged_and_shows_the_same_then(desk, qtbot):
    clip(desk)
    desk.do(view_commands.invert_clip)
    settle(desk.qtbot, desk.scene)
    start = pixel_of(desk, 1)
    qtbot.mousePress(desk.scene.canvas, LEFT, pos=start)
    for i in range(1, 6):
        event = mouse_move((start + QPoint(-8 * i, 0)).toPointF(), LEFT, NO_KEYS)
        QApplication.sendEvent(desk.scene.canvas, event)
    QApplication.processEvents()
    few = picture(desk.scene)
    qtbot.mouseRelease(desk.scene.canvas, LEFT, pos=start + QPoint(-40, 0))
    settle(qtbot, desk.scene)
    assert desk.view.clip_box.is_inverted
    assert desk.view.clip_box.high[0] < BOX.high[0] - 0.05
    assert np.abs(picture(desk.scene) - few).max(axis=2).mean() < 6


def test_that_axes_and_labels_follow_an_inverted_box(desk):
    desk.do(lambda d: view_commands.set_view(d, show_labels=True, show_points=False))
    settle_without_points(desk)
    both = picture(desk.scene)
    peak = RESULT.deformation(1).peak
    box = ClipBox(tuple((peak - 0.3).tolist()), tuple((peak + 0.3).tolist()))
    drawn = []
    for is_inverted in (False, True):
        desk.do(view_commands.set_clip_box, replace(box, is_inverted=is_inverted))
        settle_without_points(desk)
        drawn.append([label.deformation_id for label in desk.scene.overlay.labels])
        hidden = np.abs(picture(desk.scene) - both).max(axis=2) > 60
        assert hidden.any()
    assert sorted(drawn[0] + drawn[1]) == [1, 2, 3, 4]
    assert drawn[0] == [1]


def settle_without_points(desk):
    desk.qtbot.waitUntil(lambda: not desk.scene.canvas.is_moving)
    with desk.qtbot.waitSignal(desk.scene.canvas.drawn):
        desk.scene.canvas.draw()


def test_that_a_box_around_everything_is_made_smaller_to_be_inverted():
    document = Document(scans=(Scan("plant.laz", CLOUD, RESULT),), view=STILL)
    assert view_commands.invert_clip(document) is document
    whole = view_commands.clip_to_scan(document)
    box = view_commands.invert_clip(whole).view.clip_box
    inside = np.all((CLOUD.xyz >= box.low) & (CLOUD.xyz <= box.high), axis=1)
    assert box.is_inverted
    assert not inside.all()
    # What is selected is what is in the way.
    index = int(np.flatnonzero(RESULT.element_id == 7)[0])
    chosen = selection_commands.select_point(whole, index)
    around = view_commands.clip_to_selection(chosen).view.clip_box
    assert view_commands.invert_clip(chosen).view.clip_box == replace(around, is_inverted=True)


def test_that_overlays_are_clipped_with_the_points(desk):
    desk.do(lambda d: view_commands.set_view(d, show_labels=True))
    assert len(desk.scene.overlay.labels) == 4
    peak = RESULT.deformation(1).peak
    clip(desk, ClipBox(tuple((peak - 0.2).tolist()), tuple((peak + 0.2).tolist())))
    assert [label.deformation_id for label in desk.scene.overlay.labels] == [1]
    outside = picture(desk.scene)[:60, 300:]
    assert np.ptp(outside[..., 0]) < 40


def test_that_the_box_can_hold_the_selection_or_the_scan():
    document = Document(scans=(Scan("plant.laz", CLOUD, RESULT),), view=STILL)
    whole = view_commands.switch_clip(document).view.clip_box
    assert np.array(whole.low) == pytest.approx(CLOUD.xyz.min(axis=0))
    document = selection_commands.select_point(
        document, int(np.flatnonzero(RESULT.element_id == 7)[0])
    )
    box = view_commands.clip_to_selection(document).view.clip_box
    points = CLOUD.xyz[RESULT.element_id == 7]
    assert (points >= box.low).all()
    assert (points <= box.high).all()
    assert np.subtract(box.high, box.low).max() < np.ptp(points, axis=0).max() + 0.3
    assert view_commands.switch_clip(view_commands.switch_clip(document)).view.clip_box is None


def test_that_a_box_never_vanishes():
    document = Document(scans=(Scan("plant.laz", CLOUD),))
    box = view_commands.set_clip_box(
        document, ClipBox((1.0, 5.0, 0.0), (1.0, 2.0, 3.0))
    ).view.clip_box
    assert box.low == (1.0, 2.0, 0.0)
    assert box.high == pytest.approx((1.01, 5.0, 3.0))


def test_that_one_profile_is_drawn_in_colour_over_dimmed_points(desk):
    def n_coloured():
        settle(desk.qtbot, desk.scene)
        colours = picture(desk.scene)[:400]
        return (np.ptp(colours, axis=2) > 60).sum()

    plain = replace(STILL, colour_by=ColourBy.PROFILE, shown_stack=1, show_axes=False)
    desk.do(lambda d: replace(d, view=replace(plain, shown_profile=10_000)))
    before = n_coloured()
    desk.do(lambda d: replace(d, view=replace(plain, shown_profile=60)))
    assert n_coloured() > before + 100
