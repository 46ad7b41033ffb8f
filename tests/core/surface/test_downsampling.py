"""Thinning: means of cubes, whatever the order of the points."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial import cKDTree

from pipecore.geometry import LineAxis
from pipecore.progress import NoProgress
from pipecore.settings import ThinningSettings
from pipecore.surface import downsample, median_spacing
from pipecore.surface.spacing import sample_by_place
from pipecore.types import PointCloud
from tests.core.shapes import cloud_of, parents, plane, random_direction, tube


def pipe(rng, **kwargs):
    axis = LineAxis(rng.normal(size=3), random_direction(rng), 0.5)
    return tube(rng, axis, 0.1, noise=0.002, spacing=0.005, **kwargs)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("voxel_mm", [0.0, 10.0])
def test_that_shuffled_points_thin_to_the_same_bits(rng, dtype, voxel_mm):
    cloud = cloud_of(pipe(rng))
    cloud = replace(cloud, xyz=cloud.xyz.astype(dtype))
    # The automatic voxel comes from a sample of the points, so it is fixed here.
    settings = ThinningSettings(voxel_mm or 1e3 * median_spacing(cloud.xyz))
    shuffled = rng.permutation(len(cloud))
    once = downsample(cloud, settings, NoProgress())
    again = downsample(replace(cloud, xyz=cloud.xyz[shuffled]), settings, NoProgress())
    assert_array_equal(again.xyz, once.xyz)
    assert_array_equal(
        parents(again.full_resolution_points), parents(once.full_resolution_points)[shuffled]
    )


def test_that_the_automatic_voxel_does_not_depend_on_the_order_of_the_points(rng):
    cloud = cloud_of(pipe(rng), pipe(rng))
    shuffled = np.ascontiguousarray(cloud.xyz[rng.permutation(len(cloud))])
    assert median_spacing(shuffled) == median_spacing(cloud.xyz)


def test_that_a_thinned_point_is_the_mean_of_the_points_that_name_it(rng):
    cloud = cloud_of(pipe(rng))
    downsampled = downsample(cloud, ThinningSettings(20.0), NoProgress())
    assert len(downsampled.xyz) < len(cloud) / 4
    parent = parents(downsampled.full_resolution_points)
    assert set(parent) == set(range(len(downsampled.xyz)))
    for k in rng.choice(len(downsampled.xyz), 50):
        members = cloud.xyz[parent == k]
        assert_allclose(downsampled.xyz[k], members.mean(axis=0), atol=1e-6)
        assert np.ptp(members, axis=0).max() <= 0.02 + 1e-12


def test_that_far_coordinates_cost_no_more_than_a_micrometre(rng):
    xyz = np.round(cloud_of(pipe(rng)).xyz, 6)
    shift = np.array([320.0, -640.0, 64.0])
    near = downsample(PointCloud(np.zeros(3), xyz), ThinningSettings(10.0), NoProgress())
    far = downsample(PointCloud(np.zeros(3), xyz + shift), ThinningSettings(10.0), NoProgress())
    # Cubes count from the local zero and the shift is whole cubes, so that the same points
    # share one, but for those that rounding takes across a side.
    off, _ = cKDTree(near.xyz).query(far.xyz - shift)
    assert np.mean(off < 3e-6) > 0.95


def test_that_the_automatic_voxel_is_the_spacing_of_the_scan(rng):
    for spacing in (0.005, 0.01, 0.02):
        sheet = plane(rng, np.zeros(3), [100 * spacing, 0, 0], [0, 100 * spacing, 0], spacing)
        assert median_spacing(sheet[0]) == pytest.approx(spacing, rel=0.12)
        assert downsample(
            cloud_of(sheet), ThinningSettings(), NoProgress()
        ).voxel == median_spacing(sheet[0])


def test_that_scans_are_not_thinned_below_their_noise(rng):
    sheet = plane(rng, np.zeros(3), [0.1, 0, 0], [0, 0.1, 0], 0.001)
    assert downsample(cloud_of(sheet), ThinningSettings(), NoProgress()).voxel == 0.003


@pytest.mark.parametrize("case", ["pipe", "far outlier", "doubled", "few", "thick"])
def test_that_the_spacing_is_that_of_a_tree_of_all_points(rng, case):
    xyz = pipe(rng)[0]
    match case:
        case "far outlier":
            xyz = np.concatenate([xyz, [[4e5, -3e5, 10.0]]])
        case "doubled":
            xyz = np.repeat(xyz, 10, axis=0)
        case "few":
            xyz = xyz[:6]
        case "thick":
            xyz = rng.normal(size=(20_000, 3))
    n_sample, k = 500, min(8, len(xyz) - 1)
    rows = sample_by_place(xyz, min(n_sample, len(xyz)))
    reach = cKDTree(xyz).query(xyz[rows], k + 1)[0][:, -1]
    expected = np.median(reach) * np.sqrt(np.pi / (k + 1))
    assert median_spacing(xyz, n_sample) == pytest.approx(expected, rel=1e-12)


def test_that_the_sample_is_the_same_in_any_order_and_has_its_size(rng):
    xyz = np.repeat(pipe(rng)[0], 3, axis=0)
    once = xyz[sample_by_place(xyz, 700)]
    shuffled = xyz[rng.permutation(len(xyz))]
    again = shuffled[sample_by_place(shuffled, 700)]
    assert_array_equal(np.unique(again, axis=0), np.unique(once, axis=0))
    assert len(once) == len(again) == 700
