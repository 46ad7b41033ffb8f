"""The points of an element, and those of one of its profiles."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipecore.geometry import Array
from pipecore.types import OWN_STACK, PointCloud, Profiles, Result


@dataclass(frozen=True, eq=False)
class ElementPoints:
    """The points of an element in its pipe coordinates; all arrays of shape (n,).

    Parameters
    ----------
    index : ndarray of int
        Their places in the cloud.
    chainage, distance, clock : ndarray
        Metres, metres from the axis, and radians (0 … 2π).
    deviation : ndarray
        Signed distance from the undeformed contour, metres, outward positive; see
        `Result.deviation`.
    """

    index: NDArray[np.intp]
    chainage: Array
    distance: Array
    clock: Array
    deviation: Array

    def __len__(self) -> int:
        """Return the number of points."""
        return len(self.index)


def element_points(
    cloud: PointCloud, result: Result, element_id: int, index: NDArray[np.intp] | None = None
) -> ElementPoints:
    """Return the points of an element in its pipe coordinates.

    Parameters
    ----------
    cloud : PointCloud
        The cloud that `result` was detected in.
    result : Result
    element_id : int
    index : ndarray of int, shape (n,), optional
        The element's points, where they are known already.

    Returns
    -------
    ElementPoints

    Raises
    ------
    KeyError
        If the result has no such element.
    """
    axis = result.element(element_id).axis
    if index is None:
        index = np.flatnonzero(result.element_id == element_id)
    chainage, distance, clock = axis.pipe_coordinates(cloud.xyz[index].astype(np.float64))
    deviation = result.deviation[index].astype(np.float64)
    return ElementPoints(index, chainage, distance, clock, deviation)


def profile_points(
    cloud: PointCloud, result: Result, profile: Profiles, points: ElementPoints
) -> NDArray[np.intp]:
    """Return which points of the cloud lie in one profile of an element.

    Parameters
    ----------
    cloud : PointCloud
    result : Result
    profile : Profiles
        A table of one row, of the element's own stack or of one that was cut.
    points : ElementPoints
        All points of the profile's element.

    Returns
    -------
    ndarray of int, shape (k,)
        Their places in the cloud, in order.
    """
    chainage, stack_id = float(profile.chainage[0]), int(profile.stack_id[0])
    index = int(profile.profile_index[0])
    if stack_id == OWN_STACK:
        # Own profiles follow each other without gaps from the element's start.
        width = chainage / (index + 0.5)
        is_inside = np.floor(points.chainage / width) == index
        return np.asarray(points.index[is_inside])
    stack = next(s for s in result.stacks if s.stack_id == stack_id)
    is_inside = stack.profile_index(cloud.xyz[points.index]) == index
    # A stack's plane may cut a bend twice: only the branch of this profile counts.
    is_near = np.abs(points.chainage - chainage) < 4 * profile.semi_major[0]
    return np.asarray(points.index[is_inside & is_near])
