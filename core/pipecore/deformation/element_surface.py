"""Separation of the points on an element's surface from everything else around it."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pipecore.deformation.contour import fit_contour
from pipecore.deformation.deviation_map import (
    Flags,
    Grid,
    box_sum,
    group_median,
    local_noise,
    point_spacing,
)
from pipecore.deformation.unrolled_points import UnrolledPoints
from pipecore.geometry import Array
from pipecore.types import Element

MIN_POINTS = 30
"""Fewer points near the contour do not define an element's surface."""

INWARD_REACH, OUTWARD_REACH = 0.95, 0.25
"""Distance from the contour up to which deformations are searched, fractions of the radius: damage
is bounded by nothing but the axis."""

MIN_ALIGNMENT = np.cos(np.deg2rad(50.0))
"""The flank of the steepest dent (35°) with a noisy normal (5°, three times)."""

MIN_INWARD_ALIGNMENT, CLEARLY_INWARD = np.cos(np.deg2rad(75.0)), 0.05
"""Inside the contour by more than this share of the radius there is nothing but damage, and deep
damage has steep flanks."""

STEEPEST_FLANK, STEEPEST_INWARD_FLANK = np.tan(np.deg2rad([35.0, 65.0]))


@dataclass(frozen=True, eq=False)
class ElementSurface:
    """The surface of an element as found among the points around it.

    Parameters
    ----------
    grid : Grid
    points : UnrolledPoints
        All the points of the neighbourhood, n of them.
    belongs : ndarray of bool, shape (n,)
        Points on the element's surface.
    cell : ndarray of int, shape (n,)
        Flat index of each point's cell.
    noise : ndarray, shape (rows, columns)
        Standard deviation of one point, metres.
    overlain : ndarray of bool, shape (rows, columns)
        Cells where points of another object lie close above the surface.
    """

    grid: Grid
    points: UnrolledPoints
    belongs: Flags
    cell: np.ndarray
    noise: Array
    overlain: Flags

    @cached_property
    def _row(self) -> NDArray[np.int32]:
        """The row of each point, -1 if it does not belong."""
        row = np.where(self.belongs, self.cell // self.grid.n_columns, -1)
        return row.astype(np.int32)

    def points_near(self, chainage: float, reach: float) -> NDArray[np.intp]:
        """Indices of the surface's points in the rows within `reach` metres of a chainage."""
        rows = self.grid.rows_near(chainage, reach + self.grid.row_size)
        return np.flatnonzero((self._row >= rows.start) & (self._row < rows.stop))


def find_element_surface(element: Element, points: UnrolledPoints) -> ElementSurface | None:
    """Find the points on an element's surface by region growing.

    It starts from cells at the robustly fitted contour and grows into neighbouring
    cells as long as the surface continues without a step: into dents and over
    bulges, but not onto objects nearby.

    Parameters
    ----------
    element : Element
    points : UnrolledPoints
        All points of its neighbourhood.

    Returns
    -------
    ElementSurface or None
        None where fewer than `MIN_POINTS` points lie near the contour.
    """
    radius = (element.radius + element.radius_end) / 2
    length = element.axis.length
    near = (points.chainage > -0.05 * radius) & (points.chainage < length + 0.05 * radius)
    near &= np.abs(points.height) < INWARD_REACH * radius
    inward = points.height < -CLEARLY_INWARD * radius
    least = np.where(inward, MIN_INWARD_ALIGNMENT, MIN_ALIGNMENT)
    facing = near & ~(points.alignment < least)
    band = max(4 * min(element.rms, 0.03 * radius), 0.02 * radius)
    core = facing & (np.abs(points.height) < band)
    if np.count_nonzero(core) < MIN_POINTS:
        return None
    grid = Grid.for_element(
        element, point_spacing(element, points.chainage[core], points.clock[core])
    )
    cell = grid.cell_of(points.chainage, points.clock)

    sigma = local_noise(grid, cell[core], points.height[core])
    contour = _first_contour(grid, points, cell, facing, sigma)
    level = points.height - contour.ravel()[cell]
    noise = sigma.ravel()[cell]
    facing &= (level > -INWARD_REACH * radius) & (level < OUTWARD_REACH * radius)

    value = _grow(grid, level, noise, cell, facing)
    slope = _steepness(value)
    reached = np.isfinite(value).ravel()[cell]
    local = np.where(reached, value.ravel()[cell], 0.0)
    tolerance = 4 * noise + slope.ravel()[cell]
    belongs = facing & reached & (np.abs(level - local) < tolerance)
    # Isolated outliers occupy a cell alone.
    n_around = box_sum(grid.count(cell[belongs]), 2)
    belongs &= n_around.ravel()[cell] >= 3

    above = (
        near
        & (level < OUTWARD_REACH * radius)
        & ~belongs
        & (level > 4 * noise)
        & (level > local + tolerance)
    )
    overlain = grid.count(cell[above]) >= 2
    sigma = local_noise(grid, cell[belongs], points.height[belongs])
    return ElementSurface(grid, points, belongs, cell, sigma, overlain)


def _first_contour(
    grid: Grid, points: UnrolledPoints, cell: np.ndarray, facing: Flags, sigma: Array
) -> Array:
    """Height per cell of a contour fitted to the medians of cells, which bear outliers."""
    n_cells = grid.n_rows * grid.n_columns
    median, n = group_median(cell[facing], points.height[facing], n_cells)
    median, n = median.reshape(grid.shape), n.reshape(grid.shape)
    variance = np.where(n > 0, 1.6 * sigma**2 / np.maximum(n, 1), np.inf)
    return fit_contour(grid, median, variance, 3).height


def _grow(grid: Grid, level: Array, noise: Array, cell: np.ndarray, facing: Flags) -> Array:
    """Height of the surface above the contour per cell, nan where it was not reached."""
    at_contour = facing & (np.abs(level) < 3 * noise)
    value = grid.mean(cell[at_contour], level[at_contour])
    # Where most points of a cell lie off the contour, the surface has left it.
    n_off = grid.count(cell[facing]) - grid.count(cell[at_contour])
    value[n_off > grid.count(cell[at_contour])] = np.nan
    size = max(grid.row_size, grid.column_size)

    open_points = np.flatnonzero(facing)
    for _ in range(max(grid.shape)):
        known = np.isfinite(value)
        weight = box_sum(known * 1.0)
        predicted = box_sum(np.where(known, value, 0.0)) / np.maximum(weight, 1)
        # Sparse scans leave cells empty: predict from one cell further where there is none near.
        weight_2 = box_sum(known * 1.0, 2)
        further = box_sum(np.where(known, value, 0.0), 2) / np.maximum(weight_2, 1)
        predicted = np.where(weight > 0, predicted, further)
        reachable = ~known & (weight_2 > 0)
        open_points = open_points[~known.ravel()[cell[open_points]]]
        at = cell[open_points]
        gap = level[open_points] - predicted.ravel()[at]
        # The prediction is the mean of cells up to two steps away.
        rise = 1.5 * size * np.where(gap < 0, STEEPEST_INWARD_FLANK, STEEPEST_FLANK)
        is_near = np.abs(gap) < 3 * noise[open_points] + rise
        fits = reachable.ravel()[at] & is_near
        if not fits.any():
            break
        chosen = open_points[fits]
        gained = grid.mean(cell[chosen], level[chosen])
        value = np.where(known, value, gained)
    return value


def _steepness(value: Array) -> Array:
    """Rise of the surface within a cell, metres; 0 where it is not known."""
    around = np.pad(value, ((1, 1), (0, 0)), constant_values=np.nan)
    along = np.abs(around[2:] - around[:-2]) / 2
    across = np.abs(np.roll(value, -1, axis=1) - np.roll(value, 1, axis=1)) / 2
    rise = np.nan_to_num(along) + np.nan_to_num(across)
    return np.asarray(ndimage.maximum_filter(rise, 3, mode=("nearest", "wrap")))
