"""How a scene is looked at: which of the points on its surfaces a scanner brings home."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from tools.world.surfaces import Array, Patch, Samples, area, sample, unit

MAX_POINTS = 250_000
MAX_CANDIDATES = 800_000
"""Points on all surfaces, seen or not, before they are thinned to a pattern."""
GRAZING_COS = np.cos(np.deg2rad(80.0))
"""Flatter than this a surface gives no echo."""


class Pattern(StrEnum):
    """How the points lie on a surface."""

    EVEN = "even"
    RASTER = "raster"
    """Thinner with range and slant, as a station's angular grid makes it."""
    GRID = "grid"
    """One point a voxel, as downsampled clouds have them."""
    LINES = "lines"
    """Parallel scan lines, far apart and dense along."""
    STRIPS = "strips"
    """Slanting scan lines from along a path, in two passes."""
    UNEVEN = "uneven"
    """A density that falls a hundredfold across the scene."""


@dataclass(frozen=True, eq=False)
class View:
    """Where a scene is looked at from, and how.

    Parameters
    ----------
    stations : ndarray
        Scanner positions, shape (k, 3); none: every surface is seen.
    pattern : Pattern
    spacing : float
        Of points, or of lines, metres.
    along : float
        Spacing along a line, metres.
    """

    stations: Array
    pattern: Pattern
    spacing: float
    along: float = 0.002


@dataclass(frozen=True, eq=False)
class Seen:
    """Points that were seen, and from where.

    `samples` has n rows; `station` (n,) is an index into `positions` (k, 3), -1 for none;
    `beams` (n, 3) are unit vectors from the scanner.
    """

    samples: Samples
    station: NDArray[np.int32]
    positions: Array
    beams: Array


def look(patches: list[Patch], view: View, rng: np.random.Generator) -> tuple[Seen, float]:
    """Draw points on `patches`, keep what is seen; return them and the spacing used.

    The spacing is wider than asked for where the points would be too many.
    """
    total = sum(area(p) for p in patches)
    n_stations = max(1, len(view.stations))
    is_lines = view.pattern in (Pattern.LINES, Pattern.STRIPS)
    per_point = view.spacing * view.along if is_lines else view.spacing**2
    share = 0.35 if len(view.stations) else 1.0
    excess = max(1.0, n_stations * share * total / per_point / MAX_POINTS)
    spacing = view.spacing * excess if is_lines else view.spacing * np.sqrt(excess)
    dense = view.along if is_lines else spacing
    dense = max(dense, np.sqrt(total / MAX_CANDIDATES))
    if not len(view.stations):
        samples = _sampled(patches, dense, rng)
        chosen = _thinned(samples.points, view, spacing, dense, rng)
        samples = samples[chosen]
        station = np.full(len(samples), -1, np.int32)
        return Seen(samples, station, view.stations, -samples.normals), spacing
    parts = [
        _from_station(patches, view, k, spacing, dense, rng) for k in range(len(view.stations))
    ]
    samples = Samples.concatenate([p.samples for p in parts])
    station = np.concatenate([p.station for p in parts])
    beams = np.concatenate([p.beams for p in parts])
    return Seen(samples, station, view.stations, beams), spacing


def _sampled(patches: list[Patch], spacing: float, rng: np.random.Generator) -> Samples:
    return Samples.concatenate([sample(p, spacing, rng) for p in patches])


def _from_station(
    patches: list[Patch],
    view: View,
    k: int,
    spacing: float,
    dense: float,
    rng: np.random.Generator,
) -> Seen:
    samples = _sampled(patches, dense, rng)
    position = view.stations[k]
    samples = samples[visible(samples, position, dense)]
    offset = samples.points - position
    distance = np.linalg.norm(offset, axis=1)
    beams = offset / distance[:, None]
    if view.pattern is Pattern.RASTER:
        cosine = np.abs(np.einsum("ij,ij->i", beams, samples.normals))
        near = np.quantile(distance, 0.2)
        chosen = rng.uniform(size=len(samples)) < (near / distance) ** 2 * cosine
    else:
        chosen = _thinned(samples.points, view, spacing, dense, rng, k)
    samples, beams = samples[chosen], beams[chosen]
    return Seen(samples, np.full(len(samples), k, np.int32), view.stations, beams)


def visible(samples: Samples, position: Array, spacing: float) -> NDArray[np.intp]:
    """Return the rows that face a position (3,) and that nothing hides from it.

    Depths are compared in cells of a few samples each; `spacing` is theirs, metres.
    """
    offset = samples.points - position
    distance = np.linalg.norm(offset, axis=1)
    cosine = -np.einsum("ij,ij->i", offset, samples.normals) / distance
    cosine = np.where(samples.is_two_sided, np.abs(cosine), cosine)
    # What turns its back hides nothing: a room is looked into through its walls, and the far
    # side of a body lies behind the near one anyway.
    rows = np.flatnonzero(cosine > 0)
    offset, distance, cosine = offset[rows], distance[rows], cosine[rows]
    cell = 2.5 * spacing / np.quantile(distance, 0.05)
    azimuth = np.arctan2(offset[:, 1], offset[:, 0])
    elevation = np.arcsin(offset[:, 2] / distance)
    row = np.floor(elevation / cell).astype(np.int64)
    # Cells of one row are as wide as they are high.
    wide = cell / np.maximum(np.cos((row + 0.5) * cell), 0.05)
    column = np.floor(azimuth / wide).astype(np.int64)
    key = row * np.int64(1 << 24) + column
    order = np.lexsort((distance, key))
    first = np.r_[True, np.diff(key[order]) != 0]
    nearest = np.empty(len(key))
    nearest[order] = distance[order][np.maximum.accumulate(np.where(first, np.arange(len(key)), 0))]
    slant = np.minimum(np.sqrt(np.maximum(1 - cosine**2, 0)) / np.maximum(cosine, 0.05), 6.0)
    margin = 1.5 * cell * distance * (1 + slant)
    return rows[(cosine > GRAZING_COS) & (distance < nearest + margin)]


def _thinned(
    points: Array,
    view: View,
    spacing: float,
    dense: float,
    rng: np.random.Generator,
    k: int = 0,
) -> NDArray[np.intp]:
    """Rows that the pattern keeps."""
    if view.pattern is Pattern.GRID:
        cell = np.floor(points / spacing).astype(np.int64)
        _, rows = np.unique(cell @ np.array([1 << 40, 1 << 20, 1]), return_index=True)
        return np.sort(rows)
    if view.pattern in (Pattern.LINES, Pattern.STRIPS):
        # Lines of one pass are planes; those of a second pass cross them.
        slant = 0.0 if view.pattern is Pattern.LINES else (0.7, -0.7)[k % 2]
        turn = rng.uniform(0, 2 * np.pi) if view.pattern is Pattern.LINES else 0.0
        lean = rng.choice([0.0, 0.3, 1.5]) if view.pattern is Pattern.LINES else 0.0
        normal = unit(np.array([np.cos(slant + turn), np.sin(slant + turn), lean]))
        off = np.mod(points @ normal, spacing)
        return np.flatnonzero(off < dense)
    if view.pattern is Pattern.UNEVEN:
        along = points @ unit(rng.normal(size=3))
        share = (along - along.min()) / max(np.ptp(along), 1e-9)
        return np.flatnonzero(rng.uniform(size=len(points)) < 10.0 ** (-2 * share))
    return np.arange(len(points))
