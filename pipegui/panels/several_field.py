"""A field in which several of some choices are ticked, in the order of the ticks."""

from collections.abc import Sequence

from PySide6.QtCore import QSignalBlocker, Qt, Signal
from PySide6.QtGui import QAction, QFontMetrics, QResizeEvent
from PySide6.QtWidgets import QFileDialog, QMenu, QSizePolicy, QToolButton

from pipegui.i18n.texts import tr


class SeveralField(QToolButton):
    """A button that shows what is chosen and opens a list to tick.

    Parameters
    ----------
    choices : sequence of (str, str)
        Text and value of each.
    file_filter : str
        Of files that may be chosen besides, their paths being values; "" for none.
    """

    changed = Signal(tuple)
    """The values that are chosen now, at least one."""

    def __init__(self, choices: Sequence[tuple[str, str]], file_filter: str = "") -> None:
        super().__init__()
        self._filter = file_filter
        self.setProperty("several", True)
        self._text = ""
        self.values: tuple[str, ...] = ()
        self.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
        self.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextOnly)
        self.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Fixed)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        menu = QMenu(self)
        self.setMenu(menu)
        self.ticks: dict[str, QAction] = {}
        self.own_file: QAction | None = None
        if file_filter:
            menu.addSeparator()
            self.own_file = menu.addAction(tr("Own file…"))
            self.own_file.triggered.connect(self._ask_file)
        for text, value in choices:
            self._add(text, value)

    def _add(self, text: str, value: str) -> None:
        tick = QAction(text, self)
        tick.setCheckable(True)
        tick.toggled.connect(lambda is_on: self._toggle(value, is_on))
        if self.own_file is None:
            self.menu().addAction(tick)
        else:
            self.menu().insertAction(self.own_file, tick)
        self.ticks[value] = tick

    def show_values(self, values: Sequence[str]) -> None:
        """Show what is chosen; values that are not among the choices are added to them.

        Parameters
        ----------
        values : sequence of str
        """
        self.values = tuple(values)
        for value in self.values:
            if value not in self.ticks:
                self._add(value, value)
        for value, tick in self.ticks.items():
            with QSignalBlocker(tick):
                tick.setChecked(value in self.values)
        self._text = ", ".join(self.ticks[value].text() for value in self.values)
        self._elide()

    def resizeEvent(self, event: QResizeEvent) -> None:  # noqa: N802
        """Fit the text into the new width."""
        super().resizeEvent(event)
        self._elide()

    def _elide(self) -> None:
        room = max(0, self.width() - 3 * self.fontMetrics().averageCharWidth())
        metrics = QFontMetrics(self.font())
        self.setText(metrics.elidedText(self._text, Qt.TextElideMode.ElideRight, room))

    def _toggle(self, value: str, is_on: bool) -> None:
        others = tuple(v for v in self.values if v != value)
        # The last tick stays: something has to be chosen.
        self._choose((*others, value) if is_on else others or (value,))

    def _choose(self, values: tuple[str, ...]) -> None:
        self.show_values(values)
        self.changed.emit(values)

    def _ask_file(self) -> None:
        name, _ = QFileDialog.getOpenFileName(self, tr("Own file…"), "", self._filter)
        if name:
            self._choose((*(v for v in self.values if v != name), name))
