"""Fits of surfaces whose section is not round: a section model is fitted, then subtracted."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipecore.elements.refinement.guess import Guess, band_of
from pipecore.elements.refinement.nearby_points import MIN_DEPTH_RADII, RADIAL_COS, NearbyPoints
from pipecore.elements.refinement.sampled_fits import fit_roughly
from pipecore.elements.refinement.section_model import (
    MAX_HEIGHT,
    SectionModel,
    fit_section_model,
)
from pipecore.elements.refinement.surface_fits import SurfaceFit
from pipecore.geometry import AnyAxis
from pipecore.robust import robust_sd

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
Flags = NDArray[np.bool_]

OVAL_BAND_RADII = 0.13
"""A section model is fitted to points up to this distance from the round surface."""
MAX_SCATTER_RATIO = 0.75
"""A section model is used where it leaves at most this share of the points' scatter."""


def fit_oval(
    guess: Guess, arc: float, nearby: NearbyPoints, is_free: Flags, used: list[Indices]
) -> tuple[Guess, SurfaceFit[Any]] | None:
    """Fit a section model to the points, and the surface without the section's heights.

    None where the points scatter about it hardly less than about the round surface.
    """
    model = guess.model
    near = nearby.on_surface(
        model, guess.axis, 0.0, is_free, band=OVAL_BAND_RADII * model.radius,
        depth=MIN_DEPTH_RADII * model.radius, min_cos=RADIAL_COS, is_rough=True,
    )  # fmt: skip
    used.append(near.inliers)
    found = fit_section_model(near.chainage, near.clock, near.residual, model.radius, arc)
    if found is None:
        return None
    left = near.residual - found.height(near.chainage, near.clock)
    before, after = robust_sd(near.residual - np.median(near.residual)), robust_sd(left)
    section = found.without_pose()
    if after > MAX_SCATTER_RATIO * before or section.max_height > MAX_HEIGHT * model.radius:
        return None
    on = near.inliers[np.abs(left) <= band_of(after)]
    fit = fit_roughly(model, on, nearby, 3.0 * after, section_remover(guess.axis, section))
    if fit is None:
        return None
    return replace(guess.after(fit, 0.0, guess.axis.length), section=section), fit


def section_remover(axis: AnyAxis, section: SectionModel | None) -> Callable[[Array], Array] | None:
    """Return a function that subtracts a section's heights from points; None without a section."""
    if section is None:
        return None

    def remove_section(xyz: Array) -> Array:
        chainage, _, clock = axis.pipe_coordinates(xyz)
        up, right = axis.frame(chainage)
        outward = np.cos(clock)[:, None] * up + np.sin(clock)[:, None] * right
        return np.asarray(xyz - section.height(chainage, clock)[:, None] * outward)

    return remove_section
