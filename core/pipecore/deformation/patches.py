"""Dents and bulges: found on the map, measured on the points, kept if they are closed."""

from dataclasses import dataclass

import numpy as np

from pipecore.deformation.bump import Bump, fit_bump
from pipecore.deformation.deviation_map import DeviationMap, Flags, Grid, dilate
from pipecore.deformation.matched_filter import Candidate, disc, find_candidates
from pipecore.deformation.reference import Contour, fit_contour
from pipecore.deformation.surface import Surface
from pipecore.deformation.unrolled import stretch
from pipecore.geometry import Array
from pipecore.types import Element

MASK = 1.15
"""The contour is fitted without the bumps, this much larger than they are."""

N_ROUNDS = 3


@dataclass(frozen=True, eq=False)
class Patch:
    """A fitted bump at its place on a pipe of `radius`; `z` is its height over its noise."""

    chainage: float
    clock: float
    radius: float
    bump: Bump
    z: float
    is_enclosed: bool

    def cells(self, grid: Grid, scale: float = 1.0) -> Flags:
        """Cells within the extent, scaled."""
        return disc(
            grid, self.chainage, self.clock, scale * self.bump.length, scale * self.bump.width
        )


def find_patches(
    element: Element, surface: Surface, cells: DeviationMap, n_terms: int, significance: float
) -> tuple[list[Patch], Contour]:
    """Return the bumps above `significance`, and the contour that they were measured against.

    Finding and fitting the contour take turns: the contour is fitted without the bumps
    found so far, the bumps are looked for over the contour without them.
    """
    grid = cells.grid
    variance = np.where(cells.count > 0, cells.noise**2 / np.maximum(cells.count, 1), np.inf)
    contour = fit_contour(grid, cells.deviation, variance, n_terms)
    patches: list[Patch] = []
    for turn in range(N_ROUNDS):
        threshold = significance if turn == N_ROUNDS - 1 else 0.75 * significance
        candidates = _candidates(cells, contour, 0.75 * significance)
        measured = [_measure(element, surface, cells, contour, c) for c in candidates]
        patches = _without_overlap([p for p in measured if p is not None and abs(p.z) >= threshold])
        if turn < N_ROUNDS - 1:
            masked = np.zeros(grid.shape, dtype=bool)
            for patch in patches:
                masked |= patch.cells(grid, MASK)
            outside = np.where(masked, np.inf, variance)
            contour = fit_contour(grid, cells.deviation, outside, n_terms)
    return [p for p in patches if p.is_enclosed], contour


def _candidates(cells: DeviationMap, contour: Contour, threshold: float) -> list[Candidate]:
    some = cells.count > 0
    weight = np.where(some, cells.count / cells.noise**2, 0.0)
    allowed = cells.covered & ~cells.disputed
    deviation = cells.deviation - contour.height
    return find_candidates(
        cells.grid, deviation, weight, cells.count, contour.sd, allowed, threshold
    )


def _measure(
    element: Element, surface: Surface, cells: DeviationMap, contour: Contour, seen: Candidate
) -> Patch | None:
    grid, points = surface.grid, surface.points
    reach = 2.5 * max(seen.length, seen.width)
    scale = stretch(element, seen.clock)
    radius = float(element.radius_at(seen.chainage))
    along = (points.chainage - seen.chainage) * scale
    near = np.flatnonzero(surface.belongs & (np.abs(along) < reach))
    turn = np.mod(points.clock[near] - seen.clock + np.pi, 2 * np.pi) - np.pi
    near, turn = near[np.abs(turn) * radius < reach], turn[np.abs(turn) * radius < reach]
    deviation = points.height[near] - grid.interpolate(
        contour.height, points.chainage[near], points.clock[near]
    )
    row = min(int(seen.chainage / grid.row_size), grid.n_rows - 1)
    column = min(int(seen.clock / grid.column_angle), grid.n_columns - 1)
    contour_sd = float(contour.sd[row, column])
    bump = fit_bump(
        along[near],
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
    chainage = seen.chainage + bump.along / scale
    clock = float(np.mod(seen.clock + bump.around / radius, 2 * np.pi))
    # How far the height stands out of the noise, its shape taken as given.
    known = _known_shape_sd(cells, chainage, clock, bump) * seen.inflation
    z = bump.height / float(np.hypot(known, contour_sd))
    return Patch(chainage, clock, radius, bump, z, _is_enclosed(cells, chainage, clock, bump))


def _known_shape_sd(cells: DeviationMap, chainage: float, clock: float, bump: Bump) -> float:
    u, v = _shares(cells.grid, chainage, clock, bump)
    bell = np.cos(np.pi / 2 * np.minimum(np.hypot(u, v), 1.0)) ** 2
    precision = np.sum(bell**2 * cells.count / cells.noise**2)
    return float(1.0 / np.sqrt(max(precision, 1e-12)))


def _shares(grid: Grid, chainage: float, clock: float, bump: Bump) -> tuple[Array, Array]:
    turn = np.mod(grid.clocks - clock + np.pi, 2 * np.pi) - np.pi
    u = (grid.chainages - chainage) / (bump.length / 2)
    v = turn * grid.radius / (bump.width / 2)
    return u[:, None] + 0 * v, v[None, :] + 0 * u[:, None]


def _is_enclosed(cells: DeviationMap, chainage: float, clock: float, bump: Bump) -> bool:
    """Whether a bump is seen at its peak and has come back to the contour around it.

    A dent may be cut off on one side by the edge of what was scanned. A bulge may not,
    nor have another surface near: things that touch a pipe look like that.
    """
    grid = cells.grid
    if not 0 < chainage < grid.length:
        return False
    u, v = _shares(grid, chainage, clock, bump)
    distance = np.hypot(u, v)
    sides = [
        (u > np.abs(v)),
        (u < -np.abs(v)),
        (v > np.abs(u)),
        (v < -np.abs(u)),
    ]
    covered = cells.covered
    # A bump that ends with the element has no cells beyond it: count what should be there.
    n_closed = 0
    expected = bump.length * bump.width / (grid.row_size * grid.column_size) / 4
    expected *= np.pi / 4 * (1.2**2 - 0.4**2)
    for side in sides:
        ring = side & (distance > 0.4) & (distance < 1.2)
        n_closed += np.count_nonzero(covered & ring) > 0.5 * expected
    centre = distance < 0.5
    seen = np.count_nonzero(covered & centre) > 0.6 * np.count_nonzero(centre)
    if bump.height < 0:
        return bool(seen and n_closed >= 3)
    inside = distance < 1.1
    disputed = np.count_nonzero(dilate(cells.disputed) & inside) / max(np.count_nonzero(inside), 1)
    return bool(seen and n_closed == 4 and disputed < 0.1 and bump.misfit < 2.5)


def _without_overlap(patches: list[Patch]) -> list[Patch]:
    """Of bumps whose peak lies within a more significant one, keep the latter only."""
    kept: list[Patch] = []
    for patch in sorted(patches, key=lambda p: (-abs(p.z), p.chainage, p.clock)):
        if not any(_holds(other, patch) for other in kept):
            kept.append(patch)
    return kept


def _holds(outer: Patch, inner: Patch) -> bool:
    turn = np.mod(inner.clock - outer.clock + np.pi, 2 * np.pi) - np.pi
    u = (inner.chainage - outer.chainage) / (outer.bump.length / 2)
    v = turn * outer.radius / (outer.bump.width / 2)
    return bool(u**2 + v**2 < 1.0)
