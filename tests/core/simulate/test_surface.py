"""The surfaces that are scanned: true to their shape, and their facets true to them."""

from itertools import pairwise

import numpy as np
import pytest

from pipecore.geometry import surface_points
from pipecore.simulate.placing import PlacedElement, place_runs
from pipecore.simulate.scene import (
    Bow,
    Bulge,
    Dent,
    DentShape,
    Elbow,
    Kink,
    Ovality,
    Piece,
    Reducer,
    Run,
    Scene,
    Sphere,
    Straight,
)
from pipecore.simulate.surface import CHORD_ERROR

FACET_ERROR = 5e-5


def placed(piece: Piece, radius: float = 0.11) -> PlacedElement:
    run = Run((0.3, -0.2, 1.0), (1.0, 0.4, 0.2), radius, (piece,))
    return place_runs(Scene((run,), ())).elements[0]


def points_on_facets(piece: PlacedElement, rng: np.random.Generator, n: int) -> np.ndarray:
    mesh = piece.surface.mesh()
    corners = mesh.vertices[mesh.triangles]
    area = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    chosen = corners[rng.choice(len(corners), n, p=area / area.sum())]
    weights = rng.dirichlet(np.ones(3), n)
    return np.einsum("ij,ijk->ik", weights, chosen)


@pytest.mark.parametrize("radius", [0.024, 0.11, 0.2, 0.8])
@pytest.mark.parametrize(
    "make",
    [
        lambda r: Straight(1.5),
        lambda r: Elbow(90.0, 3 * r, (0.0, 0.0, 1.0)),
        lambda r: Elbow(37.0, 6 * r, (0.3, -1.0, 0.0)),
        lambda r: Reducer(2 * r, 0.6 * r),
        lambda r: Sphere(2 * r),
    ],
)
def test_that_facets_follow_the_surface_and_are_on_it_in_the_mean(
    make, radius: float, rng: np.random.Generator
) -> None:
    piece = placed(make(radius), radius)
    points = points_on_facets(piece, rng, 20_000)
    chainage, rho, clock = piece.element.axis.pipe_coordinates(points)
    inside = (chainage > 0) & (chainage < piece.element.axis.length)
    error = rho[inside] - piece.surface.radius(chainage[inside], clock[inside])
    if piece.element.kind == "sphere":
        error = np.linalg.norm(points - piece.element.centre, axis=1) - piece.element.radius
    assert np.abs(error).max() < FACET_ERROR
    assert abs(error.mean()) < CHORD_ERROR / 3


@pytest.mark.parametrize("shape", list(DentShape))
@pytest.mark.parametrize("kind", [Dent, Bulge])
def test_that_facets_follow_dents_and_bulges(kind, shape: DentShape, rng) -> None:
    spec = kind(0.75, 100.0, 0.018, 0.2, 0.16, shape)
    piece = placed(Straight(1.5, (spec,)))
    points = points_on_facets(piece, rng, 40_000)
    chainage, rho, clock = piece.element.axis.pipe_coordinates(points)
    error = rho - piece.surface.radius(chainage, clock)
    # Creases cannot run along the facets' edges everywhere.
    assert np.quantile(np.abs(error), 0.995) < FACET_ERROR
    assert np.abs(error).max() < (FACET_ERROR if shape is DentShape.SMOOTH else 4e-4)


@pytest.mark.parametrize("shape", list(DentShape))
def test_that_a_dent_is_as_deep_long_and_wide_as_it_says(shape: DentShape) -> None:
    spec = Dent(0.7, 30.0, 0.012, 0.24, 0.12, shape)
    surface = placed(Straight(1.5, (spec,))).surface
    clock, s = np.deg2rad(30.0), 0.7

    def depth(along: float, around: float) -> float:
        chainage, angle = np.array([s + along]), np.array([clock + around / 0.11])
        return float(0.11 - surface.radius(chainage, angle)[0])

    assert depth(0, 0) == pytest.approx(0.012)
    for along, around in ((0.121, 0), (-0.121, 0), (0, 0.061), (0, -0.061), (0.09, 0.045)):
        assert depth(along, around) == pytest.approx(0, abs=1e-9)
    assert depth(0.115, 0) > 0
    assert depth(0, -0.057) > 0


def test_that_an_oval_stretch_has_its_ratio_and_fades_at_its_ends() -> None:
    surface = placed(Straight(2.0, (Ovality(0.06, 40.0, 0.5, 1.5, 0.1),))).surface
    clock = np.deg2rad(np.arange(0.0, 360.0))

    def ratio(chainage: float) -> float:
        radius = surface.radius(np.full(360, chainage), clock)
        diameters = radius[:180] + radius[180:]
        return (diameters.max() - diameters.min()) / 0.22

    assert ratio(1.0) == pytest.approx(0.06, rel=1e-3)
    assert ratio(0.55) == pytest.approx(0.03, rel=1e-3)
    assert ratio(0.49) == ratio(1.51) == 0
    radius = surface.radius(np.full(360, 1.0), clock)
    assert np.argmax(radius[:180]) == 40


@pytest.mark.parametrize("spec", [Bow(0.02, 90.0), Kink(0.8, 2.0, 90.0)])
def test_that_a_bent_axis_keeps_its_ends_and_goes_where_it_says(spec: Bow | Kink) -> None:
    piece = placed(Straight(2.0, (spec,)))
    axis = piece.element.axis
    chainage = np.linspace(0.0, 2.0, 201)
    offset = piece.surface.displacement(chainage)
    _, right = axis.frame(chainage)
    sideways = np.einsum("ij,ij->i", offset, right)
    assert np.abs(sideways - np.linalg.norm(offset, axis=1)).max() < 1e-12
    assert sideways[0] == pytest.approx(0, abs=1e-12)
    assert sideways[-1] == pytest.approx(0, abs=1e-12)
    if isinstance(spec, Bow):
        assert sideways.max() == pytest.approx(0.02)
    else:
        slope = np.diff(sideways) / np.diff(chainage)
        turn = np.rad2deg(np.arctan(slope[0]) - np.arctan(slope[-1]))
        assert chainage[np.argmax(sideways)] == pytest.approx(0.8)
        assert turn == pytest.approx(2.0, rel=2e-3)


def test_that_a_chain_goes_on_where_a_piece_ends() -> None:
    pieces = (
        Straight(0.5),
        Elbow(70.0, 0.3, (0.0, 0.2, 1.0)),
        Reducer(0.2, 0.05),
        Sphere(0.2),
        Elbow(45.0, 0.2, (1.0, 1.0, 0.0)),
        Straight(0.4),
    )
    run = Run((1.0, 2.0, 3.0), (0.2, 1.0, 0.1), 0.1, pieces)
    elements = [p.element for p in place_runs(Scene((run,), ())).elements]
    for one, following in pairwise(elements):
        a, b = one.axis, following.axis
        assert np.allclose(a.end, b.start)
        assert np.allclose(a.tangent(a.length), b.tangent(0.0))
    assert elements[0].radius == 0.1
    assert elements[-1].radius == 0.05
    turned = elements[0].axis.tangent(0.0) @ elements[1].axis.tangent(elements[1].axis.length)
    assert np.rad2deg(np.arccos(turned)) == pytest.approx(70.0)


def test_that_true_peaks_lie_on_the_deformed_surface() -> None:
    spec = Dent(0.7, 250.0, 0.012, 0.24, 0.12)
    run = Run((0.3, -0.2, 1.0), (1.0, 0.4, 0.2), 0.11, (Straight(1.5, (spec, Bow(0.01, 0.0))),))
    placement = place_runs(Scene((run,), ()))
    dent, bow = placement.deformations()
    axis = placement.elements[0].element.axis
    sag = placement.elements[0].surface.displacement(np.array([0.7]))[0]
    wall = surface_points(axis, 0.7, 0.11 - 0.012, np.deg2rad(250.0))
    assert np.allclose(dent.peak, wall + sag)
    assert bow.depth == 0.01
