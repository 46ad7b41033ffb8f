"""The deformation table: columns, reviewing in place, copying; with real clicks and keys."""

from dataclasses import replace

import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtGui import QGuiApplication
from PySide6.QtTest import QAbstractItemModelTester
from PySide6.QtWidgets import QApplication, QLineEdit

from pipecore.types import Review, ReviewState
from pipegui.panels.deformation_columns import COLUMNS, EXPENDABLE, INDEX, SHOWN_FIRST
from pipegui.panels.deformation_model import DeformationFilter, DeformationModel
from pipegui.panels.deformation_table import DeformationTable
from pipegui.states.view_state import TableState
from tests.factories import make_result

STRICT = QAbstractItemModelTester.FailureReportingMode.Fatal
LEFT = Qt.MouseButton.LeftButton
CTRL = Qt.KeyboardModifier.ControlModifier
RESULT = make_result()
ACCEPTED = {2: Review(ReviewState.ACCEPTED, "old"), 3: Review(ReviewState.REJECTED)}


@pytest.fixture
def table(qtbot, no_leaks):
    table = DeformationTable()
    qtbot.addWidget(table)
    table.resize(1200, 300)
    with qtbot.waitActive(table):
        table.show()
        table.activateWindow()
    table.apply(TableState(RESULT, 1))
    return table


def cell(table, row, key):
    return table.proxy.index(row, INDEX[key])


def double_click(qtbot, table, index):
    place = table.view.visualRect(index).center()
    qtbot.mouseClick(table.view.viewport(), LEFT, pos=place)
    qtbot.mouseDClick(table.view.viewport(), LEFT, pos=place)


def copied():
    lines = QGuiApplication.clipboard().text().rstrip("\n").split("\n")
    return [line.split("\t") for line in lines]


def test_that_the_models_keep_qts_rules_while_reviews_come_and_go(qtbot):
    model = DeformationModel()
    proxy = DeformationFilter(model)
    proxy.setSourceModel(model)
    testers = [QAbstractItemModelTester(m, STRICT) for m in (model, proxy)]
    model.set_result(RESULT)
    proxy.sort(INDEX["review"])
    proxy.set_filter(None, None, 0, ReviewState.OPEN)
    model.set_reviews(ACCEPTED)
    assert proxy.rowCount() == 2
    model.set_reviews({})
    assert proxy.rowCount() == 4
    model.set_result(None)
    del testers


def test_that_a_comment_is_written_in_its_cell(table, qtbot):
    double_click(qtbot, table, cell(table, 1, "comment"))
    editor = table.view.findChild(QLineEdit)
    qtbot.keyClicks(editor, "shoe moved")
    with qtbot.waitSignal(table.commented) as told:
        qtbot.keyClick(editor, Qt.Key.Key_Return)
    assert told.args == [table.model.deformation(1).deformation_id, "shoe moved"]


def test_that_f2_edits_the_comment_without_a_mouse(table, qtbot):
    table.view.setFocus()
    table.view.setCurrentIndex(cell(table, 0, "comment"))
    qtbot.keyClick(table.view, Qt.Key.Key_F2)
    editor = table.view.findChild(QLineEdit)
    qtbot.keyClicks(editor, "by key")
    with qtbot.waitSignal(table.commented) as told:
        qtbot.keyClick(editor, Qt.Key.Key_Tab)
    assert told.args[1] == "by key"


def test_that_a_comment_left_as_it_was_tells_nothing(table, qtbot):
    table.apply(TableState(RESULT, 1, {1: Review(comment="as it was")}))
    double_click(qtbot, table, cell(table, 0, "comment"))
    editor = table.view.findChild(QLineEdit)
    assert editor.text() == "as it was"
    with qtbot.assertNotEmitted(table.commented):
        qtbot.keyClick(editor, Qt.Key.Key_Return)


def test_that_a_review_is_chosen_in_its_cell(table, qtbot):
    double_click(qtbot, table, cell(table, 0, "review"))
    qtbot.waitUntil(lambda: QApplication.activePopupWidget() is not None)
    with qtbot.waitSignal(table.reviewed) as told:
        qtbot.keyClick(QApplication.focusWidget(), Qt.Key.Key_Down)
        qtbot.keyClick(QApplication.focusWidget(), Qt.Key.Key_Return)
    assert told.args == [[table.model.deformation(0).deformation_id], ReviewState.ACCEPTED]


def test_that_several_rows_are_reviewed_at_once(table, qtbot):
    table.view.setFocus()
    qtbot.keyClick(table.view, Qt.Key.Key_A, CTRL)
    with qtbot.waitSignal(table.reviewed) as told:
        table.decisions[ReviewState.REJECTED].trigger()
    assert sorted(told.args[0]) == [1, 2, 3, 4]
    assert told.args[1] is ReviewState.REJECTED


def test_that_reviews_are_shown_counted_and_filtered(table, qtbot):
    table.apply(TableState(RESULT, 1, ACCEPTED))
    row = table.model.row_of(2)
    shown = [table.model.index(row, INDEX[key]).data() for key in ("review", "comment")]
    assert shown == ["accepted", "old"]
    assert table.filters.counts.text().endswith("2 open")
    qtbot.keyClicks(table.filters.review, "rejected")
    assert table.filters.counts.text().startswith("1 of 4 shown")


def test_that_a_review_keeps_the_cell_that_one_is_in(table, qtbot):
    table.view.setFocus()
    table.view.setCurrentIndex(cell(table, 0, "comment"))
    told = []
    table.chosen.connect(told.append)
    table.apply(TableState(RESULT, 1, ACCEPTED))
    assert table.view.currentIndex() == cell(table, 0, "comment")
    assert told == []


def test_that_columns_are_chosen_and_remembered(table, qtbot):
    with qtbot.waitSignal(table.columns.choices_changed):
        table.columns.actions["area_cm2"].trigger()
    assert "area_cm2" in table.columns.choices()["columns"]
    with qtbot.waitSignal(table.columns.choices_changed):
        table.columns.actions["width_mm"].trigger()
    header = table.view.horizontalHeader()
    header.moveSection(header.visualIndex(INDEX["comment"]), 0)
    shown = table.columns.shown
    assert shown[0] == "comment"
    assert "width_mm" not in shown
    another = DeformationTable()
    qtbot.addWidget(another)
    another.columns.show(shown)
    assert another.columns.shown == shown


def test_that_the_last_column_cannot_be_hidden_and_all_come_back(table):
    for key in list(table.columns.shown):
        table.columns.actions[key].setChecked(False)
    assert len(table.columns.shown) == 1
    table.columns.menu.actions()[-1].trigger()
    assert table.columns.shown == list(SHOWN_FIRST)


@pytest.mark.parametrize("width", [1600, 1022, 700, 400])
def test_that_without_a_choice_the_columns_need_no_scrolling(table, qtbot, width):
    table.resize(width, 300)
    header, viewport = table.view.horizontalHeader(), table.view.viewport()
    qtbot.waitUntil(lambda: viewport.width() > width - 40)
    assert header.length() <= viewport.width()
    left_out = set(SHOWN_FIRST) - set(table.columns.shown)
    assert left_out == set(EXPENDABLE[: len(left_out)])
    assert bool(left_out) == (width < 1000)
    for key in table.columns.shown:
        assert table.columns.actions[key].isChecked()


def test_that_chosen_columns_stay_however_narrow_the_table(table):
    table.columns.show(list(SHOWN_FIRST))
    table.resize(400, 300)
    assert table.columns.shown == list(SHOWN_FIRST)


def test_that_only_the_sorted_column_has_room_for_its_arrow(table):
    widths = {key: table.view.columnWidth(INDEX[key]) for key in table.columns.shown}
    table.view.sortByColumn(INDEX["clock"], Qt.SortOrder.AscendingOrder)
    wider = {k for k, w in widths.items() if table.view.columnWidth(INDEX[k]) > w}
    assert wider - {"comment"} == {"clock"}


def test_that_columns_of_another_version_do_no_harm(table):
    table.columns.show(["no such column", "depth_mm"])
    assert table.columns.shown == ["depth_mm"]
    table.columns.show([])
    assert set(table.columns.shown) == set(SHOWN_FIRST)


def test_that_a_right_click_on_the_header_offers_the_columns(table, qtbot):
    header = table.view.horizontalHeader()
    header.customContextMenuRequested.emit(QPoint(5, 5))
    qtbot.waitUntil(table.columns.menu.isVisible)
    table.columns.menu.close()


def test_that_what_is_shown_is_copied_in_the_order_shown(table, qtbot):
    table.columns.show(["depth_mm", "deformation_id", "comment"])
    table.apply(TableState(RESULT, 1, {1: Review(comment="two\tlines\nhere")}))
    table.view.setFocus()
    qtbot.keyClick(table.view, Qt.Key.Key_A, CTRL)
    qtbot.keyClick(table.view, Qt.Key.Key_C, CTRL)
    header, *rows = copied()
    assert header == ["depth_mm", "deformation_id", "comment"]
    assert len(rows) == 4
    depths = [float(row[0]) for row in rows]
    assert depths[0] == pytest.approx(12.1)
    assert rows[0][2] == "two lines here"


def test_that_every_cell_reads_and_copies(table):
    for row in range(4):
        for i, column in enumerate(COLUMNS):
            text = table.model.index(row, i).data()
            assert isinstance(text, str)
            if not column.is_text and column.key != "clock":
                plain = table.model.plain(row, i)
                assert plain == "" or float(plain) == float(plain)


def test_that_a_cell_without_a_number_says_why(table):
    index = table.model.index(0, INDEX["strain_pct"])
    assert index.data() == "not measurable"
    assert index.data(Qt.ItemDataRole.ToolTipRole) == "the wall thickness is not set"


def test_that_neighbours_and_fittings_are_named(table):
    texts = {
        key: [table.model.index(row, INDEX[key]).data() for row in range(4)]
        for key in ("fitting", "next")
    }
    assert any("m" in text for text in texts["fitting"])
    dent = RESULT.deformation(1)
    row = table.model.row_of(1)
    if dent.next_id:
        assert texts["next"][row].startswith(f"{dent.next_id}: ")


def test_that_an_empty_table_says_why(table):
    sound = replace(RESULT, deformations=())
    table.apply(TableState(sound))
    assert "every pipe keeps its shape" in table._empty.text()
    table.apply(TableState(replace(sound, elements=())))
    assert "No pipes found" in table._empty.text()
