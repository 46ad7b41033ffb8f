"""Stations in the window: coloured, listed, hidden and marked."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import QPoint, Qt

from pipecore.io import read
from pipegui.model import commands
from pipegui.model.document import ColourBy, Document, Scan, ViewOptions
from pipegui.model.stations import stations_of
from pipegui.panels.project_tree import NodeKind
from pipegui.scene.colouring import colour_points, visible_points
from pipegui.scene.legend import make_legend
from pipegui.scene.view import SceneView
from pipegui.states.hover_texts import hover_text
from pipegui.states.view_state import SceneState
from pipegui.style.colour_maps import station_colour
from pipegui.window.views import make_views
from tests.core.io.cases import pipe, ptx
from tests.factories import make_cloud
from tests.gui.patience import hover, wait_until_still

NAME, HIDDEN = 0, Qt.CheckState.Unchecked


def with_stations(n_stations: int = 3, names: tuple[str, ...] = ()):
    """The plant, scanned from stations in a row, of which the last has no known position."""
    cloud = make_cloud()
    ids = 1 + np.arange(len(cloud)) % n_stations
    places = cloud.xyz.mean(axis=0) + np.arange(n_stations)[:, None] * [0.3, 0.0, 0.0]
    places[-1] = np.nan
    return replace(
        cloud,
        station=ids.astype(np.uint16),
        station_names=names or tuple(f"site.e57: {i}" for i in range(1, n_stations + 1)),
        stations=places,
    )


CLOUD = with_stations()


def branch_of(tree):
    scan = tree.model.index(0, NAME)
    below = [tree.model.index(i, NAME, scan) for i in range(tree.model.rowCount(scan))]
    return next(i for i in below if tree.model.what(i)[1] is NodeKind.STATIONS)


@pytest.fixture
def opened(make_app, qtbot):
    app = make_app(read=lambda *_: CLOUD)
    app.controllers.scans.open_files([Path("plant.laz")])
    qtbot.waitUntil(lambda: app.session.document.scan is not None)
    return app


def test_that_each_station_has_its_name_its_points_and_its_place():
    first, second, third = stations_of(CLOUD)
    assert (first.name, second.name, third.name) == ("1", "2", "3")
    assert first.n_points + second.n_points + third.n_points == len(CLOUD)
    assert first.position is not None
    assert third.position is None


def test_that_names_of_several_files_are_whole():
    cloud = with_stations(2, ("north.laz", "south.laz"))
    assert [s.name for s in stations_of(cloud)] == ["north.laz", "south.laz"]


def test_that_points_have_the_colour_of_their_station_and_the_legend_says_so():
    view = ViewOptions(colour_by=ColourBy.STATION)
    colours = colour_points(CLOUD, None, view)
    assert (colours[CLOUD.station == 2] == station_colour(2)).all()
    assert len(np.unique(colours, axis=0)) == 3
    legend = make_legend(CLOUD, None, view)
    assert [colour for colour, _ in legend.swatches] == [station_colour(i) for i in (1, 2, 3)]
    assert legend.swatches[0][1].startswith("Station 1 · ")


def test_that_a_legend_of_many_stations_says_how_many_it_leaves_out():
    legend = make_legend(with_stations(50), None, ViewOptions(colour_by=ColourBy.STATION))
    assert len(legend.swatches) == 12
    assert legend.swatches[-1][1] == "and 39 more"


def test_that_one_station_is_no_colouring():
    one = replace(CLOUD, station_names=("a",), station=np.ones(len(CLOUD), np.uint16))
    assert ColourBy.STATION not in commands.colours_of(Scan("a", one))
    assert ColourBy.STATION in commands.colours_of(Scan("a", CLOUD))


def test_that_the_menu_colours_by_station_where_there_are_several(app, opened, qtbot):
    assert not app.window.actions_["colour_by_station"].isEnabled()
    opened.window.actions_["colour_by_station"].trigger()
    assert opened.session.document.view.colour_by is ColourBy.STATION


def test_that_points_of_a_hidden_station_are_not_visible():
    visible = visible_points(CLOUD, None, frozenset(), hidden_stations=frozenset({2, 99}))
    assert (visible == (CLOUD.station != 2)).all()


def test_that_another_scan_shows_all_of_its_stations():
    document = Document((Scan("a", CLOUD), Scan("b", CLOUD)))
    document = commands.set_stations_hidden(document, [1], hidden=True)
    assert not commands.activate_scan(document, 1).view.hidden_stations


def test_that_the_tree_lists_stations_and_its_boxes_hide_them_undoably(opened, qtbot):
    tree, session = opened.window.panels.tree, opened.session
    branch = branch_of(tree)
    assert branch.data() == "Stations (3)"
    first = tree.model.index(0, NAME, branch)
    assert first.data().startswith("Station 1 · ")
    box = tree.view.visualRect(first)
    # The box stands at the left end of the row.
    qtbot.mouseClick(
        tree.view.viewport(),
        Qt.MouseButton.LeftButton,
        pos=QPoint(box.left() + 10, box.center().y()),
    )
    assert session.document.view.hidden_stations == {1}
    assert branch.data(Qt.ItemDataRole.CheckStateRole) == Qt.CheckState.PartiallyChecked
    qtbot.keyClick(opened.window, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    assert not session.document.view.hidden_stations
    tree.model.setData(branch, HIDDEN, Qt.ItemDataRole.CheckStateRole)
    assert session.document.view.hidden_stations == {1, 2, 3}
    opened.window.actions_["show_all"].trigger()
    assert not session.document.view.hidden_stations


def test_that_a_ptx_is_coloured_and_its_scanners_are_marked_and_named(make_app, qtbot, tmp_path):
    xyz = pipe(2000)
    first = ptx(tmp_path / "a.ptx", xyz[:1000]).read_text()
    moved = first.replace("10 20 3\n", "10 19 3\n").replace("10 20 3 1\n", "10 19 3 1\n")
    (tmp_path / "two.ptx").write_text(first + moved)
    app = make_app(read=lambda path, *_: read(path), views=make_views())
    app.controllers.scans.open_files([tmp_path / "two.ptx"])
    qtbot.waitUntil(lambda: app.session.document.scan is not None)
    app.session.do(commands.set_colour, ColourBy.STATION)
    scene = app.window.views.scene
    wait_until_still(qtbot, scene.screenshot)
    assert scene.overlay.legend.title == "Station"
    texts: list[str] = []
    app.controllers.hovering.description_changed.connect(texts.append)

    def head():
        place = scene.canvas.projection().to_screen(scene.overlay.stations[0].position[None])[0]
        return QPoint(*np.round(place[0]).astype(int).tolist())

    hover(qtbot, scene.canvas, head, lambda: any("scan 1" in text for text in texts))
    name, points, *place = next(t for t in texts if "scan 1" in t).split("\n")
    assert (name, points) == ("scan 1", "1,000 points")
    assert [line.split()[0] for line in place] == ["X", "Y", "Z"]
    app.window.actions_["show_stations"].setChecked(False)
    assert scene.overlay.stations == ()


def test_that_a_hidden_station_has_no_points_and_no_mark_in_the_picture(qtbot):
    scene = SceneView()
    qtbot.addWidget(scene, before_close_func=lambda view: view.close())
    scene.resize(420, 320)
    scene.show()
    qtbot.waitExposed(scene)
    view = ViewOptions(colour_by=ColourBy.STATION, hidden_stations=frozenset({1, 3}))
    scene.apply(SceneState("a", CLOUD, None, view=view))
    assert len(scene.points) == (CLOUD.station == 2).sum()
    assert [mark.station_id for mark in scene.overlay.stations] == [2]


def test_that_a_point_under_the_cursor_is_told_its_station():
    index = int(np.flatnonzero(CLOUD.station == 2)[0])
    assert hover_text(Scan("a", CLOUD), index) == "Station 2"
    assert hover_text(Scan("a", make_cloud()), index) == ""
