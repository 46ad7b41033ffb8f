"""Going from panel to panel with the keyboard."""

from collections.abc import Iterable

from PySide6.QtCore import QObject, Qt
from PySide6.QtWidgets import QApplication, QDockWidget, QWidget


def go_to_next_panel(panels: Iterable[QWidget], focused: QWidget | None, by: int) -> None:
    """Give the focus to the next (+1) or previous (-1) panel that can be seen.

    Parameters
    ----------
    panels : iterable of QWidget
        All panels, in their order.
    focused : QWidget or None
        The widget that has the focus now.
    by : int
        +1 or -1.
    """
    places = [panel for panel in panels if not panel.visibleRegion().isEmpty()]
    here = next(
        (i for i, p in enumerate(places) if focused and (p is focused or p.isAncestorOf(focused))),
        None,
    )
    if here is None:
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


class RaiseFocusedDock(QObject):
    """Raises a dock that lies behind another when Tab leads into it.

    Parameters
    ----------
    docks : iterable of QDockWidget
        Those that may lie behind one another.
    parent : QObject
        What this ends with.
    """

    def __init__(self, docks: Iterable[QDockWidget], parent: QObject) -> None:
        super().__init__(parent)
        self._docks = list(docks)
        app = QApplication.instance()
        assert isinstance(app, QApplication)
        app.focusChanged.connect(self._on_focus_changed)

    def _on_focus_changed(self, _before: QWidget | None, now: QWidget | None) -> None:
        if now is None:
            return
        for dock in self._docks:
            is_behind = dock.isVisible() and dock.visibleRegion().isEmpty()
            if is_behind and dock.isAncestorOf(now):
                dock.raise_()
