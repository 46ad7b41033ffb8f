"""Changing results by hand, on a detected scan of known truth."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from pipecore import editing
from pipecore.catalogues import sizes_of
from pipecore.errors import CancelledError, EditError
from pipecore.pipeline import detect
from pipecore.settings import Settings
from pipecore.simulate import Scanner, Scene, SimulatedScan, scan
from pipecore.simulate.scene import Box, Dent, Elbow, Run, Straight
from pipecore.types import NO_ID, OWN_STACK, DeformationKind, ElementKind, Result

RADIUS, THIN = 0.084, 0.057
DEPTH = 0.012
GAP = 1.6  # more than the detection joins across


def plant(seed: int) -> Scene:
    """A dented run with a bend, and a pipe of which a cabinet's place shows nothing."""
    dented = Run(
        (0.0, 0.0, 0.9),
        (1.0, 0.0, 0.0),
        RADIUS,
        (
            Straight(1.3, (Dent(0.9, 270.0, DEPTH, 0.25, 0.16),)),
            Elbow(90.0, 0.25, (0.0, 1.0, 0.0)),
            Straight(0.6),
        ),
    )
    broken = [
        Run((x, -0.5, 0.5), (1.0, 0.0, 0.0), THIN, (Straight(0.7),)) for x in (0.0, 0.7 + GAP)
    ]
    return Scene(
        (dented, *broken),
        ((0.9, -2.6, 1.4), (2.6, -2.2, 1.2), (0.2, 2.6, 2.0)),
        (Box((0.8, 0.0, -0.05), (6.0, 5.0, 0.1)),),
        Scanner(spacing=0.010, noise=0.0015),
        (432_100.0, 6_201_870.0, 110.0),
        seed=seed,
    )


@pytest.fixture(scope="module")
def simulated(session_seed) -> SimulatedScan:
    return scan(plant(session_seed))


@pytest.fixture(scope="module")
def result(simulated) -> Result:
    return detect(simulated.cloud)


@pytest.fixture(scope="module")
def dented(result) -> int:
    """Id of the dented pipe."""
    return next(d.element_id for d in result.deformations if d.kind is DeformationKind.DENT)


@pytest.fixture(scope="module")
def halves(result) -> list[int]:
    """Ids of the pipe's parts on both sides of the gap."""
    return [e.element_id for e in result.elements if abs(e.radius - THIN) < 0.003]


def assert_sound(result: Result) -> None:
    """Tables and points tell of the same elements."""
    ids = [e.element_id for e in result.elements]
    assert ids == sorted(set(ids))
    assert set(np.unique(result.element_id)) <= {NO_ID, *ids}
    assert set(np.unique(result.profiles.element_id)) <= set(ids)
    assert {d.element_id for d in result.deformations} <= set(ids)
    assert {d.fitting_id for d in result.deformations} <= {NO_ID, *ids}
    numbers = [d.deformation_id for d in result.deformations]
    assert numbers == sorted(set(numbers))
    assert {d.next_id for d in result.deformations} <= {NO_ID, *numbers}
    assert_array_equal(np.isfinite(result.deviation), result.element_id != NO_ID)
    stacks = {OWN_STACK, *(s.stack_id for s in result.stacks)}
    assert set(np.unique(result.profiles.stack_id)) <= stacks
    for e in result.elements:
        rows = result.profiles.of_element(e.element_id, OWN_STACK)
        assert (np.diff(rows.chainage) > 0).all()


def test_that_the_scene_is_what_these_tests_stand_on(result, halves, dented):
    assert len(halves) == 2
    assert result.element(dented).radius == pytest.approx(RADIUS, abs=0.001)


def test_that_deleting_leaves_the_others_as_they_were(result, dented):
    fewer = editing.delete_elements(result, [dented])
    assert_sound(fewer)
    assert [e for e in result.elements if e.element_id != dented] == list(fewer.elements)
    assert not (fewer.element_id == dented).any()
    others = result.element_id != dented
    assert_array_equal(fewer.element_id[others], result.element_id[others])
    assert fewer.edits == (f"deleted Pipe {dented}",)
    assert (result.element_id == dented).any()
    with pytest.raises(EditError):
        editing.delete_elements(fewer, [dented])


def test_that_parts_merged_across_a_gap_are_one_pipe_as_long_as_in_truth(simulated, result, halves):
    merged = editing.merge_elements(simulated.cloud, result, halves[::-1])
    assert_sound(merged)
    assert len(merged.elements) == len(result.elements) - 1
    pipe = merged.element(min(halves))
    parts = [result.element(i) for i in halves]
    assert pipe.axis.length == pytest.approx(1.4 + GAP, abs=0.03)
    assert pipe.radius == pytest.approx(THIN, abs=max(3 * pipe.radius_sd, 0.0003))
    assert pipe.radius_sd < 2 * max(p.radius_sd for p in parts)
    # Each part had left out a little at its ends that now lies within the pipe.
    assert pipe.n_points == pytest.approx(sum(p.n_points for p in parts), rel=0.05)
    assert any(high - low == pytest.approx(GAP, abs=0.05) for low, high in pipe.gaps)
    assert len({e.run_id for e in merged.elements if abs(e.radius - THIN) < 0.003}) == 1
    assert len(merged.profiles.of_element(pipe.element_id, OWN_STACK)) > 40


def test_that_pipes_on_different_lines_or_of_different_size_are_not_merged(
    simulated, result, halves, dented
):
    with pytest.raises(EditError, match="one size"):
        editing.merge_elements(simulated.cloud, result, [dented, halves[0]])
    shifted = result.element(halves[1])
    axis = replace(shifted.axis, start=shifted.axis.start + np.array([0, 0.3, 0]))
    elements = [replace(e, axis=axis) if e.element_id == halves[1] else e for e in result.elements]
    with pytest.raises(EditError, match="one line"):
        editing.merge_elements(simulated.cloud, replace(result, elements=tuple(elements)), halves)
    with pytest.raises(EditError, match="at least two"):
        editing.merge_elements(simulated.cloud, result, halves[:1])


def test_that_a_split_pipe_keeps_its_dent_on_the_right_part(simulated, result, dented):
    whole = result.element(dented)
    dent = next(d for d in result.deformations_of(dented) if d.kind is DeformationKind.DENT)
    cut = whole.axis.length / 2
    split = editing.split_element(simulated.cloud, result, dented, cut)
    assert_sound(split)
    new_id = max(e.element_id for e in split.elements)
    parts = [split.element(dented), split.element(new_id)]
    assert [p.axis.length for p in parts] == pytest.approx([cut, whole.axis.length - cut], abs=1e-3)
    assert sum(p.n_points for p in parts) == pytest.approx(whole.n_points, rel=0.03)
    for part in parts:
        assert part.radius == pytest.approx(RADIUS, abs=max(4 * part.radius_sd, 0.0005))
    owner = parts[int(dent.chainage > cut)]
    [again] = [d for d in split.deformations_of(owner.element_id) if d.kind is DeformationKind.DENT]
    assert again.peak == pytest.approx(dent.peak, abs=0.02)
    assert again.depth == pytest.approx(dent.depth, abs=max(0.15 * dent.depth, 3 * dent.depth_sd))


def test_that_splitting_and_merging_again_gives_back_the_pipe(simulated, result, dented):
    whole = result.element(dented)
    split = editing.split_element(simulated.cloud, result, dented, whole.axis.length / 2)
    new_id = max(e.element_id for e in split.elements)
    back = editing.merge_elements(simulated.cloud, split, [dented, new_id])
    assert_sound(back)
    pipe = back.element(dented)
    assert pipe.radius == pytest.approx(whole.radius, abs=3 * whole.radius_sd)
    assert pipe.axis.start == pytest.approx(whole.axis.start, abs=0.003)
    assert pipe.axis.end == pytest.approx(whole.axis.end, abs=0.003)
    kinds = [d.kind for d in result.deformations_of(dented)]
    assert [d.kind for d in back.deformations_of(dented)] == kinds


@pytest.mark.parametrize("chainage", [-0.1, 0.0, 0.001, 99.0, np.nan])
def test_that_a_pipe_is_not_split_at_or_beyond_its_ends(simulated, result, dented, chainage):
    with pytest.raises(EditError):
        editing.split_element(simulated.cloud, result, dented, chainage)


def test_that_a_bend_is_split_and_merged_on_its_arc(simulated, result):
    bend = next(e for e in result.elements if e.kind is ElementKind.TORUS)
    split = editing.split_element(simulated.cloud, result, bend.element_id, bend.axis.length / 2)
    assert_sound(split)
    new_id = max(e.element_id for e in split.elements)
    back = editing.merge_elements(simulated.cloud, split, [bend.element_id, new_id])
    again = back.element(bend.element_id)
    assert again.kind is ElementKind.TORUS
    assert again.axis.bend_radius == pytest.approx(bend.axis.bend_radius, rel=0.03)
    assert again.axis.length == pytest.approx(bend.axis.length, rel=0.03)


def test_that_a_pipe_called_a_flange_has_no_dents_and_called_a_pipe_has_them_again(
    simulated, result, dented
):
    flange = editing.change_kind(simulated.cloud, result, dented, ElementKind.FLANGE)
    assert_sound(flange)
    assert flange.element(dented).kind is ElementKind.FLANGE
    assert flange.element(dented).nominal is None
    assert not flange.deformations_of(dented)
    pipe = editing.change_kind(simulated.cloud, flange, dented, ElementKind.CYLINDER)
    assert len(pipe.deformations_of(dented)) == len(result.deformations_of(dented))
    assert pipe.element(dented).nominal == result.element(dented).nominal


def test_that_a_straight_cannot_be_called_a_bend(simulated, result, dented):
    with pytest.raises(EditError, match="cannot be"):
        editing.change_kind(simulated.cloud, result, dented, ElementKind.TORUS)


def test_that_a_straight_called_a_reducer_hardly_tapers(simulated, result, halves):
    cone = editing.change_kind(simulated.cloud, result, halves[0], ElementKind.CONE)
    element = cone.element(halves[0])
    assert element.radius_end == pytest.approx(element.radius, rel=0.02)
    assert element.radius_end != element.radius


def test_that_a_size_given_by_hand_is_what_percentages_refer_to(result, dented):
    size = next(s for s in sizes_of("ASME B36.10") if s.outside_diameter > 0.5)
    sized = editing.set_nominal_size(result, dented, size)
    assert sized.element(dented).nominal == size
    assert editing.set_nominal_size(sized, dented, None).element(dented).nominal is None
    # 12 mm are more than 6 % of 168 mm, and less than 6 % of 500 mm.
    [dent] = [d for d in result.deformations_of(dented) if d.kind is DeformationKind.DENT]
    assert sized.deformation(dent.deformation_id).verdict is not dent.verdict


def test_that_a_name_is_shown_until_it_is_taken_back(result, dented):
    named = editing.name_element(result, dented, "  Feed   line ")
    assert named.element(dented).label == "Feed line"
    assert editing.name_element(named, dented, " ").element(dented).label == f"Pipe {dented}"


def test_that_detecting_again_around_a_pipe_finds_it_again_under_its_id(simulated, result, dented):
    cloud = simulated.cloud
    index = editing.points_around(cloud, result, [dented])
    again = editing.detect_again(cloud, result, index, Settings(), replaced=[dented])
    assert_sound(again)
    assert again.element(dented).radius == pytest.approx(RADIUS, abs=0.0005)
    others = [e for e in result.elements if e.element_id != dented]
    assert [e for e in again.elements if e.element_id != dented] == others
    outside = np.setdiff1d(np.arange(len(cloud)), index)
    assert_array_equal(
        again.element_id[outside][result.element_id[outside] != dented],
        result.element_id[outside][result.element_id[outside] != dented],
    )
    assert DeformationKind.DENT in [d.kind for d in again.deformations_of(dented)]


def test_that_detecting_again_in_a_box_takes_the_settings_given(simulated, result, halves):
    part = result.element(halves[0])
    ends = np.stack([part.axis.start, part.axis.end])
    low, high = tuple(ends.min(axis=0) - 0.15), tuple(ends.max(axis=0) + 0.15)
    index = editing.points_in_box(simulated.cloud, low, high)
    blind = Settings().replace({"elements.min_radius_mm": 200.0})
    none = editing.detect_again(simulated.cloud, result, index, blind)
    assert_sound(none)
    ids = [e.element_id for e in result.elements]
    assert [e.element_id for e in none.elements] == [i for i in ids if i != halves[0]]
    found = editing.detect_again(simulated.cloud, none, index, Settings())
    assert_sound(found)
    new = found.elements[-1]
    assert new.element_id not in [e.element_id for e in none.elements]
    assert new.radius == pytest.approx(THIN, abs=0.0005)


def test_that_a_pipe_that_only_reaches_into_the_box_is_not_found_twice(simulated, result, dented):
    axis = result.element(dented).axis
    low = tuple(axis.at(0.0) - 0.2)
    high = tuple(axis.at(0.35 * axis.length) + 0.2)
    index = editing.points_in_box(simulated.cloud, np.minimum(low, high), np.maximum(low, high))
    again = editing.detect_again(simulated.cloud, result, index, Settings())
    assert_sound(again)
    assert again.element(dented).axis is axis
    assert len(again.elements) == len(result.elements)


def test_that_an_empty_box_is_refused_and_work_can_be_cancelled(simulated, result, halves):
    cloud = simulated.cloud
    nowhere = editing.points_in_box(cloud, (90.0, 90.0, 90.0), (91.0, 91.0, 91.0))
    with pytest.raises(EditError, match="no points"):
        editing.detect_again(cloud, result, nowhere, Settings())

    class Stop:
        def update(self, stage: str, fraction: float) -> None:
            raise CancelledError

    with pytest.raises(CancelledError):
        editing.merge_elements(cloud, result, halves, Stop())


def test_that_a_dent_no_longer_names_a_bend_that_was_deleted(simulated, result, dented):
    bend = next(e.element_id for e in result.elements if e.kind is ElementKind.TORUS)
    dents = [d for d in result.deformations_of(dented) if d.kind is DeformationKind.DENT]
    assert [d.fitting_id for d in dents] == [bend]
    [alone] = editing.delete_elements(result, [bend]).deformations_of(dented)
    assert alone.fitting_id == NO_ID
    assert np.isnan(alone.fitting_distance)


def test_that_a_run_has_a_name_until_it_is_taken_back_or_gone(result, dented):
    run_id = result.element(dented).run_id
    named = editing.name_run(result, run_id, "  Cooling   water ")
    assert named.run_label(run_id) == "Cooling water"
    assert named.edits[-1] == f"named run {run_id} “Cooling water”"
    assert editing.name_run(named, run_id, "").run_label(run_id) == f"Run {run_id}"
    ids = [e.element_id for e in named.elements if e.run_id == run_id]
    assert run_id not in editing.delete_elements(named, ids).run_names
    with pytest.raises(EditError):
        editing.name_run(result, 99, "nobody")


def test_that_the_run_of_merged_pipes_keeps_the_name_that_one_of_them_had(
    simulated, result, halves
):
    first, second = (result.element(i).run_id for i in halves)
    named = editing.name_run(result, second, "Drain")
    merged = editing.merge_elements(simulated.cloud, named, halves)
    assert merged.run_names == {first: "Drain"}


def test_that_what_was_detected_again_tells_its_own_settings(simulated, result, halves, dented):
    other = Settings().replace({"deformation.min_depth_mm": 9.0})
    part, index = halves[0], editing.points_around(simulated.cloud, result, [halves[0]])
    again = editing.detect_again(simulated.cloud, result, index, other, replaced=[part])
    assert again.own_settings == {part: other}
    assert again.settings_of(part) == other
    assert again.settings_of(dented) == result.settings
    # What is made of it is measured with the same; what comes back as it was has none of its own.
    middle = 0.5 * again.element(part).axis.length
    parted = editing.split_element(simulated.cloud, again, part, middle)
    new = parted.elements[-1].element_id
    assert parted.own_settings == {part: other, new: other}
    assert editing.delete_elements(parted, [part]).own_settings == {new: other}
    usual = editing.detect_again(simulated.cloud, again, index, result.settings, replaced=[part])
    assert usual.own_settings == {}
