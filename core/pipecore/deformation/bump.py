"""The shape of one dent or bulge: a smooth bump fitted to its points.

The bump is h·b(u, v) + c, where u and v are distances from its peak along and around
the pipe as shares of half its length and half its width, and c is what the contour may
be off by. Its section is a cosine, cos²(π/2 · tᑫ): round for q = 1, flat-bottomed
above, pointed below. In plan it is a product (b = f(u)·f(v)) or an ellipse (b = f(√(u² + v²)));
the better of them by AIC stands. Length and width are where the bump has come back to zero,
so that a cosine bump of nominal extent has just that extent.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from pipecore.geometry import Array

MAX_POINTS = 6000
MIN_EXTENT, MAX_EXTENT = 0.1, 3.0
"""Bounds of a bump's length and width, shares of the outside diameter."""

CLEAR = 12.0
"""Significance from which the shape is fitted as well (flat-bottomed, pointed)."""


@dataclass(frozen=True, eq=False)
class Bump:
    """A fitted bump; lengths in metres in the plane of the unrolled surface.

    `height` is signed (outward positive); `curvature_along` and `curvature_around` are
    the magnitudes of the second derivatives at the peak of the cosine (1/metres).
    """

    along: float
    around: float
    height: float
    height_sd: float
    length: float
    width: float
    curvature_along: float
    curvature_around: float
    misfit: float


@dataclass(frozen=True, eq=False)
class _Fit:
    parameters: Array
    covariance: Array
    chi2: float
    aic: float
    is_ellipse: bool


def fit_bump(
    along: Array,
    around: Array,
    deviation: Array,
    noise: Array,
    *,
    start: tuple[float, float, float],
    diameter: float,
    contour_sd: float,
    inflation: float,
    is_final: bool = True,
) -> Bump | None:
    """Fit a bump to points (n,) in the plane; None if they do not carry one.

    Parameters
    ----------
    along, around : ndarray
        Distances from the supposed peak, metres.
    deviation, noise : ndarray
        Height above the contour and its standard deviation, metres.
    start : tuple
        Height, length and width to start from.
    diameter, contour_sd : float
    inflation : float
        How much larger the noise of means is than that of points alone would make it.
    is_final : bool
        Whether all forms are tried; else only the plain one, which suffices for a mask.
    """
    height, length, width = start
    fits: list[_Fit] = []
    for is_first in (True, False):  # the second time with a window that suits the extents found
        near = (np.abs(along) < 0.8 * length) & (np.abs(around) < 0.8 * width)
        if np.count_nonzero(near) < 8:
            return None
        data = _thin(along[near], around[near], deviation[near], noise[near] * inflation)
        first = np.array([height, 0.0, 0.0, np.log(length), np.log(width), 0.0])
        if fits:
            first = min(fits, key=lambda f: f.aic).parameters[:6]
        shapes = [(True, False)]
        if is_final and not is_first:
            shapes.append((False, False))
        if len(shapes) > 1 and abs(height) / max(_height_sd(data, length, width), 1e-9) > CLEAR:
            shapes += [(False, True), (True, True)]
        fits = [
            _fit(
                data,
                first,
                is_ellipse=is_ellipse,
                free_shape=free_shape,
                diameter=diameter,
                contour_sd=contour_sd,
            )
            for is_ellipse, free_shape in shapes
        ]
        best = min(fits, key=lambda f: f.aic)
        height, length, width = best.parameters[0], *np.exp(best.parameters[3:5])
    dof = max(len(data[0]) - len(best.parameters), 1)
    misfit = float(np.sqrt(best.chi2 / dof))

    # What is not known of the shape is part of the uncertainty of the depth.
    weights = np.exp(-0.5 * (np.array([f.aic for f in fits]) - best.aic))
    weights /= weights.sum()
    heights = np.array([f.parameters[0] for f in fits])
    variances = np.array([f.covariance[0, 0] for f in fits]) * max(misfit, 1.0) ** 2
    variance = float(weights @ (variances + (heights - heights[fits.index(best)]) ** 2))
    # Curvatures from the plain cosine: exponents make them zero or infinite at the peak.
    plain = min((f for f in fits if len(f.parameters) == 6), key=lambda f: f.aic).parameters
    second = 2 * np.pi**2 * abs(plain[0]) / np.exp(2 * plain[3:5])
    return Bump(
        along=float(best.parameters[1]),
        around=float(best.parameters[2]),
        height=float(best.parameters[0]),
        height_sd=float(np.sqrt(variance)),
        length=float(length),
        width=float(width),
        curvature_along=float(second[0]),
        curvature_around=float(second[1]),
        misfit=misfit,
    )


def bump_shape(u: Array, v: Array, q: float, is_ellipse: bool) -> Array:
    """Values of the bump (1 at the peak, 0 at |t| = 1) at shares of its half extents."""
    if is_ellipse:
        return _section(np.hypot(u, v), q)
    return np.asarray(_section(u, q) * _section(v, q))


def _section(t: Array, q: float) -> Array:
    t = np.minimum(np.abs(t), 1.0)
    return np.asarray(np.cos(np.pi / 2 * (t if q == 1.0 else t**q)) ** 2)


def _height_sd(data: tuple[Array, ...], length: float, width: float) -> float:
    """Noise of the height of a bump whose place and size are known."""
    along, around, _, noise = data
    b = bump_shape(2 * along / length, 2 * around / width, 1.0, False)
    return float(1.0 / np.sqrt(max(np.sum((b / noise) ** 2), 1e-12)))


def _fit(
    data: tuple[Array, ...],
    first: Array,
    *,
    is_ellipse: bool,
    free_shape: bool,
    diameter: float,
    contour_sd: float,
) -> _Fit:
    along, around, deviation, noise = data
    offset_sd = max(contour_sd, 1e-5)
    extent = np.exp(first[3:5])
    low = np.array(
        [-np.inf, -0.6 * extent[0], -0.6 * extent[1], *[np.log(MIN_EXTENT * diameter)] * 2]
    )
    high = np.array(
        [np.inf, 0.6 * extent[0], 0.6 * extent[1], *[np.log(MAX_EXTENT * diameter)] * 2]
    )
    low, high = np.append(low, -np.inf), np.append(high, np.inf)
    start = np.append(first[:6], 0.0) if free_shape else first[:6].copy()
    if free_shape:
        low, high = np.append(low, np.log(0.5)), np.append(high, np.log(3.0))
    start[1:3] = np.clip(start[1:3], 0.99 * low[1:3], 0.99 * high[1:3])
    start[3:5] = np.clip(start[3:5], low[3:5] + 1e-6, high[3:5] - 1e-6)
    low[1:3] += np.minimum(start[1:3], 0)
    high[1:3] += np.maximum(start[1:3], 0)

    def residuals(p: Array) -> Array:
        q = float(np.exp(p[6])) if free_shape else 1.0
        u, v = 2 * (along - p[1]) / np.exp(p[3]), 2 * (around - p[2]) / np.exp(p[4])
        model = p[0] * bump_shape(u, v, q, is_ellipse) + p[5]
        return np.append((deviation - model) / noise, p[5] / offset_sd)

    scale = np.array([1e-3, 0.1 * extent[0], 0.1 * extent[1], 0.1, 0.1, 1e-3, 0.2])[: len(start)]
    answer = least_squares(
        residuals,
        start,
        bounds=(low, high),
        x_scale=scale,
        diff_step=1e-5,
        max_nfev=40,
        ftol=1e-5,
        xtol=1e-5,
    )
    information = answer.jac.T @ answer.jac
    # An extent at its bound has no slope; a trace of prior keeps the inverse finite.
    information += np.diag(1e-6 / np.maximum(scale, 1e-9) ** 2)
    covariance = np.linalg.inv(information)
    chi2 = 2 * float(answer.cost)
    return _Fit(answer.x, covariance, chi2, chi2 + 2 * len(start), is_ellipse)


def _thin(
    along: Array, around: Array, deviation: Array, noise: Array
) -> tuple[Array, Array, Array, Array]:
    """Means over a fine mesh where there are more points than the fit needs."""
    if len(along) <= MAX_POINTS:
        return along, around, deviation, noise
    mesh = 64

    def bin_of(x: Array) -> Array:
        low, high = x.min(), x.max()
        return np.minimum((x - low) / max(high - low, 1e-12) * mesh, mesh - 1).astype(np.intp)

    index = bin_of(along) * mesh + bin_of(around)
    weight = 1.0 / noise**2
    total = np.bincount(index, weight, minlength=mesh * mesh)
    some = total > 0

    def mean(x: Array) -> Array:
        return np.asarray(np.bincount(index, weight * x, minlength=mesh * mesh)[some] / total[some])

    return mean(along), mean(around), mean(deviation), 1.0 / np.sqrt(total[some])
