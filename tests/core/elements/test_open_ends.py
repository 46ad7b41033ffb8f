"""What follows the open end of a straight, on points whose place is known exactly."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from pipecore.elements.fittings.open_ends import MIN_POINTS, ViewFromEnd, extend_open_end
from pipecore.elements.fittings.straight_ends import StraightEnd
from pipecore.elements.refinement.nearby_points import NearbyPoints
from pipecore.geometry import LineAxis
from tests.core.shapes import cloud_of, random_rotation, sampled, tube

TOLERANCE = 0.03


def on_bend(rng, n, start, bend_radius, azimuth, max_angle):
    """A view of n points on a bend, in radii of the pipe, with their angles along it."""
    angle, clock = rng.uniform(0.02, max_angle, n), rng.uniform(0, 2 * np.pi, n)
    inward = np.array([0.0, np.cos(azimuth), np.sin(azimuth)])
    aside = np.array([0.0, -np.sin(azimuth), np.cos(azimuth)])
    ahead = np.array([1.0, 0.0, 0.0])
    out = np.outer(np.sin(angle), ahead) - np.outer(np.cos(angle), inward)
    normal = np.cos(clock)[:, None] * out + np.sin(clock)[:, None] * aside
    centre = start * ahead + bend_radius * inward
    place = centre + bend_radius * out + normal
    return ViewFromEnd(np.ascontiguousarray(place.T), np.ascontiguousarray(normal.T)), angle


def on_straight(rng, n, length):
    """A view of n points on the straight if it goes on."""
    clock = rng.uniform(0, 2 * np.pi, n)
    normal = np.stack([np.zeros(n), np.cos(clock), np.sin(clock)])
    place = normal + np.array([[1.0], [0.0], [0.0]]) * rng.uniform(0.01, length, n)
    return ViewFromEnd(np.ascontiguousarray(place), np.ascontiguousarray(normal))


@pytest.mark.parametrize("azimuth", [0.0, 1.0, 4.0])
def test_that_points_on_a_bend_are_on_it_at_their_angles_and_on_no_other(rng, azimuth):
    view, angle = on_bend(rng, 200, 0.5, 3.0, azimuth, 1.2)
    on, found = view.bent(0.5, 3.0, np.array([azimuth, azimuth + np.pi]), TOLERANCE)
    assert on[0].all()
    assert_allclose(found[0], angle, atol=1e-9)
    # The bend to the other side touches it where both begin.
    assert on[1].mean() < 0.2


def test_that_normals_along_the_surface_or_places_behind_the_start_are_not_on_a_bend(rng):
    view, _ = on_bend(rng, 50, 0.0, 3.0, 0.0, 1.0)
    along = np.cross(view.normal.T, [0.0, 0.0, 1.0]).T
    along /= np.linalg.norm(along, axis=0)
    assert not ViewFromEnd(view.place, along).bent(0.0, 3.0, np.zeros(1), TOLERANCE)[0].any()
    on, angle = view.bent(2.0, 3.0, np.zeros(1), TOLERANCE)
    assert not on[angle <= 0].any()


def test_that_the_best_bend_is_the_one_that_most_points_are_on(rng):
    view, _ = on_bend(rng, 120, 0.5, 3.0, 1.0, 1.2)
    starts, radii, azimuths = np.array([0.0, 0.5, 1.0]), np.array([2.0, 3.0, 4.5]), np.arange(6.0)
    count, *best = view.best_of(starts, radii, azimuths, TOLERANCE)
    assert best == [0.5, 3.0, 1.0]
    counts = [
        view.bent(start, radius, azimuths, TOLERANCE)[0].sum(axis=1).max()
        for start in starts
        for radius in radii
    ]
    assert count == max(counts) == 120


def test_that_points_of_the_straight_drawn_on_are_counted(rng):
    assert on_straight(rng, 75, 3.0).straight_on(TOLERANCE) == 75
    assert on_bend(rng, 75, 0.0, 2.0, 0.0, 1.0)[0].straight_on(TOLERANCE) < 75 / 2


def test_that_a_pipe_that_goes_straight_on_or_is_hardly_seen_is_not_followed(rng):
    along = random_rotation(rng)[0]
    end = StraightEnd((0, 1), np.zeros(3), along, 0.05)
    ahead = tube(rng, LineAxis(np.zeros(3), along, 0.3), 0.05, spacing=0.008, noise=0.001)
    few = tuple(part[: MIN_POINTS - 1] for part in ahead)
    for parts in (ahead, few):
        nearby = NearbyPoints(cloud_of(parts), sampled(parts))
        is_free = np.ones(len(nearby.surface.xyz), np.bool_)
        assert extend_open_end(end, nearby, is_free) is None
