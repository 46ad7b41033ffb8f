"""Whether stations fit, told from pipes whose truth is known."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from pipecore.elements import NearbyPoints
from pipecore.geometry import LineAxis
from pipecore.progress import NoProgress
from pipecore.settings import ThinningSettings
from pipecore.stations import check_stations
from pipecore.surface import sample_surface
from pipecore.types import Element, ElementKind, PointCloud, StationCheck, StationVerdict

NOISE, SPACING = 0.002, 0.02
SCANNERS = np.array([[-5.0, -6.0, 3.0], [7.0, -5.0, 2.0]])
THREE_WAYS = [
    ((0, 0, 0), (4, 0, 0), 0.11),
    ((0, 1, 0.5), (4, 1.2, 0.6), 0.084),
    ((1, -1, 0), (1, 3, 0), 0.14),
    ((3, -1, 1.5), (3, 3, 1.5), 0.057),
    ((0, 2, -1), (0, 2, 2), 0.16),
    ((4, 2, -1), (4, 2, 2), 0.11),
]
PARALLEL = [((0, y, z), (5, y, z), 0.11) for y, z in ((0, 0), (0, 1), (1.5, 0.3), (2.5, 1.0))]


def element(number, start, end, radius):
    axis = LineAxis.between(np.array(start, float), np.array(end, float))
    return Element(
        number, number, ElementKind.CYLINDER, axis, radius, 1e-4, radius, np.full(3, np.nan),
        1000, 100, np.pi, NOISE,
    )  # fmt: skip


def seen(rng, pipe, scanner, is_seen=lambda xyz: np.ones(len(xyz), bool)):
    """Points of the side of a pipe that faces a scanner, with noise along its beams."""
    axis, radius = pipe.axis, pipe.radius
    n = int(2 * np.pi * radius * axis.length / SPACING**2)
    chainage, clock = rng.uniform(0, axis.length, n), rng.uniform(0, 2 * np.pi, n)
    up, right = axis.frame(chainage)
    normal = np.cos(clock)[:, None] * up + np.sin(clock)[:, None] * right
    xyz = axis.at(chainage) + radius * normal
    beam = xyz - scanner
    beam /= np.linalg.norm(beam, axis=1, keepdims=True)
    facing = -np.einsum("ij,ij->i", beam, normal)
    keep = (facing > rng.uniform(0, 1, n)) & is_seen(xyz)
    return xyz[keep] + NOISE * rng.standard_normal((keep.sum(), 1)) * beam[keep]


def check(pipes, views) -> StationCheck:
    """What is told of the views of stations: their points, the scanners where they are thought."""
    points, scanners = zip(*views, strict=True)
    station = np.repeat(np.arange(len(points)) + 1, [len(p) for p in points])
    cloud = PointCloud.from_points(np.concatenate(points), station=station, stations=scanners)
    surface = sample_surface(cloud, ThinningSettings(), NoProgress())
    found = check_stations(cloud, pipes, NearbyPoints(cloud, surface), 0.002, NoProgress())
    assert found is not None
    return found


def moved(xyz, shift, turn, pivot):
    return pivot + Rotation.from_rotvec(turn).apply(xyz - pivot) + shift


def two_views(rng, pipes, shift, turn):
    """Two stations' points, those of the second moved; and the correction that undoes it."""
    first, second = (np.concatenate([seen(rng, p, s) for p in pipes]) for s in SCANNERS)
    pivot = second.mean(axis=0)
    there = moved(second, shift, turn, pivot)
    scanner = moved(SCANNERS[1], shift, turn, pivot)
    return [(first, SCANNERS[0]), (there, scanner)]


@pytest.mark.parametrize("far", [0.0, 1.0, 3.0])
def test_that_corrections_are_told_to_their_standard_deviations(rng, far):
    pipes = [element(i, *p) for i, p in enumerate(THREE_WAYS, start=1)]
    shift, turn = far * np.array([1.5e-3, -1e-3, 0.8e-3]), far * np.array([2e-4, -1e-4, 3e-4])
    second = check(pipes, two_views(rng, pipes, shift, turn)).stations[1].correction
    assert second.untold == ()
    for estimate, sd, truth in (
        (second.shift, second.shift_sd, -shift),
        (second.rotation, second.rotation_sd, -turn),
    ):
        # Twelve normal numbers beyond four standard deviations once in 1,300 seeds.
        assert_allclose((estimate - truth) / sd, 0, atol=4)
    assert (second.shift_sd < 5e-4).all()
    expected = StationVerdict.DOES_NOT_FIT if far > 1 else StationVerdict.FITS
    assert second.verdict is expected


def test_that_parallel_pipes_say_that_nothing_can_be_told_along_them(rng):
    pipes = [element(i, *p) for i, p in enumerate(PARALLEL, start=1)]
    views = two_views(rng, pipes, np.array([8e-3, 0, 0]), np.zeros(3))
    second = check(pipes, views).stations[1].correction
    assert second.verdict is StationVerdict.NOT_MEASURABLE
    (along,) = second.untold
    assert_allclose(along, [1, 0, 0], atol=0.01)
    assert np.isnan(second.shift[0])
    assert np.isfinite(second.shift[1:]).all()
    assert "Along (1.00" in second.reason


def test_that_tiles_of_one_scan_raise_no_alarm(rng):
    pipes = [element(i, *p) for i, p in enumerate(THREE_WAYS, start=1)]
    halves = [
        np.concatenate([seen(rng, p, SCANNERS[0], part) for p in pipes])
        for part in (lambda xyz: xyz[:, 0] < 2.0, lambda xyz: xyz[:, 0] >= 2.0)
    ]
    found = check(pipes, [(half, SCANNERS[0]) for half in halves])
    assert found.verdict is not StationVerdict.DOES_NOT_FIT


def test_that_a_cloud_of_one_station_is_not_checked(rng):
    pipes = [element(1, *THREE_WAYS[0])]
    cloud = PointCloud.from_points(seen(rng, pipes[0], SCANNERS[0]))
    surface = sample_surface(cloud, ThinningSettings(), NoProgress())
    nearby = NearbyPoints(cloud, surface)
    assert check_stations(cloud, pipes, nearby, 0.002, NoProgress()) is None
