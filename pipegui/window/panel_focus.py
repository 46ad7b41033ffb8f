"""Going from panel to panel with the keyboard."""

from typing import TYPE_CHECKING

from PySide6.QtCore import QObject, Qt
from PySide6.QtWidgets import QApplication, QWidget

if TYPE_CHECKING:
    from pipegui.window.main_window import MainWindow


def go_to_next_panel(window: "MainWindow", by: int) -> None:
    """Give the focus to the next (+1) or previous (-1) panel that can be seen."""
    places: list[QWidget] = [window.centre, *window.panels.docks.values()]
    places = [place for place in places if not place.visibleRegion().isEmpty()]
    focused = window.focusWidget()
    here = next((i for i, p in enumerate(places) if p is focused or p.isAncestorOf(focused)), None)
    if focused is None or here is None:
        here = -1 if by > 0 else 0
    for step in range(1, len(places) + 1):
        target = _first_input(places[(here + by * step) % len(places)])
        if target is not None:
            target.setFocus(Qt.FocusReason.TabFocusReason)
            return


def _first_input(panel: QWidget) -> QWidget | None:
    """The first widget of a panel that takes the focus by Tab, in the order of Tab."""
    for widget in [panel, *panel.findChildren(QWidget)]:
        takes_it = widget.focusPolicy() & Qt.FocusPolicy.TabFocus
        if takes_it and widget.isVisibleTo(panel) and widget.isEnabled():
            return widget
    return None


class FocusInSight(QObject):
    """Brings a panel forward that lies behind another when Tab leads into it."""

    def __init__(self, window: "MainWindow") -> None:
        super().__init__(window)
        self._docks = window.panels.docks
        app = QApplication.instance()
        assert isinstance(app, QApplication)
        app.focusChanged.connect(self._look)

    def _look(self, _before: QWidget | None, now: QWidget | None) -> None:
        if now is None:
            return
        for dock in self._docks.values():
            is_behind = dock.isVisible() and dock.visibleRegion().isEmpty()
            if is_behind and dock.isAncestorOf(now):
                dock.raise_()
