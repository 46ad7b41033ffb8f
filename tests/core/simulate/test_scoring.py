"""The score judges all our figures, so it must say what is known to be so."""

from dataclasses import replace

import numpy as np
import pytest

from pipecore.geometry import ArcAxis, LineAxis, surface_points
from pipecore.settings import Settings
from pipecore.simulate import Scene, SimulatedScan, scan
from pipecore.simulate.scene import (
    Bow,
    Branch,
    Dent,
    Elbow,
    Flange,
    Reducer,
    Run,
    Scanner,
    Sphere,
    Straight,
    Tee,
)
from pipecore.simulate.scoring import score
from pipecore.types import Deformation, DeformationKind, Element, ElementKind, Profiles, Result

RUN = Run(
    (0.0, 0.0, 1.0),
    (1.0, 0.0, 0.0),
    0.11,
    (
        Straight(1.5, (Dent(0.7, 90.0, 0.012, 0.2, 0.15),)),
        Flange(0.17, 0.024),
        Straight(1.0),
        Elbow(90.0, 0.3, (0.0, 1.0, 0.0)),
        Reducer(0.25, 0.06),
        Straight(1.0, (Bow(0.01, 90.0),)),
        Tee(0.3, Branch((0.0, 0.0, 1.0), 0.05, (Straight(0.6),))),
    ),
)
BALL = Run((-1.0, 0.5, 1.2), (0.0, 0.0, 1.0), 0.0, (Sphere(0.3),))
STATIONS = ((-1.0, -3.0, 1.5), (4.5, -2.0, 1.5), (1.0, 4.0, 1.8), (0.0, 1.0, 4.0))


@pytest.fixture(scope="module")
def simulated() -> SimulatedScan:
    return scan(Scene((RUN, BALL), STATIONS, (), Scanner(spacing=0.01), (5e5, 6e6, 100.0)))


def perfect(simulated: SimulatedScan) -> Result:
    """A result that says all of the truth, about another origin."""
    truth = simulated.truth
    origin = truth.origin + np.array([3.0, -2.0, 1.0])
    shift = truth.origin - origin
    elements = tuple(
        Element(
            e.element_id,
            e.run_id,
            e.kind,
            replace(e.axis, start=e.axis.start + shift)
            if isinstance(e.axis, LineAxis)
            else replace(e.axis, centre=e.axis.centre + shift),
            e.radius,
            1e-4,
            e.radius_end,
            e.centre + shift,
            1000,
            50,
            np.pi,
            0.002,
        )
        for e in truth.elements
    )
    deformations = tuple(
        Deformation(
            d.deformation_id,
            d.element_id,
            d.kind,
            d.chainage,
            d.chainage_start,
            d.chainage_end,
            d.clock,
            d.peak + shift,
            d.depth,
            0.0005,
            d.length,
            d.width,
            d.ovality,
        )
        for d in truth.deformations
    )
    n = len(simulated.cloud)
    return Result(
        Settings(), origin, None, n, (), elements, Profiles.empty(), deformations,
        np.zeros(n, np.int32), np.zeros(n, np.int32), np.zeros(n, np.float32), {},
    )  # fmt: skip


def with_element(result: Result, element_id: int, **changes: object) -> Result:
    return replace(
        result,
        elements=tuple(
            replace(e, **changes) if e.element_id == element_id else e for e in result.elements
        ),
    )


def test_that_the_truth_itself_is_perfect(simulated: SimulatedScan) -> None:
    s = score(perfect(simulated), simulated.truth)
    assert s.recall == s.precision == s.kind_share() == 1.0
    assert s.visible_length > 5.0
    assert s.reported_length == pytest.approx(
        sum(e.axis.length for e in simulated.truth.elements), rel=1e-6
    )
    assert s.worst_radius_error < 1e-9
    assert s.median_axis_error < 1e-9
    assert max(abs(e) for e in s.bend_radius_errors.values()) < 1e-9
    assert set(s.kinds_judged) == set(ElementKind) - {ElementKind.OTHER}
    assert (s.missed, s.false, s.missed_deformations, s.false_deformations) == ((), (), (), ())
    assert all(m.is_kind_right and m.position_error < 1e-6 for m in s.deformations)
    assert len(s.deformations) == 2


def test_that_reversing_an_axis_changes_nothing(simulated: SimulatedScan) -> None:
    result = perfect(simulated)
    turned = replace(
        result,
        elements=tuple(
            replace(e, axis=e.axis.reversed(), radius=e.radius_end, radius_end=e.radius)
            for e in result.elements
        ),
    )
    s = score(turned, simulated.truth)
    assert s.recall == s.precision == s.kind_share() == 1.0


def test_that_an_empty_result_recalls_nothing(simulated: SimulatedScan) -> None:
    s = score(replace(perfect(simulated), elements=(), deformations=()), simulated.truth)
    assert s.recall == 0.0
    assert np.isnan(s.precision)
    assert s.kind_share() == 0.0
    assert len(s.missed) >= 7
    assert {d.kind for d in s.missed_deformations} == {DeformationKind.DENT, DeformationKind.BOW}


def test_that_a_missing_pipe_costs_its_visible_length(simulated: SimulatedScan) -> None:
    result = perfect(simulated)
    pipe = simulated.truth.element(3)
    visible = sum(b - a for a, b in pipe.visible_ranges())
    less = replace(result, elements=tuple(e for e in result.elements if e.element_id != 3))
    s = score(less, simulated.truth)
    assert s.recall == pytest.approx(1 - visible / s.visible_length, abs=0.01 / s.visible_length)
    assert s.precision == 1.0
    (missed,) = s.missed
    assert missed.element_id == 3
    assert missed.end - missed.start == pytest.approx(visible, abs=0.02)


@pytest.mark.parametrize(
    ("offset", "is_found"),
    [(0.014, True), (0.019, False)],  # 0.15 r is 16.5 mm.
)
def test_that_an_axis_may_be_a_little_aside(
    simulated: SimulatedScan, offset: float, is_found: bool
) -> None:
    result = perfect(simulated)
    axis = result.element(1).axis
    moved = replace(axis, start=axis.start + np.array([0.0, 0.0, offset]))
    s = score(with_element(result, 1, axis=moved), simulated.truth)
    assert (s.recall == 1.0) == is_found
    assert (s.precision == 1.0) == is_found
    if is_found:
        errors = np.sort(s.axis_errors)
        assert errors[-1] == pytest.approx(offset)


def test_that_wrong_radii_and_directions_are_not_real(simulated: SimulatedScan) -> None:
    result = perfect(simulated)
    thick = score(with_element(result, 1, radius=0.125, radius_end=0.125), simulated.truth)
    assert thick.recall < 0.8
    assert 1 in {f.element_id for f in thick.false}
    near = score(with_element(result, 1, radius=0.112, radius_end=0.112), simulated.truth)
    assert near.recall == 1.0
    assert near.radius_errors[1] == pytest.approx(0.002)
    assert near.worst_radius_error == pytest.approx(0.002)
    axis = result.element(1).axis
    across = LineAxis(axis.at(0.75) - np.array([0.0, 0.3, 0.0]), np.array([0.0, 1.0, 0.0]), 0.6)
    extra = replace(result, elements=(*result.elements, replace(result.element(1), axis=across)))
    s = score(extra, simulated.truth)
    assert s.recall == 1.0
    assert s.precision == pytest.approx(1 - 0.6 / s.reported_length)


def test_that_a_bowed_pipe_is_found_by_its_chord_and_by_its_bow(simulated: SimulatedScan) -> None:
    result = perfect(simulated)
    bowed = next(d.element_id for d in result.deformations if d.kind is DeformationKind.BOW)
    axis = result.element(bowed).axis
    _, right = axis.frame(0.0)
    # The rule alone allows 9 mm here.
    for offset in (0.0, 0.01, 0.018):
        moved = with_element(result, bowed, axis=replace(axis, start=axis.start + offset * right))
        s = score(moved, simulated.truth)
        assert s.recall == s.precision == 1.0


def test_that_telling_a_pipe_twice_is_told(simulated: SimulatedScan) -> None:
    result = perfect(simulated)
    assert score(result, simulated.truth).doubled_length < 0.05
    twice = replace(result, elements=(*result.elements, result.element(3)))
    s = score(twice, simulated.truth)
    assert s.precision == 1.0
    assert s.doubled_length == pytest.approx(1.0, abs=0.05)


def test_that_a_gap_is_no_claim_and_prolonging_a_pipe_is(simulated: SimulatedScan) -> None:
    result = perfect(simulated)
    axis = result.element(8).axis
    assert isinstance(axis, LineAxis)
    longer = with_element(result, 8, axis=replace(axis, length=axis.length + 0.5))
    s = score(longer, simulated.truth)
    assert s.precision == pytest.approx(1 - 0.5 / s.reported_length, abs=0.002)
    told = with_element(longer, 8, gaps=((axis.length, axis.length + 0.5),))
    assert score(told, simulated.truth).precision == pytest.approx(1.0, abs=0.002)


def test_that_a_bend_told_as_a_pipe_has_the_wrong_kind(simulated: SimulatedScan) -> None:
    result = perfect(simulated)
    bend = next(e for e in result.elements if e.kind is ElementKind.TORUS)
    s = score(with_element(result, bend.element_id, kind=ElementKind.CYLINDER), simulated.truth)
    assert s.recall == 1.0
    assert s.kinds_right.get(ElementKind.TORUS, 0) == 0
    assert s.kind_share() == pytest.approx(1 - 1 / sum(s.kinds_judged.values()))
    assert isinstance(bend.axis, ArcAxis)
    wide = replace(bend.axis, bend_radius=1.02 * bend.axis.bend_radius)
    s = score(with_element(result, bend.element_id, axis=wide), simulated.truth)
    assert s.bend_radius_errors[bend.element_id] == pytest.approx(0.02)


def test_that_a_pipe_told_through_its_flange_is_real_but_no_flange(
    simulated: SimulatedScan,
) -> None:
    result = perfect(simulated)
    start, end = result.element(1).axis.start, result.element(3).axis.end
    through = replace(result.element(1), axis=LineAxis.between(start, end))
    rest = tuple(e for e in result.elements if e.element_id > 3)
    s = score(replace(result, elements=(through, *rest)), simulated.truth)
    assert s.recall == s.precision == 1.0
    assert s.kinds_right.get(ElementKind.FLANGE, 0) == 0
    assert s.kinds_judged[ElementKind.FLANGE] == 1


def test_that_deformations_are_matched_where_they_are(simulated: SimulatedScan) -> None:
    result = perfect(simulated)
    dent = result.deformations[0]
    axis, radius = result.element(1).axis, 0.11

    def at(chainage: float, clock_deg: float, **changes: object) -> Deformation:
        peak = surface_points(axis, chainage, radius, np.deg2rad(clock_deg))
        return replace(dent, peak=peak, **changes)

    def judged(*reported: Deformation):
        bow = result.deformations[1]
        return score(replace(result, deformations=(*reported, bow)), simulated.truth)

    near = judged(at(0.72, 95.0, depth=0.011, length=0.15))
    assert near.deformations[0].depth_error == pytest.approx(-0.001)
    assert near.deformations[0].length_ratio == pytest.approx(0.75)
    assert 0.02 < near.deformations[0].position_error < 0.03
    elsewhere = judged(at(1.3, 90.0))
    assert [d.kind for d in elsewhere.missed_deformations] == [DeformationKind.DENT]
    assert len(elsewhere.false_deformations) == 1
    behind = judged(at(0.7, 270.0))
    assert len(behind.false_deformations) == 1
    twice = judged(at(0.7, 90.0), at(0.75, 90.0))
    assert len(twice.duplicate_deformations) == 1
    assert twice.false_deformations == ()
    bulge = judged(at(0.7, 90.0, kind=DeformationKind.BULGE))
    assert not bulge.deformations[0].is_kind_right


def test_that_hidden_and_shallow_deformations_may_be_missed(simulated: SimulatedScan) -> None:
    result = replace(perfect(simulated), deformations=())
    truth = simulated.truth
    hidden = tuple(replace(d, seen=0.2) for d in truth.deformations)
    assert score(result, replace(truth, deformations=hidden)).missed_deformations == ()
    strict = score(result, truth, min_depth=0.011)
    assert [d.depth for d in strict.missed_deformations] == [0.012]


def test_that_a_score_can_be_read(simulated: SimulatedScan) -> None:
    text = str(score(perfect(simulated), simulated.truth))
    assert "recall 1.000" in text
    assert "dent → dent" in text
