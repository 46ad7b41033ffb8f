"""One profile in its own plane: points, ellipse, smooth curve, undeformed contour. Qt-free.

Coordinates in the plane are millimetres; looking along the chainage, u points to 3:00
and v to 12:00.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pipecore.geometry import Array, twelve_o_clock
from pipecore.types import Element, Profiles

if TYPE_CHECKING:
    from pipecore.deformation.section_curve import SectionCurve


MAX_ASKEW = 0.25
"""The ellipse of half a section or less is the pipe's only if its centre is this near, in radii."""


@dataclass(frozen=True, eq=False)
class Ellipse:
    """An ellipse in a profile's plane: millimetres, u to 3:00, v to 12:00."""

    centre_uv: tuple[float, float]
    semi_major_mm: float
    semi_minor_mm: float
    angle_rad: float
    """Of the major axis, counter-clockwise from u."""


@dataclass(frozen=True, eq=False)
class SectionCut:
    """What is drawn of a section.

    Parameters
    ----------
    points_uv : ndarray, shape (n, 2)
        The profile's points relative to the centre of its ellipse.
    fitted : Ellipse
        The profile's own ellipse.
    reference : Ellipse
        The element's undeformed contour in this plane.
    nominal : Ellipse, optional
        The contour of the nominal size, about the same axis.
    curve : SectionCurve, optional
        The smooth curve through the points, about the centre of `reference`.
    no_curve : str
        Why there is none.
    is_askew : bool
        Whether so little of the section is seen, and so much of that is deformed, that the
        ellipse through it is not the pipe's.
    """

    points_uv: Array
    fitted: Ellipse
    reference: Ellipse
    nominal: Ellipse | None = None
    curve: "SectionCurve | None" = None
    no_curve: str = ""
    is_askew: bool = False


def cut_section(element: Element, profile: Profiles, xyz: Array) -> SectionCut:
    """Return a section of an element.

    Parameters
    ----------
    element : Element
    profile : Profiles
        A table of one row.
    xyz : ndarray, shape (n, 3)
        The profile's points; they are carried along the element's axis into its plane.
    """
    chainage, centre = float(profile.chainage[0]), profile.centre[0]
    tangent, normal = element.axis.tangent(chainage), profile.normal[0]
    if normal @ tangent < 0:
        normal = -normal
    up = twelve_o_clock(normal)
    right = np.cross(normal, up)
    tilt = float(normal @ tangent)

    def in_plane(points: Array) -> Array:
        offset = points - centre
        offset = offset - ((offset @ normal) / tilt)[..., None] * tangent
        return 1000 * np.stack([offset @ right, offset @ up], axis=-1)

    def contour(radius_mm: float) -> Ellipse:
        lean = float(np.arctan2(tangent @ up, tangent @ right))
        return Ellipse((float(axis_u), float(axis_v)), radius_mm / tilt, radius_mm, lean)

    axis_u, axis_v = in_plane(element.axis.at(chainage))
    major = profile.major_direction[0]
    fitted = Ellipse(
        (0.0, 0.0),
        1000 * float(profile.semi_major[0]),
        1000 * float(profile.semi_minor[0]),
        float(np.arctan2(major @ up, major @ right)),
    )
    points_uv = in_plane(xyz)
    u, v = (points_uv - (axis_u, axis_v)).T
    # With its kernels, which the start of the window should not wait for.
    from pipecore.deformation.section_curve import SectionCurve, fit_section  # noqa: PLC0415

    curve = fit_section(np.arctan2(u, v), np.hypot(u, v) / 1000)
    nominal = None
    if element.nominal is not None:
        nominal = contour(500 * element.nominal.outside_diameter)
    off_axis = float(np.hypot(axis_u, axis_v))
    return SectionCut(
        points_uv,
        fitted,
        contour(1000 * float(element.radius_at(chainage))),
        nominal,
        curve if isinstance(curve, SectionCurve) else None,
        "" if isinstance(curve, SectionCurve) else str(curve.reason),
        float(profile.arc[0]) < np.pi and off_axis > MAX_ASKEW * fitted.semi_minor_mm,
    )
