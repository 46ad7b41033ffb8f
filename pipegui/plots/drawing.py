"""Pieces of the radius plot: points with error bars, bands, shaded stretches."""

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import Qt
from PySide6.QtGui import QColor, QFont

from pipecore.geometry import Array
from pipegui.plots.chart import faint
from pipegui.style import theme

POINT_PX = 6


def draw_points(
    plot: pg.PlotItem,
    x: Array,
    y: Array,
    colour: QColor,
    sd: Array | None = None,
    symbol: str = "o",
    size: float = POINT_PX,
) -> None:
    """Draw points, with bars of one standard deviation where given."""
    shown = np.isfinite(y)
    if not shown.any():
        return
    x, y = x[shown], y[shown]
    if sd is not None:
        height = 2 * np.nan_to_num(sd[shown])
        plot.addItem(pg.ErrorBarItem(x=x, y=y, height=height, pen=pg.mkPen(faint(colour, 0.5))))
    is_outline = symbol != "o"
    plot.addItem(
        pg.ScatterPlotItem(
            x,
            y,
            symbol=symbol,
            size=size,
            brush=pg.mkBrush(None) if is_outline else colour,
            pen=pg.mkPen(colour, width=1.2) if is_outline else pg.mkPen(None),
            antialias=True,
        )
    )


def draw_line(
    plot: pg.PlotItem, x: Array, y: Array, colour: QColor, *, dashed: bool = False
) -> None:
    """Draw a line through points in the order of x."""
    order = np.argsort(x, kind="stable")
    style = Qt.PenStyle.DashLine if dashed else Qt.PenStyle.SolidLine
    pen = pg.mkPen(colour, width=1.5, style=style)
    plot.plot(x[order], y[order], pen=pen, antialias=True)


def draw_band(
    plot: pg.PlotItem, x: Array, middle: Array, half_width: float, colour: QColor
) -> None:
    """Shade what lies within `half_width` of a line."""
    order = np.argsort(x, kind="stable")
    edges = [
        pg.PlotDataItem(x[order], middle[order] + side * half_width, pen=pg.mkPen(None))
        for side in (-1, 1)
    ]
    for edge in edges:
        plot.addItem(edge)
    plot.addItem(pg.FillBetweenItem(*edges, brush=faint(colour, 0.16)))


def draw_stretch(plot: pg.PlotItem, ends: Array, colour: QColor, *, is_selected: bool) -> None:
    """Shade a stretch of profiles."""
    region = pg.LinearRegionItem(
        np.sort(ends),
        movable=False,
        brush=faint(colour, 0.18 if is_selected else 0.12),
        pen=pg.mkPen(faint(colour, 0.6)),
    )
    region.setZValue(-10)
    plot.addItem(region)


def draw_label(plot: pg.PlotItem, x: float, text: str, colour: QColor, font: QFont) -> None:
    """Write a text near the top of a plot."""
    label = pg.InfLineLabel(
        pg.InfiniteLine(x, pen=pg.mkPen(None)),
        text,
        position=0.93,
        anchors=[(0.5, 0.5), (0.5, 0.5)],
        color=colour,
    )
    label.setFont(font)
    plot.addItem(label.line)


def draw_mark(plot: pg.PlotItem, x: float, y: float) -> None:
    """Mark the selected point."""
    accent = theme.colour("accent")
    plot.addItem(pg.InfiniteLine(x, pen=pg.mkPen(accent, width=1)))
    if np.isfinite(y):
        ring = pg.mkPen(theme.colour("base"), width=1.5)
        plot.addItem(pg.ScatterPlotItem([x], [y], size=11, brush=accent, pen=ring, antialias=True))
