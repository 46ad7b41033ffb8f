"""A small drawing of some points, from above and from the south."""

import numpy as np
from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QPainter, QPaintEvent
from PySide6.QtWidgets import QSizePolicy, QWidget

from pipecore.geometry import Array
from pipecore.io.source import Chunk
from pipegui.i18n.texts import mark, tr
from pipegui.style import theme

SIDES = ((mark("from above"), 0, 1), (mark("from the south"), 0, 2))
"""Their names, and which coordinates go to the right and up."""
WIDTH, HEIGHT = 20 * theme.SPACING, 15 * theme.SPACING


class PointsSketch(QWidget):
    """Draws points in two views side by side, in their colours if they have any."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Fixed)
        self.setAccessibleName(tr("Sketch of the points"))
        self._xyz: Array = np.empty((0, 3))
        self._colours: list[QColor] = []

    def apply(self, points: Chunk | None) -> None:
        """Show points; None for none."""
        self._xyz, self._colours = np.empty((0, 3)), []
        if points is not None:
            is_there = np.isfinite(points.xyz).all(axis=1)
            self._xyz = points.xyz[is_there]
            if points.rgb is not None:
                rgb = points.rgb[is_there].astype(int)
                rgb = rgb // 257 if rgb.max(initial=0) > 255 else rgb
                self._colours = [QColor(*row) for row in rgb.tolist()]
        self.update()

    def sizeHint(self) -> QSize:  # noqa: N802
        """Return room for both views."""
        return QSize(2 * WIDTH + theme.SPACING, HEIGHT)

    def paintEvent(self, event: QPaintEvent) -> None:  # noqa: N802
        """Draw both views."""
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        for i, (name, across, up) in enumerate(SIDES):
            frame = QRectF(i * (WIDTH + theme.SPACING), 0, WIDTH, HEIGHT).adjusted(1, 1, -1, -1)
            painter.setPen(theme.colour("border"))
            painter.setBrush(theme.colour("base"))
            painter.drawRoundedRect(frame, 4, 4)
            self._draw_points(painter, frame, self._xyz[:, [across, up]])
            painter.setPen(theme.colour("muted"))
            inside = frame.adjusted(6, 4, -6, -4)
            painter.drawText(inside, Qt.AlignmentFlag.AlignBottom, tr(name))
        painter.end()

    def _draw_points(self, painter: QPainter, frame: QRectF, flat: Array) -> None:
        if not len(flat):
            return
        low, high = flat.min(axis=0), flat.max(axis=0)
        area = frame.adjusted(8, 8, -8, -8 - painter.fontMetrics().height())
        size = np.array([area.width(), area.height()])
        scale = float((size / np.maximum(high - low, 1e-9)).min())
        middle = (low + high) / 2
        for i, (right, up) in enumerate(((flat - middle) * scale).tolist()):
            painter.setPen(self._colours[i] if self._colours else theme.colour("accent"))
            painter.drawPoint(QPointF(area.center().x() + right, area.center().y() - up))
