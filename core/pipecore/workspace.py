"""Where a cloud's points are during a detection, and the steps that visit all of them.

In memory they are taken together. `pipecore.tiling` has a workspace of files for clouds that
are larger, with the same results.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from pipecore._kernels.grouping import spread_to_members
from pipecore.allocation import BLOCK, Allocate, in_memory
from pipecore.ellipses import Ellipses, fit_ellipses
from pipecore.parallel import for_chunks
from pipecore.profiles import Curves, cut_portions
from pipecore.progress import Progress
from pipecore.settings import Settings, ThinningSettings
from pipecore.surface import Order, Surface, planes_of_points, sample_surface
from pipecore.types import PointCloud, Stack

Array = NDArray[np.float64]


class PlaneLabels(NamedTuple):
    """The planes of some consecutive downsampled points.

    Parameters
    ----------
    first : int
        Index of the first of the points.
    plane : ndarray of int32, shape (n,)
        Number of each point's plane, from 0; negative for points of none.
    """

    first: int
    plane: NDArray[np.int32]


class Cut(NamedTuple):
    """The curves of some profiles, with their ellipses.

    Parameters
    ----------
    points : ndarray of int32, shape (n,)
        Indices of the downsampled points, curve after curve.
    starts : ndarray of int64, shape (c + 1,)
        Where the points of each curve begin.
    ellipses : Ellipses
        Of those of the curves that have one.
    """

    points: NDArray[np.int32]
    starts: NDArray[np.int64]
    ellipses: Ellipses


@dataclass(frozen=True, eq=False)
class NonPlanarPoints:
    """What stacks cut of a surface: all but the inner parts of planes.

    Parameters
    ----------
    surface : Surface
        Of these points only.
    rows : ndarray of int32, shape (len(surface.xyz),)
        Their indices among all downsampled points.
    """

    surface: Surface
    rows: NDArray[np.int32]


class Workspace(Protocol):
    """Holds a cloud and takes the steps that visit all of its points.

    The steps are called in the order in which they are listed, each once.
    """

    @property
    def cloud(self) -> PointCloud:
        """The cloud."""
        ...

    @property
    def allocate(self) -> Allocate:
        """Makes arrays with a value for each point, of the cloud or downsampled."""
        ...

    def sample_surface(self, settings: ThinningSettings, progress: Progress) -> Surface:
        """Downsample the cloud and estimate the normals of the downsampled points.

        Parameters
        ----------
        settings : ThinningSettings
        progress : Progress
            May cancel.

        Returns
        -------
        Surface
        """
        ...

    def remove_planes(
        self, surface: Surface, max_radius: float, progress: Progress
    ) -> Iterator[PlaneLabels]:
        """Find the planes of the surface; what is well inside them will not be cut.

        Parameters
        ----------
        surface : Surface
        max_radius : float
            Largest radius of a pipe, metres: a plane is flatter.
        progress : Progress

        Yields
        ------
        PlaneLabels
            Of all downsampled points, in their order.
        """
        ...

    def cut_stacks(
        self, stacks: Sequence[Stack], settings: Settings, progress: Progress
    ) -> Iterator[Cut]:
        """Cut stacks, join the points of their profiles to curves and fit ellipses to these.

        Stack by stack: the curves of all together need more memory than the cloud.

        Parameters
        ----------
        stacks : sequence of Stack
        settings : Settings
        progress : Progress
            May cancel.

        Yields
        ------
        Cut
            In the order of the stacks and profiles; its arrays are valid until the next.
        """
        ...


class InMemory:
    """The points of a cloud in memory, taken together; see `Workspace`.

    Parameters
    ----------
    cloud : PointCloud
    """

    def __init__(self, cloud: PointCloud) -> None:
        self.cloud = cloud
        self.allocate: Allocate = in_memory
        self._non_planar: NonPlanarPoints | None = None

    def sample_surface(self, settings: ThinningSettings, progress: Progress) -> Surface:
        """See `Workspace`."""
        return sample_surface(self.cloud, settings, progress)

    def remove_planes(
        self, surface: Surface, max_radius: float, progress: Progress
    ) -> Iterator[PlaneLabels]:
        """See `Workspace`."""
        plane, is_cut = planes_of_points(
            surface.xyz, surface.normals, surface.voxel, max_radius, progress
        )
        yield PlaneLabels(0, plane)
        rows = np.flatnonzero(is_cut).astype(np.int32)
        self._non_planar = NonPlanarPoints(surface.part(rows), rows)

    def cut_stacks(
        self, stacks: Sequence[Stack], settings: Settings, progress: Progress
    ) -> Iterator[Cut]:
        """See `Workspace`."""
        left = self._non_planar
        assert left is not None, "planes have not been removed"
        for stack, span in with_spans(stacks):
            for cut in cut_and_fit(left.surface, stack, settings, progress, span):
                yield cut._replace(points=left.rows[cut.points])
        self._non_planar = None


def cut_and_fit(
    surface: Surface,
    stack: Stack,
    settings: Settings,
    progress: Progress,
    span: tuple[float, float] = (0.0, 1.0),
) -> list[Cut]:
    """Cut a stack of a surface and fit ellipses to its curves.

    Parameters
    ----------
    surface : Surface
        The whole of it, or a part that holds whole profiles.
    stack : Stack
    settings : Settings
    progress : Progress
        Receives fractions of the stage "profiles".
    span : (float, float)
        Which part of the stage this stack is.

    Returns
    -------
    list of Cut
        Of some of the profiles each, with indices of the points of `surface`.
    """

    def fit(curves: Curves, check: Callable[[], None]) -> Cut:
        ellipses = fit_ellipses(curves, surface, settings.ellipses, settings.elements, check)
        return Cut(curves.points, curves.starts, ellipses)

    max_radius = settings.elements.max_radius
    return cut_portions(surface, stack, settings.profiles, max_radius, fit, progress, span)


def labels_to_full_cloud(
    labels: NDArray[np.int32], members: Order, allocate: Allocate, progress: Progress
) -> NDArray[np.int32]:
    """Give each point of the cloud the label of its downsampled point.

    Parameters
    ----------
    labels : ndarray of int32, shape (m,)
        Of the downsampled points.
    members : (ndarray of int, shape (n,), ndarray of int, shape (m + 1,))
        `Surface.full_resolution_points`.
    allocate : callable
        Makes the array that is returned.
    progress : Progress
        Receives fractions of the stage "segments".

    Returns
    -------
    ndarray of int32, shape (n,)
    """
    points, starts = members
    of_cloud: NDArray[np.int32] = allocate("segment_id", (len(points),), np.int32)

    def give(first: int, last: int) -> None:
        spread_to_members(labels, points, starts, first, last, of_cloud)

    for_chunks(give, len(labels), BLOCK, "segments", progress)
    return of_cloud


Item = TypeVar("Item")


def with_spans(items: Sequence[Item]) -> Iterator[tuple[Item, tuple[float, float]]]:
    """Iterate over items, each with the part of its stage that it is, from 0 to 1.

    Parameters
    ----------
    items : sequence

    Returns
    -------
    iterator of (item, (float, float))
    """
    for i, item in enumerate(items):
        yield item, (i / len(items), (i + 1) / len(items))
