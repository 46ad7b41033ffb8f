"""Pieces of axes: which ellipses make a cylinder, a bend, a reducer or a sphere.

The paper classifies by the shape of the axis (line or arc) and by the pattern of the
radius along it (constant, linear, semicircle; figure 7). Here each pattern is a model,
and in every chain of centres the models that explain most ellipses are taken off one
after the other.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from pipecore._kernels import pieces as kernels
from pipecore.axes import join_centres
from pipecore.elements.surfaces import ArcSurface, LineSurface, SphereSurface
from pipecore.ellipses import Ellipses
from pipecore.geometry import cross, unit
from pipecore.progress import Progress

Array = NDArray[np.float64]

N_TRIALS = 400
MIN_COS = float(np.cos(np.deg2rad(12.0)))
MAX_OFFSET = 0.06
"""A centre is off the axis by less than this share of the radius."""
MAX_CHANGE = 0.06
"""A radius is off the pattern by less than this share."""
SAME_RADIUS = 0.025
"""Radii of one piece differ from its pattern by less than this share (and twice their sd)."""
MIN_ELLIPSES = 5
MOSTLY_STRAIGHT = 0.7
"""What is a bend only at its ends is a straight, such as a vessel between its heads."""
MIN_SPHERE = 8
"""Ellipses cut off its centre that make a sphere."""
SAME_CENTRE = 0.06
"""Normals of a sphere's sections meet within this share of its radius."""
MIN_TAPER = 0.04
LONG_PIECE = 2.5
"""Straight pieces of this many radii come first: shorter ones may be part of a bend."""
SHORT_PIECE = 0.5


@dataclass(frozen=True, eq=False)
class Piece:
    """A surface proposed for some ellipses.

    Parameters
    ----------
    model : LineSurface, ArcSurface or SphereSurface
    ellipses : ndarray of int
        The ellipses that it explains.
    low, high : float
        Extent along the axis: metres from the middle of a line, radians from the first
        axis of an arc's plane (see `ArcSurface`); 0 and 0 for a sphere.
    """

    model: LineSurface | ArcSurface | SphereSurface
    ellipses: NDArray[np.intp]
    low: float = 0.0
    high: float = 0.0


@dataclass(frozen=True, eq=False)
class _Rows:
    """What of the ellipses makes pieces, one array per column."""

    centre: Array
    axis: Array
    radius: Array
    radius_sd: Array
    width: Array

    def __getitem__(self, rows: NDArray[np.intp]) -> "_Rows":
        return _Rows(
            self.centre[rows],
            self.axis[rows],
            self.radius[rows],
            self.radius_sd[rows],
            self.width[rows],
        )


def find_pieces(ellipses: Ellipses, chain: NDArray[np.int32], progress: Progress) -> list[Piece]:
    """Explain the ellipses by pieces of spheres, straight pipes, bends and reducers.

    Parameters
    ----------
    ellipses : Ellipses
    chain : ndarray of int32
        Chain of each ellipse.
    progress : Progress
    """
    pieces = find_spheres(ellipses)
    order = np.argsort(chain, kind="stable")
    rows = _Rows(
        ellipses.centre, ellipses.axis, ellipses.radius, ellipses.radius_sd, ellipses.width
    )
    chains = np.split(order, np.flatnonzero(np.diff(chain[order])) + 1)
    for i, members in enumerate(chains):
        progress.update("elements", 0.3 * i / max(len(chains), 1))
        if len(members) < MIN_ELLIPSES:
            continue
        pieces += _explain_chain(ellipses, rows, members, progress)
    return pieces


def _explain_chain(
    ellipses: Ellipses, rows: _Rows, members: NDArray[np.intp], progress: Progress
) -> list[Piece]:
    pieces: list[Piece] = []

    def take(found: list[Piece]) -> None:
        nonlocal members
        pieces.extend(found)
        for piece in found:
            members = np.setdiff1d(members, piece.ellipses)

    take(_take_lines(rows, members, LONG_PIECE))
    take(_take_lines(rows, members, SHORT_PIECE, is_tapered=True))
    for group in _reconnected(ellipses, members, progress):
        take(_take_arcs(rows, group))
    take(_take_lines(rows, members, SHORT_PIECE))
    return pieces


def _reconnected(
    ellipses: Ellipses, members: NDArray[np.intp], progress: Progress
) -> list[NDArray[np.intp]]:
    """Groups of the members that still hang together."""
    if len(members) < MIN_ELLIPSES:
        return []
    label = join_centres(ellipses[members], progress)
    return [members[label == k] for k in range(label.max() + 1)]


def _take_lines(
    rows: _Rows,
    members: NDArray[np.intp],
    min_length: float,
    is_tapered: bool = False,
) -> list[Piece]:
    """Take straight pieces of at least `min_length` radii off the members, best first."""
    if len(members) < MIN_ELLIPSES:
        return []
    e = rows[members]
    width = float(np.median(e.width))
    free = np.ones(len(members), np.bool_)
    inliers = np.empty(len(members), np.bool_)
    pieces: list[Piece] = []
    n_failed = 0
    while free.sum() >= MIN_ELLIPSES and n_failed < 3:
        count = kernels.best_line(
            e.centre, e.axis, e.radius, e.radius_sd, free, N_TRIALS, is_tapered,
            MIN_COS, MAX_OFFSET, MAX_CHANGE, inliers,
        )  # fmt: skip
        if count < MIN_ELLIPSES:
            break
        chosen = np.flatnonzero(inliers)
        model, along = _fit_line(e, chosen, is_tapered)
        # The pair's radius was rough: what is off the piece's own pattern stays free.
        expected = model.radius + model.slope * along
        fits = (
            np.abs(e.radius[chosen] - expected) < SAME_RADIUS * expected + 2 * e.radius_sd[chosen]
        )
        chosen, along = chosen[fits], along[fits]
        if len(chosen) >= MIN_ELLIPSES:
            part = _longest_part(along, max(8 * width, 3 * model.radius))
            chosen, along = chosen[part], along[part]
        too_short = max(min_length * model.radius, 2.5 * width)
        if len(chosen) < MIN_ELLIPSES or np.ptp(along) < too_short:
            n_failed += 1
            free[chosen if len(chosen) else inliers] = False
            continue
        free[chosen] = False
        model, along = _fit_line(e, chosen, is_tapered)
        taper, taper_sd = _taper(e, chosen, along)
        if is_tapered != (abs(taper) > max(MIN_TAPER, 6 * taper_sd)):
            continue
        half = 0.5 * width
        pieces.append(Piece(model, members[chosen], along.min() - half, along.max() + half))
    return pieces


def _taper(e: _Rows, chosen: NDArray[np.intp], along: Array) -> tuple[float, float]:
    """Change of the radius along the axis, and its standard deviation."""
    weight = 1.0 / (e.radius_sd[chosen] ** 2 + 1e-8)
    s = along - (weight @ along) / weight.sum()
    r = e.radius[chosen] - (weight @ e.radius[chosen]) / weight.sum()
    spread = weight @ s**2
    taper = (weight @ (s * r)) / spread
    scatter = np.sqrt((weight @ (r - taper * s) ** 2) / max(len(chosen) - 2, 1) / spread)
    return float(taper), float(scatter)


def _fit_line(e: _Rows, chosen: NDArray[np.intp], is_tapered: bool) -> tuple[LineSurface, Array]:
    """Line through the chosen centres, weighted by their precision; chainages from its middle."""
    weight = 1.0 / (e.radius_sd[chosen] ** 2 + 1e-8)
    weight /= weight.sum()
    centres = e.centre[chosen]
    middle = weight @ centres
    centred = centres - middle
    direction = np.linalg.eigh((weight[:, None] * centred).T @ centred)[1][:, -1]
    along = centred @ direction
    if not is_tapered:
        return LineSurface(middle, direction, _weighted_median(e.radius[chosen], weight)), along
    mean_s, mean_r = weight @ along, weight @ e.radius[chosen]
    slope = (
        weight @ ((along - mean_s) * (e.radius[chosen] - mean_r)) / (weight @ (along - mean_s) ** 2)
    )
    return LineSurface(middle, direction, mean_r - slope * mean_s, slope, is_tapered=True), along


def _weighted_median(values: Array, weights: Array) -> float:
    order = np.argsort(values)
    cumulated = np.cumsum(weights[order])
    return float(values[order[np.searchsorted(cumulated, 0.5 * cumulated[-1])]])


def _longest_part(along: Array, max_gap: float) -> NDArray[np.intp]:
    """Indices of the part with most entries that has no gap longer than `max_gap`."""
    order = np.argsort(along)
    parts = np.split(order, np.flatnonzero(np.diff(along[order]) > max_gap) + 1)
    return max(parts, key=len)


def _take_arcs(rows: _Rows, members: NDArray[np.intp]) -> list[Piece]:
    """Take bends off the members, best first."""
    e = rows[members]
    free = np.ones(len(members), np.bool_)
    inliers = np.empty(len(members), np.bool_)
    arc = np.empty(8)
    pieces: list[Piece] = []
    while free.sum() >= MIN_ELLIPSES:
        count = kernels.best_arc(
            e.centre, e.axis, e.radius, e.radius_sd, free, N_TRIALS,
            MIN_COS, 1.5 * MAX_OFFSET, 1.5 * MAX_CHANGE, inliers, arc,
        )  # fmt: skip
        if count < MIN_ELLIPSES:
            break
        chosen = np.flatnonzero(inliers)
        free[chosen] = False
        straight = np.empty(len(members), np.bool_)
        n_straight = kernels.best_line(
            e.centre, e.axis, e.radius, e.radius_sd, inliers, N_TRIALS, False,
            MIN_COS, MAX_OFFSET, MAX_CHANGE, straight,
        )  # fmt: skip
        if n_straight > MOSTLY_STRAIGHT * count:
            continue
        model = ArcSurface(
            arc[:3].copy(), arc[3:6].copy(), arc[6], float(np.median(e.radius[chosen]))
        )
        low, high, part = arc_extent(model, e.centre[chosen])
        if len(part) < MIN_ELLIPSES or high - low < np.deg2rad(12.0):
            continue
        pieces.append(Piece(model, members[chosen[part]], low, high))
    return pieces


def arc_angles(model: ArcSurface, points: Array) -> Array:
    """Angle of points about the arc's normal, from a fixed direction in its plane, in 0 … 2π."""
    e1 = unit(cross(np.eye(3)[np.argmin(np.abs(model.normal))], model.normal))
    e2 = cross(model.normal, e1)
    q = points - model.centre
    return np.mod(np.arctan2(q @ e2, q @ e1), 2 * np.pi)


def arc_direction(model: ArcSurface, angle: float) -> Array:
    """Unit vector from the centre at an angle of `arc_angles`."""
    e1 = unit(cross(np.eye(3)[np.argmin(np.abs(model.normal))], model.normal))
    return np.asarray(np.cos(angle) * e1 + np.sin(angle) * cross(model.normal, e1))


def arc_extent(model: ArcSurface, points: Array) -> tuple[float, float, NDArray[np.intp]]:
    """Angles between which points lie without a gap of over two radii, and which do."""
    angles = arc_angles(model, points)
    order = np.argsort(angles)
    gaps = np.diff(angles[order], append=angles[order[0]] + 2 * np.pi)
    first = (np.argmax(gaps) + 1) % len(order)
    order = np.roll(order, -first)
    unrolled = np.mod(angles[order] - angles[order[0]], 2 * np.pi)
    parts = np.split(
        np.arange(len(order)),
        np.flatnonzero(np.diff(unrolled) > 2.0 * model.radius / model.bend_radius) + 1,
    )
    part = max(parts, key=len)
    base = angles[order[0]]
    return base + unrolled[part[0]], base + unrolled[part[-1]], order[part]


def find_spheres(ellipses: Ellipses) -> list[Piece]:
    """Find spheres: ellipses whose normals meet in one point far from their planes.

    On a cylinder the normals of a section meet in its own plane; on a sphere those of
    all sections meet in the centre, however far from it they were cut.
    """
    centres, radii = ellipses.meeting_point, ellipses.meeting_distance
    offset = np.einsum("ij,ij->i", ellipses.centre - centres, ellipses.normal) / radii
    free = np.isfinite(radii)
    tree = cKDTree(np.where(free[:, None], centres, 1e9))
    pieces: list[Piece] = []
    may_be = np.flatnonzero(free & (np.abs(offset) > 0.15))
    # Most have hardly a neighbour: counting them all at once is quick.
    n_near = tree.query_ball_point(centres[may_be], SAME_CENTRE * radii[may_be], return_length=True)
    for i in may_be[n_near >= MIN_SPHERE]:
        if not free[i]:
            continue
        near = np.sort(np.array(tree.query_ball_point(centres[i], SAME_CENTRE * radii[i]), np.intp))
        near = near[free[near] & (np.abs(radii[near] - radii[i]) < 0.05 * radii[i])]
        is_far = np.abs(offset[near]) > 0.1
        if is_far.sum() < MIN_SPHERE or np.ptp(offset[near]) < 0.4:
            continue
        model = SphereSurface(np.median(centres[near], axis=0), float(np.median(radii[near])))
        free[near] = False
        pieces.append(Piece(model, near))
    return pieces
