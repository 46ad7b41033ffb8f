"""Radius against profile index of the selected element, as the paper draws it."""

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QPointF, QSignalBlocker, Qt, Signal
from PySide6.QtGui import QColor, QFontMetrics
from PySide6.QtWidgets import QComboBox, QLabel, QWidget

from pipecore.geometry import Array
from pipecore.report.format import format_measure
from pipegui import theme
from pipegui.colour_maps import QUALITATIVE
from pipegui.colours import VERDICT
from pipegui.plots.chart import Chart, faint, small
from pipegui.plots.pattern import Pattern, index_at, pattern_of
from pipegui.view_state import RadiusPlotState

EMPTY = "Select an element to see its radius from profile to profile."
CLICK_PX = 20
POINT_PX = 6
X_AXES = {"Index": "Profile index", "Chainage": "Chainage, m"}


class RadiusPlot(Chart):
    """Semi-minor axis per profile with the fitted pattern; centre deviation below it."""

    profile_clicked = Signal(int, int)
    """Stack id and profile index."""
    stack_chosen = Signal(int)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(EMPTY, parent)
        self._state = RadiusPlotState()
        self._x: Array = np.empty(0)
        self._pattern: Pattern | None = None
        self.stacks = QComboBox()
        self.stacks.setMinimumContentsLength(14)
        self.stacks.setToolTip("The stack whose profiles are plotted.")
        self.stacks.activated.connect(self._choose_stack)
        self.x_axis = QComboBox()
        self.x_axis.addItems(X_AXES)
        self.x_axis.setToolTip("What the profiles are plotted against.")
        self.x_axis.currentIndexChanged.connect(self._draw)
        self.key = QLabel()
        self.header.addWidget(self.stacks)
        self.header.addWidget(self.x_axis)
        self.header.addStretch(1)
        self.layout_key()
        self.radius = self.add_plot(0, "mm")
        self.offset = self.add_plot(1, "mm", X_AXES["Index"])
        # Inside the plot: beside its axis there is no room for it in a small panel.
        self.offset_title = pg.LabelItem("centre off the axis")
        self.offset_title.setParentItem(self.offset.vb)
        self.offset_title.anchor((0, 0), (0, 0), offset=(4, -2))
        self.offset.setXLink(self.radius)
        self.canvas.ci.layout.setRowStretchFactor(0, 5)
        self.canvas.ci.layout.setRowStretchFactor(1, 2)
        self.radius.getAxis("bottom").setStyle(showValues=False)
        self.on_click(self._click)
        self.on_hover(self._hover)
        self.setAccessibleName("Radius plot")

    def layout_key(self) -> None:
        """Put the key between header and plots."""
        column = self.canvas.parentWidget().layout()
        column.insertWidget(1, self.key)

    def apply(self, state: RadiusPlotState) -> None:
        """Show `state`."""
        is_new_theme = self.is_new_theme()
        before, self._state = self._state, state
        if state == before and not is_new_theme:
            return
        has_profiles = state.element is not None and len(state.shown) > 0
        self.empty.setText(
            EMPTY
            if state.element is None
            else f"{state.element.label} has no profiles with an accepted ellipse."
        )
        self.show_filled(has_profiles)
        self._fill_stacks(state)
        self._draw()
        is_other = state.element is not before.element or state.stack_id != before.stack_id
        if has_profiles and is_other:
            self._fit()

    def _fill_stacks(self, state: RadiusPlotState) -> None:
        with QSignalBlocker(self.stacks):
            self.stacks.clear()
            for stack_id, name, count in state.stacks:
                self.stacks.addItem(f"{name} ({count})", stack_id)
            self.stacks.setCurrentIndex(self.stacks.findData(state.stack_id))

    def _choose_stack(self, row: int) -> None:
        self.stack_chosen.emit(self.stacks.itemData(row))

    # Drawing

    @property
    def _is_by_chainage(self) -> bool:
        return self.x_axis.currentIndex() == 1

    def _x_at(self, chainage: Array | float) -> Array:
        if self._is_by_chainage:
            return np.asarray(chainage)
        return index_at(chainage, self._state.shown)

    def _draw(self) -> None:
        state = self._state
        self.readout.clear()
        self.radius.clear()
        self.offset.clear()
        self.offset.setLabel("bottom", X_AXES[self.x_axis.currentText()])
        self.offset_title.setText("centre off the axis", color=theme.colour("muted"), size="8pt")
        profiles = state.shown
        if state.element is None or not len(profiles):
            self._pattern, self._x = None, np.empty(0)
            return
        self._pattern = pattern = pattern_of(state.element, profiles)
        self._x = self._x_at(profiles.chainage).astype(np.float64)
        data, fitted = QColor(*QUALITATIVE[0].tolist()), theme.colour("text")
        self._shade_deformations()
        self._draw_band(pattern, data)
        order = np.argsort(self._x, kind="stable")
        x = self._x[order]
        self.radius.plot(x, pattern.fitted[order], pen=pg.mkPen(fitted, width=1.5), antialias=True)
        self._draw_points(self.radius, pattern.values, data, pattern.sd)
        self._draw_points(self.offset, 1000 * profiles.centre_deviation, data)
        self._mark_selected()
        self._describe(pattern, data, fitted)

    def _draw_band(self, pattern: Pattern, colour: QColor) -> None:
        order = np.argsort(self._x, kind="stable")
        x, moved = self._x[order], pattern.moved[order]
        edges = [
            pg.PlotDataItem(x, moved + side * pattern.spread, pen=pg.mkPen(None))
            for side in (-1, 1)
        ]
        for edge in edges:
            self.radius.addItem(edge)
        self.radius.addItem(pg.FillBetweenItem(*edges, brush=faint(colour, 0.16)))
        dashed = pg.mkPen(colour, width=1.5, style=Qt.PenStyle.DashLine)
        self.radius.plot(x, moved, pen=dashed, antialias=True)

    def _draw_points(
        self, plot: pg.PlotItem, values: Array, colour: QColor, sd: Array | None = None
    ) -> None:
        shown = np.isfinite(values)
        x, y = self._x[shown], values[shown]
        if sd is not None:
            height = 2 * np.nan_to_num(sd[shown])
            bars = pg.ErrorBarItem(x=x, y=y, height=height, pen=pg.mkPen(faint(colour, 0.5)))
            plot.addItem(bars)
        plot.addItem(
            pg.ScatterPlotItem(
                x, y, size=POINT_PX, brush=colour, pen=pg.mkPen(None), antialias=True
            )
        )

    def _shade_deformations(self) -> None:
        for deformation in self._state.deformations:
            is_selected = deformation.deformation_id == self._state.selected_deformation
            colour = theme.colour("accent") if is_selected else QColor(VERDICT[deformation.verdict])
            ends = self._x_at(np.array([deformation.chainage_start, deformation.chainage_end]))
            for plot in (self.radius, self.offset):
                region = pg.LinearRegionItem(
                    np.sort(ends),
                    movable=False,
                    brush=faint(colour, 0.18 if is_selected else 0.12),
                    pen=pg.mkPen(faint(colour, 0.6)),
                )
                region.setZValue(-10)
                plot.addItem(region)
            text = f"{deformation.kind} {format_measure(1000 * deformation.depth, unit='mm')}"
            label = pg.InfLineLabel(
                pg.InfiniteLine(float(ends.mean()), pen=pg.mkPen(None)),
                text,
                position=0.93,
                anchors=[(0.5, 0.5), (0.5, 0.5)],
                color=colour,
            )
            label.setFont(small(self.font()))
            self.radius.addItem(label.line)

    def _mark_selected(self) -> None:
        profiles, index = self._state.shown, self._state.selected_index
        rows = np.flatnonzero(profiles.profile_index == index) if index is not None else []
        if not len(rows) or self._pattern is None:
            return
        row, accent = rows[0], theme.colour("accent")
        for plot, values in (
            (self.radius, self._pattern.values),
            (self.offset, 1000 * profiles.centre_deviation),
        ):
            plot.addItem(pg.InfiniteLine(self._x[row], pen=pg.mkPen(accent, width=1)))
            if np.isfinite(values[row]):
                plot.addItem(
                    pg.ScatterPlotItem(
                        [self._x[row]],
                        [values[row]],
                        size=2 * POINT_PX,
                        brush=accent,
                        pen=pg.mkPen(theme.colour("base"), width=1.5),
                        antialias=True,
                    )
                )

    def _describe(self, pattern: Pattern, data: QColor, fitted: QColor) -> None:
        scatter = f"scatter ± {format_measure(pattern.spread, unit='mm', decimals=2)}"
        if np.ptp(pattern.fitted) < 1e-6:  # else it is not one number
            scatter = f"median {format_measure(pattern.middle, decimals=2)}, {scatter}"
        dot, line, dash, band = (
            f'<span style="color:{c.name()}">{s}</span>'
            for c, s in ((data, "●"), (fitted, "━"), (data, "╍"), (faint(data, 1), "▒"))
        )
        self.key.setText(f"{dot} semi-minor axis&nbsp; {line} fitted&nbsp; {dash} {band} {scatter}")

    def _fit(self) -> None:
        """Show all points with a margin; a few wild ones must not flatten the rest."""
        pattern = self._pattern
        if pattern is None or not len(self._x):
            return
        values = pattern.values[np.isfinite(pattern.values)]
        if not len(values):
            return
        low, high = np.percentile(values, [2, 98])
        low, high = min(low, pattern.fitted.min()), max(high, pattern.fitted.max())
        room = max(0.6 * (high - low), 4 * pattern.spread, 0.5)
        low, high = max(values.min(), low - room), min(values.max(), high + room)
        margin = max(0.15 * (high - low), 0.5)
        self.radius.setYRange(low - margin, high + 2 * margin, padding=0)
        self.radius.setXRange(self._x.min(), self._x.max(), padding=0.03)
        off = 1000 * self._state.shown.centre_deviation
        top = float(np.nanmax(off)) if np.isfinite(off).any() else 1.0
        self.offset.setYRange(0, 1.15 * max(top, 0.5), padding=0)

    # Mouse

    def _row_at(self, plot: pg.PlotItem, position: QPointF) -> int | None:
        """Row of the profile whose point is nearest to `position`, if any is near."""
        if self._pattern is None:
            return None
        is_radius = plot is self.radius
        values = self._pattern.values if is_radius else 1000 * self._state.shown.centre_deviation
        pixel = plot.vb.viewPixelSize()
        cursor = plot.vb.mapSceneToView(position)
        away = np.hypot((self._x - cursor.x()) / pixel[0], (values - cursor.y()) / pixel[1])
        if not np.isfinite(away).any() or np.nanmin(away) > CLICK_PX:
            return None
        return int(np.nanargmin(away))

    def _click(self, plot: pg.PlotItem, position: QPointF) -> None:
        row = self._row_at(plot, position)
        if row is not None:
            profiles = self._state.shown
            self.profile_clicked.emit(int(profiles.stack_id[row]), int(profiles.profile_index[row]))

    def _hover(self, plot: pg.PlotItem | None, position: QPointF) -> None:
        row = self._row_at(plot, position) if plot is not None else None
        self.readout.setText("" if row is None else self._row_text(row))

    def _row_text(self, row: int) -> str:
        profiles = self._state.shown
        radius = format_measure(1000 * profiles.radius[row], 1000 * profiles.radius_sd[row], "mm")
        centre = format_measure(1000 * profiles.centre_deviation[row], unit="mm")
        text = (
            f"Profile {profiles.profile_index[row]} · {profiles.chainage[row]:.3f} m"
            f" · radius {radius} · centre off {centre}"
        )
        metrics = QFontMetrics(self.readout.font())
        return metrics.elidedText(text, Qt.TextElideMode.ElideRight, self.readout.width())
