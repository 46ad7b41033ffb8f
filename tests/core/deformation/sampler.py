"""Scans of one pipe by formula: rays of parallel beams on a deformed surface, with clutter.

Quicker than ray casting and independent of the simulator, so that hundreds of random
pipes can be measured. Stations are far away: each sees the pipe along one direction.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from pipecore.geometry import ArcAxis, Array, LineAxis, surface_points, unit
from pipecore.types import Element, ElementKind

NAN3 = np.full(3, np.nan)
Shape = Callable[[Array, Array], Array]
"""Radial deviation in metres at (chainage, clock), outward positive."""


def bump(s0: float, clock: float, height: float, *, length: float, width: float, r: float) -> Shape:
    """A cosine bell over an ellipse: `length` along, `width` around (metres), signed height."""

    def deviation(s: Array, theta: Array) -> Array:
        turn = np.mod(theta - clock + np.pi, 2 * np.pi) - np.pi
        rho = np.hypot(2 * (s - s0) / length, 2 * turn * r / width)
        return height * np.cos(np.pi / 2 * np.minimum(rho, 1)) ** 2

    return deviation


def oval(start: float, end: float, ratio: float, clock: float, r: float) -> Shape:
    """A stretch whose (Dmax - Dmin) / Dnom is `ratio`, with ends of 0.1 m."""

    def deviation(s: Array, theta: Array) -> Array:
        x = np.clip(np.minimum(s - start, end - s) / 0.1, 0, 1)
        return ratio / 2 * r * x * x * (3 - 2 * x) * np.cos(2 * (theta - clock))

    return deviation


@dataclass
class PipeScan:
    """What `find_deformations` is given, and which points are truly the pipe's."""

    element: Element
    xyz: Array
    normals: Array
    is_own: NDArray[np.bool_]
    neighbours: list[Element] = field(default_factory=list)


@dataclass
class PipeScene:
    """A pipe to be scanned; `views` are clock angles that the stations look from."""

    radius: float = 0.1
    length: float = 2.0
    views: tuple[float, ...] = (0.0,)
    shapes: list[Shape] = field(default_factory=list)
    sag: Callable[[Array], Array] | None = None
    arc: float = np.deg2rad(165)
    spacing: float = 0.01
    noise: float = 0.002
    bend_radius: float = 0.0
    radius_end: float = 0.0
    flanges: bool = False
    elbow: bool = False
    post: bool = False
    crossing: bool = False
    crossing_known: bool = False
    mixed: bool = False
    axis_error: float = 0.0003

    def scan(self, rng: np.random.Generator) -> PipeScan:
        """Scan the pipe in a random pose."""
        axis = self._axis(rng)
        clouds, owns = [], []
        for view in self.views:
            xyz, own = self._see(axis, view, rng)
            clouds.append(xyz)
            owns.append(own)
        xyz, is_own = np.concatenate(clouds), np.concatenate(owns)
        element = self._element(axis, rng)
        chainage, distance, _ = element.axis.pipe_coordinates(xyz)
        near = (distance > 0.4 * self.radius) & (distance < 1.3 * self.radius)
        near &= (chainage > -self.radius) & (chainage < axis.length + self.radius)
        normals = plane_normals(xyz)[near]
        neighbours = []
        if self.crossing and self.crossing_known:
            neighbours.append(self._crossing_element(axis))
        return PipeScan(element, xyz[near], normals, is_own[near], neighbours)

    def _axis(self, rng: np.random.Generator) -> LineAxis | ArcAxis:
        start, direction = rng.uniform(-5, 5, 3), unit(rng.normal(size=3))
        if self.bend_radius:
            towards = unit(np.cross(direction, rng.normal(size=3)))
            angle = self.length / self.bend_radius
            return ArcAxis(start, direction, towards, self.bend_radius, angle)
        return LineAxis(start, direction, self.length)

    def _element(self, axis: LineAxis | ArcAxis, rng: np.random.Generator) -> Element:
        error = self.axis_error
        if isinstance(axis, LineAxis):
            start = axis.start + error * rng.normal(size=3)
            axis = LineAxis.between(start, axis.end + error * rng.normal(size=3))
        kind = ElementKind.TORUS if self.bend_radius else ElementKind.CYLINDER
        if self.radius_end:
            kind = ElementKind.CONE
        radius = self.radius + error * rng.normal()
        end = self.radius_end or radius
        arc = min(2 * np.pi, self.arc * len(self.views))
        return Element(1, 1, kind, axis, radius, error, end, NAN3, 0, 0, arc, self.noise)

    def _radius(self, s: Array, theta: Array) -> Array:
        base = self.radius + ((self.radius_end or self.radius) - self.radius) * s / self.length
        for shape in self.shapes:
            base = base + shape(s, theta)
        return base

    def _see(
        self, axis: LineAxis | ArcAxis, view: float, rng: np.random.Generator
    ) -> tuple[Array, NDArray[np.bool_]]:
        """Points that a station sees from far away at the clock angle `view`."""
        # Rows of evenly spaced rays; a row sees the pipe at x = r sin(angle from the view).
        rows = np.arange(rng.uniform(0, self.spacing), self.length, self.spacing)
        n_across = int(2 * self.radius / self.spacing) + 1
        x = self.spacing * (np.arange(n_across) + rng.uniform(0, 1, (len(rows), 1))) - self.radius
        s = np.repeat(rows, n_across) + 0.1 * self.spacing * rng.normal(size=x.size)
        inside = (np.abs(x.ravel()) < self.radius) & (s > 0) & (s < self.length)
        s, theta = s[inside], view + np.arcsin(x.ravel()[inside] / self.radius)
        to_station = surface_points(axis, self.length / 2, 1.0, view) - axis.at(self.length / 2)
        tilt = rng.uniform(-0.4, 0.4)
        to_station = unit(to_station + tilt * axis.tangent(self.length / 2))
        p = surface_points(axis, s, self._radius(s, theta), theta)
        along = surface_points(axis, s + 1e-4, self._radius(s + 1e-4, theta), theta) - p
        around = surface_points(axis, s, self._radius(s, theta + 1e-3), theta + 1e-3) - p
        normal = np.cross(around, along)
        normal /= np.linalg.norm(normal, axis=1)[:, None]
        normal *= np.sign(np.sum(normal * (p - axis.at(s)), axis=1))[:, None]
        cos = normal @ to_station
        lit = cos > np.cos(self.arc / 2)
        p, s = p[lit], s[lit]
        if self.sag is not None:
            up, _ = axis.frame(s)
            p = p + self.sag(s)[:, None] * up
        own = np.ones(len(p), bool)

        clutter, blockers = self._clutter(axis, to_station, rng)
        for blocker_axis, blocker_radius in blockers:
            hidden = _is_hidden(p, to_station, blocker_axis, blocker_radius)
            p, own = p[~hidden], own[~hidden]
        if len(clutter) and isinstance(axis, LineAxis):
            hidden = _is_hidden(clutter, to_station, axis, self.radius)
            clutter = clutter[~hidden]
        if self.mixed:
            # At the limb a part of the beam goes on past the pipe to what lies behind.
            s_p, rho, theta_p = axis.pipe_coordinates(p)
            turn = np.mod(theta_p - view + np.pi, 2 * np.pi) - np.pi
            edge = (np.abs(turn) > self.arc / 2 - 0.15) & (rng.uniform(size=len(p)) < 0.3)
            limb = view + np.sign(turn) * np.pi / 2
            grazing = surface_points(axis, s_p, rho + rng.uniform(0, 0.002, len(p)), limb)
            back = rng.exponential(0.03, len(p))[:, None] * to_station
            p, own = np.where(edge[:, None], grazing - back, p), own & ~edge
        p = np.concatenate([p, clutter])
        own = np.concatenate([own, np.zeros(len(clutter), bool)])
        p = p + self.noise * rng.normal(size=len(p))[:, None] * to_station
        return p, own

    def _contact(self, axis: LineAxis | ArcAxis, turn: float) -> tuple[Array, Array, Array]:
        """Point, outward and along of a contact that lies `turn` from the first view."""
        s, clock = 0.6 * self.length, self.views[0] + turn
        outward = surface_points(axis, s, 1.0, clock) - axis.at(s)
        return axis.at(s) + self.radius * outward, outward, axis.tangent(s)

    def _crossing_element(self, axis: LineAxis | ArcAxis) -> Element:
        at, outward, along = self._contact(axis, 0.9)
        r = 0.7 * self.radius
        across = np.cross(outward, along)
        line = LineAxis.between(at + r * outward - across, at + r * outward + across)
        return Element(2, 2, ElementKind.CYLINDER, line, r, 3e-4, r, NAN3, 0, 0, 2.5, self.noise)

    def _clutter(
        self, axis: LineAxis | ArcAxis, to_station: Array, rng: np.random.Generator
    ) -> tuple[Array, list[tuple[LineAxis, float]]]:
        parts: list[Array] = []
        blockers: list[tuple[LineAxis, float]] = []
        density = 1 / self.spacing**2

        def add(points: Array, normal: Array) -> None:
            cos = np.abs(np.broadcast_to(normal, points.shape) @ to_station)
            facing = np.broadcast_to(normal, points.shape) @ to_station > 0
            parts.append(points[facing & (rng.uniform(size=len(points)) < cos)])

        r = self.radius
        if self.post:  # a box whose top touches the pipe
            # Just out of the station's sight; what stands out beyond is in it.
            at, outward, along = self._contact(axis, 1.75)
            across = np.cross(outward, along)
            n = int(0.1 * 0.3 * density)
            u, v = rng.uniform(-0.05, 0.05, n), rng.uniform(-0.15, 0.15, n)
            add(at + u[:, None] * along + v[:, None] * across, -outward)
            v = rng.uniform(0, 0.5 * r, n)
            w = rng.uniform(-0.15, 0.15, n)
            for side in (-1, 1):
                edge = at + side * 0.05 * along
                add(edge + v[:, None] * outward + w[:, None] * across, side * along)
        if self.crossing:
            line = self._crossing_element(axis).axis
            assert isinstance(line, LineAxis)
            r2 = 0.7 * r
            n = int(2 * np.pi * r2 * line.length * density)
            s, theta = rng.uniform(0, line.length, n), rng.uniform(0, 2 * np.pi, n)
            p = surface_points(line, s, r2, theta)
            add(p, (p - line.at(s)) / r2)
            blockers.append((line, r2))
        if self.flanges:
            for s, side in ((0.0, -1.0), (self.length, 1.0)):
                n = int(np.pi * (1.6 * r) ** 2 * density)
                rho, theta = np.sqrt(rng.uniform(1, 1.6**2, n)) * r, rng.uniform(0, 2 * np.pi, n)
                t = np.asarray(axis.tangent(s))
                add(surface_points(axis, np.full(n, s), rho, theta), -side * t)
                # A weld neck: a hub that rises towards the flange.
                h = rng.uniform(0, 0.25 * r, n)
                chainage = s - side * h
                p = surface_points(axis, chainage, r * (1.25 - h / r), theta)
                out = surface_points(axis, chainage, 1.0, theta) - axis.at(chainage)
                add(p, unit_rows(out - side * t))
        if self.elbow:
            t = np.asarray(axis.tangent(self.length))
            towards = unit(np.cross(t, rng.normal(size=3)))
            bend = ArcAxis(
                np.asarray(axis.end) - 3 * r * towards, np.cross(towards, t), towards, 3 * r, 1.2
            )
            n = int(2 * np.pi * r * 4.6 * r * density)
            s, theta = rng.uniform(0, bend.length, n), rng.uniform(0, 2 * np.pi, n)
            p = surface_points(bend, s, r, theta)
            add(p, (p - bend.at(s)) / r)
        return (np.concatenate(parts) if parts else np.empty((0, 3))), blockers


def unit_rows(v: Array) -> Array:
    return np.asarray(v / np.linalg.norm(v, axis=1, keepdims=True))


def _is_hidden(p: Array, to_station: Array, axis: LineAxis, radius: float) -> NDArray[np.bool_]:
    """Whether a pipe stands between the points and the station."""
    across = np.cross(to_station, axis.direction)
    size = float(np.linalg.norm(across))
    offset = p - axis.start
    miss = np.abs(offset @ across) / size
    # Where along the ray it passes the axis: only what stands in front hides.
    ahead = -(offset - (offset @ axis.direction)[:, None] * axis.direction) @ to_station
    along = offset @ axis.direction
    inside = (along > 0) & (along < axis.length)
    return np.asarray((miss < 0.97 * radius) & (ahead > 0.1 * radius) & inside)


def plane_normals(xyz: Array, reach: float = 0.028) -> Array:
    """Normals by PCA of the neighbours within `reach`, nan where there are fewer than five."""
    tree = cKDTree(xyz)
    distance, index = tree.query(xyz, k=16, distance_upper_bound=reach)
    near = np.isfinite(distance)
    index = np.where(near, index, 0)
    n = near.sum(axis=1)
    q = xyz[index] * near[..., None]
    mean = q.sum(axis=1) / n[:, None]
    d = (xyz[index] - mean[:, None, :]) * near[..., None]
    _, vectors = np.linalg.eigh(np.einsum("nki,nkj->nij", d, d))
    normals = vectors[:, :, 0]
    normals[n < 5] = np.nan
    return normals
