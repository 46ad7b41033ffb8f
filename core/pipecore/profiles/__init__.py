"""Profile segmentation: the points of each profile joined to curves (paper, section 3.2)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipecore._kernels import ellipses as ellipse_kernels
from pipecore._kernels import profiles as kernels
from pipecore.geometry import unit
from pipecore.parallel import for_chunks
from pipecore.progress import NoProgress, Progress
from pipecore.settings import ProfileMethod, ProfileSettings
from pipecore.surface import Surface
from pipecore.types import Stack

MAX_SLOPE = 0.62
"""A point joins a stack only if |n·d| is below: the profile cuts its surface steeply enough."""

GAP = 3.0
"""Automatic largest gap, in voxels, where points are as dense as the voxels."""

GAP_IN_SPACINGS = 2.6
"""The same where they are sparser, in local spacings."""

MIN_CURVE = 6
"""Curves of fewer points are dropped."""

MAX_PIECES = 40
"""Most pieces that one curve is split into."""


@dataclass(frozen=True, eq=False)
class Curves:
    """The curves of one stack: points grouped by curve.

    Parameters
    ----------
    stack : Stack
    frame : ndarray, shape (3, 3)
        Rows e1, e2 (in the profile's plane) and d (the stack's direction).
    points : ndarray of int, shape (k,)
        Indices into the surface's points, grouped by curve.
    uv : ndarray, shape (k, 2)
        Positions in the plane, carried along the surface to the profile's mid-plane.
    normals : ndarray, shape (k, 3)
        Normals in `frame`.
    starts : ndarray of int, shape (c + 1,)
        Where each curve starts.
    profile_index : ndarray of int32, shape (c,)
    """

    stack: Stack
    frame: NDArray[np.float64]
    points: NDArray[np.intp]
    uv: NDArray[np.float64]
    normals: NDArray[np.float64]
    starts: NDArray[np.int64]
    profile_index: NDArray[np.int32]

    def __len__(self) -> int:
        """Return the number of curves."""
        return len(self.profile_index)

    @property
    def curve_of_point(self) -> NDArray[np.intp]:
        """Number of the curve of each row of `points`."""
        return np.repeat(np.arange(len(self)), np.diff(self.starts))

    def mid_plane(self, curves: NDArray[np.intp] | slice = slice(None)) -> NDArray[np.float64]:
        """Distance of the profiles' mid-planes from the local zero along the direction."""
        index = self.profile_index[curves].astype(np.float64)
        return self.stack.offset + (index + 0.5) * self.stack.width


def stack_frame(direction: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rows e1, e2, d: a right-handed frame with d along `direction`."""
    e1 = unit(np.cross(np.eye(3)[np.argmin(np.abs(direction))], direction))
    return np.stack([e1, np.cross(direction, e1), direction])


def segment_profiles(
    surface: Surface,
    stack: Stack,
    settings: ProfileSettings,
    max_radius: float,
    progress: Progress = NoProgress(),
    span: tuple[float, float] = (0.0, 1.0),
) -> Curves:
    """Cut `stack` out of the surface and join the points of each profile to curves.

    By proximity, points within the largest gap of each other join; the components are
    those of the relative neighbourhood graph cut at that gap. By curve fitting they
    join only where they lie on one smooth curve, and curves that change their curvature
    sharply are split into pieces of one curvature each.

    Parameters
    ----------
    surface : Surface
    stack : Stack
    settings : ProfileSettings
    max_radius : float
        Largest radius of a piece, metres.
    progress : Progress
    span : (float, float)
        Which part of the stage "profiles" this is.
    """
    begin, end = span
    progress.update("profiles", begin)
    frame = stack_frame(stack.direction)
    n = len(surface.xyz)
    usable, profile = np.empty(n, np.bool_), np.zeros(n, np.int64)
    uv, normals = np.empty((n, 2)), np.empty((n, 3))
    kernels.carry_to_mid_planes(
        surface.xyz, surface.normals, usable, frame[2], frame[0], frame[1],
        stack.width, stack.offset, MAX_SLOPE, profile, uv, normals,
    )  # fmt: skip
    if stack.min_spacing:
        usable &= surface.spacing >= stack.min_spacing
    points = np.flatnonzero(usable)
    profile, uv, normals = profile[points], uv[points], normals[points]
    if len(points) == 0:
        return Curves(
            stack, frame, points, uv, normals, np.zeros(1, np.int64), np.empty(0, np.int32)
        )

    is_fitted = settings.method is ProfileMethod.CURVE_FITTING
    gap = settings.gap_mm / 1e3 or GAP * surface.voxel
    reach = np.full(len(points), gap)
    if not settings.gap_mm:
        reach = np.clip(GAP_IN_SPACINGS * surface.spacing[points], gap, 4 * gap)
    tolerance = surface.tolerance

    # Sort by profile and by cell within it, row by row, with empty margins between.
    # Cells count from the local zero: a part of the cloud is sorted as the whole is.
    cell_uv = np.floor(uv / gap).astype(np.int64)
    cell_uv -= cell_uv.min(axis=0)
    n_u, n_v = cell_uv.max(axis=0) + 12
    keys = ((profile - profile.min()) * n_u + cell_uv[:, 0]) * n_v + cell_uv[:, 1]
    order = np.argsort(keys, kind="stable")
    keys, points, profile = keys[order], points[order], profile[order]
    uv, normals, reach = uv[order], normals[order], reach[order]
    parents = np.arange(len(points))
    bounds = np.append(np.flatnonzero(np.diff(profile, prepend=profile[0] - 1)), len(points))

    def join(first: int, last: int) -> None:
        kernels.join_neighbours(
            keys, n_v, gap, uv, normals, reach,
            np.cos(np.deg2rad(settings.corner_deg)) if is_fitted else -1.0,
            tolerance, 0.12, bounds[first], bounds[last], parents,
        )  # fmt: skip

    middle = begin + 0.5 * (end - begin)
    for_chunks(join, len(bounds) - 1, 32, "profiles", progress, (begin, middle))
    curves = _group(stack, frame, points, uv, normals, profile, parents)
    if not is_fitted or len(curves) == 0:
        progress.update("profiles", end)
        return curves

    piece = np.zeros(len(curves.points), np.int64)

    def split(first: int, last: int) -> None:
        ellipse_kernels.split_curves(
            curves.uv, curves.normals, curves.starts, first, last, MIN_CURVE, tolerance,
            0.9, np.cos(np.pi / 4), max_radius, 60, MAX_PIECES, piece,
        )  # fmt: skip

    for_chunks(split, len(curves), 256, "profiles", progress, (middle, end))
    return _group(
        stack, frame, curves.points, curves.uv, curves.normals,
        np.repeat(curves.profile_index, np.diff(curves.starts)),
        curves.curve_of_point * (MAX_PIECES + 1) + piece,
    )  # fmt: skip


def _group(
    stack: Stack,
    frame: NDArray[np.float64],
    points: NDArray[np.intp],
    uv: NDArray[np.float64],
    normals: NDArray[np.float64],
    profile: NDArray[np.integer],
    label: NDArray[np.integer],
) -> Curves:
    """Group points by label; labels lie within profiles. Small groups are dropped."""
    _, number, counts = np.unique(label, return_inverse=True, return_counts=True)
    kept = counts[number] >= MIN_CURVE
    order = np.flatnonzero(kept)[np.argsort(number[kept], kind="stable")]
    sizes = counts[counts >= MIN_CURVE]
    starts = np.concatenate([[0], np.cumsum(sizes)])
    return Curves(
        stack,
        frame,
        points[order],
        uv[order],
        normals[order],
        starts,
        profile[order[starts[:-1]]].astype(np.int32),
    )
