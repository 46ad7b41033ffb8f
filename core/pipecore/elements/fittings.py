"""Fittings looked for where straight pipes say they must be: bends, reducers and flanges.

Two straights that meet at an angle are joined by a bend, two on one line but of different
radii by a reducer, and around straights sit flanges. Each is proposed from the straights
and then has to hold against the points like any other piece.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from pipecore.elements.nearby import NearbyPoints
from pipecore.elements.pieces import Piece, arc_angles
from pipecore.elements.refine import RADIAL_COS, Fitted
from pipecore.elements.surfaces import ArcSurface, LineSurface
from pipecore.geometry import LineAxis

Array = NDArray[np.float64]
End = tuple[int, int]
"""An end of a fitted straight: its number, and 0 for its start or 1 for its end."""
NO_ELLIPSES: NDArray[np.intp] = np.empty(0, np.intp)

SAME_RADIUS = 0.06
MIN_TURN, MAX_TURN = np.deg2rad(6.0), np.deg2rad(135.0)
MAX_SKEW = 0.2
"""Axes joined by a bend pass each other within this share of the radius."""
BEND_RADII = np.geomspace(1.1, 11.0, 60)
"""Bend radii tried, in radii of the pipe."""
OVERSHOOT = 1.5
"""A straight may have been followed this many radii into the bend."""
ON_AXIS = 0.12
"""Axes of straights joined by a reducer are within this share of the radius of each other."""
MAX_REDUCER = 5.0
"""Longest reducer, in radii of its wider end."""


def _ends(fitted: list[Fitted]) -> list[tuple[End, Array, Array, float]]:
    """Ends of the cylinders: which, point, outward direction, radius."""
    ends = []
    for i, f in enumerate(fitted):
        if isinstance(f.fit.model, LineSurface) and not f.fit.model.is_tapered:
            direction = f.fit.model.direction
            ends.append(((i, 0), f.axis.start, -direction, f.fit.model.radius))
            ends.append(((i, 1), f.axis.end, direction, f.fit.model.radius))
    return ends


def propose_bends(
    fitted: list[Fitted], nearby: NearbyPoints
) -> Iterator[tuple[Piece, tuple[End, End]]]:
    """Bends tangent to two straights of one radius, with the bend radius that fits the points."""
    ends = _ends(fitted)
    proposals = []
    for a, (i, p, u, r) in enumerate(ends):
        for j, q, v, s in ends[a + 1 :]:
            if i[0] == j[0] or abs(r - s) > SAME_RADIUS * min(r, s):
                continue
            turn = float(np.arccos(np.clip(-(u @ v), -1.0, 1.0)))
            if not MIN_TURN < turn < MAX_TURN:
                continue
            along_p, along_q, skew = _closest(p, u, q, v)
            radius = 0.5 * (r + s)
            furthest = BEND_RADII[-1] * radius * np.tan(turn / 2)
            if skew > MAX_SKEW * radius + 0.002:
                continue
            if min(along_p, along_q) < -OVERSHOOT * radius or max(along_p, along_q) > furthest:
                continue
            corner = 0.5 * (p + along_p * u + q + along_q * v)
            found = _best_bend(corner, u, v, turn, radius, max(along_p, along_q), nearby)
            if found is not None:
                proposals.append((found[0], found[1], (i, j)))
    for _, piece, pair in sorted(proposals, key=lambda x: (-x[0], x[2])):
        yield piece, pair


def _closest(p: Array, u: Array, q: Array, v: Array) -> tuple[float, float, float]:
    """Parameters of the closest points of the lines p + s·u and q + t·v, and their distance."""
    w = p - q
    b, d, e = float(u @ v), float(u @ w), float(v @ w)
    det = 1.0 - b * b
    s, t = (b * e - d) / det, (e - b * d) / det
    return s, t, float(np.linalg.norm(w + s * u - t * v))


def _best_bend(
    corner: Array,
    u: Array,
    v: Array,
    turn: float,
    radius: float,
    gap: float,
    nearby: NearbyPoints,
) -> tuple[int, Piece] | None:
    """The bend radius at `corner` that most points agree with, and how many lie on its arc."""
    normal = np.cross(u, -v)
    normal /= np.linalg.norm(normal)
    inward = np.cross(normal, u)
    half_tan = np.tan(turn / 2)
    tangent_max = min(BEND_RADII[-1] * radius * half_tan, gap + 3.0 * radius)
    ball = nearby.within_ball(corner, tangent_max + 1.2 * radius)
    xyz, normals = nearby.surface.xyz[ball], nearby.surface.normals[ball]
    tolerance = max(3.0 * nearby.surface.noise, 0.03 * radius)
    best_count, best = 0, None
    for bend_radius in BEND_RADII * radius:
        tangent = bend_radius * half_tan
        if tangent > tangent_max:
            break
        centre = corner - tangent * u + bend_radius * inward
        model = ArcSurface(centre, normal, float(bend_radius), radius)
        low = float(arc_angles(model, (corner - tangent * u)[None])[0])
        inside = np.mod(arc_angles(model, xyz) - low, 2 * np.pi) < turn
        residual, _, outward = model.residuals(xyz)
        on = (np.abs(residual) < tolerance) & (
            np.abs(np.einsum("ij,ij->i", normals, outward)) > RADIAL_COS
        )
        straight = _on_straights(xyz, normals, corner, (u, v), radius, tolerance)
        # Points beyond the tangent points must agree with the straights instead.
        count = int((on & inside).sum() + (straight & ~inside).sum())
        if count > best_count and (on & inside).sum() >= 12:
            best_count, best = count, Piece(model, NO_ELLIPSES, low, low + turn)
    return None if best is None else (best_count, best)


def _on_straights(
    xyz: Array,
    normals: Array,
    corner: Array,
    directions: tuple[Array, Array],
    radius: float,
    tolerance: float,
) -> NDArray[np.bool_]:
    """Points on either of the straights that end towards the corner."""  # fmt: skip
    on = np.zeros(len(xyz), np.bool_)
    for direction in directions:
        residual, _, outward = LineSurface(corner, direction, radius).residuals(xyz)
        radial = np.abs(np.einsum("ij,ij->i", normals, outward)) > RADIAL_COS
        on |= (np.abs(residual) < tolerance) & radial & ((xyz - corner) @ direction < 0)
    return on


def propose_reducers(fitted: list[Fitted]) -> Iterator[tuple[Piece, tuple[End, End]]]:
    """Cones between straights on one line but of different radii."""
    ends = _ends(fitted)
    for a, (i, p, u, r) in enumerate(ends):
        for j, q, v, s in ends[a + 1 :]:
            wide, narrow = max(r, s), min(r, s)
            if i[0] == j[0] or -(u @ v) < np.cos(np.deg2rad(6.0)) or not 0.4 < narrow / wide < 0.96:
                continue
            gap = q - p
            along = float(gap @ u)
            across = float(np.linalg.norm(gap - along * u))
            if not 0.1 * wide < along < MAX_REDUCER * wide or across > ON_AXIS * wide:
                continue
            direction = gap / np.linalg.norm(gap)
            length = float(np.linalg.norm(gap))
            model = LineSurface(
                0.5 * (p + q), direction, 0.5 * (r + s), (s - r) / length, is_tapered=True
            )
            yield Piece(model, NO_ELLIPSES, -0.5 * length, 0.5 * length), (i, j)


FLANGE_RATIO = (1.12, 2.8)
"""A flange is this many times as wide as its pipe."""
MIN_FLANGE_LENGTH, MAX_FLANGE_LENGTH = 0.008, 0.9
"""Metres; radii of the pipe for proposed ones, of the disc itself for found ones."""
FLANGE_ARC = np.deg2rad(75.0)
RADIUS_STEP = 0.03


def propose_flanges(
    fitted: list[Fitted], nearby: NearbyPoints, is_free: NDArray[np.bool_]
) -> Iterator[Piece]:
    """Short discs around straights: rings of points whose normals point to the pipe's axis."""
    for f in fitted:
        model = f.fit.model
        if (
            not isinstance(model, LineSurface)
            or model.is_tapered
            or not isinstance(f.axis, LineAxis)
        ):
            continue
        if f.axis.length < model.radius:
            continue
        reach = FLANGE_RATIO[1] * model.radius
        near = nearby.thinned(f.axis, reach / 1.3, 1.5 * model.radius)
        near = near[is_free[near]]
        chainage, rho, clock = f.axis.pipe_coordinates(nearby.surface.xyz[near])
        _, _, outward = model.residuals(nearby.surface.xyz[near])
        cosine = np.abs(np.einsum("ij,ij->i", nearby.surface.normals[near], outward))
        ratio = rho / model.radius
        on = (cosine > 0.94) & (ratio > FLANGE_RATIO[0]) & (ratio < FLANGE_RATIO[1])
        for low, high, radius in _rings(
            chainage[on], rho[on], clock[on], model.radius, nearby.surface.voxel
        ):
            offset = float((f.axis.start - model.middle) @ model.direction)
            disc = LineSurface(
                model.middle + (offset + 0.5 * (low + high)) * model.direction,
                model.direction,
                radius,
            )
            half = 0.5 * (high - low)
            yield Piece(disc, NO_ELLIPSES, -half, half)


def _rings(
    chainage: Array, rho: Array, clock: Array, radius: float, voxel: float
) -> Iterator[tuple[float, float, float]]:
    """Runs of chainage with points of one radius around much of the axis: low, high, radius."""
    if len(chainage) < 12:
        return
    step = 1.5 * voxel
    base = chainage.min()
    row = ((chainage - base) / step).astype(np.intp)
    level = np.round(np.log(rho / radius) / RADIUS_STEP).astype(np.intp)
    sector = (clock / (2 * np.pi) * 24).astype(np.intp) % 24
    n_rows, n_levels = int(row.max()) + 1, int(level.max()) + 2
    seen = np.zeros((n_rows, n_levels + 1, 24), np.bool_)
    # A radius on the border of two levels counts in both.
    for shift in (0, 1):
        seen[row, np.clip(level + shift, 0, n_levels), sector] = True
    arc = seen.sum(axis=2) * (2 * np.pi / 24)
    is_ring = arc >= FLANGE_ARC
    for _ in range(12):
        best = np.where(is_ring, arc, 0.0)
        r0, l0 = np.unravel_index(int(np.argmax(best)), best.shape)
        if best[r0, l0] == 0.0:
            return
        first = last = int(r0)
        while first > 0 and is_ring[first - 1, l0]:
            first -= 1
        while last + 1 < n_rows and is_ring[last + 1, l0]:
            last += 1
        is_ring[max(first - 1, 0) : last + 2] = False
        members = (row >= first) & (row <= last) & ((level == l0) | (level == l0 - 1))
        low, high = float(chainage[members].min()), float(chainage[members].max())
        if MIN_FLANGE_LENGTH <= high - low <= MAX_FLANGE_LENGTH * radius and members.sum() >= 12:
            yield low, high, float(np.median(rho[members]))


def flanges(fitted: list[Fitted]) -> list[tuple[int, int]]:
    """Pairs (flange, pipe): short discs around the axis of a thinner pipe, at or on it."""
    pipes = [
        (j, f)
        for j, f in enumerate(fitted)
        if isinstance(f.fit.model, LineSurface) and not f.fit.model.is_tapered
    ]
    found = []
    for i, disc in pipes:
        if disc.axis.length > MAX_FLANGE_LENGTH * disc.fit.model.radius:
            continue
        for j, pipe in pipes:
            ratio = disc.fit.model.radius / pipe.fit.model.radius
            if i == j or not FLANGE_RATIO[0] < ratio < FLANGE_RATIO[1]:
                continue
            if pipe.axis.length < pipe.fit.model.radius:
                continue
            chainage, rho, _ = pipe.axis.pipe_coordinates(disc.axis.at(disc.axis.length / 2)[None])
            turn = abs(float(disc.axis.tangent(0.0) @ pipe.axis.tangent(0.0)))
            reach = 2 * pipe.fit.model.radius
            near = -reach < chainage[0] < pipe.axis.length + reach
            if near and rho[0] < 0.15 * pipe.fit.model.radius and turn > np.cos(np.deg2rad(12.0)):
                found.append((i, j))
                break
    return found
