"""Going from panel to panel with the keyboard."""

from typing import TYPE_CHECKING

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QWidget

if TYPE_CHECKING:
    from pipegui.main_window import MainWindow


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
