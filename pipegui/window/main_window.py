"""The main window: views, panels, actions and bars in their places.

It shows what it is given and reports what the user does; what that means is not decided here.
"""

from collections.abc import Callable, Mapping
from pathlib import Path

from PySide6.QtCore import QSettings, Signal
from PySide6.QtGui import (
    QCloseEvent,
    QCursor,
    QDragEnterEvent,
    QDragLeaveEvent,
    QDropEvent,
)
from PySide6.QtWidgets import QMainWindow, QStackedWidget, QToolTip, QVBoxLayout, QWidget

from pipecore.settings import LengthUnit
from pipecore.types import PointCloud
from pipegui.i18n.texts import inside, tr
from pipegui.model.document import Background, Tool
from pipegui.panels.status import StatusBar
from pipegui.states import descriptions
from pipegui.states.view_state import PropertiesState, WindowState
from pipegui.style import theme
from pipegui.window.about import show_about
from pipegui.window.action_table import VIEW_OPTIONS
from pipegui.window.actions import Actions
from pipegui.window.command_palette import CommandPalette
from pipegui.window.docks import Panels, arrange, restore_layout, store_layout
from pipegui.window.list_menus import HistoryMenu, RecentFilesMenu
from pipegui.window.panel_focus import RaiseFocusedDock, go_to_next_panel
from pipegui.window.shortcut_list import ShortcutList
from pipegui.window.toolbar import ToolBar
from pipegui.window.views import Views


class MainWindow(QMainWindow):
    """The shell around the views.

    Parameters
    ----------
    views : Views
        The 3D view and the plots.
    stored : QSettings
        Where the layout is kept from one start to the next.
    """

    files_dropped = Signal(list)
    """Paths of files."""
    closing = Signal()
    """The window closes now: work in the background has to end."""

    def __init__(self, views: Views, stored: QSettings) -> None:
        super().__init__()
        self.setObjectName("pipegui")
        self.setWindowTitle("PipeGUI")
        self.setAcceptDrops(True)
        self.views, self._stored = views, stored
        self.may_close: Callable[[], bool] = lambda: True
        """Asked before the window closes; may open a question and say no."""
        self.panels = Panels.make()
        self.actions_ = Actions(self)
        self.tool_bar = ToolBar(self.actions_)
        self.addToolBar(self.tool_bar)
        self.status = StatusBar()
        self.setStatusBar(self.status)
        self.centre = QStackedWidget()
        self._place_centre()
        arrange(self, self.panels, views, self.actions_.menus["Panels"])
        restore_layout(self, self.panels.docks, stored)
        self.recent_files, self.history_menu = RecentFilesMenu(self), HistoryMenu(self)
        file_menu, save = self.actions_.menus["File"], self.actions_["save"]
        file_menu.insertMenu(save, self.recent_files)
        file_menu.insertSeparator(save)
        self.actions_.menus["Edit"].insertMenu(self.actions_["go_up"], self.history_menu)
        self._palette: CommandPalette | None = None
        self._has_scan = False
        RaiseFocusedDock(self.panels.docks.values(), self)

    def _place_centre(self) -> None:
        panels = self.panels
        self.centre.addWidget(panels.welcome)
        self.centre.addWidget(self.views.scene)
        column = QVBoxLayout(centre := QWidget())
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        column.addWidget(panels.message)
        column.addWidget(self.centre, 1)
        column.addWidget(panels.profiles)
        column.addWidget(panels.clip)
        self.setCentralWidget(centre)

    # What it is given to show

    def apply(self, state: WindowState) -> None:
        """Show the scene or the welcome, and check marks as the view options have them."""
        self._has_scan = state.scan is not None
        self.centre.setCurrentWidget(self.views.scene if self._has_scan else self.panels.welcome)
        self.tool_bar.apply(state)
        self.status.apply(state)
        check = self.actions_.set_checked
        for name in VIEW_OPTIONS:
            check(name, bool(getattr(state.view, name)))
        if state.view.eye_dome is None:
            check("eye_dome", self.views.scene.shades_edges)
        box = state.view.clip_box
        check("clip", box is not None)
        check("invert_clip", box is not None and box.is_inverted)
        check("measure", state.view.tool is Tool.MEASURE)
        check("coordinates", state.view.tool is Tool.COORDINATES)
        for background in Background:
            check(f"background_{background.name.lower()}", background is state.view.background)
        for unit in LengthUnit:
            is_read_in = state.scan is not None and state.scan.reading.length_unit is unit
            check(f"unit_{unit}", is_read_in)

    def apply_properties(self, state: PropertiesState) -> None:
        """Show the properties of what is selected, and head the plots with its name."""
        self.panels.properties.apply(state)
        result = state.scan.result if state.scan else None
        title = descriptions.title(result, state.selection)
        self.panels.docks["Element"].setWindowTitle(title or "Element")

    def apply_actions(self, conditions: Mapping[str, bool], undo: str, redo: str) -> None:
        """Enable the actions that make sense now.

        Parameters
        ----------
        conditions : mapping
            What actions may need, and whether it is there.
        undo, redo : str
            The steps that would be undone and redone, "" for none.
        """
        self.actions_.update({**conditions, "undo": bool(undo), "redo": bool(redo)})
        undo_text = tr("Undo {what}").format(what=inside(tr(undo))) if undo else tr("Undo")
        redo_text = tr("Redo {what}").format(what=inside(tr(redo))) if redo else tr("Redo")
        self.actions_["undo"].setText(undo_text)
        self.actions_["redo"].setText(redo_text)

    def show_title(self, name: str, has_unsaved_work: bool) -> None:
        """Show in the title what is worked on, and whether it is saved."""
        self.setWindowTitle(f"{name}[*] – PipeGUI" if name else "PipeGUI")
        self.setWindowModified(bool(name) and has_unsaved_work)

    def show_partial_cloud(self, part: PointCloud) -> None:
        """Show what was read so far of the first scan."""
        if not self._has_scan:
            self.centre.setCurrentWidget(self.views.scene)
            self.views.scene.show_partial_cloud(part)

    def end_partial_cloud(self) -> None:
        """Show no more of what was read so far: it comes as a scan, or not at all."""
        self.views.scene.hide_partial_cloud()
        if not self._has_scan:
            self.centre.setCurrentWidget(self.panels.welcome)

    def show_tool_tip(self, text: str) -> None:
        """Show a text beside the cursor in the 3D view; "" hides it."""
        if text:
            QToolTip.showText(QCursor.pos(), text, self.views.scene)
        else:
            QToolTip.hideText()

    def show_status(self, text: str) -> None:
        """Show a text in the status bar for a moment."""
        self.status.showMessage(text, 4000)

    def refresh_icons(self) -> None:
        """Draw all icons in the colours that the theme has now."""
        theme.refresh_icons(self)
        self.panels.welcome.refresh_icons()

    # What it does on its own

    def go_to_next_panel(self, by: int) -> None:
        """Give the focus to the next (+1) or previous (-1) panel."""
        panels = [self.centre, *self.panels.docks.values()]
        go_to_next_panel(panels, self.focusWidget(), by)

    def search_actions(self) -> None:
        """Open the command palette."""
        if self._palette is None:
            self._palette = CommandPalette(self, self.actions_.entries)
        self._palette.open()

    def show_shortcuts(self) -> None:
        """List all shortcuts."""
        ShortcutList(self, self.actions_).show()

    def show_about(self) -> None:
        """Say which version this is."""
        show_about(self)

    # Qt

    def dragEnterEvent(self, event: QDragEnterEvent) -> None:  # noqa: N802
        """Accept files that are held over the window."""
        if any(url.isLocalFile() for url in event.mimeData().urls()):
            event.acceptProposedAction()
            self.panels.welcome.show_dragging(True)

    def dragLeaveEvent(self, event: QDragLeaveEvent) -> None:  # noqa: N802
        """Show no more that files would be accepted."""
        self.panels.welcome.show_dragging(False)

    def dropEvent(self, event: QDropEvent) -> None:  # noqa: N802
        """Report dropped files."""
        self.panels.welcome.show_dragging(False)
        urls = [url for url in event.mimeData().urls() if url.isLocalFile()]
        self.files_dropped.emit([Path(url.toLocalFile()) for url in urls])

    def closeEvent(self, event: QCloseEvent) -> None:  # noqa: N802
        """Store the layout, have the work ended, release VTK while its context is there."""
        if not self.may_close():
            event.ignore()
            return
        store_layout(self, self._stored)
        self.closing.emit()
        self.views.scene.close()
        super().closeEvent(event)
