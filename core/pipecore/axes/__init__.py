"""Axes: ellipse centres joined by proximity (paper, section 3.3.5)."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from pipecore._kernels.chain_links import unite_followers
from pipecore._kernels.disjoint_sets import flatten
from pipecore._kernels.line_search import AxisEllipses, PieceLimits
from pipecore.ellipses import Ellipses
from pipecore.progress import Progress

Array = NDArray[np.float64]

REACH = 3.5
"""Centres join within this many profile widths of each other, along the axis."""
WIDE_REACH = 0.25
"""Wide pipes look at least this many radii ahead: ribs and flanges interrupt them."""
MAX_TURN_COS = np.cos(np.deg2rad(15.0))
"""Their axes differ by less than this angle."""
MAX_RADIUS_CHANGE = 0.06
"""Their radii differ by less than this share (and twice its standard deviation)."""
MAX_OFFSET = 0.1
"""They are off each other's axis by less than this share of the radius."""
AT_ONCE = 100_000
"""Ellipses whose neighbours are looked for together."""


def join_centres(ellipses: Ellipses, progress: Progress) -> NDArray[np.int32]:
    """Chain the centres of ellipses that follow each other along one axis.

    Parameters
    ----------
    ellipses : Ellipses
    progress : Progress

    Returns
    -------
    ndarray of int32, shape (len(ellipses),)
        Number of the chain of each ellipse, from 0, the chain with most ellipses first.
    """
    progress.update("axes", 0.0)
    n = len(ellipses)
    if n == 0:
        return np.empty(0, np.int32)
    # Wide pipes have coarser centres, so they look further; each size class by itself.
    reach = np.maximum(REACH * ellipses.width, WIDE_REACH * ellipses.radius)
    least = reach.min()
    roots = np.arange(n, dtype=np.int32)
    on_axis = AxisEllipses(ellipses.centre, ellipses.axis, ellipses.radius, ellipses.radius_sd)
    limits = PieceLimits(MAX_TURN_COS, MAX_OFFSET, MAX_RADIUS_CHANGE)
    size_class = np.ceil(np.log2(reach / least) - 1e-9).astype(int)
    for k in np.unique(size_class):
        # The smallest ones join with all that are near, the others among themselves.
        members = np.arange(n) if k == 0 else np.flatnonzero(size_class == k)
        members = members[np.argsort(ellipses.centre[members, 0], kind="stable")]
        for some, pairs in _near(ellipses.centre[members], least * 2.0**k):
            progress.update("axes", 0.5)
            unite_followers(pairs, members[some], on_axis, limits, roots)
    flatten(roots)
    _, label, sizes = np.unique(roots, return_inverse=True, return_counts=True)
    rank = np.empty(len(sizes), np.int32)
    rank[np.argsort(-sizes, kind="stable")] = np.arange(len(sizes), dtype=np.int32)
    progress.update("axes", 1.0)
    return np.asarray(rank[label])


def _near(centres: Array, distance: float) -> Iterator[tuple[slice, NDArray[np.intp]]]:
    """Pairs of centres within a distance, some places at a time: all at once are too many.

    The centres are in the order of their x.

    Yields
    ------
    (slice, ndarray of shape (n, 2))
        A range of the centres, and pairs within it.
    """
    x = centres[:, 0]
    for first in range(0, len(x), AT_ONCE):
        # Those of the next range that are near some of this one come with it.
        last = min(first + AT_ONCE, len(x)) - 1
        end = int(np.searchsorted(x, x[last] + distance, side="right"))
        tree = cKDTree(centres[first:end])
        yield slice(first, end), tree.query_pairs(distance, output_type="ndarray")
