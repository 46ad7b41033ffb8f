"""Oblique cuts through a cylinder, seen along its axis.

Points are given in the frame of their stack: (u, v) in the profile's plane, normals as
(u, v, d) with d along the stack's direction. The plane cuts a cylinder of axis a in an
ellipse with semi-minor axis r and semi-major axis r / |a·d|. Seen along a it is a circle;
that circle, or an oval where it does not do, is what is fitted.
"""

import math

from numba import njit

from pipecore._kernels.eigen import eigenvalues, eigenvector


@njit(cache=True, nogil=True)
def common_axis(normals, chosen):
    """Return the direction most perpendicular to chosen normals, and two eigenvalue shares.

    Parameters
    ----------
    normals (n, 3) : unit normals of either sign
    chosen (n,) : normals that count

    Returns
    -------
    Unit vector (u, v, d) with d ≥ 0, and the two smaller eigenvalues of Σnnᵀ over the number of
    normals, ascending; nan for fewer than three.
    """
    n = 0
    xx = xy = xz = yy = yz = zz = 0.0
    for i in range(normals.shape[0]):
        if chosen[i]:
            a, b, c = normals[i, 0], normals[i, 1], normals[i, 2]
            n += 1
            xx += a * a
            xy += a * b
            xz += a * c
            yy += b * b
            yz += b * c
            zz += c * c
    if n < 3:
        return math.nan, math.nan, math.nan, math.nan, math.nan
    least, middle, _ = eigenvalues(xx, xy, xz, yy, yz, zz)
    u, v, d = eigenvector(xx, xy, xz, yy, yz, zz, least)
    if d < 0.0:
        u, v, d = -u, -v, -d
    return u, v, d, least / n, middle / n


@njit(cache=True, nogil=True)
def along(u, v, nu, nv, nd, tu, tv, ad, sin):
    """Return a point and its normal as seen along a tilted axis.

    x runs across the tilt, y along it, foreshortened.

    Parameters
    ----------
    u, v : point in the profile's plane, metres
    nu, nv, nd : unit normal
    tu, tv : direction of the tilt in the plane
    ad, sin : cosine and sine of the tilt
    """
    x, y = tu * v - tv * u, (tu * u + tv * v) * ad
    return x, y, tu * nv - tv * nu, (tu * nu + tv * nv) * ad - nd * sin


@njit(cache=True, nogil=True)
def project_along_axis(uv, normals, au, av, ad, x, y, mx, my):
    """Write points and normals as seen along an axis; return the direction of its tilt (tu, tv).

    Parameters
    ----------
    uv (n, 2) : points in the profile's plane, metres
    normals (n, 3) : unit normals in (u, v, d)
    au, av, ad : unit vector of the axis
    x, y, mx, my (n,) : filled
    """
    sin = math.sqrt(au * au + av * av)
    tu, tv = (au / sin, av / sin) if sin > 1e-9 else (1.0, 0.0)
    for i in range(uv.shape[0]):
        x[i], y[i], mx[i], my[i] = along(
            uv[i, 0], uv[i, 1], normals[i, 0], normals[i, 1], normals[i, 2], tu, tv, ad, sin
        )
    return tu, tv


@njit(cache=True, nogil=True)
def fits_circle(x, y, mx, my, cx, cy, r, max_distance, cos_radial):
    """Return whether a point lies on a circle and its normal points to the centre.

    Parameters
    ----------
    x, y, mx, my : point and normal, see `along`
    cx, cy, r : circle, metres
    max_distance : from the circle, metres
    cos_radial : least cosine between normal and radius
    """
    dx, dy = x - cx, y - cy
    d = math.sqrt(dx * dx + dy * dy)
    return abs(d - r) <= max_distance and abs(dx * mx + dy * my) >= cos_radial * d
