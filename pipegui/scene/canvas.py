"""The picture itself: VTK in a Qt widget, with the mouse that moves its camera."""

import time
from collections.abc import Callable

import numpy as np
from PySide6.QtCore import QEasingCurve, QEvent, QPointF, Qt, QTimer, QVariantAnimation, Signal
from PySide6.QtGui import QKeyEvent, QMouseEvent, QWheelEvent
from PySide6.QtWidgets import QApplication, QWidget
from vtkmodules.vtkRenderingCore import vtkCamera, vtkRenderer
from vtkmodules.vtkRenderingOpenGL2 import vtkEDLShading, vtkRenderStepsPass

from pipecore.geometry import Array
from pipegui.scene import pose as poses
from pipegui.scene.interactor import QVTKRenderWindowInteractor
from pipegui.scene.pose import VIEW_ANGLE, Pose
from pipegui.scene.projection import Projection, as_array

FLIGHT_MS = 300
REST_MS = 250
"""The camera counts as moving for so long after its last move."""
REST_SECONDS = 0.35
"""What drawing may take then: whoever moves on should not wait for it."""
SETTLE_MS = 900
SETTLED_SECONDS = 0.7
"""What it may take once the camera has rested for some more time."""
RADIANS_PER_PX = np.deg2rad(0.35)
ZOOM_PER_STEP = 0.8
CLOSER = 0.4
N_LAYERS = 2

SOFTWARE = ("llvmpipe", "softpipe", "swrast", "swiftshader", "microsoft basic render")
"""Names by which OpenGL without a graphics card is known, in small letters."""

LEFT, MIDDLE = Qt.MouseButton.LeftButton, Qt.MouseButton.MiddleButton
Drag = Callable[[QPointF, bool], None]
"""Called with where the mouse is, and whether the button was released there."""
SHIFT = Qt.KeyboardModifier.ShiftModifier


class Canvas(QVTKRenderWindowInteractor):
    """Draws two layers, the second always over the first, and turns mouse into camera.

    Left drag orbits about the point under the cursor, middle or shift drag pans, the
    wheel zooms to the cursor, a double click flies closer. VTK's own interaction is not used.
    """

    clicked = Signal(QPointF)
    hovered = Signal(QPointF)
    left = Signal()
    before_frame = Signal()
    moved = Signal()
    """The camera is, or will be, elsewhere."""
    settled = Signal()
    """The camera has rested for a while, and all there is time for is drawn."""
    drawn = Signal(float)
    """A frame was drawn; the seconds that it took."""

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
        # QVTKRenderWindowInteractor connects this to its bound method, which would
        # keep both alive; `SceneView.close` closes the canvas instead.
        parent.destroyed.disconnect(self.close)
        self.point_under: Callable[[QPointF], Array | None] = lambda _: None
        self.grab: Callable[[QPointF], Drag | None] = lambda _: None
        """Asked at a press of the left button: what the drag then moves, None for the camera."""
        self._held: Drag | None = None
        self.pose = Pose(np.zeros(3), 1.0)
        self.is_moving = False
        self.is_parallel = False
        self.eye_dome: bool | None = None
        self._is_software: bool | None = None
        self._shading: vtkEDLShading | None = None
        self.is_stale = True
        self._press: QPointF | None = None
        self._last: QPointF | None = None
        self._is_drag = False
        self._pivot = np.zeros(3)
        self._camera = vtkCamera()
        self._camera.SetViewAngle(float(np.rad2deg(VIEW_ANGLE)))
        self.layers = [vtkRenderer() for _ in range(N_LAYERS)]
        window = self.GetRenderWindow()
        window.SetMultiSamples(0)
        window.SetNumberOfLayers(N_LAYERS)
        for i, layer in enumerate(self.layers):
            layer.SetLayer(i)
            layer.SetActiveCamera(self._camera)
            window.AddRenderer(layer)
        window.GetInteractor().Initialize()  # else it does not render
        self.rest_timer = QTimer(self, singleShot=True, interval=REST_MS)
        self.rest_timer.timeout.connect(self._rest)
        self.seconds_to_draw = SETTLED_SECONDS
        """What a picture may take now, 0 while the camera moves."""
        self.settle_timer = QTimer(self, singleShot=True, interval=SETTLE_MS)
        self.settle_timer.timeout.connect(self._settle)
        self._flight = QVariantAnimation(self, duration=FLIGHT_MS, startValue=0.0, endValue=1.0)
        self._flight.setEasingCurve(QEasingCurve.Type.InOutCubic)
        self._flight.valueChanged.connect(self._fly_on)
        self._flight_ends = (self.pose, self.pose)
        self.setMouseTracking(True)
        self.setFocusPolicy(Qt.FocusPolicy.ClickFocus)

    # Drawing

    def draw(self) -> None:
        """Draw anew when Qt next paints."""
        self.is_stale = True
        self.update()

    def paintGL(self) -> None:  # noqa: N802
        """Draw once if anything has changed, else show the last picture again.

        The widget paints whenever anything over it changes; only `draw` makes VTK work.
        """
        if not self.is_stale or self.GetRenderWindow() is None:
            self._in_paint = True  # pyvistaqt draws only where this is False
            try:
                super().paintGL()
            finally:
                self._in_paint = False
            return
        self.is_stale = False
        self._place_camera()
        self._shade()
        self.before_frame.emit()
        start = time.perf_counter()
        super().paintGL()
        self.GetRenderWindow().WaitForCompletion()  # else only giving the orders is timed
        self.drawn.emit(time.perf_counter() - start)

    def resizeGL(self, width: int, height: int) -> None:  # noqa: N802
        """Draw anew in the new size."""
        super().resizeGL(width, height)
        self.is_stale = True

    @property
    def is_drawn(self) -> bool:
        """Whether there has been a picture, so that the hardware is known."""
        return self._is_software is not None

    @property
    def is_software(self) -> bool:
        """Whether there is no graphics card that draws; known once something was drawn."""
        if self._is_software is None:
            said = self.GetRenderWindow().ReportCapabilities().lower()
            self._is_software = any(name in said for name in SOFTWARE)
        return self._is_software

    def _shade(self) -> None:
        """Shade steps in depth where that is wanted, without a graphics card only at rest."""
        is_wanted = not self.is_software if self.eye_dome is None else self.eye_dome
        if is_wanted and self.is_moving and self.is_software:
            is_wanted = False
        if is_wanted == (self._shading is not None):
            return
        if is_wanted:
            self._shading = vtkEDLShading()
            self._shading.SetDelegatePass(vtkRenderStepsPass())
            self.layers[0].SetPass(self._shading)
        elif self._shading is not None:
            self._stop_shading()

    def _stop_shading(self) -> None:
        if self._shading is not None:
            self.layers[0].SetPass(None)  # type: ignore[arg-type]  # takes the pass away
            self._shading.ReleaseGraphicsResources(self.GetRenderWindow())
            self._shading = None

    def _place_camera(self) -> None:
        pose = self.pose
        bounds = np.array([layer.ComputeVisiblePropBounds() for layer in self.layers])
        bounds = bounds[bounds[:, 0] <= bounds[:, 1]]
        low, high = bounds[:, ::2].min(axis=0, initial=0), bounds[:, 1::2].max(axis=0, initial=0)
        position = pose.position
        if self.is_parallel:
            # How far away it is makes no difference, so nothing has to be behind it.
            away = np.linalg.norm(high - low) + np.linalg.norm((low + high) / 2 - pose.focus)
            position = pose.focus - (pose.distance + away) * pose.forward
        self._camera.SetParallelProjection(self.is_parallel)
        self._camera.SetParallelScale(self._parallel_scale)
        self._camera.SetFocalPoint(*pose.focus)
        self._camera.SetPosition(*position)
        self._camera.SetViewUp(*pose.up)
        if len(bounds):
            self.layers[0].ResetCameraClippingRange([*np.stack([low, high]).T.ravel()])

    @property
    def _parallel_scale(self) -> float:
        """Half the height of the picture in metres: what perspective shows at the focus."""
        return float(self.pose.distance * np.tan(VIEW_ANGLE / 2))

    @property
    def aspect(self) -> float:
        """Width over height."""
        return float(self.width() / max(self.height(), 1))

    def projection(self) -> Projection:
        """Return the present mapping from local coordinates to the widget's pixels."""
        self._place_camera()
        near, far = self._camera.GetClippingRange()
        to_clip = self._camera.GetCompositeProjectionTransformMatrix(self.aspect, near, far)
        return Projection.of_camera(
            as_array(to_clip),
            as_array(self._camera.GetViewTransformMatrix()),
            (self.width(), self.height()),
            VIEW_ANGLE,
            self._parallel_scale if self.is_parallel else None,
        )

    # Moving

    def move_to(self, pose: Pose) -> None:
        """Put the camera there at once; draw quickly now and fully a moment later."""
        self.pose = pose
        self._set_moving()
        self.rest_timer.start()
        self.draw()

    def _set_moving(self) -> None:
        self.is_moving, self.seconds_to_draw = True, 0.0
        self.settle_timer.stop()
        self.moved.emit()

    def fly_to(self, pose: Pose, *, fly: bool = True) -> None:
        """Take the camera there in `FLIGHT_MS`, or at once."""
        self._flight.stop()
        if not fly or not self.isVisible():
            self.move_to(pose)
            return
        self._flight_ends = (self.pose, pose)
        self._set_moving()
        self._flight.start()

    def _fly_on(self, share: float) -> None:
        self.move_to(poses.between(*self._flight_ends, float(share)))

    def _rest(self) -> None:
        if QApplication.mouseButtons() & (LEFT | MIDDLE) and self._is_drag:
            self.rest_timer.start()
            return
        self.is_moving, self.seconds_to_draw = False, REST_SECONDS
        self.settle_timer.start()
        self.draw()

    def _settle(self) -> None:
        self.seconds_to_draw = SETTLED_SECONDS
        self.draw()
        self.settled.emit()

    def settle_again(self) -> None:
        """Take what is drawn as new: it has changed while the camera rests."""
        if not self.is_moving:
            self.settle_timer.start()

    # Mouse

    def mousePressEvent(self, event: QMouseEvent) -> None:  # noqa: N802
        """Take hold of what is under the cursor."""
        self._flight.stop()
        self._press = self._last = event.position()
        self._is_drag = False
        if event.button() == LEFT:
            self._held = self.grab(event.position())
        if self._held is not None:
            return
        under = self.point_under(event.position())
        self._pivot = self.pose.focus if under is None else under

    def mouseMoveEvent(self, event: QMouseEvent) -> None:  # noqa: N802
        """Orbit or pan while a button is held, else hover."""
        position = event.position()
        if self._press is None or self._last is None:
            self.hovered.emit(position)
            return
        way = (position - self._press).manhattanLength()
        if not self._is_drag and way < QApplication.startDragDistance():
            return
        self._is_drag = True
        if self._held is not None:
            self._held(position, False)
            self.move_to(self.pose)
            return
        step, self._last = position - self._last, position
        if event.buttons() & MIDDLE or event.modifiers() & SHIFT:
            depth = float((self._pivot - self.pose.position) @ self.pose.forward)
            size = self.projection().pixel_size(max(depth, poses.MIN_DISTANCE))
            self.move_to(poses.pan(self.pose, -size * step.x(), size * step.y()))
        elif event.buttons() & LEFT:
            turn, tilt = RADIANS_PER_PX * step.x(), RADIANS_PER_PX * step.y()
            self.move_to(poses.orbit(self.pose, turn, tilt, self._pivot))

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:  # noqa: N802
        """Click, unless the mouse was dragged."""
        held, self._held = self._held, None
        was_click = self._press is not None and not self._is_drag and held is None
        if held is not None:
            held(event.position(), True)
        self._press = self._last = None
        self._is_drag = False
        if was_click and event.button() == LEFT:
            self.clicked.emit(event.position())

    def mouseDoubleClickEvent(self, event: QMouseEvent) -> None:  # noqa: N802
        """Fly closer to what is under the cursor."""
        under = self.point_under(event.position())
        if under is not None and event.button() == LEFT:
            self.fly_to(poses.zoom(self.pose, CLOSER, under))

    def wheelEvent(self, event: QWheelEvent) -> None:  # noqa: N802
        """Zoom; what is under the cursor stays there."""
        self._flight.stop()
        target = self.point_under(event.position())
        if target is None:
            origin, direction = self.projection().ray(event.position().x(), event.position().y())
            depth = (self.pose.focus - origin) @ self.pose.forward
            target = origin + depth / (direction @ self.pose.forward) * direction
        steps = event.angleDelta().y() / 120
        self.move_to(poses.zoom(self.pose, ZOOM_PER_STEP**steps, target))

    def leaveEvent(self, event: QEvent) -> None:  # noqa: N802
        """Nothing is hovered any more."""
        self.left.emit()

    def enterEvent(self, event: QEvent) -> None:  # noqa: N802
        """Keep VTK out of it."""

    def keyPressEvent(self, event: QKeyEvent) -> None:  # noqa: N802
        """Leave keys to the window."""
        event.ignore()

    keyReleaseEvent = keyPressEvent  # noqa: N815

    def close(self) -> bool:
        """Let go of VTK while its context is there."""
        self._flight.stop()
        self.rest_timer.stop()
        self.settle_timer.stop()
        self.point_under, self.grab, self._held = lambda _: None, lambda _: None, None
        window = self.GetRenderWindow()
        self._stop_shading()
        for layer in self.layers:
            layer.RemoveAllViewProps()
            if window is not None:
                window.RemoveRenderer(layer)
        self.layers = []
        closed = bool(super().close())
        # The window may outlive its closing in Python; what VTK holds must not.
        self._RenderWindow = self._Iren = None
        return closed
