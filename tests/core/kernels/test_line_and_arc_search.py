"""Straight and circular axes among ellipse centres, against their geometry."""

import numpy as np
import pytest

from pipecore._kernels import arc_search, line_search, random_draws
from pipecore._kernels.line_search import AxisEllipses, PieceLimits
from pipecore.geometry import ArcAxis, LineAxis
from tests.core.shapes import random_direction, random_rotation

# Random numbers wrap around on purpose, which plain numpy warns of.
pytestmark = [pytest.mark.kernels, pytest.mark.filterwarnings("ignore:overflow encountered")]

LIMITS = PieceLimits(np.cos(np.radians(12.0)), 0.06, 0.06)


def ellipses(*columns):
    """Ellipses as the kernels take them."""
    return AxisEllipses(*(np.atleast_1d(column) for column in columns))


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
        one = ellipses([line.at(s) + off * up], [axis], r, sd)
        numbers = np.array([*line.start, *line.direction, radius, slope])
        found = line_search.on_line(one, 0, numbers, LIMITS)
        true = (
            tilt <= np.radians(12.0)
            and abs(r - expected) <= 0.06 * expected + 2 * sd
            and off <= 0.06 * expected + 2 * min(sd, 0.03 * expected)
        )
        assert found == true
        verdicts.append(true)
    assert 5 < sum(verdicts) < 280


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
        one = ellipses([arc.at(s) + off * up], [axis], r, sd)
        numbers = np.array([*arc.centre, *arc.normal, 0.3, radius])
        found = arc_search.on_arc(one, 0, numbers, LIMITS)
        true = (
            tilt <= np.radians(12.0)
            and abs(r - radius) <= 0.06 * radius + 2 * sd
            and off <= 0.06 * radius + 2 * min(sd, 0.03 * radius)
        )
        assert found == true
        verdicts.append(true)
    assert 5 < sum(verdicts) < 280


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
    count = line_search.best_line(
        ellipses(centre, axis, radius, np.full(40, 1e-4)), np.ones(40, np.bool_), 150,
        bool(slope), LIMITS, inliers,
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
    count = arc_search.best_arc(
        ellipses(centre, axis, radius, np.full(40, 1e-4)), np.ones(40, np.bool_), 300, LIMITS,
        inliers, arc,
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
    args = ellipses(centre, axis, np.full(10, 0.1), np.full(10, 1e-4)), none_free, 50
    assert line_search.best_line(*args, False, LIMITS, inliers) == 0
    assert arc_search.best_arc(*args, LIMITS, inliers, np.empty(8)) == 0


@pytest.mark.parametrize("slope", [0.0, 0.25])
def test_that_straight_pieces_are_taken_with_their_radii_extents_and_tapers(rng, slope):
    pipes = [LineAxis(rng.normal(size=3), random_direction(rng), length) for length in (0.9, 0.5)]
    s = [np.linspace(0.0, line.length, n) for line, n in zip(pipes, (40, 20), strict=True)]
    planted = [
        (line.at(x), np.tile(line.direction, (len(x), 1)), 0.1 + slope * x)
        for line, x in zip(pipes, s, strict=True)
    ]
    centre, axis, radius = both(both(*planted), scattered(rng, 15))
    piece = np.empty(75, np.int32)

    def take(is_tapered, min_length):
        return line_search.take_lines(
            ellipses(centre, axis, radius, np.full(75, 1e-4)), 300, is_tapered,
            LIMITS._replace(min_length=min_length), 0.02, piece,
        )  # fmt: skip

    found = take(bool(slope), 0.5)
    assert len(found) == 2
    assert (piece[:40] == 0).all()
    assert (piece[40:60] == 1).all()
    assert (piece[60:] == -1).sum() >= 13
    for line, x, row in zip(pipes, s, found, strict=True):
        along = (row[:3] - line.start) @ line.direction
        sign = np.sign(row[3:6] @ line.direction)
        assert abs(row[3:6] @ line.direction) > 1 - 1e-6
        assert np.linalg.norm(row[:3] - line.at(along)) < 1e-3
        assert row[6] == pytest.approx(0.1 + slope * along, rel=1e-2)
        assert row[7] == pytest.approx(sign * slope, abs=1e-2)
        assert row[9] - row[8] == pytest.approx(x[-1] + 0.02, abs=0.05)
    # What is shorter than asked for, or tapers otherwise than asked for, is none.
    assert len(take(bool(slope), 20.0)) == 0
    assert (piece == -1).all()
    assert slope or len(take(not slope, 0.5)) == 0


def test_that_the_longest_part_is_that_with_most_entries_and_no_gap(rng):
    along = np.concatenate([np.linspace(0, 1, 11), np.linspace(1.5, 2, 21), np.linspace(3, 5, 5)])
    order = rng.permutation(len(along))
    part = line_search.longest_part(along[order], 0.3)
    assert along[order][part].tolist() == along[11:32].tolist()
    assert len(line_search.longest_part(along[order], 1.1)) == len(along)


def test_that_half_of_the_weight_is_below_the_weighted_median(rng):
    values, weights = rng.normal(size=41), rng.uniform(0.1, 2, 41)
    median = line_search.weighted_median(values, weights)
    assert weights[values < median].sum() < weights.sum() / 2 <= weights[values <= median].sum()


@pytest.mark.parametrize("draw", [random_draws.draw, random_draws.draw_fast])
def test_that_draws_are_below_their_bound_and_even(draw):
    state = random_draws.seeded(5)
    counts = np.zeros(7, int)
    for _ in range(7000):
        state, i = draw(state, 7)
        counts[i] += 1
    assert abs(counts - 1000).max() < 150
    assert random_draws.seeded(5) != random_draws.seeded(6)
