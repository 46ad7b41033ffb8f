"""The shape of one dent or bulge: a smooth bump fitted to its points.

The bump is h·b(ρ) + c over an ellipse, where ρ is the distance from its peak in shares of
half its length and half its width, and c is what the contour may be off by. Its section
b is a cosine, cos²(π/2 · ρᑫ), plain for q = 1 and flat-bottomed above, or the frustum of a
cone whose flat top may be a point. Only deep dents show which of them it is: the
depth is the mean of theirs, each weighted by how likely it is (AIC), and that they differ
is part of its uncertainty. The extents are those of the likeliest.
Length and width are where the bump has come back to zero, so that a cosine bump of
nominal extent has just that extent.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipecore._kernels import bump_fit as kernels
from pipecore.geometry import Array

MAX_POINTS = 6000
MAX_EVALUATIONS, TOLERANCE = 60, 1e-5
"""A fit ends after so many evaluations, or where χ² changes by less than this fraction."""

MIN_EXTENT, MAX_LENGTH, MAX_WIDTH = 0.1, 3.0, 1.5
"""Bounds of a bump's extents, shares of the outside diameter: beyond, it is no dent."""

TYPICAL_EXTENT, EXTENT_PRIOR = 0.5, 1.0
"""Prior of the extents: typical fraction of the diameter, and the SD of its logarithm."""

FORMS_SIGNIFICANCE = 6.0
"""Significance from which other forms are fitted as well (flat-bottomed, pointed)."""

CORE_EXTENT = 0.75
"""Residuals are judged up to this fraction of the half extents."""

PEAK_EXTENT, MIN_PEAK_POINTS = 0.5, 2
"""Fraction of the half extents around the peak, and how many points must lie within it."""

HEIGHT_PRIOR = 0.5
"""Prior standard deviation of heights, fraction of the diameter."""

FORM_PENALTY = 2.0
"""Penalty on the AIC of forms other than the plain cosine."""

ROUNDNESS_PRIOR = 0.5
"""Weak prior: standard deviation of log(length / width) around 0."""


@dataclass(frozen=True)
class Form:
    """A family of sections: height at ρ given q, and the prior SD of log q around 0.

    `number` is its code in the kernels.
    """

    number: int
    section: Callable[[Array, float], Array]
    prior: float


@dataclass(frozen=True, eq=False)
class Bump:
    """A fitted bump; lengths in metres in the plane of the unrolled surface.

    `height` is signed (outward positive); `curvature_along` and `curvature_around` are
    the magnitudes of the second derivatives at the peak of the cosine (1/metres). `misfit`
    is the root mean square of the residuals under it in units of their noise, `noise` the
    standard deviation of the height of a bump whose place and form are known. `volume`
    (metres³, positive) lies between the bump and the undeformed surface. Where no points
    lie near the peak (`is_peak_seen`), the height is no more than a guess.
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
    is_peak_seen: bool

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
    form: Form

    @property
    def exponent(self) -> float:
        """The q of its shape."""
        return float(np.exp(self.parameters[6])) if len(self.parameters) > 6 else 1.0

    @property
    def mean_share(self) -> float:
        """Mean height over the ellipse as a share of the peak's: ∫ 2ρ b(ρ) dρ."""
        rho = (np.arange(200) + 0.5) / 200
        return float(np.mean(2 * rho * self.form.section(rho, self.exponent)))

    @property
    def aic(self) -> float:
        """Akaike's criterion, with a penalty on the less common forms."""
        is_plain = self.form is BELL and len(self.parameters) == 6
        return self.chi2 + 2 * len(self.parameters) + (0.0 if is_plain else FORM_PENALTY)


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
    """Fit a bump to points in the plane of the unrolled surface.

    Parameters
    ----------
    along, around : ndarray, shape (n,)
        Distances from the expected peak along the pipe and around it, metres.
    deviation, noise : ndarray, shape (n,)
        Height above the contour and its standard deviation, metres.
    start : tuple of float
        Height, length and width to start from, metres.
    diameter : float
        Of the pipe, metres.
    contour_sd : float
        Standard deviation of the contour's height there, metres.
    inflation : float
        Factor by which correlated noise widens the standard deviation of means.

    Returns
    -------
    Bump or None
        None if the points do not define one within the bounds on its extents.
    """
    height, length, width = start
    first = np.array([height, 0.0, 0.0, np.log(length), np.log(width), 0.0])
    for _ in range(2):  # the second time with a window that suits the extents found
        near = (np.abs(along) < 0.8 * length) & (np.abs(around) < 0.8 * width)
        if np.count_nonzero(near) < 8:
            return None
        points = _binned_means(along[near], around[near], deviation[near], noise[near] * inflation)
        plain = _fit(points, first, diameter, contour_sd)
        first = plain.parameters
        length, width = np.exp(first[3:5])
        if min(length, width) < MIN_EXTENT * diameter:
            return None
        if length > MAX_LENGTH * diameter or width > MAX_WIDTH * diameter:
            return None
    fits = [plain]
    if abs(first[0]) > FORMS_SIGNIFICANCE * _height_sd(points, length, width):
        fits.append(_fit(points, np.append(first, 0.0), diameter, contour_sd))
        fits.append(_fit(points, first, diameter, contour_sd, CONE))
        fits.append(_fit(points, np.append(first, 0.0), diameter, contour_sd, FRUSTUM))
    best = min(fits, key=lambda fit: fit.aic)
    # That it may be another form is part of the uncertainty of the height.
    likely = np.exp(-0.5 * (np.array([fit.aic for fit in fits]) - best.aic))
    likely /= likely.sum()
    heights = np.array([fit.parameters[0] for fit in fits])
    height = float(likely @ heights)
    variance = likely @ [float(fit.covariance[0, 0]) for fit in fits]
    doubt = float(likely @ (heights - height) ** 2)
    along_peak, around_peak = best.parameters[1:3]
    length, width = np.exp(best.parameters[3:5])
    misfit = _core_misfit(points, best)
    inside = np.hypot(2 * (along - along_peak) / length, 2 * (around - around_peak) / width)
    # Curvatures from the plain cosine: exponents make them zero or infinite at the peak.
    second = 2 * np.pi**2 * abs(plain.parameters[0]) / np.exp(2 * plain.parameters[3:5])
    return Bump(
        along=float(along_peak),
        around=float(around_peak),
        height=float(height),
        height_sd=float(np.sqrt(variance * max(misfit, 1.0) ** 2 + doubt)),
        length=float(length),
        width=float(width),
        curvature_along=float(second[0]),
        curvature_around=float(second[1]),
        misfit=misfit,
        noise=_height_sd(
            kernels.BumpPoints(
                along - along_peak, around - around_peak, deviation, noise * inflation
            ),
            length,
            width,
        ),
        n_points=int(np.count_nonzero(inside < 1)),
        volume=float(abs(height) * np.pi / 4 * length * width * best.mean_share),
        is_peak_seen=bool(np.count_nonzero(inside < PEAK_EXTENT) >= MIN_PEAK_POINTS),
    )


def bump_shape(rho: Array, q: float = 1.0) -> Array:
    """Return the height of the cosine bump, 1 at the peak and 0 from ρ = 1 on.

    Parameters
    ----------
    rho : ndarray
        Distance from the peak, fraction of the half extents.
    q : float
        Exponent: 1 for a plain cosine, larger for a flat bottom.

    Returns
    -------
    ndarray, shape of rho
    """
    t = np.minimum(rho, 1.0)
    return np.asarray(np.cos(np.pi / 2 * (t if q == 1.0 else t**q)) ** 2)


def cone(rho: Array, _q: float = 1.0) -> Array:
    """Return the height of a cone, 1 at the peak and 0 from ρ = 1 on.

    Parameters
    ----------
    rho : ndarray
        Distance from the peak, fraction of the half extents.

    Returns
    -------
    ndarray, shape of rho
    """
    return np.asarray(1.0 - np.minimum(rho, 1.0))


def frustum(rho: Array, q: float = 1.0) -> Array:
    """Return the height of a frustum, flat up to ρ = q / (1 + q) and 0 from ρ = 1 on.

    Parameters
    ----------
    rho : ndarray
        Distance from the peak, fraction of the half extents.
    q : float
        Shape; 0 for a cone.

    Returns
    -------
    ndarray, shape of rho
    """
    return np.asarray(np.clip((1.0 - rho) * (1.0 + q), 0.0, 1.0))


BELL = Form(kernels.BELL, bump_shape, 0.4)
CONE = Form(kernels.CONE, cone, 0.4)
FRUSTUM = Form(kernels.FRUSTUM, frustum, 0.7)


def _core_misfit(points: kernels.BumpPoints, fit: _Fit) -> float:
    """Root mean square of the residuals under the bump, in units of the noise."""
    along, around, deviation, noise = points
    p = fit.parameters
    rho = np.hypot(2 * (along - p[1]) / np.exp(p[3]), 2 * (around - p[2]) / np.exp(p[4]))
    core = rho < CORE_EXTENT
    if np.count_nonzero(core) < 3:
        return np.inf
    model = p[0] * fit.form.section(rho, fit.exponent) + p[5]
    residual = (deviation - model)[core] / noise[core]
    return float(np.sqrt(np.mean(residual**2)))


def _height_sd(points: kernels.BumpPoints, length: float, width: float) -> float:
    """Noise of the height of a bump whose place and size are known."""
    b = bump_shape(np.hypot(2 * points.along / length, 2 * points.around / width))
    return float(1.0 / np.sqrt(max(np.sum((b / points.noise) ** 2), 1e-12)))


def _fit(
    points: kernels.BumpPoints,
    first: Array,
    diameter: float,
    contour_sd: float,
    form: Form | None = None,
) -> _Fit:
    form = form or BELL
    slack = 0.3 * np.exp(first[3:5])

    n_free = len(first)
    # Priors are residuals too: slopes · p - middle.
    slopes = np.zeros((8, n_free))
    slopes[0, 0] = 1.0 / (HEIGHT_PRIOR * diameter)
    slopes[[1, 2], [1, 2]] = 1.0 / slack
    slopes[[3, 4], [3, 4]] = 1.0 / EXTENT_PRIOR
    slopes[5, 3:5] = 1.0 / ROUNDNESS_PRIOR, -1.0 / ROUNDNESS_PRIOR
    slopes[6, 5] = 1.0 / max(contour_sd, 1e-5)
    slopes[7, 6:] = 1.0 / form.prior
    middle = np.zeros(8)
    middle[3:5] = np.log(TYPICAL_EXTENT * diameter) / EXTENT_PRIOR

    p, normal = np.empty(n_free), np.empty((n_free, n_free))
    prior = kernels.BumpPrior(slopes, middle)
    chi2 = kernels.fit(form.number, first, points, prior, MAX_EVALUATIONS, TOLERANCE, p, normal)
    return _Fit(p, np.asarray(np.linalg.inv(normal), np.float64), chi2, form)


def _binned_means(
    along: Array, around: Array, deviation: Array, noise: Array
) -> kernels.BumpPoints:
    """Weighted means over a fine mesh where there are more points than the fit needs."""
    if len(along) <= MAX_POINTS:
        return kernels.BumpPoints(along, around, deviation, noise)
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

    return kernels.BumpPoints(
        mean(along), mean(around), mean(deviation), 1.0 / np.sqrt(total[some])
    )
