"""“No pipes found” says why: one scan for each cause."""

import numpy as np
import pytest

import pipecore
from pipecore.geometry import LineAxis
from pipecore.settings import ElementSettings, Settings
from tests.core.shapes import cloud_of, plane, tube

AXIS = LineAxis(np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0]), 1.0)


def pipes(spacing=0.005, noise=0.0005, length=1.0, radius=0.08):
    rng = np.random.default_rng(8)
    axis = LineAxis(AXIS.start, AXIS.direction, length)
    return cloud_of(tube(rng, axis, radius, spacing=spacing, noise=noise)).xyz


def walls():
    rng = np.random.default_rng(9)
    return cloud_of(
        plane(rng, (0, 0, 0), (2, 0, 0), (0, 2, 0)), plane(rng, (0, 0, 0), (0, 2, 0), (0, 0, 2))
    ).xyz


CAUSES = {
    "unit too large": (1e3 * pipes(), Settings(), "length unit to mm"),
    "unit too small": (1e-3 * pipes(), Settings(), "length unit to m."),
    "too thin": (pipes(), Settings(elements=ElementSettings(min_radius_mm=90)), "smallest radius"),
    "too thin by far": (
        pipes(),
        Settings(elements=ElementSettings(min_radius_mm=200)),
        "smallest and the largest radius wider",
    ),
    "too wide": (pipes(), Settings(elements=ElementSettings(max_radius_mm=75)), "largest radius"),
    "short": (
        pipes(length=0.5),
        Settings(elements=ElementSettings(min_length_mm=800)),
        "shortest pipe",
    ),
    "noise": (pipes(noise=0.02), Settings(), "scatter by"),
    "spacing": (pipes(spacing=0.1), Settings(), "denser scan"),
    "nothing round": (walls(), Settings(), "nothing in the scan is round"),
}


@pytest.mark.parametrize("cause", CAUSES)
def test_that_an_empty_result_says_what_to_change(cause):
    points, settings, advice = CAUSES[cause]
    result = pipecore.detect(points, settings)
    assert not result.elements
    (note,) = [n for n in result.notes if n.startswith("No pipes found")]
    assert advice in note


def test_that_nothing_is_said_where_something_is_found():
    result = pipecore.detect(pipes())
    assert len(result.elements) == 1
    assert not [n for n in result.notes if "No pipes found" in n]
