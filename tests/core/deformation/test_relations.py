from dataclasses import replace

import numpy as np
import pytest

from pipecore.deformation import relate_deformations
from pipecore.geometry import ArcAxis, LineAxis, surface_points
from pipecore.types import NO_ID, Deformation, DeformationKind, Element, ElementKind

R = 0.1
NAN3 = np.full(3, np.nan)


def element(number, axis, kind=ElementKind.CYLINDER, run=1):
    return Element(number, run, kind, axis, R, 1e-4, R, NAN3, 100, 10, 3.0, 0.002)


def line(start, end):
    return LineAxis.between(start, end)


def dent(number, on: Element, chainage, clock=0.0, kind=DeformationKind.DENT, size=0.1):
    return Deformation(
        number,
        on.element_id,
        kind,
        chainage,
        chainage - size / 2,
        chainage + size / 2,
        clock,
        surface_points(on.axis, chainage, R, clock),
        0.01,
        0.001,
        size,
        size,
    )


@pytest.fixture
def run():
    """A flange, 2 m of pipe, a bend to +Y with a radius of 0.3 m, and 1 m of pipe, reversed."""
    bend = ArcAxis(
        centre=np.array([2.0, 0.3, 0.0]),
        normal=np.array([0.0, 0.0, 1.0]),
        towards_start=np.array([0.0, -1.0, 0.0]),
        bend_radius=0.3,
        bend_angle=np.pi / 2,
    )
    return (
        element(1, line([-0.03, 0, 0], [0, 0, 0]), ElementKind.FLANGE),
        element(2, line([0, 0, 0], [2, 0, 0])),
        element(3, bend, ElementKind.TORUS),
        element(4, line([2.3, 1.3, 0], [2.3, 0.3, 0])),
        element(5, line([0, 5, 0], [2, 5, 0]), run=2),
    )


def test_that_the_nearest_fitting_is_found_along_the_run(run):
    near_flange, near_bend, beyond = relate_deformations(
        [dent(1, run[1], 0.4), dent(2, run[1], 1.7), dent(3, run[3], 0.75)], run
    )
    assert near_flange.fitting_id == 1
    assert near_flange.fitting_distance == pytest.approx(0.4)
    assert near_bend.fitting_id == 3
    assert near_bend.fitting_distance == pytest.approx(0.3)
    assert beyond.fitting_id == 3
    assert beyond.fitting_distance == pytest.approx(0.25)


def test_that_a_dent_on_a_bend_lies_on_the_fitting(run):
    (found,) = relate_deformations([dent(1, run[2], 0.2)], run)
    assert found.fitting_id == 3
    assert found.fitting_distance == 0.0


def test_that_a_run_without_fittings_has_none_near(run):
    (found,) = relate_deformations([dent(1, run[4], 0.5)], run)
    assert found.fitting_id == NO_ID
    assert np.isnan(found.fitting_distance)
    assert found.next_id == NO_ID
    assert not found.interacts


def test_that_dents_interact_within_a_diameter_from_edge_to_edge(run):
    for gap, interacts in ((0.19, True), (0.21, False)):
        first, second = relate_deformations(
            [dent(1, run[1], 0.5), dent(2, run[1], 0.5 + 0.1 + gap)], run
        )
        assert first.next_id == 2
        assert second.next_id == 1
        assert first.next_distance == pytest.approx(gap)
        assert second.next_distance == pytest.approx(gap)
        assert first.interacts is second.interacts is interacts


def test_that_the_distance_goes_round_the_pipe_too(run):
    (first, _) = relate_deformations(
        [dent(1, run[1], 0.5, 0.1), dent(2, run[1], 0.5, 2 * np.pi - 1.4)], run
    )
    assert first.next_distance == pytest.approx(1.5 * R - 0.1)


def test_that_overlapping_dents_are_not_apart(run):
    first, _ = relate_deformations([dent(1, run[1], 0.5), dent(2, run[1], 0.55)], run)
    assert first.next_distance == 0.0
    assert first.interacts


def test_that_the_nearest_of_several_dents_is_named_and_other_runs_are_left_out(run):
    found = relate_deformations(
        [
            dent(1, run[1], 0.5),
            dent(2, run[1], 1.0, kind=DeformationKind.BULGE),
            dent(3, run[1], 1.9),
            dent(4, run[4], 0.6),
            dent(5, run[1], 0.6, kind=DeformationKind.OVALITY),
        ],
        run,
    )
    assert [d.next_id for d in found] == [2, 1, 2, NO_ID, NO_ID]
    # An oval stretch has a fitting near like any other.
    assert found[4].fitting_id == 1


def test_that_dents_on_both_sides_of_a_bend_are_as_far_apart_as_the_run_between(run):
    first, second = relate_deformations([dent(1, run[1], 1.8), dent(2, run[3], 0.8)], run)
    way = 0.2 + 0.3 * np.pi / 2 + 0.2
    assert first.next_distance == pytest.approx(way - 0.1, abs=1e-6)
    assert second.next_distance == pytest.approx(way - 0.1, abs=1e-6)


def test_that_clock_positions_go_on_through_straights_that_run_against_each_other(run):
    against = element(6, line([5, 0, 0], [2.05, 0, 0]))
    straight = (run[0], run[1], *run[3:], against)
    straight = tuple(replace(e, element_id=i) for i, e in enumerate(straight, start=1))
    # 3:00 on the one is 9:00 on the other, seen from its other end.
    first, _ = relate_deformations(
        [dent(1, straight[1], 1.95, np.pi / 2), dent(2, straight[4], 2.9, 3 * np.pi / 2)], straight
    )
    assert first.next_id == 2
    assert first.next_distance == pytest.approx(0.15 - 0.1, abs=1e-6)


def test_that_a_branch_hangs_on_its_run(run):
    branch = element(6, line([1.0, 0.1, 0], [1.0, 1.1, 0]))
    elements = (*run, branch)
    (found,) = relate_deformations([dent(1, branch, 0.3)], elements)
    # To the axis of the run, then to the bend or the flange, whichever is nearer.
    assert found.fitting_distance == pytest.approx(0.3 + 0.1 + 1.0, abs=1e-6)
