"""What the 3D view does with clouds too large to do all of it at once."""

from dataclasses import replace

import numpy as np
import pytest

from pipegui.model.document import ClipBox, ColourBy
from pipegui.scene import layers
from pipegui.scene.colouring import points_in
from pipegui.scene.point_layer import PointLayer
from pipegui.scene.view import SceneView
from tests.factories import make_scan
from tests.gui.test_scene_view import STILL, scene_state, settle

CLOUD, RESULT = make_scan(60_000)
BOX = ClipBox((0.4, 0.2, 0.2), (2.4, 1.8, 1.2))


@pytest.fixture
def large(qtbot, no_leaks, monkeypatch):
    """A view to which 60,000 points are many."""
    monkeypatch.setattr(layers, "AT_ONCE", 5_000)
    view = SceneView()
    qtbot.addWidget(view)
    view.resize(640, 480)
    with qtbot.waitExposed(view):
        view.show()
    show(view)
    settle(qtbot, view)
    yield view
    view.close()


def show(view, **options):
    view.apply(scene_state(cloud=CLOUD, result=RESULT, view=replace(STILL, **options)))


def rows_of(layer: PointLayer):
    return np.sort(np.concatenate([part.rows for part in layer.slices]))


@pytest.mark.parametrize("box", [BOX, replace(BOX, is_inverted=True)])
def test_that_a_part_of_the_points_is_clipped_at_once_and_all_soon(large, qtbot, box):
    inside = np.flatnonzero(points_in(box, CLOUD.xyz))
    show(large, clip_box=box)
    # Before anything else has had its turn: few, but none that should not be seen.
    assert 0 < len(large.points) < 5_000
    assert np.isin(rows_of(large.points), inside).all()
    qtbot.waitUntil(lambda: len(large.points) == len(inside))
    settle(qtbot, large)
    assert np.isin(rows_of(large.points), inside).all()


def test_that_hidden_elements_of_a_large_cloud_are_never_seen(large, qtbot):
    hidden = np.flatnonzero(RESULT.element_id == 2)
    show(large, hidden_elements=frozenset({2}))
    assert not np.isin(rows_of(large.points), hidden).any()
    n_seen = len(CLOUD) - len(hidden)
    qtbot.waitUntil(lambda: len(large.points) == n_seen)
    assert not np.isin(rows_of(large.points), hidden).any()


def test_that_only_the_last_of_many_boxes_counts(large, qtbot):
    for step in range(8):
        show(large, clip_box=replace(BOX, high=(0.6 + 0.2 * step, 1.8, 1.2)))
    show(large)
    assert len(large.points) == len(CLOUD)
    qtbot.wait(300)
    assert len(large.points) == len(CLOUD)


def test_that_points_take_their_new_colour_when_they_are_drawn(large, qtbot, monkeypatch):
    n_coloured = []
    colour = large.layers.colour_rows

    def count(rows):
        n_coloured.append(len(rows))
        return colour(rows)

    monkeypatch.setattr(large.layers, "colour_rows", count)
    show(large, colour_by=ColourBy.HEIGHT)
    assert n_coloured == []  # nothing has been drawn yet
    assert large.canvas.is_moving
    settle(qtbot, large)
    assert sum(n_coloured) == large.points.n_shown
    for part in large.points.slices:
        assert part.is_coloured
        assert np.array_equal(part.colours, colour(part.rows))


def test_that_moving_a_face_of_the_box_uploads_no_point_again(large, qtbot):
    large.layers.begin_preview(BOX)
    with qtbot.waitSignal(large.canvas.drawn):
        large.canvas.move_to(large.canvas.pose)
    mapper = large.layers.preview.slices[0].actor.GetMapper()
    before = mapper.GetMTime()
    large.layers.preview.clip(replace(BOX, high=(1.4, 1.8, 1.2)))
    assert mapper.GetMTime() == before
    planes = mapper.GetClippingPlanes()
    assert planes.GetItem(3).GetOrigin()[0] == 1.4
