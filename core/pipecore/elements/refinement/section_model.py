"""The section model: what a pipe's surface may do besides being round and straight.

A pipe may be oval and three-lobed, changing slowly along it, and bowed or sagging. As heights
above the fitted surface these are harmonics of the clock (first: the axis; second: ovality; third:
lobes) times Legendre polynomials of the chainage. What is left after that is the scatter of
the surface, by which pipes and clutter differ: the scatter about a circle would count
ovality as roughness and reject the most deformed pipes first.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pipecore._kernels import section_models as kernels

Array = NDArray[np.float64]

OVAL_ARC, LOBED_ARC = np.deg2rad(150.0), np.deg2rad(220.0)
"""Arcs from which on an oval and a three-lobed section differ from a round one off centre."""
PRIOR = 0.04
"""Scatter of the harmonics' amplitudes over pipes, in radii."""
MAX_HEIGHT = 0.09
"""Largest height of a section above its circle, in radii: 18 % of ovality."""
MIN_LENGTH = 0.2
"""Shortest stretch that shows a section, in radii."""
LINEAR, CUBIC = 1.0, 8.0
"""Shorter stretches, in radii, change neither along nor bow; longer ones may bow both ways."""
N_SECTORS, ROW, MAX_ROWS = 36, 0.4, 24
"""Cells around; their length in radii, and how many of them at most."""
FIRST_REACH = 0.15
"""Cells this share of the radius off the first section do not count."""
MIN_POINTS, N_ITERATIONS = 60, 8


@dataclass(frozen=True, eq=False)
class SectionModel:
    """Heights of a section above a surface about an axis.

    Parameters
    ----------
    low, high : float
        Chainages between which it was fitted, metres.
    n_powers : ndarray of int
        How many polynomials of the chainage go with each harmonic of the clock.
    coefficients : ndarray
        Metres, in the order of `pipecore._kernels.section_models`.
    """

    low: float
    high: float
    n_powers: NDArray[np.int64]
    coefficients: Array

    def height(self, chainage: Array, clock: Array) -> Array:
        """Height at places (n,), metres."""
        result = np.empty(len(chainage))
        kernels.heights(
            chainage, clock, self.low, self.high, self.n_powers, self.coefficients, result
        )
        return result

    @property
    def max_height(self) -> float:
        """Largest height above or below the surface, metres."""
        along, around = np.linspace(self.low, self.high, 7), np.linspace(0.0, 2 * np.pi, 25)
        places = np.meshgrid(along, around)
        return float(np.abs(self.height(places[0].ravel(), places[1].ravel())).max())

    def without_pose(self) -> "SectionModel":
        """Without what moving, tilting, widening and tapering the surface does as well."""
        kept = self.coefficients.copy()
        n_mean = int(self.n_powers[0])
        kept[: n_mean + 2 * min(2, int(self.n_powers[1]))] = 0.0
        return replace(self, coefficients=kept)

    def from_chainage(self, zero: float) -> "SectionModel":
        """With chainages counted from `zero`."""
        return replace(self, low=self.low - zero, high=self.high - zero)


def fit_section_model(
    chainage: Array, clock: Array, residual: Array, radius: float, arc: float
) -> SectionModel | None:
    """Fit a section model to the points near a surface, robustly.

    Parameters
    ----------
    chainage, clock, residual : ndarray, shape (n,)
        Pipe coordinates (metres, radians) of the points, and their signed distances from the
        surface, metres.
    radius : float
        Of the surface, metres.
    arc : float
        That is seen of it, radians: what a short arc does not determine is not fitted.

    Returns
    -------
    SectionModel or None
        None where the points determine none.
    """
    if len(chainage) < MIN_POINTS:
        return None
    low, high = float(chainage.min()), float(chainage.max())
    length = (high - low) / radius
    if not length > MIN_LENGTH:
        return None
    along = 1 if length < LINEAR else 3 if length < CUBIC else 4
    n_powers = [min(along, 2), along]
    if arc > OVAL_ARC:
        n_powers.append(along)
    if arc > LOBED_ARC:
        n_powers.append(min(along, 2))
    powers = np.array(n_powers, np.int64)
    n_rows = int(np.clip(length / ROW, 1, MAX_ROWS))
    cells = kernels.mean_cells(chainage, clock, residual, low, high, n_rows, N_SECTORS)
    coefficients = np.empty(int(powers[0] + 2 * powers[1:].sum()))
    carried = kernels.fit_terms(
        cells, low, high, powers, PRIOR * radius, FIRST_REACH * radius, N_ITERATIONS, coefficients
    )
    return SectionModel(low, high, powers, coefficients) if carried else None
