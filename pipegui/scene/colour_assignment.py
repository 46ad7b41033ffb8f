"""Colours for segments such that neighbours differ."""

import numpy as np
from numpy.typing import NDArray

from pipecore.types import Floats

N_SAMPLED = 100_000


def neighbouring_ids(
    xyz: Floats, ids: NDArray[np.int32], reach: float | None = None
) -> NDArray[np.int32]:
    """Return the pairs of different ids that have points within about `reach` of each other.

    Parameters
    ----------
    xyz : ndarray, shape (n, 3)
    ids : ndarray of int32, shape (n,)
        0 is no id.
    reach : float, optional
        Metres; by default a fiftieth of the extent, at most 0.5 m.

    Returns
    -------
    ndarray of int32, shape (m, 2)
        Sorted, the smaller id first, each pair once.
    """
    from scipy.spatial import cKDTree  # noqa: PLC0415 - takes its time

    few = max(1, len(ids) // (20 * N_SAMPLED))  # of a large cloud, looking at all takes long
    labelled = few * np.flatnonzero(ids[::few])
    labelled = labelled[:: max(1, len(labelled) // N_SAMPLED)]
    if not len(labelled):
        return np.empty((0, 2), np.int32)
    points, ids = xyz[labelled].astype(np.float64), ids[labelled]
    if reach is None:
        reach = min(0.5, float(np.linalg.norm(np.ptp(points, axis=0))) / 50)
    # One point per id and cell is enough to see who is near whom.
    cells = np.floor(points / (reach / 2)).astype(np.int64)
    _, first = np.unique(np.column_stack([ids, cells]), axis=0, return_index=True)
    pairs = cKDTree(points[first]).query_pairs(reach, output_type="ndarray")
    pairs = np.sort(ids[first][pairs], axis=1)
    return np.unique(pairs[pairs[:, 0] != pairs[:, 1]], axis=0)


def colour_apart(n_ids: int, pairs: NDArray[np.int32], n_colours: int) -> NDArray[np.intp]:
    """Return a colour index for each id from 0 to `n_ids`; ids of a pair differ if they can.

    Each id takes, of the colours that its neighbours leave over, the one used least so far.
    """
    neighbours: list[list[int]] = [[] for _ in range(n_ids + 1)]
    for a, b in pairs.tolist():
        neighbours[a].append(b)
        neighbours[b].append(a)
    colour = np.full(n_ids + 1, -1, np.intp)
    n_used = np.zeros(n_colours, np.intp)
    for i in range(1, n_ids + 1):
        n_near = np.bincount([c for c in colour[neighbours[i]] if c >= 0], minlength=n_colours)
        colour[i] = np.lexsort((np.arange(n_colours), n_used, n_near))[0]
        n_used[colour[i]] += 1
    colour[0] = 0
    return colour
