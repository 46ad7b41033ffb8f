"""Curves of profiles: what comes apart, what stays together, by either method."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import pipecore.profiles
from pipecore.geometry import LineAxis
from pipecore.profiles import (
    MAX_PIECES,
    MAX_SLOPE,
    MIN_CURVE_POINTS,
    Curves,
    cut_portions,
    segment_profiles,
    stack_frame,
)
from pipecore.settings import ProfileMethod, ProfileSettings
from pipecore.surface import Surface
from pipecore.types import Stack
from tests.core.shapes import known, part_of, plane, random_direction, sampled, tube

X = np.array([1.0, 0.0, 0.0])
ALONG_X = Stack(1, X, 0.02)
PROXIMITY = ProfileSettings(method=ProfileMethod.PROXIMITY)
CURVE_FITTING = ProfileSettings()
LENGTH = 0.2


def pipe(rng, y, z, radius, noise=0.001, **kwargs):
    """Points of a pipe along X."""
    axis = LineAxis(np.array([0.0, y, z]), X, LENGTH)
    return tube(rng, axis, radius, noise=noise, **kwargs)


def cut(surface: Surface, settings=CURVE_FITTING, stack=ALONG_X) -> Curves:
    return segment_profiles(surface, stack, settings, max_radius=5.0)


def mixed_share(curves: Curves, part: np.ndarray, n_parts: int) -> float:
    """Share of the points of curves that are not of the part which has most of their curve."""
    counts = np.zeros((len(curves), n_parts), int)
    np.add.at(counts, (curves.curve_of_point, part[curves.points]), 1)
    return float(1 - counts.max(axis=1).sum() / counts.sum())


def whole_share(curves: Curves, part: np.ndarray, wanted: int) -> float:
    """Median over profiles: share of a part's points in the profile that are in one curve."""
    mine = part[curves.points] == wanted
    counts = np.bincount(curves.curve_of_point, mine, len(curves))
    total = {}
    for k, count in zip(curves.profile_index, counts, strict=True):
        total.setdefault(k, []).append(count)
    in_profile = curves.stack.profile_index(surface_points_of(curves))
    shares = []
    for k, found in total.items():
        n = (mine & (in_profile == k)).sum()
        if n:
            shares.append(max(found) / n)
    return float(np.median(shares))


def surface_points_of(curves: Curves) -> np.ndarray:
    """Places of the curves' points, carried to the mid-planes."""
    along = curves.mid_plane()[curves.curve_of_point]
    return curves.uv @ curves.frame[:2] + along[:, None] * curves.frame[2]


def test_that_a_frame_is_right_handed_with_the_direction_last(rng):
    for _ in range(10):
        d = random_direction(rng)
        frame = stack_frame(d)
        assert_allclose(frame @ frame.T, np.eye(3), atol=1e-14)
        assert np.linalg.det(frame) == pytest.approx(1.0)
        assert_allclose(frame[2], d)


def test_that_the_slab_of_an_oblique_stack_does_not_smear_what_it_cuts(rng):
    axis = LineAxis(rng.normal(size=3), random_direction(rng), 0.6)
    radius = 0.1
    xyz, normals = tube(rng, axis, radius, spacing=0.005)
    up, _ = axis.frame(0.0)
    tilt = np.radians(35)
    direction = np.cos(tilt) * axis.direction + np.sin(tilt) * up
    curves = cut(known((xyz, normals), spacing=0.005), PROXIMITY, Stack(1, direction, 0.03))
    _, rho, _ = axis.pipe_coordinates(surface_points_of(curves))
    _, rho_left, _ = axis.pipe_coordinates(
        xyz[curves.points]
        - np.outer(
            (xyz[curves.points] @ direction) - curves.mid_plane()[curves.curve_of_point], direction
        )
    )
    # Straight projection smears by centimetres; carried along the tangent, the rest is of
    # second order, (15 mm · tan)² / 2r.
    assert np.abs(rho - radius).max() < 0.003
    assert np.abs(rho_left - radius).max() > 0.005


def test_that_surfaces_along_the_profile_stay_out(rng):
    across = plane(rng, [0, 0, 0], [0, 1, 0], [0, 0, 1])
    beside = plane(rng, [0, 0, 0], [1, 0, 0], [0, 0, 1])
    curves = cut(known(across, beside))
    assert set(part_of(across, beside)[curves.points]) == {1}
    assert (np.abs(curves.normals[:, 2]) < MAX_SLOPE).all()


def test_that_profiles_are_numbered_by_where_they_lie(rng):
    surface = sampled(pipe(rng, 0.0, 0.0, 0.08))
    curves = cut(surface)
    along = surface.xyz[curves.points] @ X
    index = curves.profile_index[curves.curve_of_point]
    assert (np.floor(along / ALONG_X.width) == index).all()
    assert len(set(curves.profile_index)) == round(LENGTH / ALONG_X.width)
    assert (np.diff(curves.starts) >= MIN_CURVE_POINTS).all()
    assert len(set(curves.points)) == len(curves.points)


@pytest.mark.parametrize("settings", [PROXIMITY, CURVE_FITTING])
def test_that_a_pipe_is_one_curve_in_each_profile(rng, settings):
    curves = cut(sampled(pipe(rng, 0.0, 0.0, 0.08)), settings)
    assert len(curves) == len(set(curves.profile_index))


@pytest.mark.parametrize("settings", [PROXIMITY, CURVE_FITTING])
def test_that_pipes_a_centimetre_apart_come_apart(rng, settings):
    # Scanned finely enough to see between them.
    parts = [pipe(rng, y, 0.0, 0.05, spacing=0.002, noise=0.0003) for y in (0.0, 0.11)]
    curves = cut(known(*parts, spacing=0.002), settings)
    assert mixed_share(curves, part_of(*parts), 2) == 0.0


def test_that_pipes_a_centimetre_apart_come_apart_in_a_coarse_scan_by_curve_fitting(rng):
    parts = [pipe(rng, y, 0.0, 0.05, noise=0.0015) for y in (0.0, 0.11)]
    surface = known(*parts, noise=0.0015)
    assert mixed_share(cut(surface), part_of(*parts), 2) < 0.05
    assert mixed_share(cut(surface, PROXIMITY), part_of(*parts), 2) > 0.3


def test_that_a_pipe_inside_a_cut_open_one_is_a_curve_of_its_own(rng):
    shell = pipe(rng, 0.0, 0.0, 0.12, arc=np.radians(270), noise=0.0005)
    inside = pipe(rng, 0.0, 0.0, 0.09, noise=0.0005)
    surface, part = known(shell, inside), part_of(shell, inside)
    curves = cut(surface)
    assert mixed_share(curves, part, 2) < 0.02
    assert whole_share(curves, part, 0) > 0.95
    assert whole_share(curves, part, 1) > 0.95


def test_that_a_pipe_on_a_floor_comes_off_it_by_curve_fitting_only(rng):
    floor = plane(rng, [0.0, -0.4, 0.0], [LENGTH, 0, 0], [0, 0.8, 0], noise=0.001)
    lying = pipe(rng, 0.0, 0.08, 0.08)
    surface, part = known(floor, lying, noise=0.001), part_of(floor, lying)
    curves = cut(surface)
    assert mixed_share(curves, part, 2) < 0.06
    assert whole_share(curves, part, 1) > 0.85
    assert mixed_share(cut(surface, PROXIMITY), part, 2) > 0.3


@pytest.mark.parametrize("arc_deg", [360.0, 200.0])
def test_that_a_pipe_touching_a_wall_comes_off_it_by_curve_fitting_only(rng, arc_deg):
    wall = plane(rng, [0.0, 0.1, -0.4], [LENGTH, 0, 0], [0, 0, 0.8], noise=0.001)
    # Seen all around, or from one station in front of the wall.
    arc = np.radians(arc_deg)
    touching = pipe(rng, 0.0, 0.0, 0.1, arc=arc, middle_clock=np.pi / 2)
    surface, part = known(wall, touching, noise=0.001), part_of(wall, touching)
    curves = cut(surface)
    assert mixed_share(curves, part, 2) < 0.05
    assert whole_share(curves, part, 1) > 0.85
    if arc_deg == 360.0:
        assert mixed_share(cut(surface, PROXIMITY), part, 2) > 0.2


def test_that_each_of_many_pipes_on_a_floor_comes_off_it(rng):
    n_pipes = 14
    floor = plane(rng, [0.0, -0.2, 0.0], [LENGTH, 0, 0], [0, 0.3 * n_pipes, 0], noise=0.001)
    pipes = [pipe(rng, 0.3 * i, 0.06, 0.06) for i in range(n_pipes)]
    part = part_of(floor, *pipes)
    curves = cut(known(floor, *pipes, noise=0.001))
    shares = [whole_share(curves, part, i) for i in range(1, n_pipes + 1)]
    # What is mixed is floor within reach of the contact, nine points a pipe.
    assert mixed_share(curves, part, n_pipes + 1) < 0.09
    assert min(shares) > 0.8


def test_that_crossing_pipes_in_contact_come_apart_by_curve_fitting_and_not_by_proximity(rng):
    along = tube(rng, LineAxis(np.array([-0.4, 0, 0]), X, 0.8), 0.06, noise=0.001)
    diagonal = np.array([0.8, 0.6, 0.0])
    over = tube(
        rng, LineAxis(np.array([0, 0, 0.11]) - 0.4 * diagonal, diagonal, 0.8), 0.05, noise=0.001
    )
    surface, part = known(along, over, noise=0.001), part_of(along, over)

    def mixed_at_the_crossing(settings):
        curves = cut(surface, settings)
        at_crossing = np.abs(curves.profile_index + 0.5) < 2
        counts = np.zeros((len(curves), 2), int)
        np.add.at(counts, (curves.curve_of_point, part[curves.points]), 1)
        counts = counts[at_crossing]
        return 1 - counts.max(axis=1).sum() / counts.sum()

    assert mixed_at_the_crossing(PROXIMITY) > 0.3
    assert mixed_at_the_crossing(CURVE_FITTING) < 0.06


def test_that_a_set_gap_is_kept_and_a_wider_one_joins(rng):
    parts = [pipe(rng, y, 0.0, 0.05, spacing=0.004, noise=0.0) for y in (0.0, 0.13)]
    surface, part = known(*parts, spacing=0.004), part_of(*parts)
    narrow = ProfileSettings(method=ProfileMethod.PROXIMITY, gap_mm=20.0)
    wide = ProfileSettings(method=ProfileMethod.PROXIMITY, gap_mm=40.0)
    assert mixed_share(cut(surface, narrow), part, 2) == 0.0
    assert mixed_share(cut(surface, wide), part, 2) > 0.3


def test_that_sparse_points_are_joined_over_their_own_spacing(rng):
    # Half of the pipe is scanned four times as coarsely as the other half.
    fine = pipe(rng, 0.0, 0.0, 0.15, arc=np.pi, noise=0.0, spacing=0.008)
    coarse = pipe(rng, 0.0, 0.0, 0.15, arc=np.pi, middle_clock=np.pi, noise=0.0, spacing=0.03)
    surface = known(fine, coarse, spacing=0.008)
    surface.spacing[len(fine[0]) :] = 0.03
    curves = cut(surface, PROXIMITY, Stack(1, X, 0.05))
    assert whole_share(curves, part_of(fine, coarse), 1) > 0.95


def test_that_the_order_of_the_points_does_not_matter(rng):
    xyz, normals = (
        np.concatenate(p)
        for p in zip(pipe(rng, 0.0, 0.0, 0.05), pipe(rng, 0.1, 0.0, 0.05), strict=True)
    )
    shuffled = rng.permutation(len(xyz))

    def groups(curves, names):
        return {
            frozenset(names[curves.points[a:b]])
            for a, b in zip(curves.starts[:-1], curves.starts[1:], strict=True)
        }

    once = cut(known((xyz, normals)), PROXIMITY)
    again = cut(known((xyz[shuffled], normals[shuffled])), PROXIMITY)
    assert groups(again, shuffled) == groups(once, np.arange(len(xyz)))


@pytest.mark.parametrize("settings", [PROXIMITY, CURVE_FITTING])
def test_that_a_dense_profile_of_a_hundred_thousand_points_is_no_trouble(rng, settings):
    # A thousand small pipes side by side in one profile, each touching the next.
    angle, number = (k.ravel() for k in np.indices((100, 1000)))
    angle = (angle + rng.random(angle.shape)) * 2 * np.pi / 100
    normals = np.stack([0 * angle, np.cos(angle), np.sin(angle)], axis=1)
    xyz = 0.05 * normals + np.stack([0.01 + 0 * angle, 0.1 * number, 0 * angle], axis=1)
    curves = cut(known((xyz, normals), spacing=0.003), settings)
    assert set(curves.profile_index) == {0}
    if settings is PROXIMITY:
        assert len(curves) == 1
    else:
        # As many as may be taken off one curve, and what is left over.
        assert len(curves) == MAX_PIECES + 1


def test_that_a_surface_without_normals_has_no_curves():
    surface = known((np.zeros((5, 3)), np.full((5, 3), np.nan)))
    curves = cut(surface)
    assert len(curves) == 0
    assert list(curves.starts) == [0]


def test_that_portions_hold_whole_profiles_and_together_all_curves(rng, monkeypatch):
    surface = known(pipe(rng, 0.0, 0.0, 0.05), pipe(rng, 0.2, 0.0, 0.05))
    whole = cut(surface)
    monkeypatch.setattr(pipecore.profiles, "POINTS_AT_A_TIME", len(surface.xyz) // 4)
    portions = cut_portions(surface, ALONG_X, CURVE_FITTING, 5.0, lambda curves, _: curves)
    assert len(portions) > 2
    profiles = [set(curves.profile_index) for curves in portions]
    assert sum(map(len, profiles)) == len(set.union(*profiles)) == 10
    assert np.concatenate([c.points for c in portions]).tolist() == whole.points.tolist()
    assert_allclose(np.concatenate([c.uv for c in portions]), whole.uv)


def test_that_a_stack_that_cuts_nothing_is_one_portion_without_curves():
    surface = known((np.zeros((5, 3)), np.full((5, 3), np.nan)))
    portions = cut_portions(surface, ALONG_X, CURVE_FITTING, 5.0, lambda curves, _: len(curves))
    assert portions == [0]
