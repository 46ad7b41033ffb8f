"""Profile segmentation: the points of each profile joined to curves (paper, section 3.2)."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from pipecore._kernels import profile_cuts as kernels
from pipecore._kernels.curve_splitting import SplitLimits, split_curves
from pipecore._kernels.grouping import group_from, group_large
from pipecore.geometry import unit
from pipecore.parallel import for_chunks, for_items
from pipecore.progress import NoProgress, Progress
from pipecore.settings import ProfileMethod, ProfileSettings
from pipecore.surface import Surface
from pipecore.types import Stack

MAX_SLOPE = 0.62
"""A point joins a stack only if |n·d| is below: the profile cuts its surface steeply enough."""

GAP_VOXELS = 3.0
"""Automatic largest gap, in voxels, where points are as dense as the voxels."""

GAP_SPACINGS = 2.6
"""The same where they are sparser, in local spacings."""

MIN_CURVE_POINTS = 6
"""Curves of fewer points are dropped."""

MAX_PIECES = 40
"""Most pieces that one curve is split into."""

MAX_GAP_RATIO = 4.0
"""The largest gap where points are sparsest, in those where they are dense."""

MARGIN_CELLS = 12
"""Empty cells between the rows of a profile: more than twice the cells of the largest gap."""

POINTS_AT_A_TIME = 40_000
"""Points of the profiles that one thread cuts at a time."""


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
    points: NDArray[np.int32]
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
        """Distance of the profiles' mid-planes from the local zero along the direction.

        Parameters
        ----------
        curves : ndarray of intp or slice
            Which curves; all if not given.

        Returns
        -------
        ndarray
            Metres, shape (n,).
        """
        index = self.profile_index[curves].astype(np.float64)
        return self.stack.offset + (index + 0.5) * self.stack.width


def stack_frame(direction: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a right-handed frame with its last vector along a stack.

    Parameters
    ----------
    direction : ndarray, shape (3,)
        Unit vector.

    Returns
    -------
    ndarray, shape (3, 3)
        Rows e1, e2 (in the profiles' planes) and d.
    """
    e1 = unit(np.cross(np.eye(3)[np.argmin(np.abs(direction))], direction))
    return np.stack([e1, np.cross(direction, e1), direction])


def stack_cut(stack: Stack, frame: NDArray[np.float64]) -> kernels.StackCut:
    """Return how a stack cuts, as the kernels take it.

    Parameters
    ----------
    stack : Stack
    frame : ndarray, shape (3, 3)
        Its `stack_frame`.

    Returns
    -------
    StackCut
    """
    return kernels.StackCut(frame[2], frame[0], frame[1], stack.width, stack.offset)


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

    Returns
    -------
    Curves
    """
    frame = stack_frame(stack.direction)
    portions = cut_portions(
        surface, stack, settings, max_radius, lambda curves, _: curves, progress, span
    )
    return _concatenated(stack, frame, portions)


Made = TypeVar("Made")


def cut_portions(
    surface: Surface,
    stack: Stack,
    settings: ProfileSettings,
    max_radius: float,
    make: Callable[[Curves, Callable[[], None]], Made],
    progress: Progress = NoProgress(),
    span: tuple[float, float] = (0.0, 1.0),
) -> list[Made]:
    """Do as `segment_profiles`, but a portion of whole profiles at a time, in threads.

    Parameters
    ----------
    surface, stack, settings, max_radius
        See `segment_profiles`.
    make : callable
        Takes a portion's curves, in its thread, and a function that it is to call now and then
        where it takes long.
    progress, span
        See `segment_profiles`.

    Returns
    -------
    list
        What `make` returned, in the order of the profiles; of no curves where nothing is cut.
    """
    begin, end = span
    progress.update("profiles", begin)
    middle = begin + 0.1 * (end - begin)
    cutter = _Cutter(surface, stack, settings, max_radius, progress, (begin, middle))
    bounds = cutter.bounds()
    if len(bounds) < 2:
        return [make(_concatenated(stack, cutter.frame, []), lambda: None)]
    made: dict[int, Made] = {}

    def cut(k: int, check: Callable[[], None]) -> None:
        made[k] = make(cutter.cut(bounds[k], bounds[k + 1]), check)

    for_items(cut, len(bounds) - 1, "profiles", progress, (middle, end))
    return [made[k] for k in range(len(bounds) - 1)]


class _Cutter:
    """Cuts profiles of one stack and joins their points to curves."""

    def __init__(
        self,
        surface: Surface,
        stack: Stack,
        settings: ProfileSettings,
        max_radius: float,
        progress: Progress,
        span: tuple[float, float],
    ) -> None:
        self.frame = stack_frame(stack.direction)
        self._cut = stack_cut(stack, self.frame)
        self._surface, self._stack, self._max_radius = surface, stack, max_radius
        self._gap = settings.gap_mm / 1e3 or GAP_VOXELS * surface.voxel
        self._is_gap_fixed = bool(settings.gap_mm)
        self._is_fitted = settings.method is ProfileMethod.CURVE_FITTING
        cos_corner = np.cos(np.deg2rad(settings.corner_deg)) if self._is_fitted else -1.0
        self._smoothness = kernels.Smoothness(cos_corner, surface.tolerance, 0.12)
        n = len(surface.xyz)
        profile: NDArray[np.integer] = np.empty(n, np.int32)
        limits = np.empty((-(-n // POINTS_AT_A_TIME), 2), np.int64)

        def find(start: int, stop: int) -> None:
            limits[start // POINTS_AT_A_TIME] = kernels.find_profiles(
                surface.xyz, surface.normals, surface.spacing, start, stop,
                self._cut, MAX_SLOPE, stack.min_spacing, profile,
            )  # fmt: skip

        for_chunks(find, n, POINTS_AT_A_TIME, "profiles", progress, span)
        first = limits[:, 0].min(initial=2**31)
        last = limits[:, 1].max(initial=-(2**31))
        if last - first > 2 * n:
            # Something lies far off: only the profiles that hold points are counted.
            held, profile = np.unique(profile, return_inverse=True)
            first, last = int(held[0] == kernels.NOT_CUT), len(held) - 1
        self._points, self._starts = group_from(profile, first, max(0, last - first + 1))

    def bounds(self) -> NDArray[np.intp]:
        """Points between which whole profiles lie, in portions of about the same size."""
        n = len(self._points)
        even = np.linspace(0, n, 1 + max(1, n // POINTS_AT_A_TIME))
        return np.unique(self._starts[np.searchsorted(self._starts, even)])

    def cut(self, start: int, stop: int) -> Curves:
        """Return the curves of the points start … stop."""
        surface = self._surface
        points = self._points[start:stop]
        n = len(points)
        profile, uv, normals = np.empty(n, np.int32), np.empty((n, 2)), np.empty((n, 3))
        kernels.carry_to_mid_planes(
            surface.xyz, surface.normals, points, self._cut, profile, uv, normals
        )
        order, keys, n_v = kernels.sort_by_cell(profile, uv, self._gap, MARGIN_CELLS)
        points, profile, uv, normals = points[order], profile[order], uv[order], normals[order]
        reach = np.full(n, self._gap)
        if not self._is_gap_fixed:
            spacing = surface.spacing[points]
            reach = np.clip(GAP_SPACINGS * spacing, self._gap, MAX_GAP_RATIO * self._gap)
        parents = np.arange(n)
        kernels.join_neighbours(
            keys, n_v, self._gap, uv, normals, reach, self._smoothness, 0, n, parents
        )
        curves = self._grouped(points, uv, normals, profile, parents, n)
        if not self._is_fitted or len(curves) == 0:
            return curves
        piece = np.zeros(len(curves.points), np.int64)
        limits = SplitLimits(
            min_points=MIN_CURVE_POINTS,
            tolerance=surface.tolerance,
            max_gap=4.0 * surface.voxel,
            cos_radial=0.9,
            min_cos_tilt=np.cos(np.pi / 4),
            max_radius=self._max_radius,
            n_trials=60,
            max_pieces=MAX_PIECES,
        )
        split_curves(curves.uv, curves.normals, curves.starts, 0, len(curves), limits, piece)
        profile = np.repeat(curves.profile_index, np.diff(curves.starts))
        label = curves.curve_of_point * (MAX_PIECES + 1) + piece
        n_labels = len(curves) * (MAX_PIECES + 1)
        return self._grouped(curves.points, curves.uv, curves.normals, profile, label, n_labels)

    def _grouped(
        self,
        points: NDArray[np.integer],
        uv: NDArray[np.float64],
        normals: NDArray[np.float64],
        profile: NDArray[np.int32],
        label: NDArray[np.int64],
        n_labels: int,
    ) -> Curves:
        """Group points by label; labels lie within profiles. Small groups are dropped."""
        members, starts = group_large(label, n_labels, MIN_CURVE_POINTS)
        own, places, vectors, index = kernels.gather(points, uv, normals, profile, members, starts)
        return Curves(self._stack, self.frame, own, places, vectors, starts, index)


def _concatenated(stack: Stack, frame: NDArray[np.float64], curves: Sequence[Curves]) -> Curves:
    """One table of the curves of all portions."""
    sizes = [np.diff(c.starts) for c in curves]
    return Curves(
        stack,
        frame,
        np.concatenate([np.empty(0, np.int32), *(c.points for c in curves)]),
        np.concatenate([np.empty((0, 2)), *(c.uv for c in curves)]),
        np.concatenate([np.empty((0, 3)), *(c.normals for c in curves)]),
        np.cumsum(np.concatenate([np.zeros(1, np.int64), *sizes])),
        np.concatenate([np.empty(0, np.int32), *(c.profile_index for c in curves)]),
    )
