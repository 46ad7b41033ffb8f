import numpy as np
import pytest

from pipecore.deformation import mesh_deformations, mesh_elements, mesh_surface
from pipecore.geometry import ArcAxis, LineAxis, surface_points
from pipecore.types import Element, ElementKind
from tests.factories import make_scan

R, DEPTH = 0.1, 0.02
LINE = LineAxis.between([1.0, 2.0, 3.0], [1.6, 2.8, 3.0])
BEND = ArcAxis(np.zeros(3), np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0]), 0.5, np.pi / 2)


def element(axis):
    kind = ElementKind.CYLINDER if isinstance(axis, LineAxis) else ElementKind.TORUS
    return Element(1, 1, kind, axis, R, 1e-4, R, np.full(3, np.nan), 0, 0, 6.0, 0.002)


def dented(rng, axis, n=60_000):
    """Points with a dent at the middle, 12:00, and their deviations."""
    s, theta = rng.uniform(0, axis.length, n), rng.uniform(0, 2 * np.pi, n)
    turn = np.mod(theta + np.pi, 2 * np.pi) - np.pi
    rho = np.hypot(s - axis.length / 2, turn * R) / 0.1
    deviation = -DEPTH * np.cos(np.pi / 2 * np.minimum(rho, 1)) ** 2
    return surface_points(axis, s, R + deviation, theta), deviation


@pytest.mark.parametrize("axis", [LINE, BEND], ids=["straight", "bend"])
def test_that_the_mesh_lies_on_the_scanned_surface(rng, axis):
    xyz, deviation = dented(rng, axis)
    mesh = mesh_surface(element(axis), xyz, deviation)
    _, distance, _ = axis.pipe_coordinates(mesh.vertices)
    assert np.allclose(distance, R + mesh.deviation, atol=1e-9)
    assert mesh.deviation.min() == pytest.approx(-DEPTH, rel=0.1)


@pytest.mark.parametrize("axis", [LINE, BEND], ids=["straight", "bend"])
def test_that_a_pipe_seen_all_round_is_a_closed_tube_that_faces_outward(rng, axis):
    xyz, deviation = dented(rng, axis, n=250_000)
    mesh = mesh_surface(element(axis), xyz, deviation)
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    middle = (a + b + c) / 3
    chainage, _, _ = axis.pipe_coordinates(middle)
    outward = middle - axis.at(chainage)
    normal = np.cross(b - a, c - a)
    assert (np.sum(normal * outward, axis=1) > 0).all()
    # Every edge between two faces but those of the two open ends.
    edges = np.sort(np.concatenate([mesh.faces[:, [i, (i + 1) % 3]] for i in range(3)]), axis=1)
    _, uses = np.unique(edges, axis=0, return_counts=True)
    columns = np.count_nonzero(uses == 1) / 2
    assert set(uses.tolist()) == {1, 2}
    assert len(mesh.vertices) % columns == 0
    whole = np.linalg.norm(normal, axis=1).sum() / 2
    assert whole == pytest.approx(2 * np.pi * R * axis.length, rel=0.1)


def test_that_holes_stay_holes(rng):
    xyz, deviation = dented(rng, LINE)
    s, _, clock = LINE.pipe_coordinates(xyz)
    hole = (np.abs(s - 0.5) < 0.1) & (np.abs(clock - 3.0) < 0.8)
    mesh = mesh_surface(element(LINE), xyz[~hole], deviation[~hole])
    at, _, theta = LINE.pipe_coordinates(mesh.vertices[mesh.faces].mean(axis=1))
    assert not ((np.abs(at - 0.5) < 0.07) & (np.abs(theta - 3.0) < 0.6)).any()
    assert ((np.abs(at - 0.2) < 0.07) & (np.abs(theta - 3.0) < 0.6)).any()


def test_that_exaggeration_moves_the_vertices_and_leaves_the_numbers(rng):
    xyz, deviation = dented(rng, LINE)
    plain = mesh_surface(element(LINE), xyz, deviation)
    larger = mesh_surface(element(LINE), xyz, deviation, exaggeration=3.0)
    assert np.array_equal(plain.deviation, larger.deviation)
    assert np.array_equal(plain.faces, larger.faces)
    _, distance, _ = LINE.pipe_coordinates(larger.vertices)
    assert np.allclose(distance, R + 3 * plain.deviation, atol=1e-9)


def test_that_sparse_points_and_none_make_no_mesh_out_of_nothing(rng):
    xyz, deviation = dented(rng, LINE, n=2)
    mesh = mesh_surface(element(LINE), xyz, deviation)
    assert len(mesh.vertices) == len(mesh.faces) == 0


def test_that_meshes_of_a_result_are_those_of_its_deformations():
    cloud, result = make_scan(60_000)
    meshes = mesh_deformations(cloud, result)
    assert len(meshes) == len(result.deformations)
    for mesh, d in zip(meshes, result.deformations, strict=True):
        assert d.kind in mesh.name
        assert len(mesh.faces) > 50
        nearest = np.linalg.norm(mesh.vertices - d.peak, axis=1).min()
        assert nearest < 0.03
    (one,) = mesh_deformations(cloud, result, [3])
    assert np.array_equal(one.vertices, meshes[2].vertices)
    (whole,) = mesh_elements(cloud, result, [7])
    assert len(whole.vertices) > len(one.vertices)
