"""Measured distances and picked coordinates, written over the picture."""

from dataclasses import dataclass

import numpy as np
from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QPainter, QPen

from pipecore.formatting import MINUS
from pipecore.types import PointCloud
from pipegui.i18n.texts import tr
from pipegui.model.document import Measurement
from pipegui.scene.label_places import place_box
from pipegui.scene.projection import Projection
from pipegui.states.descriptions import axis_names, coordinate_lines
from pipegui.style.theme import SPACING

CROSS = 10
END = 5.0


@dataclass(frozen=True)
class MeasureMark:
    """A measurement with its label; `number` is -1 for one not yet finished."""

    number: int
    measurement: Measurement
    lines: tuple[str, ...]


@dataclass(frozen=True)
class Pens:
    """The colours of the present theme."""

    line: QColor
    text: QColor
    paper: QColor


def lines_of(measurement: Measurement, cloud: PointCloud) -> tuple[str, ...]:
    """Return what is to be read of a measurement: coordinates, or distance and its parts."""
    start = np.array(measurement.start)
    if measurement.end is None:
        return coordinate_lines(cloud, start)
    step = np.array(measurement.end) - start
    flat = float(np.hypot(step[0], step[1]))
    parts = [f"Δ{name} {_signed(v)}" for name, v in zip(axis_names(cloud), step, strict=True)]
    return (
        f"{np.linalg.norm(step):.3f} m",
        "  ".join(parts),
        tr("horizontal {flat:.3f} m").format(flat=flat),
    )


def _signed(metres: float) -> str:
    return f"{MINUS if round(metres, 3) < 0 else '+'}{abs(metres):.3f}"


def draw_marks(
    painter: QPainter,
    marks: tuple[MeasureMark, ...],
    projection: Projection,
    pens: Pens,
    taken: list[QRectF],
    spots: list[QRectF],
) -> list[tuple[QRectF, int]]:
    """Draw measurements; returns the places of their closing crosses with their numbers.

    What is written keeps off the boxes in `taken`, to which it is added, and off `spots`.
    """
    crosses = []
    for mark in marks:
        ends = [e for e in (mark.measurement.start, mark.measurement.end) if e is not None]
        pixels, _ = projection.to_screen(np.array(ends))
        if not np.isfinite(pixels).all():
            continue
        at = [QPointF(*p) for p in pixels]
        # A pale line under the coloured one shows on any ground.
        for colour, width in ((pens.paper, 4.0), (pens.line, 2.0)):
            painter.setPen(QPen(colour, width))
            if len(at) == 2:
                painter.drawLine(*at)
            for end in at:
                painter.drawLine(end - QPointF(END, 0), end + QPointF(END, 0))
                painter.drawLine(end - QPointF(0, END), end + QPointF(0, END))
        box = _write(painter, mark, (at[0] + at[-1]) / 2, pens, [*taken, *spots])
        taken.append(box)
        if mark.number >= 0:
            crosses.append((_draw_cross(painter, box, pens), mark.number))
    return crosses


def _write(
    painter: QPainter, mark: MeasureMark, middle: QPointF, pens: Pens, taken: list[QRectF]
) -> QRectF:
    metrics = painter.fontMetrics()
    line = metrics.height() + 1
    width = max(metrics.horizontalAdvance(text) for text in mark.lines) + 2 * SPACING
    width += CROSS + SPACING if mark.number >= 0 else 0
    height = line * len(mark.lines) + SPACING
    size, leader = QSize(round(width), round(height)), 2.0 * SPACING
    free = place_box(middle, size, painter.window(), taken, leader)
    box = free or QRectF(middle.x() + 1.5 * SPACING, middle.y() + 1.5 * SPACING, width, height)
    edge = QPointF(
        min(max(middle.x(), box.left()), box.right()), min(max(middle.y(), box.top()), box.bottom())
    )
    painter.setPen(QPen(pens.line, 1.0))
    painter.drawLine(middle, edge)
    painter.setPen(QPen(pens.line, 1.0))
    painter.setBrush(pens.paper)
    painter.drawRoundedRect(box, 4, 4)
    painter.setPen(pens.text)
    for i, text in enumerate(mark.lines):
        row = QRectF(box.left() + SPACING, box.top() + SPACING / 2 + i * line, width, line)
        painter.drawText(row, Qt.AlignmentFlag.AlignVCenter, text)
    return box


def _draw_cross(painter: QPainter, box: QRectF, pens: Pens) -> QRectF:
    cross = QRectF(box.right() - CROSS - SPACING / 2, box.top() + SPACING / 2, CROSS, CROSS)
    inner = cross.adjusted(2, 2, -2, -2)
    painter.setPen(QPen(pens.text, 1.5))
    painter.drawLine(inner.topLeft(), inner.bottomRight())
    painter.drawLine(inner.topRight(), inner.bottomLeft())
    return cross.adjusted(-3, -3, 3, 3)
