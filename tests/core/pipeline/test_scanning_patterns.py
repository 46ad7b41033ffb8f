"""Scans whose points are rounded, or lie in rows far wider apart than the points in a row."""

import numpy as np
import pytest

from pipecore import detect
from pipecore.rounding import Rounding, measured_step
from pipecore.types import PointCloud

LENGTH = 1.5


def on_pipe(radius: float, axis, chainage, clock, rng, noise: float) -> np.ndarray:
    along = np.asarray(axis, float) / np.linalg.norm(axis)
    right = np.cross(along, [0.3, 0.5, 0.81])
    right /= np.linalg.norm(right)
    outward = np.cos(clock)[:, None] * right + np.sin(clock)[:, None] * np.cross(along, right)
    off = radius + rng.normal(0, noise, len(clock))
    return chainage[:, None] * along + off[:, None] * outward + rng.uniform(0, 1, 3)


def rounded_pipe(step: float, axis, seed: int) -> PointCloud:
    rng = np.random.default_rng(seed)
    n = 25_000
    chainage, clock = rng.uniform(0, LENGTH, n), rng.uniform(0, 2 * np.pi, n)
    xyz = on_pipe(0.1, axis, chainage, clock, rng, 0.001)
    return PointCloud.from_points(np.round(xyz / step) * step)


@pytest.mark.parametrize("axis", [(1, 0, 0), (0.3, -0.7, 0.4)], ids=["parallel", "oblique"])
@pytest.mark.parametrize("step", [0.005, 0.01])
def test_that_rounding_is_no_deformation_and_stands_in_the_sds(step, axis):
    # A centimetre made 29 dents of a pipe along a coordinate axis, and 31 of oblique ones.
    cloud = rounded_pipe(step, axis, 3)
    assert cloud.step == pytest.approx(step)
    result = detect(cloud)
    [pipe] = result.elements
    assert not result.deformations
    assert abs(pipe.radius - 0.1) < 3 * pipe.radius_sd
    assert pipe.radius_sd < 0.01 * 0.1


def test_that_noise_dithers_what_neighbours_are_rounded_alike():
    rounding = Rounding(0.01)
    assert rounding.neighbours_sd(0.0) == pytest.approx(0.01 / np.sqrt(12))
    # Widrow: noise of half a step leaves 0.7 % of it.
    scatter = np.sqrt(0.005**2 + 0.01**2 / 12)
    assert rounding.neighbours_sd(scatter) == pytest.approx(0.0072 * 0.01 / np.sqrt(12), rel=0.01)


@pytest.mark.parametrize("seed", range(3))
def test_that_the_sd_of_a_rounded_radius_is_that_of_many_pipes(seed):
    # Against the mean distance of many exact circles on a lattice, from a known centre.
    rng = np.random.default_rng(seed)
    radius, step = 0.1, 0.01
    clock = np.linspace(0, 2 * np.pi, 20_000, endpoint=False)
    outward = np.stack([np.cos(clock), np.sin(clock)], axis=1)
    errors = []
    for centre in rng.uniform(0, step, (400, 2)):
        exact = centre + radius * outward
        off = np.round(exact / step) * step - exact
        errors.append((off * outward).sum(axis=1).mean())
    claimed = Rounding(step).radius_sd(radius, np.array([0.0, 0.0, 1.0]), 1.0, 0.0)
    assert claimed == pytest.approx(np.std(errors), rel=0.15)


@pytest.mark.parametrize(("gap", "along", "is_ring"), [(0.02, 0.002, True), (0.03, 0.004, False)])
def test_that_a_pipe_of_rows_of_points_is_found(gap, along, is_ring):
    # A neighbourhood that holds one row alone has no normal: nothing was found, nor said.
    rng = np.random.default_rng(4)
    radius = 0.057
    s, t = (np.arange(0, LENGTH, gap), np.arange(0, 2 * np.pi, along / radius))
    if not is_ring:
        s, t = (np.arange(0, LENGTH, along), np.arange(0, 2 * np.pi, gap / radius))
    chainage, clock = (a.ravel() for a in np.meshgrid(s, t))
    xyz = on_pipe(radius, (0.8, 0.2, 0.3), chainage, clock, rng, 0.001)
    result = detect(PointCloud.from_points(xyz))
    [pipe] = result.elements
    assert pipe.radius == pytest.approx(radius, abs=0.0001)
    assert pipe.axis.length == pytest.approx(LENGTH, abs=0.04)
    assert not result.deformations


def test_that_steps_are_seen_in_arrays():
    xyz = np.round(np.random.default_rng(1).uniform(0, 1, (3000, 3)), 2)
    assert measured_step(xyz) == pytest.approx(0.01)
    assert measured_step(xyz + np.random.default_rng(2).normal(0, 1e-4, xyz.shape)) == 0.0
