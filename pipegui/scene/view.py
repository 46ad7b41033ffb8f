"""The 3D view: takes a `SceneState`, shows it, and says what the user points at."""

import threading
from collections.abc import Callable, Mapping

import numpy as np
from PySide6.QtCore import QPointF, Qt, QTimer, Signal
from PySide6.QtGui import QCloseEvent, QColor, QImage, QResizeEvent
from PySide6.QtWidgets import QVBoxLayout, QWidget

from pipecore.geometry import Array
from pipecore.types import NO_ID, PointCloud, Profiles
from pipegui.i18n.texts import mark, tr
from pipegui.model.document import Background, ClipBox, ColourBy, Measurement, Tool, ViewOptions
from pipegui.scene import clipping, shapes
from pipegui.scene import pose as poses
from pipegui.scene.aiming import aim
from pipegui.scene.canvas import Canvas
from pipegui.scene.clipping import BoxFrame
from pipegui.scene.decorations import Decorations
from pipegui.scene.layers import Layers
from pipegui.scene.legend import make_legend
from pipegui.scene.measure_marks import MeasureMark, lines_of
from pipegui.scene.overlay import SceneOverlay, label_of
from pipegui.scene.partial_cloud import PartialCloud
from pipegui.scene.picking import warm_up
from pipegui.scene.point_layer import PointLayer
from pipegui.scene.pose import Pose
from pipegui.scene.station_marks import marks_of
from pipegui.states.view_state import SceneState
from pipegui.style import theme

BACKGROUND = {
    Background.LIGHT: ("#eef1f4", "#fbfcfd"),
    Background.DARK: ("#15181b", "#262b31"),
    Background.WHITE: ("#ffffff", "#ffffff"),
    Background.BLACK: ("#000000", "#000000"),
}
"""Bottom and top."""
HINTS = {
    Tool.SELECT: ("", ""),
    Tool.MEASURE: (
        mark("Click the first point · Esc ends"),
        mark("Click the second point · Esc ends"),
    ),
    Tool.COORDINATES: (mark("Click a point: its coordinates are copied · Esc ends"), ""),
}
"""Before and after the first of two points."""
IS_DARK = {Background.DARK, Background.BLACK}
HOVER_MS = 60
FRAME_PX = 1.5
"""Width of the clip box's edges."""


class SceneView(QWidget):
    """Shows one scan with its result."""

    picked = Signal(int)
    """Index of the clicked point in the cloud, -1 for none."""
    hovered = Signal(int)
    """Index of the point under the resting cursor, -1 for none."""
    deformation_picked = Signal(int)
    """Id of the deformation whose label was clicked."""

    station_hovered = Signal(int)
    """Id of the station under the resting cursor."""

    measurement_closed = Signal(int)
    """Number of the measurement whose cross was clicked."""

    clip_dragged = Signal(object)
    """The `ClipBox` after a handle was dragged."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._state = SceneState()
        self._background: Background | None = None
        self._is_picking = False
        self._hovered = -1
        self.canvas = Canvas(self)
        self.overlay = SceneOverlay(self.canvas)
        self.layers = Layers(self.canvas, self)
        self._decorations = Decorations(self.canvas.layers)
        self._frame = BoxFrame(self.canvas.layers[1])
        self.partial_cloud = PartialCloud(self.canvas.layers[0])
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.addWidget(self.canvas)
        self._hover_at: QPointF | None = None
        self._hover_timer = QTimer(self, singleShot=True, interval=HOVER_MS)
        self._hover_timer.timeout.connect(self._hover)
        self.canvas.point_under = self._point_under
        self.canvas.grab = self._grab
        self.canvas.clicked.connect(self._click)
        self.canvas.hovered.connect(self._wait_for_hover)
        self.canvas.left.connect(self._stop_hovering)
        self.canvas.before_frame.connect(self._prepare_frame)
        self.setAccessibleName(tr("3D view"))
        self._warming = threading.Thread(target=warm_up, name="warm up picking", daemon=True)
        self._warming.start()

    @property
    def points(self) -> PointLayer:
        """The points of the whole cloud."""
        return self.layers.whole

    # States

    def apply(self, state: SceneState) -> None:
        """Show `state`; only what differs from the last one is done anew."""
        before, self._state = self._state, state
        background = _background(state.view)
        is_new_theme = background != self._background
        if is_new_theme:
            self._set_background(background)
        self.canvas.is_parallel = state.view.is_parallel
        self.canvas.eye_dome = state.view.eye_dome
        is_new_cloud = state.cloud is not before.cloud
        self.layers.dark = self._decorations.dark = self.overlay.dark = background in IS_DARK
        self.layers.update(state, before, everything=is_new_theme)
        self._decorations.update(state, before, everything=is_new_theme or is_new_cloud)
        self._show_box(state.view.clip_box)
        self._update_overlay(state)
        if is_new_cloud and state.scan_key != before.scan_key:
            self.canvas.fly_to(self._fitted(self.canvas.pose), fly=False)
        elif state.selection.lead != before.selection.lead:
            self._aim(state)
        self.canvas.draw()

    def _update_overlay(self, state: SceneState) -> None:
        self.overlay.legend, self.overlay.labels, self.overlay.stations = None, (), ()
        if state.cloud is not None:
            self.overlay.stations = marks_of(state.cloud, state.view)
            self.overlay.colours_stations = state.view.colour_by is ColourBy.STATION
        if state.cloud is not None and state.view.show_points:
            self.overlay.legend = make_legend(state.cloud, state.result, state.view)
        if state.result is not None and state.view.show_labels:
            self.overlay.labels = tuple(
                label_of(d, is_selected=d.deformation_id == state.selection.deformation_id)
                for d in state.result.deformations
                if d.element_id not in state.view.hidden_elements
                and clipping.is_shown(state.view.clip_box, d.peak)
            )
        is_selecting = state.view.tool is Tool.SELECT
        shape = Qt.CursorShape.ArrowCursor if is_selecting else Qt.CursorShape.CrossCursor
        self.canvas.setCursor(shape)
        self.overlay.hint = tr(HINTS[state.view.tool][state.view.measuring_from is not None])
        self._update_marks()

    def _update_marks(self) -> None:
        """Show the measurements, and the one being made up to the point under the cursor."""
        cloud, view = self._state.cloud, self._state.view
        self.overlay.marks = ()
        if cloud is None:
            return
        shown = list(enumerate(view.measurements))
        if view.measuring_from is not None:
            end = None
            if self._hovered >= 0:
                east, north, height = cloud.xyz[self._hovered].tolist()
                end = east, north, height
            shown.append((-1, Measurement(view.measuring_from, end)))
        self.overlay.marks = tuple(MeasureMark(i, m, lines_of(m, cloud)) for i, m in shown)
        self.overlay.update()

    def _set_background(self, background: Background) -> None:
        self._background = background
        bottom, top = (QColor(c) for c in BACKGROUND[background])
        back = self.canvas.layers[0]
        back.SetBackground(bottom.redF(), bottom.greenF(), bottom.blueF())
        back.SetBackground2(top.redF(), top.greenF(), top.blueF())
        back.GradientBackgroundOn()

    @property
    def shades_edges(self) -> bool:
        """Whether steps in depth are shaded where nobody has chosen."""
        return self.canvas.is_drawn and not self.canvas.is_software

    def show_partial_cloud(self, part: PointCloud) -> None:
        """Show a part of a scan that is still being read, and all before it."""
        if self._background is None:
            self._set_background(_background(self._state.view))
        self.partial_cloud.add(part, self.devicePixelRatioF())
        self.canvas.fly_to(self._framed(self.canvas.pose, self.partial_cloud.sample), fly=False)

    def hide_partial_cloud(self) -> None:
        """Take the parts away."""
        self.partial_cloud.clear()
        self.canvas.draw()

    # Camera

    def fit(self) -> None:
        """Fly to where everything is in view."""
        if len(self.points):
            self._fly(self._fitted(self.canvas.pose))

    def set_standard_view(self, name: str) -> None:
        """Fly to look at everything from a standard side, such as "top" or "iso"."""
        self._fly(self._fitted(poses.standard_view(self.canvas.pose, name)))

    def show_selection(self) -> None:
        """Move the camera to what is selected."""
        self._aim(self._state)

    def camera(self) -> dict[str, list[float]]:
        """Return where the camera is, to be saved in a file."""
        pose = self.canvas.pose
        return {
            "focus": pose.focus.tolist(),
            "look": [pose.distance, pose.heading, pose.elevation],
        }

    def set_camera(self, camera: Mapping[str, list[float]]) -> None:
        """Go where the camera was; stay if that is not known."""
        focus, look = np.array(camera.get("focus", ())), camera.get("look", ())
        if focus.shape == (3,) and len(look) == 3 and look[0] > 0:
            distance, heading, elevation = look
            self.canvas.fly_to(Pose(focus, distance, heading, elevation), fly=False)

    def mark_spot(self, spot: Array | None) -> None:
        """Show where another view's cursor is, in local coordinates; None for nowhere."""
        self.overlay.spot = spot
        self.overlay.update()

    def mark_profile(self, profile: Profiles | None) -> None:
        """Show which profile another view's cursor is at, a table of one row; None for none."""
        rings = list(shapes.ellipses(profile)) if profile is not None else []
        self.overlay.ring = rings[0] if rings else None
        self.overlay.update()

    def view_direction(self) -> Array:
        """Return the unit vector in which the camera looks."""
        return self.canvas.pose.forward

    def _fitted(self, pose: Pose) -> Pose:
        if not len(self.points):
            return pose
        return self._framed(pose, self.points.parts[0][:20_000].astype(np.float64))

    def _framed(self, pose: Pose, sample: Array) -> Pose:
        # A few stray points far away must not make the rest small.
        low, high = np.percentile(sample, [0.2, 99.8], axis=0)
        margin = 0.2 * (high - low)
        inside = np.all((sample >= low - margin) & (sample <= high + margin), axis=1)
        parallel = self._state.view.is_parallel
        return poses.framing(pose, sample[inside], self.canvas.aspect, parallel=parallel)

    def _fly(self, pose: Pose) -> None:
        self.canvas.fly_to(pose, fly=self._state.view.fly)

    def _aim(self, state: SceneState) -> None:
        pose = aim(state, self.canvas.pose, self.canvas.aspect, stay_if_seen=self._is_picking)
        if pose is not None:
            self._fly(pose)

    def _prepare_frame(self) -> None:
        canvas, projection = self.canvas, self.canvas.projection()
        self.layers.show(projection)
        self._decorations.prepare(
            moving=canvas.is_moving,
            point_px=self.layers.shown.point_px,
            scale=canvas.devicePixelRatioF(),
        )
        self.overlay.follow(projection, canvas.pose)

    # Clipping

    def _show_box(self, box: ClipBox | None) -> None:
        tint = theme.colour("accent", dark=self._background in IS_DARK)
        width = FRAME_PX * self.devicePixelRatioF()
        self._frame.show(box, (tint.redF(), tint.greenF(), tint.blueF()), width)
        self._decorations.clip(box)
        self.overlay.handles = None if box is None else clipping.handles(box)

    def _grab(self, position: QPointF) -> Callable[[QPointF, bool], None] | None:
        """Take hold of the box's handle under the cursor."""
        state = self._state
        box, start = state.view.clip_box, (position.x(), position.y())
        if box is None or state.cloud is None:
            return None
        projection = self.canvas.projection()
        handle = clipping.handle_at(box, projection, start)
        if handle < 0:
            return None
        self.layers.begin_preview(box)

        def drag(now: QPointF, is_over: bool) -> None:
            dragged = clipping.drag(box, handle, projection, start, (now.x(), now.y()))
            if is_over:
                self.layers.preview.clear_actors()
                self.clip_dragged.emit(dragged)
            else:
                self.layers.preview.clip(dragged)
                self._show_box(dragged)

        return drag

    # Mouse

    def pick(self, position: QPointF) -> int:
        """Return the index in the cloud of the point seen at `position`, -1 if there is none."""
        return self.layers.pick(position)

    def _point_under(self, position: QPointF) -> Array | None:
        index = self.layers.pick(position, quick=True)
        if index < 0 or self._state.cloud is None:
            return None
        return np.asarray(self._state.cloud.xyz[index], np.float64)

    def _click(self, position: QPointF) -> None:
        # What is clicked is in view: the camera stays unless it sees too little of it.
        self._is_picking = True
        try:
            closed = self.overlay.measurement_at(position)
            is_selecting = self._state.view.tool is Tool.SELECT
            deformation_id = self.overlay.deformation_at(position) if is_selecting else NO_ID
            if closed >= 0:
                self.measurement_closed.emit(closed)
            elif deformation_id != NO_ID:
                self.deformation_picked.emit(deformation_id)
            else:
                self.picked.emit(self.pick(position))
        finally:
            self._is_picking = False

    def _wait_for_hover(self, position: QPointF) -> None:
        self._hover_at = position
        if not self._hover_timer.isActive():
            self._hover_timer.start()

    def _hover(self) -> None:
        if self._hover_at is None:
            return
        if station_id := self.overlay.station_at(self._hover_at):
            self._hovered = -1
            self.station_hovered.emit(station_id)
            return
        index = self.layers.pick(self._hover_at, quick=True)
        if index >= 0 or self._hovered >= 0:
            self.hovered.emit(index)
        self._hovered = index
        if self._state.view.measuring_from is not None:
            self._update_marks()

    def _stop_hovering(self) -> None:
        self._hover_at = None
        self._hover_timer.stop()
        if self._hovered >= 0:
            self._hovered = -1
            self.hovered.emit(-1)

    # Qt

    def screenshot(self) -> QImage:
        """Return the picture with everything that is written over it."""
        return self.grab().toImage()

    def resizeEvent(self, event: QResizeEvent) -> None:  # noqa: N802
        """Keep the overlay over the whole picture."""
        super().resizeEvent(event)
        self.overlay.setGeometry(self.canvas.rect())

    def closeEvent(self, event: QCloseEvent) -> None:  # noqa: N802
        """Let go of VTK while its context is there."""
        self._warming.join()
        self._hover_timer.stop()
        self._decorations.clear()
        self._frame.show(None, (0.0, 0.0, 0.0))
        self.layers.forget()
        self.partial_cloud.clear()
        self._state = SceneState()
        self.canvas.close()
        super().closeEvent(event)


def _background(view: ViewOptions) -> Background:
    if view.background is Background.SYSTEM:
        return Background.DARK if theme.is_dark() else Background.LIGHT
    return view.background
