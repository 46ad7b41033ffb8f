"""Cutting profiles, joining points and uniting groups, against plain twins."""

import itertools
import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

from pipecore._kernels import disjoint_sets, profile_cuts
from tests.core.shapes import random_rotation, unit_rows

pytestmark = pytest.mark.kernels


def partition(labels):
    """Sets of the indices that share a label."""
    return {tuple(np.flatnonzero(labels == k)) for k in np.unique(labels)}


def connected(n, is_linked):
    """Label of each of `n` items by flooding."""
    label = np.full(n, -1)
    for seed in range(n):
        stack = [seed] if label[seed] < 0 else []
        while stack:
            i = stack.pop()
            if label[i] < 0:
                label[i] = seed
                stack += [j for j in range(n) if j != i and label[j] < 0 and is_linked(i, j)]
    return label


def test_that_points_are_carried_within_their_tangent_plane_to_the_mid_plane(rng):
    frame = random_rotation(rng)
    xyz = rng.uniform(-3, 3, (60, 3))
    normals = unit_rows(rng.normal(size=(60, 3)))
    normals[7] = np.nan
    width, offset, max_slope = 0.4, 0.13, 0.62
    spacing = rng.uniform(0.0, 1.0, 60)
    cut = profile_cuts.StackCut(frame[2], frame[0], frame[1], width, offset)
    index = np.empty(60, np.int32)
    limits = [
        profile_cuts.find_profiles(xyz, normals, spacing, a, b, cut, max_slope, 0.2, index)
        for a, b in ((0, 25), (25, 60))
    ]
    slope = np.abs(normals @ frame[2])
    usable = index != profile_cuts.NOT_CUT
    assert list(usable) == [
        bool(s < max_slope and d >= 0.2) for s, d in zip(slope, spacing, strict=True)
    ]
    assert 10 < usable.sum() < 59
    assert min(low for low, _ in limits) == index[usable].min()
    assert max(high for _, high in limits) == index[usable].max()
    points = np.flatnonzero(usable)[::-1]
    profile = np.zeros(60, np.int32)
    uv, mapped = np.empty((60, 2)), np.empty((60, 3))
    places, at, turned = (a[: len(points)].copy() for a in (profile, uv, mapped))
    profile_cuts.carry_to_mid_planes(xyz, normals, points, cut, places, at, turned)
    profile[points], uv[points], mapped[points] = places, at, turned
    assert list(profile[usable]) == list(index[usable])
    for i in points:
        along = xyz[i] @ frame[2]
        assert profile[i] == math.floor((along - offset) / width)
        middle = offset + (profile[i] + 0.5) * width
        carried = uv[i] @ frame[:2] + middle * frame[2]
        moved = carried - xyz[i]
        assert moved @ normals[i] == pytest.approx(0.0, abs=1e-12)
        # Straight down the slope: no sideways component.
        sideways = np.cross(normals[i], frame[2])
        assert moved @ sideways == pytest.approx(0.0, abs=1e-12)
        assert_allclose(mapped[i], frame @ normals[i], atol=1e-12)


def lie_on_one_curve(p, q, m, n, reach, corner_deg, offset, slope):
    """What `are_joined` says, by angles."""
    chord = np.linalg.norm(q - p)
    if chord > reach:
        return False
    if corner_deg is None:
        return True
    m, n = m / np.linalg.norm(m), n / np.linalg.norm(n)
    n = n if m @ n >= 0 else -n
    if np.degrees(np.arccos(min(1.0, m @ n))) > corner_deg:
        return False
    bisector = (m + n) / np.linalg.norm(m + n)
    return abs((q - p) @ bisector) <= offset + slope * chord


@pytest.mark.parametrize("corner_deg", [None, 40.0])
@pytest.mark.parametrize("is_uneven", [False, True])
def test_that_joined_points_are_the_components_of_the_graph_of_neighbours(
    rng, corner_deg, is_uneven
):
    n, cell, n_profiles = 90, 0.1, 3
    profile = np.sort(rng.integers(0, n_profiles, n))
    uv = rng.uniform(0, 1, (n, 2)) * [1.0, 0.4]
    angle = np.arctan2(uv[:, 1] - 0.2, uv[:, 0] - 0.5) + 0.4 * rng.normal(size=n)
    normals = np.stack([np.cos(angle), np.sin(angle), 0.3 * rng.normal(size=n)], axis=1)
    normals[::2] *= -1
    reach = np.full(n, cell)
    if is_uneven:
        reach = rng.uniform(cell, 3.5 * cell, n)
    cells = np.floor(uv / cell).astype(np.int64)
    n_u, n_v = cells.max(axis=0) + 12
    keys = (profile * n_u + cells[:, 0]) * n_v + cells[:, 1]
    order = np.argsort(keys, kind="stable")
    keys, profile, uv = keys[order], profile[order], uv[order]
    normals, reach = normals[order], reach[order]
    cos_corner = -1.0 if corner_deg is None else np.cos(np.radians(corner_deg))
    smoothness = profile_cuts.Smoothness(cos_corner, 0.01, 0.12)
    parents = np.arange(n)
    bounds = np.searchsorted(profile, [0, 2, n_profiles])
    for start, stop in itertools.pairwise(bounds):
        profile_cuts.join_neighbours(
            keys, n_v, cell, uv, normals, reach, smoothness, start, stop, parents
        )

    def is_linked(i, j):
        return profile[i] == profile[j] and lie_on_one_curve(
            uv[i], uv[j], normals[i, :2], normals[j, :2], max(reach[i], reach[j]),
            corner_deg, 0.01, 0.12,
        )  # fmt: skip

    assert partition(parents) == partition(connected(n, is_linked))


def test_that_groups_with_a_common_point_become_one(rng):
    n = 40
    groups = [rng.choice(n, size=k, replace=False) for k in (1, 4, 5, 3, 6, 2)]
    starts = np.cumsum([0, *map(len, groups)])
    parents = np.arange(n)
    disjoint_sets.unite_groups(np.concatenate(groups), starts, parents)
    disjoint_sets.flatten(parents)
    sets = [set(map(int, g)) for g in groups]
    label = connected(n, lambda i, j: any({i, j} <= s for s in sets))
    assert partition(parents) == partition(label)
    assert all(parents[i] == min(np.flatnonzero(parents == parents[i])) for i in range(n))


def test_that_points_are_sorted_by_profile_and_cell(rng):
    n, cell = 80, 0.25
    profile = np.sort(rng.integers(-3, 2, n)).astype(np.int32)
    uv = rng.uniform(-1, 1, (n, 2)) * [1.0, 0.5]
    order, keys, n_v = profile_cuts.sort_by_cell(profile, uv, cell, 12)
    cells = np.floor(uv / cell).astype(int)
    expected = np.lexsort((cells[:, 1], cells[:, 0], profile))
    assert list(order) == list(expected)
    # Cells within the margin of each other differ in their keys as they differ in place.
    same = profile[order][1:] == profile[order][:-1]
    step = np.diff(cells[order], axis=0)
    assert_allclose(np.diff(keys)[same], (step[:, 0] * n_v + step[:, 1])[same])
    assert n_v >= np.ptp(cells[:, 1]) + 12


def test_that_groups_are_gathered_with_their_profiles(rng):
    points = rng.permutation(20).astype(np.int32)
    uv, normals = rng.normal(size=(20, 2)), rng.normal(size=(20, 3))
    profile = np.repeat([4, 5], 10).astype(np.int32)
    members, starts = np.array([3, 1, 7, 15, 11]), np.array([0, 3, 5])
    of, places, vectors, index = profile_cuts.gather(points, uv, normals, profile, members, starts)
    assert list(of) == list(points[members])
    assert_allclose(places, uv[members])
    assert_allclose(vectors, normals[members])
    assert list(index) == [4, 5]
