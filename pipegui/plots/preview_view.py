"""One profile as it would be cut: its points by curve, and the ellipses found in it."""

from typing import TYPE_CHECKING

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QPointF, QSignalBlocker, Qt, Signal
from PySide6.QtGui import QColor, QHideEvent, QKeyEvent, QShowEvent
from PySide6.QtWidgets import QComboBox, QLabel, QSlider, QWidget

from pipecore.formatting import cell
from pipecore.geometry import Array
from pipecore.inspection.section import SectionEllipse
from pipegui.i18n.texts import count, mark, tr
from pipegui.plots.chart import Chart, faint
from pipegui.plots.exaggeration import ellipse_points
from pipegui.plots.export import Table
from pipegui.plots.section_view import FAR, STEPS
from pipegui.states.preview_state import PreviewState
from pipegui.style import theme
from pipegui.style.colour_maps import QUALITATIVE

if TYPE_CHECKING:
    from pipecore.preview import ProfilePreview

EMPTY = mark(
    "Open a scan to see one of its profiles with its curves before you detect. "
    "Change width, gap and method in the stacks panel and watch what they do."
)
POINT_PX = 3.5
MAX_POINTS = 60_000
LEVEL = 0.1
"""A plane is level if it is less steep than this."""
N_NAMED = 5
"""Radii that are named below the plot; the rest is counted."""


class PreviewView(Chart):
    """A profile of a planned stack; arrow keys step to its neighbours."""

    chosen = Signal(int, object)
    """Row of a stack in the plan, and a profile's index or None."""
    step_requested = Signal(int)
    seen = Signal(bool)
    """Whether it is seen: what nobody sees need not be cut."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(tr(EMPTY), parent)
        self.state = PreviewState()
        self._fitted: object = None
        self.stacks = QComboBox()
        self.stacks.setMinimumContentsLength(10)
        self.stacks.setAccessibleName(tr("Stack of the preview"))
        self.stacks.setToolTip(tr("The stack of which a profile is shown"))
        self.stacks.activated.connect(lambda row: self.chosen.emit(row, None))
        self.back = self.tool_button(tr("Previous profile (←)"), "chevron-left")
        self.ahead = self.tool_button(tr("Next profile (→)"), "chevron-right")
        for button, step in ((self.back, -1), (self.ahead, 1)):
            button.setFocusPolicy(Qt.FocusPolicy.NoFocus)
            button.clicked.connect(lambda _=False, step=step: self.step_requested.emit(step))
        self.place = QSlider(Qt.Orientation.Horizontal)
        self.place.setAccessibleName(tr("Profile"))
        self.place.setToolTip(tr("Which profile of the stack"))
        self.place.setTracking(True)
        self.place.valueChanged.connect(self._slide)
        self.number = QLabel()
        self.number.setProperty("muted", True)
        for widget in (self.stacks, self.back, self.place, self.ahead):
            self.header.addWidget(widget, 1 if widget is self.place else 0)
        self.header.addWidget(self.number)
        self.header.addWidget(self.menu_button)
        self.plot = self.add_plot(0, "m")
        self.plot.setAspectLocked(True)
        self.summary = QLabel(wordWrap=True)
        self.canvas.parentWidget().layout().insertWidget(2, self.summary)
        self.on_hover(self._hover)
        self.setAccessibleName(tr("Preview"))

    def apply(self, state: PreviewState) -> None:
        """Show `state`."""
        self.is_new_theme()
        before, self.state = self.state, state
        self.empty.setText(state.message or tr(EMPTY))
        self.show_filled(state.plan is not None and bool(state.plan.stacks))
        if state.plan is None or not state.plan.stacks:
            self.plot.clear()
            return
        planned = state.plan.stacks[state.row]
        if state.plan is not before.plan:
            self.stacks.clear()
            for one in state.plan.stacks:
                self.stacks.addItem(one.stack.name)
        self.stacks.setCurrentIndex(state.row)
        with QSignalBlocker(self.place):
            self.place.setRange(planned.first, planned.last)
            self.place.setValue(state.index)
        self.number.setText(
            tr("{n} of {total}").format(n=state.index - planned.first + 1, total=planned.n_profiles)
        )
        self.back.setEnabled(state.index > planned.first)
        self.ahead.setEnabled(state.index < planned.last)
        if state.preview is None:
            self.summary.setText(tr("Cutting …"))
            return
        self.summary.setText(summary_of(state.preview))
        self._draw(state.preview)
        # Another profile of the same stack is seen from the same place.
        shown = state.plan, state.row
        if shown != self._fitted:
            self._fitted = shown
            self.fit()

    def _draw(self, preview: "ProfilePreview") -> None:
        self.plot.clear()
        self.readout.clear()
        shown = slice(None, None, max(1, -(-len(preview.uv) // MAX_POINTS)))
        uv, curve = preview.uv[shown] @ upright(preview).T, preview.curve[shown]
        for colour, rows in _by_colour(curve):
            self.plot.addItem(
                pg.ScatterPlotItem(
                    *uv[rows].T, size=POINT_PX, brush=colour, pen=pg.mkPen(None), antialias=True
                )
            )
        pen = pg.mkPen(theme.colour("accent"), width=1.5)
        for row in range(len(preview.ellipses)):
            self.plot.plot(*self._ellipse(preview, row).T, pen=pen, antialias=True)

    def _ellipse(self, preview: "ProfilePreview", row: int) -> Array:
        centre, major, minor, angle = preview.ellipse_uv(row)
        place = float(centre[0]), float(centre[1])
        return ellipse_points(SectionEllipse(place, major, minor, angle)) @ upright(preview).T

    def fit(self) -> None:
        """Show all points."""
        preview = self.state.preview
        if preview is None or not len(preview.uv):
            return
        low, high = np.percentile(preview.uv @ upright(preview).T, [1, 99], axis=0)
        margin = 0.08 * max(float((high - low).max()), 0.1)
        self.plot.setRange(
            xRange=(low[0] - margin, high[0] + margin), yRange=(low[1] - margin, high[1] + margin)
        )

    # Copying

    def heading(self) -> str:
        """Which profile it is."""
        text = tr("<b>{stack}</b> · profile {number}").format(
            stack=self.stacks.currentText(), number=self.number.text()
        )
        return f"{text}<br>{self.summary.text()}"

    def numbers(self) -> Table:
        """Return the points with the number of their curve, empty for points of none."""
        preview = self.state.preview
        if preview is None:
            return {}
        uv = preview.uv @ upright(preview).T
        return {
            "right_m": [cell(float(v), 4) for v in uv[:, 0]],
            "up_m": [cell(float(v), 4) for v in uv[:, 1]],
            "curve": [str(c + 1) if c >= 0 else "" for c in preview.curve],
        }

    # Mouse, keys and sight

    def _slide(self, index: int) -> None:
        self.chosen.emit(self.state.row, index)

    def keyPressEvent(self, event: QKeyEvent) -> None:  # noqa: N802
        """Step with the arrow keys, far with Page Up and Down, to the ends with Home and End."""
        step = (STEPS | FAR).get(Qt.Key(event.key()))
        if step is None or self.state.plan is None:
            super().keyPressEvent(event)
            return
        self.step_requested.emit(step)

    def showEvent(self, event: QShowEvent) -> None:  # noqa: N802
        """Signal that the preview is seen."""
        super().showEvent(event)
        self.seen.emit(True)

    def hideEvent(self, event: QHideEvent) -> None:  # noqa: N802
        """Signal that the preview is hidden."""
        super().hideEvent(event)
        self.seen.emit(False)

    def _hover(self, plot: pg.PlotItem | None, position: QPointF) -> None:
        preview = self.state.preview
        if plot is None or preview is None or not len(preview.ellipses):
            self.readout.clear()
            return
        at = plot.vb.mapSceneToView(position)
        for row in range(len(preview.ellipses)):
            centre, major, _, _ = preview.ellipse_uv(row)
            centre = upright(preview) @ centre
            if np.hypot(at.x() - centre[0], at.y() - centre[1]) < 1.1 * major:
                radius = 1000 * float(preview.ellipses.radius[row])
                arc = np.rad2deg(float(preview.ellipses.arc[row]))
                self.readout.setText(
                    tr("radius {radius:.1f} mm · arc seen {arc:.0f}°").format(
                        radius=radius, arc=arc
                    )
                )
                return
        self.readout.clear()


def upright(preview: "ProfilePreview") -> Array:
    """Turn the plane's axes so that up is up, or north where the plane is level."""
    up = preview.frame[:2] @ np.array([0.0, 0.0, 1.0])
    if np.linalg.norm(up) < LEVEL:
        up = preview.frame[:2] @ np.array([0.0, 1.0, 0.0])
    x, y = up / np.linalg.norm(up)
    return np.array([[y, -x], [x, y]])


def summary_of(preview: "ProfilePreview") -> str:
    """Say what was found in a profile."""
    if not preview.n_points:
        return tr("This profile holds no points.")
    parts = [
        count("{n:,} point", "{n:,} points", preview.n_points),
        count("{n:,} curve", "{n:,} curves", preview.n_curves),
        count("{n:,} ellipse", "{n:,} ellipses", len(preview.ellipses)),
    ]
    radii = np.sort(1000 * preview.ellipses.radius)[::-1]
    named = ", ".join(f"{r:.0f}" for r in radii[:N_NAMED])
    if len(radii):
        parts.append(
            tr("radius {radii} mm").format(radii=named + (" …" if len(radii) > N_NAMED else ""))
        )
    loose = float(np.mean(preview.curve < 0)) if len(preview.curve) else 0.0
    if loose >= 0.005:
        parts.append(tr("{loose:.0f} % of the points in no curve (grey)").format(loose=100 * loose))
    return " · ".join(parts)


def _by_colour(curve: np.ndarray) -> list[tuple[QColor, np.ndarray]]:
    """Return the rows of the points by the colour of their curve; those of none first, in grey."""
    groups = [(faint(theme.colour("muted"), 0.6), np.flatnonzero(curve < 0))]
    for number, rgb in enumerate(QUALITATIVE):
        rows = np.flatnonzero((curve >= 0) & (curve % len(QUALITATIVE) == number))
        groups.append((QColor(*rgb.tolist()), rows))
    return [(colour, rows) for colour, rows in groups if len(rows)]
