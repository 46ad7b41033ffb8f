"""Refinement of spheres: a robust fit to the points around each, in rounds."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from pipecore._kernels.misfit import sphere_misfit
from pipecore.elements.refinement.extent import MAX_SECTORS, Extent
from pipecore.elements.refinement.fitted_element import FittedElement
from pipecore.elements.refinement.guess import MIN_SIGMA_M, band_of
from pipecore.elements.refinement.nearby_points import RADIAL_COS, NearbyPoints
from pipecore.elements.refinement.sampled_fits import fit_measured, fit_roughly
from pipecore.elements.refinement.surface_fits import SphereSurface, SurfaceFit
from pipecore.geometry import LineAxis

Indices = NDArray[np.intp]
Flags = NDArray[np.bool_]

N_ROUNDS = 3
"""Rounds of fitting, the last of which uses all points."""
FIRST_ROUND_SLACK, LAST_ROUND_SLACK = 3.0, 1.5
"""Factor on the limits of acceptance after the first round, and before the last."""
SPHERE_PATCHES = 12, 8, 5
"""Patches of a sphere around and up, and the points from which on one counts."""


def refine_sphere(
    model: SphereSurface,
    nearby: NearbyPoints,
    is_free: Flags,
    is_promising: Callable[[FittedElement, float], bool],
    used: list[Indices],
) -> FittedElement | None:
    """Fit a sphere to the cloud's points in a few rounds, the last of which uses all of them.

    Parameters
    ----------
    model : SphereSurface
    nearby : NearbyPoints
    is_free : ndarray of bool
        Downsampled points that no other element has taken.
    is_promising : callable
        Asked with a slack for the limits after the first round and before the last.
    used : list
        The points that were fitted to are appended.

    Returns
    -------
    FittedElement or None
        None where the sphere is not well determined.
    """
    sigma = max(nearby.surface.noise, 0.001, 0.01 * model.radius)
    fitted = None
    for round_ in range(N_ROUNDS):
        is_final = round_ == N_ROUNDS - 1
        if is_final and not (fitted and is_promising(fitted, LAST_ROUND_SLACK)):
            return None
        inliers = nearby.on_sphere(
            model, is_free, band=band_of(sigma), min_cos=RADIAL_COS, is_rough=not is_final
        )
        used.append(inliers)
        if is_final:
            fit = fit_measured(model, inliers, nearby, 3.0 * sigma, nearby.surface.voxel)
        else:
            fit = fit_roughly(model, inliers, nearby, 3.0 * sigma)
        if fit is None:
            return None
        model = fit.model
        sigma = max(fit.sigma, MIN_SIGMA_M)
        fitted = _fitted_sphere(fit, inliers, nearby)
        if round_ == 0 and not is_promising(fitted, FIRST_ROUND_SLACK):
            return None
    return fitted


def _fitted_sphere(
    fit: SurfaceFit[SphereSurface], inliers: Indices, nearby: NearbyPoints
) -> FittedElement:
    model, upright = fit.model, np.array([0.0, 0.0, 1.0])
    misfit, low, high, arc, per_point = sphere_misfit(
        nearby.surface.xyz, inliers, model.centre, model.radius, MAX_SECTORS, *SPHERE_PATCHES
    )
    if np.isfinite(misfit):
        # Medians of patches scatter by noise as well: π / 2 of the variance of a mean.
        misfit = float(np.sqrt(max(misfit**2 - 0.5 * np.pi * fit.sigma**2 * per_point, 0.0)))
    axis = LineAxis(model.centre + low * upright, upright, high - low)
    return FittedElement(fit, axis, inliers, Extent(0.0, axis.length, arc, 1.0, ()), misfit)
