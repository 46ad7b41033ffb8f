"""Completing a fitting whose shape the straights beside it constrain: a bend or a reducer."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipecore.elements.refinement.extent import Extent, find_extent, section_misfit
from pipecore.elements.refinement.fitted_element import FittedElement
from pipecore.elements.refinement.guess import axis_through
from pipecore.elements.refinement.nearby_points import NearbyPoints
from pipecore.elements.refinement.surface_fits import (
    ArcSurface,
    LineSurface,
    SurfaceFit,
    fit_surface,
)
from pipecore.geometry import ArcAxis, LineAxis

Array = NDArray[np.float64]


class FittingInliers(NamedTuple):
    """The downsampled points on a fitting.

    Parameters
    ----------
    points : ndarray of int, shape (n,)
        Their indices.
    chainage, clock : ndarray, shape (n,)
        Along and around the fitting's axis, metres and radians.
    residual : ndarray, shape (n,)
        Signed distance from its surface, metres.
    normal_angle : ndarray, shape (n,)
        From the surface's normal to the point's, towards increasing clock, radians.
    """

    points: NDArray[np.intp]
    chainage: Array
    clock: Array
    residual: Array
    normal_angle: Array


def complete_fitting(
    constrained: SurfaceFit[ArcSurface] | SurfaceFit[LineSurface],
    axis: ArcAxis | LineAxis,
    inliers: FittingInliers,
    nearby: NearbyPoints,
    is_well_determined: Callable[[SurfaceFit[Any]], bool],
) -> FittedElement | None:
    """Find how much of a fitting is seen, and release the constraint where its points suffice.

    Parameters
    ----------
    constrained : SurfaceFit
        The fit with what the straights determine held fixed.
    axis : ArcAxis or LineAxis
        From one straight to the other; the fitting keeps this length.
    inliers : FittingInliers
    nearby : NearbyPoints
    is_well_determined : callable
        Whether a free fit to the fitting's points needs no straights.

    Returns
    -------
    FittedElement or None
        None where the points do not cover the axis.
    """
    model, sigma = constrained.model, constrained.sigma
    found = find_extent(
        inliers.chainage, inliers.clock, inliers.residual, inliers.normal_angle,
        lambda *_: np.empty((2, 0)), axis.length, model.radius,
        nearby.usual_spacing(inliers.points), sigma,
    )  # fmt: skip
    if found is None:
        return None
    covered = min(found.coverage * (found.high - found.low) / axis.length, 1.0)
    extent = Extent(0.0, axis.length, found.arc, covered, found.gaps)
    misfit = section_misfit(inliers.clock, inliers.residual, extent.arc, nearby.rounding)
    free: SurfaceFit[Any] | None = fit_surface(
        model, nearby.full_resolution(inliers.points)[1], 3.0 * sigma
    )
    if free is not None and is_well_determined(free):
        own_axis = axis_through(free.model, np.stack([axis.start, axis.end]))
        return FittedElement(free, own_axis, inliers.points, extent, misfit)
    return FittedElement(constrained, axis, inliers.points, extent, misfit)
