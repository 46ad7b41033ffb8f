"""The nonlinear least-squares ellipse: true distances, a covariance, and a robust variant.

The curve is c + S·(cos t, sin t) with a symmetric S. Its five parameters, the centre, the
mean semi-axis and the two components of half the difference of the semi-axes, have no
singularity at the circle, where an axis ratio and an angle would have one.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import least_squares

from pipecore.ellipses.direct import fit_direct_ellipses

Array = NDArray[np.float64]
Model = Callable[[Array, Array], tuple[Array, Array]]

N_PARAMETERS = 5
SAMPLE_SIZE, N_SAMPLES = 6, 300
"""Random samples of the robust fit: with 40 % outliers, 14 of 300 are clean on average."""
TUKEY_REACH = 4.685
"""In standard deviations: 95 % as efficient as least squares where there are no outliers."""
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
    def centre_sd(self) -> Array:
        """Standard deviations of the centre's coordinates, shape (2,)."""
        return np.sqrt(np.diag(self.covariance)[:2])

    @property
    def semi_major_sd(self) -> float:
        """Standard deviation of the semi-major axis."""
        return self._sd(0.0, 0.0, 1.0, np.cos(2 * self.angle), np.sin(2 * self.angle))

    @property
    def semi_minor_sd(self) -> float:
        """Standard deviation of the semi-minor axis."""
        return self._sd(0.0, 0.0, 1.0, -np.cos(2 * self.angle), -np.sin(2 * self.angle))

    @property
    def angle_sd(self) -> float:
        """Standard deviation of the angle, radians; inf for a circle."""
        h = 0.5 * (self.semi_major - self.semi_minor)
        across = self._sd(0.0, 0.0, 0.0, -np.sin(2 * self.angle), np.cos(2 * self.angle))
        return across / (2 * h) if h > 0 else np.inf

    def _sd(self, *gradient: float) -> float:
        g = np.array(gradient)
        return float(np.sqrt(g @ self.covariance @ g))


@dataclass(frozen=True)
class NoFit:
    """Why points carry no ellipse. It is false."""

    reason: str

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
        return NoFit(f"{len(xy)} points are too few; {n_needed} are needed.")
    middle = xy.mean(axis=0)
    scale = float(np.sqrt(((xy - middle) ** 2).sum(axis=1).mean()))
    if not scale > 1e-12 * np.abs(middle).max():
        return NoFit("All points lie in one place.")
    scaled = (xy - middle) / scale
    if np.linalg.svd(scaled, compute_uv=False)[1] < 1e-9 * np.sqrt(len(xy)):
        return NoFit("The points lie on a straight line.")

    model = _orthogonal if distance is Distance.ORTHOGONAL else _radial
    if start is not None:
        first = _parameters((start.centre - middle) / scale, start.semi_major / scale,
                            start.semi_minor / scale, start.angle)  # fmt: skip
    else:
        first = _best_of_samples(scaled) if robust else _direct(scaled)
    if first is None:
        return NoFit("No ellipse passes near the points.")
    fit = _reweighted(model, scaled, first) if robust else _least_squares(model, scaled, first)
    if fit is None:
        return NoFit("The fit does not settle: the points do not tell an ellipse from a parabola.")
    result = _scaled_back(fit, middle, scale)
    flattening = 1 - result.semi_minor / result.semi_major
    if flattening > MAX_FLATTENING or result.semi_major > MAX_REACH * scale:
        return NoFit("The points do not tell an ellipse from a line or a parabola.")
    if fit.condition > MAX_CONDITION:
        return NoFit("The points do not determine all five parameters of an ellipse.")
    if result.semi_minor_sd > max_sd_share * result.semi_minor:
        share = 100 * result.semi_minor_sd / result.semi_minor
        return NoFit(
            f"The arc is too short for a free ellipse: its semi-minor axis is known to ±{share:.0f} % only."
        )
    return result


@dataclass(frozen=True, eq=False)
class _Fit:
    """A fit to the scaled points."""

    parameters: Array
    covariance: Array
    sigma: float
    rss: float
    weights: Array
    condition: float


def _scaled_back(fit: _Fit, middle: Array, scale: float) -> FittedEllipse:
    x, y, mean, cos_part, sin_part = scale * fit.parameters
    half_difference = float(np.hypot(cos_part, sin_part))
    axes = sorted((abs(mean - half_difference), abs(mean + half_difference)))
    return FittedEllipse(
        centre=middle + np.array([x, y]),
        semi_major=float(axes[1]),
        semi_minor=float(axes[0]),
        angle=float(0.5 * np.arctan2(sin_part, cos_part)),
        covariance=scale**2 * fit.covariance,
        sigma=scale * fit.sigma,
        rss=scale**2 * fit.rss,
        weights=fit.weights,
    )


def _parameters(centre: Array, semi_major: float, semi_minor: float, angle: float) -> Array:
    mean, half_difference = 0.5 * (semi_major + semi_minor), 0.5 * (semi_major - semi_minor)
    cos_part, sin_part = half_difference * np.cos(2 * angle), half_difference * np.sin(2 * angle)
    return np.array([*centre, mean, cos_part, sin_part])


def _direct(points: Array) -> Array | None:
    fit = fit_direct_ellipses(points, np.array([0, len(points)]))
    first = _parameters(fit.centre[0], fit.semi_major[0], fit.semi_minor[0], fit.angle[0])
    return first if np.isfinite(first).all() else None


def _best_of_samples(points: Array) -> Array | None:
    """Direct fit to the random sample with the least median distance of all points."""
    # In a fixed order, so that the same points give the same samples.
    ordered = points[np.lexsort(points.T)]
    rng = np.random.default_rng(0)
    rows = rng.random((N_SAMPLES, len(points))).argpartition(SAMPLE_SIZE, axis=1)[:, :SAMPLE_SIZE]
    starts = np.arange(0, (N_SAMPLES + 1) * SAMPLE_SIZE, SAMPLE_SIZE)
    fits = fit_direct_ellipses(ordered[rows].reshape(-1, 2), starts)
    table = np.column_stack([fits.centre, fits.semi_major, fits.semi_minor, fits.angle])
    candidates = [_parameters(row[:2], *row[2:]) for row in table[np.isfinite(table).all(axis=1)]]
    whole = _direct(points)
    candidates += [] if whole is None else [whole]
    medians = [float(np.median(np.abs(_radial(points, c)[0]))) for c in candidates]
    return candidates[int(np.argmin(medians))] if candidates else None


def _least_squares(
    model: Model, points: Array, first: Array, weights: Array | None = None
) -> _Fit | None:
    """Levenberg-Marquardt; None if it does not converge."""
    weights = np.ones(len(points)) if weights is None else weights
    root = np.sqrt(weights)

    def residuals(parameters: Array) -> Array:
        return root * model(points, parameters)[0]

    def jacobian(parameters: Array) -> Array:
        return root[:, None] * model(points, parameters)[1]

    solution = least_squares(
        residuals, first, jacobian, method="lm", xtol=1e-9, ftol=1e-12, max_nfev=100
    )
    if solution.status <= 0 or not np.isfinite(solution.x).all():
        return None
    singular, rotation = np.linalg.svd(solution.jac, full_matrices=False)[1:]
    if not singular[-1] > 0:
        return None
    rss = 2.0 * float(solution.cost)
    variance = rss / (len(points) - N_PARAMETERS)
    covariance = variance * (rotation.T / singular**2) @ rotation
    condition = float(singular[0] / singular[-1])
    return _Fit(solution.x, covariance, np.sqrt(variance), rss, weights, condition)


def _reweighted(model: Model, points: Array, first: Array) -> _Fit | None:
    """Iteratively reweighted fit with Tukey's biweight and a covariance after Huber."""
    parameters, fit = first, None
    distances = model(points, parameters)[0]
    sigma = _spread(distances)
    for _ in range(30):
        weights = _tukey(distances / (TUKEY_REACH * sigma))
        if (weights > 0).sum() <= N_PARAMETERS:
            return None
        fit = _least_squares(model, points, parameters, weights)
        if fit is None:
            return None
        moved = float(np.abs(fit.parameters - parameters).max())
        parameters = fit.parameters
        distances = model(points, parameters)[0]
        # It only narrows, so that the iteration ends.
        sigma = min(sigma, _spread(distances))
        if moved < 1e-9:
            break
    assert fit is not None
    q = distances / (TUKEY_REACH * sigma)
    weights = _tukey(q)
    near = weights > 0
    n_near = int(near.sum())
    slope = np.where(near, (1 - q**2) * (1 - 5 * q**2), 0.0).sum() / n_near
    if n_near <= N_PARAMETERS or slope <= 0:
        return None
    variance = (weights * distances**2 * weights).sum() / (n_near - N_PARAMETERS) / slope**2
    jacobian = model(points[near], parameters)[1]
    singular, rotation = np.linalg.svd(jacobian, full_matrices=False)[1:]
    if not singular[-1] > 0:
        return None
    covariance = variance * (rotation.T / singular**2) @ rotation
    condition = float(singular[0] / singular[-1])
    rss = float((weights * distances**2).sum())
    return _Fit(parameters, covariance, sigma, rss, weights, condition)


def _spread(distances: Array) -> float:
    """Standard deviation from the median distance, for few points too; never zero."""
    correction = 1 + 5 / (len(distances) - N_PARAMETERS)
    return max(1.4826 * correction * float(np.median(np.abs(distances))), 1e-10)


def _tukey(q: Array) -> Array:
    return np.where(np.abs(q) < 1, (1 - q**2) ** 2, 0.0)


def _orthogonal(points: Array, parameters: Array) -> tuple[Array, Array]:
    """Signed orthogonal distances (n,), outside positive, and their derivatives (n, 5).

    The foot of a point slides along the ellipse, across the normal n, so the distance
    changes only with the ellipse's own motion at the foot: -n·∂(c + S·u).
    """
    mean, cos_part, sin_part = parameters[2:]
    half_difference = np.hypot(cos_part, sin_part)
    angle = 0.5 * np.arctan2(sin_part, cos_part)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    axes = np.array([mean + half_difference, mean - half_difference])
    # A trial step may turn an axis round: the curve is the same with its length positive.
    lengths = np.maximum(np.abs(axes), 1e-9)
    own = (points - parameters[:2]) @ turn
    on_circle = _foot_on_circle(np.abs(own), lengths) * np.where(own < 0, -1.0, 1.0)
    normal = on_circle / lengths
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    distance = ((own - on_circle * lengths) * normal).sum(axis=1)
    (ux, uy), (nx, ny) = turn @ (on_circle * np.sign(axes)).T, turn @ normal.T
    jacobian = -np.column_stack([nx, ny, nx * ux + ny * uy, nx * ux - ny * uy, nx * uy + ny * ux])
    return distance, jacobian


def _foot_on_circle(points: Array, axes: Array) -> Array:
    """Where the unit circle holds the nearest points of an ellipse with these semi-axes.

    Newton's iteration for t in (a x / (t + a²))² + (b y / (t + b²))² = 1; from the left
    of the root, where it starts, it converges without leaving that side, for any point.
    """
    stretched = np.maximum(points, 1e-14 * axes) * axes
    t = (stretched - axes**2).max(axis=1)
    ratio = stretched / (t[:, None] + axes**2)
    for _ in range(60):
        excess = (ratio**2).sum(axis=1) - 1
        step = 0.5 * excess / (ratio**2 / (t[:, None] + axes**2)).sum(axis=1)
        t += np.maximum(step, 0.0)
        ratio = stretched / (t[:, None] + axes**2)
        if excess.max() < 1e-12:
            break
    return np.asarray(ratio / np.linalg.norm(ratio, axis=1, keepdims=True))


def _radial(points: Array, parameters: Array) -> tuple[Array, Array]:
    """Distances along the rays from the centre (n,), and their derivatives (n, 5).

    v = d - r, equations 2 and 3 of the paper: with y = S⁻¹(x - c) the ray meets the
    ellipse at r = d / |y|.
    """
    x, y, mean, cos_part, sin_part = parameters
    inverse = np.linalg.inv(np.array([[mean + cos_part, sin_part], [sin_part, mean - cos_part]]))
    offset = points - np.array([x, y])
    d = np.linalg.norm(offset, axis=1)
    on_unit = offset @ inverse
    rho = np.linalg.norm(on_unit, axis=1)
    gradient = (on_unit @ inverse) / rho[:, None]
    (gx, gy), (ux, uy) = gradient.T, on_unit.T
    ray = (offset / d[:, None]) * (1 - 1 / rho)[:, None]
    by_scale = -(d / rho**2)[:, None]
    by_shape = np.column_stack([gx * ux + gy * uy, gx * ux - gy * uy, gx * uy + gy * ux])
    jacobian = np.column_stack([by_scale * gradient - ray, by_scale * by_shape])
    return d * (1 - 1 / rho), jacobian
