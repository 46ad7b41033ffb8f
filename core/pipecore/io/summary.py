"""What is in a file, without reading more of it than that takes."""

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipecore.errors import ReadError
from pipecore.io.reading import FARTHEST
from pipecore.io.registry import identify
from pipecore.io.source import Source
from pipecore.progress import NoProgress, Progress
from pipecore.robust import sample_evenly
from pipecore.types import Array

SAMPLE_POINTS = 500_000
SAMPLE_QUERIES = 5_000


@dataclass(frozen=True, eq=False)
class FileInfo:
    """What is in a point cloud file; lengths and coordinates are in the file's own unit.

    Parameters
    ----------
    path : Path
    format : str
        Its format's name, such as “LAS/LAZ”.
    n_points : int
        Valid points; those that the header announces if it also gives their extent.
    minimum, maximum : ndarray
        Corners of the box around the points, world coordinates, float64, shape (3,).
    spacing : float
        Estimated median distance of a point from its nearest neighbour; nan for one point.
    fields : tuple of str
        What the file calls the values of a point.
    crs : str
        The coordinate reference system's name, or "".
    n_scans : int
    n_stations : int
        Scans whose scanner position is known.
    """

    path: Path
    format: str
    n_points: int
    minimum: Array
    maximum: Array
    spacing: float
    fields: tuple[str, ...]
    crs: str
    n_scans: int
    n_stations: int


def info(path: str | os.PathLike[str], *, progress: Progress | None = None) -> FileInfo:
    """Return what is in a point cloud file.

    A LAS file's header and its first points are enough; other headers say nothing
    reliable about the extent, so their points are all read, but not kept.

    Raises
    ------
    ReadError
        If the file cannot be read as a point cloud.
    CancelledError
        From `progress`.
    """
    path, progress = Path(path), progress or NoProgress()
    file_format = identify(path)
    with file_format.open(path) as source:
        n_points, bounds, sample = _survey(source, progress)
        if not len(sample):
            raise ReadError("“{name}” holds no valid points.", name=path.name)
        return FileInfo(
            path,
            file_format.name,
            n_points,
            bounds[0],
            bounds[1],
            _spacing(source, sample, n_points),
            source.fields,
            source.crs,
            source.n_scans,
            len(source.stations),
        )


def _survey(source: Source, progress: Progress) -> tuple[int, Array, Array]:
    """Return the number of points, their lowest and highest coordinates, and the first ones."""
    bounds = np.array([[np.inf] * 3, [-np.inf] * 3])
    kept: list[Array] = []
    n_valid = n_kept = 0
    for chunk in source.chunks:
        progress.update("reading", min(chunk.fraction, 1.0))
        with np.errstate(invalid="ignore"):
            xyz = chunk.xyz[(np.abs(chunk.xyz) <= FARTHEST / MILLIMETRE).all(axis=1)]
        if not len(xyz):
            continue
        n_valid += len(xyz)
        bounds = np.array(
            [np.minimum(bounds[0], xyz.min(axis=0)), np.maximum(bounds[1], xyz.max(axis=0))]
        )
        if n_kept < SAMPLE_POINTS:
            kept.append(xyz[: SAMPLE_POINTS - n_kept])
            n_kept += len(kept[-1])
        elif source.bounds is not None and source.n_points is not None:
            return source.n_points, source.bounds, np.concatenate(kept)
    return n_valid, bounds, np.concatenate(kept) if kept else np.empty((0, 3))


def _spacing(source: Source, sample: Array, n_points: int) -> float:
    """Spacing of a file's points: measured where they are all known, else estimated."""
    if source.neighbourhood is None:
        return estimate_spacing(sample, n_points)
    whole = source.neighbourhood()
    return estimate_spacing(whole, len(whole))


MILLIMETRE = 1e-3
"""The smallest unit in which a file may be, metres."""


def estimate_spacing(sample: Array, n_points: int) -> float:
    """Estimate the median distance of a point from its nearest neighbour.

    Parameters
    ----------
    sample : ndarray
        Consecutive points of the file, shape (m, 3).
    n_points : int
        Points in all.

    Notes
    -----
    Points in the order in which they were scanned are complete where they are, so that
    their spacing is that of all. Points in random order are thinned; then half of the
    sample has a wider spacing than all of it, and what that says is carried on to
    `n_points`.
    """
    spacing = _median_spacing(sample)
    if len(sample) < 100 or n_points <= len(sample):
        return spacing
    wider = _median_spacing(sample[: len(sample) // 2])
    # Surfaces thin by 2^(1/2) when half of the points are gone; complete ones not at all.
    exponent = np.clip(np.log2(wider / spacing), 0.0, 0.5) if spacing > 0 else 0.0
    return float(spacing * (len(sample) / n_points) ** (exponent if exponent > 0.2 else 0.0))


def _median_spacing(points: Array) -> float:
    from scipy.spatial import cKDTree  # noqa: PLC0415  (slow to import)

    if len(points) < 2:
        return float("nan")
    local = points - points[0]
    queries = sample_evenly(local, SAMPLE_QUERIES)
    distances, _ = cKDTree(local, balanced_tree=False).query(queries, k=2)
    return float(np.median(distances[:, 1]))
