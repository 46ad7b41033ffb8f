"""The plots in real windows with real clicks and keys."""

import numpy as np
import pytest
from PySide6.QtCore import QPoint, QPointF, Qt

from pipegui.document import Document, ProfileKey, Scan, Selection
from pipegui.plots.deviation_map import DeviationMap
from pipegui.plots.radius_plot import RadiusPlot
from pipegui.plots.section_view import SectionView
from pipegui.view_state import MapState, RadiusPlotState, SectionState, resolve
from tests.factories import make_scan

CLOUD, RESULT = make_scan()
LEFT = Qt.MouseButton.LeftButton


def states(selection):
    return resolve(Document(scans=(Scan("plant.laz", CLOUD, RESULT),), selection=selection))


def shown(qtbot, plot, state):
    qtbot.addWidget(plot)
    plot.resize(420, 480)
    with qtbot.waitExposed(plot):
        plot.show()
    plot.apply(state)
    qtbot.wait(50)
    return plot


def at(plot, plot_item, x, y) -> QPoint:
    """Where a place of a plot is in the canvas's pixels."""
    scene = plot_item.vb.mapViewToScene(QPointF(x, y))
    return plot.canvas.mapFromScene(scene)


def click(qtbot, plot, position):
    qtbot.mouseClick(plot.canvas.viewport(), LEFT, pos=position)


def hover(qtbot, plot, position):
    qtbot.mouseMove(plot.canvas.viewport(), position + QPoint(3, 3))
    qtbot.wait(30)
    qtbot.mouseMove(plot.canvas.viewport(), position)
    qtbot.wait(50)


@pytest.fixture
def radius(qtbot, no_leaks) -> RadiusPlot:
    return shown(qtbot, RadiusPlot(), states(Selection(1, 2)).radius_plot)


@pytest.mark.parametrize("by_chainage", [False, True])
@pytest.mark.parametrize("row", [3, 40, 80])
def test_that_a_click_on_a_point_names_its_profile(radius, qtbot, row, by_chainage):
    radius.x_axis.setCurrentIndex(int(by_chainage))
    radius._fit()
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
    qtbot.wait(50)
    hover(qtbot, radius, at(radius, radius.radius, 20, 1000 * profiles.semi_minor[20]))
    assert "Profile 20" in radius.readout.text()
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
        (DeviationMap, MapState()),
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
        (DeviationMap(), state.map),
        (SectionView(), state.section),
    ):
        shown(qtbot, plot, part)
        assert not plot.empty.isVisible()


# Map


@pytest.fixture
def unrolled(qtbot, no_leaks) -> DeviationMap:
    return shown(qtbot, DeviationMap(), states(Selection(1, 2)).map)


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
    hover(qtbot, unrolled, at(unrolled, unrolled.plot, dent.chainage, np.rad2deg(dent.clock)))
    text = unrolled.readout.text()
    assert "inward" in text or "not scanned" in text
    assert "m · 1:" in text


def test_that_a_deformation_over_six_o_clock_is_outlined_on_both_sides(unrolled):
    from dataclasses import replace

    state = states(Selection(1, 2)).map
    low = replace(state.deformations[0], clock=np.deg2rad(175))
    unrolled.apply(replace(state, deformations=(low,)))
    boxes = unrolled._boxes(low)
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
