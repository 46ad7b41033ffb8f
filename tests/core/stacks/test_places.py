"""Which stacks cut a place: those nearest to the axis that its normals tell."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from pipecore.geometry import LineAxis
from pipecore.stacks.places import ALL, N_NEAREST, SAME_COS, stack_bit, stacks_of_cells
from pipecore.surface.cells import Cells, cells_of_points, sum_cells
from pipecore.types import Stack
from tests.core.shapes import plane, random_rotation, tube, unit_rows

SPACING = 0.02


def stacks_along(directions):
    return [Stack(k, d, 0.04, 0.0, "") for k, d in enumerate(directions, start=1)]


@pytest.fixture
def many(rng):
    """Twelve narrow stacks in directions of any kind, and the same once more, wide."""
    directions = unit_rows(rng.normal(size=(12, 3)))
    return stacks_along([*directions, *directions])


def tilted(rng, part, angle=0.03):
    xyz, normals = part
    return xyz, unit_rows(normals + angle * rng.normal(size=normals.shape))


def pipe(rng, axis, radius, **how):
    return tilted(rng, tube(rng, axis, radius, spacing=SPACING, noise=0.001, **how))


def floor(rng):
    return tilted(rng, plane(rng, np.zeros(3), [3.0, 0, 0], [0, 3.0, 0], SPACING, 0.001))


def is_cut(part, stacks):
    """Whether each stack cuts each point, shape (n, stacks)."""
    cells, ids = cells_of_points(*part, SPACING)
    bits = stacks_of_cells(cells, stacks)[ids]
    return (bits[:, None] >> np.array([stack_bit(s) for s in stacks])) & 1 == 1


def nearest(direction, stacks):
    """Stacks by the angle between their directions and a given one."""
    return np.argsort([-abs(s.direction @ direction) for s in stacks], kind="stable")


@pytest.mark.parametrize("radius", [0.05, 0.3, 1.5])
def test_that_a_pipe_is_cut_by_the_stacks_nearest_to_its_axis(rng, many, radius):
    direction = unit_rows(rng.normal(size=(1, 3)))[0]
    cut = is_cut(pipe(rng, LineAxis(np.zeros(3), direction, 3.0), radius), many)
    by_angle = nearest(direction, many[:12])
    assert cut[:, by_angle[: N_NEAREST - 1]].mean() > 0.99
    cos = np.array([abs(s.direction @ direction) for s in many[:12]])
    far = np.flatnonzero(cos < cos[by_angle[N_NEAREST - 1]] - SAME_COS - 0.3)
    # Of the widest one, some places are flat as far as is looked.
    assert cut[:, far].mean() < (0.05 if radius < 1.0 else 0.7)
    # Wide profiles lie where the narrow ones of their direction do.
    assert_array_equal(cut[:, :12], cut[:, 12:])


def test_that_places_without_one_axis_are_cut_by_all_stacks(rng, many):
    n = 20_000
    ball = unit_rows(rng.normal(size=(n, 3)))
    assert is_cut((0.2 * ball, ball), many).all()
    assert is_cut(floor(rng), many).all()
    few = rng.uniform(0, 30, (50, 3)), unit_rows(rng.normal(size=(50, 3)))
    assert is_cut(few, many).all()
    unknown = rng.uniform(0, 1, (500, 3)), np.full((500, 3), np.nan)
    assert is_cut(unknown, many).all()


def test_that_a_few_directions_cut_everything_and_so_do_more_stacks_than_can_be_told(rng):
    part = pipe(rng, LineAxis(np.zeros(3), np.array([1.0, 0, 0]), 2.0), 0.1)
    assert is_cut(part, stacks_along(np.eye(3))).all()
    assert is_cut(part, stacks_along(unit_rows(rng.normal(size=(65, 3))))).all()
    assert len(stacks_of_cells(cells_of_points(*np.empty((2, 0, 3)), SPACING)[0], [])) == 0


def test_that_it_does_not_depend_on_order_or_parts(rng, many):
    axis = LineAxis(np.array([1.0, 1.0, 0.1]), np.array([1.0, 0, 0]), 1.5)
    xyz, normals = (np.concatenate(p) for p in zip(floor(rng), pipe(rng, axis, 0.1), strict=True))
    turn = random_rotation(rng)
    xyz, normals = xyz @ turn.T, normals @ turn.T
    cut = is_cut((xyz, normals), many)
    assert 0 < cut.mean() < 1
    order = rng.permutation(len(xyz))
    assert_array_equal(is_cut((xyz[order], normals[order]), many), cut[order])
    # As tiles do, divided anyhow.
    pieces = np.split(order, np.sort(rng.choice(len(xyz), 4)))
    summed = [sum_cells(xyz[rows], normals[rows], SPACING) for rows in pieces]
    cells, places = Cells.joined([sums for sums, _ in summed])
    bits = stacks_of_cells(cells, many)
    whole_cells, whole_ids = cells_of_points(xyz, normals, SPACING)
    whole = stacks_of_cells(whole_cells, many)[whole_ids]
    for rows, (_, ids), place in zip(pieces, summed, places, strict=True):
        assert_array_equal(bits[place[ids]], whole[rows])


def test_that_what_all_stacks_cut_has_every_bit():
    assert all((ALL >> bit) & 1 for bit in range(64))
