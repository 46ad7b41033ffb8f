"""What a detection would cut, before it runs: its stacks, and any one of their profiles.

Stacks are judged on a sample: the points in blocks of space chosen by a hash of their
place, with all their neighbours, so that spacing and normals come out as they do in the
whole cloud. A profile is cut out of the whole cloud with the margin that its normals need,
by the same functions as in the pipeline.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pipecore.ellipses import Ellipses, fit_ellipses
from pipecore.profiles import MAX_SLOPE, segment_profiles
from pipecore.progress import NoProgress, Progress, in_chunks
from pipecore.settings import Settings
from pipecore.stacks import choose_stacks
from pipecore.surface import (
    NO_FULL_RESOLUTION_POINTS,
    NOISE_QUANTILE,
    WIDEST_NEIGHBOURHOOD,
    Surface,
    fit_planes,
    sample_surface,
)
from pipecore.surface.downsampling import automatic_voxel, average_voxels
from pipecore.types import PointCloud, Stack

Array = NDArray[np.float64]

SAMPLE_SIZE = 300_000
"""About as many points of the cloud are sampled to choose its stacks."""
BLOCK_SIZE = 0.25
"""Edge of the blocks of space that a sample is made of, metres."""
BLOCK_MARGIN = 0.15
"""Fraction of a block's edge at its sides where points lack neighbours."""
MIN_SAMPLE_FRACTION = 0.3
"""A sample of less than this fraction of `SAMPLE_SIZE` is drawn again from more blocks."""
POINTS_PER_CHUNK = 2_000_000


@dataclass(frozen=True, eq=False)
class StackPlan:
    """One stack as it would be cut.

    Parameters
    ----------
    stack : Stack
    first, last : int
        Indices of the first and the last profile that holds points.
    fullest : int
        Index of the profile with most points that are cut well.
    share : float
        Share of the surface's points that the stack cuts steeply enough to use; nan if the
        sample has no normals.
    """

    stack: Stack
    first: int
    last: int
    fullest: int
    share: float

    @property
    def n_profiles(self) -> int:
        """Number of profiles from the first to the last one."""
        return self.last - self.first + 1


@dataclass(frozen=True, eq=False)
class Plan:
    """What a detection would cut.

    Parameters
    ----------
    stacks : tuple of StackPlan
    share : float
        Share of the points that at least one stack cuts well.
    voxel, noise : float
        Of the sample's surface, metres; see `Surface`.
    """

    stacks: tuple[StackPlan, ...]
    share: float
    voxel: float
    noise: float


@dataclass(frozen=True, eq=False)
class ProfilePreview:
    """One profile with its curves and ellipses, in its plane.

    Parameters
    ----------
    stack : Stack
    profile_index : int
    frame : ndarray, shape (3, 3)
        Rows e1, e2 (the plane's axes u and v) and d, as in `Curves`.
    uv : ndarray, shape (n, 2)
        All downsampled points of the profile, metres.
    curve : ndarray of int, shape (n,)
        The curve that each belongs to, -1 for points of none.
    n_curves : int
    ellipses : Ellipses
        Those that were accepted.
    n_points : int
        Points of the cloud in the profile.
    """

    stack: Stack
    profile_index: int
    frame: Array
    uv: Array
    curve: NDArray[np.intp]
    n_curves: int
    ellipses: Ellipses
    n_points: int

    def ellipse_uv(self, row: int) -> tuple[Array, float, float, float]:
        """Return one ellipse in the profile's plane.

        Parameters
        ----------
        row : int
            Its row in `ellipses`.

        Returns
        -------
        centre : ndarray, shape (2,)
            Metres.
        semi_major, semi_minor, angle : float
            Metres, and radians of the major axis from u.
        """
        ellipses = self.ellipses
        centre = self.frame[:2] @ ellipses.centre[row]
        right, up = self.frame[:2] @ ellipses.major_direction[row]
        semi_axes = float(ellipses.semi_major[row]), float(ellipses.semi_minor[row])
        return centre, *semi_axes, float(np.arctan2(up, right))


def plan_stacks(
    cloud: PointCloud, settings: Settings, progress: Progress = NoProgress()
) -> Plan | None:
    """Return what a detection would cut, judged on a sample of the cloud.

    Parameters
    ----------
    cloud : PointCloud
    settings : Settings
    progress : Progress

    Returns
    -------
    Plan or None
        None for a cloud without points.

    Raises
    ------
    SettingsError
        If the settings ask for no stacks.
    """
    if len(cloud) == 0:
        return None
    surface, is_whole = _surface_of_sample(cloud, settings, progress)
    stacks = choose_stacks(surface, settings.stacks, settings.elements.max_radius, progress)
    known = ~np.isnan(surface.normals[:, 0]) & is_whole
    xyz, normals, spacing = surface.xyz[known], surface.normals[known], surface.spacing[known]
    plans, is_cut = [], np.zeros(len(xyz), np.bool_)
    for stack in stacks:
        is_steep = np.abs(normals @ stack.direction) < MAX_SLOPE
        if stack.min_spacing:
            is_steep &= spacing >= stack.min_spacing
        is_cut |= is_steep
        plans.append(_plan(stack, surface.xyz, xyz[is_steep], len(xyz)))
    share = float(is_cut.mean()) if len(is_cut) else np.nan
    return Plan(tuple(plans), share, surface.voxel, surface.noise)


def _surface_of_sample(
    cloud: PointCloud, settings: Settings, progress: Progress
) -> tuple[Surface, NDArray[np.bool_]]:
    """The surface of some blocks of a cloud, and which of its points have all neighbours."""
    index = _sample(cloud, progress)
    xyz = cloud.xyz[index]
    is_all = len(index) == len(cloud)
    inside = None if is_all else _is_well_inside(xyz)
    voxel = settings.thinning.voxel_mm / 1e3 or automatic_voxel(xyz, cloud.step, inside)
    downsampled = average_voxels(xyz, voxel, progress)
    normals, residuals, distances = fit_planes(downsampled.xyz, voxel, progress)
    is_whole = np.full(len(normals), is_all) | _is_well_inside(downsampled.xyz)
    known = residuals[np.isfinite(residuals) & is_whole]
    noise = float(np.quantile(known, NOISE_QUANTILE)) if len(known) else np.nan
    return Surface(
        downsampled.xyz, normals, distances, downsampled.full_resolution_points, voxel, noise
    ), is_whole


def _is_well_inside(xyz: NDArray[np.floating]) -> NDArray[np.bool_]:
    """Whether points lie well inside their blocks, where they have all their neighbours."""
    place = np.mod(xyz / BLOCK_SIZE, 1.0)
    return np.asarray(((place > BLOCK_MARGIN) & (place < 1.0 - BLOCK_MARGIN)).all(axis=1))


def _plan(stack: Stack, all_xyz: Array, steep_xyz: Array, n_known: int) -> StackPlan:
    every = stack.profile_index(all_xyz)
    first, last = int(every.min()), int(every.max())
    counts = np.bincount(stack.profile_index(steep_xyz) - first, minlength=1)
    fullest = first + int(np.argmax(counts))
    share = len(steep_xyz) / n_known if n_known else np.nan
    return StackPlan(stack, first, last, fullest, share)


def preview_profile(
    cloud: PointCloud,
    settings: Settings,
    plan: Plan,
    stack: Stack,
    profile_index: int,
    progress: Progress = NoProgress(),
) -> ProfilePreview:
    """Cut one profile of a stack, join its points to curves and fit their ellipses.

    Parameters
    ----------
    cloud : PointCloud
    settings : Settings
    plan : Plan
        Gives voxel and noise of the whole cloud.
    stack : Stack
    profile_index : int
    progress : Progress

    Returns
    -------
    ProfilePreview
    """
    margin = WIDEST_NEIGHBOURHOOD * plan.voxel
    slab = cloud.xyz[_slab(cloud, stack, profile_index, margin, progress)]
    n_points = int((stack.profile_index(slab) == profile_index).sum())
    thinning = replace(settings.thinning, voxel_mm=1e3 * plan.voxel)
    surface = _empty_surface(plan)
    if n_points:
        whole = sample_surface(PointCloud(cloud.origin, slab), thinning, progress)
        inside = stack.profile_index(whole.xyz) == profile_index
        surface = replace(
            surface,
            xyz=whole.xyz[inside],
            normals=whole.normals[inside],
            spacing=whole.spacing[inside],
        )
    max_radius = settings.elements.max_radius
    curves = segment_profiles(surface, stack, settings.profiles, max_radius, progress)
    frame = curves.frame
    ellipses = fit_ellipses(curves, surface, settings.ellipses, settings.elements)
    uv = surface.xyz @ frame[:2].T
    curve = np.full(len(uv), -1, np.intp)
    curve[curves.points] = curves.curve_of_point
    uv[curves.points] = curves.uv
    return ProfilePreview(stack, profile_index, frame, uv, curve, len(curves), ellipses, n_points)


def _empty_surface(plan: Plan) -> Surface:
    nowhere, none = np.empty((0, 3)), np.empty(0)
    return Surface(nowhere, nowhere, none, NO_FULL_RESOLUTION_POINTS, plan.voxel, plan.noise)


def _slab(
    cloud: PointCloud, stack: Stack, profile_index: int, margin: float, progress: Progress
) -> NDArray[np.intp]:
    """Indices of the points within a margin of a profile."""
    middle = stack.offset + (profile_index + 0.5) * stack.width
    reach = stack.width / 2 + margin
    found = []
    for start, stop in in_chunks(len(cloud), POINTS_PER_CHUNK, "profiles", progress):
        along = cloud.xyz[start:stop] @ np.asarray(stack.direction, cloud.xyz.dtype)
        found.append(start + np.flatnonzero(np.abs(along - middle) <= reach))
    return np.concatenate(found)


def _sample(cloud: PointCloud, progress: Progress) -> NDArray[np.intp]:
    """Indices of the points in some blocks of space."""
    share = SAMPLE_SIZE / len(cloud)
    while True:
        limit = np.uint64(min(share, 1.0) * float(2**32))
        found = [
            start + np.flatnonzero(_hash_of_block(cloud.xyz[start:stop]) < limit)
            for start, stop in in_chunks(len(cloud), POINTS_PER_CHUNK, "thinning", progress)
        ]
        index = np.concatenate(found)
        if share >= 1.0 or len(index) >= MIN_SAMPLE_FRACTION * SAMPLE_SIZE:
            return index
        share *= 2


def _hash_of_block(xyz: NDArray[np.floating]) -> NDArray[np.uint64]:
    """A number below 2³² for the block that each point lies in."""
    block = np.floor(xyz / BLOCK_SIZE).astype(np.int64).astype(np.uint64)
    mixed = block[:, 0] * np.uint64(0x9E3779B97F4A7C15)
    mixed ^= block[:, 1] * np.uint64(0xC2B2AE3D27D4EB4F)
    mixed ^= block[:, 2] * np.uint64(0x165667B19E3779F9)
    mixed = (mixed ^ (mixed >> np.uint64(29))) * np.uint64(0xBF58476D1CE4E5B9)
    return np.asarray(mixed >> np.uint64(32))
