"""Directions in which stacks are cut."""

import numpy as np
from numpy.typing import NDArray

from pipecore._kernels import local_surfaces
from pipecore.parallel import for_chunks
from pipecore.progress import NoProgress, Progress
from pipecore.surface import Surface
from pipecore.surface.grid import GridFrame
from pipecore.surface.sorting import CellGrid

Array = NDArray[np.float64]

AXES = np.eye(3)
DIAGONALS = np.array([[1, 1, 1], [1, 1, -1], [1, -1, 1], [-1, 1, 1]]) / np.sqrt(3.0)

N_SAMPLES = 60_000
REACH = 6.0
"""Radius of the neighbourhood of a local axis, in voxels."""
CURVED = 0.02
"""Share of the second eigenvalue of Σnnᵀ above which a surface counts as curved."""
COVER_COS = np.cos(np.deg2rad(24.0))
"""A local axis is well cut by a stack within this angle of it."""
MAX_DIRECTIONS = 16
MIN_SHARE = 0.004
"""Local axes that are rarer than this get no direction of their own."""


def local_axes(surface: Surface, progress: Progress) -> Array:
    """Directions of the local axis at sampled curved places of the surface, shape (k, 3)."""
    usable = np.flatnonzero(~np.isnan(surface.normals[:, 0]))
    if len(usable) == 0:
        return np.empty((0, 3))
    sample = usable[sample_positions(len(usable))]
    return axes_at(surface.xyz, surface.normals, sample, surface.voxel, progress)


def sample_positions(n_usable: int) -> NDArray[np.intp]:
    """Which of the points with a normal are looked at, by their order: evenly spread ones."""
    return np.unique(np.linspace(0, n_usable - 1, N_SAMPLES).astype(np.intp))


def axes_at(
    points: Array,
    normals: Array,
    sample: NDArray[np.intp],
    voxel: float,
    progress: Progress = NoProgress(),
) -> Array:
    """Directions of the local axis at those of the sampled points that lie on curved places.

    What is further than `REACH` voxels from all sampled points does not change the result.
    """
    radius = REACH * voxel
    grid = CellGrid.build(points, radius, "directions", progress)
    # Few of the points are looked at: they are not copied cell by cell.
    cells = np.searchsorted(grid.cell_keys, GridFrame.of(points, radius).keys(points[sample]))
    lookup = grid.lookup
    axes, spreads = np.empty((len(sample), 3)), np.empty((len(sample), 3))

    def work(start: int, stop: int) -> None:
        local_surfaces.fit_local_axes(
            points, normals, lookup, radius, sample, cells, start, stop, axes, spreads
        )

    for_chunks(work, len(sample), 2_000, "directions", progress, (0.0, 0.8))
    with np.errstate(invalid="ignore"):
        is_curved = (spreads[:, 1] > CURVED) & (spreads[:, 0] < 0.25 * spreads[:, 1])
    return axes[is_curved]


def cover_directions(axes: Array) -> list[Array]:
    """Choose few directions so that nearly every axis is within the cover angle of one.

    Greedy: the direction with most axes around it, moved to their mean, then the same
    for the axes left over.
    """
    chosen: list[Array] = []
    left = axes
    candidates = _hemisphere(400)
    least = max(20, MIN_SHARE * len(axes))
    while len(chosen) < MAX_DIRECTIONS and len(left) > least:
        # Towards the peak: weights fall off well inside the cover angle.
        weight = np.maximum((left @ candidates.T) ** 2 - COVER_COS**2, 0.0).sum(axis=0)
        direction = candidates[np.argmax(weight)]
        for _ in range(3):
            near = left[np.abs(left @ direction) > np.cos(np.deg2rad(12.0))]
            if len(near) == 0:
                break
            direction = np.linalg.eigh(near.T @ near)[1][:, -1]
        covered = np.abs(left @ direction) > COVER_COS
        if covered.sum() < least:
            break
        chosen.append(_canonical(direction))
        left = left[~covered]
    return chosen


def automatic_directions(axes: Array) -> list[Array]:
    """Directions along which the cloud's own surfaces run, most frequent first.

    Where the cloud shows no curved surface and so no local axes, the axes and diagonals.
    """
    chosen = cover_directions(axes)
    return chosen or [*AXES, *DIAGONALS]


def _hemisphere(n: int) -> Array:
    """About `n` directions spread evenly over a half sphere (Fibonacci lattice)."""
    k = np.arange(n) + 0.5
    z = k / n
    azimuth = np.pi * (1 + 5**0.5) * k
    rho = np.sqrt(1 - z * z)
    return np.stack([rho * np.cos(azimuth), rho * np.sin(azimuth), z], axis=1)


def _canonical(direction: Array) -> Array:
    """Return the direction with its largest component positive."""
    return np.asarray(direction * np.sign(direction[np.argmax(np.abs(direction))]))
