"""Fits of surfaces, pipe coordinates and look-up of points, against plain numpy."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from pipecore._kernels import pipe_coordinates, surface_fit, surface_models
from pipecore._kernels.grouping import group_by_label
from pipecore.elements.refinement.nearby_points import NearbyPoints
from pipecore.elements.refinement.surface_fits import ArcSurface, LineSurface, SphereSurface
from pipecore.geometry import ArcAxis, LineAxis, unit
from pipecore.surface import Surface
from pipecore.types import PointCloud
from tests.core.shapes import random_direction, random_rotation, unit_rows

# Hashing wraps around on purpose, which plain numpy warns of.
pytestmark = [pytest.mark.kernels, pytest.mark.filterwarnings("ignore:overflow encountered")]


def surface(rng, kind):
    place, d = rng.normal(size=3), random_direction(rng)
    return {
        surface_models.CYLINDER: LineSurface(place, d, 0.1),
        surface_models.CONE: LineSurface(place, d, 0.1, 0.2, is_tapered=True),
        surface_models.TORUS: ArcSurface(place, d, 0.3, 0.1),
        surface_models.SPHERE: SphereSurface(place, 0.25),
    }[kind]


KINDS = (surface_models.CYLINDER, surface_models.CONE, surface_models.TORUS, surface_models.SPHERE)


def distances(model, xyz):
    """Signed distances, straight from what the surfaces are."""
    if isinstance(model, SphereSurface):
        return np.linalg.norm(xyz - model.centre, axis=1) - model.radius
    if isinstance(model, ArcSurface):
        h = (xyz - model.centre) @ model.normal
        in_plane = np.linalg.norm(xyz - model.centre - h[:, None] * model.normal, axis=1)
        return np.hypot(in_plane - model.bend_radius, h) - model.radius
    s = (xyz - model.middle) @ model.direction
    rho = np.linalg.norm(xyz - model.middle - s[:, None] * model.direction, axis=1)
    return (rho - model.radius - model.slope * s) / np.hypot(1.0, model.slope)


def near_points(rng, model, n=60, off=0.01):
    """Points within a centimetre or two of a surface."""
    xyz = getattr(model, "middle", getattr(model, "centre", None)) + rng.normal(size=(n, 3))
    for _ in range(20):
        residual, _, outward = model.residuals(xyz)
        xyz = xyz - residual[:, None] * outward
    return xyz + off * rng.uniform(-1, 1, (n, 1)) * outward


@pytest.mark.parametrize("kind", KINDS)
def test_that_distances_are_those_of_the_shape(rng, kind):
    model = surface(rng, kind)
    xyz = near_points(rng, model, off=0.05)
    residual, slopes, outward = model.residuals(xyz)
    assert_allclose(residual, distances(model, xyz), atol=1e-12)
    assert slopes.shape == (len(xyz), surface_models.n_parameters(kind))
    assert_allclose(np.linalg.norm(outward, axis=1), 1.0, atol=1e-12)


def test_that_there_is_no_distance_where_outward_is_not_defined(rng):
    for kind in KINDS:
        model = surface(rng, kind)
        place = model.numbers()[:3]
        if kind == surface_models.TORUS:
            place = place + model.bend_radius * model.numbers()[6:9]
        residual, _, outward = model.residuals(place[None])
        on_axis = not np.isfinite(residual[0]) and not np.isfinite(outward).any()
        # Rounding may leave the place a hair beside the axis.
        assert on_axis or abs(residual[0] + model.radius) < 1e-9


@pytest.mark.parametrize("kind", KINDS)
def test_that_normal_equations_are_the_weighted_sums(rng, kind):
    model = surface(rng, kind)
    xyz, reach = near_points(rng, model), 0.008
    p = surface_models.n_parameters(kind)
    residuals, normal, right = np.empty(len(xyz)), np.empty((p, p)), np.empty(p)
    n = surface_fit.weighted_normal_equations(
        kind, model.numbers(), xyz, reach, residuals, normal, right
    )
    residual, slopes, _ = model.residuals(xyz)
    weight = np.where(np.abs(residual) < reach, (1 - (residual / reach) ** 2) ** 2, 0.0)
    assert n == (weight > 0).sum() < len(xyz)
    assert_allclose(residuals, residual)
    assert_allclose(normal, slopes.T @ (weight[:, None] * slopes), atol=1e-12)
    assert_allclose(right, slopes.T @ (weight * residual), atol=1e-12)
    assert surface_fit.spread_within(residual, reach) == pytest.approx(
        1.4826 * np.median(np.abs(residual[weight > 0]))
    )
    step = 1e-3 * rng.normal(size=p)
    largest = np.abs(slopes @ step).max()
    assert surface_fit.moves_less(kind, model.numbers(), xyz, step, 1.001 * largest)
    assert not surface_fit.moves_less(kind, model.numbers(), xyz, step, 0.999 * largest)


@pytest.mark.parametrize("kind", KINDS)
def test_that_a_fit_is_judged_by_the_sums_over_its_points(rng, kind):
    model = surface(rng, kind)
    xyz, reach = near_points(rng, model), 0.008
    p = surface_models.n_parameters(kind)
    information, scatter, beam = np.empty((p, p)), np.empty((p, p)), np.empty(3)
    n, sigma = surface_fit.judge_fit(kind, model.numbers(), xyz, reach, information, scatter, beam)
    residual, slopes, outward = model.residuals(xyz)
    used = np.abs(residual) < reach
    residual, slopes, outward = residual[used], slopes[used], outward[used]
    ratio = (residual / reach) ** 2
    pull = (1 - ratio) ** 2 * residual
    assert n == used.sum()
    assert sigma == pytest.approx(1.4826 * np.median(np.abs(residual)))
    assert_allclose(beam, outward.mean(axis=0), atol=1e-12)
    slope = ((1 - ratio) * (1 - 5 * ratio)).mean()
    assert_allclose(information, slope * slopes.T @ slopes, atol=1e-12)
    expected = (pull[:, None] ** 2 * slopes).T @ slopes * (n / (n - p))
    assert_allclose(scatter, expected, rtol=1e-9, atol=1e-15)

    beam = unit(outward[0])
    facing = outward @ beam
    faced = facing > surface_fit.FACING
    noise = surface_fit.noise_along(kind, model.numbers(), xyz, reach, beam)
    assert noise == pytest.approx(1.4826 * np.median(np.abs(residual[faced] / facing[faced])))
    steps, shares, found = np.array([-0.002, 0.003]), np.array([0.4, 0.6]), np.empty(p)
    surface_fit.pull_along(kind, model.numbers(), xyz, reach, beam, steps, shares, found)
    on = xyz[used] - residual[:, None] * outward
    expected = np.zeros(p)
    for step, share in zip(steps, shares, strict=True):
        moved, jacobian, _ = model.residuals(on + step * beam)
        weight = np.where(np.abs(moved) < reach, (1 - (moved / reach) ** 2) ** 2, 0.0)
        expected += share * jacobian.T @ (weight * moved)
    assert_allclose(found, expected, atol=1e-12)


def axes_of(rng):
    q = random_rotation(rng)
    return (
        LineAxis(rng.normal(size=3), q[0], 0.9),
        LineAxis(rng.normal(size=3), np.array([0.0, 0.0, 1.0]), 0.9),
        ArcAxis(rng.normal(size=3), q[2], q[0], 0.3, 1.2),
        ArcAxis(rng.normal(size=3), q[2], q[0], 0.3, 4.0),
    )


def test_that_pipe_coordinates_are_those_of_the_axis(rng):
    for axis in axes_of(rng):
        xyz = axis.at(0.1) + 0.4 * rng.normal(size=(100, 3))
        found = np.empty((3, len(xyz)))
        pipe_coordinates.pipe_coordinates(axis.numbers, xyz, *found)
        assert_allclose(found, axis.pipe_coordinates(xyz), atol=1e-12)
        s = rng.uniform(-0.2, 1.0)
        assert_allclose(pipe_coordinates.place_on_axis(axis.numbers, s), axis.at(s), atol=1e-12)
        assert_allclose(pipe_coordinates.tangent(axis.numbers, s), axis.tangent(s), atol=1e-12)


def cloud_around(rng, axis, n=400):
    """A cloud with two points behind each downsampled one, in random order."""
    downsampled = axis.at(rng.uniform(-0.5, axis.length + 0.5, n)) + 0.1 * rng.normal(size=(n, 3))
    parent = rng.permutation(np.repeat(np.arange(n), 2)).astype(np.int32)
    xyz = downsampled[parent] + 0.002 * rng.normal(size=(2 * n, 3))
    normals = unit_rows(rng.normal(size=(n, 3)))
    normals[:5] = np.nan
    behind = group_by_label(parent, n)
    surface_of_cloud = Surface(downsampled, normals, np.full(n, 0.01), behind, 0.01, 0.001)
    return NearbyPoints(PointCloud(np.zeros(3), xyz), surface_of_cloud), xyz, parent


@pytest.mark.parametrize("which", range(4))
def test_that_all_points_around_an_axis_are_found(rng, which):
    axis = axes_of(rng)[which]
    points, _, _ = cloud_around(rng, axis)
    chainage, rho, _ = axis.pipe_coordinates(points.surface.xyz)
    for radius, margin in ((0.1, 0.02), (0.2, 0.3)):
        there = (rho > 0.4 * radius) & (rho < 1.3 * radius)
        there &= (chainage > -margin) & (chainage < axis.length + margin)
        assert there.any()
        assert_array_equal(points.around_axis(axis, radius, margin), np.flatnonzero(there))
    centre = axis.at(0.2)
    near = np.linalg.norm(points.surface.xyz - centre, axis=1) < 0.15
    assert_array_equal(points.within_ball(centre, 0.15), np.flatnonzero(near))


@pytest.mark.parametrize("which", range(4))
def test_that_points_on_a_surface_are_told_from_those_inside(rng, which):
    axis, radius, margin = axes_of(rng)[which], 0.12, 0.05
    if isinstance(axis, ArcAxis):
        model = ArcSurface(axis.centre, axis.normal, axis.bend_radius, radius)
    else:
        model = LineSurface(axis.at(0.3), axis.direction, radius)
    points, _, _ = cloud_around(rng, axis)
    is_free = rng.random(len(points.surface.xyz)) < 0.7
    found = points.on_surface(model, axis, margin, is_free, band=0.03, depth=0.02, min_cos=0.5)
    near = points.around_axis(axis, radius, margin)
    xyz, normals = points.surface.xyz[near], points.surface.normals[near]
    residual, _, outward = model.residuals(xyz)
    chainage, _, clock = axis.pipe_coordinates(xyz)
    cosine = np.einsum("ij,ij->i", normals, outward)
    like = np.abs(cosine) > 0.5
    on = like & (np.abs(residual) < 0.03) & is_free[near]
    assert 3 < on.sum() < like.sum()
    assert_array_equal(found.inliers, near[on])
    assert_allclose(found.residual, residual[on], atol=1e-12)
    assert_allclose(found.chainage, chainage[on], atol=1e-12)
    assert_allclose(found.clock, clock[on], atol=1e-12)
    clockwise = np.cross(axis.tangent(chainage[on]), outward[on])
    ahead = np.einsum("ij,ij->i", normals[on], clockwise)
    assert_allclose(found.normal_angle, np.arctan(ahead / cosine[on]), atol=1e-9)
    for begin, end in ((-margin, axis.length + margin), (0.1, 0.6 * axis.length)):
        inside = like & (residual < -0.02) & (chainage > begin) & (chainage < end)
        assert inside.any()
        for one, other in zip(found.inside(begin, end), (chainage, clock), strict=True):
            assert_allclose(np.sort(one), np.sort(other[inside]), atol=1e-12)


@pytest.mark.parametrize("is_sphere", [False, True])
def test_that_a_rough_look_samples_where_there_are_many_points(rng, monkeypatch, is_sphere):
    axis = LineAxis(np.zeros(3), np.array([0.0, 0.0, 1.0]), 1.0)
    points, _, _ = cloud_around(rng, axis, n=4000)
    is_free = np.ones(len(points.surface.xyz), np.bool_)

    def found(is_rough):
        if is_sphere:
            model = SphereSurface(np.array([0.0, 0.0, 0.5]), 0.2)
            return points.on_sphere(model, is_free, band=0.1, min_cos=0.0, is_rough=is_rough), 0.01
        near = points.on_surface(
            LineSurface(axis.at(0.5), axis.direction, 0.15), axis, 0.0, is_free,
            band=0.1, depth=0.1, min_cos=0.0, is_rough=is_rough,
        )  # fmt: skip
        return near.inliers, near.spacing

    every, spacing = found(is_rough=False)
    assert_array_equal(found(is_rough=True)[0], every)
    monkeypatch.setattr("pipecore.elements.refinement.nearby_points.ROUGH_SAMPLE_POINTS", 200)
    some, wider = found(is_rough=True)
    assert np.isin(some, every).all()
    assert 10 < len(some) < 220 < len(every)
    if not is_sphere:
        assert wider == pytest.approx(spacing * np.sqrt(len(every) / len(some)), rel=0.4)
    assert_array_equal(found(is_rough=False)[0], every)


def test_that_full_resolution_points_of_downsampled_ones_are_in_the_order_of_their_places(rng):
    points, xyz, parent = cloud_around(rng, axes_of(rng)[0], n=50)
    chosen = np.array([3, 7, 20])
    index, places, normals = points.full_resolution_with_normals(chosen)
    assert_array_equal(parent[index], np.repeat(chosen, 2))
    assert_array_equal(places, xyz[index])
    assert (places[::2, 0] < places[1::2, 0]).all()
    assert_array_equal(normals, np.repeat(points.surface.normals[chosen], 2, axis=0))


def test_that_points_on_a_sphere_face_its_centre(rng):
    points, _, _ = cloud_around(rng, axes_of(rng)[0])
    model = SphereSurface(points.surface.xyz.mean(axis=0), 0.2)
    is_free = rng.random(len(points.surface.xyz)) < 0.7
    residual, _, outward = model.residuals(points.surface.xyz)
    cosine = np.abs(np.einsum("ij,ij->i", points.surface.normals, outward))
    for band, outer in ((0.03, 0.03), (0.1, 0.04)):
        # No further out than a fifth of the radius.
        on = (cosine > 0.5) & is_free & (residual > -band) & (residual < outer)
        assert on.any()
        found = points.on_sphere(model, is_free, band=band, min_cos=0.5)
        assert_array_equal(found, np.flatnonzero(on))
