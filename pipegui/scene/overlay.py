"""What is written over the picture: labels, legend, scale bar, directions."""

import math
from dataclasses import dataclass

import numpy as np
from PySide6.QtCore import QPointF, QRect, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QIcon, QImage, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QWidget

from pipecore.geometry import Array
from pipecore.types import Deformation, DeformationKind
from pipegui.i18n.texts import first_capital, format_measure, tr
from pipegui.scene.label_places import LEADER, place_box
from pipegui.scene.legend import Legend
from pipegui.scene.measure_marks import MeasureMark, Pens, draw_marks
from pipegui.scene.pose import Pose
from pipegui.scene.projection import Projection
from pipegui.scene.station_marks import StationMark, draw_stations
from pipegui.style import theme
from pipegui.style.colour_maps import station_colour
from pipegui.style.colours import VERDICT
from pipegui.style.theme import SPACING

ICON = 16
HANDLE = 5.0
SCALE_BAR_PX = 140
TRIAD_PX = 30
TRIAD_REACH = TRIAD_PX + 18
SCALE_HEIGHT = 168
SCALE_WIDTH = 14


@dataclass(frozen=True, eq=False)
class Label:
    """A deformation's name at its peak."""

    deformation_id: int
    text: str
    icon: QIcon
    colour: QColor
    anchor: Array
    is_selected: bool = False


def round_length(metres: float) -> float:
    """Return the largest of 1, 2, 5 × 10ⁿ that is at most `metres`."""
    decade = 10.0 ** np.floor(np.log10(metres))
    return float(decade * max(m for m in (1, 2, 5) if m * decade <= metres * (1 + 1e-9)))


def length_text(metres: float) -> str:
    """Return a round length in the unit that reads best."""
    return f"{metres:g} m" if metres >= 1 else f"{1000 * metres:g} mm"


def label_of(deformation: Deformation, *, is_selected: bool) -> Label:
    """Return what is written at a deformation's peak."""
    if deformation.kind is DeformationKind.OVALITY and math.isfinite(deformation.ovality):
        size = format_measure(100 * deformation.ovality, unit="%")
    else:
        size = format_measure(1000 * deformation.depth, 1000 * deformation.depth_sd, "mm")
    return Label(
        deformation.deformation_id,
        f"{first_capital(tr(deformation.kind))} {size}",
        theme.verdict_icon(deformation.verdict),
        QColor(VERDICT[deformation.verdict]),
        np.asarray(deformation.peak, np.float64),
        is_selected,
    )


SPOT = 9.0
"""Radius of the ring around another view's cursor, pixels."""


class SceneOverlay(QWidget):
    """Lies over the canvas and is transparent to the mouse."""

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
        self.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        self.labels: tuple[Label, ...] = ()
        self.legend: Legend | None = None
        self.marks: tuple[MeasureMark, ...] = ()
        self.stations: tuple[StationMark, ...] = ()
        self.colours_stations = False
        """Whether stations are marked in the colours of their points."""
        self.handles: Array | None = None
        """Of the clip box, local coordinates, shape (n, 3)."""
        self.spot: Array | None = None
        """Where another view's cursor is, local coordinates, shape (3,)."""
        self.ring: Array | None = None
        """The profile that a plot's cursor is at, closed, local coordinates, shape (n, 3)."""
        self.hint = ""
        """What to do next, at the top."""
        self.crosses: list[tuple[QRectF, int]] = []
        self._projection: Projection | None = None
        self._pose: Pose | None = None
        self._targets: list[tuple[QRectF, int]] = []
        self._station_places: list[tuple[QRectF, int]] = []
        self.dark = False
        """Whether it is drawn on a dark background."""

    def follow(self, projection: Projection, pose: Pose) -> None:
        """Take the camera of the picture that is being drawn."""
        self._projection, self._pose = projection, pose
        self.update()

    def deformation_at(self, position: QPointF) -> int:
        """Id of the deformation whose label or mark is there, or 0."""
        return next((i for box, i in self._targets if box.contains(position)), 0)

    def station_at(self, position: QPointF) -> int:
        """Return the id of the station whose mark is there, or 0."""
        places = reversed(self._station_places)  # The one drawn last lies on top.
        return next((i for box, i in places if box.contains(position)), 0)

    def measurement_at(self, position: QPointF) -> int:
        """Return the number of the measurement whose closing cross is there, or -1."""
        return next((i for box, i in self.crosses if box.contains(position)), -1)

    def paintEvent(self, event: QPaintEvent) -> None:  # noqa: N802
        """Write everything."""
        if self._projection is None or self._pose is None:
            return
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        taken = [self._draw_corner(painter, self._projection, self._pose)]
        if self.legend is not None:
            taken.append(self._draw_legend(painter, self.legend))
        self._station_places = draw_stations(
            painter, self.stations, self._projection, self._station_colours(), self._paper()
        )
        if self.handles is not None:
            self._draw_handles(painter, self._projection, self.handles)
        if self.ring is not None:
            self._draw_ring(painter, self._projection, self.ring)
        if self.spot is not None:
            self._draw_spot(painter, self._projection, self.spot)
        if self.hint:
            taken.append(self._draw_hint(painter, self.hint))
        accent, text, paper = self._tint("accent"), self._tint("text"), self._paper()
        pens = Pens(accent, text, paper)
        spots = self._spots(self._projection)
        self.crosses = draw_marks(painter, self.marks, self._projection, pens, taken, spots)
        self._draw_labels(painter, self._projection, taken)
        painter.end()

    def _station_colours(self) -> list[QColor]:
        if not self.colours_stations:
            return [self._tint("text")] * len(self.stations)
        return [QColor(*station_colour(mark.station_id)) for mark in self.stations]

    def _draw_handles(self, painter: QPainter, projection: Projection, handles: Array) -> None:
        pixels, _ = projection.to_screen(handles)
        painter.setPen(QPen(self._tint("accent"), 2.0))
        painter.setBrush(self._tint("base"))
        for x, y in pixels[np.isfinite(pixels).all(axis=1)]:
            painter.drawEllipse(QPointF(x, y), HANDLE, HANDLE)

    def _draw_spot(self, painter: QPainter, projection: Projection, spot: Array) -> None:
        pixels, _ = projection.to_screen(spot[None])
        if not np.isfinite(pixels).all():
            return
        at = QPointF(*pixels[0].tolist())
        painter.setBrush(Qt.BrushStyle.NoBrush)
        for colour, width in ((self._paper(), 4.0), (self._tint("accent"), 2.0)):
            painter.setPen(QPen(colour, width))
            painter.drawEllipse(at, SPOT, SPOT)
            painter.drawPoint(at)

    def _draw_ring(self, painter: QPainter, projection: Projection, ring: Array) -> None:
        pixels, _ = projection.to_screen(ring)
        if not np.isfinite(pixels).all():
            return
        corners = [QPointF(x, y) for x, y in pixels.tolist()]
        for colour, width in ((self._paper(), 5.0), (self._tint("accent"), 2.0)):
            painter.setPen(QPen(colour, width))
            painter.drawPolyline(corners)

    def _draw_hint(self, painter: QPainter, text: str) -> QRectF:
        metrics = painter.fontMetrics()
        width = metrics.horizontalAdvance(text) + 2 * SPACING
        box = QRectF(1.5 * SPACING, 1.5 * SPACING, width, metrics.height() + SPACING)
        painter.setPen(QPen(self._tint("accent"), 1.0))
        painter.setBrush(self._paper())
        painter.drawRoundedRect(box, 4, 4)
        painter.setPen(self._tint("text"))
        painter.drawText(box, Qt.AlignmentFlag.AlignCenter, text)
        return box

    # Labels

    def _draw_labels(self, painter: QPainter, projection: Projection, taken: list[QRectF]) -> None:
        self._targets = []
        if not self.labels:
            return
        area, ground = self.rect(), tuple(taken)
        pixels, _ = projection.to_screen(np.array([label.anchor for label in self.labels]))
        spots = self._spots(projection)
        order = sorted(range(len(self.labels)), key=lambda i: not self.labels[i].is_selected)
        marks = []
        for i in order:
            anchor = QPointF(*pixels[i]) if np.isfinite(pixels[i]).all() else QPointF(-1, -1)
            is_covered = any(box.contains(anchor) for box in ground)
            if is_covered or not QRectF(area).contains(anchor):
                continue
            label = self.labels[i]
            width = painter.fontMetrics().horizontalAdvance(label.text) + ICON + 3 * SPACING
            # The selected one is looked at: its label must not cover it.
            leader = 2.5 * LEADER if label.is_selected else LEADER
            others = [spot for k, spot in enumerate(spots) if k != i]
            size = QSize(width, 3 * SPACING)
            # Where it is crowded, better over another's spot than not at all.
            box = place_box(anchor, size, area, [*taken, *others], leader) or place_box(
                anchor, size, area, taken, leader
            )
            marks.append((anchor, box, label))
            self._targets.append((QRectF(anchor.x() - 7, anchor.y() - 7, 14, 14), i))
            if box is not None:
                taken.append(box)
                self._targets.append((box, i))
        for anchor, box, label in reversed(marks):
            self._draw_label(painter, anchor, box, label)
        self._targets = [(box, self.labels[i].deformation_id) for box, i in self._targets]

    def _spots(self, projection: Projection) -> list[QRectF]:
        """Return the places that labels point at, which no text must cover."""
        if not self.labels:
            return []
        pixels, _ = projection.to_screen(np.array([label.anchor for label in self.labels]))
        return [
            QRectF(x - 8, y - 8, 16, 16) if np.isfinite(x) and np.isfinite(y) else QRectF()
            for x, y in pixels
        ]

    def _draw_label(
        self, painter: QPainter, anchor: QPointF, box: QRectF | None, label: Label
    ) -> None:
        line = self._tint("accent") if label.is_selected else label.colour
        if box is not None:
            edge = QPointF(
                float(np.clip(anchor.x(), box.left(), box.right())),
                float(np.clip(anchor.y(), box.top(), box.bottom())),
            )
            painter.setPen(QPen(line, 1.5))
            painter.drawLine(anchor, edge)
        painter.setPen(QPen(self._tint("base"), 1.5))
        painter.setBrush(line)
        painter.drawEllipse(anchor, 4.5, 4.5)
        if box is None:
            return
        painter.setPen(QPen(line, 2.0 if label.is_selected else 1.0))
        painter.setBrush(self._paper())
        painter.drawRoundedRect(box, 4, 4)
        icon = QRect(
            round(box.left()) + SPACING - 2, round(box.center().y()) - ICON // 2, ICON, ICON
        )
        label.icon.paint(painter, icon)
        painter.setPen(self._tint("text"))
        text = box.adjusted(ICON + 1.5 * SPACING, 0, 0, 0)
        painter.drawText(text, Qt.AlignmentFlag.AlignVCenter, label.text)

    # Legend

    def _draw_legend(self, painter: QPainter, legend: Legend) -> QRectF:
        metrics = painter.fontMetrics()
        line = metrics.height() + 4
        texts = [t for _, t in legend.ticks] + [t for _, t in legend.swatches]
        inner = max([metrics.horizontalAdvance(t) for t in texts], default=0)
        width = max(metrics.horizontalAdvance(legend.title), inner + 3 * SPACING) + 2 * SPACING
        rows = SCALE_HEIGHT + line if legend.scale is not None else line * len(legend.swatches)
        height = line + rows + SPACING
        box = QRectF(self.width() - width - 1.5 * SPACING, 1.5 * SPACING, width, height)
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(self._paper())
        painter.drawRoundedRect(box, 4, 4)
        painter.setPen(self._tint("text"))
        left, top = box.left() + SPACING, box.top() + SPACING / 2
        painter.drawText(QPointF(left, top + metrics.ascent()), legend.title)
        top += line
        if legend.scale is not None:
            self._draw_scale(painter, legend, QPointF(left, top + line / 2))
        for (red, green, blue), text in legend.swatches:
            painter.setPen(Qt.PenStyle.NoPen)
            painter.setBrush(QColor(red, green, blue))
            middle = top + metrics.ascent() - metrics.capHeight() / 2
            painter.drawRoundedRect(QRectF(left, middle - 6, 12, 12), 2, 2)
            painter.setPen(self._tint("text"))
            painter.drawText(QPointF(left + 2.5 * SPACING, top + metrics.ascent()), text)
            top += line
        return box

    def _draw_scale(self, painter: QPainter, legend: Legend, corner: QPointF) -> None:
        assert legend.scale is not None
        strip = np.ascontiguousarray(legend.scale[::-1])
        image = QImage(strip.data, 1, len(strip), 3, QImage.Format.Format_RGB888)
        bar = QRectF(corner.x(), corner.y(), SCALE_WIDTH, SCALE_HEIGHT)
        painter.drawImage(bar, image)
        metrics = painter.fontMetrics()
        painter.setPen(self._tint("text"))
        for share, text in legend.ticks:
            y = bar.bottom() - share * bar.height()
            painter.drawLine(QPointF(bar.right(), y), QPointF(bar.right() + 4, y))
            painter.drawText(QPointF(bar.right() + SPACING, y + metrics.ascent() / 2 - 1), text)

    # Scale and directions

    def _draw_corner(self, painter: QPainter, projection: Projection, pose: Pose) -> QRectF:
        """Draw directions and scale bar on one ground."""
        pixel = projection.pixel_size(pose.distance)
        metres = round_length(SCALE_BAR_PX * pixel)
        length = metres / pixel
        width = 2 * TRIAD_REACH + length + 4 * SPACING
        height = 2 * TRIAD_REACH
        corner = QRectF(SPACING, self.height() - height - SPACING, width, height)
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(self._paper(170))
        painter.drawRoundedRect(corner, 4, 4)
        middle = QPointF(corner.left() + TRIAD_REACH, corner.center().y())
        self._draw_triad(painter, middle, pose)
        left = QPointF(corner.left() + 2 * TRIAD_REACH + 2 * SPACING, corner.bottom() - 2 * SPACING)
        self._draw_scale_bar(painter, left, length, length_text(metres))
        return corner

    def _draw_triad(self, painter: QPainter, middle: QPointF, pose: Pose) -> None:
        names: list[QRectF] = []
        axes = zip(np.eye(3), "ENH", strict=True)
        for axis, name in sorted(axes, key=lambda a: a[0] @ pose.forward):
            tip = QPointF(float(axis @ pose.right), -float(axis @ pose.up))
            fade = QColor(self._tint("text"))
            fade.setAlphaF(1.0 if axis @ pose.forward < 0.1 else 0.55)
            painter.setPen(QPen(fade, 1.6))
            painter.drawLine(middle, middle + tip * TRIAD_PX)
            at = middle + tip * (TRIAD_PX + 9)
            box = QRectF(at.x() - 8, at.y() - 8, 16, 16)
            is_free = not any(box.intersects(other) for other in names)
            if is_free and np.hypot(tip.x(), tip.y()) > 0.25:
                names.append(box)
                painter.drawText(box, Qt.AlignmentFlag.AlignCenter, name)

    def _draw_scale_bar(self, painter: QPainter, left: QPointF, length: float, text: str) -> None:
        tick, right = QPointF(0, 4), left + QPointF(length, 0)
        painter.setPen(QPen(self._tint("text"), 1.6))
        painter.drawLine(left, right)
        for end in (left, right):
            painter.drawLine(end - tick, end + tick)
        box = QRectF(left.x() - SPACING, left.y() - 26, length + 2 * SPACING, 20)
        painter.drawText(box, Qt.AlignmentFlag.AlignCenter, text)

    def _tint(self, role: str) -> QColor:
        return theme.colour(role, dark=self.dark)

    def _paper(self, alpha: int = 225) -> QColor:
        paper = self._tint("base")
        paper.setAlpha(alpha)
        return paper
