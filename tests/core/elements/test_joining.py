"""Straights that follow each other with hardly a turn are joined to one pipe."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from pipecore.elements.refinement.extent import Extent
from pipecore.elements.refinement.refine import FittedElement
from pipecore.elements.refinement.surface_fits import LineSurface, SurfaceFit
from pipecore.elements.runs.joining import join_straights
from pipecore.geometry import LineAxis, unit
from tests.core.shapes import angle_between, random_rotation

RADIUS, LENGTH, SD, SIGMA = 0.1, 1.0, 1e-5, 0.001


def straight(axis, radius=RADIUS, sd=SD, points=(), slope=0.0):
    """A straight as the refinement leaves it, with a few downsampled points."""
    model = LineSurface(axis.at(axis.length / 2), axis.direction, radius, slope, slope != 0)
    fit = SurfaceFit(model, np.eye(5) * sd**2, SIGMA, 1000)
    extent = Extent(0.0, axis.length, np.pi, 1.0, ())
    return FittedElement(fit, axis, np.array(points, np.intp), extent, 0.0)


class Pair:
    """A straight, and one that follows it after a gap, turned and shifted, in any attitude."""

    def __init__(self, rng, gap=0.0, turn_deg=0.0, length=LENGTH):
        q, turn = random_rotation(rng), np.radians(turn_deg)
        self.first = LineAxis(rng.uniform(-5, 5, 3), q[0], LENGTH)
        direction = np.cos(turn) * q[0] + np.sin(turn) * q[1]
        self.second = LineAxis(self.first.end + gap * q[0], direction, length)

    def joined(self, radius=RADIUS, **changes):
        one, other = straight(self.first), straight(self.second, radius, **changes)
        return join_straights([one, other], [])[0]


def test_that_straights_on_one_line_are_one_with_all_that_they_had(rng):
    pair = Pair(rng)
    (pipe,) = join_straights(
        [straight(pair.first, points=[3, 1]), straight(pair.second, points=[7])], []
    )[0]
    assert pipe.axis.length == pytest.approx(2 * LENGTH)
    ends = sorted(np.linalg.norm(pipe.axis.start - p) for p in (pair.first.start, pair.second.end))
    assert_allclose(ends, [0.0, 2 * LENGTH], atol=1e-9)
    assert_array_equal(np.sort(pipe.inliers), [1, 3, 7])
    assert pipe.fit.n_used == 2000
    assert pipe.fit.sigma == pytest.approx(SIGMA)
    assert pipe.extent.coverage == pytest.approx(1.0)
    assert pipe.extent.gaps == ()


@pytest.mark.parametrize("reverses", [False, True])
def test_that_neither_order_nor_sense_of_the_axes_matter(rng, reverses):
    pair = Pair(rng, gap=0.3, turn_deg=1.0)
    other = LineAxis(pair.second.end, -pair.second.direction, LENGTH) if reverses else pair.second
    (plain,) = pair.joined()
    (pipe,) = join_straights([straight(other), straight(pair.first)], [])[0]
    assert angle_between(pipe.axis.direction, plain.axis.direction) < 1e-7
    assert_allclose(pipe.axis.at(pipe.axis.length / 2), plain.axis.at(plain.axis.length / 2))
    assert pipe.axis.length == pytest.approx(plain.axis.length)


@pytest.mark.parametrize(("turn_deg", "n"), [(3.5, 1), (4.5, 2)])
def test_that_a_kink_is_joined_up_to_four_degrees(rng, turn_deg, n):
    joined = Pair(rng, turn_deg=turn_deg).joined()
    assert len(joined) == n
    if n == 1:
        # A triangle of height h lies √(1/3 − 1/4) h off its mean line.
        off_line = np.sin(np.radians(turn_deg / 2)) * LENGTH / np.sqrt(12)
        assert joined[0].fit.sigma == pytest.approx(np.hypot(SIGMA, off_line), rel=0.1)
        assert joined[0].axis.length == pytest.approx(2 * LENGTH, rel=1e-3)


@pytest.mark.parametrize(("gap_radii", "n"), [(1.5, 1), (2.5, 1), (11.5, 1), (12.5, 2)])
def test_that_a_gap_is_joined_up_to_twelve_radii_and_reported_from_two(rng, gap_radii, n):
    joined = Pair(rng, gap=gap_radii * RADIUS).joined()
    assert len(joined) == n
    if n == 1:
        (pipe,) = joined
        gap = gap_radii * RADIUS
        # Where it begins depends on which way the axis runs, and both parts are of one length.
        expected = [(LENGTH, LENGTH + gap)] if gap_radii > 2 else []
        assert_allclose(np.array(pipe.extent.gaps).reshape(-1, 2), np.reshape(expected, (-1, 2)))
        assert pipe.extent.coverage == pytest.approx(2 * LENGTH / (2 * LENGTH + gap))


def test_that_radii_differ_by_two_percent_or_three_standard_deviations_at_most(rng):
    pair = Pair(rng)
    assert len(pair.joined(1.019 * RADIUS)) == 1
    assert len(pair.joined(1.021 * RADIUS)) == 2
    assert len(pair.joined(1.021 * RADIUS, sd=0.001 * RADIUS)) == 1


def test_that_the_radius_is_the_mean_weighted_by_precision(rng):
    (pipe,) = Pair(rng).joined(RADIUS + 0.001, sd=2 * SD)
    assert pipe.fit.model.radius == pytest.approx(RADIUS + 0.001 / 5)
    assert pipe.fit.radius_sd == pytest.approx(SD * np.sqrt(0.8))


def test_that_flanges_and_cones_are_not_joined_to_pipes(rng):
    assert len(Pair(rng, length=1.4 * RADIUS).joined()) == 2
    assert len(Pair(rng, length=1.6 * RADIUS).joined()) == 1
    assert len(Pair(rng).joined(slope=0.05)) == 2


def test_that_parallel_pipes_side_by_side_stay_two(rng):
    q = random_rotation(rng)
    axes = [LineAxis(2.5 * RADIUS * i * q[1], q[0], LENGTH) for i in range(2)]
    fitted = [straight(a) for a in axes]
    joined, links = join_straights(fitted, [(0, 1)])
    assert joined is fitted
    assert links == [(0, 1)]


def test_that_a_bowed_pipe_in_three_parts_is_one_and_links_are_renumbered(rng):
    q = random_rotation(rng)
    corners = np.array([0 * q[0], q[0], 2 * q[0] + 0.03 * q[1], 3 * q[0]])
    parts = [
        straight(LineAxis(a, unit(b - a), float(np.linalg.norm(b - a))), points=[i])
        for i, (a, b) in enumerate(pairwise(corners))
    ]
    apart = replace(parts[0], axis=LineAxis(9 * q[2], q[2], LENGTH))
    # In the list they stand 0, 2, 3 with one that is elsewhere between them.
    joined, links = join_straights([parts[1], apart, parts[0], parts[2]], [(1, 0), (3, 1)])
    assert len(joined) == 2
    pipe, other = joined
    assert other is apart
    assert links == [(1, 0), (0, 1)]
    assert_array_equal(np.sort(pipe.inliers), [0, 1, 2])
    assert pipe.axis.length == pytest.approx(3.0, abs=0.01)
    assert np.degrees(angle_between(pipe.axis.direction, q[0])) < 1.0
