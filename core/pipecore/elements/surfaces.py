"""Cylinders, cones, tori and spheres fitted to points: robust geometric least squares.

Residuals are signed distances along the radius, positive outside. Each model gives
residuals with their derivatives, and takes a step of its parameters; `fit_surface` is
the same iteration for all.
"""

import math
from dataclasses import dataclass
from typing import Generic, Protocol, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from pipecore.geometry import ArcAxis, LineAxis, unit

Array = NDArray[np.float64]


NORMAL_STEPS = np.array([-2.334, -0.742, 0.742, 2.334]), np.array([0.0459, 0.4541, 0.4541, 0.0459])
"""Nodes and weights of Gauss and Hermite's quadrature for the standard normal distribution."""
ONE_SIDED = 0.55
"""Length of the mean of a surface's normals from which on it is seen from one side (200°)."""


class SurfaceModel(Protocol):
    """A surface about an axis, with parameters that a fit can step."""

    @property
    def radius(self) -> float:
        """Radius, at the start for a cone."""
        ...

    @property
    def radius_parameter(self) -> int:
        """Which parameter is the radius."""
        ...

    def residuals(self, xyz: Array) -> tuple[Array, Array, Array]:
        """Signed distances (n,), derivatives (n, p), and outward unit vectors (n, 3)."""
        ...

    def stepped(self, step: Array) -> Self:
        """The model with its parameters moved by `step` (p,)."""
        ...


Model = TypeVar("Model", bound=SurfaceModel)


def _across(direction: Array) -> tuple[Array, Array]:
    x, y, z = direction.tolist()
    # Scalars: for single vectors np.cross takes most of a fit's time.
    if abs(x) <= abs(y) and abs(x) <= abs(z):
        e1 = np.array([0.0, -z, y]) / math.hypot(y, z)
    elif abs(y) <= abs(z):
        e1 = np.array([z, 0.0, -x]) / math.hypot(x, z)
    else:
        e1 = np.array([-y, x, 0.0]) / math.hypot(x, y)
    u, v, w = e1.tolist()
    return e1, np.array([y * w - z * v, z * u - x * w, x * v - y * u])


@dataclass(frozen=True, eq=False)
class LineSurface:
    """A cylinder, or with `is_tapered` a cone: radius + slope · chainage from the middle."""

    middle: Array
    direction: Array
    radius: float
    slope: float = 0.0
    is_tapered: bool = False

    radius_parameter = 4

    @property
    def position(self) -> Array:
        """A point that tells it from others."""
        return self.middle

    def residuals(self, xyz: Array) -> tuple[Array, Array, Array]:
        """Signed distances, derivatives and outward unit vectors."""
        e1, e2 = _across(self.direction)
        q = xyz - self.middle
        s, u, v = q @ self.direction, q @ e1, q @ e2
        rho = np.hypot(u, v)
        cos, sin = u / rho, v / rho
        scale = 1.0 / np.hypot(1.0, self.slope)
        columns = [-cos, -sin, -s * cos, -s * sin, -np.ones_like(s)]
        if self.is_tapered:
            columns.append(-s)
        outward = cos[:, None] * e1 + sin[:, None] * e2
        if self.slope:
            outward = scale * (outward - self.slope * self.direction)
        residual = scale * (rho - self.radius - self.slope * s)
        return residual, scale * np.stack(columns, axis=1), outward

    def stepped(self, step: Array) -> "LineSurface":
        """The model moved by a step of offset (2), tilt (2), radius and slope."""
        e1, e2 = _across(self.direction)
        return LineSurface(
            self.middle + step[0] * e1 + step[1] * e2,
            unit(self.direction + step[2] * e1 + step[3] * e2),
            self.radius + step[4],
            self.slope + step[5] if self.is_tapered else 0.0,
            self.is_tapered,
        )

    def radius_at(self, point: Array) -> float:
        """Radius abreast of a point."""
        return float(self.radius + self.slope * ((point - self.middle) @ self.direction))

    def axis_between(self, low: float, high: float) -> LineAxis:
        """The axis from chainage `low` to `high`, counted from the middle."""
        return LineAxis(self.middle + low * self.direction, self.direction, high - low)


@dataclass(frozen=True, eq=False)
class ArcSurface:
    """A torus about the circle of `bend_radius` around `centre`."""

    centre: Array
    normal: Array
    bend_radius: float
    radius: float

    radius_parameter = 6

    @property
    def position(self) -> Array:
        """A point that tells it from others."""
        return self.centre

    def residuals(self, xyz: Array) -> tuple[Array, Array, Array]:
        """Signed distances, derivatives and outward unit vectors."""
        e1, e2 = _across(self.normal)
        q = xyz - self.centre
        u, v, h = q @ e1, q @ e2, q @ self.normal
        in_plane = np.hypot(u, v)
        a = in_plane - self.bend_radius
        rho = np.hypot(a, h)
        cos, sin = a / rho, h / rho
        out = (u / in_plane)[:, None] * e1 + (v / in_plane)[:, None] * e2
        outward = cos[:, None] * out + sin[:, None] * self.normal
        # Tilting the normal by w: the height changes by u·w1 + v·w2.
        per_height = sin - cos * h / in_plane
        columns = np.concatenate(
            [
                -outward,
                (per_height * u)[:, None],
                (per_height * v)[:, None],
                -cos[:, None],
                -np.ones((len(xyz), 1)),
            ],
            axis=1,
        )
        return rho - self.radius, columns, outward

    def stepped(self, step: Array) -> "ArcSurface":
        """The model moved by a step of centre (3), tilt (2), bend radius and radius."""
        e1, e2 = _across(self.normal)
        return ArcSurface(
            self.centre + step[:3],
            unit(self.normal + step[3] * e1 + step[4] * e2),
            self.bend_radius + step[5],
            self.radius + step[6],
        )

    def axis_from(self, towards_start: Array, angle: float) -> ArcAxis:
        """The axis that starts in the given direction from the centre."""
        across = towards_start - (towards_start @ self.normal) * self.normal
        return ArcAxis(self.centre, self.normal, unit(across), self.bend_radius, angle)


@dataclass(frozen=True, eq=False)
class SphereSurface:
    """A sphere."""

    centre: Array
    radius: float

    radius_parameter = 3

    @property
    def position(self) -> Array:
        """A point that tells it from others."""
        return self.centre

    def residuals(self, xyz: Array) -> tuple[Array, Array, Array]:
        """Signed distances, derivatives and outward unit vectors."""
        q = xyz - self.centre
        rho = np.linalg.norm(q, axis=1)
        outward = q / rho[:, None]
        columns = np.concatenate([-outward, -np.ones((len(q), 1))], axis=1)
        return rho - self.radius, columns, outward

    def stepped(self, step: Array) -> "SphereSurface":
        """The model moved by a step of centre (3) and radius."""
        return SphereSurface(self.centre + step[:3], self.radius + step[3])


@dataclass(frozen=True, eq=False)
class SurfaceFit(Generic[Model]):
    """A fitted surface with what the fit tells of it."""

    model: Model
    covariance: Array
    sigma: float
    n_used: int

    @property
    def radius_sd(self) -> float:
        """Standard deviation of the radius, metres."""
        k = self.model.radius_parameter
        return float(np.sqrt(self.covariance[k, k]))


def robust_sigma(residuals: Array) -> float:
    """Standard deviation from the median absolute residual."""
    return float(1.4826 * np.median(np.abs(residuals)))


def _tukey_weights(residuals: Array, reach: float) -> Array:
    """Weights that fall to zero at `reach`."""
    return np.where(np.abs(residuals) < reach, (1 - (residuals / reach) ** 2) ** 2, 0.0)


def fit_surface(
    model: Model, xyz: Array, scale: float, n_iterations: int = 30
) -> SurfaceFit[Model] | None:
    """Fit a surface to points by Gauss-Newton with Tukey's weights.

    Parameters
    ----------
    model : SurfaceModel
        Where to start; within a few `scale` of the points.
    xyz : ndarray, shape (n, 3)
    scale : float
        First guess of the points' standard deviation; it shrinks to what they show.
    n_iterations : int

    Returns
    -------
    SurfaceFit or None
        None where the points do not carry the surface.
    """
    for _ in range(n_iterations):
        residual, jacobian, _ = model.residuals(xyz)
        reach = 4.685 * scale
        weight = _tukey_weights(residual, reach)
        weighted = weight[:, None] * jacobian
        normal_matrix = jacobian.T @ weighted
        n_used = int((weight > 0).sum())
        if n_used < 3 * jacobian.shape[1]:
            return None
        diagonal = np.sqrt(np.maximum(np.diag(normal_matrix), 1e-300))
        scaled = normal_matrix / np.outer(diagonal, diagonal)
        if np.linalg.cond(scaled) > 1e10:
            return None
        step = np.linalg.solve(scaled, -(weighted.T @ residual) / diagonal) / diagonal
        model = model.stepped(step)
        if not model.radius > 0:
            return None
        shown = robust_sigma(residual[np.abs(residual) < reach])
        change = abs(shown - scale)
        scale = min(scale, max(shown, 0.7 * scale, 1e-5))
        if np.abs(jacobian @ step).max() < 1e-6 and change < 0.02 * scale:
            break
    residual, jacobian, outward = model.residuals(xyz)
    reach = 4.685 * scale
    is_used = np.abs(residual) < reach
    n, p = int(is_used.sum()), jacobian.shape[1]
    if n < 3 * p:
        return None
    residual, jacobian, outward = residual[is_used], jacobian[is_used], outward[is_used]
    # Huber's covariance of an M-estimator; points need not all scatter alike.
    ratio = (residual / reach) ** 2
    pull = _tukey_weights(residual, reach) * residual
    slope = float(((1 - ratio) * (1 - 5 * ratio)).mean())
    inverse = np.linalg.pinv(slope * jacobian.T @ jacobian)
    scatter = (pull[:, None] ** 2 * jacobian).T @ jacobian * (n / (n - p))
    sigma = robust_sigma(residual)
    on_surface = xyz[is_used] - residual[:, None] * outward
    shift = inverse @ _beam_pull(model, on_surface, outward, residual, reach)
    return SurfaceFit(model.stepped(shift), inverse @ scatter @ inverse, sigma, n)


def _beam_pull(
    model: SurfaceModel, xyz: Array, outward: Array, residuals: Array, reach: float
) -> Array:
    """What noise along the laser's beam adds to the normal equations, on average.

    A point that is moved along its beam moves across the surface and along it at once, so
    that its distance from the surface and the place where that is counted go together. On a
    pipe seen from one side the fitted radius is too small by about σ²/r for it, however
    many points there are. Here points on the surface are moved along the beam, and the
    mean is taken over normal noise by Gauss and Hermite's quadrature. The beam is the mean
    direction in which the surface faces; where the surface is seen all round, the effect
    cancels and nothing is done.

    Parameters
    ----------
    model : SurfaceModel
    xyz, outward : ndarray, shape (n, 3)
        Points on the surface and its normals there.
    residuals : ndarray, shape (n,)
        The measured points' distances from the surface, metres.
    reach : float
        Distance from which on points do not count, metres.

    Returns
    -------
    ndarray, shape (p,)
        Σ Jᵀ·residual, to be taken off.
    """
    beam = outward.mean(axis=0)
    one_sidedness = float(np.linalg.norm(beam))
    n_parameters = model.residuals(xyz[:1])[1].shape[1]
    if one_sidedness < ONE_SIDED:
        return np.zeros(n_parameters)
    beam /= one_sidedness
    facing = outward @ beam
    is_faced = facing > 0.3
    noise = robust_sigma(residuals[is_faced] / facing[is_faced])
    pull = np.zeros(n_parameters)
    for step, share in zip(*NORMAL_STEPS, strict=True):
        residual, jacobian, _ = model.residuals(xyz + step * noise * beam)
        pull += share * jacobian.T @ (_tukey_weights(residual, reach) * residual)
    return pull
