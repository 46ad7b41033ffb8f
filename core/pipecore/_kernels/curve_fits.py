"""Fits of a cylinder cut to whole curves, see `oblique_cuts`."""

import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pipecore._kernels.circles import covered_arc
from pipecore._kernels.oblique_cuts import common_axis, project_along_axis
from pipecore._kernels.oval_sections import N_SHAPE, fit_section, radius_towards


class CurveFits(NamedTuple):
    """Cylinder cuts fitted to m curves, in their stack's frame (u, v, d); metres; nan for none.

    centre (m, 2): where the axis pierces the profile's plane;
    axis (m, 3): unit direction of the axis;
    radius, rms (m,): mean radius of the section seen along the axis, and its residuals;
    arc (m,): arc that the points cover, radians;
    n_points (m,): points that count;
    radial_share (m,): fraction of the normals that point to the centre;
    meeting_point (m, 3): where the points' normals meet: a sphere's centre, if it is one;
    meeting_distance (m,): mean distance of the points from there.
    """

    centre: NDArray[np.float64]
    axis: NDArray[np.float64]
    radius: NDArray[np.float64]
    rms: NDArray[np.float64]
    arc: NDArray[np.float64]
    n_points: NDArray[np.float64]
    radial_share: NDArray[np.float64]
    meeting_point: NDArray[np.float64]
    meeting_distance: NDArray[np.float64]

    @classmethod
    def empty(cls, m: int) -> "CurveFits":
        """Return fits of m curves, still without a fit."""
        columns = (2, 3, 0, 0, 0, 0, 0, 3, 0)
        return cls(*(np.full((m, n) if n else m, np.nan) for n in columns))

    def rows(self, index: Any) -> "CurveFits":
        """Return the fits of some curves."""
        return CurveFits(*(column[index] for column in self))


class CurveLimits(NamedTuple):
    """What a curve has to be for a fit.

    tolerance: distance within which points count as on their curve, metres;
    max_gap: gap between neighbouring points that counts as covered, metres;
    min_cos_tilt: least cosine between the axis and the stack's direction;
    max_off_axis: largest ratio of the two smaller eigenvalues of Σnnᵀ.
    """

    tolerance: float
    max_gap: float
    min_cos_tilt: float
    max_off_axis: float


@njit(cache=True, nogil=True)
def fit_curves(uv, normals, curve_starts, start, stop, limits, fits):
    """Fit a cylinder cut to each of some curves.

    Curves without a fit are left as they are: those whose axis is not defined or too oblique,
    and those of fewer than five points near their section.

    Parameters
    ----------
    uv (n, 2) : points in the profile's plane, metres, curve by curve
    normals (n, 3) : unit normals in (u, v, d)
    curve_starts (m + 1,) : where each curve begins
    start, stop : range of curves
    limits : CurveLimits
    fits : CurveFits of m curves; filled
    """
    for c in range(start, stop):
        a, b = curve_starts[c], curve_starts[c + 1]
        n = b - a
        if n < 5:
            continue
        points, vectors = uv[a:b], normals[a:b]
        chosen = np.ones(n, np.bool_)
        x, y, mx, my = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
        weights, shape = np.empty(n), np.empty(N_SHAPE)
        au, av, ad, l1, l2 = common_axis(vectors, chosen)
        # Also where they are nan.
        if not (ad >= limits.min_cos_tilt and l1 <= limits.max_off_axis * l2):
            continue
        tu, tv = project_along_axis(points, vectors, au, av, ad, x, y, mx, my)
        cx, cy = fit_section(x, y, limits.tolerance, limits.max_gap, 8, weights, shape)
        if not math.isfinite(cx):
            continue
        r = shape[0]
        total = ss = 0.0
        xx = xy = xz = yy = yz = zz = bx = by = bz = 0.0
        n_in = n_radial = 0
        angles = np.empty(n)
        for k in range(n):
            dx, dy = x[k] - cx, y[k] - cy
            d = math.sqrt(dx * dx + dy * dy)
            if weights[k] < 0.1 or d == 0.0:
                continue
            angles[n_in] = math.atan2(dy, dx)
            n_in += 1
            total += weights[k]
            ss += weights[k] * (d - radius_towards(shape, dx / d, dy / d)) ** 2
            radial = (dx * mx[k] + dy * my[k]) / d
            n_radial += abs(radial) > 0.9
            # Normal equations of the point nearest to all normals' lines.
            nu, nv, nd = vectors[k, 0], vectors[k, 1], vectors[k, 2]
            pn = points[k, 0] * nu + points[k, 1] * nv
            xx += 1.0 - nu * nu
            xy -= nu * nv
            xz -= nu * nd
            yy += 1.0 - nv * nv
            yz -= nv * nd
            zz += 1.0 - nd * nd
            bx += points[k, 0] - pn * nu
            by += points[k, 1] - pn * nv
            bz -= pn * nd
        if n_in < 5:
            continue
        sorted_angles = np.sort(angles[:n_in])
        arc = covered_arc(sorted_angles, max(limits.max_gap / r, 0.35))
        # Back from the view along the axis to the profile's plane.
        along_tilt = cy / ad
        fits.centre[c, 0] = -tv * cx + tu * along_tilt
        fits.centre[c, 1] = tu * cx + tv * along_tilt
        fits.axis[c, 0], fits.axis[c, 1], fits.axis[c, 2] = au, av, ad
        fits.radius[c] = r
        fits.rms[c] = math.sqrt(ss / total)
        fits.arc[c] = arc
        fits.n_points[c] = n_in
        fits.radial_share[c] = n_radial / n
        det = xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz)
        if det > 0.0:
            mu = (
                bx * (yy * zz - yz * yz) - xy * (by * zz - yz * bz) + xz * (by * yz - yy * bz)
            ) / det
            mv = (
                xx * (by * zz - yz * bz) - bx * (xy * zz - yz * xz) + xz * (xy * bz - by * xz)
            ) / det
            md = (
                xx * (yy * bz - by * yz) - xy * (xy * bz - by * xz) + bx * (xy * yz - yy * xz)
            ) / det
            distance = 0.0
            for k in range(n):
                if weights[k] >= 0.1:
                    distance += math.sqrt(
                        (points[k, 0] - mu) ** 2 + (points[k, 1] - mv) ** 2 + md * md
                    )
            fits.meeting_point[c, 0], fits.meeting_point[c, 1] = mu, mv
            fits.meeting_point[c, 2] = md
            fits.meeting_distance[c] = distance / n_in
