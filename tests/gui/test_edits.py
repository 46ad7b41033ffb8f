"""Editing elements in a real window: tree, menus, keys, history."""

from dataclasses import replace
from pathlib import Path

import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtTest import QAbstractItemModelTester
from PySide6.QtWidgets import QApplication, QInputDialog, QLineEdit, QMenu

from pipecore.editing import delete_elements
from pipecore.elements.gates import refusals
from pipecore.reasons import Reason
from pipecore.types import Candidate, Result, ReviewState
from pipegui.model import selection_commands
from pipegui.model.document import ClipBox, Scan, Selection
from pipegui.panels.project_model import NAME, NodeKind, ProjectModel
from pipegui.panels.widgets import items_of
from pipegui.states.view_state import TreeState
from tests.factories import make_scan

LEFT = Qt.MouseButton.LeftButton
CONTROL = Qt.KeyboardModifier.ControlModifier
SHIFT = Qt.KeyboardModifier.ShiftModifier
MANY = 60_000


@pytest.fixture
def app(make_app, qtbot):
    """A window with a scan that is dense enough to be measured anew."""
    cloud, result = make_scan(MANY)
    app = make_app(read=lambda *_: cloud, detect=lambda *_: result)
    app.controllers.scans.open_files([Path("plant.laz")])
    qtbot.waitUntil(lambda: app.session.document.scan is not None)
    app.controllers.scans.detect()
    qtbot.waitUntil(
        lambda: app.session.document.result is not None and not app.session.jobs.is_busy
    )
    return app


def scan_index_of(app, element_id: int) -> QPoint:
    tree = app.window.panels.tree
    index = tree.model.index_of(0, Selection(element_id=element_id))
    tree.view.scrollTo(index)
    return tree.view.visualRect(index).center()


def click(app, qtbot, element_id: int, modifier=Qt.KeyboardModifier.NoModifier) -> None:
    view = app.window.panels.tree.view
    qtbot.mouseClick(view.viewport(), LEFT, modifier, scan_index_of(app, element_id))


def ids(app) -> list[int]:
    return [e.element_id for e in app.session.document.result.elements]


def asked(app) -> QInputDialog:
    return app.window.findChild(QInputDialog, "ask")


def test_that_delete_takes_the_selected_pipe_away_and_undo_brings_it_back(app, qtbot):
    before = ids(app)
    click(app, qtbot, 7)
    assert app.session.document.selection.element_id == 7
    qtbot.keyClick(app.window.panels.tree.view, Qt.Key.Key_Delete)
    assert ids(app) == [i for i in before if i != 7]
    assert app.session.history.undo_text == "Delete Pipe 7"
    assert app.window.actions_["undo"].text() == "Undo delete Pipe 7"
    assert not any(d.element_id == 7 for d in app.session.document.result.deformations)
    qtbot.keyClick(app.window, Qt.Key.Key_Z, CONTROL)
    assert ids(app) == before


def test_that_several_pipes_are_marked_with_control_and_deleted_together(app, qtbot):
    click(app, qtbot, 7)
    click(app, qtbot, 9, CONTROL)
    selection = app.session.document.selection
    assert {selection.element_id, *selection.others} == {7, 9}
    rows = app.window.panels.tree.view.selectionModel().selectedRows(NAME)
    assert sorted(app.window.panels.tree.model.what(r)[2] for r in rows) == [7, 9]
    qtbot.keyClick(app.window.panels.tree.view, Qt.Key.Key_Delete)
    assert not {7, 9} & set(ids(app))


def test_that_a_plain_click_ends_a_selection_of_several(app, qtbot):
    click(app, qtbot, 7)
    click(app, qtbot, 9, CONTROL)
    click(app, qtbot, 2)
    assert app.session.document.selection == Selection(1, 2)
    assert len(app.window.panels.tree.view.selectionModel().selectedRows(NAME)) == 1
    click(app, qtbot, 7, CONTROL)
    qtbot.keyClick(app.window, Qt.Key.Key_Escape)
    assert app.session.document.selection.others == frozenset()


def test_that_a_range_that_leaves_the_elements_selects_one_thing(app, qtbot):
    click(app, qtbot, 9)
    view, model = app.window.panels.tree.view, app.window.panels.tree.model
    dent = model.index_of(0, Selection(1, 2, 1))
    view.scrollTo(dent)
    qtbot.mouseClick(view.viewport(), LEFT, SHIFT, view.visualRect(dent).center())
    assert app.session.document.selection.deformation_id == 1
    qtbot.waitUntil(lambda: len(view.selectionModel().selectedRows(NAME)) == 1)
    assert model.what(view.currentIndex())[1:] == (NodeKind.DEFORMATION, 1)


def test_that_f2_names_a_pipe_in_the_tree_and_the_name_shows_everywhere(app, qtbot):
    click(app, qtbot, 2)
    qtbot.keyClick(app.window.panels.tree.view, Qt.Key.Key_F2)
    editor = app.window.panels.tree.view.findChild(QLineEdit)
    assert editor.text() == "Pipe 2"
    qtbot.keyClicks(editor, "Feed line")
    qtbot.keyClick(editor, Qt.Key.Key_Return)
    qtbot.waitUntil(lambda: app.session.document.result.element(2).label == "Feed line")
    assert app.session.document.selection.element_id == 2
    assert app.window.panels.docks["Element"].windowTitle().startswith("Feed line")
    index = app.window.panels.tree.model.index_of(0, app.session.document.selection)
    assert index.data() == "Feed line"
    assert app.session.history.undo_text == "Rename Pipe 2"
    app.session.history.undo()
    assert app.session.document.result.element(2).label == "Pipe 2"


def test_that_f2_names_a_run_and_the_name_shows_everywhere(app, qtbot):
    view, model = app.window.panels.tree.view, app.window.panels.tree.model
    row = model.index_of(0, Selection(run_id=1))
    n_elements = sum(e.run_id == 1 for e in app.session.document.result.elements)
    view.scrollTo(row)
    qtbot.mouseClick(view.viewport(), LEFT, pos=view.visualRect(row).center())
    qtbot.keyClick(view, Qt.Key.Key_F2)
    editor = view.findChild(QLineEdit)
    assert editor.text() == "Run 1"
    qtbot.keyClicks(editor, "Cooling water")
    qtbot.keyClick(editor, Qt.Key.Key_Return)
    qtbot.waitUntil(lambda: app.session.document.result.run_names == {1: "Cooling water"})
    assert app.session.document.selection == Selection(run_id=1)
    assert model.index_of(0, Selection(run_id=1)).data() == f"Cooling water ({n_elements})"
    assert app.window.panels.docks["Element"].windowTitle() == "Cooling water"
    assert app.window.panels.properties.list.topLevelItem(0).text(0) == "Cooling water"
    assert app.session.history.undo_text == "Rename Run 1"
    app.session.history.undo()
    assert model.index_of(0, Selection(run_id=1)).data() == f"Run 1 ({n_elements})"
    app.session.history.redo()
    assert app.session.document.result.run_names == {1: "Cooling water"}


def test_that_a_scan_is_renamed_without_moving_the_view(app, qtbot):
    view, model = app.window.panels.tree.view, app.window.panels.tree.model
    row = model.index(0, NAME)
    view.scrollTo(row)
    qtbot.mouseClick(view.viewport(), LEFT, pos=view.visualRect(row).center())
    key = app.window.views.scene.state.scan_key
    qtbot.keyClick(view, Qt.Key.Key_F2)
    editor = view.findChild(QLineEdit)
    editor.selectAll()
    qtbot.keyClicks(editor, "Pump house")
    qtbot.keyClick(editor, Qt.Key.Key_Return)
    qtbot.waitUntil(lambda: app.session.document.scan.name == "Pump house")
    assert app.window.views.scene.state.scan_key == key


def test_that_branches_that_were_closed_stay_closed_when_rows_change(app, qtbot):
    view, model = app.window.panels.tree.view, app.window.panels.tree.model
    run = next(i for i in model.branches() if model.what(i)[1] is NodeKind.RUN)
    what = model.what(run)
    view.collapse(run)
    click(app, qtbot, 7)
    qtbot.keyClick(view, Qt.Key.Key_Delete)
    again = next(i for i in model.branches() if model.what(i) == what)
    assert not view.isExpanded(again)
    others = [i for i in model.branches() if model.what(i) != what]
    assert all(view.isExpanded(i) for i in others)


def test_that_a_split_pipe_is_two_and_merged_again_is_one(app, qtbot):
    before = ids(app)
    click(app, qtbot, 7)
    app.window.actions_["split"].trigger()
    dialog = asked(app)
    assert dialog.doubleValue() == pytest.approx(
        app.session.document.result.element(7).axis.length / 2, abs=0.001
    )
    dialog.setDoubleValue(1.0)
    dialog.accept()
    qtbot.waitUntil(lambda: not app.session.jobs.is_busy)
    assert len(ids(app)) == len(before) + 1, app.window.panels.message.text.text()
    new_id = ids(app)[-1]
    result = app.session.document.result
    assert result.element(7).axis.length == pytest.approx(1.0, abs=0.01)
    assert app.session.document.selection.element_id in (7, new_id)
    assert app.session.history.undo_text == "Split Pipe 7"

    click(app, qtbot, 7)
    click(app, qtbot, new_id, CONTROL)
    qtbot.waitUntil(app.window.actions_["merge"].isEnabled)
    qtbot.keyClick(app.window, Qt.Key.Key_M, CONTROL)
    qtbot.waitUntil(lambda: ids(app) == before)
    assert app.session.document.selection.element_id == 7
    assert "Merge Pipe 7" in app.window.panels.message.text.text()
    app.session.history.undo()
    app.session.history.undo()
    assert app.session.document.result is not result
    assert ids(app) == before


def test_that_pipes_that_cannot_be_merged_are_told_and_nothing_changes(app, qtbot):
    result = app.session.document.result
    click(app, qtbot, 7)
    click(app, qtbot, 9, CONTROL)
    app.window.actions_["merge"].trigger()
    qtbot.waitUntil(lambda: not app.session.jobs.is_busy)
    assert "not of one size" in app.window.panels.message.text.text()
    assert app.window.panels.message.property("severity") == "error"
    assert app.session.document.result is result


def test_that_an_edit_of_what_was_changed_meanwhile_is_dropped(app, qtbot):
    click(app, qtbot, 7)
    app.window.actions_["split"].trigger()
    asked(app).accept()
    assert app.session.jobs.is_busy
    click(app, qtbot, 9)
    qtbot.keyClick(app.window.panels.tree.view, Qt.Key.Key_Delete)
    kept = app.session.document.result
    qtbot.waitUntil(lambda: not app.session.jobs.is_busy)
    assert app.session.document.result is kept
    assert "dropped" in app.window.panels.message.text.text()


def test_that_a_nominal_size_is_chosen_from_the_catalogue(app, qtbot):
    click(app, qtbot, 2)
    app.window.actions_["size"].trigger()
    dialog = asked(app)
    assert dialog.textValue().startswith("DN 150")
    dialog.setTextValue(next(t for t in dialog.comboBoxItems() if t.startswith("DN 200")))
    dialog.accept()
    assert app.session.document.result.element(2).nominal.name.startswith("DN 200")
    assert app.session.history.undo_text == "Change size of Pipe 2"


def test_that_a_kind_is_chosen_and_measured_as_such(app, qtbot):
    click(app, qtbot, 2)
    app.window.actions_["kind"].trigger()
    dialog = asked(app)
    assert "torus" not in dialog.comboBoxItems()
    dialog.setTextValue("flange")
    dialog.accept()
    qtbot.waitUntil(lambda: app.session.document.result.element(2).kind == "flange")
    assert not app.session.document.result.deformations_of(2)


@pytest.mark.parametrize(
    ("row", "wanted", "enabled"),
    [
        (Selection(3, 9), {"Delete", "Split element…", "Nominal size…"}, True),
        (Selection(3, 9), {"Merge elements"}, False),
        (Selection(1, 2, 1), {"Accept deformation", "Reject deformation"}, True),
    ],
)
def test_that_a_row_offers_what_can_be_done_with_it(app, qtbot, row, wanted, enabled):
    tree = app.window.panels.tree
    index = tree.model.index_of(0, row)
    tree.view.scrollTo(index)
    centre = tree.view.visualRect(index).center()
    qtbot.mouseClick(tree.view.viewport(), LEFT, pos=centre)
    tree.view.customContextMenuRequested.emit(centre)
    menu = app.window.findChild(QMenu, "context")
    offered = {a.text(): a.isEnabled() for a in menu.actions()}
    assert wanted <= set(offered)
    assert all(offered[text] is enabled for text in wanted)
    menu.close()


def test_that_reviewing_from_the_menu_is_undone_step_by_step(app, qtbot):
    app.window.panels.table.chosen.emit(3)
    app.window.actions_["reject"].trigger()
    assert app.session.document.scan.review(3).state is ReviewState.REJECTED
    qtbot.keyClick(app.window, Qt.Key.Key_Z, CONTROL)
    assert app.session.document.scan.review(3).state is ReviewState.OPEN


def test_that_hidden_and_reviewed_things_stay_so_when_another_pipe_goes(app, qtbot):
    click(app, qtbot, 9)
    app.window.actions_["hide"].trigger()
    app.window.panels.table.chosen.emit(1)
    app.window.actions_["accept"].trigger()
    click(app, qtbot, 7)
    qtbot.keyClick(app.window.panels.tree.view, Qt.Key.Key_Delete)
    assert app.session.document.view.hidden_elements == {9}
    assert app.session.document.scan.review(1).state is ReviewState.ACCEPTED


def test_that_detecting_in_a_box_needs_a_box_and_keeps_the_rest(app, qtbot):
    assert not app.window.actions_["detect_in_box"].isEnabled()
    from pipegui.model import commands

    pipe = app.session.document.result.element(7)
    low, high = sorted([tuple(pipe.axis.start - 0.3), tuple(pipe.axis.end + 0.3)])
    app.session.do(commands.set_view, clip_box=ClipBox(low, high))
    others = [e for e in app.session.document.result.elements if e.element_id not in (7, 9)]
    app.window.actions_["detect_in_box"].trigger()
    qtbot.waitUntil(lambda: app.session.history.undo_text == "Detect again in the box")
    assert all(e in app.session.document.result.elements for e in others if e.element_id < 7)


def test_that_the_model_keeps_its_promises_while_rows_come_and_go(qtbot):
    model = ProjectModel()
    tester = QAbstractItemModelTester(
        model, QAbstractItemModelTester.FailureReportingMode.Fatal, model
    )
    cloud, result = make_scan()
    scan = Scan("a", cloud, result)
    model.apply(TreeState((scan,), 0))
    named = []
    model.renamed.connect(lambda *args: named.append(args))
    assert model.setData(model.index(0, NAME), "b")
    QApplication.processEvents()
    assert named == [(0, NodeKind.SCAN, 0, "b")]
    model.apply(TreeState((Scan("b", cloud), scan), 1))
    model.apply(TreeState())
    assert tester is not None


def with_candidate(result: Result, element_id: int) -> Result:
    """`result` without an element, which is a candidate instead."""
    element = result.element(element_id)
    reason = Reason(refusals.SCATTERS, value="8.0", limit="5.0")
    candidate = Candidate(
        1,
        element.kind,
        element.axis,
        element.radius,
        element.radius_sd,
        element.radius_end,
        element.arc,
        element.rms,
        element.n_points,
        reason,
        8.0,
        5.0,
        "mm",
    )
    return replace(delete_elements(result, [element_id]), candidates=(candidate,))


class TestNotAccepted:
    """A pipe of the scan as a candidate: its points belong to nothing yet."""

    @pytest.fixture
    def app(self, make_app, qtbot):
        cloud, result = make_scan(MANY)
        app = make_app(read=lambda *_: cloud, detect=lambda *_: with_candidate(result, 7))
        app.controllers.scans.open_files([Path("plant.laz")])
        qtbot.waitUntil(lambda: app.session.document.scan is not None)
        app.controllers.scans.detect()
        qtbot.waitUntil(
            lambda: app.session.document.result is not None and not app.session.jobs.is_busy
        )
        return app

    @staticmethod
    def row(app):
        return app.window.panels.tree.model.index_of(0, Selection(candidate_id=1))

    def test_that_it_is_told_in_a_folded_branch_with_its_reason(self, app):
        tree, row = app.window.panels.tree, self.row(app)
        assert ", 1 not accepted" in app.window.panels.message.text.text()
        assert row.parent().data() == "Not accepted (1)"
        assert not tree.view.isExpanded(row.parent())
        assert row.data() == "Pipe 1?"
        assert "scatter" in row.data(Qt.ItemDataRole.ToolTipRole)

    def test_that_a_click_shows_it_and_one_more_accepts_it(self, app, qtbot):
        tree = app.window.panels.tree
        tree.view.expand(self.row(app).parent())
        tree.view.scrollTo(self.row(app))
        place = tree.view.visualRect(self.row(app)).center()
        qtbot.mouseClick(tree.view.viewport(), LEFT, pos=place)
        assert app.window.views.scene.state.selection.candidate_id == 1
        listed = items_of(app.window.panels.properties.list)
        lines = {item.text(0): item.text(1) for item in listed}
        assert lines["Value"] == "8 mm"
        assert lines["Limit"] == "5 mm"
        app.window.actions_["accept_candidate"].trigger()
        qtbot.waitUntil(lambda: not app.session.document.result.candidates)
        element = app.session.document.result.element(app.session.document.selection.element_id)
        assert element.accepted_by == "person"
        assert element.radius == pytest.approx(make_scan(MANY)[1].element(7).radius, rel=0.002)
        app.window.actions_["undo"].trigger()
        assert len(app.session.document.result.candidates) == 1

    def test_that_dismissing_takes_the_branch_away_until_undone(self, app):
        app.session.do(selection_commands.select_candidate, 1)
        app.window.actions_["dismiss_candidate"].trigger()
        assert not self.row(app).isValid()
        assert app.session.document.selection == Selection()
        app.window.actions_["undo"].trigger()
        assert self.row(app).isValid()
