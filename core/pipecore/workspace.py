"""Where a cloud's points are while it is detected, and the steps that look at all of them.

In memory they are taken together. `pipecore.tiling` has a workspace of files for clouds that
are larger, with the same results.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from pipecore._kernels.grouping import spread_to_members
from pipecore.allocation import BLOCK, Allocate, in_memory
from pipecore.ellipses import Ellipses, fit_ellipses
from pipecore.parallel import for_chunks
from pipecore.profiles import Curves, cut_portions
from pipecore.progress import Progress
from pipecore.settings import Settings, ThinningSettings
from pipecore.stacks.directions import local_axes
from pipecore.surface import Order, Surface, planes_of_points, sample_surface
from pipecore.types import PointCloud, Stack

Array = NDArray[np.float64]
Cut = tuple[NDArray[np.int32], NDArray[np.int64], Ellipses]
"""The thinned points of some curves, where those of each begin, and the curves' ellipses."""


JoinPlanes = Callable[[int, NDArray[np.int32]], None]
"""Told the planes of the thinned points from one on, by number, below 0 for none."""


@dataclass(frozen=True, eq=False)
class Uneven:
    """What the stacks cut of a surface: all but the inner parts of planes.

    Parameters
    ----------
    surface : Surface
        In memory these points only; else all of them, and files tell which are cut.
    rows : ndarray of int32
        Their places among all of the surface; empty where files tell.
    """

    surface: Surface
    rows: NDArray[np.int32]


class Workspace(Protocol):
    """Holds a cloud and takes the steps that look at all of its points."""

    @property
    def cloud(self) -> PointCloud:
        """The cloud."""
        ...

    @property
    def allocate(self) -> Allocate:
        """Makes arrays with a value for each point, of the cloud or thinned."""
        ...

    def sample_surface(self, settings: ThinningSettings, progress: Progress) -> Surface:
        """Thin the cloud and estimate the normals of the thinned points."""
        ...

    def local_axes(self, surface: Surface, progress: Progress) -> Array:
        """Directions of the local axis at sampled curved places of the surface."""
        ...

    def leave_out_planes(
        self, surface: Surface, join: JoinPlanes, settings: Settings, progress: Progress
    ) -> Uneven:
        """Find the planes of the surface, tell them to `join`, return what is to be cut."""
        ...

    def cut(
        self,
        uneven: Uneven,
        stack: Stack,
        settings: Settings,
        progress: Progress,
        span: tuple[float, float],
    ) -> Iterator[Cut]:
        """Cut a stack, join the points of its profiles to curves and fit their ellipses."""
        ...


class InMemory:
    """The points of a cloud in memory, taken together."""

    def __init__(self, cloud: PointCloud) -> None:
        self.cloud = cloud
        self.allocate: Allocate = in_memory

    def sample_surface(self, settings: ThinningSettings, progress: Progress) -> Surface:
        """See `Workspace`."""
        return sample_surface(self.cloud, settings, progress)

    def local_axes(self, surface: Surface, progress: Progress) -> Array:
        """See `Workspace`."""
        return local_axes(surface, progress)

    def leave_out_planes(
        self, surface: Surface, join: JoinPlanes, settings: Settings, progress: Progress
    ) -> Uneven:
        """See `Workspace`."""
        max_radius = settings.elements.max_radius_mm / 1e3
        plane, is_cut = planes_of_points(
            surface.xyz, surface.normals, surface.voxel, max_radius, progress
        )
        join(0, plane)
        rows = np.flatnonzero(is_cut).astype(np.int32)
        return Uneven(surface.part(rows), rows)

    def cut(
        self,
        uneven: Uneven,
        stack: Stack,
        settings: Settings,
        progress: Progress,
        span: tuple[float, float],
    ) -> Iterator[Cut]:
        """See `Workspace`."""
        portions = cut_and_fit(uneven.surface, stack, settings, progress, span)
        for points, starts, ellipses in portions:
            yield uneven.rows[points], starts, ellipses


def cut_and_fit(
    surface: Surface,
    stack: Stack,
    settings: Settings,
    progress: Progress,
    span: tuple[float, float] = (0.0, 1.0),
) -> list[Cut]:
    """Cut a stack of a surface or of a part that holds whole profiles; fit its ellipses.

    Returns
    -------
    list of Cut
        Of a portion of the profiles each, with places in the surface.
    """

    def fit(curves: Curves, check: Callable[[], None]) -> Cut:
        ellipses = fit_ellipses(curves, surface, settings.ellipses, settings.elements, check)
        return curves.points, curves.starts, ellipses

    max_radius = settings.elements.max_radius_mm / 1e3
    return cut_portions(surface, stack, settings.profiles, max_radius, fit, progress, span)


def spread(
    values: NDArray[np.int32], behind: Order, allocate: Allocate, progress: Progress
) -> NDArray[np.int32]:
    """Give each point of the cloud the value of its thinned point."""
    members, starts = behind
    spread_out: NDArray[np.int32] = allocate("segment_id", (len(members),), np.int32)

    def give(first: int, last: int) -> None:
        spread_to_members(values, members, starts, first, last, spread_out)

    for_chunks(give, len(values), BLOCK, "segments", progress)
    return spread_out
