"""Cones and spheres that no pipe leads to."""

import numpy as np
import pytest

from pipecore import detect
from pipecore.types import Element, ElementKind, PointCloud
from tests.core.shapes import random_rotation


def cone(
    rng: np.random.Generator,
    radii: tuple[float, float],
    length: float,
    arc_deg: float = 360.0,
    spacing: float = 0.01,
    noise: float = 0.002,
) -> PointCloud:
    n = int(np.deg2rad(arc_deg) * np.mean(radii) * length / spacing**2)
    share = np.sqrt(rng.uniform(min(radii) ** 2, max(radii) ** 2, n))
    t = (share - radii[0]) / (radii[1] - radii[0])
    theta = np.deg2rad(rng.uniform(-arc_deg / 2, arc_deg / 2, n))
    rho = share + rng.normal(0, noise, n)
    xyz = np.stack([length * t, rho * np.cos(theta), rho * np.sin(theta)], axis=1)
    return PointCloud.from_points(xyz @ random_rotation(rng) + rng.uniform(-3, 3, 3))


def ball(rng: np.random.Generator, radius: float, spacing: float, noise: float) -> PointCloud:
    n = int(4 * np.pi * radius**2 / spacing**2)
    v = rng.normal(size=(n, 3))
    v *= ((radius + rng.normal(0, noise, n)) / np.linalg.norm(v, axis=1))[:, None]
    return PointCloud.from_points(v + rng.uniform(-3, 3, 3))


def only_element(cloud: PointCloud) -> Element:
    (element,) = detect(cloud).elements
    return element


@pytest.mark.parametrize("arc_deg", [360.0, 170.0])
@pytest.mark.parametrize(("radii", "length"), [((0.2, 0.1), 1.0), ((0.2, 0.1), 0.5)])
def test_that_a_lone_cone_is_found_with_both_radii(rng, radii, length, arc_deg):
    found = only_element(cone(rng, radii, length, arc_deg))
    assert found.kind is ElementKind.CONE
    assert sorted((found.radius, found.radius_end)) == pytest.approx(sorted(radii), abs=0.002)
    assert found.axis.length == pytest.approx(length, abs=0.02)


@pytest.mark.parametrize("spacing", [0.01, 0.02])
@pytest.mark.parametrize("noise", [0.001, 0.003])
def test_that_a_lone_sphere_is_found_whatever_its_noise_and_spacing(rng, spacing, noise):
    found = only_element(ball(rng, 0.25, spacing, noise))
    assert found.kind is ElementKind.SPHERE
    assert found.radius == pytest.approx(0.25, abs=5 * found.radius_sd + 1e-4)


def test_that_what_is_flatter_than_a_sphere_is_none(rng):
    """A vessel's head: half as high as wide."""
    cloud = ball(rng, 0.25, 0.01, 0.001)
    flat = cloud.world(cloud.xyz)
    flat[:, 2] = flat[:, 2].mean() + 0.9 * (flat[:, 2] - flat[:, 2].mean())
    kinds = [e.kind for e in detect(PointCloud.from_points(flat)).elements]
    assert ElementKind.SPHERE not in kinds
