"""What follows the open end of a straight: a bend, and the straight beyond it.

Ellipses on short bends of small pipes are few and poor, and a straight of which little is
seen beyond the bend has none. But a bend begins where a straight ends, along its direction
and with its radius: only the plane in which it turns, its radius and its place are unknown.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipecore._kernels import bend_support as kernels
from pipecore.elements.fittings.straight_ends import NO_ELLIPSES, StraightEnd
from pipecore.elements.proposals import Proposal, arc_angles
from pipecore.elements.refinement.nearby_points import RADIAL_COS, NearbyPoints
from pipecore.elements.refinement.surface_fits import ArcSurface, LineSurface
from pipecore.geometry import cross, unit
from pipecore.robust import sample_evenly

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

REACH_AHEAD_RADII, REACH_ASIDE_RADII = 4.0, 3.0
"""Points are taken up to so many radii ahead of an end and beside its line."""
MAX_POINTS = 400
MIN_POINTS = 20
START_RADII = np.array([-1.0, -0.5, 0.0, 0.5, 1.0])
"""Where the bend may begin, in radii beyond the end: inside the straight, or hidden beyond it."""
BEND_RADII = 1.3 * 1.14 ** np.arange(16.0)
AZIMUTHS = np.deg2rad(np.arange(0.0, 360.0, 15.0))
MAX_BEND_ANGLE = np.deg2rad(100.0)
MIN_BEND_ANGLE, ANGLE_STEP = np.deg2rad(12.0), np.deg2rad(3.0)
MIN_POINT_RATIO = 1.3
"""A bend has at least so many times as many points as the straight would if it went on."""
STRAIGHT_LENGTH_RADII, STRAIGHT_BAND_RADII = 3.0, 0.1
"""Length over which a straight beyond a bend is searched, and largest distance of its points."""


@dataclass(frozen=True, eq=False)
class ViewFromEnd:
    """Points seen from the end of a straight: along it and across, in its radii."""

    place: Array
    normal: Array

    def bent(
        self, start: float, bend_radius: float, azimuth: Array, tolerance: float
    ) -> tuple[Flags, Array]:
        """Which points are on a bend, and their angles along it, shape (azimuths, points)."""
        s, a, b = self.place
        n_s, n_a, n_b = self.normal
        cos, sin = np.cos(azimuth)[:, None], np.sin(azimuth)[:, None]
        s = s - start
        inward, aside = a * cos + b * sin, b * cos - a * sin
        back = inward - bend_radius
        distance = np.hypot(s, back)
        outward = distance - bend_radius
        rho = np.hypot(outward, aside)
        along_normal = (n_s * s + (n_a * cos + n_b * sin) * back) / distance
        cosine = (outward * along_normal + aside * (n_b * cos - n_a * sin)) / rho
        angle = np.arctan2(s, -back)
        on = (np.abs(rho - 1.0) < tolerance) & (np.abs(cosine) > RADIAL_COS)
        on &= (angle > 0) & (angle < min(MAX_BEND_ANGLE, REACH_AHEAD_RADII / bend_radius))
        return on, angle

    def best_of(
        self, starts: Array, bend_radii: Array, azimuths: Array, tolerance: float
    ) -> tuple[int, float, float, float]:
        """The bend that most points are on: how many, its start, bend radius and azimuth."""
        count, i, j, k = kernels.best_follower(
            self.place, self.normal, starts, bend_radii, np.cos(azimuths), np.sin(azimuths),
            tolerance, RADIAL_COS, MAX_BEND_ANGLE, REACH_AHEAD_RADII,
        )  # fmt: skip
        return int(count), float(starts[i]), float(bend_radii[j]), float(azimuths[k])

    def straight_on(self, tolerance: float) -> int:
        """How many points are on the straight if it goes on."""
        s, a, b = self.place
        rho = np.hypot(a, b)
        cosine = (self.normal[1] * a + self.normal[2] * b) / rho
        return int(
            ((np.abs(rho - 1.0) < tolerance) & (np.abs(cosine) > RADIAL_COS) & (s > 0)).sum()
        )


def extend_open_end(
    end: StraightEnd, nearby: NearbyPoints, is_free: Flags
) -> tuple[Proposal, Proposal | None] | None:
    """Search a bend at the end of a straight, and the straight beyond it.

    Parameters
    ----------
    end : StraightEnd
    nearby : NearbyPoints
    is_free : ndarray of bool
        Downsampled points that no element has taken.

    Returns
    -------
    tuple of Proposal and (Proposal or None), or None
        The bend, and the straight beyond it if points show one.
    """
    radius, origin, ahead = end.radius, end.point, end.outward
    side = unit(cross(np.eye(3)[np.argmin(np.abs(ahead))], ahead))
    frame = np.stack([ahead, side, cross(ahead, side)])
    reach = np.hypot(REACH_AHEAD_RADII, REACH_ASIDE_RADII) * radius
    ball = nearby.within_ball(origin, reach)
    ball = ball[is_free[ball] & np.isfinite(nearby.surface.normals[ball, 0])]
    place = frame @ (nearby.surface.xyz[ball] - origin).T / radius
    near = (place[0] > START_RADII[0]) & (np.hypot(place[1], place[2]) < REACH_ASIDE_RADII)
    if near.sum() < MIN_POINTS:
        return None
    rows = sample_evenly(np.flatnonzero(near), MAX_POINTS)
    view = ViewFromEnd(
        np.ascontiguousarray(place[:, rows]),
        np.ascontiguousarray(frame @ nearby.surface.normals[ball[rows]].T),
    )
    tolerance = max(3.0 * nearby.surface.noise / radius, 0.03)
    best = view.best_of(START_RADII, BEND_RADII, AZIMUTHS, tolerance)
    if best[0] < max(MIN_POINTS, MIN_POINT_RATIO * view.straight_on(tolerance)):
        return None
    _, start, bend_radius, azimuth = best
    fine = np.linspace(-1.0, 1.0, 7)
    for share in (1.0, 0.3):
        _, start, bend_radius, azimuth = view.best_of(
            start + share * 0.4 * fine,
            np.maximum(bend_radius * (1.0 + share * 0.15 * fine), 1.05),
            azimuth + share * np.deg2rad(12.0) * fine,
            tolerance,
        )
    inward = np.cos(azimuth) * frame[1] + np.sin(azimuth) * frame[2]
    begin = origin + start * radius * ahead
    bend = ArcSurface(
        begin + bend_radius * radius * inward,
        cross(-inward, ahead),
        float(bend_radius * radius),
        radius,
    )
    on, angle = view.bent(start, bend_radius, np.array([azimuth]), tolerance)
    low = float(arc_angles(bend, begin[None])[0])
    proposal = Proposal(bend, NO_ELLIPSES, low, low + float(np.quantile(angle[on], 0.98)))
    return proposal, _straight_beyond(bend, inward, ahead, nearby, is_free)


def _straight_beyond(
    bend: ArcSurface,
    inward: Array,
    ahead: Array,
    nearby: NearbyPoints,
    is_free: Flags,
) -> Proposal | None:
    """The straight, of those that leave a bend at some angle, that most points are on."""
    radius, half = bend.radius, 0.5 * STRAIGHT_LENGTH_RADII * bend.radius
    tolerance = max(3.0 * nearby.surface.noise, STRAIGHT_BAND_RADII * radius)
    best, most = None, MIN_POINTS - 1
    for turn in np.arange(MIN_BEND_ANGLE, MAX_BEND_ANGLE, ANGLE_STEP):
        direction = np.cos(turn) * ahead + np.sin(turn) * inward
        out = np.sin(turn) * ahead - np.cos(turn) * inward
        model = LineSurface(
            bend.centre + bend.bend_radius * out + half * direction, direction, radius
        )
        on = nearby.on_surface(
            model, model.axis_between(-half, half), 0.0, is_free,
            band=tolerance, depth=radius, min_cos=RADIAL_COS,
        )  # fmt: skip
        if len(on.inliers) > most:
            best, most = Proposal(model, NO_ELLIPSES, -half, half), len(on.inliers)
    return best
