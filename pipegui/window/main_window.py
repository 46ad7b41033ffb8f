"""The main window: signals of the parts become commands, states go back to the parts."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from PySide6.QtCore import QSettings
from PySide6.QtGui import QCloseEvent, QCursor, QDragEnterEvent, QDropEvent
from PySide6.QtWidgets import QApplication, QMainWindow, QStackedWidget, QToolTip

from pipecore.errors import PipecoreError
from pipecore.types import PointCloud, Result
from pipegui import connections as wiring
from pipegui.controllers import file_dialogs
from pipegui.controllers.element_edits import Edits, conditions
from pipegui.controllers.exports import MenuActions
from pipegui.controllers.project_session import Projects
from pipegui.i18n.texts import error_text, inside, tr
from pipegui.model import commands
from pipegui.model.document import Background, ColourBy, Document, Scan, Tool
from pipegui.model.history import History
from pipegui.panels.project_tree import NodeKind
from pipegui.panels.status import StatusBar
from pipegui.project.project_file import SUFFIX
from pipegui.states import descriptions
from pipegui.states.view_state import PropertiesState, ViewState, WindowState, resolve
from pipegui.style import theme
from pipegui.window.action_table import VIEW_OPTIONS
from pipegui.window.actions import Actions
from pipegui.window.docks import LAYOUT_VERSION, Panels, arrange
from pipegui.window.toolbar import ToolBar
from pipegui.window.views import Parts
from pipegui.work.job_queue import Jobs
from pipegui.work.previews import Previews


class MainWindow(QMainWindow):
    """Holds the history; every part hears only of what changed for it.

    Parameters
    ----------
    parts : Parts
        The 3D view and the plots.
    jobs : Jobs
        Reads and detects.
    stored : QSettings
        Keeps the window's layout and the recent files.
    rescue : Path, optional
        Folder for copies of unsaved work.
    """

    def __init__(
        self, parts: Parts, jobs: Jobs, stored: QSettings, rescue: Path | None = None
    ) -> None:
        super().__init__()
        self.setObjectName("pipegui")
        self.setWindowTitle("PipeGUI")
        self.setAcceptDrops(True)
        self.parts, self.jobs, self.stored = parts, jobs, stored
        # Qt's connections hold on to the window in a way that Python does not see: they
        # go with the jobs, and the jobs with the window.
        jobs.setParent(self)
        self.history = History(changed=self._show)
        self._state = ViewState()
        self.panels = Panels.make()
        self.previews = Previews(jobs, self)
        self.menu_actions = MenuActions(self)
        self.edits = Edits(self)
        self.projects = Projects(self, rescue)
        self.actions_ = Actions(self, wiring.handlers(self))
        self.tool_bar = ToolBar(self.actions_)
        self.addToolBar(self.tool_bar)
        self.status = StatusBar()
        self.setStatusBar(self.status)
        self.centre = QStackedWidget()
        arrange(self)
        self.menu_actions.list_recent()
        self.menu_actions.list_history()
        wiring.connect_panels(self)
        wiring.connect_views(self)
        wiring.connect_previews(self)
        wiring.connect_jobs(self)
        wiring.keep_choices(self)
        QApplication.styleHints().colorSchemeChanged.connect(self.refresh_colours)
        self._apply(resolve(self.history.document), everything=True)
        self.menu_actions.restore_appearance()
        self.menu_actions.show_language()

    @property
    def document(self) -> Document:
        """The present document."""
        return self.history.document

    def do(self, command: Callable[..., Document], *args: Any, **kwargs: Any) -> None:
        """Carry out a command; what it objects to is told, and nothing changes."""
        try:
            self.history.do(command, *args, **kwargs)
        except PipecoreError as error:
            self.panels.message.tell(error_text(error), "warning")
            self._apply(self._state, everything=True)

    # Work

    def open_files(self, paths: list[Path]) -> None:
        """Read scans in the background; of projects there is one at a time."""
        projects = [path for path in paths if path.suffix == SUFFIX]
        if projects:
            self.projects.open(projects[0])
        self.jobs.open_files([p for p in paths if p not in projects], self.document.settings)

    def detect(self) -> None:
        """Detect on the active scan in the background."""
        # A number still being typed counts: it becomes a setting when its field is left.
        if (field := self.focusWidget()) is not None:
            field.clearFocus()
        if self.document.scan is not None:
            self.jobs.detect(self.document.scan.cloud, self.document.settings)

    def show_glimpse(self, part: PointCloud) -> None:
        """Show what was read so far, unless another scan is looked at."""
        if self.document.scan is None:
            self.centre.setCurrentWidget(self.parts.scene)
            self.parts.scene.glimpse(part)

    def end_glimpse(self) -> None:
        """What was read comes as a scan now, or not at all."""
        self.parts.scene.end_glimpse()
        if self.document.scan is None:
            self.centre.setCurrentWidget(self.panels.welcome)

    def take_scan(self, scan: Scan) -> None:
        """Add a scan that was read."""
        self.panels.message.hide()
        self.do(commands.open_scan, scan)
        if scan.cloud.source is not None:
            file_dialogs.remember(self.stored, scan.cloud.source)
            self.menu_actions.list_recent()

    def take_result(self, cloud: PointCloud, result: Result) -> None:
        """Show what was detected, and say it in a line."""
        self.do(commands.set_result, cloud, result)
        hint = "" if result.elements else tr(". Check the length unit and the smallest radius")
        seconds = sum(result.seconds.values())
        took = tr(" Detected in {seconds:.0f} s.").format(seconds=seconds) if seconds >= 1 else ""
        severity = "info" if result.elements else "warning"
        # Another scan may be looked at meanwhile.
        scan = next((s for s in self.document.scans if s.cloud is cloud), None)
        whose = f"{scan.name}: " if scan is not None and scan is not self.document.scan else ""
        self.panels.message.tell(f"{whose}{descriptions.summary(result)}{hint}.{took}", severity)

    def choose_in_tree(self, scan_index: int, kind: NodeKind, item_id: int) -> None:
        """Select what was chosen in the tree, in another scan if it is there."""
        if scan_index != self.document.active:
            self.do(commands.activate_scan, scan_index)
        choose = {
            NodeKind.RUN: commands.select_run,
            NodeKind.ELEMENT: commands.select_element,
            NodeKind.DEFORMATION: commands.select_deformation,
        }.get(kind)
        if choose is not None:
            self.do(choose, item_id)
        elif kind is NodeKind.SCAN:
            self.do(commands.select, type(self.document.selection)())

    def hover(self, point_index: int) -> None:
        """Say what is under the cursor: coordinates below, name and deviation beside it."""
        scan = self.document.scan
        if scan is None or point_index < 0:
            self.status.cursor_position.clear()
            QToolTip.hideText()
            return
        self.status.cursor_position.setText(descriptions.coordinates(scan.cloud, point_index))
        text = descriptions.hover_text(scan, point_index)
        QToolTip.showText(QCursor.pos(), text, self.parts.scene)

    def tell_crash(self, message: str, details: str) -> None:
        """Say that something went wrong that should not have, and keep a copy of the work."""
        self.panels.message.tell(message, "error", details)
        if self.projects.rescue is not None:
            self.projects.rescue.keep()

    # States go to the parts

    def _show(self, document: Document) -> None:
        self._apply(resolve(document))
        self.projects.show_title()

    def _apply(self, state: ViewState, *, everything: bool = False) -> None:
        before, self._state = self._state, state
        for name, part in self._consumers().items():
            if everything or getattr(state, name) != getattr(before, name):
                part(getattr(state, name))
        self.update_actions()

    def _consumers(self) -> dict[str, Callable[[Any], None]]:
        panels, parts = self.panels, self.parts
        return {
            "window": self._apply_window,
            "tree": panels.tree.apply,
            "stacks": panels.stacks.apply,
            "planning": lambda state: self.previews.apply(state.cloud, state.settings),
            "settings": panels.settings.apply,
            "table": panels.table.apply,
            "clip": panels.clip.apply,
            "profile_bar": panels.profiles.apply,
            "properties": self._apply_properties,
            "radius_plot": parts.radius_plot.apply,
            "section": parts.section.apply,
            "map": parts.map.apply,
            "scene": parts.scene.apply,
        }

    def _apply_window(self, state: WindowState) -> None:
        has_scan = state.scan is not None
        self.centre.setCurrentWidget(self.parts.scene if has_scan else self.panels.welcome)
        self.tool_bar.apply(state)
        self.status.apply(state)
        for name in VIEW_OPTIONS:
            self.actions_.set_checked(name, bool(getattr(state.view, name)))
        if state.view.eye_dome is None:
            self.actions_.set_checked("eye_dome", self.parts.scene.shades_edges)
        box = state.view.clip_box
        self.actions_.set_checked("clip", box is not None)
        self.actions_.set_checked("invert_clip", box is not None and box.is_inverted)
        self.actions_.set_checked("measure", state.view.tool is Tool.MEASURE)
        self.actions_.set_checked("coordinates", state.view.tool is Tool.COORDINATES)
        for background in Background:
            chosen = background is state.view.background
            self.actions_.set_checked(f"background_{background.name.lower()}", chosen)

    def _apply_properties(self, state: PropertiesState) -> None:
        self.panels.properties.apply(state)
        result = state.scan.result if state.scan else None
        title = descriptions.title(result, state.selection)
        self.panels.docks["Element"].setWindowTitle(title or "Element")

    def update_actions(self) -> None:
        """Enable the actions that make sense now."""
        document, busy = self.document, self.jobs.is_busy
        view = document.view
        self.actions_.update(
            {
                "scan": document.scan is not None,
                "scans": len(document.scans) > 1,
                "result": document.result is not None,
                "deformations": bool(document.result and document.result.deformations),
                "selection": self._state.window.has_selection,
                "escape": self._state.window.has_selection or view.tool is not Tool.SELECT,
                "stack": view.colour_by is ColourBy.PROFILE and bool(view.shown_stack),
                "measured": bool(view.measurements),
                "hidden": bool(document.view.hidden_elements),
                "busy": busy,
                "idle": not busy,
                **conditions(document),
                "undo": bool(self.history.undo_text),
                "redo": bool(self.history.redo_text),
            }
        )
        undo, redo = self.history.undo_text, self.history.redo_text
        undo_text = tr("Undo {what}").format(what=inside(tr(undo))) if undo else tr("Undo")
        redo_text = tr("Redo {what}").format(what=inside(tr(redo))) if redo else tr("Redo")
        self.actions_["undo"].setText(undo_text)
        self.actions_["redo"].setText(redo_text)

    # Qt

    def refresh_colours(self) -> None:
        """Draw all in the colours that the theme has now."""
        app = QApplication.instance()
        if isinstance(app, QApplication):
            theme.apply_theme(app)
        theme.refresh_icons(self)
        self.panels.welcome.refresh_icons()
        self._apply(self._state, everything=True)

    def dragEnterEvent(self, event: QDragEnterEvent) -> None:  # noqa: N802
        """Take files that are held over the window."""
        if any(url.isLocalFile() for url in event.mimeData().urls()):
            event.acceptProposedAction()
            self.panels.welcome.show_dragging(True)

    def dragLeaveEvent(self, event: Any) -> None:  # noqa: N802
        """Forget about them."""
        self.panels.welcome.show_dragging(False)

    def dropEvent(self, event: QDropEvent) -> None:  # noqa: N802
        """Open dropped files."""
        self.panels.welcome.show_dragging(False)
        urls = [url for url in event.mimeData().urls() if url.isLocalFile()]
        self.open_files([Path(url.toLocalFile()) for url in urls])

    def closeEvent(self, event: QCloseEvent) -> None:  # noqa: N802
        """Keep the layout, stop the work, let go of VTK while its context is there."""
        if not self.projects.may_close():
            event.ignore()
            return
        self.stored.setValue("window/geometry", self.saveGeometry())
        self.stored.setValue("window/state", self.saveState(LAYOUT_VERSION))
        QApplication.styleHints().colorSchemeChanged.disconnect(self.refresh_colours)
        self.jobs.close()
        self.projects.close()
        self.parts.scene.close()
        super().closeEvent(event)
