"""Copying and saving plots: by keys, by menu, as pictures, drawings and numbers."""

import csv
import io
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtGui import QGuiApplication, QImage

from pipegui.model.document import ProfileKey, Selection
from pipegui.plots.chart import SAVED_AS
from pipegui.plots.deviation_map_view import DeviationMapView
from pipegui.plots.export import to_csv, to_tsv
from pipegui.plots.radius_plot import RadiusPlot
from pipegui.plots.section_view import SectionView
from tests.gui.test_plot_widgets import RESULT, shown, states

CTRL, SHIFT = Qt.KeyboardModifier.ControlModifier, Qt.KeyboardModifier.ShiftModifier
PLOTS = {
    "radius_plot": (RadiusPlot, Selection(1, 2)),
    "section": (SectionView, Selection(1, 2, 0, ProfileKey(0, 20))),
    "map": (DeviationMapView, Selection(1, 2)),
}


@pytest.fixture(params=PLOTS)
def plot(request, qtbot, no_leaks):
    kind, selection = PLOTS[request.param]
    plot = shown(qtbot, kind(), getattr(states(selection), request.param))
    with qtbot.waitActive(plot):  # without it keys do not reach the shortcuts
        plot.activateWindow()
    return plot


def rows_of(text, delimiter):
    return list(csv.DictReader(io.StringIO(text), delimiter=delimiter))


def test_that_ctrl_c_copies_plain_numbers_with_a_header(plot, qtbot):
    plot.setFocus()
    qtbot.keyClick(plot, Qt.Key.Key_C, CTRL)
    rows = rows_of(QGuiApplication.clipboard().text(), "\t")
    assert len(rows) > 20
    for title, value in rows[10].items():
        if title not in ("element", "clock") and value:
            float(value)


def test_that_ctrl_shift_c_copies_the_picture(plot, qtbot):
    plot.setFocus()
    qtbot.keyClick(plot, Qt.Key.Key_C, CTRL | SHIFT)
    image = QGuiApplication.clipboard().image()
    assert image.width() == 2 * plot.canvas.width()
    assert image.height() > 2 * plot.canvas.height()  # the heading is above


def test_that_every_entry_to_save_names_its_kind_of_file(plot, qtbot):
    for ending, text in SAVED_AS.items():
        action = next(a for a in plot.menu.actions() if a.text() == text)
        with qtbot.waitSignal(plot.save_requested) as asked:
            action.trigger()
        assert asked.args == [ending]


def test_that_a_right_click_opens_the_menu(plot, qtbot):
    position = plot.canvas.viewport().rect().center()
    qtbot.mouseClick(plot.canvas.viewport(), Qt.MouseButton.RightButton, pos=position)
    qtbot.waitUntil(plot.menu.isVisible)
    plot.menu.close()


def test_that_the_picture_holds_what_is_plotted(plot, qtbot):
    image = QImage.fromData(plot.as_file("png"), "PNG")
    colours = {image.pixelColor(x, y).name() for x in range(0, 400, 3) for y in range(0, 700, 3)}
    assert len(colours) > 10


def test_that_the_drawing_is_made_of_lines_and_letters(plot, qtbot):
    root = ET.fromstring(plot.as_file("svg"))
    tags = [element.tag.rsplit("}")[-1] for element in root.iter()]
    assert tags.count("text") > 5
    if not isinstance(plot, DeviationMapView):  # whose cells are a picture
        assert tags.count("path") + tags.count("polyline") > 50
        assert "image" not in tags


def test_that_the_radius_numbers_are_those_of_the_profiles(qtbot):
    plot = shown(qtbot, RadiusPlot(), states(Selection(1, 2)).radius_plot)
    rows = rows_of(plot.as_file("csv").decode(), ",")
    profiles = RESULT.profiles.of_element(2, 0)
    assert [int(r["profile_index"]) for r in rows] == profiles.profile_index.tolist()
    found = [float(r["semi_minor_mm"]) for r in rows]
    assert found == pytest.approx(1000 * profiles.semi_minor, abs=1e-3)


def test_that_the_section_numbers_put_the_points_where_they_are(qtbot):
    key = ProfileKey(0, 20)
    state = states(Selection(1, 2, 0, key)).section
    plot = shown(qtbot, SectionView(), state)
    rows = rows_of(plot.as_file("csv").decode(), ",")
    assert len(rows) == len(state.section.points_uv)
    right, up, clock, off, curve = (
        np.array([float(r[name] or "nan") for r in rows])
        for name in ("right_mm", "up_mm", "clock_deg", "deviation_mm", "curve_radius_mm")
    )
    radius = np.hypot(right, up)
    assert np.mod(np.rad2deg(np.arctan2(right, up)), 360) == pytest.approx(clock, abs=0.02)
    assert radius - 1000 * state.section.reference.semi_minor == pytest.approx(off, abs=0.01)
    assert np.nanstd(radius - curve) < np.std(off) + 0.1


def test_that_the_map_numbers_leave_out_what_was_not_scanned(qtbot):
    plot = shown(qtbot, DeviationMapView(), states(Selection(1, 2)).map)
    rows = rows_of(plot.as_file("csv").decode(), ",")
    assert sum(int(r["n_points"]) for r in rows) == (RESULT.element_id == 2).sum()
    deepest = min(rows, key=lambda r: float(r["deviation_mm"]))
    assert float(deepest["chainage_m"]) == pytest.approx(RESULT.deformation(1).chainage, abs=0.05)


def test_that_a_table_is_written_with_its_header():
    table = {"a": ["1", "2"], "b, c": ["x", ""]}
    assert to_tsv(table) == "a\tb, c\n1\tx\n2\t\n"
    assert to_csv(table) == 'a,"b, c"\n1,x\n2,\n'
