"""Distance of points from their nearest neighbours."""

import numpy as np

from pipecore.robust import sample_evenly
from pipecore.types import Array

SAMPLE_QUERIES = 5_000


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
    spacing = median_spacing(sample)
    if len(sample) < 100 or n_points <= len(sample):
        return spacing
    wider = median_spacing(sample[: len(sample) // 2])
    # Surfaces thin by 2^(1/2) when half of the points are gone; complete ones not at all.
    exponent = np.clip(np.log2(wider / spacing), 0.0, 0.5) if spacing > 0 else 0.0
    return float(spacing * (len(sample) / n_points) ** (exponent if exponent > 0.2 else 0.0))


def median_spacing(points: Array) -> float:
    """Median distance of points from their nearest neighbours; nan for less than two places.

    Parameters
    ----------
    points : ndarray
        Shape (m, 3), float64. Points at one place count as one.
    """
    from scipy.spatial import cKDTree  # noqa: PLC0415  (slow to import)

    local = points - points[:1]
    # Many points at one place cannot be divided, and would be held against each other.
    order = np.lexsort(local.T)
    is_new = np.ones(len(local), np.bool_)
    is_new[order[1:]] = (local[order[1:]] != local[order[:-1]]).any(axis=1)
    local = local[is_new]
    if len(local) < 2:
        return float("nan")
    queries = sample_evenly(local, SAMPLE_QUERIES)
    distances, _ = cKDTree(local, balanced_tree=False).query(queries, k=2)
    return float(np.median(distances[:, 1]))
