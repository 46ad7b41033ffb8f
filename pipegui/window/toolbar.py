"""The tool bar: open, detect, cancel, undo, views, and what the colours mean."""

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QLabel, QToolBar, QToolButton, QWidget

from pipegui.i18n.texts import tr
from pipegui.model.colour_limits import n_decimals
from pipegui.model.commands import colours_of
from pipegui.model.document import ColourBy, Limits
from pipegui.panels.widgets import Applying, QuietComboBox, QuietSpinBox
from pipegui.states.view_state import WindowState
from pipegui.style import theme
from pipegui.window.actions import Actions


class ToolBar(QToolBar):
    """Buttons of the actions used most, and the choice of colours."""

    colour_chosen = Signal(object)
    limit_chosen = Signal(float)
    limits_chosen = Signal(object)
    """Low and high end of the colours, as in `WindowState.limits`."""

    def __init__(self, actions: Actions, parent: QWidget | None = None) -> None:
        super().__init__("Tools", parent)
        self.setObjectName("tools")
        self.setMovable(False)
        self.setIconSize(theme.icon_size(2.5))
        self._applying = Applying()
        for name in ("open", "detect", "cancel"):
            self.addAction(actions[name])
            button = self.widgetForAction(actions[name])
            if isinstance(button, QToolButton):
                button.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextBesideIcon)
        self.widgetForAction(actions["detect"]).setObjectName("primary")
        self.addSeparator()
        for name in ("undo", "redo"):
            self.addAction(actions[name])
        self.addSeparator()
        for name in ("clip", "measure", "coordinates"):
            self.addAction(actions[name])
        self.addSeparator()
        for name in ("fit", "view_top", "view_front", "view_right", "view_iso"):
            self.addAction(actions[name])
        self.addSeparator()
        self.colour = QuietComboBox()
        self.colour.setAccessibleName(tr("Colour by"))
        self.colour.setToolTip(tr("What the colour of the points means"))
        self.colour.setSizeAdjustPolicy(QuietComboBox.SizeAdjustPolicy.AdjustToContents)
        self.colour.currentIndexChanged.connect(self._emit_colour)
        self.limit = QuietSpinBox()
        self.limit.setAccessibleName(tr("Deviation range"))
        self.limit.setToolTip(tr("Deviations from − to + this are told apart by colour"))
        self.limit.setRange(0.5, 500)
        self.limit.setPrefix("± ")
        self.limit.setSuffix(" mm")
        self.limit.valueChanged.connect(self._emit_limit)
        self.addWidget(QLabel(tr("Colour by")))
        self.addWidget(self.colour)
        self._limit_label = self.addWidget(QLabel(tr("Range")))
        self._limit_action = self.addWidget(self.limit)
        self.ends = [QuietSpinBox() for _ in range(2)]
        self._end_actions: list[QAction] = []
        self._limits: Limits | None = None
        for end, name in enumerate((tr("Lower limit"), tr("Upper limit"))):
            field = self.ends[end]
            field.setAccessibleName(name)
            field.setToolTip(tr("Colours run from the lower to the upper limit"))
            field.setRange(-1e9, 1e9)
            field.setButtonSymbols(QuietSpinBox.ButtonSymbols.NoButtons)
            field.setFixedWidth(11 * theme.SPACING)
            field.valueChanged.connect(lambda value, end=end: self._emit_end(end, value))
            if self._end_actions:
                self._end_actions.append(self.addWidget(QLabel("–")))
            self._end_actions.append(self.addWidget(field))
        self.addSeparator()
        self.addWidget(QLabel(tr("Deformations")))
        for name in ("previous_deformation", "next_deformation"):
            self.addAction(actions[name])

    def apply(self, state: WindowState) -> None:
        """Show a state."""
        with self._applying:
            self.colour.setEnabled(state.scan is not None)
            offered = colours_of(state.scan) if state.scan else (ColourBy.HEIGHT,)
            if tuple(self.colour.itemData(i) for i in range(self.colour.count())) != offered:
                self.colour.clear()
                for colour in offered:
                    self.colour.addItem(tr(colour), colour)
            self.colour.setCurrentIndex(self.colour.findData(state.view.colour_by))
            self.limit.setValue(state.view.deviation_limit_mm)
            self._show_ends(state)
        shows_deviation = state.scan is not None and state.view.colour_by is ColourBy.DEVIATION
        self._limit_label.setVisible(shows_deviation or state.limits is not None)
        self._limit_action.setVisible(shows_deviation)
        for action in self._end_actions:
            action.setVisible(state.limits is not None)

    def _show_ends(self, state: WindowState) -> None:
        self._limits = state.limits
        if state.limits is None:
            return
        is_height = state.view.colour_by is ColourBy.HEIGHT
        decimals = 2 if is_height else n_decimals(state.limits)
        for field, value in zip(self.ends, state.limits, strict=True):
            field.setDecimals(decimals)
            field.setSingleStep(0.1 if is_height else 10.0 ** -max(decimals - 1, 0))
            field.setSuffix(" m" if is_height else "")
            field.setValue(value)

    def _emit_end(self, end: int, value: float) -> None:
        """Move one end; the other keeps what its field rounds."""
        if not self._applying and self._limits is not None:
            low, high = self._limits
            self.limits_chosen.emit((low, value) if end else (value, high))

    def _emit_colour(self) -> None:
        if not self._applying:
            self.colour_chosen.emit(ColourBy(self.colour.currentData()))

    def _emit_limit(self, limit: float) -> None:
        if not self._applying:
            self.limit_chosen.emit(limit)
