"""What is said of a section, without a window."""

from dataclasses import replace

import numpy as np

from pipecore.geometry import surface_points
from pipecore.inspection.section import Section, cut_section
from pipegui.plots.section_texts import section_text
from tests.factories import bump, make_result

RESULT = make_result()
PIPE = RESULT.element(2)
PROFILE = RESULT.profiles.of_element(2, 0)[40:41]
CHAINAGE = float(PROFILE.chainage[0])


def section(height=-0.01, n=240, seen=2 * np.pi, profile=PROFILE) -> Section:
    """A section of the pipe with a dent or bulge at 2:00."""
    clock = np.linspace(0.3, 0.3 + seen, n, endpoint=False)
    shape = bump(CHAINAGE, 1.0, height, 0.3, np.deg2rad(100))
    noise = np.random.default_rng(3).normal(0, 0.001, n)
    radius = PIPE.radius + shape(np.full(n, CHAINAGE), clock) + noise
    xyz = surface_points(PIPE.axis, np.full(n, CHAINAGE), radius, clock)
    return cut_section(PIPE, profile, xyz)


def test_that_a_dent_has_a_depth_and_a_bulge_a_height_with_their_clock():
    text = section_text(section())
    assert "Dmax" in text
    assert "Dmin" in text
    assert "Depth" in text
    assert "mm at 1:" in text or "mm at 2:" in text
    assert "Height" in section_text(section(height=0.01))


def test_that_a_section_seen_from_one_side_has_no_diameters():
    half = RESULT.profiles.of_element(9, 0)[:1]
    assert "diameters not measurable" in section_text(section(seen=2.6, profile=half))


def test_that_a_radius_that_is_not_the_pipes_is_not_shown():
    beside = replace(
        PROFILE, centre_deviation=0.4 * PROFILE.semi_minor, arc=np.array([np.deg2rad(90)])
    )
    assert "Radius not measurable" in section_text(section(seen=1.5, profile=beside))
    assert "Radius not measurable" not in section_text(section())


def test_that_a_section_says_why_it_has_no_curve():
    assert "no fitted curve: only 8 points" in section_text(section(n=8))
