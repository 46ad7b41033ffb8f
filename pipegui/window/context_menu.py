"""The menu of a row of the project tree."""

from PySide6.QtCore import QPoint, Qt
from PySide6.QtWidgets import QMenu, QWidget

from pipegui.panels.project_tree import NodeKind
from pipegui.window.actions import Actions

_OF_ELEMENTS = ("zoom", "isolate", "hide", "show_all", "export_selection", "")
_OF_STATIONS = ("colour_by_station", "show_all", "show_stations", "", "export_shown")
CONTEXT_MENUS: dict[NodeKind, tuple[str, ...]] = {
    NodeKind.SCAN: (
        "fit",
        "show_all",
        "",
        "detect",
        "detect_in_box",
        "",
        "export_cloud",
        "rename",
        "close_scan",
    ),
    NodeKind.RUN: (*_OF_ELEMENTS, "rename", "detect_around", "delete"),
    NodeKind.ELEMENT: (
        *_OF_ELEMENTS,
        "rename",
        "kind",
        "size",
        "answer",
        "split",
        "merge",
        "",
        "detect_around",
        "delete",
    ),
    NodeKind.STATIONS: _OF_STATIONS,
    NodeKind.STATION: _OF_STATIONS,
    NodeKind.DEFORMATIONS: ("next_deformation", "export_deformations"),
    NodeKind.CANDIDATES: ("dismiss_candidates",),
    NodeKind.CANDIDATE: ("zoom", "", "accept_candidate", "dismiss_candidate"),
    NodeKind.DEFORMATION: ("zoom", "isolate", "", "answer", "", "accept", "reject", "reopen"),
}
"""Names of actions by the kind of row; "" separates."""


def show_context_menu(parent: QWidget, actions: Actions, kind: NodeKind, position: QPoint) -> None:
    """Open the menu of a selected row.

    Parameters
    ----------
    parent : QWidget
        The window.
    actions : Actions
        The window's actions.
    kind : NodeKind
        What the row stands for.
    position : QPoint
        Where the menu opens, on the screen.
    """
    menu = QMenu(parent)
    menu.setObjectName("context")
    menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
    for name in CONTEXT_MENUS[kind]:
        if name:
            menu.addAction(actions[name])
        else:
            menu.addSeparator()
    menu.popup(position)
