"""Commands and history: without Qt."""

from dataclasses import replace

import numpy as np
import pytest

from pipecore.errors import SettingsError
from pipecore.geometry import LineAxis
from pipecore.settings import Settings
from pipecore.types import DeformationKind, Review, ReviewState, Verdict
from pipegui.model import commands, selection_commands
from pipegui.model.document import ClipBox, ColourBy, Document, ProfileKey, Scan, Selection
from pipegui.model.history import History
from pipegui.model.selection import nearest_profile, selection_of_deformation, worst_deformation
from tests.factories import make_scan

CLOUD, RESULT = make_scan()
DETECTED = Document(scans=(Scan("plant.laz", CLOUD, RESULT),))


def shuffled_result():
    """The same pipes found again: ids reversed, axes turned round, a little different."""
    n = len(RESULT.elements)
    elements = []
    for e in reversed(RESULT.elements):
        axis = e.axis
        if isinstance(axis, LineAxis):
            axis = LineAxis(axis.start + 0.003, axis.direction, axis.length).reversed()
        elements.append(
            replace(e, element_id=n + 1 - e.element_id, axis=axis, radius=e.radius + 0.0004)
        )
    deformations = tuple(replace(d, element_id=n + 1 - d.element_id) for d in RESULT.deformations)
    profiles = replace(RESULT.profiles, element_id=n + 1 - RESULT.profiles.element_id)
    chainage = profiles.chainage.copy()
    for e in elements:
        rows = profiles.element_id == e.element_id
        chainage[rows] = e.axis.pipe_coordinates(profiles.centre[rows])[0]
    profiles = replace(profiles, chainage=chainage)
    return replace(RESULT, elements=tuple(elements), deformations=deformations, profiles=profiles)


def test_that_a_new_scan_is_shown_in_its_own_colours():
    document = commands.open_scan(Document(), Scan("a", CLOUD))
    assert document.active == 0
    assert document.view.colour_by is ColourBy.RGB
    document = commands.open_scan(document, Scan("grey", replace(CLOUD, rgb=None)))
    assert document.active == 1
    assert document.view.colour_by is ColourBy.INTENSITY


def test_that_the_worst_deformation_is_selected_after_the_first_detection():
    document = commands.open_scan(Document(), Scan("plant.laz", CLOUD))
    document = commands.set_result(document, CLOUD, RESULT)
    deformation = RESULT.deformation(document.selection.deformation_id)
    assert deformation.verdict is Verdict.REJECT
    assert document.selection.element_id == deformation.element_id
    assert document.view.colour_by is ColourBy.DEVIATION


def test_that_a_result_of_a_closed_scan_changes_nothing():
    document = commands.close_scan(DETECTED, 0)
    assert commands.set_result(document, CLOUD, RESULT) is document


@pytest.mark.parametrize("element_id", [e.element_id for e in RESULT.elements])
def test_that_the_selected_element_is_kept_when_detected_again(element_id):
    document = selection_commands.select_element(DETECTED, element_id)
    again = commands.set_result(document, CLOUD, shuffled_result())
    assert again.selection.element_id == len(RESULT.elements) + 1 - element_id


def test_that_the_selected_profile_is_kept_in_its_place_when_detected_again():
    document = selection_commands.select_profile(
        selection_commands.select_element(DETECTED, 7), 0, 30
    )
    again = commands.set_result(document, CLOUD, shuffled_result())
    before = RESULT.profiles.of_element(7, 0).centre[30]
    kept = again.selection
    rows = again.result.profiles.of_element(kept.element_id, 0)
    after = rows.centre[rows.profile_index == kept.profile.profile_index][0]
    assert after == pytest.approx(before, abs=0.02)


def test_that_a_selection_is_let_go_when_its_element_is_no_longer_found():
    document = selection_commands.select_element(DETECTED, 9)
    fewer = replace(
        RESULT,
        elements=RESULT.elements[:8],
        deformations=tuple(d for d in RESULT.deformations if d.element_id < 9),
    )
    again = commands.set_result(document, CLOUD, fewer)
    assert again.selection == selection_of_deformation(fewer, worst_deformation(fewer))


def test_that_escape_goes_up_to_nothing():
    document = selection_commands.select_profile(
        selection_commands.select_deformation(DETECTED, 1), 0, 3
    )
    seen = []
    for _ in range(4):
        document = selection_commands.select_parent(document)
        seen.append(document.selection)
    assert seen == [Selection(1, 2, 1), Selection(1, 2), Selection(1), Selection()]


@pytest.mark.parametrize("index", [0, 123, 19_999])
def test_that_a_picked_point_selects_its_element(index):
    document = selection_commands.select_point(DETECTED, index)
    assert document.selection.element_id == RESULT.element_id[index]


def test_that_a_pick_beside_everything_selects_nothing():
    document = selection_commands.select_element(DETECTED, 3)
    assert selection_commands.select_point(document, -1).selection == Selection()
    floor = int(np.flatnonzero(RESULT.element_id == 0)[0])
    assert selection_commands.select_point(document, floor).selection == Selection()


def test_that_a_spot_on_the_map_selects_the_dent_there_or_the_profile_beside_it():
    document = selection_commands.select_element(DETECTED, 2)
    dent = RESULT.deformation(1)
    inside = selection_commands.select_spot(document, dent.chainage + 0.02, dent.clock - 0.1)
    assert inside.selection.deformation_id == 1
    opposite = selection_commands.select_spot(document, dent.chainage, dent.clock + np.pi)
    assert opposite.selection.deformation_id == 0
    assert opposite.selection.profile == nearest_profile(RESULT, 2, dent.chainage)


def test_that_stepping_through_profiles_stops_at_the_ends():
    document = selection_commands.select_profile(
        selection_commands.select_element(DETECTED, 2), 0, 0
    )
    assert selection_commands.step_profile(document, -1).selection.profile == ProfileKey(0, 0)
    for _ in range(1000):
        document = selection_commands.step_profile(document, 1)
    last = RESULT.profiles.of_element(2, 0).profile_index[-1]
    assert document.selection.profile == ProfileKey(0, last)


def test_that_stepping_from_a_dent_begins_at_its_peak():
    document = selection_commands.step_profile(
        selection_commands.select_deformation(DETECTED, 1), 1
    )
    rows = RESULT.profiles.of_element(2, 0)
    row = rows.profile_index == document.selection.profile.profile_index
    assert 0 < rows.chainage[row][0] - RESULT.deformation(1).chainage < 0.03
    assert document.selection.deformation_id == 1


def test_that_deformations_are_stepped_through_by_verdict_and_round_again():
    document, seen = DETECTED, []
    for _ in range(5):
        document = selection_commands.step_deformation(document, 1)
        seen.append(document.selection.deformation_id)
    assert seen[0] == seen[4] == 1
    assert sorted(seen[:4]) == [1, 2, 3, 4]


def test_that_isolating_a_run_hides_everything_else():
    document = commands.isolate(selection_commands.select_run(DETECTED, 3))
    assert document.view.hidden_elements == {1, 2, 3, 4, 5, 6, 7}
    assert commands.show_all(document).view.hidden_elements == frozenset()


def test_that_a_setting_out_of_bounds_is_refused():
    with pytest.raises(SettingsError):
        commands.change_settings(DETECTED, {"ellipses.min_arc_deg": 1000.0})


def test_that_own_stacks_are_added_edited_and_removed_and_survive_a_reset():
    document = commands.add_stack(DETECTED, (1.0, 1.0, 0.0))
    document = commands.add_stack(document, (0.0, 0.0, 1.0, 30.0))
    document = commands.edit_stack(document, 0, (1.0, 0.0, 0.0, 15.0))
    document = commands.reset_settings(
        commands.change_settings(document, {"elements.min_radius_mm": 40.0})
    )
    assert document.settings.stacks.directions == ((1.0, 0.0, 0.0, 15.0), (0.0, 0.0, 1.0, 30.0))
    assert document.settings.elements == Settings().elements
    document = commands.remove_stack(document, 0)
    assert document.settings.stacks.directions == ((0.0, 0.0, 1.0, 30.0),)


def test_that_undo_takes_back_work_but_not_where_one_looks():
    history = History(DETECTED)
    history.do(commands.change_settings, {"elements.min_radius_mm": 40.0})
    history.do(selection_commands.select_deformation, 1)
    history.do(commands.set_view, show_axes=False)
    assert history.undo_text == "Change settings"
    history.undo()
    assert history.document.settings == Settings()
    assert history.document.selection.deformation_id == 1
    assert not history.document.view.show_axes
    history.redo()
    assert history.document.settings.elements.min_radius_mm == 40.0


def test_that_looking_around_is_no_step():
    history = History(DETECTED)
    for command, argument in (
        (selection_commands.select_element, 2),
        (commands.set_colour, ColourBy.KIND),
        (commands.show_stack, 1),
        (selection_commands.step_deformation, 1),
    ):
        history.do(command, argument)
    assert history.undo_text == ""


def test_that_undoing_a_detection_lets_its_selection_and_colours_go():
    opened = Document(scans=(Scan("plant.laz", CLOUD),))
    history = History(opened)
    history.do(commands.set_result, CLOUD, RESULT)
    history.undo()
    assert history.document.selection == Selection()
    assert history.document.view.colour_by in commands.colours_of(history.document.scan)
    history.redo()
    assert history.document.result is RESULT


def test_that_a_new_step_forgets_what_was_undone():
    history = History(DETECTED)
    history.do(commands.set_hidden, [1], True)
    history.undo()
    history.do(commands.set_hidden, [2], True)
    assert history.redo_text == ""
    assert history.document.view.hidden_elements == {2}


def test_that_every_kind_of_deformation_keeps_its_element_selected():
    for deformation in RESULT.deformations:
        document = selection_commands.select_deformation(DETECTED, deformation.deformation_id)
        assert document.selection.element_id == deformation.element_id
    assert {d.kind for d in RESULT.deformations} >= {DeformationKind.DENT, DeformationKind.BULGE}


def test_that_reviews_are_steps_of_the_history_and_leave_the_result_alone():
    history = History(DETECTED)
    history.do(commands.set_review, [1, 3], ReviewState.ACCEPTED)
    history.do(commands.set_comment, 3, "  seen on site ")
    scan = history.document.scan
    assert scan.reviews == {
        1: Review(ReviewState.ACCEPTED),
        3: Review(ReviewState.ACCEPTED, "seen on site"),
    }
    assert scan.result is RESULT
    assert history.steps == ["Review", "Comment"]
    history.undo()
    history.undo()
    assert history.document.scan.reviews == {}


def test_that_a_review_that_changes_nothing_is_no_step():
    history = History(DETECTED)
    history.do(commands.set_review, [2], ReviewState.OPEN)
    assert history.steps == []


def test_that_reviews_follow_their_deformations_through_another_detection():
    document = commands.set_review(DETECTED, [1, 3], ReviewState.REJECTED)
    fewer = shuffled_result()
    gone = [d for d in fewer.deformations if d.deformation_id != 3]
    renumbered = tuple(replace(d, deformation_id=i) for i, d in enumerate(reversed(gone), start=1))
    again = commands.set_result(document, CLOUD, replace(fewer, deformations=renumbered))
    assert again.scan.reviews == {3: Review(ReviewState.REJECTED)}
    assert again.result.deformation(3).peak == pytest.approx(RESULT.deformation(1).peak)


def test_that_another_scan_is_not_clipped_by_the_box_of_the_first():
    document = commands.set_view(DETECTED, clip_box=ClipBox((0, 0, 0), (1, 1, 1)))
    assert commands.open_scan(document, Scan("b", CLOUD)).view.clip_box is None


def test_that_a_cloud_without_pipes_keeps_its_colours():
    document = commands.open_scan(Document(), Scan("a", CLOUD))
    document = commands.set_colour(document, ColourBy.HEIGHT)
    nothing = replace(RESULT, elements=(), deformations=())
    assert commands.set_result(document, CLOUD, nothing).view.colour_by is ColourBy.HEIGHT
