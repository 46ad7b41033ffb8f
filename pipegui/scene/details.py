"""Which points of a large cloud to draw, found in a thread of its own.

Full density where one looks: once the camera rests, all points in the picture.
"""

import threading
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QObject, Qt, Signal

from pipecore.types import Floats
from pipegui.scene.projection import Projection
from pipegui.style.colour_maps import BLOCK

Mask = NDArray[np.bool_]
Rows = NDArray[np.int32]
WORTH = 0.7
"""Of the points: if more are in the picture, nothing is gained by leaving out the others."""


def in_picture(xyz: Floats, projection: Projection, size: tuple[int, int]) -> Mask:
    """Return which points are in the picture."""
    u, v, depth, w = projection.matrix.astype(np.float32) @ np.vstack(
        [xyz.T.astype(np.float32), np.ones(len(xyz), np.float32)]
    )
    inside: Mask = (depth > 0) & (w > 0)
    for pixel, length in ((u, size[0]), (v, size[1])):
        inside &= (pixel >= 0) & (pixel <= length * w)
    return inside


def rows_in_picture(
    xyz: Floats,
    projection: Projection,
    size: tuple[int, int],
    visible: Callable[[], Mask | None],
    is_wanted: Callable[[], bool],
) -> Rows | None:
    """Return the rows of the `visible` points (None: all) that are in the picture.

    None if these are nearly all, or no longer wanted.
    """
    seen = visible()
    mask = np.zeros(len(xyz), np.bool_)
    for start in range(0, len(xyz), BLOCK):
        if not is_wanted():
            return None
        at = slice(start, start + BLOCK)
        mask[at] = in_picture(xyz[at], projection, size)
    if seen is not None:
        mask &= seen
    n_seen = len(mask) if seen is None else int(np.count_nonzero(seen))
    if np.count_nonzero(mask) > WORTH * n_seen:
        return None
    return rows_of(mask)


def rows_of(mask: Mask | None) -> Rows | None:
    """Return the rows where a mask is true; None, which is all, stays None."""
    return None if mask is None else np.flatnonzero(mask).astype(np.int32)


class Finder(QObject):
    """Finds points in a thread of its own; a new search or `stop` ends the one before."""

    found = Signal(object)
    """The rows of the points, shape (n,)."""
    _posted = Signal(int, object)

    def __init__(self, parent: QObject) -> None:
        super().__init__(parent)
        self._turn = 0
        self._threads: list[threading.Thread] = []
        self._posted.connect(self._deliver, Qt.ConnectionType.QueuedConnection)

    def look(self, find: Callable[[Callable[[], bool]], Rows | None]) -> None:
        """Begin to find; `find` is given whether it is still wanted, None is no answer."""
        self.stop()
        turn = self._turn

        def work() -> None:
            rows = find(lambda: turn == self._turn)
            if rows is not None and turn == self._turn:
                self._posted.emit(turn, rows)

        thread = threading.Thread(target=work, name="points to draw", daemon=True)
        self._threads = [t for t in self._threads if t.is_alive()] + [thread]
        thread.start()

    def stop(self) -> None:
        """Want no more what is being looked for."""
        self._turn += 1

    def close(self) -> None:
        """Stop, and wait for it."""
        self.stop()
        for thread in self._threads:
            thread.join()
        self._threads = []

    def _deliver(self, turn: int, rows: Rows) -> None:
        if turn == self._turn:
            self.found.emit(rows)
