"""A surface fitted to the cloud, with its axis, its extent and how well its section is round."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipecore.elements.refinement.extent import MAX_SECTORS, Extent
from pipecore.elements.refinement.section_model import SectionModel
from pipecore.elements.refinement.surface_fits import (
    ArcSurface,
    LineSurface,
    SphereSurface,
    SurfaceFit,
)
from pipecore.ellipses import radius_sd_factor
from pipecore.geometry import AnyAxis

Indices = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class FittedElement:
    """A proposed surface fitted to the cloud.

    Parameters
    ----------
    fit : SurfaceFit
    axis : LineAxis or ArcAxis
        As scanned, from where the points start to where they end.
    inliers : ndarray of int
        Downsampled points on the surface.
    extent : Extent
        Along `axis`.
    misfit : float
        See `section_misfit`; metres.
    """

    fit: SurfaceFit[LineSurface] | SurfaceFit[ArcSurface] | SurfaceFit[SphereSurface]
    axis: AnyAxis
    inliers: Indices
    extent: Extent
    misfit: float
    section: SectionModel | None = None
    """How its section leaves the round one; None where it hardly does."""

    @property
    def _n_sectors(self) -> float:
        return max(self.extent.arc / (2 * np.pi) * MAX_SECTORS, 1.0)

    @property
    def excess_misfit(self) -> float:
        """How far the section leaves circle and oval beyond what noise does, metres."""
        by_noise = 0.5 * np.pi * self.fit.sigma**2 * self._n_sectors / max(len(self.inliers), 1)
        return float(np.sqrt(max(self.misfit**2 - by_noise, 0.0)))

    @property
    def radius_sd(self) -> float:
        """Standard deviation of the radius: the fit's, and what is off the round section.

        Sectors that leave circle and oval by more than noise does are as many wrong
        measurements of the radius as there are sectors; metres.
        """
        off_round = self.excess_misfit / np.sqrt(self._n_sectors)
        factor = float(radius_sd_factor(self.extent.arc))
        return float(np.hypot(self.fit.radius_sd, factor * off_round))

    @property
    def radii(self) -> tuple[float, float]:
        """Radius at the start and at the end of the axis, metres."""
        model = self.fit.model
        if not isinstance(model, LineSurface):
            return model.radius, model.radius
        return model.radius_at(self.axis.start), model.radius_at(self.axis.end)
