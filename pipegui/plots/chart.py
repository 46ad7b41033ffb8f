"""What the plots share: a themed pyqtgraph canvas, a line to read from, and a word if empty."""

from collections.abc import Callable

import pyqtgraph as pg
from PySide6.QtCore import QPointF, Qt
from PySide6.QtGui import QColor, QFont
from PySide6.QtWidgets import QHBoxLayout, QLabel, QStackedLayout, QVBoxLayout, QWidget

from pipegui import theme
from pipegui.theme import SPACING


class Chart(QWidget):
    """A header row, one or more plots under each other, and a readout below.

    Parameters
    ----------
    empty_text : str
        What would fill the plot; shown while there is nothing in it.
    """

    def __init__(self, empty_text: str, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._dark: bool | None = None
        self.header = QHBoxLayout()
        self.header.setSpacing(SPACING)
        self.canvas = pg.GraphicsLayoutWidget()
        self.canvas.ci.setContentsMargins(0, SPACING, SPACING, 0)
        self.canvas.ci.setSpacing(SPACING // 2)
        self.readout = QLabel()
        self.readout.setContentsMargins(SPACING // 2, 0, 0, 0)
        self.readout.setTextFormat(Qt.TextFormat.PlainText)
        self.readout.setMinimumWidth(1)  # a long text must not widen the panel
        filled = QWidget()
        column = QVBoxLayout(filled)
        column.setContentsMargins(SPACING, SPACING, SPACING, SPACING // 2)
        column.setSpacing(SPACING // 2)
        column.addLayout(self.header)
        column.addWidget(self.canvas, 1)
        column.addWidget(self.readout)
        self.empty = QLabel(empty_text, alignment=Qt.AlignmentFlag.AlignCenter, wordWrap=True)
        self.empty.setContentsMargins(3 * SPACING, 0, 3 * SPACING, 0)
        self._stack = QStackedLayout(self)
        self._stack.addWidget(self.empty)
        self._stack.addWidget(filled)

    def add_plot(self, row: int, left: str, bottom: str = "") -> pg.PlotItem:
        """Add a plot with its axes' labels; it zooms but has no menu."""
        plot = self.canvas.addPlot(row=row, col=0, enableMenu=False)
        plot.hideButtons()
        plot.setLabel("left", left)
        plot.getAxis("left").enableAutoSIPrefix(False)
        plot.getAxis("left").setWidth(56)
        if bottom:
            plot.setLabel("bottom", bottom)
            plot.getAxis("bottom").enableAutoSIPrefix(False)
        return plot

    def is_new_theme(self) -> bool:
        """Dress the plots in the present theme; return whether it has changed."""
        if self._dark == theme.is_dark():
            return False
        self._dark = theme.is_dark()
        self.canvas.setBackground(theme.colour("window"))
        muted = theme.colour("muted").name()
        self.empty.setStyleSheet(f"color: {muted}")
        self.readout.setStyleSheet(f"color: {muted}")
        grid = 40 if self._dark else 30
        for plot in self.plots():
            plot.showGrid(x=True, y=True, alpha=grid / 255)
            for side in ("left", "bottom"):
                axis = plot.getAxis(side)
                axis.setPen(theme.colour("border"))
                axis.setTextPen(theme.colour("text"))
                axis.setTickFont(small(self.font()))
        return True

    def plots(self) -> list[pg.PlotItem]:
        """The plots from top to bottom."""
        return [item for item in self.canvas.ci.items if isinstance(item, pg.PlotItem)]

    def show_filled(self, filled: bool) -> None:
        """Show the plots, or the word that says what would fill them."""
        self._stack.setCurrentIndex(int(filled))

    def on_click(self, act: Callable[[pg.PlotItem, QPointF], None]) -> None:
        """Call `act` with plot and position in the canvas when a plot is clicked."""

        def clicked(event: object) -> None:
            plot = self._plot_at(event.scenePos())
            if plot is not None and event.button() == Qt.MouseButton.LeftButton:
                act(plot, event.scenePos())

        self.canvas.scene().sigMouseClicked.connect(clicked)

    def on_hover(self, act: Callable[[pg.PlotItem | None, QPointF], None]) -> None:
        """Call `act` with the plot under the cursor (or None) when the mouse moves."""
        self.canvas.scene().sigMouseMoved.connect(lambda at: act(self._plot_at(at), at))

    def _plot_at(self, position: QPointF) -> pg.PlotItem | None:
        for plot in self.plots():
            if plot.vb.sceneBoundingRect().contains(position):
                return plot
        return None


def small(font: QFont) -> QFont:
    """Return the font a size smaller."""
    smaller = QFont(font)
    if font.pointSizeF() > 0:
        smaller.setPointSizeF(font.pointSizeF() * 0.9)
    return smaller


def faint(colour: QColor | str, alpha: float) -> QColor:
    """Return the colour, translucent."""
    fainter = QColor(colour)
    fainter.setAlphaF(alpha)
    return fainter
