from dataclasses import replace

import numpy as np
import pytest

from pipecore.deformation import find_deformations
from pipecore.deformation.criteria import ProfileCriteria
from pipecore.deformation.deviation_map import DeviationMap, Grid
from pipecore.deformation.free_sections import FreeSections, diameters
from pipecore.settings import DeformationSettings
from pipecore.types import DeformationKind, SeenBy
from tests.core.deformation.sampler import PipeScene

R, LENGTH, NOISE, COUNT = 0.1, 3.0, 0.002, 4
SETTINGS = DeformationSettings(significance=6.5)
VIEWS = (0.0, 2.1, 4.2)


def noisy_map(rng, shape) -> DeviationMap:
    """Return a map of a pipe all round, with four points a cell, deformed by a function."""
    grid = Grid(LENGTH, R, 300, 63)
    s, theta = np.meshgrid(grid.chainages, grid.clocks, indexing="ij")
    height = shape(s, theta) + rng.normal(0, NOISE / np.sqrt(COUNT), grid.shape)
    flat = np.full(grid.shape, NOISE)
    return DeviationMap(
        grid, height, flat, np.full(grid.shape, float(COUNT)), np.zeros(grid.shape, bool)
    )


def window(s, length=0.3):
    return (np.abs(s - LENGTH / 2) < length / 2) * 1.0


SIZE = 10.0 * NOISE / np.sqrt(COUNT * 63)
"""A mean radius ten standard deviations of one profile off."""

SHAPES = {
    "radius": (SeenBy.AXES, lambda s, t: -SIZE * window(s)),
    "ovality": (SeenBy.AXES, lambda s, t: 1.6 * SIZE * window(s) * np.cos(2 * t)),
    "centres": (SeenBy.CENTRES, lambda s, t: 1.6 * SIZE * window(s) * np.cos(t - 1.0)),
    "curvature": (SeenBy.CURVATURE, lambda s, t: 1.6 * SIZE * window(s) * np.cos(4 * t)),
}


@pytest.mark.parametrize("name", list(SHAPES))
def test_that_a_criterion_sees_what_is_significant_and_nothing_else(rng, name):
    criterion, shape = SHAPES[name]
    seen = ProfileCriteria.of(noisy_map(rng, shape), 5.5).seen
    s = Grid(LENGTH, R, 300, 63).chainages
    assert seen[criterion][np.abs(s - LENGTH / 2) < 0.1].any()
    assert not seen[criterion][np.abs(s - LENGTH / 2) > 0.3].any()
    assert not any(flags.any() for c, flags in seen.items() if c is not criterion)


@pytest.mark.parametrize("name", list(SHAPES))
def test_that_a_criterion_sees_nothing_just_inside_the_noise(rng, name):
    _, shape = SHAPES[name]
    cells = noisy_map(rng, lambda s, t: 0.05 * shape(s, t))
    assert not any(flags.any() for flags in ProfileCriteria.of(cells, 5.5).seen.values())


def test_that_sound_profiles_raise_no_alarm_however_many(rng):
    for _ in range(10):
        seen = ProfileCriteria.of(noisy_map(rng, lambda s, t: 0.0 * s), 5.5).seen
        assert not any(flags.any() for flags in seen.values())


def test_that_what_the_whole_pipe_does_is_its_own_pattern(rng):
    taper = noisy_map(rng, lambda s, t: 0.002 * s + 0.004 * np.cos(t) * (s / LENGTH) ** 2)
    assert not any(flags.any() for flags in ProfileCriteria.of(taper, 5.5).seen.values())


@pytest.mark.parametrize("offset", [0.005, 0.02])
def test_that_a_round_pipe_off_its_axis_is_round(rng, offset):
    def shape(s, t):
        return offset * np.cos(t) + np.sqrt(R**2 - (offset * np.sin(t)) ** 2) - R

    terms, _ = FreeSections.of(noisy_map(rng, shape)).pooled(31).fit(5)
    middle = terms[150]
    assert middle[1] == pytest.approx(offset, abs=2e-4)
    assert np.hypot(middle[3], middle[4]) < 2.5e-4
    assert abs(middle[0]) < 1.5e-4


def test_that_diameters_are_a_calipers():
    ellipse = np.array([[0.001, 0.02, 0.03, 0.004, 0.0]])
    largest, smallest = diameters(ellipse, R)
    assert largest[0] == pytest.approx(0.21)
    assert smallest[0] == pytest.approx(0.194)


def crumple(s, _theta):
    inside = np.abs(s - 1.5) < 0.2
    return 0.008 * np.sin(2 * np.pi * s / 0.1) * np.cos(np.pi * (s - 1.5) / 0.4) * inside


def twist(s, theta):
    return 0.003 * np.cos(2 * (theta - np.pi * s / LENGTH))


def flat(s, theta):
    inside = np.clip((0.3 - np.abs(s - 1.5)) / 0.15, 0, 1)
    return 0.01 * np.cos(2 * (theta - 0.3)) * (1 - np.cos(np.pi * inside)) / 2


def found_on(rng, shape, **scene):
    scan = PipeScene(radius=R, length=LENGTH, views=VIEWS, shapes=[shape], **scene).scan(rng)
    return find_deformations(scan.element, scan.xyz, scan.normals, (), SETTINGS).deformations


def test_that_a_crumple_is_one_row_with_its_rings_and_extent(rng):
    (d,) = found_on(rng, crumple)
    assert d.kind is DeformationKind.CRUMPLE
    assert SeenBy.AXES in d.seen_by
    assert d.depth == pytest.approx(0.008, rel=0.1)
    assert d.chainage_start == pytest.approx(1.3, abs=0.08)
    assert d.chainage_end == pytest.approx(1.7, abs=0.08)
    assert d.dmax == pytest.approx(2 * (R + 0.008), abs=0.005)
    assert d.dmin == pytest.approx(2 * (R - 0.008), abs=0.005)


def test_that_an_oval_that_turns_is_a_twist(rng):
    (d,) = found_on(rng, twist)
    assert d.kind is DeformationKind.TWIST
    assert d.ovality == pytest.approx(0.06, rel=0.1)
    assert d.chainage_end - d.chainage_start > 0.9 * LENGTH


def test_that_a_flattened_stretch_is_ovality_of_its_own_size(rng):
    (d,) = found_on(rng, flat)
    assert d.kind is DeformationKind.OVALITY
    assert d.seen_by == (SeenBy.AXES,)
    assert d.ovality == pytest.approx(0.2, rel=0.1)


def test_that_what_is_flattened_by_half_its_diameter_is_crushed(rng):
    (d,) = found_on(rng, lambda s, t: 5.0 * flat(s, t))
    assert d.kind is DeformationKind.CRUSHED
    assert d.dmin < 0.55 * 2 * R


def test_that_an_oval_seen_from_one_side_is_told_as_no_bow(rng):
    scene = PipeScene(radius=R, length=LENGTH, views=(0.0,), arc=np.deg2rad(160), shapes=[twist])
    scan = scene.scan(rng)
    finding = find_deformations(scan.element, scan.xyz, scan.normals, (), SETTINGS)
    assert finding.deformations == ()
    assert {"ovality", "straightness"} <= finding.not_measurable.keys()
    deeper = replace(SETTINGS, min_depth_mm=1.0)
    kinds = {d.kind for d in find_deformations(
        scan.element, scan.xyz, scan.normals, (), deeper
    ).deformations}  # fmt: skip
    assert DeformationKind.BOW not in kinds


def test_that_a_stretch_that_cannot_be_measured_is_told_with_its_place(rng):
    scan = PipeScene(radius=R, length=LENGTH, views=VIEWS).scan(rng)
    chainage, _, _ = scan.element.axis.pipe_coordinates(scan.xyz)
    seen = np.abs(chainage - 1.5) > 0.2
    finding = find_deformations(scan.element, scan.xyz[seen], scan.normals[seen], (), SETTINGS)
    assert finding.deformations == ()
    stretches = finding.not_measurable["profiles"].values["stretches"]
    first, last = (float(x) for x in stretches.split("–"))
    assert first == pytest.approx(1.3, abs=0.02)
    assert last == pytest.approx(1.7, abs=0.02)
