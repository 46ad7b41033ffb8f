"""The 3D view in a real window with a real mouse."""

from dataclasses import replace

import numpy as np
import pytest
from PySide6.QtCore import QPoint, QPointF, Qt
from PySide6.QtGui import QWheelEvent
from PySide6.QtWidgets import QApplication

from pipecore.types import PointCloud
from pipegui.model.document import (
    Background,
    ClipBox,
    ColourBy,
    Document,
    Scan,
    Selection,
    ViewOptions,
)
from pipegui.scene import pose as poses
from pipegui.scene.canvas import SETTLED_SECONDS
from pipegui.scene.shapes import ellipses
from pipegui.scene.view import SceneView
from pipegui.states.view_state import resolve
from tests.factories import make_scan
from tests.gui.patience import PATIENCE, hover

CLOUD, RESULT = make_scan()
STILL = ViewOptions(fly=False, colour_by=ColourBy.SEGMENT, show_labels=False)
LEFT = Qt.MouseButton.LeftButton


def scene_state(selection=Selection(), view=STILL, result=RESULT, cloud=CLOUD):  # noqa: B008
    scan = Scan("plant.laz", cloud, result)
    return resolve(Document(scans=(scan,), selection=selection, view=view)).scene


@pytest.fixture
def scene(qtbot, no_leaks):
    view = SceneView()
    qtbot.addWidget(view)
    view.resize(640, 480)
    with qtbot.waitExposed(view):
        view.show()
    view.apply(scene_state())
    settle(qtbot, view)
    yield view
    view.close()


def settle(qtbot, view):
    """Wait until the camera rests and the picture is drawn in full."""
    canvas = view.canvas
    qtbot.waitUntil(
        lambda: not canvas.is_moving and not canvas.is_stale and view.points.n_shown > 0
    )


def on_screen(view, index):
    pixels, _ = view.canvas.projection().to_screen(CLOUD.xyz[index].astype(float))
    return QPoint(round(pixels[0, 0]), round(pixels[0, 1]))


def picture(view) -> np.ndarray:
    image = view.screenshot().convertToFormat(view.screenshot().Format.Format_RGB888)
    rows = np.frombuffer(image.constBits(), np.uint8).reshape(image.height(), -1)
    return rows[:, : 3 * image.width()].reshape(image.height(), image.width(), 3).astype(int)


def seen_points(view, element_id, n=5):
    """Points of an element that nothing hides and that are nearest to the pixel they are in."""
    projection = view.canvas.projection()
    pixels, depth = projection.to_screen(CLOUD.xyz.astype(float))
    found = []
    for index in np.flatnonzero(RESULT.element_id == element_id):
        away = np.linalg.norm(pixels - np.rint(pixels[index]), axis=1)
        front = depth[away < 8].min()
        is_hidden = depth[index] - front > 4 * projection.pixel_size(front)
        if not is_hidden and np.argmin(away) == index:
            found.append(int(index))
        if len(found) == n:
            break
    return found


def test_that_the_cloud_fills_the_view_after_opening(scene):
    colours = picture(scene)
    background = np.abs(colours - colours[2, 2]).max(axis=2) < 25
    rows, columns = np.nonzero(~background)
    assert np.ptp(rows) > 200
    assert np.ptp(columns) > 250


@pytest.mark.parametrize("element_id", [2, 4, 7])
def test_that_a_click_picks_the_very_point_under_it(scene, qtbot, element_id):
    points = seen_points(scene, element_id)
    assert len(points) == 5
    for index in points:
        with qtbot.waitSignal(scene.picked) as picked:
            qtbot.mouseClick(scene.canvas, LEFT, pos=on_screen(scene, index))
        assert picked.args == [index]


def test_that_a_click_beside_everything_picks_nothing(scene, qtbot):
    with qtbot.waitSignal(scene.picked) as picked:
        qtbot.mouseClick(scene.canvas, LEFT, pos=QPoint(4, 4))
    assert picked.args == [-1]


def test_that_points_of_hidden_elements_are_neither_drawn_nor_picked(scene, qtbot):
    (index, *_) = seen_points(scene, 2)
    n_before = len(scene.points)
    position = on_screen(scene, index)
    scene.apply(scene_state(view=replace(STILL, hidden_elements=frozenset({2}))))
    settle(qtbot, scene)
    assert len(scene.points) == n_before - (RESULT.element_id == 2).sum()
    with qtbot.waitSignal(scene.picked) as picked:
        qtbot.mouseClick(scene.canvas, LEFT, pos=position)
    assert picked.args[0] != index
    assert picked.args[0] < 0 or RESULT.element_id[picked.args[0]] != 2


def test_that_a_drag_orbits_and_does_not_pick(scene, qtbot):
    before = scene.view_direction()
    with qtbot.assertNotEmitted(scene.picked):
        drag(qtbot, scene, LEFT, QPoint(320, 240), QPoint(420, 240))
    after = scene.view_direction()
    assert np.degrees(np.arccos(before @ after)) > 10
    assert after[2] == pytest.approx(before[2])


def test_that_a_middle_drag_pans_the_point_along_with_the_mouse(scene, qtbot):
    (index, *_) = seen_points(scene, 4)
    start, way = on_screen(scene, index), QPoint(60, 40)
    direction = scene.view_direction()
    drag(qtbot, scene, Qt.MouseButton.MiddleButton, start, start + way)
    moved = on_screen(scene, index) - start
    assert (moved - way).manhattanLength() <= 6
    assert scene.view_direction() == pytest.approx(direction)


def drag(qtbot, view, button, start, end, steps=5):
    qtbot.mousePress(view.canvas, button, pos=start)
    for i in range(1, steps + 1):
        at = QPointF(start + (end - start) * i / steps)
        move = Qt.KeyboardModifier.NoModifier
        event = mouse_move(at, button, move)
        QApplication.sendEvent(view.canvas, event)
    qtbot.mouseRelease(view.canvas, button, pos=end)


def mouse_move(at, buttons, modifiers):
    from PySide6.QtCore import QEvent
    from PySide6.QtGui import QMouseEvent

    return QMouseEvent(QEvent.Type.MouseMove, at, at, Qt.MouseButton.NoButton, buttons, modifiers)


def test_that_the_wheel_zooms_to_the_cursor(scene):
    (index, *_) = seen_points(scene, 2)
    at, before = on_screen(scene, index), scene.canvas.pose.distance
    event = QWheelEvent(
        QPointF(at),
        QPointF(scene.canvas.mapToGlobal(at)),
        QPoint(),
        QPoint(0, 240),
        Qt.MouseButton.NoButton,
        Qt.KeyboardModifier.NoModifier,
        Qt.ScrollPhase.NoScrollPhase,
        False,
    )
    QApplication.sendEvent(scene.canvas, event)
    assert scene.canvas.pose.distance < 0.8 * before
    assert (on_screen(scene, index) - at).manhattanLength() <= 4


def test_that_fewer_points_are_drawn_while_moving_and_all_at_rest(qtbot, no_leaks):
    cloud, result = make_scan(60_000)
    view = SceneView()
    qtbot.addWidget(view)
    view.resize(320, 240)
    with qtbot.waitExposed(view):
        view.show()
    view.apply(scene_state(cloud=cloud, result=result))
    settle(qtbot, view)
    assert view.points.n_shown == 60_000
    view.points.seconds_per_point = 1e-5  # as on a slow machine
    view.canvas.rest_timer.setInterval(PATIENCE)
    with qtbot.waitSignal(view.canvas.drawn):
        view.set_standard_view("top")
    assert view.points.n_shown < 60_000
    view.canvas.rest_timer.start(0)
    settle(qtbot, view)
    assert view.points.n_shown == 60_000
    view.close()


def test_that_selecting_flies_to_the_element_and_colours_it(scene, qtbot):
    accent = np.array(scene.palette().highlight().color().getRgb()[:3])

    def n_accented():
        return (np.abs(picture(scene) - accent).max(axis=2) < 12).sum()

    assert n_accented() < 50
    before = scene.canvas.pose
    flying = replace(STILL, fly=True)
    scene.apply(scene_state(Selection(1, 6), flying))
    assert scene.canvas.pose.position == pytest.approx(before.position, abs=1e-6)
    qtbot.waitUntil(lambda: scene.canvas.pose.distance < 0.6 * before.distance)
    # Close by, the points of the picture come a moment after the camera has come to rest.
    qtbot.waitUntil(lambda: n_accented() > 2000)


def test_that_it_does_not_fly_where_flying_is_off(scene):
    before = scene.canvas.pose
    scene.apply(scene_state(Selection(1, 6)))
    assert scene.canvas.pose.distance < 0.6 * before.distance


def test_that_a_click_on_a_label_picks_its_deformation(scene, qtbot):
    scene.apply(scene_state(view=replace(STILL, show_labels=True)))
    settle(qtbot, scene)
    scene.screenshot()
    peak = RESULT.deformation(1).peak
    pixels, _ = scene.canvas.projection().to_screen(peak)
    with qtbot.waitSignal(scene.deformation_picked) as picked:
        qtbot.mouseClick(scene.canvas, LEFT, pos=QPoint(*np.rint(pixels[0]).astype(int).tolist()))
    assert picked.args == [1]


def test_that_hovering_tells_the_element_under_the_cursor(scene, qtbot):
    (index, *_) = seen_points(scene, 7)
    told = []
    scene.hovered.connect(told.append)
    hover(qtbot, scene.canvas, lambda: on_screen(scene, index), lambda: told[-1:] == [index])
    assert RESULT.element_id[told[-1]] == 7


def test_that_only_what_differs_is_done_anew(scene, qtbot, monkeypatch):
    counted = []
    for name in ("set_points", "set_colours"):
        monkeypatch.setattr(scene.points, name, lambda *_, name=name: counted.append(name))
    scene.apply(scene_state(Selection(1, 2)))
    scene.apply(scene_state(Selection(1, 3)))
    assert counted == []
    scene.apply(scene_state(Selection(1, 3), replace(STILL, colour_by=ColourBy.HEIGHT)))
    assert counted == ["set_colours"]


def test_that_an_idle_repaint_does_not_draw_the_points_again(scene, qtbot):
    canvas = scene.canvas
    qtbot.waitUntil(
        lambda: (
            canvas.seconds_to_draw == SETTLED_SECONDS
            and not canvas.settle_timer.isActive()
            and not canvas.is_stale
        )
    )
    with qtbot.assertNotEmitted(scene.canvas.drawn):
        scene.overlay.update()
        scene.canvas.update()
        qtbot.wait(100)


def test_that_every_colouring_and_decoration_can_be_shown(scene, qtbot):
    before = picture(scene)
    for colour_by in ColourBy:
        view = ViewOptions(
            colour_by=colour_by,
            shown_stack=1,
            show_ellipses=True,
            show_surfaces=True,
            fly=False,
        )
        scene.apply(scene_state(Selection(1, 2), view))
    settle(qtbot, scene)
    assert np.abs(picture(scene) - before).max() > 50


def test_that_closing_the_scan_empties_the_view(scene, qtbot):
    scene.apply(resolve(Document()).scene)
    assert scene.points.n_shown == 0
    colours = picture(scene)[:, :, 0]
    assert np.ptp(colours[:300, 100:]) < 30


# Ways to look


@pytest.mark.parametrize("name", ["top", "iso", "back"])
def test_that_picking_and_zooming_are_as_exact_without_perspective(scene, qtbot, name):
    scene.apply(scene_state(view=replace(STILL, is_parallel=True)))
    scene.set_standard_view(name)
    settle(qtbot, scene)
    (index, *_) = seen_points(scene, 7)
    at = on_screen(scene, index)
    with qtbot.waitSignal(scene.picked) as picked:
        qtbot.mouseClick(scene.canvas, LEFT, pos=at)
    assert picked.args == [index]
    scene.canvas.move_to(poses.zoom(scene.canvas.pose, 0.5, CLOUD.xyz[index].astype(float)))
    assert (on_screen(scene, index) - at).manhattanLength() <= 2


def test_that_equal_lengths_look_equal_without_perspective(scene, qtbot):
    scene.apply(scene_state(view=replace(STILL, is_parallel=True)))
    settle(qtbot, scene)
    projection, pose = scene.canvas.projection(), scene.canvas.pose
    lengths = []
    for depth in (-1.0, 0.0, 1.0):
        start = pose.focus + depth * pose.forward
        pixels, _ = projection.to_screen(np.stack([start, start + 0.3 * pose.right]))
        lengths.append(np.linalg.norm(pixels[1] - pixels[0]))
    assert lengths == pytest.approx([lengths[0]] * 3)
    assert 0.3 / lengths[0] == pytest.approx(projection.pixel_size(pose.distance))
    # Everything is drawn, also what would lie behind the eye from so near.
    scene.canvas.move_to(replace(pose, distance=0.3))
    settle(qtbot, scene)
    colours = picture(scene)
    assert (np.abs(colours - colours[2, 2]).max(axis=2) > 25).mean() > 0.02


@pytest.mark.parametrize(
    ("background", "brightness"),
    [(Background.WHITE, 255), (Background.BLACK, 0), (Background.LIGHT, 245)],
)
def test_that_the_background_is_as_chosen(scene, qtbot, background, brightness):
    scene.apply(scene_state(view=replace(STILL, background=background)))
    settle(qtbot, scene)
    assert picture(scene)[2, 2] == pytest.approx([brightness] * 3, abs=8)


def test_that_points_are_drawn_larger_where_asked_for(scene, qtbot):
    def n_covered():
        settle(qtbot, scene)
        colours = picture(scene)
        return (np.abs(colours - colours[2, 2]).max(axis=2) > 25).sum()

    usual = n_covered()
    scene.apply(scene_state(view=replace(STILL, point_size=2.2)))
    assert n_covered() > 1.3 * usual


def test_that_edges_are_shaded_only_where_asked_for_on_software(scene, qtbot):
    if not scene.canvas.is_software:
        pytest.skip("there is a graphics card")
    before = picture(scene)
    assert not scene.shades_edges
    scene.apply(scene_state(view=replace(STILL, eye_dome=True)))
    settle(qtbot, scene)
    shaded = picture(scene)
    darker = (before.sum(axis=2) - shaded.sum(axis=2)) > 40
    assert darker.mean() > 0.01
    scene.apply(scene_state(view=replace(STILL, eye_dome=False)))
    settle(qtbot, scene)
    assert np.abs(picture(scene) - before).mean() < 1


def test_that_points_outside_the_clip_box_are_neither_drawn_nor_picked(scene, qtbot):
    (index, *_) = seen_points(scene, 2)
    position = on_screen(scene, index)
    x = float(CLOUD.xyz[index, 0])
    box = ClipBox((x + 0.05, -1.0, -1.0), (5.0, 5.0, 5.0))
    scene.apply(scene_state(view=replace(STILL, clip_box=box)))
    settle(qtbot, scene)
    assert len(scene.points) == (CLOUD.xyz[:, 0] >= x + 0.05).sum()
    with qtbot.waitSignal(scene.picked) as picked:
        qtbot.mouseClick(scene.canvas, LEFT, pos=position)
    assert picked.args[0] != index


# While a scan is read


def test_that_parts_of_a_scan_are_seen_while_it_is_read(qtbot, no_leaks):
    view = SceneView()
    qtbot.addWidget(view)
    view.resize(320, 240)
    with qtbot.waitExposed(view):
        view.show()
    background = picture(view)
    half = len(CLOUD) // 2
    for start in (0, half):
        at = slice(start, start + half)
        view.show_partial_cloud(PointCloud(CLOUD.origin, CLOUD.xyz[at], rgb=CLOUD.rgb[at]))
        with qtbot.waitSignal(view.canvas.drawn):
            view.canvas.draw()
    seen = np.abs(picture(view) - background).max(axis=2) > 25
    assert seen.mean() > 0.03
    pixels, _ = view.canvas.projection().to_screen(CLOUD.xyz.astype(float))
    assert ((pixels > 0) & (pixels < [320, 240])).all(axis=1).mean() > 0.99
    view.hide_partial_cloud()
    view.apply(scene_state())
    settle(qtbot, view)
    assert len(view.partial_cloud) == 0
    assert view.points.n_shown > 0
    view.close()


def test_that_all_points_in_the_picture_are_drawn_once_a_close_view_rests(
    qtbot, no_leaks, monkeypatch
):
    monkeypatch.setattr("pipegui.scene.layers.NO_LIMIT", 30_000)
    cloud, result = make_scan(60_000)
    view = SceneView()
    qtbot.addWidget(view)
    view.resize(640, 480)
    view.points.most = 30_000
    with qtbot.waitExposed(view):
        view.show()
    view.apply(scene_state(cloud=cloud, result=result))
    settle(qtbot, view)
    assert view.points.n_shown < 60_000
    # The whole is in the picture: nothing to be gained there. Then near a pipe:
    index = int(np.flatnonzero(result.element_id == 7)[200])
    close = poses.zoom(view.canvas.pose, 0.25, cloud.xyz[index].astype(float))
    view.canvas.move_to(close)
    qtbot.waitUntil(lambda: view.layers.close_up.n_shown > 0)
    pixels, depth = view.canvas.projection().to_screen(cloud.xyz.astype(float))
    inside = ((pixels >= 0) & (pixels <= [640, 480])).all(axis=1) & (depth > 0)
    assert view.layers.close_up.n_shown == pytest.approx(inside.sum(), abs=3)
    assert view.points.n_shown == 0
    # A point that only the close view draws is picked.
    drawn = {view.points.cloud_index(row) for row in range(len(view.points.parts[0]))}
    front = [i for i in np.flatnonzero(inside) if i not in drawn]
    hits = 0
    for i in front[:200:10]:
        at = QPointF(*pixels[i])
        hits += view.pick(at) in front
    assert hits > 0
    view.canvas.move_to(view.canvas.pose)
    with qtbot.waitSignal(view.canvas.drawn):
        view.canvas.draw()
    assert view.layers.close_up.n_shown == 0
    assert view.points.n_shown > 0
    view.close()


def test_that_the_profile_under_a_plots_cursor_is_ringed(scene, qtbot):
    scene.apply(scene_state(view=replace(STILL, show_points=False, show_axes=False)))
    qtbot.waitUntil(lambda: not scene.canvas.is_moving)
    with qtbot.waitSignal(scene.canvas.drawn):
        scene.canvas.draw()
    before = picture(scene)
    profile = RESULT.profiles.of_element(2)[5:6]
    scene.mark_profile(profile)
    rows, columns = np.nonzero(np.abs(picture(scene) - before).max(axis=2) > 60)
    ring, _ = scene.canvas.projection().to_screen(ellipses(profile)[0])
    assert len(rows) > 20
    low, high = ring.min(axis=0), ring.max(axis=0)
    assert [columns.min(), rows.min()] == pytest.approx(low, abs=5)
    assert [columns.max(), rows.max()] == pytest.approx(high, abs=5)
    scene.mark_profile(None)
    assert np.array_equal(picture(scene), before)
