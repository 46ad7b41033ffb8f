"""Segments: what curves of any stack have in common."""

import numpy as np
from numpy.testing import assert_array_equal

import pipecore.segments
from pipecore.geometry import LineAxis
from pipecore.profiles import Curves, segment_profiles, stack_frame
from pipecore.segments import MIN_SEGMENT, StackOverlay
from pipecore.settings import ProfileSettings
from pipecore.types import NO_ID, Stack
from tests.core.shapes import parents, part_of, sampled, tube


def curves_of(groups, direction=(1.0, 0.0, 0.0)) -> Curves:
    """Curves with the given points, all in one profile."""
    d = np.array(direction)
    points = np.concatenate(groups).astype(np.intp)
    starts = np.cumsum([0, *map(len, groups)])
    n = len(points)
    index = np.zeros(len(groups), np.int32)
    return Curves(
        Stack(1, d, 0.02), stack_frame(d), points, np.zeros((n, 2)), np.zeros((n, 3)), starts, index
    )


def segments_of(curves, n_points):
    """The segment of each point, from the curves of some stacks."""
    overlay = StackOverlay(n_points)
    for of_stack in curves:
        overlay.add(of_stack.points, of_stack.starts)
    return overlay.number_segments()


def test_that_curves_of_different_stacks_with_a_common_point_are_one_segment():
    one = curves_of([np.arange(0, 30), np.arange(30, 60)])
    other = curves_of([np.arange(25, 35), np.arange(70, 100)])
    segments = segments_of([one, other], 100)
    assert_array_equal(segments[:60], 1)
    assert_array_equal(segments[60:70], NO_ID)
    assert_array_equal(segments[70:], 2)


def test_that_planes_are_segments_with_the_curves_that_reach_into_them():
    plane = np.full(120, -1, np.int32)
    plane[:40], plane[40:70] = 0, 1
    overlay = StackOverlay(len(plane))
    for start in (0, 30, 60):
        overlay.add_planes(start, plane[start : start + 30])
    overlay.add_planes(90, plane[90:])
    # The stack was cut out of every other point: its first curve is 0, 2 … 8, 100, 102 … 118.
    rows = np.arange(0, 120, 2)
    curves = curves_of([np.r_[0:5, 50:60], np.arange(40, 45)])
    overlay.add(rows[curves.points].astype(np.int32), curves.starts)
    segments = overlay.number_segments()
    assert_array_equal(segments[:40], 1)
    assert_array_equal(segments[100::2], 1)
    assert_array_equal(segments[40:70], 2)
    assert_array_equal(segments[71:100], NO_ID)


def test_that_segments_are_numbered_from_the_largest_and_small_ones_are_none(rng):
    sizes = np.array([25, 60, MIN_SEGMENT, 40, MIN_SEGMENT - 1, 6])
    points = rng.permutation(sizes.sum())
    groups = np.split(points, np.cumsum(sizes)[:-1])
    segments = segments_of([curves_of(groups)], len(points))
    expected = [3, 1, 4, 2, NO_ID, NO_ID]
    for group, number in zip(groups, expected, strict=True):
        assert_array_equal(segments[group], number)


def test_that_the_order_of_stacks_and_curves_does_not_change_the_segments(rng):
    groups = [rng.choice(200, size=rng.integers(6, 30), replace=False) for _ in range(9)]
    stacks = [groups[:4], groups[4:7], groups[7:]]
    once = segments_of([curves_of(g) for g in stacks], 200)
    again = segments_of([curves_of(g[::-1]) for g in stacks[::-1]], 200)
    assert_array_equal(again, once)


def test_that_a_pipe_is_one_segment_where_stacks_of_different_directions_overlap(rng):
    # A single stack along the pipe leaves its profiles apart; an oblique one joins them.
    d = np.array([1.0, 0.0, 0.0])
    parts = [
        tube(rng, LineAxis(np.array([0.0, y, 0.0]), d, 0.6), r, noise=0.001)
        for y, r in ((0.0, 0.08), (0.5, 0.05))
    ]
    surface = sampled(*parts, voxel_mm=10)
    part = np.empty(len(surface.xyz), int)
    part[parents(surface.full_resolution_points)] = part_of(*parts)
    directions = (d, np.array([0.8, 0.6, 0.0]))
    curves = [
        segment_profiles(surface, Stack(i, e, 0.02), ProfileSettings(), 5.0)
        for i, e in enumerate(directions, start=1)
    ]
    alone = segments_of(curves[:1], len(surface.xyz))
    both = segments_of(curves, len(surface.xyz))
    assert alone.max() > 20
    # The pipe with more points is the first segment.
    assert (both[part == 0] == 1).mean() > 0.95
    assert (both[part == 1] == 2).mean() > 0.95


def test_that_no_curves_make_no_segments():
    assert_array_equal(segments_of([], 5), [NO_ID] * 5)


def test_that_segments_in_arrays_of_others_and_in_blocks_are_the_same(rng, monkeypatch):
    groups = [rng.choice(3_000, 40, replace=False) for _ in range(60)]
    curves = curves_of(groups)
    expected = segments_of([curves], 3_000)
    made = []

    def allocate(name, shape, dtype):
        made.append(name)
        return np.zeros(shape, dtype)

    monkeypatch.setattr(pipecore.segments, "BLOCK", 100)
    overlay = StackOverlay(3_000, allocate)
    overlay.add(curves.points, curves.starts)
    assert_array_equal(overlay.number_segments(), expected)
    assert len(set(made)) == len(made) == 3
