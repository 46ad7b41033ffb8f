"""Straight and circular axes among ellipse centres, against their geometry."""

import numpy as np
import pytest

from pipecore._kernels import pieces as kernels
from pipecore.geometry import ArcAxis, LineAxis
from tests.core.shapes import random_direction, random_rotation

# Random numbers wrap around on purpose, which plain numpy warns of.
pytestmark = [pytest.mark.kernels, pytest.mark.filterwarnings("ignore:overflow encountered")]

MIN_COS = np.cos(np.radians(12.0))


def test_that_an_ellipse_is_on_a_line_if_place_direction_and_radius_agree(rng):
    verdicts = []
    for _ in range(300):
        line = LineAxis(rng.normal(size=3), random_direction(rng), 1.0)
        radius, slope, sd = 0.1, rng.choice([0.0, 0.2]), rng.choice([0.0, 0.001])
        s, tilt = rng.uniform(-0.5, 0.5), rng.uniform(0, np.radians(20))
        up, right = line.frame(s)
        off = rng.uniform(0, 0.02)
        expected = radius + slope * s
        r = expected * (1 + rng.uniform(-0.12, 0.12))
        axis = np.cos(tilt) * line.direction + np.sin(tilt) * right
        axis *= rng.choice([-1, 1])
        found = kernels.on_line(
            *(line.at(s) + off * up), *axis, r, sd, *line.start, *line.direction,
            radius, slope, MIN_COS, 0.06, 0.06,
        )  # fmt: skip
        true = (
            tilt <= np.radians(12.0)
            and abs(r - expected) <= 0.06 * expected + 2 * sd
            and off <= 0.06 * expected + 2 * min(sd, 0.03 * expected)
        )
        assert found == true
        verdicts.append(true)
    assert 20 < sum(verdicts) < 280


def test_that_an_ellipse_is_on_an_arc_if_place_direction_and_radius_agree(rng):
    verdicts = []
    for _ in range(300):
        q = random_rotation(rng)
        arc = ArcAxis(rng.normal(size=3), q[2], q[0], 0.3, 2.0)
        radius, sd = 0.1, rng.choice([0.0, 0.001])
        s, tilt = rng.uniform(0, 0.6), rng.uniform(0, np.radians(20))
        up, _ = arc.frame(s)
        off = rng.uniform(0, 0.02)
        r = radius * (1 + rng.uniform(-0.12, 0.12))
        axis = np.cos(tilt) * arc.tangent(s) + np.sin(tilt) * up
        found = kernels.on_arc(
            *(arc.at(s) + off * up), *axis, r, sd, *arc.centre, *arc.normal, 0.3, radius,
            MIN_COS, 0.06, 0.06,
        )  # fmt: skip
        true = (
            tilt <= np.radians(12.0)
            and abs(r - radius) <= 0.06 * radius + 2 * sd
            and off <= 0.06 * radius + 2 * min(sd, 0.03 * radius)
        )
        assert found == true
        verdicts.append(true)
    assert 20 < sum(verdicts) < 280


def scattered(rng, n):
    """Ellipses of no common axis."""
    axes = np.array([random_direction(rng) for _ in range(n)])
    return rng.uniform(-1, 1, (n, 3)), axes, rng.uniform(0.03, 0.2, n)


def both(planted, stray):
    return [np.concatenate(p) for p in zip(planted, stray, strict=True)]


@pytest.mark.parametrize("slope", [0.0, 0.25])
def test_that_the_line_with_most_ellipses_is_found_among_strays(rng, slope):
    line = LineAxis(rng.normal(size=3), random_direction(rng), 0.6)
    s = np.linspace(0, 0.6, 25)
    planted = line.at(s), np.tile(line.direction, (25, 1)), 0.1 + slope * s
    centre, axis, radius = both(planted, scattered(rng, 15))
    inliers = np.empty(40, np.bool_)
    count = kernels.best_line(
        centre, axis, radius, np.full(40, 1e-4), np.ones(40, np.bool_), 150, bool(slope),
        MIN_COS, 0.06, 0.06, inliers,
    )  # fmt: skip
    assert count == inliers.sum()
    assert inliers[:25].all()
    assert inliers[25:].sum() <= 2


def test_that_the_arc_with_most_ellipses_is_found_with_its_centre_and_bend_radius(rng):
    q = random_rotation(rng)
    bend = ArcAxis(rng.normal(size=3), q[2], q[0], 0.3, np.pi / 2)
    s = np.linspace(0, bend.length, 25)
    planted = bend.at(s), np.array(bend.tangent(s)), np.full(25, 0.1)
    centre, axis, radius = both(planted, scattered(rng, 15))
    inliers, arc = np.empty(40, np.bool_), np.empty(8)
    count = kernels.best_arc(
        centre, axis, radius, np.full(40, 1e-4), np.ones(40, np.bool_), 300,
        MIN_COS, 0.06, 0.06, inliers, arc,
    )  # fmt: skip
    assert count == inliers.sum()
    assert inliers[:25].all()
    assert np.linalg.norm(arc[:3] - bend.centre) < 1e-9
    assert abs(arc[3:6] @ bend.normal) > 1 - 1e-9
    assert arc[6] == pytest.approx(0.3)


def test_that_taken_ellipses_are_not_found_again(rng):
    line = LineAxis(np.zeros(3), np.array([1.0, 0.0, 0.0]), 0.6)
    centre, axis = line.at(np.linspace(0, 0.6, 10)), np.tile(line.direction, (10, 1))
    inliers, none_free = np.empty(10, np.bool_), np.zeros(10, np.bool_)
    args = centre, axis, np.full(10, 0.1), np.full(10, 1e-4), none_free, 50
    assert kernels.best_line(*args, False, MIN_COS, 0.06, 0.06, inliers) == 0
    assert kernels.best_arc(*args, MIN_COS, 0.06, 0.06, inliers, np.empty(8)) == 0
