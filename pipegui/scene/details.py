"""Full density where one looks: of a large cloud, the points in the picture, once it rests."""

import threading
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QObject, Qt, Signal

from pipecore.types import Floats
from pipegui.colour_maps import BLOCK
from pipegui.scene.projection import Projection

Mask = NDArray[np.bool_]
WORTH = 0.7
"""Of the points: if more are in the picture, nothing is gained by leaving out the others."""


def in_picture(xyz: Floats, projection: Projection, size: tuple[int, int]) -> Mask:
    """Return which points are in the picture."""
    u, v, depth, w = projection.matrix.astype(np.float32) @ np.vstack(
        [xyz.T.astype(np.float32), np.ones(len(xyz), np.float32)]
    )
    inside = (depth > 0) & (w > 0)
    for pixel, length in ((u, size[0]), (v, size[1])):
        inside &= (pixel >= 0) & (pixel <= length * w)
    return inside


class Details(QObject):
    """Finds the points in the picture, in a thread of its own that a move of the camera ends."""

    found = Signal(object)
    """Mask of the points, shape (n,)."""
    _posted = Signal(int, object)

    def __init__(self, parent: QObject) -> None:
        super().__init__(parent)
        self._turn = 0
        self._threads: list[threading.Thread] = []
        self._posted.connect(self._deliver, Qt.ConnectionType.QueuedConnection)

    def look(
        self,
        xyz: Floats,
        projection: Projection,
        size: tuple[int, int],
        visible: Callable[[], Mask | None],
    ) -> None:
        """Begin to find those of the `visible` points (None: all) that are in the picture."""
        self.stop()
        turn = self._turn

        def work() -> None:
            seen = visible()
            mask = np.zeros(len(xyz), np.bool_)
            for start in range(0, len(xyz), BLOCK):
                if turn != self._turn:
                    return
                at = slice(start, start + BLOCK)
                mask[at] = in_picture(xyz[at], projection, size)
            if seen is not None:
                mask &= seen
            n_seen = len(mask) if seen is None else int(np.count_nonzero(seen))
            if np.count_nonzero(mask) <= WORTH * n_seen:
                self._posted.emit(turn, mask)

        thread = threading.Thread(target=work, name="points in the picture", daemon=True)
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

    def _deliver(self, turn: int, mask: Mask) -> None:
        if turn == self._turn:
            self.found.emit(mask)
