"""Bowed, sagging and kinked pipes are one cylinder about a curved axis."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from pipecore import detect, load
from pipecore.editing import split_element
from pipecore.elements.refinement.curved_fit import curve_through, straightened
from pipecore.geometry import Array, CurveAxis, LineAxis, surface_points
from pipecore.report import write_report
from pipecore.types import DeformationKind, Element, ElementKind, PointCloud, Result
from tests.core.shapes import bowed_axis, random_rotation

RADIUS, LENGTH, SPACING, NOISE = 0.1, 4.0, 0.007, 0.001


def arc(bow: float) -> Callable[[Array], Array]:
    return lambda t: 4 * bow * t * (1 - t)


def sag(bow: float) -> Callable[[Array], Array]:
    """A beam under an even load."""
    return lambda t: 16 / 5 * bow * (t**4 - 2 * t**3 + t)


def kink(angle_deg: float) -> Callable[[Array], Array]:
    turn = np.tan(np.deg2rad(angle_deg) / 2)
    return lambda t: LENGTH * turn * np.minimum(t, 1 - t)


def scanned(
    rng: np.random.Generator, sideways: Callable[[Array], Array], arc_deg: float = 360.0
) -> PointCloud:
    """Points around a pipe whose axis is moved sideways, in any attitude."""
    n = int(2 * np.pi * RADIUS * LENGTH / SPACING**2 * arc_deg / 360)
    t, theta = rng.uniform(0, 1, n), np.deg2rad(rng.uniform(-arc_deg / 2, arc_deg / 2, n)) + 1.0
    step = 1e-5
    slope = (sideways(t + step) - sideways(t - step)) / (2 * step * LENGTH)
    centre = np.stack([LENGTH * t, sideways(t), np.zeros(n)], axis=1)
    ahead = np.stack([np.ones(n), slope, np.zeros(n)], axis=1) / np.sqrt(1 + slope**2)[:, None]
    aside = np.stack([-ahead[:, 1], ahead[:, 0], np.zeros(n)], axis=1)
    across = np.cos(theta)[:, None] * aside + np.sin(theta)[:, None] * np.cross(ahead, aside)
    xyz = centre + (RADIUS + rng.normal(0, NOISE, n))[:, None] * across
    return PointCloud.from_points(xyz @ random_rotation(rng) + rng.uniform(-3, 3, 3))


def only_element(result: Result) -> Element:
    (element,) = result.elements
    return element


@pytest.mark.parametrize("arc_deg", [360.0, 170.0])
@pytest.mark.parametrize("shape", [arc, sag])
@pytest.mark.parametrize("bow", [0.03, 0.1, 0.2])
def test_that_a_bowed_pipe_is_one_with_its_radius_length_and_bow(rng, shape, bow, arc_deg):
    result = detect(scanned(rng, shape(bow), arc_deg))
    pipe = only_element(result)
    assert pipe.kind is ElementKind.CYLINDER
    assert isinstance(pipe.axis, CurveAxis)
    assert pipe.radius == pytest.approx(RADIUS, rel=0.003)
    assert pipe.axis.length == pytest.approx(LENGTH, abs=0.04)
    assert pipe.straightness == pytest.approx(bow, rel=0.03)
    (found,) = result.deformations
    assert found.kind is DeformationKind.BOW
    assert found.depth == pytest.approx(bow, rel=0.03)
    assert found.chainage == pytest.approx(LENGTH / 2, abs=0.1)


def test_that_a_small_bow_seen_from_one_side_does_not_widen_the_pipe(rng):
    """One straight carries it all, off by a tenth of the radius, and was 0.4 % too wide."""
    pipe = only_element(detect(scanned(rng, arc(0.01), arc_deg=150.0)))
    assert isinstance(pipe.axis, CurveAxis)
    assert pipe.radius == pytest.approx(RADIUS, rel=0.003)
    assert pipe.axis.length == pytest.approx(LENGTH, abs=0.04)


@pytest.mark.parametrize("angle_deg", [3.0, 8.0])
def test_that_a_kinked_pipe_is_one_with_its_kink(rng, angle_deg):
    result = detect(scanned(rng, kink(angle_deg)))
    pipe = only_element(result)
    assert pipe.radius == pytest.approx(RADIUS, rel=0.003)
    (found,) = result.deformations
    assert found.kind is DeformationKind.KINK
    height = LENGTH / 2 * np.tan(np.deg2rad(angle_deg) / 2)
    assert found.depth == pytest.approx(height, rel=0.05)
    assert found.chainage == pytest.approx(LENGTH / 2, abs=0.1)


def test_that_a_gentle_bend_between_straights_is_no_bow(rng):
    """It turns the run by 45° with a radius of 30 pipe radii: the middle is 10 % off the chord."""
    half, turn, far = 1.5, np.deg2rad(45.0), 30 * RADIUS
    n = int(2 * np.pi * RADIUS * (2 * half + far * turn) / 0.008**2)
    s, theta = rng.uniform(0, 2 * half + far * turn, n), rng.uniform(0, 2 * np.pi, n)
    phi = np.clip((s - half) / far, 0, turn)
    beyond = np.maximum(s - half - far * turn, 0)
    x = np.minimum(s, half) + far * np.sin(phi) + beyond * np.cos(phi)
    y = far * (1 - np.cos(phi)) + beyond * np.sin(phi)
    aside = np.stack([-np.sin(phi), np.cos(phi), np.zeros(n)], axis=1)
    across = np.cos(theta)[:, None] * aside + np.sin(theta)[:, None] * np.array([0.0, 0.0, 1.0])
    xyz = np.stack([x, y, np.zeros(n)], axis=1) + RADIUS * across
    result = detect(PointCloud.from_points(xyz + rng.normal(0, 0.0015, xyz.shape)))
    whole = 2 * half + far * turn
    assert max(e.axis.length for e in result.elements) < 0.9 * whole


def test_that_a_straight_pipe_has_a_straight_axis(rng):
    pipe = only_element(detect(scanned(rng, arc(0.0))))
    assert isinstance(pipe.axis, LineAxis)


def test_that_a_pipe_is_not_followed_into_its_bend(rng):
    """A bend of 3 radii at the end of a straight pipe is a torus, and the pipe stays straight."""
    n_straight, n_bend = 30_000, 9_000
    t, theta = rng.uniform(0, 2.0, n_straight), rng.uniform(0, 2 * np.pi, n_straight)
    straight = np.stack([t, RADIUS * np.cos(theta), RADIUS * np.sin(theta)], axis=1)
    turn, theta = rng.uniform(0, np.pi / 2, n_bend), rng.uniform(0, 2 * np.pi, n_bend)
    far = 3 * RADIUS - RADIUS * np.cos(theta)
    bend = np.stack(
        [2.0 + far * np.sin(turn), 3 * RADIUS - far * np.cos(turn), RADIUS * np.sin(theta)], axis=1
    )
    xyz = np.concatenate([straight, bend])
    result = detect(PointCloud.from_points(xyz + rng.normal(0, 0.001, xyz.shape)))
    pipes = [e for e in result.elements if e.kind is ElementKind.CYLINDER]
    assert all(isinstance(e.axis, LineAxis) for e in pipes)
    assert max(pipes, key=lambda e: e.axis.length).axis.length == pytest.approx(2.0, abs=0.03)


def test_that_a_bowed_pipe_is_saved_and_loaded(rng, tmp_path: Path):
    cloud = scanned(rng, sag(0.1))
    result = detect(cloud)
    write_report(tmp_path / "report", cloud, result)
    before, after = only_element(result).axis, only_element(load(tmp_path / "report")).axis
    assert isinstance(after, CurveAxis)
    s = np.linspace(0, before.length, 9)
    assert_allclose(after.at(s), before.at(s), atol=1e-9)


def test_that_a_bowed_pipe_is_split_and_merged(rng):
    cloud = scanned(rng, arc(0.1))
    result = detect(cloud)
    parts = split_element(cloud, result, 1, 1.5)
    assert len(parts.elements) == 2
    for part in parts.elements:
        assert part.radius == pytest.approx(RADIUS, rel=0.003)
    lengths = sorted(e.axis.length for e in parts.elements)
    assert_allclose(lengths, [1.5, only_element(result).axis.length - 1.5], atol=0.02)


def test_that_points_about_a_curve_made_straight_lie_about_its_chord(rng):
    axis = bowed_axis(rng)
    s, clock = rng.uniform(0, axis.length, 200), rng.uniform(0, 2 * np.pi, 200)
    moved = straightened(surface_points(axis, s, 0.05, clock), axis)
    chainage, distance, angle = axis.chord.pipe_coordinates(moved)
    assert_allclose(distance, 0.05, atol=1e-9)
    assert_allclose(chainage, s / axis.length * axis.chord.length, atol=1e-9)
    assert_allclose(np.exp(1j * angle), np.exp(1j * clock), atol=1e-9)


def test_that_places_that_turn_back_make_no_axis():
    there = np.linspace([0.0, 0.0, 0.0], [1.0, 0.1, 0.0], 9)
    axis = curve_through(there, 4)
    assert axis is not None
    assert axis.length == pytest.approx(np.hypot(1.0, 0.1))
    back = there.copy()
    back[5] = back[3]
    assert curve_through(back, 4) is None
    assert curve_through(there[:1].repeat(9, axis=0), 4) is None
