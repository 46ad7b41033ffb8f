"""Ellipses of the curves in the profiles, and which of them to believe (paper, 3.3.3 and 3.3.4)."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from pipecore._kernels.curve_fits import CurveFits, CurveLimits, fit_curves
from pipecore.ellipses.direct import PlaneEllipses, fit_direct_ellipses
from pipecore.ellipses.free import fit_free_ellipses
from pipecore.ellipses.uncertainty import radius_sd_factor
from pipecore.profiles import Curves
from pipecore.settings import ElementSettings, EllipseFit, EllipseSettings
from pipecore.surface import Surface

__all__ = [
    "Ellipses",
    "PlaneEllipses",
    "akaike",
    "fit_direct_ellipses",
    "fit_ellipses",
    "fit_free_ellipses",
    "radius_sd_factor",
]

Array = NDArray[np.float64]

FREE_FIT_ARC = np.deg2rad(240.0)
"""A free ellipse is believed only where the points cover at least this arc."""

LINE_PARAMETERS, CIRCLE_PARAMETERS, ELLIPSE_PARAMETERS = 2, 3, 5


@dataclass(frozen=True, eq=False)
class Ellipses:
    """Accepted ellipses of all stacks, one per row.

    Parameters
    ----------
    stack_id, profile_index : ndarray of int32, shape (m,)
    width : ndarray, shape (m,)
        Width of the profile, metres.
    centre : ndarray, shape (m, 3)
        Local coordinates.
    normal : ndarray, shape (m, 3)
        Unit normal of the profile's plane: its stack's direction.
    axis : ndarray, shape (m, 3)
        Unit direction of the pipe there, from the points' normals.
    radius, radius_sd : ndarray, shape (m,)
        Of the circle seen along `axis`, metres.
    meeting_point : ndarray, shape (m, 3)
        Where the points' normals meet: the sphere's centre, if it is one.
    meeting_distance : ndarray, shape (m,)
        Mean distance of the points from there.
    arc : ndarray, shape (m,)
        Radians.
    n_points : ndarray of int32, shape (m,)
    rms : ndarray, shape (m,)
    semi_minor, semi_major : ndarray, shape (m,)
        Of the free direct fit where the arc carries it, else of the constrained ellipse.
    major_direction : ndarray, shape (m, 3)
        Unit vector of the major axis.
    aic_line, aic_ellipse : ndarray, shape (m,)
    """

    stack_id: NDArray[np.int32]
    profile_index: NDArray[np.int32]
    width: Array
    centre: Array
    normal: Array
    axis: Array
    radius: Array
    radius_sd: Array
    meeting_point: Array
    meeting_distance: Array
    arc: Array
    n_points: NDArray[np.int32]
    rms: Array
    semi_minor: Array
    semi_major: Array
    major_direction: Array
    aic_line: Array
    aic_ellipse: Array

    def __len__(self) -> int:
        """Return the number of ellipses."""
        return len(self.radius)

    def __getitem__(self, rows: NDArray[np.intp] | NDArray[np.bool_]) -> "Ellipses":
        """Return the given rows."""
        return Ellipses(*(getattr(self, f.name)[rows] for f in fields(self)))

    @classmethod
    def concatenate(cls, tables: "Sequence[Ellipses]") -> "Ellipses":
        """Return one table with the rows of all; at least one table.

        Parameters
        ----------
        tables : sequence of Ellipses

        Returns
        -------
        Ellipses
        """
        return cls(*(np.concatenate([getattr(t, f.name) for t in tables]) for f in fields(cls)))


def akaike(n_parameters: int, n_points: NDArray[np.integer], rss: Array) -> Array:
    """Return Akaike's information criterion, 2k + n ln(2π·RSS/n): equation 4 of the paper.

    Parameters
    ----------
    n_parameters : int
        k.
    n_points : ndarray of int, shape (m,)
        n of each group.
    rss : ndarray, shape (m,)
        Residual sum of squares of each group, metres².

    Returns
    -------
    ndarray, shape (m,)
    """
    result = 2 * n_parameters + n_points * np.log(2 * np.pi * np.maximum(rss, 1e-18) / n_points)
    return np.asarray(result, np.float64)


def fit_ellipses(
    curves: Curves,
    surface: Surface,
    settings: EllipseSettings,
    sizes: ElementSettings,
    check: Callable[[], None] = lambda: None,
) -> Ellipses:
    """Fit an ellipse to every curve of a stack and return those that are accepted.

    The ellipse is constrained: an oblique cut through a cylinder whose direction comes
    from the points' normals. It is accepted if its flattening, arc, residual and radius are
    within bounds, its normals point to its centre, and Akaike's criterion prefers it to
    a line.

    Parameters
    ----------
    curves : Curves
    surface : Surface
        The surface that they were cut out of.
    settings : EllipseSettings
    sizes : ElementSettings
        Their bounds on the radius.
    check : callable
        Called now and then; may raise to cancel.

    Returns
    -------
    Ellipses
    """
    fits = CurveFits.empty(len(curves))
    tolerance = surface.tolerance
    limits = CurveLimits(
        tolerance, 4.0 * surface.voxel, 1.0 - settings.max_flattening, MAX_OFF_AXIS
    )
    fit_curves(curves.uv, curves.normals, curves.starts, 0, len(curves), limits, fits)
    radius, rms, arc = fits.radius, fits.rms, fits.arc
    max_rms = settings.max_rms_mm / 1e3 or 1.25 * tolerance
    radius_sd = rms * radius_sd_factor(arc) / np.sqrt(fits.n_points)
    with np.errstate(invalid="ignore"):
        is_sure = (arc >= SURE_ARC) | (radius_sd < MAX_RADIUS_SD * radius)
        accepted = (
            (arc >= np.deg2rad(settings.min_arc_deg))
            & is_sure
            & (rms <= max_rms)
            & (rms <= 0.12 * radius)
            & (radius >= 0.8 * sizes.min_radius_mm / 1e3)
            & (radius <= 1.2 * sizes.max_radius_mm / 1e3)
            & (fits.radial_share >= MIN_RADIAL)
        )
    kept = np.flatnonzero(accepted)
    fits = fits.rows(kept)
    is_long = fits.arc >= FREE_FIT_ARC
    line_rss, free = _competing_fits(curves, kept, is_long, settings.fit, check)
    n_points = np.diff(curves.starts)[kept]
    aic_line = akaike(LINE_PARAMETERS, n_points, line_rss)
    circle_rss = fits.rms**2 * n_points
    is_free = is_long & np.isfinite(free.semi_minor)
    aic_ellipse = np.where(
        is_free,
        akaike(ELLIPSE_PARAMETERS, n_points, free.rss),
        akaike(CIRCLE_PARAMETERS, n_points, circle_rss),
    )
    ellipses = _to_space(curves, kept, fits, free, is_free, aic_line, aic_ellipse)
    return ellipses[aic_ellipse < aic_line]


SURE_ARC, MAX_RADIUS_SD = np.deg2rad(80.0), 0.10
"""Shorter arcs must carry the radius to this share of it, as those of vessels do."""
MIN_RADIAL = 0.75
"""Share of a curve's normals that must point to the centre."""
MAX_OFF_AXIS = 0.35
"""Largest ratio of the two smaller eigenvalues of Σnnᵀ: above, the axis is not defined."""


def _competing_fits(
    curves: Curves,
    kept: NDArray[np.intp],
    is_long: NDArray[np.bool_],
    method: EllipseFit,
    check: Callable[[], None],
) -> tuple[Array, PlaneEllipses]:
    """Residual sums of squares of a line, and free ellipses, for the kept curves."""
    if len(kept) == 0:
        return np.empty(0), PlaneEllipses(np.empty((0, 2)), *(np.empty(0) for _ in range(4)))
    sizes = np.diff(curves.starts)[kept]
    starts = np.concatenate([[0], np.cumsum(sizes)])
    rows = np.arange(starts[-1]) + np.repeat(curves.starts[kept] - starts[:-1], sizes)
    uv = curves.uv[rows]
    return line_rss(uv, starts), fit_free_ellipses(uv, starts, is_long, method, check)


def line_rss(points: Array, starts: NDArray[np.int64]) -> Array:
    """Return the residual sum of squares of the best line through each group of points.

    Parameters
    ----------
    points : ndarray, shape (n, 2)
        Grouped.
    starts : ndarray of int, shape (m + 1,)
        Where each group starts; the last entry is n.

    Returns
    -------
    ndarray, shape (m,)
        In the square of the points' unit.
    """
    counts = np.diff(starts)
    mean = np.add.reduceat(points, starts[:-1]) / counts[:, None]
    x, y = (points - np.repeat(mean, counts, axis=0)).T
    xx, xy, yy = (np.add.reduceat(p, starts[:-1]) for p in (x * x, x * y, y * y))
    return np.asarray(0.5 * (xx + yy) - np.hypot(0.5 * (xx - yy), xy))


def _combined(components: Array, vectors: Array) -> Array:
    """Sums of vectors by rows of components.

    Not by BLAS, whose rounding depends on how many rows there are.
    """
    return np.asarray(sum(c[:, None] * v for c, v in zip(components.T, vectors, strict=False)))


def _to_space(
    curves: Curves,
    kept: NDArray[np.intp],
    fits: CurveFits,
    free: PlaneEllipses,
    is_free: NDArray[np.bool_],
    aic_line: Array,
    aic_ellipse: Array,
) -> Ellipses:
    frame = curves.frame
    centre = _combined(fits.centre, frame) + curves.mid_plane(kept)[:, None] * frame[2]
    axis = _combined(fits.axis, frame)
    n_points = fits.n_points.astype(np.int32)
    # The major axis of the constrained ellipse runs along the axis's tilt.
    angle = np.where(is_free, free.angle, np.arctan2(fits.axis[:, 1], fits.axis[:, 0]))
    return Ellipses(
        stack_id=np.full(len(kept), curves.stack.stack_id, np.int32),
        profile_index=curves.profile_index[kept],
        width=np.full(len(kept), curves.stack.width),
        centre=centre,
        normal=np.broadcast_to(frame[2], centre.shape),
        axis=axis,
        radius=fits.radius,
        radius_sd=fits.rms * radius_sd_factor(fits.arc) / np.sqrt(n_points),
        meeting_point=_combined(fits.meeting_point, frame)
        + curves.mid_plane(kept)[:, None] * frame[2],
        meeting_distance=fits.meeting_distance,
        arc=fits.arc,
        n_points=n_points,
        rms=fits.rms,
        semi_minor=np.where(is_free, free.semi_minor, fits.radius),
        semi_major=np.where(is_free, free.semi_major, fits.radius / fits.axis[:, 2]),
        major_direction=np.cos(angle)[:, None] * frame[0] + np.sin(angle)[:, None] * frame[1],
        aic_line=aic_line,
        aic_ellipse=aic_ellipse,
    )
