"""One profile in its own plane: points, ellipse, smooth curve, undeformed contour.

Coordinates in the plane are metres; looking along the chainage, u points to 3:00 and v
to 12:00.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pipecore.geometry import Array, twelve_o_clock
from pipecore.reasons import Reason
from pipecore.types import Element, Profiles

if TYPE_CHECKING:
    from pipecore.deformation.section_curve import SectionCurve

MAX_OFFSET_RADII = 0.25
"""A profile seen over less than half its section has the pipe's radius only if its centre
lies this near to the element's axis, in radii."""


@dataclass(frozen=True, eq=False)
class SectionEllipse:
    """An ellipse in a profile's plane.

    Parameters
    ----------
    centre_uv : tuple of float
        Metres.
    semi_major, semi_minor : float
        Metres.
    angle : float
        Of the major axis, radians, counter-clockwise from u.
    """

    centre_uv: tuple[float, float]
    semi_major: float
    semi_minor: float
    angle: float

    def rays(self, points_uv: Array) -> tuple[Array, Array, Array]:
        """Return the rays from the ellipse's centre through points of the plane.

        Parameters
        ----------
        points_uv : ndarray, shape (n, 2)
            Metres.

        Returns
        -------
        direction : ndarray, shape (n, 2)
            Unit vectors.
        distance : ndarray, shape (n,)
            Of the points from the centre, metres.
        on_ellipse : ndarray, shape (n,)
            Distance at which each ray meets the ellipse, metres.
        """
        offset = points_uv - np.asarray(self.centre_uv)
        distance = np.linalg.norm(offset, axis=1)
        direction = offset / np.maximum(distance, 1e-12)[:, None]
        cos, sin = np.cos(self.angle), np.sin(self.angle)
        along = direction @ np.array([cos, sin]) / self.semi_major
        across = direction @ np.array([-sin, cos]) / self.semi_minor
        return direction, distance, 1 / np.maximum(np.hypot(along, across), 1e-12)

    def deviation(self, points_uv: Array) -> Array:
        """Return how far points (n, 2) lie beyond the ellipse along the ray from its centre."""
        _, distance, on_ellipse = self.rays(points_uv)
        return distance - on_ellipse

    def clock(self, points_uv: Array) -> Array:
        """Return the clock angles 0 … 2π of points (n, 2) about the ellipse's centre, radians."""
        u, v = (points_uv - np.asarray(self.centre_uv)).T
        return np.asarray(np.mod(np.arctan2(u, v), 2 * np.pi))


@dataclass(frozen=True, eq=False)
class Section:
    """A profile of an element in its own plane.

    Parameters
    ----------
    profile : Profiles
        The profile, a table of one row.
    points_uv : ndarray, shape (n, 2)
        Its points relative to the centre of its ellipse, metres.
    fitted : SectionEllipse
        Its own ellipse.
    reference : SectionEllipse
        The element's undeformed contour in this plane.
    nominal : SectionEllipse, optional
        The contour of the nominal size, about the same axis.
    curve : SectionCurve, optional
        The smooth curve through the points, about the centre of `reference`.
    no_curve : Reason
        Why there is none.
    """

    profile: Profiles
    points_uv: Array
    fitted: SectionEllipse
    reference: SectionEllipse
    nominal: SectionEllipse | None = None
    curve: "SectionCurve | None" = None
    no_curve: Reason = Reason()

    @property
    def is_radius_measurable(self) -> bool:
        """Whether the ellipse is the pipe's; see `radius_is_measurable`."""
        return bool(radius_is_measurable(self.profile)[0])

    def on_curve(self, clock: Array) -> Array:
        """Return the points of the smooth curve at clock angles (n,), shape (n, 2), metres."""
        if self.curve is None:
            return np.empty((0, 2))
        directions = np.stack([np.sin(clock), np.cos(clock)], axis=1)
        radius = self.curve.radius_at(clock)
        return np.asarray(np.asarray(self.reference.centre_uv) + radius[:, None] * directions)

    def curve_pieces(self) -> list[Array]:
        """Return the smooth curve to draw: one piece a span that is seen, (n, 2), metres."""
        if self.curve is None:
            return []
        return [self.on_curve(clocks) for clocks in self.curve.clocks()]


def radius_is_measurable(profiles: Profiles) -> NDArray[np.bool_]:
    """Return whether the radius of each profile is the pipe's.

    Where little of a section is seen and that little is deformed, the circle through it
    lies beside the pipe, and its radius says nothing of the pipe.

    Parameters
    ----------
    profiles : Profiles
        Of m rows.

    Returns
    -------
    ndarray of bool, shape (m,)
    """
    is_beside = profiles.centre_deviation > MAX_OFFSET_RADII * profiles.semi_minor
    return np.asarray((profiles.arc >= np.pi) | ~is_beside)


def cut_section(element: Element, profile: Profiles, xyz: Array) -> Section:
    """Return a profile of an element in its own plane.

    Parameters
    ----------
    element : Element
    profile : Profiles
        A table of one row.
    xyz : ndarray, shape (n, 3)
        The profile's points in the cloud's local coordinates, metres; they are carried
        along the element's axis into the profile's plane. See `profile_points`.

    Returns
    -------
    Section
    """
    # With its kernels, which a program that has not cut anything yet should not wait for.
    from pipecore.deformation.section_curve import SectionCurve, fit_section  # noqa: PLC0415

    chainage, centre = float(profile.chainage[0]), profile.centre[0]
    tangent, normal = element.axis.tangent(chainage), profile.normal[0]
    if normal @ tangent < 0:
        normal = -normal
    up = twelve_o_clock(normal)
    right = np.cross(normal, up)
    cos_tilt = float(normal @ tangent)

    def in_plane(points: Array) -> Array:
        offset = points - centre
        offset = offset - ((offset @ normal) / cos_tilt)[..., None] * tangent
        return np.stack([offset @ right, offset @ up], axis=-1)

    axis_u, axis_v = in_plane(element.axis.at(chainage)).tolist()
    tilted_towards = float(np.arctan2(tangent @ up, tangent @ right))

    def contour(radius: float) -> SectionEllipse:
        return SectionEllipse((axis_u, axis_v), radius / cos_tilt, radius, tilted_towards)

    major = profile.major_direction[0]
    fitted = SectionEllipse(
        (0.0, 0.0),
        float(profile.semi_major[0]),
        float(profile.semi_minor[0]),
        float(np.arctan2(major @ up, major @ right)),
    )
    points_uv = in_plane(xyz)
    u, v = (points_uv - (axis_u, axis_v)).T
    curve = fit_section(np.arctan2(u, v), np.hypot(u, v))
    nominal = None
    if element.nominal is not None:
        nominal = contour(element.nominal.outside_diameter / 2)
    return Section(
        profile,
        points_uv,
        fitted,
        contour(float(element.radius_at(chainage))),
        nominal,
        curve if isinstance(curve, SectionCurve) else None,
        Reason() if isinstance(curve, SectionCurve) else curve.reason,
    )
