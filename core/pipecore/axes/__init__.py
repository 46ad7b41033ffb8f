"""Axes: ellipse centres joined by proximity (paper, section 3.3.5)."""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from pipecore.ellipses import Ellipses
from pipecore.progress import Progress

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
AT_ONCE = 500_000
"""Pairs that are looked at together."""


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
    tree = cKDTree(ellipses.centre)
    # Wide pipes have coarser centres, so they look further; each size class by itself.
    reach = np.maximum(REACH * ellipses.width, WIDE_REACH * ellipses.radius)
    least = reach.min()
    links = []
    size_class = np.ceil(np.log2(reach / least) - 1e-9).astype(int)
    for k in np.unique(size_class):
        members = np.flatnonzero(size_class == k)
        distance = least * 2.0**k
        near = tree if k == 0 else cKDTree(ellipses.centre[members])
        pairs = near.query_pairs(distance, output_type="ndarray")
        if k > 0:
            pairs = members[pairs]
        for start in range(0, max(len(pairs), 1), AT_ONCE):
            some = pairs[start : start + AT_ONCE]
            links.append(some[_follow(ellipses, some[:, 0], some[:, 1])])
            progress.update("axes", 0.5)
    i, j = np.concatenate(links).T
    graph = coo_array((np.ones(len(i), np.int8), (i, j)), shape=(n, n))
    _, label = connected_components(graph, directed=False)
    sizes = np.bincount(label)
    rank = np.empty(len(sizes), np.int32)
    rank[np.argsort(-sizes, kind="stable")] = np.arange(len(sizes), dtype=np.int32)
    progress.update("axes", 1.0)
    return np.asarray(rank[label])


def _follow(e: Ellipses, i: NDArray[np.intp], j: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Whether ellipses i and j may be neighbours on one axis."""
    turn = np.abs(np.einsum("ij,ij->i", e.axis[i], e.axis[j]))
    smaller = np.minimum(e.radius[i], e.radius[j])
    sd = np.hypot(e.radius_sd[i], e.radius_sd[j])
    chord = e.centre[j] - e.centre[i]
    mean_axis = (
        e.axis[i] + np.sign(np.einsum("ij,ij->i", e.axis[i], e.axis[j]))[:, None] * e.axis[j]
    )
    mean_axis /= np.linalg.norm(mean_axis, axis=1)[:, None]
    along = np.einsum("ij,ij->i", chord, mean_axis)
    offset = np.sqrt(np.maximum(np.einsum("ij,ij->i", chord, chord) - along**2, 0.0))
    return np.asarray(
        (turn > MAX_TURN_COS)
        & (np.abs(e.radius[i] - e.radius[j]) < MAX_RADIUS_CHANGE * smaller + 2 * sd)
        & (offset < MAX_OFFSET * smaller + 2 * sd)
    )
