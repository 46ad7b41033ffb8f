"""An element's neighbourhood rolled out flat: chainage, clock and height above its surface."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipecore._kernels import pipe_coordinates as axis_kernels
from pipecore._kernels import unrolling as kernels
from pipecore.geometry import ArcAxis, Array
from pipecore.types import Element, ElementKind

Flags = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class UnrolledPoints:
    """Points in the coordinates of an element; all arrays of shape (n,).

    Parameters
    ----------
    chainage, distance, clock : ndarray
        Metres, metres from the axis, and radians (0 … 2π).
    height : ndarray
        Signed distance from the element's fitted surface, metres, outward positive.
    alignment : ndarray
        |cosine| between a point's normal and the surface's; nan where not known.
    """

    chainage: Array
    distance: Array
    clock: Array
    height: Array
    alignment: Array

    def __getitem__(self, rows: Flags | NDArray[np.intp]) -> "UnrolledPoints":
        """Return the given points."""
        return UnrolledPoints(
            self.chainage[rows],
            self.distance[rows],
            self.clock[rows],
            self.height[rows],
            self.alignment[rows],
        )


def unroll(element: Element, xyz: Array, normals: Array) -> UnrolledPoints:
    """Return points in the coordinates of an element.

    Parameters
    ----------
    element : Element
    xyz : ndarray, shape (n, 3)
        Local coordinates, metres.
    normals : ndarray, shape (n, 3)
        Unit normals of either sign, nan where not known.

    Returns
    -------
    UnrolledPoints
    """
    chainage, distance, clock, height, alignment = np.empty((5, len(xyz)))
    slope = (element.radius_end - element.radius) / element.axis.length
    kernels.unroll(
        element.axis.numbers, element.radius, slope, xyz, normals,
        chainage, distance, clock, height, alignment,
    )  # fmt: skip
    if element.kind is ElementKind.SPHERE:
        outward = xyz - element.centre
        from_centre = np.linalg.norm(outward, axis=1)
        height = from_centre - element.radius
        alignment = np.abs(np.einsum("ij,ij->i", outward, normals))
        alignment /= np.maximum(from_centre, 1e-9)
    return UnrolledPoints(chainage, distance, clock, height, alignment)


def surface_distance(element: Element, xyz: Array) -> Array:
    """Return the distance of points from an element's surface between its ends.

    Parameters
    ----------
    element : Element
    xyz : ndarray, shape (n, 3)
        Local coordinates, metres.

    Returns
    -------
    ndarray, shape (n,)
        Metres, not negative.
    """
    if element.kind is ElementKind.SPHERE:
        return np.asarray(np.abs(np.linalg.norm(xyz - element.centre, axis=1) - element.radius))
    chainage, distance, clock = np.empty((3, len(xyz)))
    axis_kernels.pipe_coordinates(element.axis.numbers, xyz, chainage, distance, clock)
    within = np.clip(chainage, 0.0, element.axis.length)
    return np.asarray(np.hypot(distance - element.radius_at(within), chainage - within))


def stretch(element: Element, clock: Array | float) -> Array:
    """Return the length on the surface per chainage: 1, but more outside and less inside a bend.

    Parameters
    ----------
    element : Element
    clock : ndarray or float
        Radians.

    Returns
    -------
    ndarray, shape of clock
    """
    axis, theta = element.axis, np.asarray(clock, dtype=np.float64)
    if not isinstance(axis, ArcAxis):
        return np.ones_like(theta)
    up, right = axis.frame(0.0)
    up_part, right_part = up @ axis.towards_start, right @ axis.towards_start
    outward = np.cos(theta) * up_part + np.sin(theta) * right_part
    return np.asarray(1.0 + element.radius * outward / axis.bend_radius)


def min_stretch(element: Element) -> float:
    """Return the least value of `stretch` all round, at least 0.05.

    Parameters
    ----------
    element : Element

    Returns
    -------
    float
    """
    if not isinstance(element.axis, ArcAxis):
        return 1.0
    return float(max(1.0 - element.radius / element.axis.bend_radius, 0.05))
