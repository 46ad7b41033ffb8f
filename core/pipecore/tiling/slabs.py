"""The surface of a cloud in files: downsampled slab by slab, with normals from overlapping slabs.

A slab holds whole planes of voxels across the x axis, so that the downsampled points of all
slabs in a row are in the order in which the whole cloud's would be.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from pipecore.progress import Progress
from pipecore.settings import ThinningSettings
from pipecore.surface import (
    NOISE_QUANTILE,
    WIDEST_NEIGHBOURHOOD,
    Surface,
    automatic_voxel,
    average_voxels,
    cells_of,
    fit_planes,
    index_type,
)
from pipecore.tiling.engine import Engine
from pipecore.tiling.quantile import quantile
from pipecore.tiling.store import StopWhenUnwanted, Store

Array = NDArray[np.float64]
Rows = tuple[int, int]
"""A range of rows: the first, and the one behind the last."""

POINTS_AT_A_TIME = 1_000_000
"""Points that are looked at together before they are sorted into slabs."""
BYTES_PER_POINT = 260
"""What thinning a point or fitting a plane to a downsampled point takes at the most."""
MARGIN_PLANES = int(np.ceil(WIDEST_NEIGHBOURHOOD)) + 1
"""Planes on either side of a slab that its normals need."""


@dataclass(frozen=True, eq=False)
class Slab:
    """Planes of voxels that are processed together.

    Parameters
    ----------
    first, last : int
        The planes, both included.
    points, surface : (int, int)
        Rows of the cloud's points sorted by voxel, and of the downsampled points.
    """

    first: int
    last: int
    points: Rows
    surface: Rows


@dataclass(frozen=True, eq=False)
class TiledSurface:
    """A downsampled cloud in a store, slab by slab.

    Parameters
    ----------
    surface : Surface
        With arrays in files; its `parent` is empty, see `members`.
    slabs : tuple of Slab
    planes, plane_starts : ndarray of int64
        The planes that hold downsampled points, and the first of each; one more at the end.
    """

    surface: Surface
    slabs: tuple[Slab, ...]
    planes: NDArray[np.int64]
    plane_starts: NDArray[np.int64]

    def rows_of(self, slab: Slab, margin: float) -> Rows:
        """Rows of the downsampled points of a slab and of what is within `margin` voxels of it."""
        # Means of rounded coordinates may lie a micrometre outside their voxel.
        reach = int(np.ceil(margin)) + 1
        first = np.searchsorted(self.planes, slab.first - reach)
        last = np.searchsorted(self.planes, slab.last + reach, side="right")
        return int(self.plane_starts[first]), int(self.plane_starts[last])


def parts_of(n_points: int) -> list[Rows]:
    """Ranges of rows of about equal size."""
    n_parts = max(1, int(np.ceil(n_points / POINTS_AT_A_TIME)))
    bounds = np.linspace(0, n_points, n_parts + 1).astype(np.int64)
    return [(int(a), int(b)) for a, b in pairwise(bounds)]


def downsample_in_slabs(
    engine: Engine,
    n_points: int,
    settings: ThinningSettings,
    step: float,
    slab_bytes: int,
    progress: Progress,
) -> TiledSurface:
    """Downsample the cloud "xyz" of the engine's store and estimate normals.

    Afterwards the store holds the surface, "members" (the cloud's points in the order of
    their downsampled points) and "starts" (where each downsampled point's begin).

    Parameters
    ----------
    engine : Engine
    n_points : int
    settings : ThinningSettings
    step : float
        Steps of the coordinates, metres.
    slab_bytes : int
        Memory that one slab may take.
    progress : Progress
    """
    store = engine.store
    parts = parts_of(n_points)
    edge = settings.voxel_mm / 1e3
    if not edge:
        # It looks at the points in passing, chunk by chunk.
        xyz = store.open_coordinates()
        edge = automatic_voxel(xyz, step, progress=progress)
    counted = engine.run(count_planes, [(p, edge) for p in parts], "thinning", progress, (0.3, 0.4))
    planes, which = np.unique(np.concatenate([p for p, _ in counted]), return_inverse=True)
    counts = np.zeros(len(planes), np.int64)
    np.add.at(counts, which, np.concatenate([n for _, n in counted]))
    firsts = slab_bounds(planes, counts, slab_bytes // BYTES_PER_POINT)
    first_planes = planes[firsts]
    sorted_parts = engine.run(
        sort_part,
        [(k, p, edge, first_planes) for k, p in enumerate(parts)],
        "thinning",
        progress,
        (0.4, 0.6),
    )
    in_slab = np.array(sorted_parts)  # (parts, slabs)
    ends = np.cumsum(in_slab.sum(axis=0))
    store.create("members", (n_points,), index_type(n_points))
    begins = np.concatenate([np.zeros((len(parts), 1), np.int64), np.cumsum(in_slab, axis=1)], 1)
    downsampled = engine.run(
        downsample_slab,
        [
            (k, begins[:, k : k + 2], int(ends[k] - in_slab[:, k].sum()), edge)
            for k in range(len(firsts))
        ],
        "thinning",
        progress,
        (0.6, 1.0),
    )
    store.remove(*(f"part-{k}" for k in range(len(parts))))
    surface_ends = np.cumsum([sum(n) for _, n in downsampled])
    last_planes = np.append(planes[firsts[1:] - 1], planes[-1])
    slabs = tuple(
        Slab(
            int(first_planes[k]),
            int(last_planes[k]),
            (int(ends[k] - in_slab[:, k].sum()), int(ends[k])),
            (int(surface_ends[k] - sum(downsampled[k][1])), int(surface_ends[k])),
        )
        for k in range(len(firsts))
    )
    _gather(store, slabs, n_points)
    kept_planes = np.concatenate([p for p, _ in downsampled])
    plane_starts = np.concatenate([[0], np.cumsum(np.concatenate([n for _, n in downsampled]))])
    return _with_normals(engine, slabs, kept_planes, plane_starts, edge, progress)


def slab_bounds(
    planes: NDArray[np.int64], counts: NDArray[np.int64], per_slab: int
) -> NDArray[np.intp]:
    """Which planes begin a slab.

    A slab and the margin that its normals need hold at most `per_slab` points, but no slab
    is thinner than its margin: it would be little else.
    """
    upto = np.concatenate([[0], np.cumsum(counts)])
    firsts: list[int] = []
    for i, plane in enumerate(planes.tolist()):
        if firsts:
            begun = planes[firsts[-1]]
            low = np.searchsorted(planes, begun - MARGIN_PLANES)
            high = np.searchsorted(planes, plane + MARGIN_PLANES, side="right")
            if plane - begun < MARGIN_PLANES or upto[high] - upto[low] <= per_slab:
                continue
        firsts.append(i)
    return np.array(firsts)


def _gather(store: Store, slabs: tuple[Slab, ...], n_points: int) -> None:
    """Put the downsampled points of all slabs into one array."""
    m = slabs[-1].surface[1]
    xyz, starts = (
        store.create("surface", (m, 3), np.float64),
        store.create("starts", (m + 1,), index_type(n_points)),
    )
    starts[m] = n_points
    for k, slab in enumerate(slabs):
        rows = slice(*slab.surface)
        xyz[rows] = store.open(f"downsampled-{k}")
        starts[rows] = store.open(f"starts-{k}").astype(starts.dtype) + slab.points[0]
        store.remove(f"downsampled-{k}", f"starts-{k}")


def _with_normals(
    engine: Engine,
    slabs: tuple[Slab, ...],
    planes: NDArray[np.int64],
    plane_starts: NDArray[np.int64],
    edge: float,
    progress: Progress,
) -> TiledSurface:
    store = engine.store
    m = slabs[-1].surface[1]
    store.create("normals", (m, 3), np.float64)
    store.create("spacing", (m,), np.float64)
    residuals = store.create("residuals", (m,), np.float64)

    def described(noise: float) -> TiledSurface:
        surface = Surface(
            store.open("surface"),
            store.open("normals"),
            store.open("spacing"),
            (store.open("members"), store.open("starts")),
            edge,
            noise,
        )
        return TiledSurface(surface, slabs, planes, plane_starts)

    unknown = described(np.nan)
    engine.run(
        fit_slab_planes,
        [(slab.surface, unknown.rows_of(slab, WIDEST_NEIGHBOURHOOD), edge) for slab in slabs],
        "normals",
        progress,
    )
    noise = quantile(residuals, NOISE_QUANTILE, "normals", progress)
    del residuals
    store.remove("residuals")
    return described(noise)


# What follows runs on the workers.


def count_planes(
    store: Store, rows: Rows, edge: float
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Planes of voxels in a part, and how many points each holds."""
    x = store.open_coordinates()[slice(*rows), 0]
    planes, counts = np.unique(cells_of(x, edge).astype(np.int64), return_counts=True)
    return planes, counts


def sort_part(
    store: Store, number: int, rows: Rows, edge: float, first_planes: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Write a part's rows in the order of their slabs; return how many each slab has."""
    x = store.open_coordinates()[slice(*rows), 0]
    slab = np.searchsorted(first_planes, cells_of(x, edge).astype(np.int64), side="right") - 1
    store.save(f"part-{number}", rows[0] + np.argsort(slab, kind="stable"))
    return np.bincount(slab, minlength=len(first_planes))


def downsample_slab(
    store: Store, number: int, begins: NDArray[np.int64], first_point: int, edge: float
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Average a slab's voxels; return its planes and how many downsampled points each holds."""
    progress = StopWhenUnwanted(store)
    rows = np.concatenate(
        [store.open(f"part-{p}")[a:b] for p, (a, b) in enumerate(begins.tolist())]
    )
    xyz = store.open_coordinates()[rows]
    progress.update("thinning", 0.0)
    downsampled = average_voxels(xyz, edge, progress)
    members, starts = downsampled.full_resolution_points
    progress.update("thinning", 1.0)
    all_members = store.open("members")
    all_members[first_point : first_point + len(rows)] = rows[members]
    store.save(f"downsampled-{number}", downsampled.xyz)
    store.save(f"starts-{number}", starts[:-1])
    plane = cells_of(xyz[members[starts[:-1]], 0], edge).astype(np.int64)
    planes, counts = np.unique(plane, return_counts=True)
    return planes, counts


def fit_slab_planes(store: Store, rows: Rows, near: Rows, edge: float) -> None:
    """Fit planes to a slab's downsampled points, with those of the margin around it."""
    xyz = np.array(store.open("surface")[slice(*near)])
    fitted = fit_planes(xyz, edge, StopWhenUnwanted(store))
    inside = slice(rows[0] - near[0], rows[1] - near[0])
    for name, values in zip(("normals", "residuals", "spacing"), fitted, strict=True):
        store.open(name)[slice(*rows)] = values[inside]
