"""Proposals: surfaces that explain the ellipses of a chain: cylinder, reducer, bend or sphere.

The paper classifies by the shape of the axis (line or arc) and by the pattern of the
radius along it (constant, linear, semicircle; figure 7). Here each pattern is a model,
and in every chain of centres the model that explains most ellipses is removed first, then
the next.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from pipecore._kernels.arc_search import best_arc
from pipecore._kernels.line_search import AxisEllipses, PieceLimits, best_line, take_lines
from pipecore.axes import join_centres
from pipecore.elements.refinement.surface_fits import ArcSurface, LineSurface, SphereSurface
from pipecore.ellipses import Ellipses
from pipecore.geometry import cross, unit
from pipecore.parallel import for_chunks
from pipecore.progress import NoProgress, Progress

Array = NDArray[np.float64]

N_TRIALS = 400
MIN_COS = float(np.cos(np.deg2rad(12.0)))
MAX_OFFSET = 0.06
"""A centre is off the axis by less than this share of the radius."""
MAX_CHANGE = 0.06
"""A radius is off the pattern by less than this share."""
SAME_RADIUS = 0.025
"""Radii of one proposal differ from its pattern by less than this share (and twice their SD)."""
MIN_ELLIPSES = 5
MAX_STRAIGHT_SHARE = 0.7
"""What is a bend only at its ends is a straight, such as a vessel between its heads."""
MIN_SPHERE_ELLIPSES = 8
"""Ellipses cut off its centre that make a sphere."""
MAX_CENTRE_OFFSET = 0.06
"""Normals of a sphere's sections meet within this share of its radius."""
MIN_TAPER = 0.04
LONG_STRAIGHT_RADII = 2.5
"""Straights of this many radii are taken first: shorter ones may be part of a bend."""
SHORT_STRAIGHT_RADII = 0.5
CHAINS_AT_ONCE = 64


@dataclass(frozen=True, eq=False)
class Proposal:
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

    @property
    def length(self) -> float:
        """Extent along the axis, in the unit of `low` and `high`."""
        return self.high - self.low


@dataclass(frozen=True, eq=False)
class _Rows:
    """Columns of the ellipses from which proposals are made."""

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

    @property
    def on_axis(self) -> AxisEllipses:
        """As the kernels take them."""
        return AxisEllipses(self.centre, self.axis, self.radius, self.radius_sd)


def propose_surfaces(
    ellipses: Ellipses, chain: NDArray[np.int32], progress: Progress
) -> list[Proposal]:
    """Propose spheres, straight pipes, reducers and bends that explain the ellipses.

    Parameters
    ----------
    ellipses : Ellipses
    chain : ndarray of int32
        Chain of each ellipse.
    progress : Progress

    Returns
    -------
    list of Proposal
        Spheres first, then chain by chain.
    """
    order = np.argsort(chain, kind="stable")
    rows = _Rows(
        ellipses.centre, ellipses.axis, ellipses.radius, ellipses.radius_sd, ellipses.width
    )
    chains = np.split(order, np.flatnonzero(np.diff(chain[order])) + 1)
    chains = [members for members in chains if len(members) >= MIN_ELLIPSES]
    found: list[list[Proposal]] = [[] for _ in chains]

    def explain(first: int, last: int) -> None:
        for i in range(first, last):
            found[i] = _explain_chain(ellipses, rows, chains[i])

    for_chunks(explain, len(chains), CHAINS_AT_ONCE, "elements", progress, (0.0, 0.3))
    return [*find_spheres(ellipses), *(proposal for proposals in found for proposal in proposals)]


def _explain_chain(ellipses: Ellipses, rows: _Rows, members: NDArray[np.intp]) -> list[Proposal]:
    proposals, members = _take_lines(rows, members, LONG_STRAIGHT_RADII)
    tapered, members = _take_lines(rows, members, SHORT_STRAIGHT_RADII, is_tapered=True)
    proposals += tapered
    for group in _reconnected(ellipses, members):
        arcs = _take_arcs(rows, group)
        proposals += arcs
        for proposal in arcs:
            members = np.setdiff1d(members, proposal.ellipses)
    return proposals + _take_lines(rows, members, SHORT_STRAIGHT_RADII)[0]


def _reconnected(ellipses: Ellipses, members: NDArray[np.intp]) -> list[NDArray[np.intp]]:
    """Groups of members whose centres are still chained."""
    if len(members) < MIN_ELLIPSES:
        return []
    label = join_centres(ellipses[members], NoProgress())
    return [members[label == k] for k in range(label.max() + 1)]


def _take_lines(
    rows: _Rows,
    members: NDArray[np.intp],
    min_length: float,
    is_tapered: bool = False,
) -> tuple[list[Proposal], NDArray[np.intp]]:
    """Take straights of at least `min_length` radii from the members, best first.

    Returns the straights and the members that are left.
    """
    if len(members) < MIN_ELLIPSES:
        return [], members
    e = rows[members]
    number = np.empty(len(members), np.int32)
    limits = PieceLimits(
        MIN_COS, MAX_OFFSET, MAX_CHANGE, SAME_RADIUS, MIN_TAPER, min_length, MIN_ELLIPSES
    )
    lines = take_lines(e.on_axis, N_TRIALS, is_tapered, limits, float(np.median(e.width)), number)
    proposals = [
        Proposal(
            LineSurface(line[:3].copy(), line[3:6].copy(), line[6], line[7], is_tapered),
            members[number == k],
            line[8],
            line[9],
        )
        for k, line in enumerate(lines)
    ]
    return proposals, members[number < 0]


def _take_arcs(rows: _Rows, members: NDArray[np.intp]) -> list[Proposal]:
    """Take bends from the members, best first."""
    e = rows[members]
    free = np.ones(len(members), np.bool_)
    inliers = np.empty(len(members), np.bool_)
    arc = np.empty(8)
    proposals: list[Proposal] = []
    while free.sum() >= MIN_ELLIPSES:
        limits = PieceLimits(MIN_COS, 1.5 * MAX_OFFSET, 1.5 * MAX_CHANGE)
        count = best_arc(e.on_axis, free, N_TRIALS, limits, inliers, arc)
        if count < MIN_ELLIPSES:
            break
        chosen = np.flatnonzero(inliers)
        free[chosen] = False
        straight = np.empty(len(members), np.bool_)
        limits = PieceLimits(MIN_COS, MAX_OFFSET, MAX_CHANGE)
        n_straight = best_line(e.on_axis, inliers, N_TRIALS, False, limits, straight)
        if n_straight > MAX_STRAIGHT_SHARE * count:
            continue
        model = ArcSurface(
            arc[:3].copy(), arc[3:6].copy(), arc[6], float(np.median(e.radius[chosen]))
        )
        low, high, part = arc_extent(model, e.centre[chosen])
        if len(part) < MIN_ELLIPSES or high - low < np.deg2rad(12.0):
            continue
        proposals.append(Proposal(model, members[chosen[part]], low, high))
    return proposals


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


def find_spheres(ellipses: Ellipses) -> list[Proposal]:
    """Find spheres: ellipses whose normals meet in one point far from their planes.

    On a cylinder the normals of a section meet in its own plane; on a sphere those of
    all sections meet in the centre, however far from it they were cut.
    """
    centres, radii = ellipses.meeting_point, ellipses.meeting_distance
    offset = np.einsum("ij,ij->i", ellipses.centre - centres, ellipses.normal) / radii
    free = np.isfinite(radii)
    tree = cKDTree(np.where(free[:, None], centres, 1e9))
    proposals: list[Proposal] = []
    may_be = np.flatnonzero(free & (np.abs(offset) > 0.15))
    # Most have hardly a neighbour: counting them all at once is quick.
    n_near = tree.query_ball_point(
        centres[may_be], MAX_CENTRE_OFFSET * radii[may_be], return_length=True
    )
    for i in may_be[n_near >= MIN_SPHERE_ELLIPSES]:
        if not free[i]:
            continue
        near = np.sort(
            np.array(tree.query_ball_point(centres[i], MAX_CENTRE_OFFSET * radii[i]), np.intp)
        )
        near = near[free[near] & (np.abs(radii[near] - radii[i]) < 0.05 * radii[i])]
        is_far = np.abs(offset[near]) > 0.1
        if is_far.sum() < MIN_SPHERE_ELLIPSES or np.ptp(offset[near]) < 0.4:
            continue
        model = SphereSurface(np.median(centres[near], axis=0), float(np.median(radii[near])))
        free[near] = False
        proposals.append(Proposal(model, near))
    return proposals
