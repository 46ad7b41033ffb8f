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

STEP_SAMPLE, STEP_RUN = 5_000, 250
"""About so many points show the steps of coordinates, so many of them consecutive."""
FEWEST_GAPS = 8
"""Fewer different values may be multiples of a step by chance."""
ZETA_3 = 1.2020569
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

        Along coordinate x the k-th harmonic of the sawtooth, sin 2πkx/q · q/πk, leaves a
        share J₁(2πkr/q) of itself in the mean over a circle; the sum over k of its mean
        square is 3 ζ(3)/π⁴ · q/r times q²/12. A length that crosses the steps averages it.

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
        crossed = length * np.abs(direction) / self.step
        left = 1 / np.maximum(2 * (np.pi * crossed) ** 2, 1.0)
        share = 3 * ZETA_3 / np.pi**4 * self.step / radius * np.sum(facing * left)
        return float(self.neighbours_sd(scatter) * np.sqrt(share))

    def radius_bias(self, radius: float) -> float:
        """Return by how much rounding enlarges a fitted radius, metres.

        What it moves points aside by, SD q/√12, only ever leads away from the axis.

        Parameters
        ----------
        radius : float
            Metres.

        Returns
        -------
        float
        """
        return self.step**2 / (24 * radius)


NO_ROUNDING = Rounding()


def measured_step(xyz: Array) -> float:
    """Return the step in which all three coordinates are kept; 0 where none shows.

    A regular grid has steps too, but not in all of its coordinates.

    Parameters
    ----------
    xyz : ndarray, shape (m, 3)
        Some points, float64.

    Returns
    -------
    float
        In the unit of the coordinates.
    """
    return min(_step_along(xyz[:, axis]) for axis in range(3))


def _step_along(values: Array) -> float:
    unique = np.unique(values)
    gaps = np.diff(unique)
    if len(gaps) < FEWEST_GAPS or len(unique) > 0.9 * len(values):
        return 0.0
    step = float(gaps.min())
    if step * 2.0**53 < gaps.max():
        return 0.0
    # Values that are multiples of a step, but for the rounding of float64 itself.
    rest = np.abs(gaps / step - np.round(gaps / step))
    slack = 4 * np.spacing(np.abs(unique).max()) / step + 1e-6
    return step if rest.max() <= 0.05 + slack else 0.0


def sampled_runs(xyz: Array) -> Array:
    """Return some runs of consecutive points, evenly spread.

    Parameters
    ----------
    xyz : ndarray, shape (n, 3)

    Returns
    -------
    ndarray, shape (m, 3)
        All of them where there are no more than `STEP_SAMPLE`.
    """
    n_runs = STEP_SAMPLE // STEP_RUN
    if len(xyz) <= STEP_SAMPLE:
        return xyz
    starts = np.linspace(0, len(xyz) - STEP_RUN, n_runs).astype(int)
    return np.asarray(xyz[(starts[:, None] + np.arange(STEP_RUN)).ravel()])
