"""Sections as they are cut and dimensioned, without a window."""

from dataclasses import replace

import numpy as np
import pytest

from pipecore.geometry import surface_points
from pipegui.plots.dimensions import clock_of, curve_points, dimensions, dimensions_text
from pipegui.plots.exaggeration import deviations
from pipegui.states.section import SectionCut, cut_section
from tests.factories import bump, make_result, oval

RESULT = make_result()
PIPE = RESULT.element(2)
PROFILE = RESULT.profiles.of_element(2, 0)[40:41]
CHAINAGE = float(PROFILE.chainage[0])
SD = 0.001
ALL_ROUND, ONE_SIDE = (0.0, 2 * np.pi), (0.3, 2.9)


def cut(shape, seen=ALL_ROUND, n=240, seed=3) -> SectionCut:
    """A section of the pipe with a shape known exactly, seen over some clock angles."""
    rng = np.random.default_rng(seed)
    clock = np.linspace(*seen, n, endpoint=False)
    chainage = CHAINAGE + rng.uniform(-0.01, 0.01, n)
    radius = PIPE.radius + shape(np.full(n, CHAINAGE), clock) + rng.normal(0, SD, n)
    return cut_section(PIPE, PROFILE, surface_points(PIPE.axis, chainage, radius, clock))


def dented(depth, clock=1.0):
    return bump(CHAINAGE, clock, -depth, 0.3, np.deg2rad(100))


def found(section, name):
    return next((d for d in dimensions(section) if d.name == name), None)


@pytest.mark.parametrize("depth", [0.008, 0.015])
@pytest.mark.parametrize("seen", [ALL_ROUND, ONE_SIDE])
def test_that_the_depth_of_a_dented_section_is_that_of_the_dent(depth, seen):
    section = cut(dented(depth), seen)
    found_depth = found(section, "Depth")
    # A smooth series rounds the dent's bottom off a little.
    assert found_depth.value_mm == pytest.approx(1000 * depth, abs=3 * found_depth.sd_mm + 0.5)
    off = (clock_of(found_depth.ends_uv[1], section.reference) - 1.0 + np.pi) % (2 * np.pi) - np.pi
    assert abs(off) < np.deg2rad(6)
    length = np.linalg.norm(found_depth.ends_uv[1] - found_depth.ends_uv[0])
    assert length == pytest.approx(found_depth.value_mm, rel=1e-6)
    assert deviations(found_depth.ends_uv[:1], section.reference) == pytest.approx(0, abs=1e-6)


def test_that_an_ellipse_through_little_but_a_dent_is_not_the_pipes():
    aside = PROFILE.centre + 0.4 * PIPE.radius * np.cross(PIPE.axis.tangent(CHAINAGE), [0, 0, 1.0])
    section = cut(dented(0.01), ONE_SIDE)
    assert not section.is_askew
    for arc, is_askew in ((np.deg2rad(90), True), (np.deg2rad(300), False)):
        askew = replace(PROFILE, centre=aside, arc=np.array([arc]))
        section = cut_section(
            PIPE,
            askew,
            surface_points(
                PIPE.axis, np.array([CHAINAGE] * 9), PIPE.radius, np.linspace(0.3, 1.8, 9)
            ),
        )
        assert section.is_askew == is_askew
        assert ("Radius not measurable" in dimensions_text(askew, section)) == is_askew


def test_that_a_bulge_has_a_height_and_a_clean_pipe_neither():
    assert found(cut(dented(-0.01)), "Height").value_mm == pytest.approx(10, abs=1)
    clean = cut(oval(CHAINAGE, 1.0, 0.0, 0.0))
    assert [d.name for d in dimensions(clean)][:2] == ["Dmax", "Dmin"]
    for dimension in dimensions(clean)[:2]:
        assert dimension.value_mm == pytest.approx(2000 * PIPE.radius, abs=3 * dimension.sd_mm)


def test_that_the_diameters_of_an_oval_section_lie_where_it_is_oval():
    section = cut(oval(CHAINAGE, 1.0, 0.003, 0.5))
    largest, smallest = found(section, "Dmax"), found(section, "Dmin")
    assert largest.value_mm == pytest.approx(2000 * PIPE.radius + 6, abs=4 * largest.sd_mm)
    assert smallest.value_mm == pytest.approx(2000 * PIPE.radius - 6, abs=4 * smallest.sd_mm)
    for dimension, clock in ((largest, 0.5), (smallest, 0.5 + np.pi / 2)):
        at = clock_of(dimension.ends_uv[0], section.reference)
        assert abs(np.sin(at - clock)) < np.sin(np.deg2rad(10))
        length = np.linalg.norm(dimension.ends_uv[1] - dimension.ends_uv[0])
        assert length == pytest.approx(dimension.value_mm, rel=1e-6)


def test_that_a_section_seen_from_one_side_has_no_diameters():
    section = cut(dented(0.01), ONE_SIDE)
    assert found(section, "Dmax") is None
    half = RESULT.profiles.of_element(9, 0)[:1]
    assert "diameters not measurable" in dimensions_text(half, section)
    assert "Dmax" in dimensions_text(PROFILE, cut(dented(0.01)))


def test_that_the_curve_lies_on_the_true_section_and_ends_where_nothing_was_seen():
    shape = dented(0.01)
    section = cut(shape, ONE_SIDE)
    assert section.curve.noise == pytest.approx(SD, rel=0.2)
    drawn = np.concatenate(curve_points(section))
    clocks = np.array([clock_of(p, section.reference) for p in drawn])
    assert clocks.min() == pytest.approx(ONE_SIDE[0], abs=0.03)
    assert clocks.max() == pytest.approx(ONE_SIDE[1], abs=0.03)
    inside = (clocks > ONE_SIDE[0] + 0.2) & (clocks < ONE_SIDE[1] - 0.2)
    truth = 1000 * shape(np.full(len(clocks), CHAINAGE), clocks)
    off = deviations(drawn, section.reference) - truth
    assert np.abs(off[inside]).max() < 1.2


def test_that_points_too_few_for_a_curve_are_told():
    section = cut(dented(0.01), n=8)
    assert section.curve is None
    assert curve_points(section) == []
    assert "no fitted curve: only 8 points" in dimensions_text(PROFILE, section)
