"""The points of the 3D view, in whichever of three layers suits the moment."""

from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QObject, QPointF

from pipecore.types import PointCloud
from pipegui.model.document import ClipBox
from pipegui.scene.canvas import Canvas
from pipegui.scene.colouring import ALL, Rows, colour_points, visible_points
from pipegui.scene.details import Finder, Mask, rows_in_picture, rows_of
from pipegui.scene.picking import pick_point
from pipegui.scene.point_layer import MOVING_LEVEL, PointLayer
from pipegui.scene.projection import Projection
from pipegui.scene.spreading import Spread
from pipegui.states.view_state import SceneState
from pipegui.style.colour_maps import Colours

COLOURING = (
    "colour_by",
    "deviation_limit_mm",
    "height_limits",
    "intensity_limits",
    "shown_stack",
    "shown_profile",
)
NO_LIMIT = 2**31
AT_ONCE = 400_000
"""Of more points than these, the window does not wait to know which are to be seen: so many,
spread over all, do until it is known."""


class Layers(QObject):
    """The cloud as a whole, a close-up of what is in the picture, and a preview.

    The close-up is for clouds of which not all points can be drawn; it comes once the
    camera has settled. The preview is for dragging the clip box: it has the points in
    the box and out of it.
    """

    def __init__(self, canvas: Canvas, parent: QObject) -> None:
        super().__init__(parent)
        self._canvas = canvas
        self._state = SceneState()
        self.dark = False
        """Whether it is drawn on a dark background."""
        self.whole, self.close_up, self.preview = (PointLayer(canvas.layers[0]) for _ in range(3))
        self.shown = self.whole
        self._details, self._subset = Finder(self), Finder(self)
        self._details.found.connect(self._show_close_up)
        self._subset.found.connect(self._show_subset)
        canvas.settled.connect(self._look_closer)
        # Not with the next picture: where that is late, the camera may be at rest again.
        canvas.moved.connect(self._end_close_up)
        self._search: Callable[[], NDArray[np.int32] | None] | None = None
        canvas.drawn.connect(self._begin_search)
        for layer in (self.whole, self.close_up, self.preview):
            canvas.drawn.connect(layer.learn)

    def update(self, state: SceneState, before: SceneState, *, everything: bool) -> None:
        """Show the points of `state` where they differ from `before`, first a part of many."""
        self._state = state
        cloud, view = state.cloud, state.view
        if cloud is None:
            self.forget()
            return
        is_new_result = state.result is not before.result
        is_recoloured = (
            everything
            or is_new_result
            or any(getattr(view, name) != getattr(before.view, name) for name in COLOURING)
        )
        hidden = view.hidden_elements
        is_other_subset = (
            cloud is not before.cloud
            or hidden != before.view.hidden_elements
            or (hidden and is_new_result)
            or view.hidden_stations != before.view.hidden_stations
            or view.clip_box != before.view.clip_box
        )
        if is_other_subset:
            self._choose(cloud, view.clip_box)
        elif is_recoloured:
            self.whole.set_colours(self.colour_rows)
        else:
            return
        self._end_close_up()
        if len(self.whole) > MOVING_LEVEL or len(cloud) > AT_ONCE:
            self._canvas.move_to(self._canvas.pose)  # few points now, all when there is time
        else:
            self._canvas.settle_again()

    def _choose(self, cloud: PointCloud, box: ClipBox | None) -> None:
        """Show the points that are to be seen; of a large cloud, a part until all are known."""
        self._subset.stop()
        self._search = None
        if self._is_whole(box) or len(cloud) <= AT_ONCE:
            self.whole.set_points(cloud, rows_of(self._visible(box)), self.colour_rows)
            return
        self.whole.set_points(cloud, self._sample(box), self.colour_rows)
        self._search = lambda: rows_of(self._visible(box))

    def _begin_search(self, _: float) -> None:
        """Look for all points that are to be seen, once a part of them is on the screen."""
        if self._search is not None:
            search, self._search = self._search, None
            self._subset.look(lambda _: search())

    def _show_subset(self, rows: NDArray[np.int32]) -> None:
        if self._state.cloud is not None:
            self.whole.set_points(self._state.cloud, rows, self.colour_rows)
            self._end_close_up()
            self._canvas.move_to(self._canvas.pose)

    def show(self, projection: Projection) -> None:
        """Draw the layer that suits the moment, with as many points as there is time for."""
        canvas, view = self._canvas, self._state.view
        if not canvas.is_software:
            self.whole.most = self.close_up.most = NO_LIMIT
        layers = (self.preview, self.close_up, self.whole)
        self.shown = next(layer for layer in layers if len(layer) or layer is self.whole)
        for layer in layers:
            layer.show(
                seconds=0.0 if layer is self.preview else canvas.seconds_to_draw,
                pixel_size=projection.pixel_size(canvas.pose.distance),
                visible=view.show_points and layer is self.shown,
                size=view.point_size,
                scale=canvas.devicePixelRatioF(),
            )

    def pick(self, position: QPointF, *, quick: bool = False) -> int:
        """Return the index in the cloud of the point seen at `position`, -1 for none.

        Quick is among those points only that are drawn while the camera moves.
        """
        layer = self.close_up if len(self.close_up) and not quick else self.whole
        parts = layer.quick_parts if quick else layer.parts
        if not parts or not self._state.view.show_points:
            return -1
        row = pick_point(parts, self._canvas.projection(), (position.x(), position.y()))
        return layer.cloud_index(row) if row >= 0 else -1

    def begin_preview(self, box: ClipBox) -> None:
        """Draw what is in the box, of points that need not have been in it before."""
        if self._state.cloud is not None:
            self.preview.seconds_per_point = self.whole.seconds_per_point
            self.preview.set_points(self._state.cloud, self._sample(None), self.colour_rows)
            self.preview.clip(box)

    def forget(self) -> None:
        """Let go of the cloud."""
        self._end_close_up()
        self._search = None
        self._details.close()
        self._subset.close()
        self._state = SceneState()
        for layer in (self.whole, self.close_up, self.preview):
            layer.forget()

    def _visible(self, box: ClipBox | None) -> Mask | None:
        state = self._state
        if state.cloud is None:
            return None
        return self._visible_rows(state.cloud, box)

    def _visible_rows(
        self, cloud: PointCloud, box: ClipBox | None, rows: Rows = ALL
    ) -> Mask | None:
        state, view = self._state, self._state.view
        return visible_points(
            cloud, state.result, view.hidden_elements, box, rows, view.hidden_stations
        )

    def _is_whole(self, box: ClipBox | None) -> bool:
        """Return whether no point is left out."""
        view = self._state.view
        return box is None and not view.hidden_elements and not view.hidden_stations

    def _sample(self, box: ClipBox | None) -> NDArray[np.int32] | None:
        """Return the visible rows of a sample small enough to take no time; None: all are."""
        state = self._state
        if state.cloud is None or self._is_whole(box):
            return None
        if len(state.cloud) <= AT_ONCE:
            return rows_of(self._visible(box))
        rows = Spread(len(state.cloud)).rows(0, AT_ONCE)
        seen = self._visible_rows(state.cloud, box, rows)
        return (rows if seen is None else rows[seen]).astype(np.int32)

    def colour_rows(self, rows: NDArray[np.int32]) -> Colours:
        """Return the colours (n, 3) of rows of the cloud as they are drawn."""
        state = self._state
        assert state.cloud is not None
        return colour_points(state.cloud, state.result, state.view, dark=self.dark, rows=rows)

    def _look_closer(self) -> None:
        """Begin to draw all points in the picture, if not all of the cloud are drawn."""
        canvas, cloud, view = self._canvas, self._state.cloud, self._state.view
        if cloud is None or not view.show_points or self.whole.n_shown == len(self.whole):
            return
        size = (canvas.width(), canvas.height())
        box = view.clip_box
        find = partial(rows_in_picture, cloud.xyz, canvas.projection(), size)
        self._details.look(partial(find, lambda: self._visible(box)))

    def _show_close_up(self, rows: NDArray[np.int32]) -> None:
        if self._state.cloud is not None and not self._canvas.is_moving:
            self.close_up.seconds_per_point = self.whole.seconds_per_point
            self.close_up.set_points(self._state.cloud, rows, self.colour_rows)
            self._canvas.draw()

    def _end_close_up(self) -> None:
        self._details.stop()
        self.close_up.clear_actors()
