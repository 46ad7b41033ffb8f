"""Normals, spacing and noise of surfaces whose normals are known."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from pipecore.geometry import LineAxis
from pipecore.progress import NoProgress
from pipecore.settings import ThinningSettings
from pipecore.surface import Surface, sample_surface
from pipecore.types import PointCloud
from tests.core.shapes import (
    angle_between,
    ball,
    parents,
    plane,
    random_direction,
    random_rotation,
    sampled,
    tube,
    unit_rows,
)

R = 0.15


def inner(surface: Surface, mask):
    """Normals and places of the downsampled points for which `mask` holds."""
    return surface.xyz[mask], surface.normals[mask]


def sheet_error(rng, noise, rotation=None):
    q = random_rotation(rng) if rotation is None else rotation
    surface = sampled(plane(rng, np.zeros(3), 0.6 * q[0], 0.6 * q[1], 0.005, noise), voxel_mm=10)
    s, t = surface.xyz @ q[0], surface.xyz @ q[1]
    inside = (np.abs(s - 0.3) < 0.26) & (np.abs(t - 0.3) < 0.26)
    return np.median(angle_between(surface.normals[inside], q[2])), surface


def test_that_normals_of_a_plane_get_better_as_the_noise_falls(rng):
    # In one attitude: how a sheet lies in the voxels matters too.
    rotation = random_rotation(rng)
    errors = [sheet_error(rng, noise, rotation)[0] for noise in (0.004, 0.002, 0.001)]
    assert errors[0] < np.radians(5.0)
    # Half the noise, half the error, and less where little noise leaves the sheet in one layer of
    # voxels: of sixty attitudes up to 2.7 times.
    assert 1.5 < errors[0] / errors[1] < 3.5
    assert 1.5 < errors[1] / errors[2] < 3.5


def test_that_an_exact_plane_has_exact_normals_and_no_noise(rng):
    error, surface = sheet_error(rng, 0.0)
    assert error < 1e-4
    assert surface.noise < 1e-6


@pytest.mark.parametrize("shape", ["cylinder", "sphere"])
def test_that_normals_of_curved_surfaces_are_radial(rng, shape):
    medians = []
    for noise in (0.003, 0.0005):
        if shape == "sphere":
            surface = sampled(ball(rng, np.zeros(3), R, 0.005, noise), voxel_mm=10)
            true = unit_rows(surface.xyz)
        else:
            axis = LineAxis(np.zeros(3), random_direction(rng), 1.0)
            surface = sampled(tube(rng, axis, R, spacing=0.005, noise=noise), voxel_mm=10)
            chainage = axis.pipe_coordinates(surface.xyz)[0]
            surface = Surface(
                surface.xyz,
                surface.normals,
                surface.spacing,
                surface.full_resolution_points,
                0.01,
                surface.noise,
            )
            true = unit_rows(surface.xyz - axis.at(chainage))
        error = angle_between(surface.normals, true)
        assert np.mean(error < np.radians(10.0)) > 0.97
        medians.append(np.median(error))
    assert medians[1] < 0.4 * medians[0]


def test_that_the_noise_is_that_of_the_thinned_points(rng):
    q = random_rotation(rng)
    for noise in (0.001, 0.003):
        sheet = plane(rng, np.zeros(3), 0.6 * q[0], 0.6 * q[1], 0.005, noise)
        surface = sampled(sheet, voxel_mm=10)
        assert surface.noise == pytest.approx(np.std(surface.xyz @ q[2]), rel=0.45)


def test_that_the_spacing_is_the_distance_between_thinned_points(rng):
    _, surface = sheet_error(rng, 0.001)
    assert np.median(surface.spacing) == pytest.approx(0.01, rel=0.2)


def test_that_lonely_points_have_no_normal(rng):
    xyz = np.concatenate(
        [plane(rng, np.zeros(3), [0.3, 0, 0], [0, 0.3, 0])[0], [[2.0, 2.0, 2.0], [-2.0, 1.0, 0.5]]]
    )
    surface = sample_surface(PointCloud(np.zeros(3), xyz), ThinningSettings(), NoProgress())
    lonely = parents(surface.full_resolution_points)[-2:]
    assert np.isnan(surface.normals[lonely]).all()
    assert np.isfinite(np.delete(surface.normals, lonely, axis=0)).mean() > 0.99


def test_that_turning_the_cloud_turns_its_normals(rng):
    axis = LineAxis(np.zeros(3), np.array([1.0, 0.0, 0.0]), 0.8)
    xyz, _ = tube(rng, axis, R, spacing=0.005, noise=0.001)
    q = random_rotation(rng)
    surface = sampled((xyz, xyz), voxel_mm=10)
    turned = sampled((xyz @ q.T, xyz), voxel_mm=10)
    # The cubes differ, so places are compared: the normal of the nearest downsampled point.
    _, nearest = cKDTree(turned.xyz @ q).query(surface.xyz)
    angle = angle_between(turned.normals[nearest] @ q, surface.normals)
    assert np.median(angle) < np.radians(4.0)
