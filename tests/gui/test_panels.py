"""Panels and models, each on its own, with real clicks and keys."""

from dataclasses import replace

import numpy as np
import pytest
from PySide6.QtCore import QModelIndex, Qt
from PySide6.QtGui import QGuiApplication
from PySide6.QtTest import QAbstractItemModelTester

from pipecore.settings import DirectionPreset, Settings, iterate_fields
from pipecore.types import DeformationKind, Verdict
from pipegui.model import commands, selection_commands
from pipegui.model.document import Document
from pipegui.panels.deformation_columns import COLUMNS
from pipegui.panels.deformation_model import DeformationFilter, DeformationModel
from pipegui.panels.deformation_table import DeformationTable
from pipegui.panels.project_model import BADGE, NAME, RADIUS, NodeKind, ProjectModel
from pipegui.panels.project_tree import ProjectTree
from pipegui.panels.properties import PropertiesPanel
from pipegui.panels.settings_form import ELSEWHERE, SettingsForm
from pipegui.panels.stacks_panel import StacksPanel
from pipegui.states.view_state import TableState, TreeState, resolve
from tests.factories import make_result

STRICT = QAbstractItemModelTester.FailureReportingMode.Fatal
Role = Qt.ItemDataRole
LEFT = Qt.MouseButton.LeftButton


def column(title):
    return next(i for i, c in enumerate(COLUMNS) if c.title == title)


def show(qtbot, widget, size=(420, 600)):
    qtbot.addWidget(widget)
    widget.resize(*size)
    with qtbot.waitActive(widget):
        widget.show()
        widget.activateWindow()
    return widget


def click_cell(qtbot, view, index):
    qtbot.mouseClick(view.viewport(), LEFT, pos=view.visualRect(index).center())


# Project


def test_that_the_project_model_keeps_qts_rules_while_scans_come_and_go(qtbot, document):
    model = ProjectModel()
    tester = QAbstractItemModelTester(model, STRICT)
    model.apply(resolve(document).tree)
    model.apply(resolve(commands.set_hidden(document, [1, 2], True)).tree)
    model.apply(resolve(commands.open_scan(document, document.scan)).tree)
    model.apply(TreeState())
    del tester


def shown_names(tree, parent=QModelIndex()):  # noqa: B008
    """Names of the rows that the filter leaves, depth first."""
    names = []
    for row in range(tree.model.rowCount(parent)):
        if not tree.view.isRowHidden(row, parent):
            index = tree.model.index(row, NAME, parent)
            names += [index.data(), *shown_names(tree, index)]
    return names


def test_that_typing_filters_the_tree_and_clearing_shows_all(qtbot, document):
    tree = show(qtbot, ProjectTree())
    tree.apply(resolve(document).tree)
    everything = shown_names(tree)
    qtbot.keyClicks(tree.filter, "bend")
    left = shown_names(tree)
    bends = [name for name in everything if "bend" in name.lower()]
    assert bends
    assert set(bends) <= set(left)
    assert not any(name.startswith("Pipe ") for name in left)
    # A new state keeps the filter.
    tree.apply(resolve(commands.open_scan(document, document.scan)).tree)
    assert not any(name.startswith("Pipe ") for name in shown_names(tree))
    tree.filter.clear()
    assert set(everything) <= set(shown_names(tree))


def test_that_the_tree_holds_runs_elements_and_deformations(qtbot, document):
    model = ProjectModel()
    model.apply(resolve(document).tree)
    scan = model.index(0, NAME)
    names = [model.index(r, NAME, scan).data() for r in range(model.rowCount(scan))]
    assert names == ["Run 1 (6)", "Pipe 7", "Run 3 (2)", "Deformations (4)"]
    run = model.index(0, NAME, scan)
    assert model.rowCount(run) == 6
    assert model.index(1, NAME, run).data() == "Pipe 2"
    assert model.index(1, RADIUS, run).data() == "84.2"
    assert model.index(1, BADGE, run).data() == "1"
    assert model.index(0, BADGE, run).data() == ""


def test_that_a_run_of_one_element_is_shown_as_that_element(qtbot, document):
    model = ProjectModel()
    model.apply(resolve(document).tree)
    run = model.index_of(0, selection_commands.select_run(document, 2).selection)
    assert model.what(run) == (0, NodeKind.ELEMENT, 7)
    run = model.index_of(0, selection_commands.select_run(document, 3).selection)
    assert model.what(run) == (0, NodeKind.RUN, 3)


def test_that_a_run_is_half_checked_when_some_of_it_is_hidden(qtbot, document):
    model = ProjectModel()
    model.apply(resolve(commands.set_hidden(document, [1, 2], True)).tree)
    scan = model.index(0, NAME)
    states = [Qt.CheckState(model.index(r, NAME, scan).data(Role.CheckStateRole)) for r in range(3)]
    assert states == [
        Qt.CheckState.PartiallyChecked,
        Qt.CheckState.Checked,
        Qt.CheckState.Checked,
    ]


def test_that_a_click_in_the_tree_tells_what_was_clicked(qtbot, document):
    tree = show(qtbot, ProjectTree())
    tree.apply(resolve(document).tree)
    index = tree.model.index_of(0, selection_commands.select_element(document, 4).selection)
    with qtbot.waitSignal(tree.chosen) as told:
        click_cell(qtbot, tree.view, index)
    assert told.args == [0, NodeKind.ELEMENT, 4]


def test_that_the_keys_walk_the_tree(qtbot, document):
    tree = show(qtbot, ProjectTree())
    tree.apply(resolve(selection_commands.select_element(document, 4)).tree)
    with qtbot.waitSignal(tree.chosen) as told:
        qtbot.keyClick(tree.view, Qt.Key.Key_Down)
    assert told.args == [0, NodeKind.ELEMENT, 5]


def test_that_a_click_on_a_check_box_asks_to_hide(qtbot, document):
    tree = show(qtbot, ProjectTree())
    tree.apply(resolve(document).tree)
    run = tree.model.index(1, NAME, tree.model.index(0, NAME))
    rect = tree.view.visualRect(run)
    with qtbot.waitSignal(tree.visibility_changed) as told:
        box = rect.topLeft()
        box.setX(box.x() + 10)
        box.setY(rect.center().y())
        qtbot.mouseClick(tree.view.viewport(), LEFT, pos=box)
    assert told.args == [(7,), True]


def test_that_showing_a_selection_is_not_told_as_a_choice(qtbot, document):
    tree = show(qtbot, ProjectTree())
    told = []
    tree.chosen.connect(lambda *args: told.append(args))
    for element_id in (2, 9, 0):
        tree.apply(resolve(selection_commands.select_element(document, element_id)).tree)
    assert told == []
    assert not tree.view.selectionModel().hasSelection()


# Deformations


def test_that_the_deformation_models_keep_qts_rules(qtbot):
    model = DeformationModel()
    proxy = DeformationFilter(model)
    proxy.setSourceModel(model)
    testers = [QAbstractItemModelTester(m, STRICT) for m in (model, proxy)]
    model.set_result(make_result())
    proxy.set_filter(DeformationKind.DENT, None, 0)
    proxy.sort(5)
    proxy.set_filter(None, Verdict.REVIEW, 5)
    model.set_result(None)
    del testers


def test_that_deformations_stand_in_order_of_verdict_and_depth(qtbot):
    model = DeformationModel()
    model.set_result(make_result())
    verdicts = [model.deformation(r).verdict for r in range(4)]
    depths = [model.deformation(r).depth for r in range(4)]
    assert verdicts == [Verdict.REJECT, Verdict.REVIEW, Verdict.REVIEW, Verdict.REVIEW]
    assert depths[1:] == sorted(depths[1:], reverse=True)


@pytest.mark.parametrize("title", ["Depth, mm", "% OD", "Chainage, m", "Clock"])
def test_that_a_click_on_a_header_sorts_by_number(qtbot, title):
    table = show(qtbot, DeformationTable(), (1000, 300))
    table.apply(TableState(make_result()))
    header = table.view.horizontalHeader()
    place = header.sectionViewportPosition(column(title)) + header.sectionSize(column(title)) // 2
    qtbot.mouseClick(
        header.viewport(), LEFT, pos=header.viewport().rect().topLeft() + _point(place, 8)
    )
    rows = [table.proxy.mapToSource(table.proxy.index(r, 0)).row() for r in range(4)]
    keys = [table.model.sort_key(r, column(title)) for r in rows]
    assert keys == sorted(keys)


def _point(x, y):
    from PySide6.QtCore import QPoint

    return QPoint(x, y)


def test_that_the_filters_leave_out_and_count(qtbot):
    table = show(qtbot, DeformationTable(), (1000, 300))
    table.apply(TableState(make_result()))
    assert table.filters.counts.text() == "4 shown · 1 to reject · 3 to review"
    qtbot.keyClicks(table.filters.kind, "dent")
    assert table.filters.counts.text() == "2 of 4 shown · 1 to reject · 1 to review"
    table.filters.min_depth.setFocus()
    table.filters.min_depth.selectAll()
    qtbot.keyClicks(table.filters.min_depth, "10")
    qtbot.keyClick(table.filters.min_depth, Qt.Key.Key_Return)
    assert table.filters.counts.text() == "1 of 4 shown · 1 to reject"


def test_that_a_click_on_a_row_tells_its_deformation(qtbot):
    table = show(qtbot, DeformationTable(), (1000, 300))
    table.apply(TableState(make_result()))
    with qtbot.waitSignal(table.chosen) as told:
        click_cell(qtbot, table.view, table.proxy.index(2, 4))
    assert told.args == [table.model.deformation(2).deformation_id]


def test_that_copied_rows_are_plain_numbers(qtbot):
    table = show(qtbot, DeformationTable(), (1000, 300))
    table.apply(TableState(make_result(), selected=1))
    table.view.setFocus()
    qtbot.keyClick(table.view, Qt.Key.Key_C, Qt.KeyboardModifier.ControlModifier)
    header, row = QGuiApplication.clipboard().text().rstrip("\n").split("\n")
    cells = dict(zip(header.split("\t"), row.split("\t"), strict=True))
    assert float(cells["depth_mm"]) == pytest.approx(12.1)
    assert float(cells["depth_pct_od"]) == pytest.approx(100 * 12.1 / 168.3, abs=0.06)
    assert cells["ovality_pct"] == ""
    assert cells["verdict"] == "reject"


def test_that_what_the_scan_cannot_carry_sorts_last(qtbot):
    table = DeformationTable()
    qtbot.addWidget(table)
    table.apply(TableState(make_result()))
    table.view.sortByColumn(column("Ovality, %"), Qt.SortOrder.AscendingOrder)
    first = table.proxy.mapToSource(table.proxy.index(0, 0)).row()
    assert table.model.deformation(first).kind is DeformationKind.OVALITY


# Properties


def test_that_properties_carry_unit_and_uncertainty(qtbot, document):
    panel = show(qtbot, PropertiesPanel())
    panel.apply(resolve(selection_commands.select_element(document, 2)).properties)
    lines = {
        panel.list.topLevelItem(i).text(0): panel.list.topLevelItem(i)
        for i in range(panel.list.topLevelItemCount())
    }
    assert lines["Radius"].text(1) == "84.15 ± 0.04 mm"
    assert lines["Nominal size"].text(1) == "DN 150 / NPS 6 (OD 168.3 mm)"
    panel.apply(resolve(selection_commands.select_element(document, 9)).properties)
    ovality = panel.list.findItems("Ovality", Qt.MatchFlag.MatchExactly, 0)[0]
    assert ovality.text(1) == "not measurable"
    assert "140° of arc" in ovality.toolTip(1)


def test_that_properties_tell_with_what_an_element_was_detected_again(qtbot, document):
    [scan] = document.scans
    own = scan.result.settings.replace({"elements.min_radius_mm": 12.0})
    result = replace(scan.result, own_settings={2: own})
    document = replace(document, scans=(replace(scan, result=result),))
    panel = show(qtbot, PropertiesPanel())
    panel.apply(resolve(selection_commands.select_element(document, 2)).properties)
    [line] = panel.list.findItems("Own settings", Qt.MatchFlag.MatchExactly, 0)
    before = f"{scan.result.settings.elements.min_radius_mm:g} mm"
    assert line.text(1) == f"Smallest radius: 12 mm ({before})"
    panel.apply(resolve(selection_commands.select_element(document, 7)).properties)
    assert not panel.list.findItems("Own settings", Qt.MatchFlag.MatchExactly, 0)


# Settings


def test_that_every_setting_has_a_field_here_or_in_the_stacks_panel(qtbot):
    form = SettingsForm()
    qtbot.addWidget(form)
    from PySide6.QtWidgets import QWidget

    for key, spec in iterate_fields():
        if key in ELSEWHERE:
            continue
        field = form.findChild(QWidget, key)
        assert field is not None, key
        assert field.accessibleName() == spec.label
        assert spec.help in field.toolTip()


def test_that_a_typed_number_is_told_once_when_it_is_done(qtbot):
    form = show(qtbot, SettingsForm())
    from PySide6.QtWidgets import QDoubleSpinBox

    field = form.findChild(QDoubleSpinBox, "elements.min_radius_mm")
    told = []
    form.changed.connect(lambda *args: told.append(args))
    field.setFocus()
    field.selectAll()
    qtbot.keyClicks(field, "37.5")
    assert told == []
    qtbot.keyClick(field, Qt.Key.Key_Return)
    assert told == [("elements.min_radius_mm", 37.5)]


def test_that_zero_reads_as_what_it_means_and_advanced_is_folded(qtbot):
    form = show(qtbot, SettingsForm())
    from PySide6.QtWidgets import QDoubleSpinBox

    assert form.findChild(QDoubleSpinBox, "thinning.voxel_mm").text() == "automatic"
    corner = form.findChild(QDoubleSpinBox, "profiles.corner_deg")
    assert not corner.isVisible()
    qtbot.mouseClick(form.advanced.button, LEFT)
    assert corner.isVisible()


def test_that_the_form_refuses_what_the_settings_would_refuse(qtbot):
    form = SettingsForm()
    qtbot.addWidget(form)
    from PySide6.QtWidgets import QDoubleSpinBox

    for key, spec in iterate_fields():
        if spec.kind is float and key not in ELSEWHERE:
            field = form.findChild(QDoubleSpinBox, key)
            for value in (field.minimum(), field.maximum()):
                if spec.minimum is None and value < 0:
                    continue
                Settings().replace({key: value})


def test_that_a_changed_setting_stands_out_and_can_be_reset(qtbot):
    form = show(qtbot, SettingsForm())
    form.apply(Settings().replace({"elements.min_radius_mm": 40.0}))
    assert form.labels["elements.min_radius_mm"].font().bold()
    assert not form.labels["elements.max_radius_mm"].font().bold()
    with qtbot.waitSignal(form.reset_requested):
        qtbot.mouseClick(form.reset, LEFT)


# Stacks


def stacks_panel(qtbot, document):
    panel = show(qtbot, StacksPanel())
    panel.apply(resolve(document).stacks)
    return panel


def test_that_cut_stacks_are_listed_with_width_and_number_of_profiles(qtbot, document):
    panel = stacks_panel(qtbot, document)
    item = panel.list.topLevelItem(0)
    expected = int((make_result().profiles.stack_id == 1).sum())
    assert [item.text(c) for c in range(3)] == ["X", "20 mm", str(expected)]


def test_that_ticking_a_stack_asks_to_show_its_profiles(qtbot, document):
    panel = stacks_panel(qtbot, document)
    rect = panel.list.visualItemRect(panel.list.topLevelItem(2))
    with qtbot.waitSignal(panel.shown) as told:
        place = rect.topLeft()
        place.setX(place.x() + 12)
        place.setY(rect.center().y())
        qtbot.mouseClick(panel.list.viewport(), LEFT, pos=place)
    assert told.args == [3]


def test_that_a_stack_is_added_from_the_view_direction(qtbot, document):
    panel = stacks_panel(qtbot, document)
    panel.editor.view_direction = lambda: np.array([0.0, 0.6, -0.8])
    qtbot.mouseClick(panel.add_button, LEFT)
    qtbot.mouseClick(panel.editor.from_view, LEFT)
    panel.editor.width_mm.setValue(15)
    with qtbot.waitSignal(panel.added) as told:
        qtbot.mouseClick(panel.editor.accept_button, LEFT)
    assert told.args == [(0.0, 0.6, -0.8, 15.0)]
    assert not panel.editor.isVisible()


def test_that_a_direction_of_zero_cannot_be_added(qtbot, document):
    panel = stacks_panel(qtbot, document)
    panel.add()
    for component in panel.editor.components:
        component.setValue(0)
    assert not panel.editor.accept_button.isEnabled()


def test_that_own_stacks_can_be_edited_and_removed_but_automatic_ones_not(qtbot, document):
    document = commands.add_stack(document, (1.0, 1.0, 0.0))
    panel = stacks_panel(qtbot, document)
    panel.list.setCurrentItem(panel.list.topLevelItem(0))
    assert not panel.remove_button.isEnabled()
    panel.list.setCurrentItem(panel.list.topLevelItem(3))
    with qtbot.waitSignal(panel.removed) as told:
        qtbot.mouseClick(panel.remove_button, LEFT)
    assert told.args == [0]
    qtbot.mouseClick(panel.edit_button, LEFT)
    with qtbot.waitSignal(panel.edited) as told:
        qtbot.mouseClick(panel.editor.accept_button, LEFT)
    assert told.args == [0, (1.0, 1.0, 0.0)]


def test_that_an_own_stack_that_was_cut_is_recognised_either_way_round(qtbot, document):
    document = commands.add_stack(document, (0.0, 0.0, -2.0))
    panel = stacks_panel(qtbot, document)
    assert panel.list.topLevelItemCount() == 3


def test_that_the_preset_is_told(qtbot):
    panel = stacks_panel(qtbot, Document())
    with qtbot.waitSignal(panel.preset_chosen) as told:
        qtbot.keyClicks(panel.preset, "Axes")
    assert told.args == [DirectionPreset.AXES_AND_DIAGONALS]


def test_that_empty_indexes_hold_nothing(qtbot):
    assert DeformationModel().data(QModelIndex()) is None
    assert ProjectModel().data(QModelIndex()) is None
