"""Floors and walls are told from what may be a pipe."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from pipecore.geometry import LineAxis
from pipecore.surface.planes import (
    CELL_VOXELS,
    NO_PLANE,
    find_planes,
    planes_of_points,
    sum_cells,
)
from tests.core.shapes import known, part_of, plane, random_rotation, tube, unit_rows

MAX_RADIUS = 5.0
SPACING = 0.02
EDGE = CELL_VOXELS * SPACING


def tilted(rng, part, angle=0.05):
    """A part with normals as an estimate gives them."""
    xyz, normals = part
    return xyz, unit_rows(normals + angle * rng.normal(size=normals.shape))


def turned(part, rotation):
    return part[0] @ rotation.T, part[1] @ rotation.T


def floor(rng, size=4.0, noise=0.002):
    return tilted(rng, plane(rng, np.zeros(3), [size, 0, 0], [0, size, 0], SPACING, noise))


def pipe(rng, axis, radius, **how):
    return tilted(rng, tube(rng, axis, radius, spacing=SPACING, noise=0.002, **how))


def found(*parts, max_radius=MAX_RADIUS):
    surface = known(*parts, spacing=SPACING)
    return planes_of_points(surface.xyz, surface.normals, SPACING, max_radius)


def test_that_a_floor_is_one_plane_and_not_cut(rng):
    part = floor(rng)
    plane_of, is_cut = found(part)
    assert plane_of.max() == 0
    assert (plane_of == 0).mean() > 0.98
    # Nothing else is near, so that even its edges need no cutting.
    assert is_cut.mean() < 0.02


def test_that_most_of_a_floor_in_any_attitude_is_plane(rng):
    plane_of, is_cut = found(turned(floor(rng), random_rotation(rng)))
    assert (plane_of != NO_PLANE).mean() > 0.7
    assert is_cut.mean() < 0.5


def test_that_a_floor_and_a_wall_are_two_planes(rng):
    ground = floor(rng)
    wall = tilted(rng, plane(rng, np.zeros(3), [4.0, 0, 0], [0, 0, 3.0], SPACING, 0.002))
    plane_of, is_cut = found(ground, wall)
    part = part_of(ground, wall)
    assert plane_of.max() == 1
    assert len({int(np.median(plane_of[part == k])) for k in (0, 1)}) == 2
    # Along the corner between them both are cut.
    corner = np.abs(ground[0][:, 1]) < 0.5 * EDGE
    assert is_cut[part == 0][corner].all()


@pytest.mark.parametrize("height", [0.05, 0.3])
def test_that_a_pipe_and_the_floor_around_it_are_cut(rng, height):
    ground = floor(rng)
    axis = LineAxis(np.array([1.0, 2.0, height]), np.array([1.0, 0, 0]), 2.0)
    own = pipe(rng, axis, 0.05)
    plane_of, is_cut = found(ground, own)
    part = part_of(ground, own)
    assert is_cut[part == 1].all()
    assert (plane_of[part == 1] == NO_PLANE).all()
    if height == 0.05:
        x, y, _ = ground[0].T
        beside = (np.abs(y - 2.0) < EDGE) & (x > 1.0) & (x < 3.0)
        assert is_cut[part == 0][beside].all()
        away = np.abs(y - 2.0) > 4 * EDGE
        assert is_cut[part == 0][away].mean() < 0.02


@pytest.mark.parametrize("radius", [0.3, 1.0, 3.0, MAX_RADIUS])
@pytest.mark.parametrize("arc_deg", [30.0, 90.0, 360.0])
def test_that_no_vessel_is_a_plane(rng, radius, arc_deg):
    axis = LineAxis(np.zeros(3), np.array([0, 0, 1.0]), 3.0)
    own = turned(pipe(rng, axis, radius, arc=np.radians(arc_deg)), random_rotation(rng))
    _, is_cut = found(own)
    assert is_cut.all()


def test_that_what_is_wider_than_the_widest_pipe_is_a_plane(rng):
    axis = LineAxis(np.zeros(3), np.array([0, 0, 1.0]), 3.0)
    own = pipe(rng, axis, 40.0, arc=0.1)
    assert found(own, max_radius=1.0)[1].mean() < 0.5
    assert found(own, max_radius=50.0)[1].all()


def test_that_a_narrow_strip_may_be_of_a_vessel(rng):
    strip = tilted(rng, plane(rng, np.zeros(3), [4.0, 0, 0], [0, 0.3, 0], SPACING, 0.002))
    assert found(strip)[1].all()


def test_that_points_without_normals_are_of_no_plane(rng):
    xyz, normals = floor(rng)
    plane_of, is_cut = planes_of_points(xyz, np.full_like(normals, np.nan), SPACING, MAX_RADIUS)
    assert is_cut.all()
    assert (plane_of == NO_PLANE).all()
    nothing = np.empty((0, 3))
    assert len(planes_of_points(nothing, nothing, SPACING, MAX_RADIUS)[0]) == 0


def test_that_planes_do_not_depend_on_order_or_parts(rng):
    axis = LineAxis(np.array([1.0, 2.0, 0.05]), np.array([1.0, 0, 0]), 2.0)
    parts = (turned(p, random_rotation(rng)) for p in (floor(rng), pipe(rng, axis, 0.05)))
    xyz, normals = (np.concatenate(p) for p in zip(*parts, strict=True))
    plane_of, is_cut = planes_of_points(xyz, normals, SPACING, MAX_RADIUS)
    assert 0 < is_cut.mean() < 1
    order = rng.permutation(len(xyz))
    again = planes_of_points(xyz[order], normals[order], SPACING, MAX_RADIUS)
    assert_array_equal(again[0], plane_of[order])
    assert_array_equal(again[1], is_cut[order])
    # As tiles do, divided anyhow.
    pieces = np.split(order, np.sort(rng.choice(len(xyz), 4)))
    summed = [sum_cells(xyz[rows], normals[rows], SPACING) for rows in pieces]
    told = find_planes([sums for sums, _ in summed], SPACING, MAX_RADIUS)
    for rows, (_, ids), cells in zip(pieces, summed, told, strict=True):
        assert_array_equal(cells.plane[ids], plane_of[rows])
        assert_array_equal(cells.is_cut[ids], is_cut[rows])
