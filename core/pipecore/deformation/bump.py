"""The shape of one dent or bulge: a smooth bump fitted to its points.

The bump is h·b(ρ) + c over an ellipse, where ρ is the distance from its peak in shares of
half its length and half its width, and c is what the contour may be off by. Its section
b is a cosine, cos²(π/2 · ρᑫ), plain for q = 1, flat-bottomed above, or a cone, 1 - ρ:
whichever fits best by AIC where the bump is clear, else the plain cosine.
Length and width are where the bump has come back to zero, so that a cosine bump of
nominal extent has just that extent.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from pipecore.geometry import Array

MAX_POINTS = 6000
MIN_EXTENT, MAX_LENGTH, MAX_WIDTH = 0.1, 3.0, 1.5
"""Bounds of a bump's extents, shares of the outside diameter: beyond, it is no dent."""

TYPICAL_EXTENT, EXTENT_PRIOR = 0.5, 1.0
"""Extents believed in beforehand (shares of the diameter), and the sd of their logarithms."""

CLEAR = 20.0
"""Significance from which the form is fitted as well (flat-bottomed, pointed)."""

CORE = 0.75
"""Where the fit is held against its points: up to this share of the half extents."""

HEIGHT_PRIOR = 0.5
"""Standard deviation of heights believed in beforehand, share of the diameter."""

FORM_HANDICAP = 4.0
"""How much better than a plain cosine another form has to fit."""

FORM_PRIOR, ROUNDNESS_PRIOR = 0.4, 0.5
"""Weak beliefs: standard deviations of log q around 0, and of log(length / width) around 0."""


Shape = Callable[[Array, float], Array]
"""Height of a bump of height one at ρ, given q."""


@dataclass(frozen=True, eq=False)
class Bump:
    """A fitted bump; lengths in metres in the plane of the unrolled surface.

    `height` is signed (outward positive); `curvature_along` and `curvature_around` are
    the magnitudes of the second derivatives at the peak of the cosine (1/metres). `misfit`
    is the root mean square of the residuals under it in units of their noise, `noise` the
    standard deviation of the height of a bump whose place and form are known. `volume`
    (metres³, positive) lies between the bump and the undeformed surface.
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
    noise: float
    n_points: int
    volume: float

    @property
    def area(self) -> float:
        """Area of its ellipse on the undeformed surface, metres²."""
        return float(np.pi / 4 * self.length * self.width)


@dataclass(frozen=True, eq=False)
class _Fit:
    """Parameters: height, two of place, log length and width, offset, log q if free."""

    parameters: Array
    covariance: Array
    chi2: float
    shape: Shape

    @property
    def exponent(self) -> float:
        """The q of its shape."""
        return float(np.exp(self.parameters[6])) if len(self.parameters) > 6 else 1.0

    @property
    def mean_share(self) -> float:
        """Mean height over the ellipse as a share of the peak's: ∫ 2ρ b(ρ) dρ."""
        rho = (np.arange(200) + 0.5) / 200
        return float(np.mean(2 * rho * self.shape(rho, self.exponent)))

    @property
    def aic(self) -> float:
        """Akaike's criterion, with the handicap of the less common forms."""
        is_plain = self.shape is bump_shape and len(self.parameters) == 6
        return self.chi2 + 2 * len(self.parameters) + (0.0 if is_plain else FORM_HANDICAP)


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
    """
    height, length, width = start
    first = np.array([height, 0.0, 0.0, np.log(length), np.log(width), 0.0])
    for _ in range(2):  # the second time with a window that suits the extents found
        near = (np.abs(along) < 0.8 * length) & (np.abs(around) < 0.8 * width)
        if np.count_nonzero(near) < 8:
            return None
        data = _thin(along[near], around[near], deviation[near], noise[near] * inflation)
        plain = _fit(data, first, diameter, contour_sd)
        first = plain.parameters
        length, width = np.exp(first[3:5])
        if min(length, width) < MIN_EXTENT * diameter:
            return None
        if length > MAX_LENGTH * diameter or width > MAX_WIDTH * diameter:
            return None
    fits = [plain]
    if abs(first[0]) > CLEAR * _height_sd((data[0], data[1], data[3]), length, width):
        fits.append(_fit(data, np.append(first, 0.0), diameter, contour_sd))
        fits.append(_fit(data, first, diameter, contour_sd, cone))
    best = min(fits, key=lambda fit: fit.aic)
    # That it may be another form is part of the uncertainty of the height.
    likely = np.exp(-0.5 * (np.array([fit.aic for fit in fits]) - best.aic))
    others = np.array([fit.parameters[0] for fit in fits]) - best.parameters[0]
    doubt = float(likely @ others**2 / likely.sum())
    height, along_peak, around_peak = best.parameters[:3]
    length, width = np.exp(best.parameters[3:5])
    misfit = _core_misfit(data, best)
    inside = np.hypot(2 * (along - along_peak) / length, 2 * (around - around_peak) / width)
    # Curvatures from the plain cosine: exponents make them zero or infinite at the peak.
    second = 2 * np.pi**2 * abs(plain.parameters[0]) / np.exp(2 * plain.parameters[3:5])
    return Bump(
        along=float(along_peak),
        around=float(around_peak),
        height=float(height),
        height_sd=float(np.sqrt(best.covariance[0, 0] * max(misfit, 1.0) ** 2 + doubt)),
        length=float(length),
        width=float(width),
        curvature_along=float(second[0]),
        curvature_around=float(second[1]),
        misfit=misfit,
        noise=_height_sd(
            (along - along_peak, around - around_peak, noise * inflation), length, width
        ),
        n_points=int(np.count_nonzero(inside < 1)),
        volume=float(abs(height) * np.pi / 4 * length * width * best.mean_share),
    )


def bump_shape(rho: Array, q: float = 1.0) -> Array:
    """Values of the cosine bump (1 at the peak, 0 from ρ = 1 on)."""
    t = np.minimum(rho, 1.0)
    return np.asarray(np.cos(np.pi / 2 * (t if q == 1.0 else t**q)) ** 2)


def cone(rho: Array, _q: float = 1.0) -> Array:
    """Values of a pointed bump."""
    return np.asarray(1.0 - np.minimum(rho, 1.0))


def _core_misfit(data: tuple[Array, ...], fit: _Fit) -> float:
    """Root mean square of the residuals under the bump, in units of the noise."""
    along, around, deviation, noise = data
    p = fit.parameters
    rho = np.hypot(2 * (along - p[1]) / np.exp(p[3]), 2 * (around - p[2]) / np.exp(p[4]))
    core = rho < CORE
    if np.count_nonzero(core) < 3:
        return np.inf
    model = p[0] * fit.shape(rho, fit.exponent) + p[5]
    residual = (deviation - model)[core] / noise[core]
    return float(np.sqrt(np.mean(residual**2)))


def _height_sd(data: tuple[Array, ...], length: float, width: float) -> float:
    """Noise of the height of a bump whose place and size are known."""
    along, around, noise = data
    b = bump_shape(np.hypot(2 * along / length, 2 * around / width))
    return float(1.0 / np.sqrt(max(np.sum((b / noise) ** 2), 1e-12)))


def _fit(
    data: tuple[Array, ...],
    first: Array,
    diameter: float,
    contour_sd: float,
    shape: Shape = bump_shape,
) -> _Fit:
    along, around, deviation, noise = data
    extent_log = np.log(TYPICAL_EXTENT * diameter)
    slack = 0.3 * np.exp(first[3:5])

    def residuals(p: Array) -> Array:
        q = float(np.exp(p[6])) if len(p) > 6 else 1.0
        u, v = 2 * (along - p[1]) / np.exp(p[3]), 2 * (around - p[2]) / np.exp(p[4])
        model = p[0] * shape(np.hypot(u, v), q) + p[5]
        beliefs = [
            p[0] / (HEIGHT_PRIOR * diameter),
            *(p[1:3] / slack),
            *((p[3:5] - extent_log) / EXTENT_PRIOR),
            (p[3] - p[4]) / ROUNDNESS_PRIOR,
            p[5] / max(contour_sd, 1e-5),
            np.log(q) / FORM_PRIOR,
        ]
        return np.concatenate([(deviation - model) / noise, np.asarray(beliefs)])

    scale = np.array([1e-3, slack[0] / 3, slack[1] / 3, 0.1, 0.1, 1e-3, 0.2])[: len(first)]
    answer = least_squares(
        residuals,
        first,
        method="lm",
        x_scale=scale,
        diff_step=1e-5,
        max_nfev=400,
        ftol=1e-5,
        xtol=1e-5,
    )
    information = answer.jac.T @ answer.jac
    return _Fit(answer.x, np.linalg.inv(information), 2 * float(answer.cost), shape)


def _thin(
    along: Array, around: Array, deviation: Array, noise: Array
) -> tuple[Array, Array, Array, Array]:
    """Means over a fine mesh where there are more points than the fit needs."""
    if len(along) <= MAX_POINTS:
        return along, around, deviation, noise
    mesh = 64

    def bin_of(x: Array) -> NDArray[np.intp]:
        share = (x - x.min()) / max(float(np.ptp(x)), 1e-12)
        return np.asarray(np.minimum(share * mesh, mesh - 1), dtype=np.intp)

    index = bin_of(along) * mesh + bin_of(around)
    weight = 1.0 / noise**2
    total = np.bincount(index, weight, minlength=mesh * mesh)
    some = total > 0

    def mean(x: Array) -> Array:
        return np.asarray(np.bincount(index, weight * x, minlength=mesh * mesh)[some] / total[some])

    return mean(along), mean(around), mean(deviation), 1.0 / np.sqrt(total[some])
