"""Rounded corners: what is curved between two planes is a fillet or an edge, not a pipe.

A concrete plinth meets its floor in a fillet, a hollow section turns its edges by a quarter
circle: both are as round as a pipe and as long. But at both ends of the arc the surface goes
on as the plane that touches it there, where beside a pipe there is nothing, or something that
the pipe stands on and meets at an angle.
"""

import numpy as np
from numpy.typing import NDArray

from pipecore.elements.refinement.fitted_element import FittedElement
from pipecore.elements.refinement.nearby_points import NearbyPoints
from pipecore.elements.refinement.surface_fits import LineSurface

Array = NDArray[np.float64]

NEAREST, FURTHEST = np.deg2rad(17.0), np.deg2rad(38.0)
"""The part of a touching plane that is looked at: angles about the axis from where it touches."""
MIN_DISTANCE_NOISE, MIN_PART_ANGLE = 3.0, np.deg2rad(8.0)
"""It begins where it is so many times the noise off the cylinder, and is no smaller than this."""
BESIDE = np.deg2rad(5.0), np.deg2rad(30.0)
"""The part of the arc that must be seen next to where a plane touches."""
MAX_OFF = 0.03
"""It touches if it passes the axis at the radius, give or take this share of it and the noise."""
MAX_TILT = 0.2
"""Largest cosine between its normal and the axis."""
MIN_SHARE = 0.2
"""Share of the points of a whole plane that must be there, on either side."""
MAX_TURN = np.deg2rad(10.0)
"""Most that the normals turn across the part looked at: those of a pipe close by turn more."""
MAX_ARC = np.deg2rad(225.0)
"""What is seen further round than this, twice what a corner turns by, is no corner."""


def is_rounded_corner(found: FittedElement, nearby: NearbyPoints) -> bool:
    """Whether planes touch a cylinder all along on both sides.

    Parameters
    ----------
    found : FittedElement
    nearby : NearbyPoints
    """
    model = found.fit.model
    if not isinstance(model, LineSurface) or found.extent.arc > MAX_ARC:
        return False
    return min(touching_planes(found, nearby)) > MIN_SHARE


def touching_planes(found: FittedElement, nearby: NearbyPoints) -> tuple[float, float]:
    """How much there is of planes in which a cylinder's arc goes on, before it and after it.

    1 is a plane without holes; before and after are in the sense of increasing clock. A plane
    that touches the cylinder elsewhere, such as the floor below a pipe, does not count. Where
    planes cannot be distinguished from the cylinder for the noise there are none.
    """
    axis, radius, noise = found.axis, found.fit.model.radius, nearby.surface.noise
    nearest = max(NEAREST, float(np.arccos(1.0 / (1.0 + MIN_DISTANCE_NOISE * noise / radius))))
    if FURTHEST - nearest < MIN_PART_ANGLE:
        return 0.0, 0.0
    downsampled = nearby.around_axis(axis, radius, 0.0)
    chainage, rho, clock = axis.pipe_coordinates(nearby.surface.xyz[downsampled])
    normals = nearby.surface.normals[downsampled]
    along = np.abs(np.einsum("ij,ij->i", normals, axis.tangent(chainage)))
    up, right = axis.frame(chainage)
    x, y = np.einsum("ij,ij->i", normals, up), np.einsum("ij,ij->i", normals, right)
    # Normals point either way: outward is where the point lies.
    angle = np.mod(clock - np.arctan2(y, x) + np.pi / 2, np.pi) - np.pi / 2
    tolerance = MAX_OFF * radius + 2.0 * noise
    touches = (np.abs(rho * np.cos(angle) - radius) < tolerance) & (along < MAX_TILT)
    _, _, inlier_clock = axis.pipe_coordinates(nearby.surface.xyz[found.inliers])
    density = axis.length / nearby.usual_spacing(found.inliers) ** 2
    width = radius * (np.tan(FURTHEST) - np.tan(nearest))
    shares = []
    for side in (-1.0, 1.0):
        is_there = touches & (side * angle > nearest) & (side * angle < FURTHEST)
        share = float(is_there.sum()) / (width * density)
        if abs(_turn(clock - angle, rho * np.sin(angle), is_there)) * width > MAX_TURN:
            share = 0.0  # a pipe close by has a tangent plane in common with this one
        # The arc that the plane goes on from lies on the other side of where it touches.
        touch = np.exp(1j * (clock - angle)[is_there]).sum()
        beside = side * np.angle(touch * np.exp(-1j * inlier_clock))
        n_beside = np.sum((beside > BESIDE[0]) & (beside < BESIDE[1]))
        is_seen = n_beside > 0.5 * (BESIDE[1] - BESIDE[0]) * radius * density
        shares.append(share if is_seen else 0.0)
    return shares[0], shares[1]


def _turn(facing: Array, place: Array, rows: NDArray[np.bool_]) -> float:
    """By how much the direction that a surface faces turns a metre; 0 of less than three points."""
    if rows.sum() < 3:
        return 0.0
    mean = np.exp(1j * facing[rows]).sum()
    angle = np.angle(np.exp(1j * facing[rows]) * mean.conjugate())
    return float(np.polyfit(place[rows], angle, 1)[0])
