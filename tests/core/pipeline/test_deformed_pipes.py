"""Deformed pipes are found: the more a pipe is deformed, the more it is looked for."""

import numpy as np
import pytest

from pipecore import detect
from pipecore.types import DeformationKind, ElementKind, PointCloud
from tests.core.shapes import jittered, random_rotation


def pipe(rng, radius, *, ovality=0.0, waviness=0.0, arc=2 * np.pi, noise=0.001, length=None):
    """A lone pipe by formula: oval, or wavy over 0.3 radii; no simulator of ours draws it."""
    length = max(1.0, 5 * radius) if length is None else length
    s, around = jittered(rng, length, arc * radius, max(0.006, radius / 30))
    clock = around / radius - arc / 2
    rho = radius * (1 + ovality / 2 * np.cos(2 * (clock - rng.uniform(0, np.pi))))
    if waviness:
        waves = zip(
            rng.normal(0, 3.3 / radius, 150),
            np.round(rng.normal(0, 3.3, 150)),
            rng.uniform(0, 6.3, 150),
            strict=True,
        )
        field = sum(np.cos(a * s + k * clock + phase) for a, k, phase in waves)
        rho = rho + waviness * radius * field * np.sqrt(2 / 150)
    xyz = np.stack([rho * np.cos(clock), rho * np.sin(clock), s], axis=1)
    xyz = (xyz + noise * rng.normal(size=xyz.shape)) @ random_rotation(rng).T
    return PointCloud(xyz=xyz, origin=np.array([432_100.0, 6_201_870.0, 110.0])), length


@pytest.mark.parametrize("radius", [0.03, 0.0572, 0.2032, 0.3, 0.75])
@pytest.mark.parametrize("ovality", [0.03, 0.08, 0.12])
def test_that_an_oval_pipe_is_one_element_of_its_radius_and_ovality(rng, radius, ovality):
    cloud, length = pipe(rng, radius, ovality=ovality)
    (element,) = detect(cloud).elements
    assert element.kind is ElementKind.CYLINDER
    assert element.radius == pytest.approx(radius, rel=0.003, abs=3 * element.radius_sd)
    assert element.ovality == pytest.approx(ovality, rel=0.1, abs=3 * element.ovality_sd)
    assert element.axis.length == pytest.approx(length, abs=0.05)


@pytest.mark.parametrize("radius", [0.0842, 0.3, 1.5])
@pytest.mark.parametrize(
    ("arc_deg", "radius_share", "length_share"), [(360, 0.008, 0.05), (180, 0.05, 0.15)]
)
def test_that_a_pipe_of_a_wavy_surface_is_found_whole(
    rng, radius, arc_deg, radius_share, length_share
):
    """Corrosion, cladding, bark: 1 % of the radius everywhere, beyond noise.

    In 150 draws all round the radius scatters by 0.12 %, 0.5 % at the most; in 180 draws over
    180° by 0.5 % with two of 2.1 and 2.6 %, and one in ten of r = 1.5 m is 2 to 9 % too short.
    """
    cloud, length = pipe(rng, radius, waviness=0.01, arc=np.deg2rad(arc_deg))
    (element,) = detect(cloud).elements
    assert element.kind is ElementKind.CYLINDER
    assert element.radius == pytest.approx(radius, rel=radius_share)
    assert element.axis.length == pytest.approx(length, rel=length_share)


def dented(rng, shape, radius=0.1, length=3.0, noise=0.002):
    """A lone pipe, 10 mm spacing, whose radius `shape` of chainage and clock changes."""
    s, around = jittered(rng, length, 2 * np.pi * radius, 0.01)
    clock = around / radius
    rho = radius + shape(s, clock)
    xyz = np.stack([rho * np.cos(clock), rho * np.sin(clock), s], axis=1)
    xyz = (xyz + noise * rng.normal(size=xyz.shape)) @ random_rotation(rng).T
    return PointCloud(xyz=xyz, origin=np.zeros(3))


@pytest.mark.parametrize("depth", [0.02, 0.04, 0.06, 0.08])
def test_that_a_dent_is_measured_however_deep_it_is(rng, depth):
    """250 mm × 160 mm, down to 80 % of the radius: nothing but the axis bounds damage."""

    def dent(s, clock):
        along, across = (s - 1.5) / 0.25, 0.1 * (clock - np.pi) / 0.16
        inside = (np.abs(along) < 0.5) & (np.abs(across) < 0.5)
        return -depth * inside * (np.cos(np.pi * along) * np.cos(np.pi * across)) ** 2

    result = detect(dented(rng, dent))
    (element,) = result.elements
    # One draw of a hundred has a dent or bulge of noise besides.
    assert len(result.deformations) <= 2
    found = max(result.deformations, key=lambda d: d.depth)
    assert element.radius == pytest.approx(0.1, rel=0.005)
    assert found.kind is DeformationKind.DENT
    # In 120 draws depths scatter by 0.7 mm (20 mm deep) to 1.6 mm (80 mm).
    assert found.depth == pytest.approx(depth, abs=5 * (0.0004 + 0.015 * depth))
    assert abs(found.chainage - 1.5) < 0.1


@pytest.mark.parametrize("ovality", [0.06, 0.10])
def test_that_a_flattened_stretch_is_told_as_one_thing(rng, ovality):
    """0.6 m of a pipe of 3 m, with smooth ends: the pipe stays whole.

    Three of a hundred draws have one dent or bulge besides, of noise, anywhere on the pipe.
    """

    def flattened(s, clock):
        share = np.clip((0.4 - np.abs(s - 1.5)) / 0.1, 0.0, 1.0)
        return 0.1 * ovality / 2 * share * np.cos(2 * clock)

    result = detect(dented(rng, flattened))
    (element,) = result.elements
    (found,) = (d for d in result.deformations if d.kind is DeformationKind.OVALITY)
    assert len(result.deformations) <= 2
    assert element.axis.length == pytest.approx(3.0, abs=0.05)
    # The largest of noisy profiles: in 140 draws 0.0037 above, scattering by 0.0014.
    assert found.ovality == pytest.approx(ovality + 0.0037, abs=5 * 0.0014)
    assert found.chainage_start < 1.35
    assert found.chainage_end > 1.65
