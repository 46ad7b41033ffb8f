"""Where the map leaves the contour by more than its noise: a matched filter of bump sizes.

A smooth bump of extents L × W is fitted at every cell. With weights w (inverse
variances of the cell means) and a bump shape k, its height there and its variance are

    h = Σ k w d / Σ k² w,    var h = 1 / Σ k² w + var(contour),

which uses holes and uneven density for what they are.
"""

from dataclasses import dataclass

import numpy as np

from pipecore._kernels import map_filters as kernels
from pipecore.deformation.deviation_map import Flags, Grid
from pipecore.geometry import Array

EXTENTS = (0.18, 0.25, 0.35, 0.5, 0.7, 1.0)
"""Extents of the bumps searched for, fractions of the outside diameter."""

MIN_POINTS = 5
"""Fewer points than this under a bump are no evidence, however far off they lie."""


@dataclass(frozen=True)
class BumpCandidate:
    """A place where a bump of a certain size stands out.

    `length` and `width` are the extents of the filter that saw it best.
    """

    chainage: float
    clock: float
    length: float
    width: float
    height: float
    z: float
    inflation: float


@dataclass(frozen=True, eq=False)
class MatchedFilter:
    """Matched filters of several extents for one deviation map, independent of the contour.

    Parameters
    ----------
    grid : Grid
    weight : ndarray, shape (rows, columns)
        Inverse variances of the cell means, 0 where empty.
    allowed : ndarray of bool, shape (rows, columns)
        Cells where a peak may lie.
    filters : tuple of SizeFilter
    """

    grid: Grid
    weight: Array
    allowed: Flags
    filters: tuple["SizeFilter", ...]

    @classmethod
    def of(cls, grid: Grid, weight: Array, count: Array, allowed: Flags) -> "MatchedFilter":
        """Return the filters for a map with the given weights and point counts."""
        sizes = np.array(EXTENTS) * 2 * grid.radius
        wide = sizes[sizes >= 2.5 * max(grid.row_size, grid.column_size)]
        return cls(
            grid, weight, allowed, tuple(SizeFilter.of(grid, weight, count, size) for size in wide)
        )

    def find(self, deviation: Array, contour_sd: Array, threshold: float) -> list[BumpCandidate]:
        """Find bumps and dents above `threshold` times their noise, strongest first.

        Parameters
        ----------
        deviation, contour_sd : ndarray, shape (rows, columns)
            Cell means above the contour, nan where empty, and the contour's standard deviation.
        threshold : float
        """
        grid = self.grid
        weighted = self.weight * np.nan_to_num(deviation)
        heights, scores, inflations = [], [], []
        for size_filter in self.filters:
            height, z = np.empty(grid.shape), np.empty(grid.shape)
            kernels.correlate(weighted, size_filter.along, size_filter.around, height)
            spread = kernels.score(
                height,
                size_filter.precision,
                size_filter.is_measurable,
                contour_sd,
                self.allowed,
                z,
            )
            # Correlated noise widens the distribution of z.
            inflations.append(max(1.0, spread))
            heights.append(height)
            scores.append(z)

        found: list[BumpCandidate] = []
        free = self.allowed.copy()
        peaks = [kernels.strongest(z, free) for z in scores]
        while peaks:
            for k, (_, place) in enumerate(peaks):
                if not free.ravel()[place]:
                    peaks[k] = kernels.strongest(scores[k], free)
            best = max(range(len(peaks)), key=lambda k: peaks[k][0] / inflations[k])
            row, column = divmod(peaks[best][1], grid.n_columns)
            score = float(scores[best][row, column] / inflations[best])
            if not free[row, column] or abs(score) < threshold:
                break
            size = self.filters[best].size
            found.append(
                BumpCandidate(
                    float(grid.chainages[row]),
                    float(grid.clocks[column]),
                    size,
                    size,
                    float(heights[best][row, column]),
                    score,
                    inflations[best],
                )
            )
            free &= ~disc(grid, found[-1].chainage, found[-1].clock, 1.2 * size, 1.2 * size)
        return found


@dataclass(frozen=True, eq=False)
class SizeFilter:
    """Matched filter for bumps of one extent at every cell.

    Parameters
    ----------
    size : float
        Their extent, metres.
    along, around : ndarray
        The bump along the pipe and around it, by cells.
    precision : ndarray, shape (rows, columns)
        Inverse variance of a height there.
    is_measurable : ndarray of bool, shape (rows, columns)
        Whether at least `MIN_POINTS` points lie under a bump there.
    """

    size: float
    along: Array
    around: Array
    precision: Array
    is_measurable: Flags

    @classmethod
    def of(cls, grid: Grid, weight: Array, count: Array, size: float) -> "SizeFilter":
        """Return the filter for bumps `size` metres wide."""
        along, around = _bell(size, grid.row_size), _bell(size, grid.column_size)
        precision, points = np.empty(grid.shape), np.empty(grid.shape)
        kernels.correlate(weight, along**2, around**2, precision)
        kernels.correlate(count, 1.0 * (along > 0.1), 1.0 * (around > 0.1), points)
        precision = np.maximum(precision, 1e-12)
        return cls(float(size), along, around, precision, points >= MIN_POINTS)


def disc(grid: Grid, chainage: float, clock: float, length: float, width: float) -> Flags:
    """Return the cells within an ellipse on the surface.

    Parameters
    ----------
    grid : Grid
    chainage, clock : float
        Its centre, metres and radians.
    length, width : float
        Its full axes along the pipe and around it, metres.

    Returns
    -------
    ndarray of bool, shape (rows, columns)
    """
    cells = np.zeros(grid.shape, dtype=bool)
    rows = grid.rows_near(chainage, length / 2)
    along = (grid.chainages[rows] - chainage) / (length / 2)
    turn = np.mod(grid.clocks - clock + np.pi, 2 * np.pi) - np.pi
    around = turn * grid.radius / (width / 2)
    cells[rows] = along[:, None] ** 2 + around[None, :] ** 2 < 1.0
    return cells


def _bell(size: float, cell: float) -> Array:
    half = int(np.floor(size / 2 / cell))
    return np.asarray(np.cos(np.pi * np.arange(-half, half + 1) * cell / size) ** 2)
