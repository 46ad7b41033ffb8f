"""Stacks in files: directions from samples of all slabs, profiles batch by batch.

A curve lies in one profile, so a batch of whole profiles needs no margin, and its curves are
those of the whole cloud. What joins batches and stacks are the downsampled points that their
curves share.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipecore._kernels import profile_cuts as kernels
from pipecore._kernels.grouping import argsort_keys
from pipecore.ellipses import Ellipses
from pipecore.profiles import MAX_SLOPE, stack_cut, stack_frame
from pipecore.progress import Progress
from pipecore.settings import Settings
from pipecore.surface import NO_FULL_RESOLUTION_POINTS, Surface
from pipecore.surface.planes import CellSums, find_planes, sum_cells
from pipecore.tiling.engine import Engine
from pipecore.tiling.slabs import Rows, TiledSurface
from pipecore.tiling.store import StopWhenUnwanted, Store
from pipecore.types import Stack
from pipecore.workspace import Cut, PlaneLabels, cut_and_fit

Array = NDArray[np.float64]

BYTES_PER_POINT = 420
"""What cutting a downsampled point into a profile and fitting its curve takes at the most."""
SORTING_SHARE = 0.3
"""Share of the time that sorting points by profile takes."""
CUT_ARRAYS = "surface", "normals", "spacing"
"""What the cutting of profiles looks at."""


@dataclass(frozen=True)
class Facts:
    """What a tile must know of the whole surface."""

    voxel: float
    noise: float


def remove_planes(
    engine: Engine, tiled: TiledSurface, max_radius: float, progress: Progress
) -> Iterator[PlaneLabels]:
    """Yield the planes of each slab's points; write for each slab which of its points are cut."""
    store, voxel = engine.store, tiled.surface.voxel
    tiles = [(k, slab.surface, voxel) for k, slab in enumerate(tiled.slabs)]
    parts = engine.run(sum_slab_cells, tiles, "directions", progress, (0.8, 1.0))
    known = find_planes(parts, voxel, max_radius)
    for k, (slab, cells) in enumerate(zip(tiled.slabs, known, strict=True)):
        progress.update("directions", 1.0)
        ids = store.open(f"cells-{k}")
        yield PlaneLabels(slab.surface[0], cells.plane[ids])
        rows = slab.surface[0] + np.flatnonzero(cells.is_cut[ids])
        store.save(f"cut-{k}", rows.astype(np.int32))
        # Every stack looks at these points, so that they are laid side by side.
        for name in CUT_ARRAYS:
            store.save(f"cut-{name}-{k}", store.open(name)[rows])
        store.remove(f"cells-{k}")


def cut_in_batches(
    engine: Engine,
    tiled: TiledSurface,
    stack: Stack,
    settings: Settings,
    batch_bytes: int,
    progress: Progress,
    span: tuple[float, float],
) -> Iterator[Cut]:
    """Segment the profiles of a stack and fit their ellipses, a batch of profiles at a time.

    Yields
    ------
    Cut
        Of each batch, in their order; the points are there until the next.
    """
    store = engine.store
    begin, end = span
    middle = begin + SORTING_SHARE * (end - begin)
    facts = Facts(tiled.surface.voxel, tiled.surface.noise)
    slabs = [(k, stack) for k in range(len(tiled.slabs))]
    sorted_slabs = engine.run(sort_slab, slabs, "profiles", progress, (begin, middle))
    batches = [
        (k, begins, stack, settings, facts)
        for k, begins in enumerate(_batches(sorted_slabs, max(1, batch_bytes // BYTES_PER_POINT)))
    ]
    tables = engine.run(ellipses_of_batch, batches, "profiles", progress, (middle, end))
    store.remove(*(f"sorted-{k}" for k in range(len(slabs))))
    for k, table in enumerate(tables):
        yield Cut(store.open(f"points-{k}"), store.open(f"curves-{k}"), table)
        store.remove(f"points-{k}", f"curves-{k}")


def _batches(
    sorted_slabs: list[tuple[NDArray[np.int64], NDArray[np.int64]]], per_batch: int
) -> list[NDArray[np.int64]]:
    """Batches of whole profiles: for each slab the range of its sorted points, (slabs, 2)."""
    profiles = np.unique(np.concatenate([p for p, _ in sorted_slabs]))
    # How many points each slab has in each of the profiles.
    counts = np.zeros((len(sorted_slabs), len(profiles)), np.int64)
    for k, (of_slab, n) in enumerate(sorted_slabs):
        counts[k, np.searchsorted(profiles, of_slab)] = n
    upto = np.concatenate([np.zeros((len(counts), 1), np.int64), counts.cumsum(axis=1)], axis=1)
    total = upto.sum(axis=0)
    batches, first = [], 0
    while first < len(profiles):
        last = int(np.searchsorted(total, total[first] + per_batch, side="right")) - 1
        last = max(last, first + 1)
        batches.append(upto[:, [first, last]])
        first = last
    return batches or [np.zeros((len(counts), 2), np.int64)]


# What follows runs on the workers.


def sum_slab_cells(store: Store, number: int, rows: Rows, voxel: float) -> CellSums:
    """Sum up a slab's points by cell; write the cell of each."""
    StopWhenUnwanted(store).update("directions", 0.0)
    xyz, normals = (store.open(name)[slice(*rows)] for name in ("surface", "normals"))
    sums, ids = sum_cells(xyz, normals, voxel)
    store.save(f"cells-{number}", ids)
    return sums


def sort_slab(
    store: Store, number: int, stack: Stack
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Write a slab's points that join a stack by profile; return profiles and their counts."""
    StopWhenUnwanted(store).update("profiles", 0.0)
    xyz, normals, spacing = (store.open(f"cut-{name}-{number}") for name in CUT_ARRAYS)
    profile = np.empty(len(xyz), np.int32)
    kernels.find_profiles(
        xyz, normals, spacing, 0, len(profile), stack_cut(stack, stack_frame(stack.direction)),
        MAX_SLOPE, stack.min_spacing, profile,
    )  # fmt: skip
    joins = np.flatnonzero(profile != kernels.NOT_CUT)
    keys = profile[joins].astype(np.int64)
    order = argsort_keys(keys - keys.min(initial=0))
    store.save(f"sorted-{number}", joins[order].astype(np.int32))
    profiles, counts = np.unique(keys, return_counts=True)
    return profiles, counts


def ellipses_of_batch(
    store: Store,
    number: int,
    begins: NDArray[np.int64],
    stack: Stack,
    settings: Settings,
    facts: Facts,
) -> Ellipses:
    """Segment whole profiles and fit their ellipses; write the points of their curves."""
    chosen = [store.open(f"sorted-{k}")[a:b] for k, (a, b) in enumerate(begins.tolist())]

    def of_all(name: str) -> NDArray[Any]:
        # In each profile in the order of the whole surface, since the slabs are.
        return np.concatenate([store.open(f"{name}-{k}")[rows] for k, rows in enumerate(chosen)])

    index = of_all("cut")
    xyz, normals, spacing = (of_all(f"cut-{name}") for name in CUT_ARRAYS)
    surface = Surface(xyz, normals, spacing, NO_FULL_RESOLUTION_POINTS, facts.voxel, facts.noise)
    cuts = cut_and_fit(surface, stack, settings, StopWhenUnwanted(store))
    store.save(f"points-{number}", index[np.concatenate([cut.points for cut in cuts])])
    sizes = [np.diff(cut.starts) for cut in cuts]
    store.save(f"curves-{number}", np.cumsum(np.concatenate([np.zeros(1, np.int64), *sizes])))
    return Ellipses.concatenate([cut.ellipses for cut in cuts])
