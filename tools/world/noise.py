"""What goes wrong between a surface and the points of a cloud."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tools.world.surfaces import Array
from tools.world.viewing import Seen

MIXED_GAP = 0.1
"""From this step in range on, metres, a beam's edge may hit both sides."""


@dataclass(frozen=True)
class Noise:
    """The faults of a cloud; lengths in metres.

    Parameters
    ----------
    beam, isotropic, correlated : float
        Standard deviations: along the beam, in all directions, and of a displacement that
        neighbours share.
    reach : float
        Correlation length of the latter.
    offset : float
        Length of each station's shift against the others.
    rounding : float
        Coordinates are whole multiples of this, 0 for none.
    duplicates : int
        How often each point occurs.
    mixed, stray : float
        Shares of points between an edge and what is behind it, and anywhere.
    """

    beam: float = 0.0
    isotropic: float = 0.0
    correlated: float = 0.0
    reach: float = 0.03
    offset: float = 0.0
    rounding: float = 0.0
    duplicates: int = 1
    mixed: float = 0.0
    stray: float = 0.0

    @property
    def sd(self) -> float:
        """Standard deviation of a point across its surface, roughly."""
        rounded = self.rounding / np.sqrt(12)
        return float(
            np.hypot(np.hypot(self.beam, self.isotropic), np.hypot(self.correlated, rounded))
        )


def disturb(seen: Seen, noise: Noise, rng: np.random.Generator) -> tuple[Array, NDArray[np.intp]]:
    """Return the points as a scanner gives them, with the row of `seen` of each, -1 for none."""
    points = seen.samples.points.copy()
    n = len(points)
    row = np.arange(n)
    if noise.beam:
        points += rng.normal(scale=noise.beam, size=n)[:, None] * seen.beams
    if noise.isotropic:
        points += rng.normal(scale=noise.isotropic, size=(n, 3))
    if noise.correlated:
        points += correlated_field(points, noise.correlated, noise.reach, rng)
    if noise.offset and len(seen.positions) > 1:
        shifts = rng.normal(size=(len(seen.positions), 3))
        shifts *= noise.offset / np.linalg.norm(shifts, axis=1, keepdims=True)
        points += shifts[seen.station]
    if noise.mixed and len(seen.positions):
        extra = mixed_points(seen, points, noise.mixed, rng)
        points, row = np.concatenate([points, extra]), np.r_[row, np.full(len(extra), -1)]
    if noise.stray:
        low, high = points.min(axis=0), points.max(axis=0)
        extra = rng.uniform(low - 0.2, high + 0.2, (int(noise.stray * n), 3))
        points, row = np.concatenate([points, extra]), np.r_[row, np.full(len(extra), -1)]
    if noise.duplicates > 1:
        points, row = (np.repeat(a, noise.duplicates, axis=0) for a in (points, row))
    if noise.rounding:
        points = np.round(points / noise.rounding) * noise.rounding
    return points, row


def correlated_field(points: Array, sd: float, reach: float, rng: np.random.Generator) -> Array:
    """Return displacements (n, 3) with correlation exp(-d²/2 reach²), by random waves."""
    n_waves = 48
    k = rng.normal(scale=1 / reach, size=(3, n_waves))
    phase = rng.uniform(0, 2 * np.pi, n_waves)
    weight = rng.normal(size=(n_waves, 3)) * sd * np.sqrt(2 / n_waves)
    return np.cos(points @ k + phase) @ weight


def mixed_points(seen: Seen, points: Array, share: float, rng: np.random.Generator) -> Array:
    """Return points between neighbours in direction that differ in range."""
    extra = []
    for k, position in enumerate(seen.positions):
        mine = points[seen.station == k]
        offset = mine - position
        distance = np.linalg.norm(offset, axis=1)
        azimuth = np.arctan2(offset[:, 1], offset[:, 0])
        row = np.floor(np.arcsin(offset[:, 2] / distance) / 0.003).astype(np.int64)
        order = np.lexsort((azimuth, row))
        a, b = order[:-1], order[1:]
        is_edge = (
            (row[a] == row[b])
            & (np.abs(azimuth[a] - azimuth[b]) < 0.006)
            & (np.abs(distance[a] - distance[b]) > MIXED_GAP)
        )
        pairs = np.flatnonzero(is_edge)
        pairs = rng.choice(pairs, min(len(pairs), int(share * len(mine))), replace=False)
        a, b = a[pairs], b[pairs]
        between = distance[a] + rng.uniform(size=len(a)) * (distance[b] - distance[a])
        extra.append(position + offset[a] / distance[a][:, None] * between[:, None])
    return np.concatenate(extra)
