"""Refinement: a robust geometric fit of each piece to all points around it, and its extent."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipecore.elements.nearby import NearbyPoints
from pipecore.elements.pieces import Piece, arc_direction
from pipecore.elements.surfaces import (
    ArcSurface,
    LineSurface,
    SphereSurface,
    SurfaceFit,
    fit_surface,
)
from pipecore.geometry import ArcAxis, LineAxis

Array = NDArray[np.float64]

RADIAL_COS = float(np.cos(np.deg2rad(30.0)))
"""A point belongs to a surface only if its normal is this close to the surface's."""
N_SECTORS = 36
MIN_SECTORS = 7
"""A step of axis is covered if at least this many 10° sectors around it have points."""
MAX_GAP = 4.0
"""An element goes on across gaps of this many radii (or 0.25 m)."""
MAX_FIT_POINTS = 60_000
"""Larger elements are fitted to an even sample of this many points."""


@dataclass(frozen=True, eq=False)
class Fitted:
    """A piece fitted to the cloud.

    Parameters
    ----------
    fit : SurfaceFit
    axis : LineAxis or ArcAxis
        As scanned, from where the points start to where they end.
    own : ndarray of int
        Thinned points on the surface.
    arc : float
        Median arc that steps along the axis see, radians.
    coverage : float
        Share of the steps along the axis that are covered.
    gaps : tuple of (float, float)
        Chainage ranges that are not.
    ellipses : ndarray of int
        Ellipses of the piece.
    """

    fit: SurfaceFit[LineSurface] | SurfaceFit[ArcSurface] | SurfaceFit[SphereSurface]
    axis: LineAxis | ArcAxis
    own: NDArray[np.intp]
    arc: float
    coverage: float
    gaps: tuple[tuple[float, float], ...]
    ellipses: NDArray[np.intp]

    @property
    def radius(self) -> float:
        """Radius at the start of the axis, metres."""
        model = self.fit.model
        if isinstance(model, LineSurface):
            return float(model.radius + model.slope * self._from_middle(self.axis.start))
        return model.radius

    @property
    def radius_end(self) -> float:
        """Radius at the end of the axis, metres."""
        model = self.fit.model
        if isinstance(model, LineSurface):
            return float(model.radius + model.slope * self._from_middle(self.axis.end))
        return model.radius

    def _from_middle(self, point: Array) -> float:
        model = self.fit.model
        assert isinstance(model, LineSurface)
        return float((point - model.middle) @ model.direction)


def axis_of(piece_model: LineSurface | ArcSurface, low: float, high: float) -> LineAxis | ArcAxis:
    """The axis of a model between two of its chainages (lines) or angles (arcs)."""
    if isinstance(piece_model, ArcSurface):
        return piece_model.axis_from(arc_direction(piece_model, low), high - low)
    return piece_model.axis_between(low, high)


def refine_piece(piece: Piece, nearby: NearbyPoints, is_free: NDArray[np.bool_]) -> Fitted | None:
    """Fit a piece's surface to the cloud's points and find how far it reaches.

    The fit and the extent improve each other, thrice. Extents grow over steps of axis
    that the surface covers, and across gaps of up to `MAX_GAP` radii or 0.25 m.

    Parameters
    ----------
    piece : Piece
    nearby : NearbyPoints
    is_free : ndarray of bool
        Thinned points that no other element has taken.

    Returns
    -------
    Fitted or None
        None where the points do not carry the surface.
    """
    model = piece.model
    if isinstance(model, SphereSurface):
        return _refine_sphere(piece, model, nearby, is_free)
    tolerance = max(3.0 * nearby.surface.noise, 0.002, 0.02 * model.radius)
    axis = axis_of(model, piece.low, piece.high)
    fit: SurfaceFit[LineSurface] | SurfaceFit[ArcSurface] | None = None
    extent = None
    for round_ in range(3):
        margin = 1.0 * model.radius if round_ == 0 else 0.5 * axis.length + 4.0 * model.radius
        if isinstance(axis, ArcAxis):
            margin = min(
                margin, 0.8 * model.radius, 0.5 * (2 * np.pi - axis.bend_angle) * axis.bend_radius
            )
        thinned = nearby.thinned(axis, model.radius, margin)
        thinned = thinned[is_free[thinned]]
        xyz, normals = nearby.surface.xyz[thinned], nearby.surface.normals[thinned]
        residual, _, outward = model.residuals(xyz)
        is_radial = np.abs(np.einsum("ij,ij->i", normals, outward)) > RADIAL_COS
        chainage, _, clock = axis.pipe_coordinates(xyz)
        own = is_radial & (np.abs(residual) < 2.0 * tolerance)
        extent = _extent(chainage[own], clock[own], axis.length, nearby.surface.voxel, model.radius)
        if extent is None:
            return None
        low, high = extent.low, extent.high
        own &= (chainage >= low) & (chainage <= high)
        if own.sum() < 15:
            return None
        inner = min(0.3 * model.radius, 0.1 * (high - low))
        core = own & (chainage >= low + inner) & (chainage <= high - inner)
        index, points, _ = nearby.of_cloud(thinned[core if core.sum() > 30 else own])
        if len(points) > MAX_FIT_POINTS:
            points = points[np.linspace(0, len(points) - 1, MAX_FIT_POINTS).astype(np.intp)]
        fit = fit_surface(model, points, tolerance)
        if fit is None or abs(fit.model.radius - model.radius) > 0.25 * model.radius:
            return None
        moved = axis.at(np.array([low, high]))
        model = fit.model
        axis = _axis_through(model, moved)
        tolerance = max(3.0 * fit.sigma, 0.0015)
    assert fit is not None and extent is not None
    shift = -extent.low
    return Fitted(
        fit,
        axis,
        thinned[own],
        extent.arc,
        extent.coverage,
        tuple((a + shift, b + shift) for a, b in extent.gaps),
        piece.ellipses,
    )


def _axis_through(model: LineSurface | ArcSurface, ends: Array) -> LineAxis | ArcAxis:
    """The model's axis between the places nearest to two points."""
    if isinstance(model, LineSurface):
        low, high = (ends - model.middle) @ model.direction
        return model.axis_between(float(low), float(high))
    start, end = (e - model.centre for e in ends)
    axis = model.axis_from(start, 0.0)
    ahead = np.cross(axis.normal, axis.towards_start)
    angle = float(np.mod(np.arctan2(end @ ahead, end @ axis.towards_start), 2 * np.pi))
    return model.axis_from(start, angle)


@dataclass(frozen=True)
class _Extent:
    low: float
    high: float
    arc: float
    coverage: float
    gaps: tuple[tuple[float, float], ...]


def _extent(
    chainage: Array,
    clock: Array,
    length: float,
    voxel: float,
    radius: float,
) -> "_Extent | None":
    """How far points on a surface cover its axis, starting from its middle part."""
    step = max(2.0 * voxel, 0.15 * radius)
    if len(chainage) == 0:
        return None
    base = chainage.min()
    row = ((chainage - base) / step).astype(np.intp)
    n_rows = int(row.max()) + 1
    # A sector is wide enough to hold a point wherever the surface is seen.
    n_sectors = int(np.clip(2 * np.pi * radius / (2.0 * voxel), 12, N_SECTORS))
    sector = (clock / (2 * np.pi) * n_sectors).astype(np.intp) % n_sectors
    seen = np.zeros((n_rows, n_sectors), np.bool_)
    seen[row, sector] = True
    arc = seen.sum(axis=1) / n_sectors * 2 * np.pi
    inside = (np.arange(n_rows) + 0.5) * step + base
    core = (inside > 0) & (inside < length)
    if not core.any():
        return None
    usual = np.quantile(arc[core], 0.75)
    covered = arc >= max(0.45 * usual, np.deg2rad(50.0))
    rows = np.flatnonzero(covered)
    if len(rows) == 0:
        return None
    parts = np.split(rows, np.flatnonzero(np.diff(rows) * step > max(MAX_GAP * radius, 0.25)) + 1)
    part = max(parts, key=lambda p: int(core[p].sum()))
    first, last = part[0], part[-1]
    low = chainage[row == first].min()
    high = chainage[row == last].max()
    breaks = np.flatnonzero(np.diff(part) * step > max(2.0 * radius, 3 * step))
    gaps = tuple(
        (float(base + (part[b] + 1) * step), float(base + part[b + 1] * step)) for b in breaks
    )
    return _Extent(
        float(low),
        float(high),
        float(np.median(arc[part])),
        len(part) / (last - first + 1),
        gaps,
    )


def _refine_sphere(
    piece: Piece, model: SphereSurface, nearby: NearbyPoints, is_free: NDArray[np.bool_]
) -> Fitted | None:
    axis = LineAxis(
        model.centre - np.array([0.0, 0.0, model.radius]),
        np.array([0.0, 0.0, 1.0]),
        2 * model.radius,
    )
    own: NDArray[np.intp] = np.empty(0, np.intp)
    tolerance = max(3.0 * nearby.surface.noise, 0.002, 0.02 * model.radius)
    fit: SurfaceFit[SphereSurface] | None = None
    for _ in range(3):
        near = nearby.within_ball(model.centre, 1.2 * model.radius)
        near = near[is_free[near]]
        residual, _, outward = model.residuals(nearby.surface.xyz[near])
        radial = np.abs(np.einsum("ij,ij->i", nearby.surface.normals[near], outward)) > RADIAL_COS
        own = near[radial & (np.abs(residual) < 2.0 * tolerance)]
        if len(own) < 30:
            return None
        _, points, _ = nearby.of_cloud(own)
        fit = fit_surface(model, points, tolerance)
        if fit is None or abs(fit.model.radius - model.radius) > 0.25 * model.radius:
            return None
        model = fit.model
        tolerance = max(3.0 * fit.sigma, 0.0015)
    assert fit is not None
    along = np.sort((nearby.surface.xyz[own] - model.centre)[:, 2])
    axis = LineAxis(
        model.centre + np.array([0.0, 0.0, along[0]]),
        np.array([0.0, 0.0, 1.0]),
        float(along[-1] - along[0]),
    )
    return Fitted(fit, axis, own, np.nan, 1.0, (), piece.ellipses)
