"""Exact parametric surfaces and points on them."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Surface = Callable[[Array, Array], Array]
"""Points (n, 3) at parameters u and v in [0, 1], each of shape (n,)."""

_STEP = 1e-6
_COARSE = 65


def unit(vectors: Array) -> Array:
    """Scale vectors (..., 3) to length one."""
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def across(direction: Array) -> tuple[Array, Array]:
    """Return two unit vectors that make a right-handed frame with a unit vector (3,)."""
    first = unit(np.cross(direction, np.eye(3)[np.argmin(np.abs(direction))]))
    return first, np.cross(direction, first)


def random_direction(rng: np.random.Generator) -> Array:
    """Draw a unit vector, uniform on the sphere."""
    return unit(rng.normal(size=3))


@dataclass(frozen=True, eq=False)
class Patch:
    """A piece of surface over the unit square.

    Parameters
    ----------
    at : callable
        Its points.
    body : int
        Index of the body that it belongs to.
    element_id : int
        The true element whose lateral surface it is, 0 if none.
    is_two_sided : bool
        Whether it is seen from both sides; else only from where the normal
        (∂/∂u × ∂/∂v, turned if `is_inward`) points.
    is_inward : bool
    keep : callable, optional
        Which of its points (n, 3) are there; the others lie within another body.
    """

    at: Surface
    body: int = 0
    element_id: int = 0
    is_two_sided: bool = False
    is_inward: bool = False
    keep: Callable[[Array], NDArray[np.bool_]] | None = None

    def moved(self, rotation: Array, shift: Array) -> "Patch":
        """Return the patch turned by `rotation` (3, 3), then shifted."""
        at = self.at
        return replace(self, at=lambda u, v: at(u, v) @ rotation.T + shift)


@dataclass(frozen=True, eq=False)
class Samples:
    """Points on patches: a table, one array per column.

    `points` and `normals` have shape (n, 3), `u`, `v`, `body`, `element_id` and
    `is_two_sided` shape (n,).
    """

    points: Array
    normals: Array
    u: Array
    v: Array
    body: NDArray[np.int32]
    element_id: NDArray[np.int32]
    is_two_sided: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.points)

    def __getitem__(self, rows: NDArray[np.bool_] | NDArray[np.intp]) -> "Samples":
        """Return the given rows."""
        return Samples(*(column[rows] for column in vars(self).values()))

    @classmethod
    def concatenate(cls, tables: "list[Samples]") -> "Samples":
        """Return one table with the rows of all."""
        columns = zip(*(vars(t).values() for t in tables), strict=True)
        return cls(*(np.concatenate(c) for c in columns))


def sample(patch: Patch, spacing: float, rng: np.random.Generator) -> Samples:
    """Draw points of even density, one per `spacing` squared (metres), on a patch."""
    n_u, n_v = (max(2, int(np.ceil(extent / spacing))) for extent in _extents(patch.at))
    i, j = np.meshgrid(np.arange(n_u), np.arange(n_v), indexing="ij")
    u = (i.ravel() + rng.uniform(size=i.size)) / n_u
    v = (j.ravel() + rng.uniform(size=j.size)) / n_v
    points = patch.at(u, v)
    normal = _normal(patch.at, u, v, points)
    density = np.linalg.norm(normal, axis=1) / (spacing**2 * n_u * n_v)
    chosen = rng.uniform(size=len(u)) < density
    u, v, points, normal = u[chosen], v[chosen], points[chosen], unit(normal[chosen])
    n = len(points)
    table = Samples(
        points,
        -normal if patch.is_inward else normal,
        u,
        v,
        np.full(n, patch.body, np.int32),
        np.full(n, patch.element_id, np.int32),
        np.full(n, patch.is_two_sided),
    )
    return table if patch.keep is None else table[patch.keep(points)]


def area(patch: Patch) -> float:
    """Return the area of a patch in square metres, what others hide included."""
    u, v = _middles(_COARSE)
    return float(np.linalg.norm(_normal(patch.at, u, v, patch.at(u, v)), axis=1).mean())


def _normal(at: Surface, u: Array, v: Array, points: Array) -> Array:
    """∂/∂u × ∂/∂v, by differences."""
    along_u = (at(u + _STEP, v) - points) / _STEP
    along_v = (at(u, v + _STEP) - points) / _STEP
    return np.cross(along_u, along_v)


def _extents(at: Surface) -> tuple[float, float]:
    """Lengths of the longest u-line and the longest v-line, with a margin."""
    line = np.linspace(0.0, 1.0, _COARSE)
    u, v = np.meshgrid(line, line, indexing="ij")
    grid = at(u.ravel(), v.ravel()).reshape(_COARSE, _COARSE, 3)
    return (
        1.1 * float(np.linalg.norm(np.diff(grid, axis=0), axis=2).sum(axis=0).max()),
        1.1 * float(np.linalg.norm(np.diff(grid, axis=1), axis=2).sum(axis=1).max()),
    )


def _middles(n: int) -> tuple[Array, Array]:
    line = (np.arange(n) + 0.5) / n
    u, v = np.meshgrid(line, line, indexing="ij")
    return u.ravel(), v.ravel()


def quad(corner: Array, edge_u: Array, edge_v: Array, **kwargs: object) -> Patch:
    """Return a parallelogram."""
    return Patch(lambda u, v: corner + u[:, None] * edge_u + v[:, None] * edge_v, **kwargs)


def extrusion(outline: Array, length: float, **kwargs: object) -> Patch:
    """Return a polyline (m, 2) in the x-y plane swept along z, centred on the origin.

    The normal points to the right of the polyline's direction.
    """
    step = np.linalg.norm(np.diff(outline, axis=0), axis=1)
    t = np.r_[0.0, np.cumsum(step)] / step.sum()

    def at(u: Array, v: Array) -> Array:
        x, y = (np.interp(u, t, outline[:, k]) for k in (0, 1))
        return np.column_stack([x, y, (v - 0.5) * length])

    return Patch(at, **kwargs)


def height_field(
    size: tuple[float, float], height: Callable[[Array, Array], Array], **kwargs: object
) -> Patch:
    """Return z = height(x, y) over a rectangle around the origin."""

    def at(u: Array, v: Array) -> Array:
        x, y = (u - 0.5) * size[0], (v - 0.5) * size[1]
        return np.column_stack([x, y, height(x, y)])

    return Patch(at, **kwargs)
