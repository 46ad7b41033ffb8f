import numpy as np
import pytest

from pipecore.geometry import LineAxis
from pipecore.types import DeformationKind, ElementKind
from tools.world.assembly import Assembly, Role, Run
from tools.world.clutter import CLUTTER
from tools.world.pipes import FEATURES, bowed
from tools.world.shapes import DENT_PROFILES, Dent, Oval, Waves
from tools.world.surfaces import area, random_direction, sample
from tools.world.tubes import Arc, Line

RADIUS, LENGTH = 0.1, 1.5


@pytest.fixture
def pipe(rng):
    """Return an assembly with a body, and a line in some direction."""
    assembly = Assembly()
    direction = random_direction(rng)
    return assembly, assembly.body("pipe", Role.PIPE), Line(rng.normal(size=3), direction, LENGTH)


def _distances(assembly, rng, spacing=0.01):
    samples = sample(assembly.patches[0], spacing, rng)
    return samples, assembly.elements[0].axis.pipe_coordinates(samples.points)


def test_that_a_round_pipe_has_its_true_radius_everywhere(pipe, rng):
    assembly, body, line = pipe
    assembly.element(line, body, RADIUS)
    samples, (chainage, offset, _) = _distances(assembly, rng)
    np.testing.assert_allclose(offset, RADIUS, atol=1e-9)
    np.testing.assert_allclose(chainage, samples.u * LENGTH, atol=1e-9)


def test_that_normals_point_out_of_a_pipe(pipe, rng):
    assembly, body, line = pipe
    assembly.element(line, body, RADIUS)
    samples = sample(assembly.patches[0], 0.02, rng)
    inside = samples.points - 0.01 * samples.normals
    np.testing.assert_allclose(
        assembly.elements[0].axis.pipe_coordinates(inside)[1], RADIUS - 0.01, atol=1e-4
    )


def test_that_samples_are_even(pipe, rng):
    assembly, body, line = pipe
    assembly.element(line, body, RADIUS)
    assembly.sphere(np.zeros(3), 0.3, body)
    for patch, true in zip(
        assembly.patches, (2 * np.pi * RADIUS * LENGTH, 4 * np.pi * 0.3**2), strict=True
    ):
        assert area(patch) == pytest.approx(true, rel=0.01)
        assert len(sample(patch, 0.005, rng)) * 0.005**2 == pytest.approx(true, rel=0.02)
    points = sample(assembly.patches[1], 0.005, rng).points
    halves = points @ random_direction(rng) > 0
    assert halves.mean() == pytest.approx(0.5, abs=0.01)


@pytest.mark.parametrize("ovality", [0.01, 0.05, 0.12])
def test_that_ovality_is_the_difference_of_diameters(pipe, ovality):
    assembly, body, line = pipe
    shape = Oval(RADIUS, ovality, three_lobed=0.4, phase=1.0, turn=0.3)
    assembly.element(line, body, RADIUS, shapes=[shape])
    v = np.arange(360) / 360
    points = assembly.patches[0].at(np.full(360, 0.3), v)
    offset = assembly.elements[0].axis.pipe_coordinates(points)[1]
    diameters = offset + np.roll(offset, 180)
    assert np.ptp(diameters) / (2 * RADIUS) == pytest.approx(ovality, rel=1e-3)
    assert offset.mean() == pytest.approx(RADIUS)
    assert assembly.deformations[0].ovality == ovality


@pytest.mark.parametrize("profile", list(DENT_PROFILES))
def test_that_a_dent_is_as_deep_as_stated_where_stated(pipe, rng, profile):
    assembly, body, line = pipe
    dent = Dent(0.03, 0.2, 0.15, 0.7, 2.0, RADIUS, profile)
    assembly.element(line, body, RADIUS, shapes=[dent])
    (true,) = assembly.deformations
    chainage, offset, clock = assembly.elements[0].axis.pipe_coordinates(true.peak[None])
    assert (chainage[0], offset[0]) == pytest.approx((0.7, RADIUS - 0.03))
    assert clock[0] == pytest.approx(true.clock)
    _, (chainage, offset, clock) = _distances(assembly, rng, 0.004)
    assert RADIUS - offset.max() > -0.2 * 0.03 - 1e-9
    assert RADIUS - 0.03 - 1e-9 <= offset.min() < RADIUS - 0.027
    is_away = (chainage < true.chainage_start - 0.1) | (chainage > true.chainage_end + 0.1)
    np.testing.assert_allclose(offset[is_away], RADIUS, atol=0.001)


@pytest.mark.parametrize("shape", ["arc", "sag", "kink"])
def test_that_a_bowed_pipe_is_round_about_its_bowed_axis(rng, shape):
    assembly = Assembly()
    direction, depth = random_direction(rng), 0.04
    line = bowed(np.zeros(3), direction, 2.0, depth, shape)
    assembly.element(line, assembly.body("bowed", Role.PIPE), RADIUS)
    assert assembly.deformations[0].depth == pytest.approx(depth, rel=0.02)
    assert assembly.deformations[0].kind is DeformationKind.BOW
    s = np.linspace(0, 2.0, 4001)
    curve = line.at(s)
    points = sample(assembly.patches[0], 0.05, rng).points
    middle = np.abs(points @ direction - 1) < 0.8
    nearest = np.linalg.norm(points[middle][:, None] - curve, axis=2).min(axis=1)
    # About the corner of a kink the sections of both sides meet.
    tolerance = 2e-3 if shape == "kink" else 1e-5
    np.testing.assert_allclose(nearest, RADIUS, atol=tolerance)


def test_that_bends_and_reducers_lie_on_their_true_surfaces(rng):
    assembly = Assembly()
    run = Run(assembly, "line", rng.normal(size=3), random_direction(rng), RADIUS)
    run.straight(0.5)
    run.bend(0.3, np.deg2rad(70), 0.7)
    run.reducer(0.4, 0.06, 0.0)
    run.bend(0.18, np.pi, 2.0)
    run.flange(0.1, 0.02, 0.003, is_blind=True)
    assert [e.kind for e in assembly.elements] == [
        ElementKind.CYLINDER, ElementKind.TORUS, ElementKind.CONE, ElementKind.TORUS,
        ElementKind.FLANGE,
    ]  # fmt: skip
    for patch, element in zip(assembly.patches, assembly.elements, strict=False):
        points = sample(patch, 0.01, rng).points
        chainage, offset, _ = element.axis.pipe_coordinates(points)
        np.testing.assert_allclose(offset, element.radius_at(chainage), atol=1e-8)
        assert chainage.min() > -1e-8
        assert chainage.max() < element.axis.length + 1e-8
    for before, after in zip(assembly.elements, assembly.elements[1:], strict=False):
        np.testing.assert_allclose(before.axis.end, after.axis.start, atol=1e-9)


def test_that_an_eccentric_reducer_keeps_one_side_straight(rng):
    assembly = Assembly()
    run = Run(assembly, "line", np.zeros(3), random_direction(rng), RADIUS)
    run.reducer(0.4, 0.06, 1.0)
    element = assembly.elements[0]
    assert np.linalg.norm(element.axis.end - run.direction * 0.4) == pytest.approx(0.04)
    points = sample(assembly.patches[0], 0.005, rng).points
    along = LineAxis(np.zeros(3), run.direction, 0.4)
    _, offset, _ = along.pipe_coordinates(points)
    assert offset.max() < RADIUS + 1e-9
    near_end = points @ run.direction > 0.39
    assert offset[near_end].max() > 0.099


def test_that_a_whole_ring_closes(rng):
    arc = Arc(np.zeros(3), np.eye(3)[0], np.eye(3)[1], 0.5, 2 * np.pi)
    np.testing.assert_allclose(arc.at(np.array(arc.length)), arc.start, atol=1e-12)


def test_that_waves_have_their_standard_deviation_and_no_ovality(rng):
    waves = Waves.draw(rng, 0.002, (4, 16), (0.05, 0.4))
    s, theta = np.meshgrid(np.linspace(0, 20, 1200), 2 * np.pi * np.arange(64) / 64)
    height = waves(s.ravel(), theta.ravel()).reshape(s.shape)
    assert height.std() == pytest.approx(0.002, rel=0.15)
    harmonics = np.abs(np.fft.rfft(height, axis=0))[:4] / 64
    assert harmonics.max() < 1e-12


@pytest.mark.parametrize("feature", list(FEATURES))
def test_that_each_lone_body_has_a_truth(rng, feature):
    assembly = Assembly()
    FEATURES[feature][0](assembly, rng, 0.1, random_direction(rng))
    assert assembly.elements
    assert {p.element_id for p in assembly.patches if p.element_id} == {
        e.element_id for e in assembly.elements
    }
    for element in assembly.elements:
        assert element.axis.length >= 0.1


@pytest.mark.parametrize("name", list(CLUTTER))
def test_that_clutter_is_of_a_human_size_and_no_element(rng, name):
    patches = CLUTTER[name](rng)
    points = np.concatenate([sample(p, 0.02, rng).points for p in patches])
    assert np.isfinite(points).all()
    assert 0.5 < np.ptp(points, axis=0).max() < 4.0
    assert {p.element_id for p in patches} == {0}
