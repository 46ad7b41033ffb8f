"""Axes in space: a line, a circular arc or a bowed curve, with chainage and clock position.

Every element of a pipe run has an axis. An axis maps points in space to *pipe
coordinates* (chainage, distance from the axis, clock angle) and back. See
``docs/conventions.md`` for the sign and direction of each.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline

Array = NDArray[np.float64]

N_NEWTON = 4
"""Steps to the foot of a point on a bowed axis; see `pipecore._kernels.pipe_coordinates`."""
VERTICAL_COS = np.cos(np.deg2rad(15.0))
"""An axis within 15 degrees of the vertical counts as vertical: its 12:00 is grid north."""


def unit(vector: ArrayLike) -> Array:
    """Return `vector` scaled to length one.

    Parameters
    ----------
    vector : array_like, shape (n,)

    Returns
    -------
    ndarray, shape (n,)
    """
    v = np.asarray(vector, dtype=np.float64)
    return v / np.linalg.norm(v)


def cross(a: Array, b: Array) -> Array:
    """Return the cross product of two vectors.

    `np.cross` takes fifty times as long for a single pair.

    Parameters
    ----------
    a, b : ndarray, shape (3,)

    Returns
    -------
    ndarray, shape (3,)
    """
    x, y, z = a.tolist()
    u, v, w = b.tolist()
    return np.array([y * w - z * v, z * u - x * w, x * v - y * u])


def twelve_o_clock(tangent: Array) -> Array:
    """Return the unit vector across `tangent` that points to 12:00.

    It is up (+Z) made perpendicular to the tangent; grid north (+Y) for a vertical tangent.

    Parameters
    ----------
    tangent : ndarray, shape (3,)
        Unit vector along an axis.

    Returns
    -------
    ndarray, shape (3,)
    """
    reference = np.array([0.0, 1.0, 0.0] if abs(tangent[2]) > VERTICAL_COS else [0.0, 0.0, 1.0])
    return unit(reference - (reference @ tangent) * tangent)


class Axis(Protocol):
    """What a line and an arc have in common. Lengths in metres, angles in radians."""

    @property
    def length(self) -> float:
        """Length along the axis."""
        ...

    @property
    def start(self) -> Array:
        """Point at chainage zero, shape (3,)."""
        ...

    @property
    def end(self) -> Array:
        """Point at the end, shape (3,)."""
        ...

    def at(self, chainage: ArrayLike) -> Array:
        """Points on the axis at `chainage` (shape (n,) or scalar), shape (n, 3) or (3,).

        Parameters
        ----------
        chainage : array_like
            Metres, shape (n,) or ().

        Returns
        -------
        ndarray
            Local coordinates, shape (n, 3) or (3,).
        """
        ...

    def tangent(self, chainage: ArrayLike) -> Array:
        """Unit tangents towards increasing chainage, shape (n, 3) or (3,).

        Parameters
        ----------
        chainage : array_like
            Metres, shape (n,) or ().

        Returns
        -------
        ndarray
            Shape (n, 3) or (3,).
        """
        ...

    def frame(self, chainage: ArrayLike) -> tuple[Array, Array]:
        """Unit vectors to 12:00 and to 3:00 at `chainage`, each (n, 3) or (3,).

        Parameters
        ----------
        chainage : array_like
            Metres, shape (n,) or ().

        Returns
        -------
        up, aside : ndarray
            Shape (n, 3) or (3,).
        """
        ...

    @property
    def numbers(self) -> Array:
        """The axis as `pipecore._kernels.pipe_coordinates` takes it, one-dimensional."""
        ...

    def pipe_coordinates(self, points: Array) -> tuple[Array, Array, Array]:
        """Chainage, distance from the axis and clock angle of `points` (n, 3), each (n,).

        The chainage may lie outside 0 … length. Clock angles are in [0, 2π).

        Parameters
        ----------
        points : ndarray
            Local coordinates, shape (n, 3).

        Returns
        -------
        chainage, distance, clock : ndarray
            Metres, metres and radians, shape (n,).
        """
        ...

    def reversed(self) -> "Axis":
        """The same axis with chainage counted from its other end."""
        ...

    def part(self, low: float, high: float) -> "Axis":
        """The axis between two chainages, which may lie beyond its ends.

        Parameters
        ----------
        low, high : float
            Metres.

        Returns
        -------
        Axis
        """
        ...

    def moved(self, shift: Array) -> "Axis":
        """The axis moved by a vector.

        Parameters
        ----------
        shift : ndarray
            Metres, shape (3,).

        Returns
        -------
        Axis
        """
        ...


def surface_points(axis: Axis, chainage: ArrayLike, radius: ArrayLike, clock: ArrayLike) -> Array:
    """Points at pipe coordinates; the inverse of `Axis.pipe_coordinates`.

    Parameters
    ----------
    axis : Axis
    chainage, radius, clock : array_like
        Metres, metres and radians; one-dimensional or scalar, broadcast against each other.

    Returns
    -------
    ndarray
        Shape (n, 3), or (3,) for scalars.
    """
    chainage, radius, clock = np.broadcast_arrays(chainage, radius, clock)
    up, right = axis.frame(chainage)
    across = np.cos(clock)[..., None] * up + np.sin(clock)[..., None] * right
    return np.asarray(axis.at(chainage) + np.asarray(radius)[..., None] * across)


def _polar(up_part: Array, right_part: Array) -> tuple[Array, Array]:
    clock = np.mod(np.arctan2(right_part, up_part), 2 * np.pi)
    # A hair before 12:00 rounds to a full turn, which would fall out of any map's last cell.
    return np.hypot(up_part, right_part), np.where(clock < 2 * np.pi, clock, 0.0)


@dataclass(frozen=True, eq=False)
class LineAxis:
    """A straight axis, as a pipe or a reducer has it.

    Parameters
    ----------
    start : ndarray, shape (3,)
        Point at chainage zero.
    direction : ndarray, shape (3,)
        Unit vector towards increasing chainage.
    length : float
        Metres.
    """

    start: Array
    direction: Array
    length: float

    @classmethod
    def between(cls, start: ArrayLike, end: ArrayLike) -> "LineAxis":
        """Return the axis from one point to another.

        Parameters
        ----------
        start, end : array_like
            Local coordinates, shape (3,).

        Returns
        -------
        LineAxis
        """
        a, b = np.asarray(start, dtype=np.float64), np.asarray(end, dtype=np.float64)
        return cls(a, unit(b - a), float(np.linalg.norm(b - a)))

    @property
    def end(self) -> Array:
        """Point at the end, shape (3,)."""
        return self.at(self.length)

    def at(self, chainage: ArrayLike) -> Array:
        """Points on the axis at `chainage`."""
        return np.asarray(self.start + np.asarray(chainage)[..., None] * self.direction)

    def tangent(self, chainage: ArrayLike) -> Array:
        """Unit tangents at `chainage`."""
        return np.broadcast_to(self.direction, (*np.shape(chainage), 3))

    @cached_property
    def _up_right(self) -> tuple[Array, Array]:
        up = twelve_o_clock(self.direction)
        return up, cross(self.direction, up)

    def frame(self, chainage: ArrayLike) -> tuple[Array, Array]:
        """Unit vectors to 12:00 and 3:00 at `chainage`."""
        shape = (*np.shape(chainage), 3)
        up, right = self._up_right
        return np.broadcast_to(up, shape), np.broadcast_to(right, shape)

    @cached_property
    def numbers(self) -> Array:
        """The axis as the kernels take it."""
        up, right = self._up_right
        shape = [0.0, 0.0, 1.0, 0.0, self.length]
        return np.concatenate([self.start, self.direction, up, right, shape])

    def pipe_coordinates(self, points: Array) -> tuple[Array, Array, Array]:
        """Chainage, distance and clock angle of `points` (n, 3)."""
        up, right = self._up_right
        offset = np.asarray(points, dtype=np.float64) - self.start
        return (offset @ self.direction, *_polar(offset @ up, offset @ right))

    def reversed(self) -> "LineAxis":
        """The same axis from its other end.

        Returns
        -------
        LineAxis
        """
        return LineAxis(self.end, -self.direction, self.length)

    def part(self, low: float, high: float) -> "LineAxis":
        """The axis between two chainages."""
        return LineAxis(self.at(low), self.direction, high - low)

    def moved(self, shift: Array) -> "LineAxis":
        """The axis moved by a vector."""
        return LineAxis(self.start + shift, self.direction, self.length)


@dataclass(frozen=True, eq=False)
class ArcAxis:
    """A circular axis, as a bend has it.

    Parameters
    ----------
    centre : ndarray
        Centre of the arc, shape (3,).
    normal : ndarray
        Unit normal of the arc's plane; chainage increases counter-clockwise about it.
    towards_start : ndarray
        Unit vector from the centre to the start, across `normal`.
    bend_radius : float
        Radius of the arc in metres.
    bend_angle : float
        Angle of the arc in radians, 0 to 2π.
    """

    centre: Array
    normal: Array
    towards_start: Array
    bend_radius: float
    bend_angle: float

    @property
    def length(self) -> float:
        """Length along the arc."""
        return self.bend_radius * self.bend_angle

    @property
    def start(self) -> Array:
        """Point at chainage zero."""
        return self.centre + self.bend_radius * self.towards_start

    @property
    def end(self) -> Array:
        """Point at the end."""
        return self.at(self.length)

    @cached_property
    def _ahead_at_start(self) -> Array:
        return cross(self.normal, self.towards_start)

    def _outward(self, chainage: ArrayLike) -> Array:
        angle = np.asarray(chainage)[..., None] / self.bend_radius
        return np.asarray(np.cos(angle) * self.towards_start + np.sin(angle) * self._ahead_at_start)

    def at(self, chainage: ArrayLike) -> Array:
        """Points on the axis at `chainage`."""
        return self.centre + self.bend_radius * self._outward(chainage)

    def tangent(self, chainage: ArrayLike) -> Array:
        """Unit tangents at `chainage`."""
        return np.cross(self.normal, self._outward(chainage))

    @cached_property
    def _clock_of_outward(self) -> float:
        """Clock angle of the extrados, the same all along the bend.

        12:00 is found at the middle of the bend and carried along, so that a clock
        position keeps its meaning (intrados, extrados, side) through the bend.
        """
        middle = self.length / 2
        tangent, outward = self.tangent(middle), self._outward(middle)
        up = twelve_o_clock(tangent)
        return float(np.arctan2(outward @ cross(tangent, up), outward @ up))

    def frame(self, chainage: ArrayLike) -> tuple[Array, Array]:
        """Unit vectors to 12:00 and 3:00 at `chainage`."""
        outward = self._outward(chainage)
        # Clockwise of `outward`, seen along t = normal × outward, lies t × outward = -normal.
        cos, sin = np.cos(self._clock_of_outward), np.sin(self._clock_of_outward)
        return cos * outward + sin * self.normal, sin * outward - cos * self.normal

    @cached_property
    def numbers(self) -> Array:
        """The axis as the kernels take it."""
        cos, sin = np.cos(self._clock_of_outward), np.sin(self._clock_of_outward)
        shape = [self.bend_radius, self.bend_angle / 2, cos, sin, self.length]
        return np.concatenate(
            [self.centre, self.normal, self.towards_start, self._ahead_at_start, shape]
        )

    def pipe_coordinates(self, points: Array) -> tuple[Array, Array, Array]:
        """Chainage, distance and clock angle of `points` (n, 3)."""
        offset = np.asarray(points, dtype=np.float64) - self.centre
        along_start, along_ahead = offset @ self.towards_start, offset @ self._ahead_at_start
        # The cut of the circle is put opposite the middle of the arc.
        half = self.bend_angle / 2
        angle = np.arctan2(along_ahead, along_start) - half
        angle = half + np.mod(angle + np.pi, 2 * np.pi) - np.pi
        outward_part = np.hypot(along_start, along_ahead) - self.bend_radius
        side_part = -(offset @ self.normal)
        cos, sin = np.cos(self._clock_of_outward), np.sin(self._clock_of_outward)
        rho, clock = _polar(
            cos * outward_part - sin * side_part, sin * outward_part + cos * side_part
        )
        return angle * self.bend_radius, rho, clock

    def reversed(self) -> "ArcAxis":
        """The same axis from its other end.

        Returns
        -------
        ArcAxis
        """
        return ArcAxis(
            self.centre,
            -self.normal,
            self._outward(self.length),
            self.bend_radius,
            self.bend_angle,
        )

    def part(self, low: float, high: float) -> "ArcAxis":
        """The axis between two chainages."""
        return ArcAxis(
            self.centre,
            self.normal,
            self._outward(low),
            self.bend_radius,
            (high - low) / self.bend_radius,
        )

    def moved(self, shift: Array) -> "ArcAxis":
        """The axis moved by a vector."""
        return ArcAxis(
            self.centre + shift,
            self.normal,
            self.towards_start,
            self.bend_radius,
            self.bend_angle,
        )


def _spline(at: Array, values: Array) -> "CubicSpline":
    from scipy.interpolate import CubicSpline  # noqa: PLC0415 - few axes are curves

    return CubicSpline(at, values)


N_PIECES = 16
"""Pieces of a bowed axis that is cut out of another."""


@dataclass(frozen=True, eq=False)
class CurveAxis:
    """A bowed axis, as a sagging, bent or kinked pipe has it: offsets from the chord of its ends.

    Cubic splines of the distance along the chord; beyond its ends it goes on straight.

    Parameters
    ----------
    start, end : ndarray
        Ends of the chord, which are those of the axis, shape (3,).
    up, right : ndarray
        Offsets to 12:00 and 3:00 of the chord at equal steps along it, metres, shape (n + 1,);
        zero at both ends.
    """

    start: Array
    end: Array
    up: Array
    right: Array

    @classmethod
    def through(cls, points: Array, n_pieces: int = N_PIECES) -> "CurveAxis":
        """Return the axis through points that follow each other from end to end.

        Parameters
        ----------
        points : ndarray
            Local coordinates, shape (m, 3); they advance along the chord of the first and last.
        n_pieces : int

        Returns
        -------
        CurveAxis
        """
        chord = LineAxis.between(points[0], points[-1])
        up, right = chord.frame(0.0)
        offset = points - chord.start
        along = offset @ chord.direction
        knots = np.linspace(0.0, chord.length, n_pieces + 1)
        across = _spline(along, np.stack([offset @ up, offset @ right], axis=1))(knots)
        across[[0, -1]] = 0.0
        return cls(chord.start, chord.end, across[:, 0], across[:, 1])

    @cached_property
    def chord(self) -> LineAxis:
        """The straight line from end to end."""
        return LineAxis.between(self.start, self.end)

    @property
    def bow(self) -> float:
        """Largest distance from the chord at the steps along it, metres."""
        return float(np.hypot(self.up, self.right).max())

    @cached_property
    def _spline(self) -> "CubicSpline":
        knots = np.linspace(0.0, self.chord.length, len(self.up))
        return _spline(knots, np.stack([self.up, self.right], axis=1))

    @cached_property
    def _chainage_at_knots(self) -> Array:
        """Length of the curve up to each step, by Simpson's rule over each piece."""
        knots = self._spline.x
        middles = (knots[1:] + knots[:-1]) / 2
        at_knots, at_middles = (
            np.sqrt(1.0 + np.square(self._spline(t, 1)).sum(axis=1)) for t in (knots, middles)
        )
        pieces = np.diff(knots) * (at_knots[:-1] + 4 * at_middles + at_knots[1:]) / 6
        return np.concatenate([[0.0], np.cumsum(pieces)])

    @property
    def length(self) -> float:
        """Length along the curve."""
        return float(self._chainage_at_knots[-1])

    def _along_chord(self, chainage: ArrayLike) -> Array:
        """Distance along the chord at `chainage`, the latter even within each piece."""
        s, at_knots = np.asarray(chainage, np.float64), self._chainage_at_knots
        k = np.clip(np.searchsorted(at_knots, s, side="right") - 1, 0, len(at_knots) - 2)
        size = self.chord.length / (len(at_knots) - 1)
        return np.asarray(k * size + (s - at_knots[k]) * size / np.diff(at_knots)[k])

    def _offsets(self, t: Array, derivative: int = 0) -> Array:
        """Offsets from the chord or their derivatives, shape (…, 2)."""
        inside = np.clip(t, 0.0, self.chord.length)
        beyond = (t - inside)[..., None]
        values = self._spline(inside, derivative)
        if derivative == 0:
            return np.asarray(values + beyond * self._spline(inside, 1))
        return np.asarray(np.where(beyond != 0.0, 0.0, values) if derivative > 1 else values)

    def _place(self, t: Array) -> Array:
        up, right = self.chord.frame(t)
        across = self._offsets(t)
        return self.chord.at(t) + across[..., :1] * up + across[..., 1:] * right

    def at(self, chainage: ArrayLike) -> Array:
        """Points on the axis at `chainage`."""
        return self._place(self._along_chord(chainage))

    def _tangent_at(self, t: Array) -> Array:
        up, right = self.chord.frame(t)
        slope = self._offsets(t, 1)
        ahead = self.chord.direction + slope[..., :1] * up + slope[..., 1:] * right
        return np.asarray(ahead / np.linalg.norm(ahead, axis=-1, keepdims=True))

    def _frame_at(self, t: Array) -> tuple[Array, Array]:
        """12:00 of the chord made perpendicular to the tangent, and 3:00."""
        tangent = self._tangent_at(t)
        up, _ = self.chord.frame(t)
        across = up - (up * tangent).sum(axis=-1, keepdims=True) * tangent
        across = across / np.linalg.norm(across, axis=-1, keepdims=True)
        return across, np.cross(tangent, across)

    def tangent(self, chainage: ArrayLike) -> Array:
        """Unit tangents at `chainage`."""
        return self._tangent_at(self._along_chord(chainage))

    def frame(self, chainage: ArrayLike) -> tuple[Array, Array]:
        """Unit vectors to 12:00 and 3:00 at `chainage`."""
        return self._frame_at(self._along_chord(chainage))

    @cached_property
    def numbers(self) -> Array:
        """The axis as the kernels take it."""
        up, right = self.chord.frame(0.0)
        n, at_knots = len(self.up) - 1, self._chainage_at_knots
        shape = [-float(n), self.chord.length, 0.0, 0.0, self.length]
        size = self.chord.length / n
        # The highest power comes first in SciPy, last here.
        cubic = self._spline.c[::-1]
        pieces = np.concatenate(
            [
                cubic[:, :, 0].T,
                cubic[:, :, 1].T,
                at_knots[:-1, None],
                np.diff(at_knots)[:, None] / size,
            ],
            axis=1,
        )
        line = [self.start, self.chord.direction, up, right, shape]
        return np.concatenate([*line, pieces.ravel()])

    def pipe_coordinates(self, points: Array) -> tuple[Array, Array, Array]:
        """Chainage, distance and clock angle of `points` (n, 3)."""
        xyz = np.asarray(points, dtype=np.float64)
        chord = self.chord
        up, right = chord.frame(0.0)
        offset = xyz - chord.start
        along, across = offset @ chord.direction, np.stack([offset @ up, offset @ right], axis=-1)
        t = along
        for _ in range(N_NEWTON):
            left, slope = across - self._offsets(t), self._offsets(t, 1)
            bent = 1.0 + (slope * slope - left * self._offsets(t, 2)).sum(axis=-1)
            t = t + (along - t + (left * slope).sum(axis=-1)) / np.maximum(bent, 0.2)
        off = xyz - self._place(t)
        up_here, right_here = self._frame_at(t)
        at_knots, size = self._chainage_at_knots, chord.length / (len(self.up) - 1)
        k = np.clip(np.floor(t / size).astype(np.intp), 0, len(self.up) - 2)
        chainage = at_knots[k] + (t - k * size) * np.diff(at_knots)[k] / size
        return (
            chainage,
            *_polar((off * up_here).sum(axis=-1), (off * right_here).sum(axis=-1)),
        )

    def reversed(self) -> "CurveAxis":
        """The same axis from its other end.

        Returns
        -------
        CurveAxis
        """
        # From there 12:00 is the same, and 3:00 is on the other side.
        return CurveAxis(self.end, self.start, self.up[::-1], -self.right[::-1])

    def part(self, low: float, high: float) -> "CurveAxis":
        """The axis between two chainages."""
        share = (high - low) / self.length
        n_pieces = max(4, round(share * (len(self.up) - 1)))
        return CurveAxis.through(self.at(np.linspace(low, high, 8 * n_pieces + 1)), n_pieces)

    def moved(self, shift: Array) -> "CurveAxis":
        """The axis moved by a vector."""
        return CurveAxis(self.start + shift, self.end + shift, self.up, self.right)


AnyAxis = LineAxis | ArcAxis | CurveAxis
"""What an element's axis may be."""


def offsets_from_chord(axis: AnyAxis, chainage: Array) -> Array:
    """Return how far an axis lies off the chord of its ends, to 12:00 and 3:00 of the chord.

    Parameters
    ----------
    axis : AnyAxis
    chainage : ndarray
        Metres, shape (n,).

    Returns
    -------
    ndarray
        Metres, shape (n, 2); zero for a straight axis, and for a bend, which is to be one.
    """
    if not isinstance(axis, CurveAxis):
        return np.zeros((len(chainage), 2))
    up, right = axis.chord.frame(0.0)
    offset = axis.at(chainage) - axis.start
    return np.stack([offset @ up, offset @ right], axis=1)
