"""Where a label stands without covering others."""

import numpy as np
from PySide6.QtCore import QPointF, QRect, QRectF, QSize

LEADER = 36
"""Pixels from what it names."""


def place_box(
    anchor: QPointF, size: QSize, area: QRect, taken: list[QRectF], leader: float = LEADER
) -> QRectF | None:
    """Return where a label of `size` is free of others around its anchor, or None.

    Tried are places up and to the sides first, near before far.
    """
    for reach in (leader, 2 * leader, 3.5 * leader):
        for degrees in (60, 120, 25, 155, -25, 205, -60, 240):
            angle = np.deg2rad(degrees)
            x = anchor.x() + reach * np.cos(angle)
            y = anchor.y() - reach * np.sin(angle)
            left = x if np.cos(angle) > 0 else x - size.width()
            box = QRectF(left, y - size.height() / 2, size.width(), size.height())
            room = box.adjusted(-4, -4, 4, 4)
            if QRectF(area).contains(room) and not any(room.intersects(t) for t in taken):
                return box
    return None
