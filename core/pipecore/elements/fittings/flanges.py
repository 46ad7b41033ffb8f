"""Flanges: rings about the axis of a straight pipe, wider than it and short.

Their rims are so short that few downsampled points have normals across them, and so few that
a free fit would not know their axis. But a flange sits on a pipe whose axis is known: about
that axis its rim is a line of one radius, and only this radius and its ends are unknown.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pipecore.elements.refinement.extent import Extent
from pipecore.elements.refinement.fitted_element import FittedElement
from pipecore.elements.refinement.nearby_points import OUTER_RADII, NearbyPoints
from pipecore.elements.refinement.surface_fits import LineSurface, SurfaceFit
from pipecore.elements.runs.ends import LineIndex, Link
from pipecore.geometry import AnyAxis, ArcAxis, LineAxis
from pipecore.robust import robust_sd

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

FLANGE_RATIO = (1.12, 3.6)
"""A flange is this many times as wide as its pipe; DN 15 has the largest ratio ..."""
MAX_OVERHANG = 0.2
"""... and no flange of a wide pipe stands out by more metres."""
MIN_LENGTH, MAX_LENGTH = 0.008, 0.9
"""Length of a flange, or of a pair with its gasket: metres; radii of the flange."""
MIN_ARC = np.deg2rad(75.0)
REACH_RADII, REACH_M = 2.0, 0.06
"""Flanges are searched so many radii of the pipe beyond its ends, which may be hidden, and
so many metres further, for their own length."""
RADIAL_COS = 0.8
"""Normals at an edge are tilted, but those on the faces of a flange are along the pipe."""
MAX_MISFIT, MAX_NOISE_MISFIT = 0.012, 0.5
"""Largest root mean square of the sectors' distances from the ring, in radii and in noise."""
MIN_POINTS = 12
GOES_ON, MISSED_ROWS = 0.5, 2
"""A ring goes on along rows of points that show this share of `MIN_ARC`, and across so many
that show less."""
MAX_CANDIDATES = 12
"""More rings than this are not tried on one pipe."""


@dataclass(frozen=True, eq=False)
class _Shell:
    """Points around a pipe that may be of a rim, in coordinates of its axis."""

    index: Indices
    chainage: Array
    rho: Array
    clock: Array

    def __getitem__(self, rows: NDArray[np.bool_]) -> "_Shell":
        return _Shell(self.index[rows], self.chainage[rows], self.rho[rows], self.clock[rows])


def find_flanges(
    fitted: list[FittedElement], nearby: NearbyPoints, is_free: NDArray[np.bool_]
) -> Iterator[FittedElement]:
    """Find the rings around straights, each pipe's most complete first.

    Parameters
    ----------
    fitted : list of FittedElement
    nearby : NearbyPoints
    is_free : ndarray of bool
        Downsampled points that no element has taken; looked at anew for each ring, so that
        the caller can mark what a ring took.
    """
    for f in fitted:
        model = f.fit.model
        if not isinstance(model, LineSurface) or model.is_tapered:
            continue
        if isinstance(f.axis, ArcAxis) or f.axis.length < model.radius:
            continue
        shell = _shell(f.axis, model.radius, nearby, is_free)
        tolerance = max(3.0 * nearby.surface.noise, 0.0025)
        for low, high, radius in _rings(shell, tolerance, nearby.surface.voxel):
            ring = _fit_ring(f, shell, (low, high), radius, tolerance, nearby, is_free)
            if ring is not None:
                yield ring


def _shell(
    axis: AnyAxis, radius: float, nearby: NearbyPoints, is_free: NDArray[np.bool_]
) -> _Shell:
    """Free downsampled points wider than the pipe that do not face along it."""
    widest = min(FLANGE_RATIO[1] * radius, radius + MAX_OVERHANG)
    near = nearby.around_axis(axis, widest / OUTER_RADII, REACH_RADII * radius + REACH_M)
    near = near[is_free[near]]
    chainage, rho, clock = axis.pipe_coordinates(nearby.surface.xyz[near])
    up, right = axis.frame(chainage)
    outward = np.cos(clock)[:, None] * up + np.sin(clock)[:, None] * right
    cosine = np.abs(np.einsum("ij,ij->i", nearby.surface.normals[near], outward))
    # Thinly scanned rims have too few neighbours for a normal at all.
    may_be_rim = np.isnan(cosine) | (cosine > RADIAL_COS)
    may_be_rim &= (rho > FLANGE_RATIO[0] * radius) & (rho < widest)
    return _Shell(near, chainage, rho, clock)[may_be_rim]


def _rings(shell: _Shell, tolerance: float, voxel: float) -> Iterator[tuple[float, float, float]]:
    """Chainages and radius of places where one radius shows around much of the axis."""
    if len(shell.index) < MIN_POINTS:
        return
    step = 1.5 * voxel
    base, narrowest = float(shell.chainage.min()), float(shell.rho.min())
    n_sectors = int(np.clip(2 * np.pi * narrowest / (2.0 * voxel), 12, 36))
    row = ((shell.chainage - base) / step).astype(np.intp)
    level = ((shell.rho - narrowest) / tolerance).astype(np.intp)
    sector = (shell.clock / (2 * np.pi) * n_sectors).astype(np.intp) % n_sectors
    n_rows, n_levels = int(row.max()) + 1, int(level.max()) + 2
    seen = np.zeros((n_rows, n_levels, n_sectors), np.bool_)
    # A radius on the border of two levels counts in both.
    seen[row, level, sector] = True
    seen[row, level + 1, sector] = True
    arc = longest_run(seen) * (2 * np.pi / n_sectors)
    is_ring = arc >= MIN_ARC
    for _ in range(MAX_CANDIDATES):
        best = np.where(is_ring, arc, 0.0)
        r0, l0 = np.unravel_index(int(np.argmax(best)), best.shape)
        if best[r0, l0] == 0.0:
            return
        # A row in which fewer points happen to lie does not end a ring.
        shows = arc[:, l0] >= GOES_ON * MIN_ARC
        goes_on = shows | ndimage.binary_closing(shows, np.ones(MISSED_ROWS + 2))
        first = last = int(r0)
        while first > 0 and goes_on[first - 1]:
            first -= 1
        while last + 1 < n_rows and goes_on[last + 1]:
            last += 1
        is_ring[max(first - 1, 0) : last + 2] = False
        members = (row >= first) & (row <= last) & ((level == l0) | (level == l0 - 1))
        yield (
            float(shell.chainage[members].min()),
            float(shell.chainage[members].max()),
            float(np.median(shell.rho[members])),
        )


def longest_run(seen: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Longest run of seen sectors around the clock (last axis); single gaps are closed."""
    n = seen.shape[-1]
    closed = seen | (np.roll(seen, 1, axis=-1) & np.roll(seen, -1, axis=-1))
    run = np.zeros(seen.shape[:-1], np.intp)
    longest = np.zeros_like(run)
    for k in range(2 * n):
        run = np.where(closed[..., k % n], run + 1, 0)
        longest = np.maximum(longest, run)
    return np.minimum(longest, n)


def _fit_ring(
    pipe: FittedElement,
    shell: _Shell,
    ends: tuple[float, float],
    radius: float,
    tolerance: float,
    nearby: NearbyPoints,
    is_free: NDArray[np.bool_],
) -> FittedElement | None:
    """Fit a ring's radius about the pipe's axis to all points there; None if it is no ring."""
    axis = pipe.axis
    voxel = nearby.surface.voxel
    near = (shell.chainage > ends[0] - voxel) & (shell.chainage < ends[1] + voxel)
    near &= (np.abs(shell.rho - radius) < 2.0 * tolerance) & is_free[shell.index]
    inliers = shell.index[near]
    _, xyz, _ = nearby.full_resolution_with_normals(inliers)
    if len(xyz) < MIN_POINTS:
        return None
    chainage, rho, clock = axis.pipe_coordinates(xyz)
    sigma = max(tolerance / 2, 0.001)
    for _ in range(5):
        on = np.abs(rho - radius) < 3.0 * sigma
        if on.sum() < MIN_POINTS:
            return None
        radius = float(np.median(rho[on]))
        sigma = max(robust_sd(rho[on] - radius), 0.0003)
    low, high = np.quantile(chainage[on], [0.01, 0.99])
    if not MIN_LENGTH < high - low < MAX_LENGTH * radius:
        return None
    n_sectors = int(np.clip(2 * np.pi * radius / (2.0 * voxel), 12, 36))
    sector = (clock[on] / (2 * np.pi) * n_sectors).astype(np.intp) % n_sectors
    seen = np.bincount(sector, minlength=n_sectors) > 0
    arc = float(longest_run(seen)) * 2 * np.pi / n_sectors
    off = np.array([np.median(rho[on][sector == k]) - radius for k in np.flatnonzero(seen)])
    misfit = float(np.sqrt(np.mean(off**2)))
    if arc < MIN_ARC or misfit > MAX_MISFIT * radius + MAX_NOISE_MISFIT * sigma:
        return None
    parent = pipe.fit
    covariance = parent.covariance.copy()
    # The pipe's axis is known to within its own standard deviation.
    covariance[4, 4] = sigma**2 / on.sum() + 0.5 * (covariance[0, 0] + covariance[1, 1])
    start, direction = axis.at(low), np.array(axis.tangent(0.5 * (low + high)))
    model = LineSurface(axis.at(0.5 * (low + high)), direction, radius)
    fit = SurfaceFit(model, covariance, sigma, int(on.sum()))
    ring = LineAxis(start, direction, float(high - low))
    return FittedElement(fit, ring, inliers, Extent(0.0, ring.length, arc, 1.0, ()), misfit)


def pair_flanges(fitted: list[FittedElement]) -> list[Link]:
    """Pairs (flange, pipe): short discs around the axis of a thinner pipe, at or on it."""
    pipes = [
        (j, f)
        for j, f in enumerate(fitted)
        if isinstance(f.fit.model, LineSurface) and not f.fit.model.is_tapered
    ]
    found = []
    lines = LineIndex([f.axis for _, f in pipes])
    reaches = np.array([REACH_RADII * f.fit.model.radius + REACH_M for _, f in pipes])
    for i, disc in pipes:
        if disc.axis.length > MAX_LENGTH * disc.fit.model.radius:
            continue
        middle = disc.axis.at(disc.axis.length / 2)
        for j, pipe in (pipes[k] for k in lines.near(middle, reaches)):
            ratio = disc.fit.model.radius / pipe.fit.model.radius
            if i == j or not FLANGE_RATIO[0] < ratio < FLANGE_RATIO[1]:
                continue
            if pipe.axis.length < pipe.fit.model.radius:
                continue
            chainage, rho, _ = pipe.axis.pipe_coordinates(disc.axis.at(disc.axis.length / 2)[None])
            turn = abs(float(disc.axis.tangent(0.0) @ pipe.axis.tangent(chainage[0])))
            reach = REACH_RADII * pipe.fit.model.radius + REACH_M
            near = -reach < chainage[0] < pipe.axis.length + reach
            if near and rho[0] < 0.15 * pipe.fit.model.radius and turn > np.cos(np.deg2rad(12.0)):
                found.append((i, j))
                break
    return found
