"""Rules, catalogues and answers in a real window."""

from pathlib import Path

import pytest
from PySide6.QtCore import Qt

from pipecore.types import Question, Verdict
from pipegui.model.document import Selection
from pipegui.panels.answers_dialog import AnswersDialog
from pipegui.panels.several_field import SeveralField
from tests.factories import make_scan


@pytest.fixture
def app(make_app, qtbot):
    """A window with a detected scan."""
    cloud, result = make_scan(5000)
    app = make_app(read=lambda *_: cloud, detect=lambda *_: result)
    app.controllers.scans.open_files([Path("plant.laz")])
    qtbot.waitUntil(lambda: app.session.document.scan is not None)
    app.controllers.scans.detect()
    qtbot.waitUntil(
        lambda: app.session.document.result is not None and not app.session.jobs.is_busy
    )
    return app


def select(app, qtbot, selection: Selection) -> None:
    tree = app.window.panels.tree
    index = tree.model.index_of(0, selection)
    tree.view.scrollTo(index)
    centre = tree.view.visualRect(index).center()
    qtbot.mouseClick(tree.view.viewport(), Qt.MouseButton.LeftButton, pos=centre)


def answer(app, qtbot, question: Question, column: int) -> None:
    app.window.actions_["answer"].trigger()
    dialog = app.window.findChild(AnswersDialog, "answers")
    qtbot.waitUntil(dialog.isVisible)
    qtbot.mouseClick(dialog.groups[question].button(column), Qt.MouseButton.LeftButton)
    dialog.accept()


def test_that_an_answer_changes_the_verdict_and_is_shown(app, qtbot):
    dent = app.session.document.result.deformation(1)
    select(app, qtbot, Selection(1, dent.element_id, 1))
    answer(app, qtbot, Question.STRESS_RAISER, 0)
    told = app.session.document.result.deformation(1)
    assert told.answers == {Question.STRESS_RAISER: True}
    assert told.verdict is Verdict.REJECT
    shown = app.window.panels.properties
    qtbot.waitUntil(lambda: "with a gouge, crack or corrosion" in texts_of(shown))
    app.session.undo()
    assert app.session.document.result.deformation(1).answers == {}


def texts_of(properties) -> str:
    tree = properties.list
    items = [tree.topLevelItem(i) for i in range(tree.topLevelItemCount())]
    children = [item.child(i) for item in items for i in range(item.childCount())]
    return "\n".join(item.text(1) for item in (*items, *children))


def test_that_an_element_is_called_clad_and_gets_no_verdict(app, qtbot):
    number = app.session.document.result.deformation(1).element_id
    run = app.session.document.result.element(number).run_id
    select(app, qtbot, Selection(run, number))
    answer(app, qtbot, Question.CLAD, 0)
    result = app.session.document.result
    assert result.element(number).is_clad
    assert {d.verdict for d in result.deformations_of(number)} == {Verdict.NOT_MEASURABLE}


def field_of(app, key: str) -> SeveralField:
    field = app.window.findChild(SeveralField, key)
    assert field is not None
    return field


def test_that_several_rules_are_ticked_and_the_last_one_stays(app, qtbot):
    field = field_of(app, "deformation.rule")
    assert field.values == ("asme-6pct",)
    field.ticks["b31-3-bends"].trigger()
    assert app.session.document.settings.deformation.rule == "asme-6pct, b31-3-bends"
    field.ticks["asme-6pct"].trigger()
    field.ticks["b31-3-bends"].trigger()
    assert app.session.document.settings.deformation.rule == "b31-3-bends"
    assert field.ticks["b31-3-bends"].isChecked()


def test_that_an_own_rule_from_a_file_judges(app, qtbot, tmp_path, monkeypatch):
    path = tmp_path / "ours.toml"
    path.write_text(
        'title="t"\nsource="s"\nnote="n"\n'
        '[[criteria]]\nkinds=["dent"]\nmeasure="depth_mm"\nlimit=0.1\n',
        encoding="utf-8",
    )
    monkeypatch.setattr(
        "pipegui.panels.several_field.QFileDialog.getOpenFileName", lambda *_: (str(path), "")
    )
    field = field_of(app, "deformation.rule")
    field.own_file.trigger()
    field.ticks["asme-6pct"].trigger()
    assert app.session.document.settings.deformation.rule == str(path)
    dents = [d for d in app.session.document.result.deformations if d.kind == "dent"]
    assert {d.verdict for d in dents} == {Verdict.REJECT}


def test_that_a_rule_that_cannot_be_read_is_refused_and_the_field_set_back(
    app, qtbot, tmp_path, monkeypatch
):
    path = tmp_path / "broken.toml"
    path.write_text("title=", encoding="utf-8")
    monkeypatch.setattr(
        "pipegui.panels.several_field.QFileDialog.getOpenFileName", lambda *_: (str(path), "")
    )
    field = field_of(app, "deformation.rule")
    field.own_file.trigger()
    assert app.session.document.settings.deformation.rule == "asme-6pct"
    assert field.values == ("asme-6pct",)
    assert "broken.toml" in app.window.panels.message.text.text()


def test_that_catalogues_are_ticked_in_the_order_of_the_clicks(app, qtbot):
    field = field_of(app, "elements.catalogue")
    field.ticks["EN 10220"].trigger()
    assert app.session.document.settings.elements.catalogue == ("ASME B36.10", "EN 10220")
    assert app.session.document.result.settings.elements.catalogue == ("ASME B36.10", "EN 10220")
