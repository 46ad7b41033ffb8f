"""Actors besides the points: axes, ellipses, surfaces and the selection."""

from collections.abc import Iterable

import numpy as np
import pyvista as pv
from PySide6.QtGui import QColor
from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper, vtkRenderer

from pipecore.types import OWN_STACK, Candidate, Element, Profiles
from pipegui.model.document import ClipBox, ColourBy
from pipegui.scene import shapes
from pipegui.scene.colouring import (
    effective,
    profile_colours,
    profile_rows,
    stack_of,
    visible_elements,
    visible_points,
)
from pipegui.scene.point_layer import point_actor, set_planes
from pipegui.states.view_state import SceneState
from pipegui.style import theme

MAX_HIGHLIGHTED = {False: 400_000, True: 20_000}
"""Points of the selected element that are drawn over the others, at rest and moving."""
MAX_IN_PROFILE = 200_000
SURFACE_OPACITY = 0.5
SURFACE_COLOUR = "#7d9cc4"
ACCENT_POINTS = {ColourBy.SEGMENT, ColourBy.ELEMENT, ColourBy.KIND, ColourBy.RGB}
"""Colourings whose colours the selection may cover; others are measured values."""
HIGHLIGHTING = ("colour_by", "show_points", "hidden_stations")
"""View options that decide which points of the selection are drawn over the others."""


class Decorations:
    """Groups of actors; each group is made anew when what it shows has changed.

    `layers` are the renderers: the first among the points, the second over them.
    """

    def __init__(self, layers: list[vtkRenderer]) -> None:
        self._layers = layers
        self._groups: dict[str, list[tuple[vtkRenderer, vtkActor]]] = {}
        self._accented: dict[bool, vtkActor] = {}
        self._box: ClipBox | None = None
        self._scale = 1.0
        self.dark = False
        """Whether it is drawn on a dark background."""

    def update(self, state: SceneState, before: SceneState, *, everything: bool) -> None:
        """Show the decorations of `state` where they differ from `before`."""
        old, new = before.view, state.view
        hidden = old.hidden_elements != new.hidden_elements
        base = everything or hidden or state.result is not before.result
        if base or old.show_axes != new.show_axes:
            self._replace("axes", self._axes(state))
        if base or old.show_surfaces != new.show_surfaces:
            self._replace("surfaces", self._surfaces(state))
        selected = base or state.selection != before.selection
        if selected or old.show_ellipses != new.show_ellipses:
            self._replace("ellipses", self._ellipses(state))
        if selected or any(getattr(old, name) != getattr(new, name) for name in HIGHLIGHTING):
            self._replace("highlight", self._highlight(state))
        if selected:
            self._replace("candidate", self._candidate(state))
        is_other_stack = (old.shown_stack, old.shown_profile) != (
            new.shown_stack,
            new.shown_profile,
        )
        if base or is_other_stack or old.colour_by != new.colour_by:
            self._replace("stack profile", self._stack_profile(state))
        if everything or state.profile is not before.profile:
            self._replace("profile", self._profile(state))

    def prepare(self, *, moving: bool, point_px: float, scale: float = 1.0) -> None:
        """Draw the points of the selection a little larger than the others, over them.

        Widths and sizes are of pixels of which the screen has `scale` each.
        """
        if scale != self._scale:
            for group in self._groups.values():
                for _, actor in group:
                    _enlarge(actor, scale / self._scale)
            self._scale = scale
        for is_for_moving, actor in self._accented.items():
            actor.SetVisibility(is_for_moving == moving)
            actor.GetProperty().SetPointSize(scale * (point_px + 1))

    def clip(self, box: ClipBox | None) -> None:
        """Draw only what lies in the box."""
        if box == self._box:
            return
        self._box = box
        for group in self._groups.values():
            for _, actor in group:
                set_planes(actor, box)

    def clear(self) -> None:
        """Take all away."""
        self._accented = {}
        for name in list(self._groups):
            self._replace(name, ())

    def _tint(self, role: str) -> QColor:
        return theme.colour(role, dark=self.dark)

    def _replace(self, name: str, actors: Iterable[tuple[int, vtkActor]]) -> None:
        for layer, actor in self._groups.pop(name, ()):
            layer.RemoveActor(actor)
        self._groups[name] = [(self._layers[i], actor) for i, actor in actors]
        for layer, actor in self._groups[name]:
            layer.AddActor(actor)
            _enlarge(actor, self._scale)
            set_planes(actor, self._box)

    def _axes(self, state: SceneState) -> Iterable[tuple[int, vtkActor]]:
        elements = visible_elements(state.result, state.view.hidden_elements)
        if state.view.show_axes and elements:
            yield 1, _lines(shapes.axis_lines(elements), self._tint("text"), 1.0, 0.55)

    def _surfaces(self, state: SceneState) -> Iterable[tuple[int, vtkActor]]:
        elements = visible_elements(state.result, state.view.hidden_elements)
        if state.view.show_surfaces and elements:
            yield 0, _surface(shapes.surfaces(elements), QColor(SURFACE_COLOUR))

    def _ellipses(self, state: SceneState) -> Iterable[tuple[int, vtkActor]]:
        selected = state.selection.element_id
        if not (state.view.show_ellipses and state.result):
            return
        profiles = state.result.profiles
        if selected:
            profiles = profiles.of_element(selected, OWN_STACK)
        else:
            shown = [
                e.element_id for e in visible_elements(state.result, state.view.hidden_elements)
            ]
            mask = np.isin(profiles.element_id, shown) & (profiles.stack_id == OWN_STACK)
            profiles = _thinned(profiles[mask])
        if len(profiles):
            yield 0, _lines(shapes.ellipse_lines(profiles), self._tint("text"), 1.0, 0.8)

    def _highlight(self, state: SceneState) -> Iterable[tuple[int, vtkActor]]:
        self._accented = {}
        element = selected_element(state)
        cloud, result = state.cloud, state.result
        if element is None or cloud is None or result is None:
            return
        accent = self._tint("accent")
        colour_by = effective(state.view.colour_by, cloud, result)
        if colour_by in ACCENT_POINTS and state.view.show_points:
            rows = np.flatnonzero(result.element_id == element.element_id)
            seen = visible_points(
                cloud, None, frozenset(), rows=rows, hidden_stations=state.view.hidden_stations
            )
            rows = rows if seen is None else rows[seen]
            for moving, limit in MAX_HIGHLIGHTED.items() if len(rows) else ():
                thinned = rows[:: -(-len(rows) // limit)]
                self._accented[moving] = _points(cloud.xyz[thinned], accent)
                yield 0, self._accented[moving]
        marked = [e for e in result.elements if e.element_id in state.selection.others]
        yield 1, _lines(shapes.axis_lines((element, *marked)), accent, 2.5)
        for each in (element, *marked):
            yield 1, _lines(shapes.end_rings(each), accent, 2.0)

    def _candidate(self, state: SceneState) -> Iterable[tuple[int, vtkActor]]:
        candidate = selected_candidate(state)
        if candidate is not None:
            yield 1, _lines(shapes.wire(candidate), self._tint("accent"), 1.5)

    def _stack_profile(self, state: SceneState) -> Iterable[tuple[int, vtkActor]]:
        """Yield the one profile of a stack: its points in their colours, and its ellipses."""
        cloud, result, view = state.cloud, state.result, state.view
        if cloud is None or result is None or view.shown_profile is None:
            return
        if view.colour_by is not ColourBy.PROFILE:
            return
        stack = stack_of(result, view.shown_stack)
        if stack is None:
            return
        rows = profile_rows(cloud, stack, view.shown_profile)
        rows = rows[:: -(-len(rows) // MAX_IN_PROFILE) or 1]
        xyz = np.ascontiguousarray(cloud.xyz[rows], np.float32)
        points = point_actor(xyz, profile_colours(cloud, result, rows))
        points.GetProperty().SetPointSize(3.0)
        yield 1, points
        table = result.profiles
        is_shown = table.profile_index == view.shown_profile
        ring = shapes.ellipse_lines(table[is_shown & (table.stack_id == view.shown_stack)])
        if ring.n_points:
            yield 1, _lines(ring, self._tint("text"), 1.5, 0.8)

    def _profile(self, state: SceneState) -> Iterable[tuple[int, vtkActor]]:
        if state.profile is None:
            return
        if len(state.profile_xyz):
            points = _points(state.profile_xyz, self._tint("text"))
            points.GetProperty().SetPointSize(3.0)
            yield 1, points
        ring = shapes.ellipse_lines(state.profile)
        if ring.n_points:
            yield 1, _lines(ring, self._tint("accent"), 3.0)


def _thinned(profiles: Profiles) -> Profiles:
    """Profiles so far apart that their ellipses are seen one by one: half a radius."""
    cell = np.floor(profiles.chainage / np.maximum(0.5 * profiles.radius, 1e-3))
    cells = np.column_stack([profiles.element_id, np.nan_to_num(cell, nan=-1.0)])
    _, first = np.unique(cells, axis=0, return_index=True)
    return profiles[np.sort(first)]


def selected_element(state: SceneState) -> Element | None:
    """Return the selected element, if there is one."""
    selected = state.selection.element_id
    if state.result is None or not selected:
        return None
    return state.result.element(selected)


def selected_candidate(state: SceneState) -> Candidate | None:
    """Return the selected candidate, if there is one."""
    selected = state.selection.candidate_id
    if state.result is None or not selected:
        return None
    return state.result.candidate(selected)


def _lines(mesh: pv.PolyData, colour: QColor, width: float, opacity: float = 1.0) -> vtkActor:
    mapper = vtkPolyDataMapper()
    mapper.SetInputData(mesh)
    actor = vtkActor()
    actor.SetMapper(mapper)
    _paint(actor, colour)
    actor.GetProperty().LightingOff()
    actor.GetProperty().SetLineWidth(width)
    actor.GetProperty().SetOpacity(opacity)
    return actor


def _surface(mesh: pv.PolyData, colour: QColor) -> vtkActor:
    mapper = vtkPolyDataMapper()
    mapper.SetInputData(mesh)
    mapper.ScalarVisibilityOff()
    actor = vtkActor()
    actor.SetMapper(mapper)
    _paint(actor, colour)
    actor.GetProperty().SetOpacity(SURFACE_OPACITY)
    actor.GetProperty().SetInterpolationToPhong()
    actor.GetProperty().BackfaceCullingOn()
    return actor


def _points(xyz: np.ndarray, colour: QColor) -> vtkActor:
    shade = np.array([colour.red(), colour.green(), colour.blue()], np.uint8)
    colours = np.broadcast_to(shade, (len(xyz), 3)).copy()
    return point_actor(np.ascontiguousarray(xyz, np.float32), colours)


def _enlarge(actor: vtkActor, ratio: float) -> None:
    """Draw wider lines and larger points."""
    drawn = actor.GetProperty()
    drawn.SetLineWidth(ratio * drawn.GetLineWidth())
    drawn.SetPointSize(ratio * drawn.GetPointSize())


def _paint(actor: vtkActor, colour: QColor) -> None:
    actor.GetProperty().SetColor(colour.redF(), colour.greenF(), colour.blueF())
