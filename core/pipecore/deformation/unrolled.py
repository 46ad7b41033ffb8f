"""An element's neighbourhood rolled out flat: chainage, clock and height above its surface."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipecore.geometry import ArcAxis, Array
from pipecore.types import Element, ElementKind

Flags = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Unrolled:
    """Points in the coordinates of an element; all arrays of shape (n,).

    Parameters
    ----------
    chainage, clock : ndarray
        Metres and radians (0 … 2π).
    height : ndarray
        Signed distance from the element's fitted surface, metres, outward positive.
    alignment : ndarray
        |cosine| between a point's normal and the surface's; nan where not known.
    """

    chainage: Array
    clock: Array
    height: Array
    alignment: Array

    def __getitem__(self, rows: Flags | NDArray[np.intp]) -> "Unrolled":
        """Return the given points."""
        return Unrolled(
            self.chainage[rows], self.clock[rows], self.height[rows], self.alignment[rows]
        )


def unroll(element: Element, xyz: Array, normals: Array) -> Unrolled:
    """Return points (n, 3) with their normals in the coordinates of an element."""
    axis = element.axis
    chainage, distance, clock = axis.pipe_coordinates(xyz)
    if element.kind is ElementKind.SPHERE:
        from_centre = xyz - element.centre
        distance = np.linalg.norm(from_centre, axis=1)
        outward = from_centre / np.maximum(distance, 1e-9)[:, None]
        height = distance - element.radius
    else:
        slope = (element.radius_end - element.radius) / axis.length
        outward = xyz - axis.at(chainage)
        outward /= np.maximum(distance, 1e-9)[:, None]
        outward -= slope * axis.tangent(chainage)
        outward /= np.hypot(1.0, slope)
        height = (distance - element.radius_at(chainage)) / np.hypot(1.0, slope)
    alignment = np.abs(np.einsum("ij,ij->i", outward, normals))
    return Unrolled(chainage, clock, height, alignment)


def surface_distance(element: Element, xyz: Array) -> Array:
    """Unsigned distance of points (n, 3) from an element's surface between its ends."""
    chainage, distance, _ = element.axis.pipe_coordinates(xyz)
    if element.kind is ElementKind.SPHERE:
        return np.asarray(np.abs(np.linalg.norm(xyz - element.centre, axis=1) - element.radius))
    within = np.clip(chainage, 0.0, element.axis.length)
    return np.asarray(np.hypot(distance - element.radius_at(within), chainage - within))


def stretch(element: Element, clock: Array | float) -> Array:
    """Length on the surface per chainage: 1, but more outside and less inside of a bend."""
    axis, theta = element.axis, np.asarray(clock, dtype=np.float64)
    if not isinstance(axis, ArcAxis):
        return np.ones_like(theta)
    up, right = axis.frame(0.0)
    up_part, right_part = up @ axis.towards_start, right @ axis.towards_start
    outward = np.cos(theta) * up_part + np.sin(theta) * right_part
    return np.asarray(1.0 + element.radius * outward / axis.bend_radius)
