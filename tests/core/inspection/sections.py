"""Sections of a pipe whose shape is known exactly."""

import numpy as np

from pipecore.geometry import surface_points
from pipecore.inspection.section import Section, cut_section
from tests.factories import bump, make_result

RESULT = make_result()
PIPE = RESULT.element(2)
PROFILE = RESULT.profiles.of_element(2, 0)[40:41]
CHAINAGE = float(PROFILE.chainage[0])
SD = 0.001
ALL_ROUND, ONE_SIDE = (0.0, 2 * np.pi), (0.3, 2.9)


def cut(shape, seen=ALL_ROUND, n=240, profile=PROFILE, rng=None) -> Section:
    """A section of the pipe with a shape known exactly, seen over some clock angles."""
    rng = rng or np.random.default_rng(3)
    clock = np.linspace(*seen, n, endpoint=False)
    chainage = CHAINAGE + rng.uniform(-0.01, 0.01, n)
    radius = PIPE.radius + shape(np.full(n, CHAINAGE), clock) + rng.normal(0, SD, n)
    return cut_section(PIPE, profile, surface_points(PIPE.axis, chainage, radius, clock))


def dented(depth, clock=1.0):
    return bump(CHAINAGE, clock, -depth, 0.3, np.deg2rad(100))
