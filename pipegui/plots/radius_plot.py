"""Radius against profile of the selected element, as the paper draws it, and of pinned ones."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QPointF, QSignalBlocker, Qt, Signal
from PySide6.QtGui import QColor, QFontMetrics
from PySide6.QtWidgets import (
    QComboBox,
    QGraphicsSimpleTextItem,
    QLabel,
    QToolButton,
    QWidget,
)

from pipecore.geometry import Array
from pipecore.inspection.radius_pattern import profile_index_at
from pipecore.types import Element, Profiles, Verdict
from pipegui.i18n.texts import format_measure, label_of, mark, tr
from pipegui.model.document import ProfileKey
from pipegui.plots import drawing
from pipegui.plots.chart import Chart, small
from pipegui.plots.export import Table
from pipegui.plots.radius_curves import (
    Curve,
    curve_of,
    free_radius_mm,
    legend,
    limit_text,
    range_of,
    row_text,
    table_of,
)
from pipegui.plots.series_menu import SeriesMenu
from pipegui.states.view_state import RadiusPlotState
from pipegui.style import theme
from pipegui.style.colour_maps import QUALITATIVE
from pipegui.style.colours import VERDICT

EMPTY = mark("Select an element to see its radius from profile to profile.")
CLICK_PX = 20
ROOM_FOR_ALL = 260
"""Height in pixels below which the radius stands alone."""
SPACE = 4
"""Pixels between the plots."""
NO_PROFILES = mark("{label} has no profiles with an accepted ellipse.")
X_AXES = {mark("Index"): mark("Profile index"), mark("Chainage"): mark("Chainage, m")}
SERIES = {
    "semi_minor": mark("Semi-minor axis"),
    "free_radius": mark("Radius of the free circle"),
    "fitted": mark("Fitted pattern"),
    "band": mark("Scatter band"),
    "limit": mark("Limit of the rule"),
    "error_bars": mark("Error bars"),
    "centre": mark("Centre off the axis"),
    "ovality": mark("Ovality"),
    "difference": mark("As difference from the fitted radius"),
}
"""What can be shown, by name."""
AT_FIRST = frozenset(SERIES) - {"free_radius", "difference"}


class RadiusPlot(Chart):
    """Semi-minor axis per profile with the fitted pattern; centre and ovality below it."""

    profile_clicked = Signal(int, int)
    """Stack id and profile index."""
    profile_hovered = Signal(object)
    """The `ProfileKey` of the profile under the cursor, None for none."""
    stack_chosen = Signal(int)
    pin_toggled = Signal()
    """The present element is to stay in the plot, or is not to any more."""
    pins_cleared = Signal()
    choices_changed = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(tr(EMPTY), parent)
        self.state = RadiusPlotState()
        self._curve: Curve | None = None
        self._pinned: list[Curve] = []
        self._had_room = True
        self._make_header()
        self.radius = self.add_plot(0, "mm")
        self.offset = self.add_plot(1, "mm")
        self.ovality = self.add_plot(2, "%")
        self._titles = [
            self._inside_title(plot, text)
            for plot, text in (
                (self.offset, tr("centre off the axis")),
                (self.ovality, tr("ovality")),
            )
        ]
        for plot in (self.offset, self.ovality):
            plot.setXLink(self.radius)
        self.canvas.sigDeviceRangeChanged.connect(self._follow_room)
        self.on_click(self._click)
        self.on_hover(self._hover)
        self.setAccessibleName(tr("Radius plot"))

    def _make_header(self) -> None:
        self.stacks = QComboBox()
        self.stacks.setMinimumContentsLength(10)
        self.stacks.setAccessibleName(tr("Stack"))
        self.stacks.setToolTip(tr("The stack whose profiles are plotted"))
        self.stacks.activated.connect(self._choose_stack)
        self.x_axis = QComboBox()
        self.x_axis.addItems([tr(name) for name in X_AXES])
        self.x_axis.setAccessibleName(tr("Plot against"))
        self.x_axis.setToolTip(tr("What the profiles are plotted against"))
        self.x_axis.currentIndexChanged.connect(self._redraw)
        self.pin = self.tool_button(tr("Pin: keep this element in the plot"), "pin-outline")
        self.pin.setCheckable(True)
        self.pin.clicked.connect(lambda _: self.pin_toggled.emit())
        self.shown_menu = SeriesMenu(SERIES, AT_FIRST, ("centre", "difference"), self)
        self.shown_menu.changed.connect(self._redraw)
        self.shown_menu.addSeparator()
        self.shown_menu.addAction(tr("Unpin all"), self.pins_cleared.emit)
        self.shown_button = self.tool_button(tr("What is plotted"), "tune-variant")
        self.shown_button.setMenu(self.shown_menu)
        self.shown_button.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
        self.key = QLabel(wordWrap=True)
        self.key.setMinimumWidth(1)
        for choice in (self.stacks, self.x_axis):
            self.header.addWidget(choice)
        self.header.addStretch(1)
        for widget in (self.pin, self.shown_button, self.menu_button):
            self.header.addWidget(widget)
        self.canvas.parentWidget().layout().insertWidget(1, self.key)

    def _inside_title(self, plot: pg.PlotItem, text: str) -> QGraphicsSimpleTextItem:
        """Return a title inside the plot: at its axis there is no room in a small panel."""
        title = QGraphicsSimpleTextItem(text, plot.vb)
        title.setFont(small(self.font()))
        title.setPos(SPACE, 0)
        return title

    def apply(self, state: RadiusPlotState) -> None:
        """Show `state`."""
        is_new_theme = self.is_new_theme()
        before, self.state = self.state, state
        if state == before and not is_new_theme:
            return
        has_profiles = state.element is not None and len(state.shown) > 0
        self.empty.setText(
            tr(EMPTY)
            if state.element is None
            else tr(NO_PROFILES).format(label=label_of(state.element))
        )
        self.show_filled(has_profiles)
        self._fill_stacks(state)
        self.pin.setChecked(state.is_pinned)
        self._draw()
        is_other = state.element is not before.element or state.stack_id != before.stack_id
        if has_profiles and (is_other or state.pinned != before.pinned):
            self.fit()

    def _fill_stacks(self, state: RadiusPlotState) -> None:
        with QSignalBlocker(self.stacks):
            self.stacks.clear()
            for stack_id, name, count in state.stacks:
                self.stacks.addItem(f"{name} ({count})", stack_id)
            self.stacks.setCurrentIndex(self.stacks.findData(state.stack_id))

    def _choose_stack(self, row: int) -> None:
        self.stack_chosen.emit(self.stacks.itemData(row))

    def _redraw(self) -> None:
        self._draw()
        self.fit()
        self.choices_changed.emit()

    # Kept from one session to the next

    def choices(self) -> dict[str, Any]:
        """Return what is plotted against what."""
        against = list(X_AXES)[self.x_axis.currentIndex()]
        return {"shown": self.shown_menu.shown, "against": against}

    def choose(self, choices: Mapping[str, Any]) -> None:
        """Plot as it was."""
        self.shown_menu.choose(choices.get("shown"))
        if (against := choices.get("against")) in list(X_AXES):
            self.x_axis.setCurrentIndex(list(X_AXES).index(against))

    # Numbers

    def shows(self, name: str) -> bool:
        """Return whether one of `SERIES` is shown."""
        return self.shown_menu.shows(name)

    @property
    def _is_by_chainage(self) -> bool:
        return self.x_axis.currentIndex() == 1

    def _x_at(self, chainage: Array | float, profiles: Profiles) -> Array:
        if self._is_by_chainage:
            return np.asarray(chainage, np.float64)
        return profile_index_at(chainage, profiles)

    def _curve_of(self, element: Element, profiles: Profiles, number: int) -> Curve:
        x = self._x_at(profiles.chainage, profiles)
        colour = QColor(*QUALITATIVE[number % len(QUALITATIVE)].tolist())
        return curve_of(element, profiles, x, colour)

    def _level(self, curve: Curve, values: Array) -> Array:
        """Values of a curve as plotted: as they are, or less the fitted radius."""
        return values - curve.pattern_mm.fitted if self.shows("difference") else values

    # Drawing

    def _draw(self) -> None:
        state, profiles = self.state, self.state.shown
        self.readout.clear()
        for plot in self.plots():
            plot.clear()
        self._curve, self._pinned = None, []
        if state.element is None or not len(profiles):
            return
        self._curve = curve = self._curve_of(state.element, profiles, 0)
        self._pinned = [
            self._curve_of(pinned.element, pinned.profiles, number)
            for number, pinned in enumerate(state.pinned, start=1)
        ]
        self._arrange()
        self._shade_deformations(curve)
        if self.shows("band"):
            drawing.draw_band(
                self.radius,
                curve.x,
                self._level(curve, curve.pattern_mm.moved),
                curve.pattern_mm.scatter,
                curve.colour,
            )
            moved = self._level(curve, curve.pattern_mm.moved)
            drawing.draw_line(self.radius, curve.x, moved, curve.colour, dashed=True)
        if self.shows("limit") and state.dent_limit is not None:
            lowest = curve.pattern_mm.fitted - 1000 * state.dent_limit.depth
            red = QColor(VERDICT[Verdict.REJECT])
            drawing.draw_line(self.radius, curve.x, self._level(curve, lowest), red, dashed=True)
        for one in (*self._pinned, curve):
            self._draw_curve(one, is_pinned=one is not curve)
        self._mark_selected(curve)
        self._describe(curve)

    def _has_room(self) -> bool:
        return bool(self.canvas.height() >= ROOM_FOR_ALL)

    def _follow_room(self) -> None:
        """Leave the smaller plots out of a small panel."""
        if self._curve is not None and self._had_room != self._has_room():
            self._arrange()

    def _arrange(self) -> None:
        """Show the plots that are wanted; the lowest has the axis's numbers and name."""
        assert self._curve is not None
        self._had_room = self._has_room()
        every = (self._curve, *self._pinned)
        has_ovality = any(np.isfinite(c.profiles.ovality).any() for c in every)
        wanted = {
            self.radius: True,
            self.offset: self.shows("centre") and self._has_room(),
            self.ovality: self.shows("ovality") and has_ovality and self._has_room(),
        }
        layout = self.canvas.ci.layout
        for row, (plot, is_wanted) in enumerate(wanted.items()):
            plot.setVisible(is_wanted)
            plot.setMaximumHeight(16_777_215 if is_wanted else 0)
            layout.setRowStretchFactor(row, (5 if row == 0 else 2) if is_wanted else 0)
            layout.setRowSpacing(row, SPACE if is_wanted else 0)
        lowest = [plot for plot, is_wanted in wanted.items() if is_wanted][-1]
        title = tr(list(X_AXES.values())[self.x_axis.currentIndex()])
        for plot in wanted:
            axis = plot.getAxis("bottom")
            axis.setStyle(showValues=plot is lowest)
            axis.setLabel(title if plot is lowest else None)
            axis.showLabel(plot is lowest)
        for inside in self._titles:
            inside.setBrush(theme.colour("muted"))

    def _draw_curve(self, curve: Curve, *, is_pinned: bool) -> None:
        profiles, pattern, bars = curve.profiles, curve.pattern_mm, self.shows("error_bars")
        size = drawing.POINT_PX - (1.5 if is_pinned else 0)
        if self.shows("fitted"):
            colour = curve.colour if is_pinned else theme.colour("text")
            fitted = self._level(curve, pattern.fitted)
            drawing.draw_line(self.radius, curve.x, fitted, colour)
        if self.shows("free_radius") and not is_pinned:
            free, sd = free_radius_mm(profiles), 1000 * profiles.radius_sd
            violet = QColor(*QUALITATIVE[-1].tolist())
            level = self._level(curve, free)
            drawing.draw_points(self.radius, curve.x, level, violet, sd if bars else None, "d", 7)
        if self.shows("semi_minor"):
            level, error = self._level(curve, pattern.values), pattern.sd if bars else None
            drawing.draw_points(self.radius, curve.x, level, curve.colour, error, size=size)
        for plot, values in (
            (self.offset, 1000 * profiles.centre_deviation),
            (self.ovality, 100 * profiles.ovality),
        ):
            drawing.draw_points(plot, curve.x, values, curve.colour, size=size)

    def _shade_deformations(self, curve: Curve) -> None:
        for deformation in self.state.deformations:
            is_selected = deformation.deformation_id == self.state.selected_deformation
            colour = theme.colour("accent") if is_selected else QColor(VERDICT[deformation.verdict])
            ends = np.array([deformation.chainage_start, deformation.chainage_end])
            ends = self._x_at(ends, curve.profiles)
            for plot in self.plots():
                drawing.draw_stretch(plot, ends, colour, is_selected=is_selected)
            text = f"{tr(deformation.kind)} {format_measure(1000 * deformation.depth, unit='mm')}"
            font = small(self.font())
            drawing.draw_label(self.radius, float(ends.mean()), text, colour, font)

    def _mark_selected(self, curve: Curve) -> None:
        index = self.state.selected_index
        rows = np.flatnonzero(curve.profiles.profile_index == index)
        if index is None or not len(rows):
            return
        for plot in self.plots():
            drawing.draw_mark(plot, curve.x[rows[0]], float(self._values(plot, curve)[rows[0]]))

    def _values(self, plot: pg.PlotItem, curve: Curve) -> Array:
        """Return the values that a plot shows of a curve."""
        if plot is self.radius:
            return self._level(curve, curve.pattern_mm.values)
        if plot is self.offset:
            return 1000 * curve.profiles.centre_deviation
        return 100 * curve.profiles.ovality

    def _describe(self, curve: Curve) -> None:
        limit = self.state.dent_limit
        self.key.setText(legend(curve, self._pinned, self.shows, limit))
        self.key.setToolTip(limit_text(limit) if limit and self.shows("limit") else "")

    def fit(self) -> None:
        """Show all points with a margin; a few wild ones must not flatten the rest."""
        curve = self._curve
        if curve is None:
            return
        ranges = [
            range_of(
                self._level(one, one.pattern_mm.values),
                self._level(one, one.pattern_mm.fitted),
                one,
            )
            for one in (curve, *self._pinned)
        ]
        lows, highs = ([r[end] for r in ranges if r is not None] for end in (0, 1))
        if not lows:
            return
        if self.shows("limit") and self.state.dent_limit is not None:
            limit = self._level(curve, curve.pattern_mm.fitted).min()
            limit -= 1000 * self.state.dent_limit.depth
            if limit > min(lows) - (max(highs) - min(lows)):  # else it would flatten the rest
                lows.append(limit)
        margin = max(0.15 * (max(highs) - min(lows)), 0.5)
        self.radius.setYRange(min(lows) - margin, max(highs) + 2 * margin, padding=0)
        every = np.concatenate([c.x for c in (curve, *self._pinned)])
        self.radius.setXRange(every.min(), every.max(), padding=0.03)
        for plot in (self.offset, self.ovality):
            values = np.concatenate([self._values(plot, c) for c in (curve, *self._pinned)])
            top = float(np.nanmax(values)) if np.isfinite(values).any() else 1.0
            plot.setYRange(0, 1.15 * max(top, 0.5), padding=0)

    # Copying

    def heading(self) -> str:
        """Title and key of the picture."""
        element = self.state.element
        name = "" if element is None else label_of(element)
        return f"<b>{name}</b> · {self.stacks.currentText()}<br>{self.key.text()}"

    def numbers(self) -> Table:
        """Return the profiles of the element and of the pinned ones."""
        return table_of([self._curve, *self._pinned] if self._curve is not None else [])

    # Mouse

    def _row_at(self, plot: pg.PlotItem, position: QPointF) -> int | None:
        """Row of the profile whose point is nearest to `position`, if any is near."""
        curve = self._curve
        if curve is None:
            return None
        values = self._values(plot, curve)
        pixel = plot.vb.viewPixelSize()
        cursor = plot.vb.mapSceneToView(position)
        away = np.hypot((curve.x - cursor.x()) / pixel[0], (values - cursor.y()) / pixel[1])
        if not np.isfinite(away).any() or np.nanmin(away) > CLICK_PX:
            return None
        return int(np.nanargmin(away))

    def _click(self, plot: pg.PlotItem, position: QPointF) -> None:
        row = self._row_at(plot, position)
        if row is not None:
            key = self._key_of(row)
            self.profile_clicked.emit(key.stack_id, key.profile_index)

    def _hover(self, plot: pg.PlotItem | None, position: QPointF) -> None:
        row = self._row_at(plot, position) if plot is not None else None
        text = "" if row is None else row_text(self.state.shown, row)
        metrics, elide = QFontMetrics(self.readout.font()), Qt.TextElideMode.ElideRight
        self.readout.setText(metrics.elidedText(text, elide, self.readout.width()))
        self.profile_hovered.emit(None if row is None else self._key_of(row))

    def _key_of(self, row: int) -> ProfileKey:
        profiles = self.state.shown
        return ProfileKey(int(profiles.stack_id[row]), int(profiles.profile_index[row]))
