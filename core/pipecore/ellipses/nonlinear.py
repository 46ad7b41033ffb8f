"""The nonlinear least-squares ellipse: true distances, a covariance, and a robust variant.

Its five parameters are those of `pipecore.ellipses.distances`, which know no singularity.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipecore.ellipses.direct import fit_direct_ellipses
from pipecore.ellipses.distances import (
    N_PARAMETERS,
    canonical,
    orthogonal_distances,
    radial_distances,
    to_parameters,
)
from pipecore.reasons import Reason
from pipecore.robust import MAD_TO_SD, TUKEY_REACH, tukey_weights

Array = NDArray[np.float64]
Model = Callable[[Array, Array], tuple[Array, Array]]

SAMPLE_SIZE, N_SAMPLES = 6, 300
"""Random samples of the robust fit: with 40 % outliers, 14 of 300 are clean on average."""
N_TEST_POINTS = 500
"""About as many points rate the samples."""
MAX_CONDITION = 1e8
MAX_FLATTENING = 0.999
MAX_REACH = 100.0
"""Largest semi-major axis in units of the points' own spread."""


class Distance(StrEnum):
    """What is minimised."""

    ORTHOGONAL = "orthogonal"
    """From the nearest point of the ellipse."""
    RADIAL = "radial"
    """Along the ray from the centre: equations 2 and 3 of the paper."""


@dataclass(frozen=True, eq=False)
class PlaneEllipse:
    """An ellipse in a plane.

    Parameters
    ----------
    centre : ndarray, shape (2,)
    semi_major, semi_minor : float
    angle : float
        Of the major axis from the first coordinate, radians, in (-π/2, π/2].
    """

    centre: Array
    semi_major: float
    semi_minor: float
    angle: float


@dataclass(frozen=True, eq=False)
class FittedEllipse(PlaneEllipse):
    """An ellipse with how well the points carry it.

    Parameters
    ----------
    covariance : ndarray, shape (5, 5)
        Of centre x and y, the mean m of the semi-axes, and h·cos 2θ and h·sin 2θ, where h
        is half their difference and θ the angle.
    sigma : float
        Standard deviation of a point's distance; robust if the fit is.
    rss : float
        Sum of squared distances of the points, weighted if the fit is robust.
    weights : ndarray, shape (n,)
        Of the points, 0 to 1; all 1 unless the fit is robust.
    """

    covariance: Array
    sigma: float
    rss: float
    weights: Array

    @property
    def semi_minor_sd(self) -> float:
        """Standard deviation of the semi-minor axis."""
        # Its derivatives by the five parameters.
        g = np.array([0.0, 0.0, 1.0, -np.cos(2 * self.angle), -np.sin(2 * self.angle)])
        return float(np.sqrt(g @ self.covariance @ g))


@dataclass(frozen=True)
class NoFit:
    """Why points carry no ellipse or other curve. It is false."""

    reason: Reason

    def __bool__(self) -> Literal[False]:
        return False


def fit_nonlinear_ellipse(
    points: ArrayLike,
    start: PlaneEllipse | None = None,
    *,
    robust: bool = False,
    distance: Distance = Distance.ORTHOGONAL,
    max_sd_share: float = 0.05,
) -> FittedEllipse | NoFit:
    """Fit an ellipse by Levenberg-Marquardt.

    Parameters
    ----------
    points : array_like, shape (n, 2)
        Finite. Their order does not matter.
    start : PlaneEllipse, optional
        Where to begin; else at the direct fit, or for the robust fit at the best of many
        direct fits to random samples (least median of squares).
    robust : bool
        Whether points weigh less the further off they lie (Tukey's biweight); up to 40 %
        outliers are borne.
    distance : Distance
        The orthogonal distance has the least bias; the radial one is the paper's.
    max_sd_share : float
        The fit fails if the semi-minor axis is known less well than to this share of
        itself, at one standard deviation.

    Returns
    -------
    FittedEllipse or NoFit
        NoFit, which is false and says why, if the points do not carry a free ellipse.

    Raises
    ------
    ValueError
        If `points` is not an (n, 2) array of finite numbers.

    References
    ----------
    Paper, section 3.3.3, method 2; Ahn, Rauh & Warnecke, Least-squares orthogonal
    distances fitting of circle, sphere, ellipse, hyperbola, and parabola (2001).
    """
    xy = np.asarray(points, dtype=np.float64)
    if xy.ndim != 2 or xy.shape[1] != 2 or not np.isfinite(xy).all():
        raise ValueError("points must be an (n, 2) array of finite numbers")
    n_needed = 2 * N_PARAMETERS if robust else N_PARAMETERS + 1
    if len(xy) < n_needed:
        return NoFit(
            Reason("{n} points are too few; {needed} are needed.", n=len(xy), needed=n_needed)
        )
    middle = xy.mean(axis=0)
    scale = float(np.sqrt(((xy - middle) ** 2).sum(axis=1).mean()))
    if not scale > 1e-12 * np.abs(middle).max():
        return NoFit(Reason("All points lie in one place."))
    scaled = (xy - middle) / scale
    if np.linalg.svd(scaled, compute_uv=False)[1] < 1e-9 * np.sqrt(len(xy)):
        return NoFit(Reason("The points lie on a straight line."))

    first = _first(scaled, robust) if start is None else _start(start, middle, scale)
    if first is None:
        return NoFit(Reason("No ellipse passes near the points."))
    model = orthogonal_distances if distance is Distance.ORTHOGONAL else radial_distances
    fit = (_reweighted if robust else _least_squares)(model, scaled, first)
    if fit is None:
        return NoFit(Reason("The points do not separate an ellipse from a parabola."))
    return _in_units(fit, middle, scale, max_sd_share)


@dataclass(frozen=True, eq=False)
class _ScaledFit:
    """A fit to the scaled points."""

    parameters: Array
    covariance: Array
    sigma: float
    rss: float
    weights: Array
    condition: float


def _in_units(
    fit: _ScaledFit, middle: Array, scale: float, max_sd_share: float
) -> FittedEllipse | NoFit:
    """The fit in the units of the points, or why they do not determine it."""
    x, y, mean, cos_part, sin_part = scale * fit.parameters
    half_difference = float(np.hypot(cos_part, sin_part))
    ellipse = FittedEllipse(
        centre=middle + np.array([x, y]),
        semi_major=float(mean + half_difference),
        semi_minor=float(mean - half_difference),
        angle=float(0.5 * np.arctan2(sin_part, cos_part)),
        covariance=scale**2 * fit.covariance,
        sigma=scale * fit.sigma,
        rss=scale**2 * fit.rss,
        weights=fit.weights,
    )
    if (
        ellipse.semi_minor < (1 - MAX_FLATTENING) * ellipse.semi_major
        or ellipse.semi_major > MAX_REACH * scale
    ):
        return NoFit(Reason("The points do not separate an ellipse from a line or a parabola."))
    if fit.condition > MAX_CONDITION:
        return NoFit(Reason("The points do not determine all five parameters of an ellipse."))
    if ellipse.semi_minor_sd > max_sd_share * ellipse.semi_minor:
        share = 100 * ellipse.semi_minor_sd / ellipse.semi_minor
        return NoFit(
            Reason(
                "The arc is too short for a free ellipse: "
                "its semi-minor axis would be known to ±{share} % only.",
                share=f"{share:.0f}",
            )
        )
    return ellipse


def _start(ellipse: PlaneEllipse, middle: Array, scale: float) -> Array:
    return to_parameters(
        (ellipse.centre - middle) / scale,
        ellipse.semi_major / scale,
        ellipse.semi_minor / scale,
        ellipse.angle,
    )


def _first(points: Array, robust: bool) -> Array | None:
    return _best_of_samples(points) if robust else _direct(points)


def _direct(points: Array) -> Array | None:
    fit = fit_direct_ellipses(points, np.array([0, len(points)]))
    first = to_parameters(fit.centre[0], fit.semi_major[0], fit.semi_minor[0], fit.angle[0])
    return first if np.isfinite(first).all() else None


def _best_of_samples(points: Array) -> Array | None:
    """Direct fit to the random sample with the least median distance of all points."""
    # In a fixed order, so that the same points give the same samples.
    ordered = points[np.lexsort(points.T)]
    rng = np.random.default_rng(0)
    rows = rng.random((N_SAMPLES, len(points))).argpartition(SAMPLE_SIZE, axis=1)[:, :SAMPLE_SIZE]
    starts = np.arange(0, (N_SAMPLES + 1) * SAMPLE_SIZE, SAMPLE_SIZE)
    fits = fit_direct_ellipses(ordered[rows].reshape(-1, 2), starts)
    is_ellipse = np.isfinite(fits.centre).all(axis=1) & np.isfinite(fits.semi_major)
    is_ellipse &= np.isfinite(fits.semi_minor) & np.isfinite(fits.angle)
    if not is_ellipse.any():
        return _direct(points)
    centre, angle = fits.centre[is_ellipse], fits.angle[is_ellipse]
    semi_major, semi_minor = fits.semi_major[is_ellipse], fits.semi_minor[is_ellipse]
    tested = ordered[:: max(1, len(points) // N_TEST_POINTS)]
    x, y = (tested[:, None, i] - centre[:, i] for i in (0, 1))
    cos, sin = np.cos(angle), np.sin(angle)
    stretch = np.hypot((cos * x + sin * y) / semi_major, (cos * y - sin * x) / semi_minor)
    off = np.abs(np.hypot(x, y) * (1 - 1 / np.maximum(stretch, 1e-9)))
    best = np.argmin(np.median(off, axis=0))
    return to_parameters(centre[best], semi_major[best], semi_minor[best], angle[best])


def _least_squares(model: Model, points: Array, first: Array) -> _ScaledFit | None:
    """Fit with equal weights; None if it does not converge."""
    weights = np.ones(len(points))
    parameters, rss = _descend(model, points, first, weights, max_evaluations=100)
    if parameters is None:
        return None
    variance = rss / (len(points) - N_PARAMETERS)
    inverse, condition = _inverse_normal(model(points, parameters)[1])
    return _ScaledFit(parameters, variance * inverse, np.sqrt(variance), rss, weights, condition)


def _descend(
    model: Model, points: Array, first: Array, weights: Array, max_evaluations: int
) -> tuple[Array | None, float]:
    """Levenberg-Marquardt: parameters, None if it does not converge, and the sum of squares."""
    root = np.sqrt(weights)

    def residuals(parameters: Array) -> Array:
        return root * model(points, parameters)[0]

    def jacobian(parameters: Array) -> Array:
        return root[:, None] * model(points, parameters)[1]

    from scipy.optimize import least_squares  # noqa: PLC0415 - slow to import, seldom used

    solution = least_squares(
        residuals, first, jacobian, method="lm", xtol=1e-9, ftol=1e-12, max_nfev=max_evaluations
    )
    is_settled = solution.status > 0 and np.isfinite(solution.x).all()
    return canonical(solution.x) if is_settled else None, 2.0 * float(solution.cost)


def _inverse_normal(jacobian: Array) -> tuple[Array, float]:
    """(JᵀJ)⁻¹ and the condition number of J, inf where it is singular."""
    singular, rotation = np.linalg.svd(jacobian, full_matrices=False)[1:]
    if not singular[-1] > 1e-15 * singular[0]:
        return np.full((N_PARAMETERS, N_PARAMETERS), np.inf), np.inf
    return (rotation.T / singular**2) @ rotation, float(singular[0] / singular[-1])


def _reweighted(model: Model, points: Array, first: Array) -> _ScaledFit | None:
    """Iteratively reweighted fit with Tukey's biweight and a covariance after Huber."""
    parameters = first
    distances = model(points, parameters)[0]
    sigma = _spread(distances)
    for _ in range(30):
        weights = tukey_weights(distances / (TUKEY_REACH * sigma))
        if (weights > 0).sum() <= N_PARAMETERS:
            return None
        found, _ = _descend(model, points, parameters, weights, max_evaluations=100)
        if found is None:
            return None
        moved = float(np.abs(found - parameters).max())
        parameters = found
        distances = model(points, parameters)[0]
        # It only narrows, so that the iteration ends.
        sigma = min(sigma, _spread(distances[weights > 0]))
        if moved < 1e-7:
            break
    q = distances / (TUKEY_REACH * sigma)
    weights = tukey_weights(q)
    near = weights > 0
    n_near = int(near.sum())
    slope = float(((1 - q**2) * (1 - 5 * q**2))[near].mean()) if n_near > N_PARAMETERS else 0.0
    if slope <= 0:
        return None
    variance = ((weights * distances) ** 2).sum() / (n_near - N_PARAMETERS) / slope**2
    inverse, condition = _inverse_normal(model(points[near], parameters)[1])
    rss = float((weights * distances**2).sum())
    return _ScaledFit(parameters, variance * inverse, sigma, rss, weights, condition)


def _spread(distances: Array) -> float:
    """Standard deviation from the median distance, for few points too; never zero."""
    correction = 1 + 5 / (len(distances) - N_PARAMETERS)
    return max(MAD_TO_SD * correction * float(np.median(np.abs(distances))), 1e-10)
