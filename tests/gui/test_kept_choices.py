"""Plots and table look as they were left when the program is started again."""

from pathlib import Path

import pytest
from PySide6.QtCore import QSettings, Qt
from PySide6.QtWidgets import QTabWidget

from pipegui.controllers.remembered_choices import remember_choices, remember_tab
from pipegui.panels.deformation_table import DeformationTable
from pipegui.plots.deviation_map_view import DeviationMapView
from pipegui.plots.preview_view import PreviewView
from pipegui.plots.radius_plot import AT_FIRST, RadiusPlot
from pipegui.plots.section_view import SectionView
from pipegui.states.view_state import TableState
from pipegui.window.views import Views
from tests.factories import make_result
from tests.gui.fakes import FakeScene


@pytest.fixture
def stored(tmp_path):
    return QSettings(str(tmp_path / "window.ini"), QSettings.Format.IniFormat)


@pytest.fixture
def start_again(make_app, qtbot):
    """Close the window, if there is one, and return a new one with the real plots."""
    apps = []

    def start():
        while apps:
            old = apps.pop()
            old.controllers.project.discard_changes()
            old.window.close()
            old.session.stored.sync()
        views = Views(FakeScene(), RadiusPlot(), SectionView(), DeviationMapView(), PreviewView())
        apps.append(make_app(views=views))
        apps[0].controllers.scans.open_files([Path("plant.laz")])
        qtbot.waitUntil(lambda: apps[0].session.document.scan is not None)
        apps[0].controllers.scans.detect()
        qtbot.waitUntil(lambda: apps[0].session.document.result is not None)
        return apps[0]

    return start


def test_that_plots_are_as_they_were_left(start_again):
    app = start_again()
    radius, section = app.window.views.radius_plot, app.window.views.section
    radius.shown_menu.series["free_radius"].trigger()
    radius.shown_menu.series["ovality"].trigger()
    radius.x_axis.setCurrentIndex(1)
    section.layer_menu.series["nominal"].trigger()
    section.factor.setValue(7)
    app.window.panels.plots.setCurrentWidget(section)

    app = start_again()
    radius, section = app.window.views.radius_plot, app.window.views.section
    assert set(radius.shown_menu.shown) == AT_FIRST - {"ovality"} | {"free_radius"}
    assert not radius.ovality.isVisible()
    assert radius.x_axis.currentText() == "Chainage"
    assert radius.radius.getAxis("bottom").labelText != "Profile index"
    assert section.layer_menu.shows("nominal")
    assert (section.factor.value(), section.factor_text.text()) == (7, "7×")
    assert app.window.panels.plots.currentWidget() is section


def test_that_filters_and_columns_are_as_they_were_left(start_again, qtbot):
    table = start_again().window.panels.table
    qtbot.keyClicks(table.filters.kind, "dent")
    table.filters.min_depth.setValue(10.0)
    table.columns.actions["area_cm2"].trigger()
    shown = table.filters.counts.text(), table.columns.shown

    table = start_again().window.panels.table
    assert table.filters.kind.currentText() == "dent"
    assert table.filters.min_depth.value() == 10.0
    assert table.proxy.rowCount() == 1
    assert (table.filters.counts.text(), table.columns.shown) == shown


def test_that_one_click_shows_everything_again(qtbot, no_leaks):
    table = DeformationTable()
    qtbot.addWidget(table)
    table.resize(1200, 300)
    table.show()
    table.apply(TableState(make_result(), 1))
    filters = table.filters
    assert not filters.everything.isVisible()
    qtbot.keyClicks(filters.verdict, "reject")
    filters.min_depth.setValue(3.0)
    assert table.proxy.rowCount() == 1
    qtbot.mouseClick(filters.everything, Qt.MouseButton.LeftButton)
    assert table.proxy.rowCount() == 4
    assert not filters.everything.isVisible()


@pytest.mark.parametrize(
    "text",
    [
        "not JSON",
        "[]",
        '{"shown": 3, "against": ["Chainage"], "exaggeration": "x", "columns": {"a": 1}}',
        '{"kind": "crack", "verdict": 5, "min_depth_mm": null, "shown": ["no such series"]}',
    ],
)
def test_that_choices_of_another_version_do_no_harm(qtbot, no_leaks, stored, text):
    parts = {"radius": RadiusPlot(), "section": SectionView(), "table": DeformationTable()}
    for part in parts.values():
        qtbot.addWidget(part)
    table = parts.pop("table")
    choosers = parts | {"columns": table.columns, "filters": table.filters}
    for name in choosers:
        stored.setValue(f"choices/{name}", text)
    remember_choices(stored, choosers)
    assert parts["radius"].x_axis.currentIndex() == 0
    assert parts["section"].factor.value() == 1
    assert table.filters.choices() == {
        "kind": "",
        "verdict": "",
        "review": "",
        "min_depth_mm": 0.0,
    }


def test_that_a_tab_of_another_version_does_no_harm(qtbot, stored):
    tabs = QTabWidget()
    qtbot.addWidget(tabs)
    tabs.setObjectName("plots")
    stored.setValue("choices/plots", "left")
    remember_tab(stored, tabs)
    stored.setValue("choices/plots", 17)
    remember_tab(stored, tabs)
    assert tabs.currentIndex() == -1
