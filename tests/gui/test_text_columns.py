"""The dialog for the columns of text files: by choice, by drag, by keyboard, and what is read."""

from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import QMimeData, QPoint, Qt
from PySide6.QtGui import QDropEvent
from PySide6.QtWidgets import QDialogButtonBox

from pipegui.panels.role_table import MIME, RoleChip
from pipegui.panels.text_columns_dialog import TextColumnsDialog
from pipegui.work.job_queue import read_files
from tests.core.io.cases import pipe

OPEN = QDialogButtonBox.StandardButton.Open
LEFT = Qt.MouseButton.LeftButton


@pytest.fixture
def app(make_app):
    return make_app(read=read_files)


@pytest.fixture
def table(tmp_path) -> Path:
    """Points with their colours, alpha, and the scan's number; x is the third column."""
    path = tmp_path / "table.txt"
    x, y, z = pipe(500).T
    more = np.column_stack([np.arange(500) % 2, z, x, y])
    np.savetxt(path, more, fmt="%.0f %.4f %.4f %.4f")
    return path


def dialog_of(app, qtbot) -> TextColumnsDialog:
    qtbot.waitUntil(lambda: app.window.findChild(TextColumnsDialog) is not None)
    dialog = app.window.findChild(TextColumnsDialog)
    qtbot.waitUntil(dialog.isVisible)
    return dialog


def choose(dialog, column, role):
    choice = dialog.table.roles.choices[column]
    choice.setCurrentIndex(choice.findData(role))


def roles(dialog):
    return [choice.currentData() for choice in dialog.table.roles.choices]


def drop(dialog, column, role):
    mime = QMimeData()
    mime.setData(MIME, role.encode())
    x = dialog.table.columnViewportPosition(column) + 5
    event = QDropEvent(
        QPoint(x, 20).toPointF(), Qt.DropAction.CopyAction, mime, LEFT, Qt.KeyboardModifier(0)
    )
    dialog.table.dropEvent(event)
    return event


def wait_until_read(app, qtbot, n_scans=1):
    qtbot.waitUntil(
        lambda: len(app.session.document.scans) == n_scans and not app.session.jobs.is_busy
    )


def is_right(app) -> bool:
    cloud = app.session.document.scan.cloud
    return np.abs(cloud.world(cloud.xyz.astype(float)) - pipe(500)).max() < 1e-3


def test_that_a_guess_is_told_and_changed_from_its_message(app, qtbot, table):
    app.controllers.scans.open_files([table])
    wait_until_read(app, qtbot)
    bar = app.window.panels.message
    assert "Columns guessed: " in bar.text.text()
    assert bar.property("severity") == "info"
    [button] = bar.answer_buttons
    qtbot.mouseClick(button, LEFT)
    dialog = dialog_of(app, qtbot)
    for column, role in enumerate(("station", "z", "x", "y")):
        choose(dialog, column, role)
    qtbot.mouseClick(dialog.buttons.button(OPEN), LEFT)
    qtbot.waitUntil(lambda: is_right(app))
    assert len(app.session.document.scans) == 1
    assert np.bincount(app.session.document.scan.cloud.station).tolist() == [0, 250, 250]
    assert app.session.document.scan.reading.columns == "station,z,x,y"
    qtbot.waitUntil(lambda: app.window.findChild(TextColumnsDialog) is None)


def test_that_roles_are_dropped_on_columns_and_wrong_ones_answered(app, qtbot, table):
    app.controllers.columns.open([table])
    dialog = dialog_of(app, qtbot)
    assert drop(dialog, 2, "x").isAccepted()
    # The column that was x is x no more, and no z is left.
    assert roles(dialog)[2] == "x"
    assert roles(dialog).count("x") == 1
    assert "Choose the column that holds" in dialog.said.text()
    assert not dialog.buttons.button(OPEN).isEnabled()
    drop(dialog, 3, "y")
    drop(dialog, 1, "z")
    assert dialog.buttons.button(OPEN).isEnabled()
    assert dialog.said.text() == "This is what is read:"
    dialog.accept()
    dialog._accept()
    qtbot.waitUntil(lambda: app.session.document.scan is not None)
    assert is_right(app)


def test_that_a_chip_is_dragged(app, qtbot, table, monkeypatch):
    dragged = []
    monkeypatch.setattr(
        "pipegui.panels.role_table.QDrag.exec",
        lambda drag, *_: dragged.append(bytes(drag.mimeData().data(MIME).data())),
    )
    app.controllers.columns.open([table])
    dialog = dialog_of(app, qtbot)
    chip = next(c for c in dialog.findChildren(RoleChip) if c.role == "station")
    qtbot.mousePress(chip, LEFT, pos=QPoint(5, 5))
    qtbot.mouseMove(chip, QPoint(60, 40))
    qtbot.waitUntil(lambda: dragged == [b"station"])
    dialog.reject()


def test_that_roles_are_chosen_with_the_keyboard(app, qtbot, table):
    app.controllers.columns.open([table])
    dialog = dialog_of(app, qtbot)
    first = dialog.table.roles.choices[0]
    first.setFocus()
    qtbot.waitUntil(first.hasFocus)
    qtbot.keyClick(first, Qt.Key.Key_S)
    assert roles(dialog)[0] == "station"
    qtbot.keyClick(first, Qt.Key.Key_Tab)
    second = dialog.table.roles.choices[1]
    qtbot.waitUntil(second.hasFocus)
    qtbot.keyClick(second, Qt.Key.Key_Z)
    assert roles(dialog)[1] == "z"
    qtbot.keyClick(dialog, Qt.Key.Key_Escape)
    qtbot.waitUntil(lambda: app.window.findChild(TextColumnsDialog) is None)
    assert app.session.document.scan is None


def test_that_separator_decimals_and_skipped_lines_are_chosen(app, qtbot, tmp_path):
    path = tmp_path / "comma.txt"
    rows = "".join(f"{x:.3f} {y:.3f} {z:.3f}\n".replace(".", ",") for x, y, z in pipe(300))
    path.write_text("5 5 5 5\n" + rows)
    app.controllers.columns.open([path])
    dialog = dialog_of(app, qtbot)
    dialog.skip.setValue(1)
    dialog.decimal.setCurrentIndex(dialog.decimal.findData("comma"))
    dialog.separator.setCurrentIndex(dialog.separator.findData("blank"))
    assert roles(dialog) == ["x", "y", "z"]
    qtbot.mouseClick(dialog.buttons.button(OPEN), LEFT)
    wait_until_read(app, qtbot)
    assert len(app.session.document.scan.cloud) == 300
    reading = app.session.document.scan.reading
    assert reading.columns == "x,y,z|separator=blank|decimal=comma|skip=1"
    # What was chosen is shown again when it is changed.
    app.window.actions_["change_columns"].trigger()
    dialog = dialog_of(app, qtbot)
    assert (dialog.skip.value(), dialog.decimal.currentData()) == (1, "comma")
    qtbot.mouseClick(dialog.guess, LEFT)
    assert dialog.skip.value() == 0
    dialog.reject()


def test_that_text_that_cannot_be_read_offers_its_columns(app, qtbot, tmp_path):
    path = tmp_path / "names.txt"
    path.write_text("".join(f"P{i} a {x} {y} {z}\n" for i, (x, y, z) in enumerate(pipe(300))))
    app.controllers.scans.open_files([path])
    bar = app.window.panels.message
    qtbot.waitUntil(bar.isVisible)
    [button] = bar.answer_buttons
    qtbot.mouseClick(button, LEFT)
    dialog = dialog_of(app, qtbot)
    for column, role in ((2, "x"), (3, "y"), (4, "z")):
        choose(dialog, column, role)
    qtbot.mouseClick(dialog.buttons.button(OPEN), LEFT)
    wait_until_read(app, qtbot)
    assert len(app.session.document.scan.cloud) == 300


def test_that_columns_of_what_is_no_text_cannot_be_chosen(app, qtbot, tmp_path):
    assert not app.window.actions_["change_columns"].isEnabled()
    app.controllers.columns.open([tmp_path / "missing.txt"])
    assert app.window.findChild(TextColumnsDialog) is None
    assert "missing.txt" in app.window.panels.message.text.text()


def test_that_the_dialog_speaks_german(app, qtbot, table, german):
    app.controllers.columns.open([table])
    dialog = dialog_of(app, qtbot)
    assert dialog.table.roles.choices[0].itemText(3) == "Intensität"
    choose(dialog, 1, "-")
    assert dialog.said.text().startswith("Wählen Sie die Spalte")
    dialog.reject()


def test_that_files_opened_together_get_their_columns_together(app, qtbot, table):
    other = table.with_name("other.txt")
    other.write_bytes(table.read_bytes())
    app.controllers.scans.open_files([table, other])
    wait_until_read(app, qtbot, 2)
    bar = app.window.panels.message
    [change] = [b for b in bar.answer_buttons if b.text() == "Change columns…"]
    qtbot.mouseClick(change, LEFT)
    dialog = dialog_of(app, qtbot)
    for column, role in enumerate(("-", "z", "x", "y")):
        choose(dialog, column, role)
    dialog._accept()
    qtbot.waitUntil(
        lambda: [s.reading.columns for s in app.session.document.scans] == ["-,z,x,y"] * 2
    )


def test_that_what_is_no_text_is_told_so(app, tmp_path):
    path = tmp_path / "a.bin"
    path.write_bytes(bytes(1000))
    app.controllers.columns.open([path])
    assert app.window.findChild(TextColumnsDialog) is None
    assert "is no text" in app.window.panels.message.text.text()


def test_that_what_was_opened_before_is_not_told_again(app, qtbot, table):
    app.controllers.scans.open_files([table])
    wait_until_read(app, qtbot)
    app.controllers.columns.open([table])
    dialog_of(app, qtbot)._accept()
    wait_until_read(app, qtbot, 2)
    assert "2 scans were opened" not in app.window.panels.message.text.text()
