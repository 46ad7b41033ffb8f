"""Which stacks are cut, and what lies in their profiles."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from pipecore.geometry import ArcAxis, LineAxis
from pipecore.profiles import segment_profiles
from pipecore.progress import NoProgress
from pipecore.settings import DirectionPreset, ProfileSettings, Settings, StackSettings
from pipecore.stacks import choose_stacks, preset_directions
from pipecore.stacks.directions import cover_directions
from pipecore.stacks.round_places import RoundPlaces, find_round_places
from pipecore.types import Stack
from tests.core.shapes import (
    angle_between,
    plane,
    random_direction,
    random_rotation,
    sampled,
    tube,
    unit_rows,
)

NONE_CURVED = StackSettings(DirectionPreset.AUTOMATIC)


def floor(rng, corner=(0.0, 0.0, 0.0)):
    return plane(rng, corner, [1, 0, 0], [0, 1, 0], 0.02, 0.002)


def test_that_a_profile_holds_what_lies_within_its_width(rng):
    stack = Stack(1, random_direction(rng), 0.03, -0.2)
    xyz = rng.uniform(-2, 2, (200, 3))
    index = stack.profile_index(xyz)
    low = stack.offset + index * stack.width
    along = xyz @ stack.direction
    assert ((low <= along + 1e-12) & (along < low + stack.width + 1e-12)).all()


def test_that_the_presets_are_the_axes_and_the_diagonals_of_the_cube():
    assert_allclose(preset_directions(DirectionPreset.AXES), np.eye(3))
    seven = np.array(preset_directions(DirectionPreset.AXES_AND_DIAGONALS))
    assert_allclose(np.linalg.norm(seven, axis=1), 1.0)
    cosines = np.abs(seven @ seven.T)[np.triu_indices(7, 1)]
    # Between axes, between an axis and a diagonal, between diagonals.
    assert (
        sorted(np.round(np.degrees(np.arccos(cosines)), 1)) == [54.7] * 12 + [70.5] * 6 + [90.0] * 3
    )
    assert preset_directions(DirectionPreset.NONE) == []


def test_that_no_direction_in_space_is_far_from_the_seven(rng):
    seven = np.array(preset_directions(DirectionPreset.AXES_AND_DIAGONALS))
    cosines = np.abs(unit_rows(rng.normal(size=(20_000, 3))) @ seven.T).max(axis=1)
    assert np.degrees(np.arccos(cosines.min())) == pytest.approx(36.2, abs=0.5)


def test_that_own_stacks_come_with_their_own_width_after_the_presets(rng):
    settings = Settings().replace(
        {"stacks.preset": "axes", "stacks.directions": "0,3,4,50; 1,1,0", "stacks.width_mm": 20}
    )
    stacks = choose_stacks(sampled(floor(rng)), settings.stacks, 5.0, NoProgress())
    assert [s.stack_id for s in stacks] == [1, 2, 3, 4, 5]
    assert [s.name for s in stacks[:3]] == ["X", "Y", "Z"]
    assert_allclose(stacks[3].direction, [0.0, 0.6, 0.8])
    assert_allclose(stacks[4].direction, np.array([1.0, 1.0, 0.0]) / np.sqrt(2))
    assert [s.width for s in stacks] == pytest.approx([0.02, 0.02, 0.02, 0.05, 0.02])


def test_that_the_automatic_width_follows_the_thinning(rng):
    for voxel_mm in (15.0, 30.0):
        surface = sampled(floor(rng), voxel_mm=voxel_mm)
        stacks = choose_stacks(surface, StackSettings(DirectionPreset.AXES), 5.0, NoProgress())
        narrow = [s.width for s in stacks if not s.min_spacing]
        assert narrow == pytest.approx([0.002 * voxel_mm] * 3)


def test_that_thinly_scanned_places_are_cut_again_by_wider_profiles(rng):
    dense = plane(rng, np.zeros(3), [1, 0, 0], [0, 1, 0], 0.005, 0.001)
    thin = plane(rng, np.array([0, 0, 2.0]), [1, 0, 0], [0, 1, 0], 0.025, 0.001)
    surface = sampled(dense, thin)
    stacks = choose_stacks(surface, StackSettings(DirectionPreset.AXES), 5.0, NoProgress())
    narrow, wide = stacks[:3], stacks[3:]
    assert [s.stack_id for s in stacks] == [1, 2, 3, 4, 5, 6]
    for one, other in zip(narrow, wide, strict=True):
        assert_allclose(one.direction, other.direction)
        assert other.width > 2 * one.width
    is_inside = (np.abs(surface.xyz[:, :2] - 0.5) < 0.4).all(axis=1)
    in_thin = is_inside & (surface.xyz[:, 2] > 1.0)
    joined = np.zeros(len(is_inside), np.bool_)
    joined[segment_profiles(surface, wide[0], ProfileSettings(), 1.0).points] = True
    assert joined[in_thin].mean() > 0.5
    assert joined[is_inside & ~in_thin].mean() < 0.01
    given = StackSettings(DirectionPreset.AXES, width_mm=20.0)
    assert len(choose_stacks(surface, given, 5.0, NoProgress())) == 3


def test_that_automatic_directions_are_the_axes_of_the_pipes(rng):
    # Three pipes well apart in attitude, in a random frame, and a floor that meets none of them.
    true = random_rotation(rng)
    pipes = [
        tube(rng, LineAxis(np.array([2.0 * i, 0, 0]), d, 1.0), 0.1, noise=0.002)
        for i, d in enumerate(true)
    ]
    surface = sampled(*pipes, floor(rng, (-3.0, 0.0, 0.0)))
    stacks = choose_stacks(surface, StackSettings(), 5.0, NoProgress())
    found = np.array([s.direction for s in stacks if not s.min_spacing])
    for d in true:
        # 1.1° at most in 200 draws.
        assert np.degrees(angle_between(found, d).min()) < 3.0
    assert len(found) == 3


def test_that_every_oblique_pipe_is_cut_well_by_an_automatic_stack(rng):
    true = [random_direction(rng) for _ in range(8)]
    pipes = [
        tube(rng, LineAxis(np.array([2.0 * i, 0, 0]), d, 0.8), 0.1, noise=0.002, arc=np.pi)
        for i, d in enumerate(true)
    ]
    stacks = choose_stacks(sampled(*pipes), StackSettings(), 5.0, NoProgress())
    found = np.array([s.direction for s in stacks])
    for d in true:
        # A place further than 24° from a direction gets one of its own; 23.9° at most in 900 draws.
        assert np.degrees(angle_between(found, d).min()) < 27.0


def test_that_the_directions_of_a_bend_are_all_covered(rng):
    q = random_rotation(rng)
    bend = ArcAxis(np.zeros(3), q[2], q[0], 0.5, np.pi / 2)
    surface = sampled(tube(rng, bend, 0.12, noise=0.001))
    found = np.array(
        [s.direction for s in choose_stacks(surface, StackSettings(), 5.0, NoProgress())]
    )
    for tangent in bend.tangent(np.linspace(0.1, 0.9, 9) * bend.length):
        # Directions 30° apart and the bend's ends: 16.5° at most in 900 draws, with an SD of 0.5°.
        assert np.degrees(angle_between(found, tangent).min()) < 20.0


def test_that_a_scene_without_curved_surfaces_gets_the_axes_and_diagonals(rng):
    stacks = choose_stacks(sampled(floor(rng)), StackSettings(), 5.0, NoProgress())
    assert_allclose(
        [s.direction for s in stacks if not s.min_spacing],
        preset_directions(DirectionPreset.AXES_AND_DIAGONALS),
    )


def test_that_rare_axes_get_no_direction_of_their_own(rng):
    common = np.tile([0.0, 0.0, 1.0], (3000, 1)) + 0.02 * rng.normal(size=(3000, 3))
    rare = np.tile([1.0, 0.0, 0.0], (8, 1))
    axes = unit_rows(np.concatenate([common, rare]))
    (direction,) = cover_directions(RoundPlaces(axes, np.full(len(axes), 3.0)))
    assert np.degrees(angle_between(direction, np.array([0.0, 0.0, 1.0]))) < 1.0


@pytest.mark.parametrize("radius", [0.06, 0.16, 0.6, 1.5])
@pytest.mark.parametrize("spacing", [0.004, 0.01])
def test_that_a_wide_pipe_is_cut_beside_narrow_ones_however_densely_it_is_scanned(
    rng, radius, spacing
):
    """A neighbourhood of few voxels sees no curvature of a wide pipe that is scanned densely."""
    q = random_rotation(rng)
    narrow = [
        tube(rng, LineAxis(q[1] * i, q[0], 0.8), 0.04, spacing=spacing, noise=0.001)
        for i in range(4)
    ]
    axis, arc = LineAxis(q[1] * -4.0, q[2], 0.6), 0.8 / radius
    wide = tube(rng, axis, radius, spacing=spacing, noise=0.001, arc=min(arc, 2 * np.pi))
    stacks = choose_stacks(sampled(*narrow, wide), StackSettings(), 5.0, NoProgress())
    found = np.array([s.direction for s in stacks])
    for d in (q[0], q[2]):
        assert np.degrees(angle_between(found, d).min()) < 10.0


def test_that_edges_between_planes_are_no_round_places(rng):
    """Their normals turn about one axis, but the normal lines do not meet on it."""
    q = random_rotation(rng)
    walls = [
        plane(rng, np.zeros(3), q[0], q[1], 0.01, 0.001),
        plane(rng, np.zeros(3), q[0], q[2], 0.01, 0.001),
    ]
    places = find_round_places(sampled(*walls), 5.0)
    # Normals of a few voxels across are rounded at an edge: 1.5 of the finest cells on either side,
    # 6 % of the points. Taken for round at the three scales that see both planes it were 78 %.
    assert places.n_points.sum() < 0.08 * 2 * 100**2
