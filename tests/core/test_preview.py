"""What a detection would cut, against what the pipeline cuts."""

import numpy as np
import pytest

import pipecore.preview
from pipecore.errors import CancelledError, SettingsError
from pipecore.preview import plan_stacks, preview_profile
from pipecore.profiles import MAX_SLOPE, segment_profiles
from pipecore.progress import NoProgress
from pipecore.settings import Settings
from pipecore.stacks import choose_stacks
from pipecore.surface import sample_surface
from pipecore.types import PointCloud

R, LENGTH, SPACING, NOISE = 0.1, 2.0, 0.008, 0.001
AXES = Settings().replace({"stacks.preset": "axes", "stacks.width_mm": 20.0})


def make_cloud(length=LENGTH, seed=5) -> PointCloud:
    """A pipe along X and a floor below it."""
    rng = np.random.default_rng(seed)
    n = int(2 * np.pi * R * length / SPACING**2)
    x, angle = rng.uniform(0, length, n), rng.uniform(0, 2 * np.pi, n)
    radius = R + rng.normal(0, NOISE, n)
    pipe = np.stack([x, radius * np.cos(angle), 0.6 + radius * np.sin(angle)], axis=1)
    m = int(length * 1.0 / SPACING**2)
    floor = np.stack(
        [rng.uniform(0, length, m), rng.uniform(-0.5, 0.5, m), rng.normal(0, NOISE, m)], axis=1
    )
    return PointCloud(np.zeros(3), np.concatenate([pipe, floor]).astype(np.float32))


CLOUD = make_cloud()


def test_that_the_plan_of_a_small_cloud_is_what_is_cut():
    plan = plan_stacks(CLOUD, AXES)
    surface = sample_surface(CLOUD, AXES.thinning, NoProgress())
    stacks = choose_stacks(surface, AXES.stacks, 5.0, NoProgress())
    assert [p.stack.name for p in plan.stacks] == [s.name for s in stacks]
    known = surface.normals[~np.isnan(surface.normals[:, 0])]
    for planned, stack in zip(plan.stacks, stacks, strict=True):
        assert planned.share == pytest.approx((np.abs(known @ stack.direction) < MAX_SLOPE).mean())
        index = stack.profile_index(surface.xyz)
        assert (planned.first, planned.last) == (index.min(), index.max())
        assert planned.first <= planned.fullest <= planned.last


def test_that_a_stack_along_the_pipe_cuts_it_well_and_one_up_does_not_cut_the_floor():
    plan = plan_stacks(CLOUD, AXES)
    shares = {p.stack.name: p.share for p in plan.stacks}
    assert shares["X"] > 0.95
    n_floor = LENGTH * 1.0 / SPACING**2
    share_of_floor = n_floor / len(CLOUD)
    # Of the pipe's wall |n·z| < 0.62 holds on 2·asin(0.62) of π.
    steep = 2 * np.arcsin(MAX_SLOPE) / np.pi
    assert shares["Z"] == pytest.approx((1 - share_of_floor) * steep, abs=0.05)
    assert plan.share >= max(shares.values())


@pytest.mark.parametrize("method", ["proximity", "curve fitting"])
@pytest.mark.parametrize("name", ["X", "Y", "Z"])
def test_that_a_previewed_profile_is_that_of_the_pipeline(name, method):
    settings = AXES.replace({"profiles.method": method})
    plan = plan_stacks(CLOUD, settings)
    planned = next(p for p in plan.stacks if p.stack.name == name)
    preview = preview_profile(CLOUD, settings, plan, planned.stack, planned.fullest)
    surface = sample_surface(CLOUD, settings.thinning, NoProgress())
    curves = segment_profiles(surface, planned.stack, settings.profiles, 5.0)
    of_profile = np.flatnonzero(curves.profile_index == planned.fullest)
    assert preview.n_curves == len(of_profile)
    sizes = sorted(np.diff(curves.starts)[of_profile])
    assert sorted(np.bincount(preview.curve[preview.curve >= 0])) == sizes
    rows = np.isin(curves.curve_of_point, of_profile)
    expected = curves.uv[rows]
    found = preview.uv[preview.curve >= 0]
    order = [np.lexsort(np.round(uv, 6).T) for uv in (found, expected)]
    assert found[order[0]] == pytest.approx(expected[order[1]], abs=1e-6)


def test_that_the_ellipse_of_a_previewed_profile_lies_on_its_points():
    plan = plan_stacks(CLOUD, AXES)
    planned = plan.stacks[0]
    preview = preview_profile(CLOUD, AXES, plan, planned.stack, planned.fullest)
    assert len(preview.ellipses) == 1
    centre, major, minor, _ = preview.ellipse_uv(0)
    assert major == pytest.approx(R, abs=0.003)
    assert minor == pytest.approx(R, abs=0.003)
    middle = preview.frame[:2] @ np.array([0, 0, 0.6])
    assert np.linalg.norm(centre - middle) < 0.002


def test_that_a_sample_knows_spacing_and_shares_of_the_whole(monkeypatch):
    cloud = make_cloud(length=12.0)
    whole = plan_stacks(cloud, AXES)
    monkeypatch.setattr(pipecore.preview, "SAMPLE_SIZE", len(cloud) // 6)
    part = plan_stacks(cloud, AXES)
    assert part.voxel == pytest.approx(whole.voxel, rel=0.05)
    assert part.noise == pytest.approx(whole.noise, rel=0.2)
    for a, b in zip(part.stacks, whole.stacks, strict=True):
        assert a.share == pytest.approx(b.share, abs=0.12)


def test_that_a_profile_beside_the_cloud_is_empty():
    plan = plan_stacks(CLOUD, AXES)
    preview = preview_profile(CLOUD, AXES, plan, plan.stacks[0].stack, 10**6)
    assert (preview.n_points, preview.n_curves, len(preview.ellipses)) == (0, 0, 0)


def test_that_nothing_is_planned_for_nothing():
    assert plan_stacks(PointCloud(np.zeros(3), np.empty((0, 3), np.float32)), AXES) is None
    with pytest.raises(SettingsError):
        plan_stacks(CLOUD, Settings().replace({"stacks.preset": "none"}))


def test_that_planning_and_previewing_can_be_cancelled():
    class Stop:
        def update(self, stage, fraction):
            raise CancelledError

    with pytest.raises(CancelledError):
        plan_stacks(CLOUD, AXES, Stop())
    plan = plan_stacks(CLOUD, AXES)
    with pytest.raises(CancelledError):
        preview_profile(CLOUD, AXES, plan, plan.stacks[0].stack, 0, Stop())
