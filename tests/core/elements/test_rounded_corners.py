"""Fillets and rounded edges are no pipes; pipes on floors and beside walls are."""

import numpy as np
import pytest

from pipecore.geometry import LineAxis
from pipecore.pipeline import detect
from tests.core.shapes import cloud_of, plane, random_rotation, tube

SPACING, NOISE = 0.008, 0.0015
LENGTH = 1.4


def rounded_corner(rng, radius, width):
    """Two planes at a right angle and the quarter circle between them."""
    along, across, up = random_rotation(rng)
    start = rng.uniform(-1, 1, 3)
    axis = LineAxis(start, along, LENGTH)
    clock_up, clock_right = axis.frame(0.0)
    middle = np.arctan2((across + up) @ clock_right, (across + up) @ clock_up)
    arc = tube(rng, axis, radius, spacing=SPACING, noise=NOISE, arc=np.pi / 2, middle_clock=middle)
    planes = [
        plane(rng, start + radius * n, LENGTH * along, -width * t, SPACING, NOISE)
        for n, t in ((across, up), (up, across))
    ]
    return arc, *planes


@pytest.mark.parametrize("radius", [0.05, 0.1])
def test_that_a_rounded_corner_is_no_pipe(rng, radius):
    assert detect(cloud_of(*rounded_corner(rng, radius, 0.5))).elements == ()


@pytest.mark.parametrize("radius", [0.05, 0.1])
def test_that_the_same_arc_without_planes_is_a_pipe(rng, radius):
    axis = LineAxis(rng.uniform(-1, 1, 3), random_rotation(rng)[0], LENGTH)
    arc = tube(rng, axis, radius, spacing=SPACING, noise=NOISE, arc=np.deg2rad(110))
    assert len(detect(cloud_of(arc)).elements) == 1


def pipe_in_corner(rng):
    """A pipe that touches floor and wall where nobody sees it, with both; its radius beside."""
    along, across, up = random_rotation(rng)
    radius, start = rng.uniform(0.05, 0.1), rng.uniform(-1, 1, 3)
    axis = LineAxis(start, along, LENGTH)
    clock_up, clock_right = axis.frame(0.0)
    middle = np.arctan2((across + up) @ clock_right, (across + up) @ clock_up)
    corner = start - radius * (across + up)

    def visible(xyz, normals):
        """What the pipe does not hide from far away in the direction between floor and wall."""
        is_seen = np.abs((xyz - start) @ (across - up)) > np.sqrt(2) * radius
        return xyz[is_seen], normals[is_seen]

    cloud = cloud_of(
        tube(
            rng, axis, radius, spacing=SPACING, noise=NOISE, arc=np.deg2rad(170),
            middle_clock=middle,
        ),
        visible(*plane(rng, corner, LENGTH * along, 0.8 * across, SPACING, NOISE)),
        visible(*plane(rng, corner, LENGTH * along, 0.8 * up, SPACING, NOISE)),
    )  # fmt: skip
    return cloud, radius


def test_that_pipes_in_the_corner_of_floor_and_wall_are_pipes(rng):
    n_scenes, n_right = 12, 0
    for _ in range(n_scenes):
        cloud, radius = pipe_in_corner(rng)
        # The strips of floor and wall beside it are as near as its own points: it is large.
        radii = [e.radius for e in detect(cloud).elements]
        n_right += radii == pytest.approx([radius], rel=0.06)
    # One in twenty attitudes is missed: fewer than 8 of 12 come once in ten thousand seeds.
    assert n_right >= 8
