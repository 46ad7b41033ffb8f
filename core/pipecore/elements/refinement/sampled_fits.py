"""Fits of a surface to a sample of the points on it, and to all of them, off bands around it."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipecore.elements.refinement.nearby_points import NearbyPoints
from pipecore.elements.refinement.raised_bands import is_off_bands
from pipecore.elements.refinement.surface_fits import (
    ArcSurface,
    LineSurface,
    SphereSurface,
    SurfaceFit,
    fit_surface,
)
from pipecore.robust import sample_evenly

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
AnySurface = LineSurface | ArcSurface | SphereSurface

MAX_FIT_POINTS, MAX_ROUGH_POINTS = 60_000, 1_500
"""Larger elements are fitted to an even sample of this many points; fewer in early rounds."""
MIN_FIT_POINTS = 15
"""No fit takes fewer points."""
SAMPLE_POINTS = 4_000
"""Points of a sample. The standard deviations of a rough fit are those of up to so many."""
MAX_DIRECT_FIT_POINTS = 6_000
"""More points are fitted to only if a fit to a sample of them holds."""
RESTART_SCALE_SDS = 1.5
"""Scale of a fit that starts from that of a sample, in standard deviations of the latter."""
MAX_RADIUS_CHANGE = 0.25
"""A fit whose radius differs from the proposed one by more, in shares of it, is discarded."""
MIN_BAND_COS = float(np.cos(np.deg2rad(15.0)))
"""Beside bands the normals of the pipe's points are this close to the surface's."""


def fit_roughly(
    model: AnySurface,
    downsampled: Indices,
    nearby: NearbyPoints,
    scale: float,
    remove_section: Callable[[Array], Array] | None = None,
) -> SurfaceFit[Any] | None:
    """Fit the model to a sample of downsampled points; None where it is not well determined."""
    if len(downsampled) < MIN_FIT_POINTS:
        return None
    points = nearby.surface.xyz[sample_evenly(downsampled, MAX_ROUGH_POINTS)]
    if remove_section is not None:
        points = remove_section(points)
    return _fit_sample(model, points, scale, min(len(downsampled), SAMPLE_POINTS))


def fit_measured(
    model: AnySurface,
    downsampled: Indices,
    nearby: NearbyPoints,
    scale: float,
    spacing: float,
    holds: Callable[[SurfaceFit[Any]], bool] = lambda fit: True,
    remove_section: Callable[[Array], Array] | None = None,
) -> SurfaceFit[Any] | None:
    """Fit a model as elements are measured: to all points, free of bands around the pipe.

    Parameters
    ----------
    model : LineSurface, ArcSurface or SphereSurface
        Where to start.
    downsampled : ndarray of int
        Downsampled points on the surface.
    nearby : NearbyPoints
    scale : float
        Distance from the surface up to which points count in full, metres.
    spacing : float
        Distance between neighbouring downsampled points, metres.
    holds : callable
        Asked of the fit to a sample of many points, from which that to all begins.
    remove_section : callable, optional
        Moves points, shape (n, 3), so that a round surface fits them; see `section_remover`.

    Returns
    -------
    SurfaceFit or None
        None where the surface is not well determined, or where it is quite another one.
    """
    if len(downsampled) < MIN_FIT_POINTS:
        return None
    _, points = nearby.full_resolution(downsampled)
    points = sample_evenly(points, MAX_FIT_POINTS)
    if remove_section is not None:
        points = remove_section(points)
    start = model
    if len(points) > MAX_DIRECT_FIT_POINTS:
        sampled = _fit_sample(model, sample_evenly(points, SAMPLE_POINTS), scale, len(points))
        if sampled is None or not (
            holds(sampled) or points_off_bands(sampled, downsampled, nearby, spacing) is not None
        ):
            return None
        start, scale = sampled.model, RESTART_SCALE_SDS * sampled.sigma
    fit = fit_surface(start, points, scale)
    if fit is None or not _is_same_surface(fit, model):
        return None
    inliers = (
        points_off_bands(fit, downsampled, nearby, spacing) if remove_section is None else None
    )
    if inliers is None:
        return fit
    if len(inliers) >= MIN_FIT_POINTS:
        _, points = nearby.full_resolution(inliers)
        fit = fit_surface(fit.model, sample_evenly(points, MAX_FIT_POINTS), 3.0 * fit.sigma)
        if fit is not None and _is_same_surface(fit, model):
            return fit
    return None


def points_off_bands(
    fit: SurfaceFit[Any], downsampled: Indices, nearby: NearbyPoints, spacing: float
) -> Indices | None:
    """Select the points that are not on bands around a pipe; None where there are no bands."""
    model = fit.model
    if not isinstance(model, LineSurface):
        return None
    xyz = nearby.surface.xyz[downsampled]
    chainage = (xyz - model.middle) @ model.direction
    residual, _, outward = model.residuals(xyz)
    is_inlier = is_off_bands(chainage, residual, spacing, model.radius)
    if is_inlier is None:
        return None
    # Where a band or a rib meets the pipe, the normals turn away before the points do.
    cosine = np.abs(np.einsum("ij,ij->i", nearby.surface.normals[downsampled], outward))
    return np.asarray(downsampled[is_inlier & (cosine > MIN_BAND_COS)], np.intp)


def _fit_sample(
    model: AnySurface, points: Array, scale: float, n_all: int
) -> SurfaceFit[Any] | None:
    """Fit the model to a sample; its covariance is that of a fit to `n_all` points."""
    fit = fit_surface(model, points, scale, is_rough=True)
    if fit is None or not _is_same_surface(fit, model):
        return None
    return replace(fit, covariance=fit.covariance * min(len(points) / n_all, 1.0))


def _is_same_surface(fit: SurfaceFit[Any], model: AnySurface) -> bool:
    """Whether a fitted radius is near enough to the proposed one."""
    return bool(abs(fit.model.radius - model.radius) <= MAX_RADIUS_CHANGE * model.radius)
