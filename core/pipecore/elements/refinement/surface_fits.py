"""Cylinders, cones, tori and spheres fitted to points: robust geometric least squares.

Residuals are signed distances along the radius, positive outside. The arithmetic is that
of `pipecore._kernels.surface_models`, which documents the parameters of each kind; here are the
surfaces as classes, and the result of a fit.
"""

from dataclasses import dataclass
from typing import ClassVar, Generic, Protocol, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from pipecore._kernels import surface_fit
from pipecore._kernels import surface_models as kernels
from pipecore.geometry import ArcAxis, LineAxis, unit

Array = NDArray[np.float64]


CONVERGED, ROUGHLY = 1e-6, 2e-5
"""A fit ends when no point's distance changes by more than this, metres; a rough one earlier."""
BEAM_NOISE = surface_fit.BeamNoise(
    min_one_sided=0.55,  # seen over less than 200°
    steps=np.array([-2.334, -0.742, 0.742, 2.334]),
    shares=np.array([0.0459, 0.4541, 0.4541, 0.0459]),
)
"""Nodes and weights of Gauss and Hermite's quadrature for the standard normal distribution."""
NO_CORRECTION = BEAM_NOISE._replace(min_one_sided=np.inf)


class SurfaceModel(Protocol):
    """A surface about an axis, with parameters that a fit can step."""

    radius_parameter: ClassVar[int]
    """Which parameter is the radius."""

    @property
    def radius(self) -> float:
        """Radius, at the start for a cone."""
        ...

    @property
    def kind(self) -> int:
        """Its kind as the kernels name it."""
        ...

    @property
    def is_conical(self) -> bool:
        """Whether its radius changes along its axis."""
        ...

    def numbers(self) -> Array:
        """The surface as the kernels take it, shape (14,)."""
        ...

    def from_numbers(self, numbers: Array) -> Self:
        """A surface of the same kind."""
        ...


Model = TypeVar("Model", bound=SurfaceModel)


class _Measured:
    """Residuals by the kernels, for all surfaces."""

    def residuals(self: SurfaceModel, xyz: Array) -> tuple[Array, Array, Array]:
        """Signed distances (n,), derivatives (n, p) and outward unit vectors (n, 3)."""
        n = len(xyz)
        residuals, outward = np.empty(n), np.empty((n, 3))
        slopes = np.empty((n, kernels.n_parameters(self.kind)))
        kernels.at_points(self.kind, self.numbers(), xyz, residuals, slopes, outward)
        return residuals, slopes, outward

    def stepped(self: Model, step: Array) -> Model:
        """The surface with its parameters moved by `step` (p,)."""
        numbers = self.numbers()
        kernels.move(self.kind, numbers, step)
        return self.from_numbers(numbers)


def _numbers(place: Array, direction: Array, radius: float, shape: float) -> Array:
    numbers = np.empty(14)
    numbers[:3], numbers[3:6], numbers[12], numbers[13] = place, direction, radius, shape
    kernels.place_frame(numbers)
    return numbers


@dataclass(frozen=True, eq=False)
class LineSurface(_Measured):
    """A cylinder, or with `is_tapered` a cone: radius + slope · chainage from the middle."""

    middle: Array
    direction: Array
    radius: float
    slope: float = 0.0
    is_tapered: bool = False

    radius_parameter: ClassVar[int] = 4

    @property
    def is_conical(self) -> bool:
        """Whether it is a cone."""
        return self.is_tapered

    @property
    def kind(self) -> int:
        """Cone or cylinder."""
        return kernels.CONE if self.is_tapered else kernels.CYLINDER

    @property
    def position(self) -> Array:
        """A point by which two surfaces of one kind are compared."""
        return self.middle

    def numbers(self) -> Array:
        """The surface as the kernels take it."""
        return _numbers(self.middle, self.direction, self.radius, self.slope)

    def from_numbers(self, numbers: Array) -> "LineSurface":
        """A surface of the same kind."""
        return LineSurface(
            numbers[:3].copy(),
            numbers[3:6].copy(),
            float(numbers[12]),
            float(numbers[13]),
            self.is_tapered,
        )

    def radius_at(self, point: Array) -> float:
        """Radius abreast of a point."""
        return float(self.radius + self.slope * ((point - self.middle) @ self.direction))

    def axis_between(self, low: float, high: float) -> LineAxis:
        """The axis from chainage `low` to `high`, counted from the middle."""
        return LineAxis(self.middle + low * self.direction, self.direction, high - low)


@dataclass(frozen=True, eq=False)
class ArcSurface(_Measured):
    """A torus about the circle of `bend_radius` around `centre`."""

    centre: Array
    normal: Array
    bend_radius: float
    radius: float

    radius_parameter: ClassVar[int] = 6
    kind: ClassVar[int] = kernels.TORUS
    is_conical: ClassVar[bool] = False

    @property
    def position(self) -> Array:
        """A point by which two surfaces of one kind are compared."""
        return self.centre

    def numbers(self) -> Array:
        """The surface as the kernels take it."""
        return _numbers(self.centre, self.normal, self.radius, self.bend_radius)

    def from_numbers(self, numbers: Array) -> "ArcSurface":
        """A surface of the same kind."""
        return ArcSurface(
            numbers[:3].copy(), numbers[3:6].copy(), float(numbers[13]), float(numbers[12])
        )

    def axis_from(self, towards_start: Array, angle: float) -> ArcAxis:
        """The axis that starts in the given direction from the centre."""
        across = towards_start - (towards_start @ self.normal) * self.normal
        return ArcAxis(self.centre, self.normal, unit(across), self.bend_radius, angle)


@dataclass(frozen=True, eq=False)
class SphereSurface(_Measured):
    """A sphere."""

    centre: Array
    radius: float

    radius_parameter: ClassVar[int] = 3
    kind: ClassVar[int] = kernels.SPHERE
    is_conical: ClassVar[bool] = False

    @property
    def position(self) -> Array:
        """A point by which two surfaces of one kind are compared."""
        return self.centre

    def numbers(self) -> Array:
        """The surface as the kernels take it."""
        return _numbers(self.centre, np.array([0.0, 0.0, 1.0]), self.radius, 0.0)

    def from_numbers(self, numbers: Array) -> "SphereSurface":
        """Another sphere."""
        return SphereSurface(numbers[:3].copy(), float(numbers[12]))


@dataclass(frozen=True, eq=False)
class SurfaceFit(Generic[Model]):
    """A fitted surface with the covariance of its parameters and the points' standard deviation."""

    model: Model
    covariance: Array
    sigma: float
    n_used: int

    @property
    def radius_sd(self) -> float:
        """Standard deviation of the radius, metres."""
        k = self.model.radius_parameter
        return float(np.sqrt(self.covariance[k, k]))


def fit_surface(
    model: Model, xyz: Array, scale: float, n_iterations: int = 30, *, is_rough: bool = False
) -> SurfaceFit[Model] | None:
    """Fit a surface to points by Gauss-Newton with Tukey's weights.

    A point that is moved by noise along the laser's beam moves across the surface and along
    it at once, so that its distance from the surface and the place where that is counted go
    together. On a pipe seen from one side the fitted radius is too small by about σ²/r for
    it, however many points there are. So points on the surface are moved along the beam,
    and what that adds to the normal equations, in the mean over normal noise by Gauss and
    Hermite's quadrature, is taken off. The beam is the mean direction in which the surface
    faces; where the surface is seen all round, the effect cancels and nothing is done.

    Parameters
    ----------
    model : SurfaceModel
        Where to start; within a few `scale` of the points.
    xyz : ndarray, shape (n, 3)
    scale : float
        First guess of the points' standard deviation; it shrinks to what they show.
    n_iterations : int
    is_rough : bool
        Whether the last hundredths of a millimetre do not matter.

    Returns
    -------
    SurfaceFit or None
        None where the surface is not well determined.
    """
    kind, numbers = model.kind, model.numbers()
    p = kernels.n_parameters(kind)
    covariance = np.empty((p, p))
    converged, noise = (ROUGHLY, NO_CORRECTION) if is_rough else (CONVERGED, BEAM_NOISE)
    n, sigma = surface_fit.fit_surface(
        kind, numbers, xyz, scale, n_iterations, converged, noise, covariance
    )
    return SurfaceFit(model.from_numbers(numbers), covariance, sigma, n) if n else None
