"""Command search, from a few typed letters to the action; the menu of the steps done."""

import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QMenu
from pytestqt.qtbot import QtBot

from pipegui.composition import Application
from pipegui.model import commands
from pipegui.window.command_palette import CommandPalette, match


@pytest.mark.parametrize(
    ("typed", "text"),
    [
        ("", "Undo"),
        ("und", "Undo"),
        ("fs", "Fitted surfaces"),
        ("DET", "Detect"),
        ("f v", "Fit to view"),
    ],
)
def test_that_letters_in_their_order_match(typed, text):
    assert match(typed, text) is not None


def test_that_other_letters_do_not_match():
    assert match("xyz", "Undo") is None
    assert match("odnu", "Undo") is None


def test_that_the_beginnings_of_words_rank_before_letters_inside_them():
    assert match("sa", "Show all").gaps < match("sa", "Isolate").gaps
    assert match("det", "Detect").gaps < match("det", "Order the table").gaps


@pytest.fixture
def search(qtbot: QtBot, detected: Application) -> CommandPalette:
    """The search as the key opens it."""
    qtbot.keyClick(
        detected.window,
        Qt.Key.Key_P,
        Qt.KeyboardModifier.ControlModifier | Qt.KeyboardModifier.ShiftModifier,
    )
    found = detected.window.findChild(CommandPalette)
    qtbot.waitUntil(found.isVisible)
    return found


def names(search: CommandPalette) -> list[str]:
    return [search.list.topLevelItem(i).text(0) for i in range(search.list.topLevelItemCount())]


def test_that_all_actions_are_listed_and_letters_narrow_them_down(qtbot, detected, search):
    assert len(names(search)) == len(detected.window.actions_.entries())
    qtbot.keyClicks(search.field, "ellip")
    assert names(search)[0] == "Ellipses"
    assert len(names(search)) < 5


def test_that_return_carries_out_the_action_and_closes(qtbot, detected, search):
    was_shown = detected.session.document.view.show_ellipses
    qtbot.keyClicks(search.field, "ellip")
    qtbot.keyClick(search.field, Qt.Key.Key_Return)
    assert detected.session.document.view.show_ellipses is not was_shown
    assert not search.isVisible()


def test_that_the_arrow_keys_choose(qtbot, search):
    second = names(search)[1]
    qtbot.keyClick(search.field, Qt.Key.Key_Down)
    assert search.list.currentItem().text(0) == second
    qtbot.keyClick(search.field, Qt.Key.Key_Up)
    qtbot.keyClick(search.field, Qt.Key.Key_Up)
    assert search.list.currentItem().text(0) == names(search)[0]


def test_that_what_makes_no_sense_now_is_last_and_does_nothing(qtbot, detected, search):
    qtbot.keyClicks(search.field, "cancel")
    assert names(search) == ["Cancel"]
    qtbot.keyClick(search.field, Qt.Key.Key_Return)
    assert search.isVisible()


def test_that_nothing_found_is_said(qtbot, search):
    qtbot.keyClicks(search.field, "qqqq")
    assert names(search) == ["No action is called that"]
    qtbot.keyClick(search.field, Qt.Key.Key_Return)
    assert search.isVisible()


def test_that_the_history_menu_goes_back_and_forward_to_any_step(qtbot, detected):
    detected.session.do(commands.set_hidden, [1], True)
    detected.session.do(commands.set_hidden, [2], True)
    n_steps = len(detected.session.history.steps)
    detected.window.actions_.menus["Edit"].aboutToShow.emit()
    menu = next(m for m in detected.window.findChildren(QMenu) if m.title() == "History")
    actions = menu.actions()
    assert [a.text() for a in actions] == ["Start", *detected.session.history.steps]
    assert [a.isChecked() for a in actions] == [False] * n_steps + [True]
    actions[n_steps - 2].trigger()
    assert detected.session.document.view.hidden_elements == frozenset()
    detected.window.actions_.menus["Edit"].aboutToShow.emit()
    menu.actions()[-1].trigger()
    assert detected.session.document.view.hidden_elements == frozenset({1, 2})
    detected.window.actions_.menus["Edit"].aboutToShow.emit()
    menu.actions()[0].trigger()
    assert detected.session.document.scan is None
