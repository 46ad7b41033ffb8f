"""Clicks into the 3D view and the tree: what they select, measure or copy."""

from PySide6.QtCore import QObject, Signal
from PySide6.QtGui import QGuiApplication

from pipegui.controllers.session import Session
from pipegui.i18n.texts import tr
from pipegui.model import commands, selection_commands, view_commands
from pipegui.model.document import Selection, Tool
from pipegui.panels.project_tree import NodeKind
from pipegui.states import descriptions

COMMANDS = {
    NodeKind.RUN: selection_commands.select_run,
    NodeKind.ELEMENT: selection_commands.select_element,
    NodeKind.DEFORMATION: selection_commands.select_deformation,
    NodeKind.CANDIDATE: selection_commands.select_candidate,
}


class Clicks(QObject):
    """Turns clicks into commands, where a click is more than one command."""

    copied = Signal(str)
    """What was put on the clipboard, in words."""

    def __init__(self, session: Session) -> None:
        super().__init__(session)
        self._session = session

    def click_point(self, point_index: int) -> None:
        """Use the chosen tool on a point of the cloud, -1 for a click beside all points.

        Picked coordinates go to the clipboard too, as plain numbers.
        """
        session = self._session
        session.do(view_commands.click_point, point_index)
        scan, tool = session.document.scan, session.document.view.tool
        if tool is Tool.COORDINATES and scan is not None and point_index >= 0:
            world = scan.cloud.world(scan.cloud.xyz[point_index])
            QGuiApplication.clipboard().setText("\t".join(f"{v:.3f}" for v in world))
            text = descriptions.coordinates(scan.cloud, point_index)
            self.copied.emit(tr("Copied: {coordinates}").format(coordinates=text))

    def click_row(self, scan_index: int, kind: NodeKind, item_id: int) -> None:
        """Select what a row of the tree stands for, in another scan if it is there."""
        session = self._session
        if scan_index != session.document.active:
            session.do(commands.activate_scan, scan_index)
        if kind in COMMANDS:
            session.do(COMMANDS[kind], item_id)
        elif kind is NodeKind.SCAN:
            session.do(selection_commands.select, Selection())
