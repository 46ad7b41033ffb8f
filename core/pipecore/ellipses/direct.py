"""The direct least-squares ellipse: Fitzgibbon's fit in Halir & Flusser's stable form.

Equation 1 of the paper, F(x, y) = a x² + b xy + c y² + d x + e y + f, minimised over
all points under 4ac - b² = 1. It is fast and always an ellipse, and it is badly biased
towards small ones where the points cover less than about 240° of arc.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipecore._kernels import conics as kernels

Array = NDArray[np.float64]

_CONSTRAINT_INVERSE = np.array([[0.0, 0.0, 0.5], [0.0, -1.0, 0.0], [0.5, 0.0, 0.0]])


_QUADRATIC = np.array([[10, 11, 12], [11, 12, 13], [12, 13, 14]])
_MIXED = np.array([[6, 7, 3], [7, 8, 4], [8, 9, 5]])
_LINEAR = np.array([[3, 4, 1], [4, 5, 2], [1, 2, 0]])
"""Where the products of x², xy, y² with themselves and with x, y, 1, and of these, are
among the sums of powers."""


@dataclass(frozen=True, eq=False)
class PlaneEllipses:
    """Ellipses in a plane, one per row; nan where there is none.

    Parameters
    ----------
    centre : ndarray, shape (m, 2)
    semi_major, semi_minor : ndarray, shape (m,)
    angle : ndarray, shape (m,)
        Of the major axis from the first coordinate, radians.
    rss : ndarray, shape (m,)
        Sum of squared Sampson distances of the points.
    """

    centre: Array
    semi_major: Array
    semi_minor: Array
    angle: Array
    rss: Array


def fit_direct_ellipses(points: Array, starts: NDArray[np.int64]) -> PlaneEllipses:
    """Fit an ellipse directly to each group of points.

    Parameters
    ----------
    points : ndarray, shape (n, 2)
        Grouped; they are centred and scaled per group before the fit.
    starts : ndarray of int, shape (m + 1,)
        Where each group starts; the last entry is n. No group is empty.

    Returns
    -------
    PlaneEllipses
        nan for groups of fewer than six points or without an ellipse.

    References
    ----------
    Halir & Flusser, Numerically stable direct least squares fitting of ellipses (1998);
    paper, section 3.3.3, method 1.
    """
    counts = np.diff(starts)
    m = len(counts)
    mean, scale, moments = np.empty((m, 2)), np.empty(m), np.empty((m, 15))
    kernels.scaled_moments(points, starts, mean, scale, moments)
    s1, s2, s3 = (moments[:, powers] for powers in (_QUADRATIC, _MIXED, _LINEAR))
    usable = (counts >= 6) & (np.linalg.cond(s3) < 1e12)
    s3[~usable] = np.eye(3)
    t = -np.linalg.solve(s3, s2.transpose(0, 2, 1))
    reduced = _CONSTRAINT_INVERSE @ (s1 + s2 @ t)
    _, vectors = np.linalg.eig(reduced)
    vectors = np.real(vectors)
    discriminant = 4 * vectors[:, 0] * vectors[:, 2] - vectors[:, 1] ** 2
    best = np.argmax(discriminant, axis=1)
    rows = np.arange(m)
    usable &= discriminant[rows, best] > 0
    abc = vectors[rows, :, best]
    de_f = np.einsum("mij,mj->mi", t, abc)
    conic = np.where(usable[:, None], np.concatenate([abc, de_f], axis=1), np.nan)

    rss = np.empty(m)
    kernels.sampson_sums(points, starts, mean, scale, conic, rss)
    centre, semi_major, semi_minor, angle = _axes_of_conic(conic)
    return PlaneEllipses(
        mean + centre * scale[:, None],
        semi_major * scale,
        semi_minor * scale,
        angle,
        rss * scale**2,
    )


def _axes_of_conic(conic: Array) -> tuple[Array, Array, Array, Array]:
    """Centre, semi-axes and angle of the major axis of ellipses given as conics (m, 6)."""
    a, b, c, d, e, f = conic.T
    det = 4 * a * c - b * b
    with np.errstate(divide="ignore", invalid="ignore"):
        x0, y0 = (b * e - 2 * c * d) / det, (b * d - 2 * a * e) / det
        level = -(f + 0.5 * (d * x0 + e * y0))
        mean, half = 0.5 * (a + c), 0.5 * np.hypot(a - c, b)
        sign = np.sign(mean)
        # Eigenvalues of the quadratic form: the smaller belongs to the major axis.
        semi_major = np.sqrt(level * sign / (np.abs(mean) - half))
        semi_minor = np.sqrt(level * sign / (np.abs(mean) + half))
        angle = 0.5 * np.arctan2(-sign * b, -sign * (a - c))
    return np.stack([x0, y0], axis=1), semi_major, semi_minor, angle
