"""Which point is under the cursor: points are projected one by one, the nearest wins."""

import math
from collections.abc import Callable, Sequence
from functools import cache

import numpy as np
from numpy.typing import NDArray

from pipecore.geometry import Array
from pipegui.scene.projection import Projection

PICK_RADIUS_PX = 6.0
LAYER_PX = 10.0
"""Points whose depths differ by less than this on screen count as one surface."""


def _find_near(
    xyz: NDArray[np.floating],
    matrix: Array,
    cursor: Array,
    radius: float,
    rows: NDArray[np.int64],
    depths: Array,
    distances: Array,
) -> int:
    """Fill the three arrays with the points within `radius` of `cursor`; return their number.

    Points for which there is no room are counted only. Serial on purpose: numba's plain
    threading layer dies when two of our threads use it.
    """
    n_found = 0
    for i in range(xyz.shape[0]):
        px, py, pz = xyz[i, 0], xyz[i, 1], xyz[i, 2]
        w = matrix[3, 0] * px + matrix[3, 1] * py + matrix[3, 2] * pz + matrix[3, 3]
        if w <= 0.0:
            continue
        u = matrix[0, 0] * px + matrix[0, 1] * py + matrix[0, 2] * pz + matrix[0, 3]
        du = u - cursor[0] * w
        if abs(du) > radius * w:
            continue
        v = matrix[1, 0] * px + matrix[1, 1] * py + matrix[1, 2] * pz + matrix[1, 3]
        dv = v - cursor[1] * w
        distance = math.sqrt(du * du + dv * dv) / w
        depth = matrix[2, 0] * px + matrix[2, 1] * py + matrix[2, 2] * pz + matrix[2, 3]
        if distance > radius or depth <= 0.0:
            continue
        if n_found < len(rows):
            rows[n_found] = i
            depths[n_found] = depth
            distances[n_found] = distance
        n_found += 1
    return n_found


@cache
def _compiled() -> Callable[..., int]:
    """Return the kernel as numba makes it, which the start of the window does not wait for."""
    from numba import njit  # noqa: PLC0415

    kernel: Callable[..., int] = njit(cache=True, nogil=True)(_find_near)
    return kernel


def points_near(
    xyz: NDArray[np.floating],
    projection: Projection,
    cursor: tuple[float, float],
    radius: float,
    kernel: Callable[..., int] | None = None,
) -> tuple[NDArray[np.int64], Array, Array]:
    """Return rows, depths (metres) and distances (pixels) of the points near `cursor`."""
    kernel = kernel or _compiled()
    room = 1024
    while True:
        rows, depths, distances = np.empty(room, np.int64), np.empty(room), np.empty(room)
        at = np.array(cursor, np.float64)
        n_found = kernel(xyz, projection.matrix, at, float(radius), rows, depths, distances)
        if n_found <= room:
            return rows[:n_found], depths[:n_found], distances[:n_found]
        room = n_found


@cache
def warm_up() -> None:
    """Compile the kernel, or load it: seconds that the first hover should not take."""
    projection = Projection(np.eye(4), 1.0, 0.0)
    points_near(np.zeros((1, 3), np.float32), projection, (0.0, 0.0), 1.0)


def pick_point(
    parts: Sequence[NDArray[np.floating]], projection: Projection, cursor: tuple[float, float]
) -> int:
    """Return the row of the point that somebody clicking at `cursor` means, or -1.

    Of the points within `PICK_RADIUS_PX` only those of the surface nearest to the
    viewer count; of these, the one nearest to the cursor.

    Parameters
    ----------
    parts : sequence of ndarray, shape (n, 3), C-contiguous
        The points; rows count through all parts.
    projection : Projection
    cursor : tuple of float
        Pixels from the left and from the top.
    """
    starts = np.cumsum([0, *(len(xyz) for xyz in parts)])
    found = [points_near(xyz, projection, cursor, PICK_RADIUS_PX) for xyz in parts]
    rows = np.concatenate([near[0] + i for near, i in zip(found, starts, strict=False)] or [[]])
    if not len(rows):
        return -1
    depths, distances = (np.concatenate([near[i] for near in found]) for i in (1, 2))
    front = depths.min()
    is_front = depths <= front + LAYER_PX * projection.pixel_size(front)
    return int(rows[is_front][np.argmin(distances[is_front])])
