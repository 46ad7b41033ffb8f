"""The plots in real windows with real clicks and keys."""

import numpy as np
import pytest
from PySide6.QtCore import QEvent, QPoint, QPointF, Qt
from PySide6.QtWidgets import QApplication

from pipegui.model import commands, result_queries, selection_commands
from pipegui.model.document import Document, ProfileKey, Scan, Selection
from pipegui.plots.deviation_map_view import DeviationMapView
from pipegui.plots.radius_plot import RadiusPlot
from pipegui.plots.section_view import SectionView
from pipegui.states.view_state import MapState, RadiusPlotState, SectionState, resolve
from tests.factories import make_scan
from tests.gui.patience import hover

CLOUD, RESULT = make_scan()
LEFT = Qt.MouseButton.LeftButton
DETECTED = Document(scans=(Scan("plant.laz", CLOUD, RESULT),))


def states(selection):
    return resolve(Document(scans=(Scan("plant.laz", CLOUD, RESULT),), selection=selection))


def shown(qtbot, plot, state):
    qtbot.addWidget(plot)
    plot.resize(420, 480)
    with qtbot.waitExposed(plot):
        plot.show()
    plot.apply(state)
    lay_out(plot)
    return plot


def lay_out(plot):
    """Bring everything to its place, without which clicks go astray."""
    for _ in range(2):
        QApplication.processEvents()
        plot.grab()


def at(plot, plot_item, x, y) -> QPoint:
    """Where a place of a plot is in the canvas's pixels."""
    scene = plot_item.vb.mapViewToScene(QPointF(x, y))
    return plot.canvas.mapFromScene(scene)


def click(qtbot, plot, position):
    qtbot.mouseClick(plot.canvas.viewport(), LEFT, pos=position)


def hover_plot(qtbot, plot, plot_item, x, y, is_told):
    hover(qtbot, plot.canvas.viewport(), lambda: at(plot, plot_item, x, y), is_told)


@pytest.fixture
def radius(qtbot, no_leaks) -> RadiusPlot:
    return shown(qtbot, RadiusPlot(), states(Selection(1, 2)).radius_plot)


@pytest.mark.parametrize("by_chainage", [False, True])
@pytest.mark.parametrize("row", [3, 40, 80])
def test_that_a_click_on_a_point_names_its_profile(radius, qtbot, row, by_chainage):
    radius.x_axis.setCurrentIndex(int(by_chainage))
    radius.fit()
    profiles = RESULT.profiles.of_element(2, 0)
    x = profiles.chainage[row] if by_chainage else profiles.profile_index[row]
    y = 1000 * profiles.semi_minor[row]
    with qtbot.waitSignal(radius.profile_clicked) as clicked:
        click(qtbot, radius, at(radius, radius.radius, x, y))
    assert clicked.args == [0, int(profiles.profile_index[row])]


def test_that_a_click_far_from_every_point_selects_nothing(radius, qtbot):
    with qtbot.assertNotEmitted(radius.profile_clicked, wait=200):
        (x_low, _), (y_low, y_high) = radius.radius.viewRange()
        click(qtbot, radius, at(radius, radius.radius, x_low + 8, (y_low + y_high) / 2))


def test_that_the_centre_deviations_can_be_clicked_too(radius, qtbot):
    profiles = RESULT.profiles.of_element(2, 0)
    row = int(np.argmax(profiles.centre_deviation))
    y = 1000 * profiles.centre_deviation[row]
    with qtbot.waitSignal(radius.profile_clicked) as clicked:
        click(qtbot, radius, at(radius, radius.offset, profiles.profile_index[row], y))
    assert clicked.args == [0, int(profiles.profile_index[row])]


def test_that_hovering_reads_out_the_profile(radius, qtbot):
    profiles = RESULT.profiles.of_element(2, 0)
    radius.resize(900, 480)  # room for the whole line
    lay_out(radius)
    y = 1000 * profiles.semi_minor[20]
    hover_plot(qtbot, radius, radius.radius, 20, y, lambda: "Profile 20" in radius.readout.text())
    assert f"{profiles.chainage[20]:.3f} m" in radius.readout.text()
    assert "±" in radius.readout.text()


def test_that_another_stack_is_asked_for_by_its_id(radius, qtbot):
    assert radius.stacks.itemText(0).startswith("Across the axis")
    row = radius.stacks.findData(1)
    assert row > 0
    with qtbot.waitSignal(radius.stack_chosen) as chosen:
        radius.stacks.activated.emit(row)
    assert chosen.args == [1]


def test_that_applying_a_state_emits_nothing(radius, qtbot):
    with (
        qtbot.assertNotEmitted(radius.stack_chosen),
        qtbot.assertNotEmitted(radius.profile_clicked),
    ):
        radius.apply(states(Selection(1, 4, 2)).radius_plot)
        radius.apply(states(Selection(1, 2, 0, ProfileKey(1, 40))).radius_plot)


def test_that_zoom_is_kept_when_only_the_selection_changes(radius):
    radius.radius.setYRange(80, 82, padding=0)
    before = radius.radius.viewRange()[1]
    radius.apply(states(Selection(1, 2, 0, ProfileKey(0, 12))).radius_plot)
    assert radius.radius.viewRange()[1] == pytest.approx(before)


@pytest.mark.parametrize(
    ("make", "state"),
    [
        (RadiusPlot, RadiusPlotState()),
        (DeviationMapView, MapState()),
        (SectionView, SectionState()),
    ],
)
def test_that_an_empty_plot_says_what_would_fill_it(qtbot, no_leaks, make, state):
    plot = shown(qtbot, make(), state)
    assert plot.empty.isVisible()
    assert plot.empty.text().startswith("Select ")


@pytest.mark.parametrize("element", RESULT.elements, ids=lambda e: e.label)
def test_that_every_kind_of_element_can_be_plotted(qtbot, no_leaks, element):
    state = states(Selection(element.run_id, element.element_id, 0, ProfileKey(0, 0)))
    for plot, part in (
        (RadiusPlot(), state.radius_plot),
        (DeviationMapView(), state.map),
        (SectionView(), state.section),
    ):
        shown(qtbot, plot, part)
        assert not plot.empty.isVisible()


# Map


@pytest.fixture
def unrolled(qtbot, no_leaks) -> DeviationMapView:
    return shown(qtbot, DeviationMapView(), states(Selection(1, 2)).map)


@pytest.mark.parametrize(("chainage", "clock_deg"), [(0.3, 90), (1.4, 270), (1.1, 170)])
def test_that_a_click_on_the_map_names_chainage_and_clock(unrolled, qtbot, chainage, clock_deg):
    degrees = (clock_deg + 180) % 360 - 180
    with qtbot.waitSignal(unrolled.spot_clicked) as clicked:
        click(qtbot, unrolled, at(unrolled, unrolled.plot, chainage, degrees))
    assert clicked.args[0] == pytest.approx(chainage, abs=0.01)
    assert np.rad2deg(clicked.args[1]) == pytest.approx(clock_deg, abs=2)


def test_that_a_click_into_an_outline_names_the_deformation(unrolled, qtbot):
    dent = RESULT.deformation(1)
    with qtbot.waitSignal(unrolled.deformation_clicked) as clicked:
        click(qtbot, unrolled, at(unrolled, unrolled.plot, dent.chainage, np.rad2deg(dent.clock)))
    assert clicked.args == [1]


def test_that_hovering_reads_the_dent_off_the_map(unrolled, qtbot):
    dent = RESULT.deformation(1)
    x, y = dent.chainage, np.rad2deg(dent.clock)

    def is_told():
        text = unrolled.readout.text()
        return ("inward" in text or "not scanned" in text) and "m · 1:" in text

    hover_plot(qtbot, unrolled, unrolled.plot, x, y, is_told)


def test_that_a_deformation_over_six_o_clock_is_outlined_on_both_sides(unrolled):
    from dataclasses import replace

    state = states(Selection(1, 2)).map
    low = replace(state.deformations[0], clock=np.deg2rad(175))
    unrolled.apply(replace(state, deformations=(low,)))
    boxes = unrolled.boxes(low)
    assert len(boxes) == 2
    assert boxes[0].center().y() - boxes[1].center().y() == pytest.approx(360)


# Section


@pytest.fixture
def section(qtbot, no_leaks) -> SectionView:
    selection = Selection(1, 2, 0, ProfileKey(0, 40))
    view = shown(qtbot, SectionView(), states(selection).section)
    view.activateWindow()
    view.setFocus()
    return view


@pytest.mark.parametrize(("key", "step"), [(Qt.Key.Key_Right, 1), (Qt.Key.Key_Left, -1)])
def test_that_arrow_keys_ask_for_the_next_profile(section, qtbot, key, step):
    with qtbot.waitSignal(section.step_requested) as asked:
        qtbot.keyClick(section, key)
    assert asked.args == [step]


def test_that_arrow_keys_step_after_a_click_into_the_section(section, qtbot):
    click(qtbot, section, at(section, section.plot, 10, 10))
    qtbot.waitUntil(section.hasFocus)
    with qtbot.waitSignal(section.step_requested):
        qtbot.keyClick(section.focusWidget() or section, Qt.Key.Key_Right)


def test_that_buttons_step_and_end_at_the_ends(section, qtbot):
    with qtbot.waitSignal(section.step_requested) as asked:
        qtbot.mouseClick(section.back, LEFT)
    assert asked.args == [-1]
    section.apply(states(Selection(1, 2, 0, ProfileKey(0, 0))).section)
    assert not section.back.isEnabled()
    assert section.ahead.isEnabled()


def test_that_the_section_has_equal_axes(section):
    (u_low, u_high), (v_low, v_high) = section.plot.viewRange()
    box = section.plot.vb.sceneBoundingRect()
    per_mm = box.width() / (u_high - u_low), box.height() / (v_high - v_low)
    assert per_mm[0] == pytest.approx(per_mm[1], rel=0.01)


def test_that_exaggeration_keeps_all_in_view(section):
    before = section.plot.viewRange()
    section.factor.setValue(20)
    assert section.factor_text.text() == "20×"
    assert np.ptp(section.plot.viewRange()[0]) > np.ptp(before[0])


@pytest.mark.parametrize("layer", ["points", "curve", "ellipse", "reference", "dimensions"])
def test_that_layers_of_the_section_can_be_left_out(section, layer):
    n_items = len(section.plot.items)
    section.layer_menu.series[layer].setChecked(False)
    assert len(section.plot.items) < n_items


def test_that_page_and_end_keys_step_far(section, qtbot):
    for key, step in ((Qt.Key.Key_PageUp, 10), (Qt.Key.Key_PageDown, -10)):
        with qtbot.waitSignal(section.step_requested) as asked:
            qtbot.keyClick(section, key)
        assert asked.args == [step]
    document = selection_commands.select_profile(
        selection_commands.select_element(DETECTED, 2), 0, 5
    )
    last = selection_commands.step_profile(document, 10**6).selection.profile
    assert last.profile_index == RESULT.profiles.of_element(2, 0).profile_index[-1]


# Several elements in one plot


def test_that_pinned_elements_stay_in_the_plot(qtbot):
    plot = shown(qtbot, RadiusPlot(), states(Selection(1, 2)).radius_plot)
    n_points = len(plot.numbers()["element"])
    document = commands.toggle_pin(selection_commands.select_element(DETECTED, 9))
    document = selection_commands.select_element(document, 2)
    plot.apply(resolve(document).radius_plot)
    assert set(plot.numbers()["element"]) == {"Pipe 2", "Pipe 9"}
    assert len(plot.numbers()["element"]) > n_points
    assert "Pipe&nbsp;9" in plot.key.text()
    assert not plot.pin.isChecked()
    plot.apply(resolve(selection_commands.select_element(document, 9)).radius_plot)
    assert plot.pin.isChecked()
    assert set(plot.numbers()["element"]) == {"Pipe 9"}


def test_that_the_pin_asks_to_be_set(radius, qtbot):
    with qtbot.waitSignal(radius.pin_toggled):
        qtbot.mouseClick(radius.pin, LEFT)


def test_that_the_seventh_pin_takes_the_first_one_off():
    document = DETECTED
    for element_id in range(1, 8):
        document = commands.toggle_pin(selection_commands.select_element(document, element_id))
    assert document.view.pinned_elements == (2, 3, 4, 5, 6, 7)
    assert commands.toggle_pin(document).view.pinned_elements == (2, 3, 4, 5, 6)


def test_that_differences_from_the_fitted_radius_lie_about_zero(radius):
    radius.shown_menu.series["difference"].setChecked(True)
    low, high = radius.radius.viewRange()[1]
    assert low < 0 < high
    assert high - low < 40


def test_that_the_rules_limit_is_that_of_the_elements_own_diameter():
    limit = states(Selection(1, 2)).radius_plot.dent_limit
    assert limit.depth == pytest.approx(0.06 * 0.1683)
    assert "6 %" in str(limit.criterion)


def test_that_what_is_not_wanted_is_not_drawn(radius):
    n_items = len(radius.radius.items)
    for name in ("semi_minor", "fitted", "band", "limit"):
        radius.shown_menu.series[name].setChecked(False)
        assert len(radius.radius.items) < n_items
        n_items = len(radius.radius.items)
    assert radius.offset.isVisible()
    radius.shown_menu.series["centre"].setChecked(False)
    assert not radius.offset.isVisible()


# The cursor of one view in the other


def test_that_hovering_the_map_tells_the_spot_and_leaving_it_nothing(qtbot):
    plot = shown(qtbot, DeviationMapView(), states(Selection(1, 2)).map)
    told = []
    plot.spot_hovered.connect(told.append)

    def is_at(x, y):
        if not told or told[-1] is None:
            return False
        chainage, clock = told[-1]
        return abs(chainage - x) < 0.02 and abs(np.rad2deg(clock) - y % 360) < 3

    for x, y in ((0.8, 40), (1.0, -60)):
        hover_plot(qtbot, plot, plot.plot, x, y, lambda x=x, y=y: bool(is_at(x, y)))
    QApplication.sendEvent(plot, QEvent(QEvent.Type.Leave))
    assert told[-1] is None


def test_that_hovering_a_point_of_the_radius_plot_tells_its_profile(radius, qtbot):
    told = []
    radius.profile_hovered.connect(told.append)
    profiles = radius.state.shown
    y = 1000 * profiles.semi_minor[20]
    key = ProfileKey(int(profiles.stack_id[20]), int(profiles.profile_index[20]))
    hover_plot(qtbot, radius, radius.radius, 20, y, lambda: told[-1:] == [key])
    QApplication.sendEvent(radius, QEvent(QEvent.Type.Leave))
    assert told[-1] is None


def test_that_hovering_a_point_of_the_section_tells_where_on_the_pipe_it_is(section, qtbot):
    told = []
    section.spot_hovered.connect(told.append)
    points, profile = 1000 * section.state.section.points_uv, section.state.profile
    section.factor.setValue(1)
    u, v = points[np.argmax(points[:, 0])]

    def is_told():
        chainage, clock = told[-1] if told and told[-1] else (np.nan, np.nan)
        away = np.hypot(u, v) * abs(np.sin(clock - np.arctan2(u, v)))
        return bool(chainage == pytest.approx(profile.chainage[0]) and away < 10)

    hover_plot(qtbot, section, section.plot, u, v, is_told)
    QApplication.sendEvent(section, QEvent(QEvent.Type.Leave))
    assert told[-1] is None


def test_that_the_map_shows_the_cursor_of_the_3d_view(qtbot):
    plot = shown(qtbot, DeviationMapView(), states(Selection(1, 2)).map)
    plot.show_cursor((0.8, np.deg2rad(300)))
    assert plot.cursor_mark.getData()[0] == pytest.approx([0.8])
    assert plot.cursor_mark.getData()[1] == pytest.approx([-60])
    plot.show_cursor(None)
    assert len(plot.cursor_mark.getData()[0]) == 0


def test_that_a_spot_on_the_surface_and_its_point_are_one():
    index = int(np.flatnonzero(RESULT.element_id == 2)[17])
    chainage, clock = result_queries.spot_of_point(CLOUD, RESULT, 2, index)
    spot = result_queries.spot_on_surface(RESULT, 2, chainage, clock)
    off = np.linalg.norm(spot - CLOUD.xyz[index])
    assert off == pytest.approx(abs(RESULT.deviation[index]), abs=2e-3)
    assert result_queries.spot_of_point(CLOUD, RESULT, 9, index) is None
    assert result_queries.spot_of_point(CLOUD, RESULT, 2, -1) is None


def test_that_in_a_small_panel_the_radius_has_all_the_room(radius, qtbot):
    assert radius.offset.isVisible()
    radius.resize(420, 300)
    qtbot.waitUntil(lambda: not radius.offset.isVisible() and not radius.ovality.isVisible())
    assert radius.radius.getAxis("bottom").labelText == "Profile index"
    assert radius.radius.vb.height() > 40
    radius.resize(420, 600)
    qtbot.waitUntil(radius.offset.isVisible)
    assert radius.radius.getAxis("bottom").labelText == ""
