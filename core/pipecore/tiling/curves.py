"""Stacks in files: directions from samples of all slabs, profiles batch by batch.

A curve lies in one profile, so a batch of whole profiles needs no margin, and its curves are
those of the whole cloud. What joins batches and stacks are the thinned points that their
curves share.
"""

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from pipecore._kernels import components
from pipecore.ellipses import Ellipses, fit_ellipses
from pipecore.profiles import MAX_SLOPE, segment_profiles
from pipecore.progress import Progress, in_chunks
from pipecore.segments import MIN_SEGMENT
from pipecore.settings import Settings
from pipecore.stacks.directions import REACH, axes_at, sample_positions
from pipecore.surface import Surface
from pipecore.tiling.engine import Engine
from pipecore.tiling.store import StopWhenUnwanted, Store, drop_pages
from pipecore.tiling.thinning import Rows, TiledSurface
from pipecore.types import NO_ID, Stack

Array = NDArray[np.float64]

BYTES_PER_POINT = 420
"""What cutting a thinned point into a profile and fitting its curve takes at the most."""
BLOCK = 2_000_000


@dataclass(frozen=True)
class Facts:
    """What a tile must know of the whole surface."""

    voxel: float
    noise: float


def local_axes_in_slabs(engine: Engine, tiled: TiledSurface, progress: Progress) -> Array:
    """`pipecore.stacks.directions.local_axes` of the whole surface."""
    total = int(tiled.n_usable.sum())
    if total == 0:
        return np.empty((0, 3))
    positions = sample_positions(total)
    ends = np.cumsum(tiled.n_usable)
    tiles = []
    for slab, n, end in zip(tiled.slabs, tiled.n_usable, ends, strict=True):
        own = positions[(positions >= end - n) & (positions < end)] - (end - n)
        tiles.append((slab.surface, tiled.rows_of(slab, REACH), own, tiled.surface.voxel))
    return np.concatenate(engine.run(axes_of_slab, tiles, "directions", progress))


def ellipses_of_stacks(
    engine: Engine,
    tiled: TiledSurface,
    stacks: tuple[Stack, ...],
    settings: Settings,
    batch_bytes: int,
    progress: Progress,
) -> tuple[Ellipses, NDArray[np.int32]]:
    """Segment the profiles of all stacks and fit their ellipses.

    Returns
    -------
    ellipses : Ellipses
        Of all stacks, in their order.
    segments : ndarray of int32, shape (m,)
        The segment of each thinned point, an array of the engine's store.
    """
    facts = Facts(tiled.surface.voxel, tiled.surface.noise)
    firsts = tuple(slab.surface[0] for slab in tiled.slabs)
    m = len(tiled.surface.xyz)
    parents = engine.store.create("parents", (m,), np.int32)
    for start in range(0, m, BLOCK):
        parents[start : start + BLOCK] = np.arange(start, min(start + BLOCK, m))
    tables = []
    for i, stack in enumerate(stacks):
        span = i / len(stacks), (i + 0.3) / len(stacks), (i + 1) / len(stacks)
        sorted_slabs = engine.run(
            sort_slab,
            [(k, slab.surface, stack) for k, slab in enumerate(tiled.slabs)],
            "profiles",
            progress,
            span[:2],
        )
        batches = _batches(sorted_slabs, max(1, batch_bytes // BYTES_PER_POINT))
        results = engine.run(
            ellipses_of_batch,
            [(k, begins, firsts, stack, settings, facts) for k, begins in enumerate(batches)],
            "profiles",
            progress,
            span[1:],
        )
        for k, table in enumerate(results):
            tables.append(table)
            points, starts = (engine.store.open(f"{name}-{k}") for name in ("points", "curves"))
            components.unite_groups(points, starts, parents)
            engine.store.remove(f"points-{k}", f"curves-{k}")
        engine.store.remove(*(f"sorted-{k}" for k in range(len(tiled.slabs))))
        drop_pages(parents)
    segments = number_segments(engine.store, parents, progress)
    engine.store.remove("parents")
    return Ellipses.concatenate(tables), segments


def _batches(
    sorted_slabs: list[tuple[NDArray[np.int64], NDArray[np.int64]]], per_batch: int
) -> list[NDArray[np.int64]]:
    """Batches of whole profiles: for each slab the range of its sorted points, (slabs, 2)."""
    profiles = np.unique(np.concatenate([p for p, _ in sorted_slabs]))
    # How many points each slab has in each of the profiles.
    counts = np.zeros((len(sorted_slabs), len(profiles)), np.int64)
    for k, (own, n) in enumerate(sorted_slabs):
        counts[k, np.searchsorted(profiles, own)] = n
    upto = np.concatenate([np.zeros((len(counts), 1), np.int64), counts.cumsum(axis=1)], axis=1)
    total = upto.sum(axis=0)
    batches, first = [], 0
    while first < len(profiles):
        last = int(np.searchsorted(total, total[first] + per_batch, side="right")) - 1
        last = max(last, first + 1)
        batches.append(upto[:, [first, last]])
        first = last
    return batches or [np.zeros((len(counts), 2), np.int64)]


def number_segments(
    store: Store, parents: NDArray[np.int32], progress: Progress
) -> NDArray[np.int32]:
    """Number the components as `pipecore.segments.overlay_stacks` does."""
    m = len(parents)
    components.flatten(parents)
    sizes = store.create("sizes", (m,), np.int32)
    for start, stop in in_chunks(m, BLOCK, "segments", progress):
        components.count_members(parents[start:stop], sizes)
    roots = np.concatenate(
        [
            start + np.flatnonzero(sizes[start : start + BLOCK] >= MIN_SEGMENT)
            for start in range(0, m, BLOCK)
        ]
    )
    by_size = roots[np.lexsort((roots, -sizes[roots]))]
    # From here on a root's size is replaced by its number.
    segments = store.create("segments", (m,), np.int32)
    for start in range(0, m, BLOCK):
        sizes[start : start + BLOCK] = NO_ID
    sizes[by_size] = np.arange(1, len(by_size) + 1)
    for start, stop in in_chunks(m, BLOCK, "segments", progress):
        segments[start:stop] = sizes[parents[start:stop]]
    drop_pages(parents, sizes, segments)
    store.remove("sizes")
    return segments


# What follows runs on the workers.


def axes_of_slab(
    store: Store, own: Rows, near: Rows, positions: NDArray[np.intp], voxel: float
) -> Array:
    """Local axes at some of the points of a slab that have a normal, by their order."""
    if len(positions) == 0:
        return np.empty((0, 3))
    xyz, normals = (np.array(store.open(name)[slice(*near)]) for name in ("surface", "normals"))
    inside = normals[own[0] - near[0] : own[1] - near[0], 0]
    sample = own[0] - near[0] + np.flatnonzero(~np.isnan(inside))[positions]
    return axes_at(xyz, normals, sample, voxel, StopWhenUnwanted(store))


def sort_slab(
    store: Store, number: int, rows: Rows, stack: Stack
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Write a slab's points that join a stack by profile; return profiles and their counts."""
    StopWhenUnwanted(store).update("profiles", 0.0)
    dx, dy, dz = stack.direction
    x, y, z = np.array(store.open("normals")[slice(*rows)]).T
    # Who joins in the end is decided where the profile is cut.
    joins = np.abs(x * dx + y * dy + z * dz) < MAX_SLOPE + 1e-9
    if stack.min_spacing:
        joins &= store.open("spacing")[slice(*rows)] >= stack.min_spacing
    index = np.flatnonzero(joins)
    x, y, z = store.open("surface")[slice(*rows)][index].T
    profile = np.floor((x * dx + y * dy + z * dz - stack.offset) / stack.width).astype(np.int64)
    order = np.argsort(profile, kind="stable")
    store.save(f"sorted-{number}", index[order].astype(np.int32))
    profiles, counts = np.unique(profile, return_counts=True)
    return profiles, counts


def ellipses_of_batch(
    store: Store,
    number: int,
    begins: NDArray[np.int64],
    firsts: tuple[int, ...],
    stack: Stack,
    settings: Settings,
    facts: Facts,
) -> Ellipses:
    """Segment whole profiles and fit their ellipses; write the points of their curves."""
    progress = StopWhenUnwanted(store)
    parts = [
        first + np.sort(store.open(f"sorted-{k}")[a:b].astype(np.int64))
        for k, (first, (a, b)) in enumerate(zip(firsts, begins.tolist(), strict=True))
    ]
    index = np.concatenate(parts)
    surface = Surface(
        store.open("surface")[index],
        store.open("normals")[index],
        store.open("spacing")[index],
        np.empty(0, np.int32),
        facts.voxel,
        facts.noise,
    )
    max_radius = settings.elements.max_radius_mm / 1e3
    curves = segment_profiles(surface, stack, settings.profiles, max_radius, progress)
    store.save(f"points-{number}", index[curves.points])
    store.save(f"curves-{number}", curves.starts)
    ellipses = fit_ellipses(curves, surface, settings.ellipses, settings.elements, progress)
    # Without the profile's frame as a view, which does not travel.
    return Ellipses(*(np.array(getattr(ellipses, f.name)) for f in fields(Ellipses)))
