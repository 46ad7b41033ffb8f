"""Points on surfaces of known shape, spread as a scan spreads them."""

import numpy as np
from numpy.typing import NDArray

from pipecore.geometry import Axis, CurveAxis, LineAxis, surface_points, unit
from pipecore.progress import NoProgress
from pipecore.settings import ThinningSettings
from pipecore.surface import Order, Surface, sample_surface
from pipecore.types import PointCloud

Array = NDArray[np.float64]
FULL = 2 * np.pi


def random_rotation(rng: np.random.Generator) -> Array:
    """A rotation matrix, all attitudes alike."""
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return q if np.linalg.det(q) > 0 else -q


def random_direction(rng: np.random.Generator) -> Array:
    return unit(rng.normal(size=3))


def bowed_axis(rng: np.random.Generator, length: float = 0.9, bow: float = 0.04) -> CurveAxis:
    """An axis with one bow to 12:00 of its chord and a smaller one to both sides."""
    chord = LineAxis(rng.normal(size=3), random_direction(rng), length)
    t = np.linspace(0.0, 1.0, 17)
    up, right = chord.frame(0.0)
    across = bow * (np.sin(np.pi * t)[:, None] * up + 0.2 * np.sin(2 * np.pi * t)[:, None] * right)
    return CurveAxis.through(chord.at(t * length) + across)


def jittered(
    rng: np.random.Generator, width: float, height: float, spacing: float
) -> tuple[Array, Array]:
    """Places in a rectangle from (0, 0), one in each cell of a grid of `spacing`."""
    n, m = max(1, round(width / spacing)), max(1, round(height / spacing))
    i, j = (k.ravel() for k in np.indices((n, m)))
    return (i + rng.random(n * m)) * width / n, (j + rng.random(n * m)) * height / m


def tube(
    rng: np.random.Generator,
    axis: Axis,
    radius: float,
    *,
    radius_end: float | None = None,
    spacing: float = 0.01,
    noise: float = 0.0,
    arc: float = FULL,
    middle_clock: float = 0.0,
) -> tuple[Array, Array]:
    """Points and outward unit normals of a pipe about `axis`, seen over `arc` around a clock."""
    end = radius if radius_end is None else radius_end
    chainage, around = jittered(rng, axis.length, arc * max(radius, end), spacing)
    clock = around / max(radius, end) - arc / 2 + middle_clock
    slope = (end - radius) / axis.length
    at = radius + slope * chainage
    outward = unit_rows(surface_points(axis, chainage, 1.0, clock) - axis.at(chainage))
    normals = unit_rows(outward - slope * axis.tangent(chainage))
    off = noise * rng.normal(size=len(chainage))
    return axis.at(chainage) + at[:, None] * outward + off[:, None] * normals, normals


def plane(
    rng: np.random.Generator,
    corner: Array,
    along: Array,
    across: Array,
    spacing: float = 0.01,
    noise: float = 0.0,
) -> tuple[Array, Array]:
    """Points and normals of the rectangle over two perpendicular edges."""
    corner, along, across = (np.asarray(v, dtype=np.float64) for v in (corner, along, across))
    s, t = jittered(rng, float(np.linalg.norm(along)), float(np.linalg.norm(across)), spacing)
    normal = unit(np.cross(along, across))
    xyz = corner + s[:, None] * unit(along) + t[:, None] * unit(across)
    off = noise * rng.normal(size=len(s))
    return xyz + off[:, None] * normal, np.tile(normal, (len(s), 1))


def ball(
    rng: np.random.Generator,
    centre: Array,
    radius: float,
    spacing: float = 0.01,
    noise: float = 0.0,
) -> tuple[Array, Array]:
    """Points and normals of a whole sphere (Fibonacci lattice, turned at random)."""
    n = round(4 * np.pi * radius**2 / spacing**2)
    k = np.arange(n) + 0.5
    z, azimuth = 1 - 2 * k / n, np.pi * (1 + 5**0.5) * k
    rho = np.sqrt(1 - z * z)
    normals = np.stack([rho * np.cos(azimuth), rho * np.sin(azimuth), z], axis=1)
    normals = normals @ random_rotation(rng)
    off = radius + noise * rng.normal(size=n)
    return np.asarray(centre) + off[:, None] * normals, normals


def unit_rows(vectors: Array) -> Array:
    return vectors / np.linalg.norm(vectors, axis=1)[:, None]


def cloud_of(
    *parts: tuple[Array, Array], origin: tuple[float, ...] = (0.0, 0.0, 0.0)
) -> PointCloud:
    """The points of some surfaces as one cloud."""
    xyz = np.ascontiguousarray(np.concatenate([p for p, _ in parts]))
    return PointCloud(np.array(origin), xyz)


def sampled(*parts: tuple[Array, Array], voxel_mm: float = 0.0) -> Surface:
    """Some surfaces as the detection sees them: downsampled, with estimated normals."""
    return sample_surface(cloud_of(*parts), ThinningSettings(voxel_mm), NoProgress())


def known(*parts: tuple[Array, Array], spacing: float = 0.01, noise: float = 0.0) -> Surface:
    """Some surfaces with their true normals, not downsampled."""
    xyz, normals = (np.concatenate(p) for p in zip(*parts, strict=True))
    n = len(xyz)
    behind = np.arange(n, dtype=np.int32), np.arange(n + 1, dtype=np.int32)
    return Surface(xyz, normals, np.full(n, spacing), behind, spacing, noise)


def parents(behind: Order) -> NDArray[np.intp]:
    """The downsampled point of each point of a cloud."""
    members, starts = behind
    parent = np.full(len(members), -1)
    parent[members] = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
    assert (parent >= 0).all()
    return parent


def part_of(*parts: tuple[Array, Array]) -> NDArray[np.intp]:
    """Which part each point of `cloud_of` or `known` is from."""
    return np.repeat(np.arange(len(parts)), [len(p) for p, _ in parts])


def angle_between(a: Array, b: Array) -> NDArray[np.float64]:
    """Angle between lines along unit vectors (..., 3), radians."""
    return np.arccos(np.clip(np.abs((a * b).sum(axis=-1)), 0.0, 1.0))
