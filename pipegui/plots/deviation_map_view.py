"""The unrolled deviation map: chainage by clock, inward blue, outward red."""

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QPointF, QRectF, Signal
from PySide6.QtGui import QColor, QImage, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QGraphicsEllipseItem, QGraphicsRectItem, QWidget

from pipecore.formatting import format_clock
from pipecore.inspection.deviation_grid import DeviationGrid, clock_from, grid_deviation
from pipecore.types import Deformation, DeformationKind
from pipegui.i18n.texts import format_measure, label_of, mark, tr
from pipegui.plots.chart import Chart
from pipegui.plots.export import Table
from pipegui.states.view_state import MapState
from pipegui.style import theme
from pipegui.style.colour_maps import DEVIATION, deviation_colours
from pipegui.style.colours import VERDICT
from pipegui.style.theme import SPACING

EMPTY = mark("Select an element to see its surface unrolled.")
DEGREES = ((-180, "6:00"), (-90, "9:00"), (0, "12:00"), (90, "3:00"), (180, "6:00"))
MARGIN_DEG = 190
"""The map ends at ± 180°; the rest is room for the labels there."""
WHOLE_ROUND = np.deg2rad(330)
"""A deformation wider than this goes all the way round."""


class DeviationMapView(Chart):
    """Shows the surface of the selected element; clicks say which spot is meant."""

    spot_clicked = Signal(float, float)
    """Chainage in metres and clock angle in radians."""
    deformation_clicked = Signal(int)
    spot_hovered = Signal(object)
    """(chainage, clock) under the cursor, or None."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(tr(EMPTY), parent)
        self.state = MapState()
        self._grid: DeviationGrid | None = None
        self.scale = ScaleStrip()
        self.header.addWidget(self.scale)
        self.header.addStretch(1)
        self.header.addWidget(self.menu_button)
        self.plot = self.add_plot(0, tr("Clock"), tr("Chainage, m"))
        self.plot.getAxis("left").setTicks([DEGREES])
        self.plot.setYRange(-MARGIN_DEG, MARGIN_DEG, padding=0)
        self.plot.setLimits(yMin=-MARGIN_DEG, yMax=MARGIN_DEG)
        self._image = pg.ImageItem(axisOrder="row-major")
        self._shapes: list[object] = []
        self.plot.addItem(self._image)
        self.cursor_mark = pg.ScatterPlotItem(size=14, brush=pg.mkBrush(None), antialias=True)
        self.cursor_mark.setZValue(20)
        self.plot.addItem(self.cursor_mark, ignoreBounds=True)
        self.on_click(self._click)
        self.on_hover(self._hover)
        self.setAccessibleName(tr("Deviation map"))

    def apply(self, state: MapState) -> None:
        """Show `state`."""
        is_new_theme = self.is_new_theme()
        before, self.state = self.state, state
        if state == before and not is_new_theme:
            return
        element = state.element
        has_points = bool(np.isfinite(state.points.deviation).any())
        self.empty.setText(
            tr(EMPTY)
            if element is None
            else tr("{label} has no points with a deviation.").format(label=label_of(element))
        )
        self.show_filled(element is not None and has_points)
        self.scale.set_limit(state.limit_mm)
        self.readout.clear()
        if element is None or not has_points:
            self._grid = None
            return
        is_other = element is not before.element or state.points is not before.points
        if is_other:
            self._grid = grid_deviation(element, state.points)
        if self._grid is not None:
            self._draw_image(self._grid)
        self._draw_shapes()
        if is_other:
            self.fit()

    # Drawing

    def _draw_image(self, grid: DeviationGrid) -> None:
        values = 1000 * grid.deviation.T
        colours = deviation_colours(values, self.state.limit_mm)
        opaque = np.where(np.isfinite(values), 255, 0).astype(np.uint8)
        self._image.setImage(np.dstack([colours, opaque]), levels=(0, 255))
        self._image.setRect(QRectF(grid.start, -180, grid.length, 360))

    def _draw_shapes(self) -> None:
        for shape in self._shapes:
            self.plot.removeItem(shape)
        self._shapes = []
        for deformation in self.state.deformations:
            is_selected = deformation.deformation_id == self.state.selected_deformation
            colour = theme.colour("accent") if is_selected else QColor(VERDICT[deformation.verdict])
            for box in self.boxes(deformation):
                is_round = box.height() < 360
                shape = (QGraphicsEllipseItem if is_round else QGraphicsRectItem)(box)
                pen = QPen(colour, 3.0 if is_selected else 2.0)
                pen.setCosmetic(True)
                shape.setPen(pen)
                self._add(shape)
        if self.state.selected_chainage is not None:
            line = pg.mkPen(theme.colour("accent"), width=1.5)
            self._add(pg.InfiniteLine(self.state.selected_chainage, pen=line))

    def _add(self, shape: object) -> None:
        self.plot.addItem(shape, ignoreBounds=True)
        self._shapes.append(shape)

    def boxes(self, deformation: Deformation) -> list[QRectF]:
        """Return where a deformation lies on the map; twice if it crosses the cut at 6:00."""
        length = deformation.chainage_end - deformation.chainage_start
        width = float(np.rad2deg(self._angular_width(deformation)))
        if width >= np.rad2deg(WHOLE_ROUND):
            return [QRectF(deformation.chainage_start, -180, length, 360)]
        middle = float(np.rad2deg(clock_from(deformation.clock)))
        turns = [0] + [t for t in (-360, 360) if abs(middle + t) - width / 2 < 180]
        return [
            QRectF(deformation.chainage_start, middle + t - width / 2, length, width) for t in turns
        ]

    def _angular_width(self, deformation: Deformation) -> float:
        if deformation.kind in {DeformationKind.OVALITY, DeformationKind.BOW}:
            return 2 * np.pi
        element = self.state.element
        radius = 0.0 if element is None else float(element.radius_at(deformation.chainage))
        width = deformation.width / radius if radius > 0 else np.nan
        return width if np.isfinite(width) else 2 * np.pi

    def fit(self) -> None:
        """Show the whole element."""
        if self._grid is not None:
            self.plot.setXRange(
                self._grid.start, self._grid.start + self._grid.length, padding=0.02
            )
            self.plot.setYRange(-MARGIN_DEG, MARGIN_DEG, padding=0)

    # Copying

    def heading(self) -> str:
        """Return the element's name and what the colours mean."""
        element, limit = self.state.element, self.state.limit_mm
        name = "" if element is None else label_of(element)
        blue, red = (QColor(*DEVIATION[i].tolist()).name() for i in (0, -1))
        inward, outward = (f'<span style="color:{c}">■</span>' for c in (blue, red))
        return tr(
            "<b>{name}</b> · deviation<br>{inward} {limit:g} mm inward … {outward} "
            "{limit:g} mm outward"
        ).format(name=name, inward=inward, limit=limit, outward=outward)

    def numbers(self) -> Table:
        """Return the cells that hold points."""
        if self._grid is None:
            return {}
        deviation_mm, counts = 1000 * self._grid.deviation, self._grid.n_points
        along, around = np.nonzero(counts)
        chainage, clock = self._grid.chainages[along], self._grid.clocks[around]
        return {
            "chainage_m": [f"{v:.4f}" for v in chainage],
            "clock": [format_clock(float(v)) for v in clock],
            "clock_deg": [f"{v:.2f}" for v in np.rad2deg(clock)],
            "deviation_mm": [f"{v:.3f}" for v in deviation_mm[along, around]],
            "n_points": [str(v) for v in counts[along, around]],
        }

    # Mouse

    def _place(self, position: QPointF) -> tuple[float, float]:
        """Chainage and clock angle (0 … 2π) under a position in the canvas."""
        at = self.plot.vb.mapSceneToView(position)
        return at.x(), float(np.mod(np.deg2rad(at.y()), 2 * np.pi))

    def _click(self, _: pg.PlotItem, position: QPointF) -> None:
        if self._grid is None:
            return
        at = self.plot.vb.mapSceneToView(position)
        hit = [
            d for d in self.state.deformations if any(_is_inside(box, at) for box in self.boxes(d))
        ]
        if hit:
            smallest = min(hit, key=lambda d: d.length * self._angular_width(d))
            self.deformation_clicked.emit(smallest.deformation_id)
        elif self._grid.cell(*self._place(position)) is not None:
            self.spot_clicked.emit(*self._place(position))

    def _hover(self, plot: pg.PlotItem | None, position: QPointF) -> None:
        grid = self._grid
        if plot is None or grid is None:
            self.readout.clear()
            self.spot_hovered.emit(None)
            return
        place = self._place(position)
        self.readout.setText(_text_of(grid, *place))
        self.spot_hovered.emit(place if grid.cell(*place) is not None else None)

    def show_cursor(self, place: tuple[float, float] | None) -> None:
        """Show where another view's cursor is: chainage and clock, or nowhere."""
        if place is None or self._grid is None:
            self.cursor_mark.clear()
            return
        chainage, clock = place
        pen = pg.mkPen(theme.colour("accent"), width=2)
        self.cursor_mark.setData([chainage], [float(np.rad2deg(clock_from(clock)))], pen=pen)


class ScaleStrip(QWidget):
    """The colours of the deviation with their limits."""

    BAR = 120

    def __init__(self) -> None:
        super().__init__()
        self._limit_mm = 10.0
        self.setFixedHeight(3 * SPACING)
        self.setMinimumWidth(self.BAR + 120)

    def set_limit(self, limit_mm: float) -> None:
        """Take other limits."""
        self._limit_mm = limit_mm
        self.update()

    def paintEvent(self, event: QPaintEvent) -> None:  # noqa: N802
        """Draw "−10 ▇▇▇ +10 mm"."""
        painter = QPainter(self)
        painter.setPen(theme.colour("text"))
        low, high = f"−{self._limit_mm:g}", f"+{self._limit_mm:g} mm"
        metrics = painter.fontMetrics()
        left = metrics.horizontalAdvance(low) + SPACING
        middle = self.height() / 2
        baseline = middle + metrics.ascent() / 2 - 1
        painter.drawText(QPointF(0, baseline), low)
        strip = np.ascontiguousarray(DEVIATION)
        image = QImage(strip.data, len(strip), 1, 3 * len(strip), QImage.Format.Format_RGB888)
        painter.drawImage(QRectF(left, middle - 6, self.BAR, 12), image)
        painter.drawText(QPointF(left + self.BAR + SPACING, baseline), high)
        painter.end()


def _text_of(grid: DeviationGrid, chainage: float, clock: float) -> str:
    """Return the readout of a place on the map."""
    cell = grid.cell(chainage, clock)
    if cell is None:
        return ""
    place = f"{chainage:.3f} m · {format_clock(clock)}"
    n_points = int(grid.n_points[cell])
    if not n_points:
        return tr("{place} · not scanned").format(place=place)
    value = 1000 * float(grid.deviation[cell])
    side = tr("outward") if value > 0 else tr("inward")
    size = format_measure(abs(value), unit="mm")
    return tr("{place} · {size} {side} · {n_points} points").format(
        place=place, size=size, side=side, n_points=n_points
    )


def _is_inside(box: QRectF, at: QPointF) -> bool:
    if box.height() >= 360:
        return box.contains(at)
    x = (at.x() - box.center().x()) / (box.width() / 2)
    y = (at.y() - box.center().y()) / (box.height() / 2)
    return x * x + y * y <= 1
