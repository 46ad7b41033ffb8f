"""One profile: its points, its ellipse and curve, the undeformed contour, in millimetres."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QPointF, Qt, Signal
from PySide6.QtGui import QColor, QKeyEvent
from PySide6.QtWidgets import QLabel, QSlider, QToolButton, QWidget

from pipecore.formatting import cell
from pipecore.geometry import Array
from pipecore.inspection.dimensions import measure_dimensions
from pipecore.inspection.section import Section, SectionEllipse
from pipecore.types import OWN_STACK
from pipegui.i18n.texts import format_measure, label_of, mark, tr
from pipegui.plots.chart import Chart, faint
from pipegui.plots.exaggeration import ellipse_points, exaggerate
from pipegui.plots.export import Table
from pipegui.plots.section_texts import dimension_text, section_text, value_text
from pipegui.plots.series_menu import SeriesMenu
from pipegui.states.view_state import SectionState
from pipegui.style import theme
from pipegui.style.colour_maps import QUALITATIVE

EMPTY = mark("Select a profile to see its section: click a point of the radius plot or of the map.")
MAX_FACTOR = 20
MAX_POINTS = 20_000
HOVER_PX = 15
MM = 1000.0
"""Sections come in metres and are drawn in millimetres."""
ROOM_FOR_BOTH = 250
"""Height in pixels below which the section stands alone."""
CLOCK = (("12", 0, 1), ("3", 1, 0), ("6", 0, -1), ("9", -1, 0))
HOURS = tuple((90.0 * i, text) for i, text in enumerate(("12:00", "3:00", "6:00", "9:00", "12:00")))
STEPS = {Qt.Key.Key_Left: -1, Qt.Key.Key_Down: -1, Qt.Key.Key_Right: 1, Qt.Key.Key_Up: 1}
FAR = {Qt.Key.Key_PageDown: -10, Qt.Key.Key_PageUp: 10, Qt.Key.Key_Home: -(10**6)}
FAR |= {Qt.Key.Key_End: 10**6}
LAYERS = {
    "points": mark("Points"),
    "curve": mark("Fitted curve"),
    "ellipse": mark("Ellipse"),
    "reference": mark("Undeformed contour"),
    "nominal": mark("Nominal size"),
    "dimensions": mark("Dimensions"),
    "curvature": mark("Curvature × radius (1 where round)"),
}
AT_FIRST = frozenset(LAYERS) - {"nominal"}


class SectionView(Chart):
    """The section of the selected profile; arrow keys step to its neighbours."""

    step_requested = Signal(int)
    """How many profiles further: -1 or 1, or many."""
    spot_hovered = Signal(object)
    """Chainage and clock (radians) of the point under the cursor, None for none."""
    choices_changed = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(tr(EMPTY), parent)
        self.state = SectionState()
        self._make_header()
        self.plot = self.add_plot(0, "mm")
        self.plot.setAspectLocked(True)
        self.curvature = self.add_plot(1, tr("curvature × r"))
        self.curvature.setToolTip(
            tr("Curvature of the fitted curve times the radius: 1 where the section is round")
        )
        self.curvature.getAxis("bottom").setTicks([HOURS])
        self.curvature.setLimits(xMin=-20, xMax=380)
        self.canvas.ci.layout.setRowStretchFactor(0, 3)
        self.canvas.ci.layout.setRowStretchFactor(1, 1)
        self.dimensions = QLabel(wordWrap=True)
        self.dimensions.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self.canvas.parentWidget().layout().insertWidget(2, self.dimensions)
        self.on_hover(self._hover)
        self.canvas.sigDeviceRangeChanged.connect(self._refit)
        self.setAccessibleName(tr("Section"))

    def _make_header(self) -> None:
        self.title = QLabel()
        self.back = self.tool_button(tr("Previous profile (←)"), "chevron-left")
        self.ahead = self.tool_button(tr("Next profile (→)"), "chevron-right")
        for button, step in ((self.back, -1), (self.ahead, 1)):
            button.setFocusPolicy(Qt.FocusPolicy.NoFocus)
            button.clicked.connect(lambda _=False, step=step: self.step_requested.emit(step))
        self.factor = QSlider(Qt.Orientation.Horizontal)
        self.factor.setRange(1, MAX_FACTOR)
        self.factor.setMaximumWidth(96)
        self.factor.setAccessibleName(tr("Exaggeration"))
        self.factor.setToolTip(tr("Draws deviations from the undeformed contour larger"))
        self.factor.setFocusPolicy(Qt.FocusPolicy.TabFocus)
        self.factor.valueChanged.connect(self._change)
        self.factor_text = QLabel("1×")
        self.factor_text.setMinimumWidth(self.fontMetrics().horizontalAdvance("20×"))
        self.layer_menu = SeriesMenu(LAYERS, AT_FIRST, parent=self)
        self.layer_menu.changed.connect(self._change)
        self.layer_button = self.tool_button(tr("What is drawn"), "tune-variant")
        self.layer_button.setMenu(self.layer_menu)
        self.layer_button.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
        title: tuple[QWidget, ...] = (self.back, self.title, self.ahead)
        for widget in title:
            self.header.addWidget(widget)
        self.header.addStretch(1)
        for widget in (self.factor, self.factor_text, self.layer_button, self.menu_button):
            self.header.addWidget(widget)

    def apply(self, state: SectionState) -> None:
        """Show `state`."""
        if not self.is_new_theme() and state == self.state:
            return
        before, self.state = self.state, state
        self.show_filled(state.profile is not None)
        if state.profile is None or state.section is None:
            for plot in self.plots():
                plot.clear()
            return
        index, chainage = int(state.profile.profile_index[0]), float(state.profile.chainage[0])
        self.title.setText(
            tr("Profile {index} · {chainage:.3f} m").format(index=index, chainage=chainage)
        )
        self.title.setToolTip(
            tr("{n} of {total} · {stack}").format(
                n=state.position, total=state.count, stack=state.stack_name
            )
        )
        self.back.setEnabled(state.position > 1)
        self.ahead.setEnabled(state.position < state.count)
        self.dimensions.setText(section_text(state.section))
        self._draw()
        if state.element is not before.element or before.profile is None:
            self.fit()

    def _redraw(self) -> None:
        self._draw()
        self.fit()

    def _change(self) -> None:
        self._redraw()
        self.choices_changed.emit()

    def _shows(self, layer: str) -> bool:
        return self.layer_menu.shows(layer)

    # Kept from one session to the next

    def choices(self) -> dict[str, Any]:
        """Return what is drawn, and how much deviations are enlarged."""
        return {"shown": self.layer_menu.shown, "exaggeration": self.factor.value()}

    def choose(self, choices: Mapping[str, Any]) -> None:
        """Draw as it was."""
        self.layer_menu.choose(choices.get("shown"))
        if isinstance(factor := choices.get("exaggeration"), int):
            self.factor.setValue(factor)

    # Drawing

    def _draw(self) -> None:
        section, factor = self.state.section, self.factor.value()
        self.factor_text.setText(f"{factor}×")
        for plot in self.plots():
            plot.clear()
        self.readout.clear()
        if section is None:
            return
        muted, reference = theme.colour("muted"), section.reference
        if self._shows("reference"):
            dashed = pg.mkPen(muted, width=1.5, style=Qt.PenStyle.DashLine)
            self.plot.plot(*(MM * ellipse_points(reference)).T, pen=dashed, antialias=True)
        if self._shows("nominal") and section.nominal is not None:
            dotted = pg.mkPen(theme.colour("text"), width=1.2, style=Qt.PenStyle.DotLine)
            self._draw_contour(section.nominal, dotted, factor)
        self._draw_clock(reference)
        is_drawable = factor == 1 or _is_around(section.fitted, reference)
        if self._shows("ellipse") and is_drawable and section.is_radius_measurable:
            pen = pg.mkPen(faint(_points_colour(), 0.9), width=1)
            self._draw_contour(section.fitted, pen, factor)
        if self._shows("points"):
            points = section.points_uv[:: max(1, -(-len(section.points_uv) // MAX_POINTS))]
            drawn = MM * exaggerate(points, reference, factor)
            self.plot.addItem(
                pg.ScatterPlotItem(
                    *drawn.T,
                    size=5,
                    brush=faint(_points_colour(), 0.8),
                    pen=pg.mkPen(None),
                    antialias=True,
                )
            )
        if self._shows("curve"):
            pen = pg.mkPen(theme.colour("accent"), width=2)
            for piece in section.curve_pieces():
                curve = MM * exaggerate(piece, reference, factor)
                self.plot.plot(*curve.T, pen=pen, antialias=True)
        if self._shows("dimensions"):
            self._draw_dimensions(section, factor)
        self._draw_curvature(section)

    def _draw_contour(self, ellipse: SectionEllipse, pen: object, factor: int) -> None:
        assert self.state.section is not None
        shown = ellipse_points(ellipse)
        if np.isfinite(shown).all():
            drawn = MM * exaggerate(shown, self.state.section.reference, factor)
            self.plot.plot(*drawn.T, pen=pen, antialias=True)

    def _draw_clock(self, reference: SectionEllipse) -> None:
        u, v = MM * np.asarray(reference.centre_uv)
        radius = MM * reference.semi_major
        muted = theme.colour("muted")
        for text, right, up in CLOCK:
            ends = np.array([[u, v]]) + np.outer((0.94, 1.06), (right, up)) * radius
            self.plot.plot(*ends.T, pen=pg.mkPen(muted, width=1.5))
            label = pg.TextItem(text, color=muted, anchor=(0.5, 0.5))
            label.setPos(u + 1.2 * radius * right, v + 1.2 * radius * up)
            self.plot.addItem(label)
        cross = pg.ScatterPlotItem([u], [v], symbol="+", size=11, pen=muted, brush=muted)
        self.plot.addItem(cross)

    def _draw_dimensions(self, section: Section, factor: int) -> None:
        text_colour = theme.colour("text")
        for number, dimension in enumerate(measure_dimensions(section)):
            ends = exaggerate(dimension.ends_uv, section.reference, factor)
            is_depth = not dimension.is_diameter
            pen = pg.mkPen(text_colour, width=2 if is_depth else 1)
            self.plot.plot(*(MM * ends).T, pen=pen, symbol="+", symbolSize=7, symbolPen=pen)
            if not is_depth and self.canvas.height() < ROOM_FOR_BOTH:
                continue  # they would lie on each other; the line below the plot has them
            # Labels of crossing diameters stand off the centre, towards different ends.
            share = 0.0 if is_depth else 0.28 + 0.44 * (number % 2)
            anchor = _outward_anchor(ends[0], section.reference) if is_depth else (0.5, 0.5)
            text = value_text(dimension) if is_depth else dimension_text(dimension)
            label = pg.TextItem(text, color=text_colour, anchor=anchor)
            label.fill = pg.mkBrush(faint(theme.colour("window"), 0.75))
            label.setPos(*(MM * (ends[0] + share * (ends[1] - ends[0]))))
            self.plot.addItem(label)

    def _give_room(self) -> bool:
        """Show the curvature where it is wanted and leaves room for the section."""
        section = self.state.section
        is_wanted = self._shows("curvature") and section is not None and section.curve is not None
        is_shown = is_wanted and self.canvas.height() >= ROOM_FOR_BOTH
        # What is merely hidden keeps its room.
        layout = self.canvas.ci
        if is_shown and not self._has_curvature():
            layout.addItem(self.curvature, 1, 0)
        elif not is_shown and self._has_curvature():
            layout.removeItem(self.curvature)
        layout.layout.setRowStretchFactor(1, 1 if is_shown else 0)
        layout.layout.invalidate()
        layout.layout.activate()
        return is_shown

    def _has_curvature(self) -> bool:
        return self.canvas.ci.getItem(1, 0) is not None

    def _refit(self) -> None:
        """Leave the curvature out of a small panel."""
        if self.state.section is not None and self._has_curvature() != self._give_room():
            self._redraw()

    def _draw_curvature(self, section: Section) -> None:
        """Curvature times radius against the clock: 1 on a circle."""
        if not self._give_room() or section.curve is None:
            return
        round_line = pg.mkPen(theme.colour("muted"), width=1.5, style=Qt.PenStyle.DashLine)
        self.curvature.addItem(pg.InfiniteLine(1.0, angle=0, pen=round_line))
        radius, accent = section.reference.semi_minor, theme.colour("accent")
        lowest, highest = 0.5, 1.5
        for clocks in section.curve.clocks():
            value = radius * section.curve.curvature_at(clocks)
            sd = radius * section.curve.curvature_sd_at(clocks)
            degrees = np.rad2deg(clocks)
            turns = (0, -360) if degrees[-1] > 360 else (0,)
            for turn in turns:
                edges = [
                    pg.PlotDataItem(degrees + turn, value + side * sd, pen=pg.mkPen(None))
                    for side in (-1, 1)
                ]
                for edge in edges:
                    self.curvature.addItem(edge)
                self.curvature.addItem(pg.FillBetweenItem(*edges, brush=faint(accent, 0.2)))
                self.curvature.plot(
                    degrees + turn, value, pen=pg.mkPen(accent, width=1.5), antialias=True
                )
            is_known = sd < 0.5
            lowest = min(lowest, float(value[is_known].min(initial=lowest)))
            highest = max(highest, float(value[is_known].max(initial=highest)))
        self.curvature.setYRange(lowest, highest, padding=0.08)

    def fit(self) -> None:
        """Show the whole section."""
        section = self.state.section
        if section is not None:
            reference = section.reference
            (u, v), reach = MM * np.asarray(reference.centre_uv), 1.35 * MM * reference.semi_major
            if len(section.points_uv):
                drawn = exaggerate(section.points_uv, reference, self.factor.value())
                away = np.linalg.norm(drawn - reference.centre_uv, axis=1)
                reach = max(reach, 1.05 * MM * float(np.percentile(away, 99)))
            self.plot.setRange(xRange=(u - reach, u + reach), yRange=(v - reach, v + reach))
            self.curvature.setXRange(0, 360, padding=0.05)

    # Copying

    def heading(self) -> str:
        """Return the section's name and dimensions."""
        element = self.state.element
        name = "" if element is None else label_of(element)
        return f"<b>{name}</b> · {self.title.text()}<br>{self.dimensions.text()}"

    def numbers(self) -> Table:
        """Return the points with their distance from the undeformed contour and the curve there."""
        section = self.state.section
        if section is None:
            return {}
        points, reference = section.points_uv, section.reference
        clocks = reference.clock(points)
        curve, curvature = np.full(len(points), np.nan), np.full(len(points), np.nan)
        if section.curve is not None:
            curve = MM * section.curve.radius_at(clocks)
            curvature = section.curve.curvature_at(clocks)
        relative = MM * (points - np.asarray(reference.centre_uv))
        columns: dict[str, tuple[Array, int]] = {
            "right_mm": (relative[:, 0], 3),
            "up_mm": (relative[:, 1], 3),
            "clock_deg": (np.rad2deg(clocks), 2),
            "deviation_mm": (MM * reference.deviation(points), 3),
            "curve_radius_mm": (curve, 3),
            "curvature_per_m": (curvature, 3),
        }
        order = np.argsort(clocks, kind="stable")
        return {
            title: [cell(float(v), decimals) for v in values[order]]
            for title, (values, decimals) in columns.items()
        }

    # Mouse and keys

    def keyPressEvent(self, event: QKeyEvent) -> None:  # noqa: N802
        """Step with the arrow keys, far with Page Up and Down, to the ends with Home and End."""
        step = (STEPS | FAR).get(Qt.Key(event.key()))
        if step is None or self.state.profile is None or event.modifiers() & _MODIFIERS:
            super().keyPressEvent(event)
            return
        self.step_requested.emit(step)

    def _hover(self, plot: pg.PlotItem | None, position: QPointF) -> None:
        point = self._point_at(position) if plot is self.plot else None
        self.readout.setText("" if point is None else self._text_of(point))
        self.spot_hovered.emit(None if point is None else self._spot_of(point))

    def _point_at(self, position: QPointF) -> Array | None:
        """Place in the plane of the point that is drawn near `position`, shape (1, 2), metres."""
        section = self.state.section
        if section is None or not len(section.points_uv):
            return None
        at = self.plot.vb.mapSceneToView(position)
        drawn = MM * exaggerate(section.points_uv, section.reference, self.factor.value())
        away = np.hypot(*(drawn - (at.x(), at.y())).T) / self.plot.vb.viewPixelSize()[0]
        nearest = int(np.argmin(away))
        return None if away[nearest] > HOVER_PX else section.points_uv[nearest : nearest + 1]

    def _spot_of(self, point: Array) -> tuple[float, float] | None:
        """Return chainage and clock of a point, if the section is square to the axis."""
        profile, section = self.state.profile, self.state.section
        if profile is None or section is None or int(profile.stack_id[0]) != OWN_STACK:
            return None
        return float(profile.chainage[0]), float(section.reference.clock(point)[0])

    def _text_of(self, point: Array) -> str:
        assert self.state.section is not None
        value = MM * float(self.state.section.reference.deviation(point)[0])
        side = tr("outward") if value > 0 else tr("inward")
        return tr("{value} {side} of the undeformed contour").format(
            value=format_measure(abs(value), unit="mm"), side=side
        )


_MODIFIERS = Qt.KeyboardModifier.ControlModifier | Qt.KeyboardModifier.AltModifier


def _points_colour() -> QColor:
    return QColor(*QUALITATIVE[0].tolist())


def _is_around(ellipse: SectionEllipse, reference: SectionEllipse) -> bool:
    """Return whether the reference's centre lies well inside an ellipse: else no rays meet it."""
    offset = np.subtract(ellipse.centre_uv, reference.centre_uv)
    return bool(np.linalg.norm(offset) < 0.5 * ellipse.semi_minor)


def _outward_anchor(place: Array, reference: SectionEllipse) -> tuple[float, float]:
    """Return the anchor of a label that stands outside of a place on the contour."""
    u, v = place - np.asarray(reference.centre_uv)
    reach = max(abs(u), abs(v), 1e-9)
    return 0.5 - 0.62 * u / reach, 0.5 + 0.9 * v / reach
