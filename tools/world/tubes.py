"""Curves that pipes follow, and the surfaces about them."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pipecore.geometry import ArcAxis, LineAxis
from tools.world.surfaces import Array, Surface, across, unit

Radius = Callable[[Array, Array], Array]
"""Distance of the surface from the curve (metres) at chainage and angle, each (n,)."""


@dataclass(frozen=True, eq=False)
class Line:
    """A straight line, or one whose points are moved sideways.

    Parameters
    ----------
    start, direction : ndarray
        `direction` is a unit vector.
    length : float
    sideways : callable, optional
        Shift of the section's centre (metres) by chainage, along the first vector of
        `across(direction)`.
    is_sheared : bool
        Whether sections stay square to `direction`; else they are square to the moved curve.
    """

    start: Array
    direction: Array
    length: float
    sideways: Callable[[Array], Array] | None = None
    is_sheared: bool = False

    def at(self, chainage: Array) -> Array:
        points = self.start + np.asarray(chainage)[..., None] * self.direction
        if self.sideways is None:
            return points
        return points + self.sideways(np.asarray(chainage))[..., None] * across(self.direction)[0]

    def frame(self, chainage: Array) -> tuple[Array, Array]:
        """Two unit vectors across the curve, each (n, 3)."""
        first, second = across(self.direction)
        shape = (*np.shape(chainage), 3)
        if self.sideways is None or self.is_sheared:
            return np.broadcast_to(first, shape), np.broadcast_to(second, shape)
        slope = (self.sideways(chainage + 1e-6) - self.sideways(chainage - 1e-6)) / 2e-6
        turned = unit(first - slope[:, None] * self.direction)
        return turned, np.broadcast_to(second, shape)

    @property
    def axis(self) -> LineAxis:
        """The chord of its ends."""
        return LineAxis.between(self.at(np.array(0.0)), self.at(np.array(self.length)))


@dataclass(frozen=True, eq=False)
class Arc:
    """A circular arc from `start` along `direction`, turning towards `inward`.

    `direction` and `inward` are unit vectors at right angles; the angle is in radians.
    """

    start: Array
    direction: Array
    inward: Array
    bend_radius: float
    angle: float

    @property
    def length(self) -> float:
        return self.bend_radius * self.angle

    @property
    def centre(self) -> Array:
        return self.start + self.bend_radius * self.inward

    def _outward(self, chainage: Array) -> Array:
        turn = np.asarray(chainage)[..., None] / self.bend_radius
        return np.sin(turn) * self.direction - np.cos(turn) * self.inward

    def at(self, chainage: Array) -> Array:
        return self.centre + self.bend_radius * self._outward(chainage)

    def tangent(self, chainage: Array) -> Array:
        turn = np.asarray(chainage)[..., None] / self.bend_radius
        return np.cos(turn) * self.direction + np.sin(turn) * self.inward

    def frame(self, chainage: Array) -> tuple[Array, Array]:
        """Outward and along the bend's normal, each (n, 3)."""
        normal = np.cross(self.direction, self.inward)
        outward = self._outward(chainage)
        return outward, np.broadcast_to(-normal, outward.shape)

    @property
    def axis(self) -> ArcAxis:
        normal = np.cross(self.direction, self.inward)
        return ArcAxis(self.centre, normal, -self.inward, self.bend_radius, self.angle)


Curve = Line | Arc


def tube(curve: Curve, radius: Radius) -> Surface:
    """Return the surface at `radius` from a curve: u along it, v around it."""

    def at(u: Array, v: Array) -> Array:
        s, theta = u * curve.length, 2 * np.pi * v
        first, second = curve.frame(s)
        r = radius(s, theta)[:, None]
        return curve.at(s) + r * (np.cos(theta)[:, None] * first + np.sin(theta)[:, None] * second)

    return at


def dome(centre: Array, direction: Array, radius: float, height: float, reach: float) -> Surface:
    """Return an ellipsoid of revolution from its pole down.

    Parameters
    ----------
    centre, direction : ndarray
        The pole lies at `centre` + `height` · `direction`.
    radius, height : float
        Semi-axes across and along `direction`, metres.
    reach : float
        Angle from the pole to the rim, radians: π/2 is half of it, π the whole.
    """
    first, second = across(direction)

    def at(u: Array, v: Array) -> Array:
        polar, theta = reach * u, 2 * np.pi * v
        rho = radius * np.sin(polar)
        side = np.cos(theta)[:, None] * first + np.sin(theta)[:, None] * second
        return centre + height * np.cos(polar)[:, None] * direction + rho[:, None] * side

    return at


def ring_disc(centre: Array, direction: Array, inner: float, outer: float) -> Surface:
    """Return a flat ring whose normal is `direction`."""
    first, second = across(direction)

    def at(u: Array, v: Array) -> Array:
        rho, theta = inner + (outer - inner) * u, 2 * np.pi * v
        side = np.cos(theta)[:, None] * first + np.sin(theta)[:, None] * second
        return centre + rho[:, None] * side

    return at
