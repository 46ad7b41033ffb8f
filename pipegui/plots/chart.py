"""Base of the plots: a themed pyqtgraph canvas, a readout line, and a hint while empty."""

from collections.abc import Callable
from functools import partial

import pyqtgraph as pg
from pyqtgraph.GraphicsScene.mouseEvents import MouseClickEvent
from PySide6.QtCore import QEvent, QPointF, Qt, Signal
from PySide6.QtGui import QAction, QColor, QCursor, QFont, QGuiApplication, QKeySequence
from PySide6.QtWidgets import (
    QHBoxLayout,
    QLabel,
    QMenu,
    QStackedLayout,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

from pipegui.i18n.texts import mark, tr
from pipegui.plots.export import Table, png, to_csv, to_image, to_svg, to_tsv
from pipegui.style import theme
from pipegui.style.theme import SPACING

SAVED_AS = {
    "png": mark("Save as PNG…"),
    "svg": mark("Save as SVG…"),
    "csv": mark("Save numbers as CSV…"),
}
"""Endings of the files that every plot can be saved as."""


class Chart(QWidget):
    """A header row, one or more plots under each other, and a readout below.

    Parameters
    ----------
    empty_text : str
        What would fill the plot; shown while there is nothing in it.
    """

    save_requested = Signal(str)
    """The ending of the file that the plot is to be saved as, see `SAVED_AS`."""

    def __init__(self, empty_text: str, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._dark: bool | None = None
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.header = QHBoxLayout()
        self.header.setSpacing(SPACING)
        self.canvas = pg.GraphicsLayoutWidget()
        self.canvas.setFocusPolicy(Qt.FocusPolicy.NoFocus)
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
        self.menu = self._make_menu()
        self.menu_button = self.tool_button(tr("Copy and save"), "export-variant")
        self.menu_button.setMenu(self.menu)
        self.menu_button.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
        self.canvas.scene().sigMouseClicked.connect(self._open_menu)

    def tool_button(self, tip: str, icon: str) -> QToolButton:
        """Return a small button for the header; its icon follows the theme."""
        button = QToolButton()
        button.setAutoRaise(True)
        button.setToolTip(tip)
        button.setAccessibleName(tip)
        theme.set_icon(button, icon)
        return button

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
        theme.refresh_icons(self)
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
        """Return the plots from top to bottom."""
        return [item for item in self.canvas.ci.items if isinstance(item, pg.PlotItem)]

    def show_filled(self, filled: bool) -> None:
        """Show the plots, or the hint that says what would fill them."""
        self._stack.setCurrentIndex(int(filled))

    # Copying and saving

    def numbers(self) -> Table:
        """Return what is plotted as columns of plain numbers."""
        raise NotImplementedError

    def heading(self) -> str:
        """Return the heading of a saved picture, as rich text."""
        return ""

    def fit(self) -> None:
        """Show all that is plotted."""

    def _make_menu(self) -> QMenu:
        menu = QMenu(self)
        menu.addAction(tr("Show all"), self.fit)
        menu.addSeparator()
        for text, shortcut, act in (
            (tr("Copy numbers"), QKeySequence(QKeySequence.StandardKey.Copy), self.copy_numbers),
            (tr("Copy picture"), QKeySequence("Ctrl+Shift+C"), self.copy_picture),
        ):
            action = QAction(text, self)
            action.setShortcut(shortcut)
            action.setShortcutContext(Qt.ShortcutContext.WidgetWithChildrenShortcut)
            action.triggered.connect(act)
            self.addAction(action)  # the keys work while the plot has the focus
            menu.addAction(action)
        menu.addSeparator()
        for ending, text in SAVED_AS.items():
            menu.addAction(tr(text), partial(self.save_requested.emit, ending))
        return menu

    def _open_menu(self, event: MouseClickEvent) -> None:
        self.setFocus()
        if event.button() == Qt.MouseButton.RightButton:
            self.menu.popup(QCursor.pos())

    def copy_numbers(self) -> None:
        """Copy what is plotted, for a spreadsheet."""
        QGuiApplication.clipboard().setText(to_tsv(self.numbers()))

    def copy_picture(self) -> None:
        """Copy the plot as it looks."""
        QGuiApplication.clipboard().setImage(to_image(self.canvas, self.heading()))

    def as_file(self, ending: str) -> bytes:
        """Return the plot as the content of a file, see `SAVED_AS`."""
        match ending:
            case "csv":
                return to_csv(self.numbers()).encode()
            case "svg":
                return to_svg(self.canvas, self.heading())
            case _:
                return png(to_image(self.canvas, self.heading()))

    # Mouse

    def on_click(self, act: Callable[[pg.PlotItem, QPointF], None]) -> None:
        """Call `act` with plot and position in the canvas when a plot is clicked."""

        def clicked(event: MouseClickEvent) -> None:
            plot = self._plot_at(event.scenePos())
            if plot is not None and event.button() == Qt.MouseButton.LeftButton:
                act(plot, event.scenePos())

        self.canvas.scene().sigMouseClicked.connect(clicked)

    def on_hover(self, act: Callable[[pg.PlotItem | None, QPointF], None]) -> None:
        """Call `act` with the plot under the cursor (or None) when the mouse moves."""
        self.canvas.scene().sigMouseMoved.connect(lambda at: act(self._plot_at(at), at))

    def leaveEvent(self, event: QEvent) -> None:  # noqa: N802
        """Let go of what was under the cursor."""
        super().leaveEvent(event)
        self.canvas.scene().sigMouseMoved.emit(QPointF(-1e4, -1e4))

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
