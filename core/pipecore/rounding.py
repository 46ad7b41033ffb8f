"""Errors of coordinates that a file keeps in coarse steps.

Neighbours on a flat part of a surface are rounded alike, so that no average removes their
error, however many they are. Along each coordinate it is a sawtooth of the coordinate; what
the noise before rounding leaves of its mean is its first harmonic (Widrow & Kollár 2008,
Quantization Noise, section 4): for noise σ and steps q, SD q/√12 · exp(-2π² σ²/q²).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

LEAST_TURN = 1e-9
"""A direction that follows a plane of the steps better than this follows it as far as it goes."""


@dataclass(frozen=True)
class Rounding:
    """What rounding does to averages over points.

    Parameters
    ----------
    step : float
        Steps of all three coordinates, metres; 0 where they are fine.
    """

    step: float = 0.0

    def neighbours_sd(self, scatter: Array | float) -> Array:
        """Return the SD of the error that neighbours on a flat surface share, metres.

        Parameters
        ----------
        scatter : array_like
            SD of points about their surface, with what rounding adds to it, metres.

        Returns
        -------
        ndarray
            Shape as of `scatter`.
        """
        scatter = np.asarray(scatter, np.float64)
        if self.step == 0:
            return np.zeros(scatter.shape)
        variance = self.step**2 / 12
        noise = np.maximum(scatter**2 - variance, 0.0)
        return np.asarray(np.sqrt(variance) * np.exp(-2 * np.pi**2 * noise / self.step**2))

    def point_sd(
        self, scatter: Array, frame: tuple[Array, Array, Array], density: Array, radius: float
    ) -> Array:
        """Return the SD of independent points whose averages are as uncertain as those of these.

        Of n points that are rounded alike the mean has the error of one; n independent ones
        of √n times their SD have the same.

        Parameters
        ----------
        scatter : ndarray, shape (k,)
            SD of the points about the surface at k places, metres.
        frame : tuple of ndarray, shape (k, 3)
            Unit vectors there: normal to the surface, along the axis and around it.
        density : ndarray, shape (k,)
            Points per square metre.
        radius : float
            Of the surface, metres.

        Returns
        -------
        ndarray, shape (k,)
            Metres.
        """
        if self.step == 0:
            return scatter
        normal, along, around = (np.abs(v) for v in frame)
        # A surface whose tangent follows the steps leaves them by its curvature.
        widest = 2 * np.sqrt(radius * self.step)
        shared = np.minimum(self.step / np.maximum(around, LEAST_TURN), widest)
        shared *= self.step / np.maximum(along, LEAST_TURN)
        n_alike = np.maximum(density[:, None] * shared, 1.0)
        variance = self.neighbours_sd(scatter) ** 2 * np.sum(normal**2 * n_alike, axis=1)
        return np.asarray(np.sqrt(scatter**2 + variance))

    def radius_sd(self, radius: float, direction: Array, length: float, scatter: float) -> float:
        """Return the SD that rounding gives the mean radius of a whole round, metres.

        What the sides that face along a coordinate have in common does not cancel: each is
        as wide as the surface stays within a step, √(2q/r) to either side.

        Parameters
        ----------
        radius : float
            Metres.
        direction : ndarray, shape (3,)
            Unit vector along the axis.
        length : float
            Metres.
        scatter : float
            SD of the points about the surface, metres.

        Returns
        -------
        float
        """
        if self.step == 0:
            return 0.0
        facing = np.sqrt(np.maximum(1 - direction**2, 0.0))
        n_along = np.maximum(length * np.abs(direction) / self.step, 1.0)
        share = 4 * facing * self.step / (np.pi**2 * radius)
        variance = self.neighbours_sd(scatter) ** 2 * np.sum(share / n_along)
        return float(np.sqrt(variance))


NO_ROUNDING = Rounding()
