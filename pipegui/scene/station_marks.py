"""Where the scanner stood, marked over the picture."""

from dataclasses import dataclass

import numpy as np
from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QPainter, QPen

from pipecore.geometry import Array
from pipecore.types import PointCloud
from pipegui.model.document import ViewOptions
from pipegui.model.stations import stations_of
from pipegui.scene.projection import Projection

HEAD = 3.5
LEGS = (QPointF(-6, 13), QPointF(0, 14), QPointF(6, 13))
"""Ends of the tripod's legs, pixels from its head."""


@dataclass(frozen=True, eq=False)
class StationMark:
    """A station whose scanner position is known, local coordinates, shape (3,)."""

    station_id: int
    position: Array


def marks_of(cloud: PointCloud, view: ViewOptions) -> tuple[StationMark, ...]:
    """Return the stations to be marked: of those that are shown, where it is known."""
    if not view.show_stations:
        return ()
    return tuple(
        StationMark(station.station_id, np.array(station.position))
        for station in stations_of(cloud)
        if station.position is not None and station.station_id not in view.hidden_stations
    )


def draw_stations(
    painter: QPainter,
    marks: tuple[StationMark, ...],
    projection: Projection,
    colours: list[QColor],
    paper: QColor,
) -> list[tuple[QRectF, int]]:
    """Draw a tripod at each position; returns where they are, with the ids of the stations."""
    places: list[tuple[QRectF, int]] = []
    if not marks:
        return places
    pixels, _ = projection.to_screen(np.array([mark.position for mark in marks]))
    for mark, colour, at in zip(marks, colours, pixels.tolist(), strict=True):
        if not np.isfinite(at).all():
            continue
        head = QPointF(*at)
        # A pale line under the coloured one shows on any ground.
        for tint, width in ((paper, 4.5), (colour, 2.0)):
            painter.setPen(QPen(tint, width, Qt.PenStyle.SolidLine, Qt.PenCapStyle.RoundCap))
            for leg in LEGS:
                painter.drawLine(head, head + leg)
            painter.setBrush(tint)
            painter.drawEllipse(head, HEAD, HEAD)
        places.append((QRectF(at[0] - 8, at[1] - 6, 16, 22), mark.station_id))
    return places
