"""Dents and bulges: found on the map, measured on the points, kept if they are closed."""

from dataclasses import dataclass, replace

import numpy as np

from pipecore.deformation.bump import TYPICAL_EXTENT, Bump, fit_bump
from pipecore.deformation.contour import Contour, fit_contour
from pipecore.deformation.deviation_map import DeviationMap, Flags, Grid
from pipecore.deformation.element_surface import ElementSurface
from pipecore.deformation.matched_filter import BumpCandidate, MatchedFilter, disc
from pipecore.deformation.unrolled_points import min_stretch, stretch
from pipecore.geometry import Array
from pipecore.types import Element

MASK_SCALE = 1.2
"""Bumps are masked in the fit of the contour, this much larger than their filter's extent."""

MASK_SIGNIFICANCE = 0.7
"""Fraction of the required significance from which a place is masked."""

N_ROUNDS = 2

MIN_POINTS = 8
"""A bump of six parameters needs more points than that."""

MAX_REMAINDER = 0.4
"""Beyond a bump, the surface has returned if it deviates by less than this fraction of it."""

BULGE_FACTOR = 1.1
"""Factor on the significance of bulges, as objects that touch a pipe look like one."""

MAX_MISFIT = 1.8
"""Largest RMS residual of a bulge, in units of the noise: beyond, it is two surfaces."""


@dataclass(frozen=True, eq=False)
class Patch:
    """A fitted bump at its place on a pipe of `radius`; `z` is its height over its noise.

    `scale` is the length on the surface per chainage, which differs from 1 in a bend.
    `n_closed` counts the sides, of four, on which it is seen to come back to the contour.
    """

    chainage: float
    clock: float
    radius: float
    bump: Bump
    z: float
    scale: float
    n_closed: int = 0

    @property
    def is_enclosed(self) -> bool:
        """Whether enough of it is seen."""
        return self.n_closed >= (3 if self.bump.height < 0 else 4)

    @property
    def span(self) -> float:
        """Chainage that it covers, metres."""
        return self.bump.length / self.scale

    @property
    def place(self) -> tuple[float, float, float, float]:
        """Chainage and clock of its peak, and the chainage and width that it covers."""
        return self.chainage, self.clock, self.span, self.bump.width

    def cells(self, grid: Grid, scale: float = 1.0) -> Flags:
        """Cells within the extent, scaled."""
        return disc(grid, self.chainage, self.clock, scale * self.span, scale * self.bump.width)


def find_patches(
    element: Element,
    surface: ElementSurface,
    cells: DeviationMap,
    significance: float,
    *,
    n_terms: int,
    knot_diameters: float,
) -> tuple[list[Patch], Contour]:
    """Find the dents and bulges of an element, and the contour they were measured against.

    The search for bumps and the fit of the contour alternate: the contour is fitted with the
    bumps found so far masked, and more is found against the better contour.

    Parameters
    ----------
    element : Element
    surface : ElementSurface
    cells : DeviationMap
        Its heights above the element's fitted surface.
    significance : float
        Least height over its noise.
    n_terms : int
        Terms of the contour: 3, or 5 with ovality.
    knot_diameters : float
        Distance between its knots, in diameters.

    Returns
    -------
    patches : list of Patch
        The most significant first.
    contour : Contour
    """
    grid = cells.grid
    some = cells.count > 0
    variance = np.where(some, cells.noise**2 / np.maximum(cells.count, 1), np.inf)
    weight = np.divide(cells.count, cells.noise**2, where=some, out=np.zeros(grid.shape))
    allowed = cells.covered & ~cells.in_contact
    bumps = MatchedFilter.of(grid, weight, cells.count, allowed)

    masked = np.zeros(grid.shape, dtype=bool)
    for n_masks in range(N_ROUNDS + 1):
        contour = fit_contour(
            grid,
            cells.deviation,
            np.where(masked, np.inf, variance),
            n_terms,
            knot_diameters=knot_diameters,
        )
        deviation = cells.deviation - contour.height
        found = bumps.find(deviation, contour.sd, MASK_SIGNIFICANCE * significance)
        before, masked = masked, np.zeros(grid.shape, dtype=bool)
        for seen in found:
            masked |= disc(
                grid, seen.chainage, seen.clock, MASK_SCALE * seen.length, MASK_SCALE * seen.width
            )
        if n_masks == N_ROUNDS or np.array_equal(masked, before):
            break  # The same mask leads to the same contour.
    patches = []
    for seen in found:
        if _closed_sides(cells, (seen.chainage, seen.clock, seen.length, seen.width)) >= 3:
            patch = _measure(element, surface, cells, contour, seen)
            least = significance * (BULGE_FACTOR if seen.height > 0 else 1.0)
            if patch is not None and abs(patch.z) >= least and patch.is_enclosed:
                patches.append(patch)
    return _without_overlap(patches), contour


def _measure(
    element: Element,
    surface: ElementSurface,
    cells: DeviationMap,
    contour: Contour,
    seen: BumpCandidate,
) -> Patch | None:
    grid, points = surface.grid, surface.points
    reach = 2.5 * max(seen.length, seen.width)
    scale = float(stretch(element, seen.clock))
    radius = float(element.radius_at(seen.chainage))
    near = surface.points_near(seen.chainage, reach / min_stretch(element))
    along = (points.chainage[near] - seen.chainage) * stretch(element, points.clock[near])
    turn = np.mod(points.clock[near] - seen.clock + np.pi, 2 * np.pi) - np.pi
    close = (np.abs(along) < reach) & (np.abs(turn) * radius < reach)
    near, along, turn = near[close], along[close], turn[close]
    deviation = points.height[near] - grid.interpolate(
        contour.height, points.chainage[near], points.clock[near]
    )
    row = min(int(seen.chainage / grid.row_size), grid.n_rows - 1)
    column = min(int(seen.clock / grid.column_angle), grid.n_columns - 1)
    contour_sd = float(contour.sd[row, column])
    bump = fit_bump(
        along,
        turn * radius,
        deviation,
        cells.noise.ravel()[surface.cell[near]],
        start=(seen.height, seen.length * scale, seen.width),
        diameter=2 * radius,
        contour_sd=contour_sd,
        inflation=seen.inflation,
    )
    if bump is None:
        return None
    clock = float(np.mod(seen.clock + bump.around / radius, 2 * np.pi))
    scale = float(stretch(element, clock))
    chainage = seen.chainage + bump.along / scale
    # Noise alone gains one unit of z² by each of the four parameters of place and size, and
    # the smaller a bump, the more places there are for one: twice the logarithm of their number.
    places = (TYPICAL_EXTENT * 2 * radius) ** 2 / (bump.length * bump.width)
    z_squared = bump.height**2 / (bump.noise**2 + contour_sd**2)
    z_squared -= 4.0 + 2.0 * max(float(np.log(places)), 0.0)
    z = float(np.sign(bump.height) * np.sqrt(max(z_squared, 0.0)))
    patch = Patch(chainage, clock, radius, bump, z, scale)
    n_closed = _seen_sides(cells, cells.deviation - contour.height, patch)
    return replace(patch, n_closed=n_closed)


def _shares(
    grid: Grid, place: tuple[float, float, float, float], reach: float
) -> tuple[slice, Array, Array]:
    """Distances of cells from a place as shares of half the extents, in rows within reach.

    A place is a chainage, a clock, a length and a width; `reach` is such a share too. Returns
    the rows, and the distances along and around of their cells.
    """
    chainage, clock, length, width = place
    rows = grid.rows_near(chainage, reach * length / 2)
    turn = np.mod(grid.clocks - clock + np.pi, 2 * np.pi) - np.pi
    u = (grid.chainages[rows] - chainage) / (length / 2)
    v = turn * grid.radius / (width / 2)
    along, around = np.broadcast_arrays(u[:, None], v[None, :])
    return rows, along, around


def _sides(u: Array, v: Array) -> tuple[Flags, ...]:
    """Cells beyond a place, before it, to its right and to its left."""
    return u > np.abs(v), u < -np.abs(v), v > np.abs(u), v < -np.abs(u)


def _closed_sides(cells: DeviationMap, place: tuple[float, float, float, float]) -> int:
    """On how many of its four sides a bump is seen to come back to the contour."""
    grid = cells.grid
    rows, u, v = _shares(grid, place, 1.2)
    distance = np.hypot(u, v)
    covered = cells.covered[rows] & (distance > 0.4) & (distance < 1.2)
    # Beyond the ends there are no cells: count what should be there.
    _, _, length, width = place
    quarter = np.pi / 4 * (1.2**2 - 0.4**2) * (length * width / 4)
    expected = quarter / (grid.row_size * grid.column_size)
    return sum(int(np.count_nonzero(covered & side) > 0.5 * expected) for side in _sides(u, v))


def _returns(cells: DeviationMap, deviation: Array, patch: Patch) -> int:
    """On how many of its four sides the surface is back at the contour beyond a bump."""
    rows, u, v = _shares(cells.grid, patch.place, 1.5)
    distance = np.hypot(u, v)
    ring = (distance > 1.0) & (distance < 1.5) & (cells.count[rows] > 0)
    n_back = 0
    for side in _sides(u, v):
        there = ring & side
        weight = cells.count[rows][there] / cells.noise[rows][there] ** 2
        if weight.sum() > 0:
            mean = float(np.average(deviation[rows][there], weights=weight))
            least = 2.5 / np.sqrt(weight.sum())
            n_back += abs(mean) < max(MAX_REMAINDER * abs(patch.bump.height), least)
    return n_back


def _seen_sides(cells: DeviationMap, deviation: Array, patch: Patch) -> int:
    """On how many sides a bump is seen to come back to the contour, 0 if it is no bump.

    A dent may be cut off on one side by the edge of what was scanned. A bulge may not,
    nor have another surface near: objects that touch a pipe look like that.
    """
    bump = patch.bump
    if not 0 < patch.chainage < cells.grid.length or bump.n_points < MIN_POINTS:
        return 0
    rows, u, v = _shares(cells.grid, patch.place, 1.1)
    distance = np.hypot(u, v)
    centre, inside = distance < 0.5, distance < 1.1
    if np.count_nonzero(cells.covered[rows] & centre) <= 0.6 * np.count_nonzero(centre):
        return 0
    n_closed = min(_closed_sides(cells, patch.place), _returns(cells, deviation, patch))
    if bump.height > 0:
        n_contact = np.count_nonzero(cells.near_contact[rows] & inside)
        is_free = n_contact < 0.1 * int(np.count_nonzero(inside)) and bump.misfit < MAX_MISFIT
        return n_closed if is_free else 0
    return n_closed


def _without_overlap(patches: list[Patch]) -> list[Patch]:
    """Of bumps whose peak lies within a more significant one, keep the latter only."""
    kept: list[Patch] = []
    for patch in sorted(patches, key=lambda p: (-abs(p.z), p.chainage, p.clock)):
        if not any(_holds(other, patch) for other in kept):
            kept.append(patch)
    return kept


def _holds(outer: Patch, inner: Patch) -> bool:
    turn = np.mod(inner.clock - outer.clock + np.pi, 2 * np.pi) - np.pi
    u = (inner.chainage - outer.chainage) / (outer.span / 2)
    v = turn * outer.radius / (outer.bump.width / 2)
    return bool(u**2 + v**2 < 1.0)
