"""Quantiles of more values than memory holds, the same bits as numpy's."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from pipecore.progress import Progress, in_chunks

Array = NDArray[np.float64]

VALUES_AT_A_TIME = 2_000_000
MAX_SORTED_VALUES = 2_000_000
"""Values that may be sorted in memory."""
N_BINS = 4096


def quantile(
    values: Array, q: float, stage: str, progress: Progress, few: int = MAX_SORTED_VALUES
) -> float:
    """Return a quantile of an array in a file, as `numpy.nanquantile` does.

    The range that holds the wanted ranks is narrowed by counting until it holds few values.

    Parameters
    ----------
    values : ndarray, shape (n,)
        nan is left out; if there is nothing else, so is the result.
    q : float
        0 to 1.
    stage : str
        Reported to `progress`.
    progress : Progress
    few : int
        So many values may be sorted in memory.
    """
    n, low, high = 0, np.inf, -np.inf
    for block in _known(values, stage, progress):
        n += len(block)
        low, high = min(low, float(block.min())), max(high, float(block.max()))
    if n == 0:
        return np.nan
    virtual = q * (n - 1)
    rank = int(np.floor(virtual))
    n_below, n_inside = 0, n
    while n_inside > few and low < high:
        edges = np.linspace(low, high, N_BINS + 1)
        edges[-1] = high
        counts = np.zeros(N_BINS, np.int64)
        for block in _known(values, stage, progress):
            inside = block[(block >= low) & (block <= high)]
            place = np.searchsorted(edges, inside, side="right") - 1
            counts += np.bincount(np.minimum(place, N_BINS - 1), minlength=N_BINS)
        upto = n_below + np.cumsum(counts)
        first = int(np.searchsorted(upto, rank, side="right"))
        last = int(np.searchsorted(upto, min(rank + 1, n - 1), side="right"))
        if first == 0 and last == N_BINS - 1:
            break
        n_below = int(upto[first] - counts[first])
        n_inside = int(counts[first : last + 1].sum())
        low = float(edges[first])
        # The last bin includes its upper edge, the others do not.
        high = high if last == N_BINS - 1 else float(np.nextafter(edges[last + 1], -np.inf))
    left = [b[(b >= low) & (b <= high)] for b in _known(values, stage, progress)]
    ordered = np.sort(np.concatenate(left))
    at = rank - n_below
    below, above = float(ordered[at]), float(ordered[min(at + 1, len(ordered) - 1)])
    share = virtual - rank
    # In numpy's own way, to the last bit.
    return below + (above - below) * share if share < 0.5 else above - (above - below) * (1 - share)


def _known(values: Array, stage: str, progress: Progress) -> Iterator[Array]:
    for start, stop in in_chunks(len(values), VALUES_AT_A_TIME, stage, progress):
        block = values[start:stop]
        block = block[~np.isnan(block)]
        if len(block):
            yield block
