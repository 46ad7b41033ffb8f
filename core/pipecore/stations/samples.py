"""Points of elements by station: what the corrections of the stations are told from."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipecore.deformation.unrolled_points import unroll
from pipecore.elements import NearbyPoints
from pipecore.parallel import for_items
from pipecore.progress import Progress
from pipecore.robust import sample_evenly
from pipecore.types import Element, ElementKind, PointCloud

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

TELLING_KINDS = {ElementKind.CYLINDER, ElementKind.CONE, ElementKind.TORUS, ElementKind.SPHERE}
"""Elements with one smooth surface, which both sides of a scan share."""

REACH, REACH_RADII = 0.03, 0.28
"""Walls are looked for this far from the element's surface, metres and radii: three times what
registrations usually err, and within what is looked up around an axis."""
MIN_ALIGNMENT = np.cos(np.deg2rad(40.0))
"""The wall of another station, 0.3 radii aside, leans by 20°; noisy normals by as much again."""

POINTS_PER_VIEW, POINTS_IN_ALL = 2_000, 2_500_000
"""Of an element and a station. 2,000 points of 2 mm noise tell a place to 0.1 mm; of tens of
elements the corrections are told to hundredths. All of them take 100 MB."""
FEWEST_POINTS = 40
"""Fewer points of a station on an element tell nothing of it."""
N_ROWS, FEWEST_SHARED_ROWS, FEWEST_IN_ROW = 24, 3, 3
"""An element is cut across into so many rows. Only where two stations see the same row is it said
how they fit: further apart, it would be the pipe's straightness that tells."""


@dataclass(frozen=True, eq=False)
class Samples:
    """Points on an element that two or more stations have seen at the same places along it.

    Parameters
    ----------
    element : Element
    xyz : ndarray, shape (n, 3)
        Local coordinates, metres.
    station : ndarray of int, shape (n,)
        Place of each point's station among all.
    reach : float
        How far from the element's surface they were taken, metres.
    """

    element: Element
    xyz: Array
    station: Indices
    reach: float


def collect_samples(
    cloud: PointCloud,
    ids: NDArray[np.uint16],
    elements: Sequence[Element],
    nearby: NearbyPoints,
    progress: Progress,
) -> list[Samples]:
    """Return the points by which stations can be compared, element by element.

    Parameters
    ----------
    cloud : PointCloud
        With the station of each point.
    ids : ndarray of uint16, shape (s,)
        Of the stations, ascending.
    elements : sequence of Element
    nearby : NearbyPoints
        Of the cloud.
    progress : Progress
        Receives fractions of the stage "stations"; may cancel.

    Returns
    -------
    list of Samples
        In the order of the elements; of those only that two stations have seen together.
    """
    telling = [e for e in elements if e.kind in TELLING_KINDS]
    share = POINTS_IN_ALL // max(1, len(telling) * len(ids))
    per_view = int(np.clip(share, FEWEST_POINTS * 5, POINTS_PER_VIEW))
    found: dict[int, Samples] = {}

    def work(k: int, _check: Callable[[], None]) -> None:
        samples = _samples_of(cloud, ids, telling[k], nearby, per_view)
        if samples is not None:
            found[k] = samples

    for_items(work, len(telling), "stations", progress, (0.0, 0.6))
    return [found[k] for k in sorted(found)]


def _samples_of(
    cloud: PointCloud,
    ids: NDArray[np.uint16],
    element: Element,
    nearby: NearbyPoints,
    per_view: int,
) -> Samples | None:
    assert cloud.station is not None
    wide, narrow = (f(element.radius, element.radius_end) for f in (max, min))
    around = nearby.around_axis(element.axis, wide, 0.0, 1.0 - REACH_RADII - REACH / wide)
    # Several times as many as are kept: most of what is around may be of other surfaces.
    around = sample_evenly(around, 6 * per_view * len(ids))
    index, xyz, normals = nearby.full_resolution_with_normals(around)
    points = unroll(element, xyz, normals)
    reach = min(REACH, REACH_RADII * narrow)
    on = (np.abs(points.height) < reach) & (points.alignment > MIN_ALIGNMENT)
    on &= (points.chainage > 0) & (points.chainage < element.axis.length)
    index, xyz, chainage = index[on], xyz[on], points.chainage[on]
    station = np.searchsorted(ids, cloud.station[index]).astype(np.intp)
    row = (chainage * (N_ROWS / element.axis.length)).astype(np.intp)
    seen = np.bincount(row * len(ids) + station, minlength=N_ROWS * len(ids))
    seen_rows = seen.reshape(N_ROWS, len(ids)) >= FEWEST_IN_ROW
    shared = seen_rows.sum(axis=1) >= 2
    if shared.sum() < FEWEST_SHARED_ROWS:
        return None
    keep = shared[row] & seen_rows[row, station]
    rows = [sample_evenly(np.flatnonzero(keep & (station == s)), per_view) for s in range(len(ids))]
    rows = [own for own in rows if len(own) >= FEWEST_POINTS]
    if len(rows) < 2:
        return None
    chosen = np.concatenate(rows)
    return Samples(element, xyz[chosen], station[chosen], reach)
