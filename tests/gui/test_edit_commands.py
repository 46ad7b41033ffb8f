"""Edits as commands: any sequence can be undone, without Qt."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipecore.catalogues import sizes_of
from pipecore.errors import SettingsError
from pipecore.types import Question, ReviewState
from pipegui.model import commands, element_commands, selection_commands
from pipegui.model.document import Document, Scan, Selection
from pipegui.model.history import History
from pipegui.project.project_file import work_of
from tests.factories import make_scan

CLOUD, RESULT = make_scan(2000)
START = Document(scans=(Scan("plant.laz", CLOUD, RESULT),))
IDS = [e.element_id for e in RESULT.elements]
SIZES = sizes_of("ASME B36.10")


def present(document: Document) -> list[int]:
    return [e.element_id for e in document.result.elements]


def deformations(document: Document) -> list[int]:
    return [d.deformation_id for d in document.result.deformations]


@st.composite
def edits(draw):
    """A function that does something to a history."""
    kind = draw(st.sampled_from(["delete", "rename", "size", "review", "hide", "select", "undo"]))
    number, text = draw(st.integers(0, 99)), draw(st.text(max_size=5))

    def act(history: History) -> None:
        ids, found = present(history.document), deformations(history.document)
        one = ids[number % len(ids)] if ids else 0
        if kind == "undo":
            history.undo()
        elif kind == "review" and found:
            state = list(ReviewState)[number % 3]
            history.do(commands.set_review, [found[number % len(found)]], state)
        elif not ids:
            return
        elif kind == "delete":
            history.do(element_commands.delete_elements, [one])
        elif kind == "rename":
            history.do(element_commands.rename_element, one, text)
        elif kind == "size":
            history.do(element_commands.set_nominal_size, one, SIZES[number % len(SIZES)])
        elif kind == "hide":
            history.do(commands.set_hidden, [one], number % 2 == 0)
        elif kind == "select":
            history.do(selection_commands.select_element, one)
            history.do(element_commands.mark_elements, ids[: number % 4])

    return act


@given(st.lists(edits(), max_size=12))
def test_that_any_edits_can_be_undone_to_the_start_and_done_again(sequence):
    history = History(START)
    for act in sequence:
        act(history)
        document = history.document
        assert set(document.view.hidden_elements) <= set(IDS)
        selection = document.selection
        assert {selection.element_id, *selection.others} <= {0, *present(document)}
        assert selection.deformation_id in {0, *deformations(document)}
        assert set(document.scan.reviews) <= set(deformations(document))
    n_steps = len(history.steps)
    history.go_to(n_steps)
    end = work_of(history.document)
    history.go_to(0)
    assert history.document.scans == START.scans
    history.go_to(n_steps)
    assert work_of(history.document) == end


def test_that_steps_are_named_after_what_they_are_about():
    history = History(START)
    history.do(element_commands.rename_element, 2, "Feed line")
    history.do(element_commands.delete_elements, [7, 2])
    history.do(element_commands.set_nominal_size, 9, None)
    assert history.steps == ["Rename Pipe 2", "Delete Feed line, Pipe 7", "Change size of Pipe 9"]


def test_that_what_changes_nothing_is_no_step():
    history = History(START)
    history.do(element_commands.delete_elements, [])
    history.do(element_commands.rename_element, 2, "Pipe 2")
    history.do(element_commands.rename_scan, 0, "  ")
    history.do(element_commands.rename_run, 1, " Run 1")
    assert history.steps == []
    # A person confirms a size once; the second time changes nothing.
    for _ in range(2):
        history.do(element_commands.set_nominal_size, 2, RESULT.element(2).nominal)
    assert history.steps == ["Change size of Pipe 2"]


def test_that_another_rule_judges_at_once_and_undo_takes_it_back():
    history = History(START)
    before = [d.verdict for d in START.result.deformations]
    history.do(commands.change_settings, {"deformation.rule": "49cfr195-452h"})
    judged = history.document.result
    assert {d.rule for d in judged.deformations} == {"49cfr195-452h"}
    assert judged.settings.deformation.rule == "49cfr195-452h"
    history.do(commands.change_settings, {"stacks.width_mm": 12})
    assert history.document.result is judged
    history.undo()
    history.undo()
    assert [d.verdict for d in history.document.result.deformations] == before
    with pytest.raises(SettingsError, match="no acceptance rule"):
        history.do(commands.change_settings, {"deformation.rule": "of-nobody"})


def test_that_answers_go_to_the_place_or_to_its_element():
    history = History(START)
    dent = START.result.deformations[0]
    told = {Question.WELD: True, Question.CLAD: False}
    history.do(element_commands.answer, dent.deformation_id, dent.element_id, told)
    result = history.document.result
    assert result.deformation(dent.deformation_id).answers == {Question.WELD: True}
    assert result.element(dent.element_id).answers == {Question.CLAD: False}
    assert history.steps == ["Answer"]


def test_that_several_elements_are_a_selection_until_another_is_selected():
    document = selection_commands.select_element(START, 7)
    document = element_commands.mark_elements(document, [7, 9, 0])
    assert document.selection == Selection(2, 7, others=frozenset({9}))
    assert selection_commands.select_parent(document).selection == Selection(2, 7)
    assert selection_commands.select_element(document, 2).selection.others == frozenset()
    assert element_commands.mark_elements(START, [3]) is START


def test_that_first_steps_are_forgotten_before_memory_runs_out():
    per_edit = RESULT.element_id.nbytes + RESULT.deviation.nbytes
    history = History(START, budget_bytes=3 * per_edit)
    for element_id in IDS[:6]:
        history.do(element_commands.delete_elements, [element_id])
    assert len(history.steps) == 3
    assert history.steps[-1] == f"Delete {RESULT.element(IDS[5]).label}"
    history.go_to(0)
    assert present(history.document) == IDS[3:]


@pytest.mark.parametrize("n", [1, 50])
def test_that_steps_that_share_their_arrays_are_kept(n):
    history = History(START, budget_bytes=1000)
    for i in range(n):
        history.do(element_commands.rename_element, 2, f"line {i}")
    assert len(history.steps) == n
