"""One profile: its points, its ellipse and the undeformed contour, in millimetres."""

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QPointF, Qt, Signal
from PySide6.QtGui import QColor, QKeyEvent
from PySide6.QtWidgets import QLabel, QSlider, QToolButton, QWidget

from pipecore.report.format import NOT_MEASURABLE, format_measure
from pipecore.types import Profiles
from pipegui import theme
from pipegui.colour_maps import QUALITATIVE
from pipegui.plots.chart import Chart, faint
from pipegui.plots.exaggeration import deviations, ellipse_points, exaggerate
from pipegui.view_state import SectionState

EMPTY = "Select a profile to see its section: click a point of the radius plot or of the map."
MAX_FACTOR = 20
MAX_POINTS = 20_000
HOVER_PX = 15
CLOCK = (("12", 0, 1), ("3", 1, 0), ("6", 0, -1), ("9", -1, 0))
STEPS = {Qt.Key.Key_Left: -1, Qt.Key.Key_Down: -1, Qt.Key.Key_Right: 1, Qt.Key.Key_Up: 1}


class SectionView(Chart):
    """The section of the selected profile; arrow keys step to its neighbours."""

    step_requested = Signal(int)
    """How many profiles further: -1 or 1."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(EMPTY, parent)
        self._state = SectionState()
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.title = QLabel()
        self.back, self.ahead = QToolButton(), QToolButton()
        for button, step, tip in (
            (self.back, -1, "Previous profile (←)"),
            (self.ahead, 1, "Next profile (→)"),
        ):
            button.setAutoRaise(True)
            button.setToolTip(tip)
            button.setFocusPolicy(Qt.FocusPolicy.NoFocus)
            button.clicked.connect(lambda _=False, step=step: self.step_requested.emit(step))
        self.factor = QSlider(Qt.Orientation.Horizontal, minimum=1, maximum=MAX_FACTOR)
        self.factor.setMaximumWidth(120)
        self.factor.setToolTip("Draws deviations from the undeformed contour larger.")
        self.factor.setFocusPolicy(Qt.FocusPolicy.TabFocus)
        self.factor.valueChanged.connect(self._exaggerate)
        self.factor_text = QLabel("1×")
        self.factor_text.setMinimumWidth(self.fontMetrics().horizontalAdvance("20×"))
        for widget in (self.back, self.title, self.ahead):
            self.header.addWidget(widget)
        self.header.addStretch(1)
        self.header.addWidget(self.factor)
        self.header.addWidget(self.factor_text)
        self.plot = self.add_plot(0, "mm", "mm")
        self.plot.setAspectLocked(True)
        self.dimensions = QLabel(wordWrap=True)
        self.canvas.parentWidget().layout().insertWidget(2, self.dimensions)
        self.on_hover(self._hover)
        self.on_click(lambda *_: self.setFocus())
        self.setAccessibleName("Section")

    def apply(self, state: SectionState) -> None:
        """Show `state`."""
        if self.is_new_theme():
            self.back.setIcon(theme.icon("chevron-left"))
            self.ahead.setIcon(theme.icon("chevron-right"))
        elif state == self._state:
            return
        before, self._state = self._state, state
        self.show_filled(state.profile is not None)
        if state.profile is None:
            self.plot.clear()
            return
        index, chainage = int(state.profile.profile_index[0]), float(state.profile.chainage[0])
        self.title.setText(f"Profile {index} · {chainage:.3f} m")
        self.title.setToolTip(f"{state.position} of {state.count} · {state.stack_name}")
        self.back.setEnabled(state.position > 1)
        self.ahead.setEnabled(state.position < state.count)
        self.dimensions.setText(dimensions_text(state.profile))
        self._draw()
        if state.element is not before.element or before.profile is None:
            self._fit()

    # Drawing

    def _exaggerate(self) -> None:
        self._draw()
        self._fit()

    def _draw(self) -> None:
        state, factor = self._state, self.factor.value()
        self.factor_text.setText(f"{factor}×")
        self.plot.clear()
        self.readout.clear()
        reference, fitted = state.reference, state.fitted
        if reference is None or fitted is None:
            return
        muted = theme.colour("muted")
        data = QColor(*QUALITATIVE[0].tolist())
        contour = ellipse_points(reference)
        dashed = pg.mkPen(muted, width=1.5, style=Qt.PenStyle.DashLine)
        self.plot.plot(*contour.T, pen=dashed, antialias=True)
        self._draw_clock()
        shown = ellipse_points(fitted)
        if np.isfinite(shown).all():
            curve = exaggerate(shown, reference, factor)
            self.plot.plot(*curve.T, pen=pg.mkPen(theme.colour("accent"), width=2), antialias=True)
        points = state.points_uv[:: max(1, -(-len(state.points_uv) // MAX_POINTS))]
        if len(points):
            self.plot.addItem(
                pg.ScatterPlotItem(
                    *exaggerate(points, reference, factor).T,
                    size=5,
                    brush=faint(data, 0.8),
                    pen=pg.mkPen(None),
                    antialias=True,
                )
            )

    def _draw_clock(self) -> None:
        reference = self._state.reference
        u, v = reference.centre_uv
        radius = reference.semi_major_mm
        muted = theme.colour("muted")
        for text, right, up in CLOCK:
            ends = np.array([[u, v]]) + np.outer((0.94, 1.06), (right, up)) * radius
            self.plot.plot(*ends.T, pen=pg.mkPen(muted, width=1.5))
            label = pg.TextItem(text, color=muted, anchor=(0.5, 0.5))
            label.setPos(u + 1.2 * radius * right, v + 1.2 * radius * up)
            self.plot.addItem(label)
        cross = pg.ScatterPlotItem([u], [v], symbol="+", size=11, pen=muted, brush=muted)
        self.plot.addItem(cross)

    def _fit(self) -> None:
        reference = self._state.reference
        if reference is not None:
            (u, v), reach = reference.centre_uv, 1.35 * reference.semi_major_mm
            if len(self._state.points_uv):
                drawn = exaggerate(self._state.points_uv, reference, self.factor.value())
                away = np.linalg.norm(drawn - reference.centre_uv, axis=1)
                reach = max(reach, 1.05 * float(np.percentile(away, 99)))
            self.plot.setRange(xRange=(u - reach, u + reach), yRange=(v - reach, v + reach))

    # Mouse and keys

    def keyPressEvent(self, event: QKeyEvent) -> None:  # noqa: N802
        """Step with the arrow keys."""
        step = STEPS.get(Qt.Key(event.key()))
        if step is None or self._state.profile is None:
            super().keyPressEvent(event)
            return
        self.step_requested.emit(step)

    def _hover(self, plot: pg.PlotItem | None, position: QPointF) -> None:
        self.readout.setText(self._text_at(position) if plot is not None else "")

    def _text_at(self, position: QPointF) -> str:
        reference, points = self._state.reference, self._state.points_uv
        if reference is None or not len(points):
            return ""
        at = self.plot.vb.mapSceneToView(position)
        drawn = exaggerate(points, reference, self.factor.value())
        away = np.hypot(*(drawn - (at.x(), at.y())).T) / self.plot.vb.viewPixelSize()[0]
        nearest = int(np.argmin(away))
        if away[nearest] > HOVER_PX:
            return ""
        value = float(deviations(points[nearest : nearest + 1], reference)[0])
        side = "outward" if value > 0 else "inward"
        return f"{format_measure(abs(value), unit='mm')} {side} of the undeformed contour"


def dimensions_text(profile: Profiles) -> str:
    """Return what is measured of the section, as far as the scan carries it."""
    radius = format_measure(1000 * profile.radius[0], 1000 * profile.radius_sd[0], "mm")
    arc = f"arc seen {np.rad2deg(profile.arc[0]):.0f}°"
    ovality = float(profile.ovality[0])
    if not np.isfinite(ovality):
        return f"Radius {radius} · {arc} · diameters {NOT_MEASURABLE}: too little arc"
    half = ovality * float(profile.radius[0])
    widest, narrowest = (
        format_measure(1000 * (2 * profile.radius[0] + side * half), unit="mm") for side in (1, -1)
    )
    return (
        f"Radius {radius} · {arc} · Dmax {widest} · Dmin {narrowest}"
        f" · ovality {format_measure(100 * ovality, unit='%')}"
    )
