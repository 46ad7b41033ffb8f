"""The main window: signals of the parts become commands, states go back to the parts."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from PySide6.QtCore import QSettings
from PySide6.QtGui import QCloseEvent, QCursor, QDragEnterEvent, QDropEvent
from PySide6.QtWidgets import QApplication, QMainWindow, QStackedWidget, QToolTip

from pipecore.errors import PipecoreError
from pipecore.report.summary import summarise
from pipecore.types import PointCloud, Result
from pipegui import commands, describe, files, theme
from pipegui.actions import Actions
from pipegui.document import Document, Scan
from pipegui.history import History
from pipegui.jobs import Jobs
from pipegui.layout import LAYOUT_VERSION, Panels, arrange
from pipegui.menu_actions import MenuActions
from pipegui.panels.project_tree import NodeKind
from pipegui.panels.status import StatusBar
from pipegui.parts import Parts
from pipegui.toolbar import ToolBar
from pipegui.view_state import PropertiesState, ViewState, WindowState, resolve

VIEW_OPTIONS = ("show_points", "show_axes", "show_ellipses", "show_surfaces", "show_labels", "fly")


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
    """

    def __init__(self, parts: Parts, jobs: Jobs, stored: QSettings) -> None:
        super().__init__()
        self.setObjectName("pipegui")
        self.setWindowTitle("PipeGUI")
        self.setAcceptDrops(True)
        self.parts, self.jobs, self.stored = parts, jobs, stored
        self.history = History(changed=self._show)
        self._state = ViewState()
        self.panels = Panels.make()
        self.menu_actions = MenuActions(self)
        self.actions_ = Actions(self, self._handlers())
        self.tool_bar = ToolBar(self.actions_)
        self.addToolBar(self.tool_bar)
        self.status = StatusBar()
        self.setStatusBar(self.status)
        self.centre = QStackedWidget()
        arrange(self)
        self.menu_actions.list_recent()
        self._connect_parts()
        self._connect_jobs()
        QApplication.styleHints().colorSchemeChanged.connect(self._change_scheme)
        self._apply(resolve(self.history.document), everything=True)

    # Signals become commands

    def _handlers(self) -> Mapping[str, Callable[..., None]]:
        do, menu = self.do, self.menu_actions
        handlers: dict[str, Callable[..., None]] = {
            "open": menu.open,
            "close_scan": lambda: do(commands.close_scan, self.document.active),
            "load_settings": menu.load_settings,
            "save_settings": menu.save_settings,
            "quit": self.close,
            "undo": self.history.undo,
            "redo": self.history.redo,
            "go_up": lambda: do(commands.select_parent),
            "fit": self.parts.scene.fit,
            "next_scan": lambda: do(
                commands.activate_scan, (self.document.active + 1) % len(self.document.scans)
            ),
            "detect": self.detect,
            "cancel": self.jobs.cancel,
            "add_stack": self.panels.open_stack_editor,
            "reset_settings": lambda: do(commands.reset_settings),
            "next_deformation": lambda: do(commands.step_deformation, 1),
            "previous_deformation": lambda: do(commands.step_deformation, -1),
            "isolate": lambda: do(commands.isolate),
            "show_all": lambda: do(commands.show_all),
            "export_report": menu.export_report,
            "export_deformations": lambda: menu.export_table("deformations"),
            "export_elements": lambda: menu.export_table("elements"),
            "export_profiles": lambda: menu.export_table("profiles"),
            "export_picture": menu.export_picture,
            "demo": menu.open_demo,
            "shortcuts": menu.show_shortcuts,
            "about": menu.show_about,
        }
        for name in ("top", "front", "right", "iso"):
            handlers[f"view_{name}"] = lambda name=name: self.parts.scene.set_standard_view(name)
        for name in VIEW_OPTIONS:
            handlers[name] = lambda on, name=name: do(commands.set_view, **{name: on})
        return handlers

    def _connect_parts(self) -> None:
        do, panels, parts = self.do, self.panels, self.parts
        panels.welcome.open_requested.connect(self.menu_actions.open)
        panels.welcome.demo_requested.connect(self.menu_actions.open_demo)
        panels.tree.chosen.connect(self._choose_in_tree)
        panels.tree.visibility_changed.connect(
            lambda ids, hidden: do(commands.set_hidden, ids, hidden)
        )
        panels.table.chosen.connect(lambda i: do(commands.select_deformation, i))
        panels.settings.changed.connect(lambda k, v: do(commands.change_settings, {k: v}))
        panels.settings.reset_requested.connect(lambda: do(commands.reset_settings))
        panels.stacks.preset_chosen.connect(lambda p: do(commands.set_preset, p))
        panels.stacks.added.connect(lambda d: do(commands.add_stack, d))
        panels.stacks.edited.connect(lambda i, d: do(commands.edit_stack, i, d))
        panels.stacks.removed.connect(lambda i: do(commands.remove_stack, i))
        panels.stacks.shown.connect(lambda i: do(commands.show_stack, i))
        if hasattr(parts.scene, "view_direction"):
            panels.stacks.editor.view_direction = parts.scene.view_direction
        parts.scene.picked.connect(lambda i: do(commands.select_point, i))
        parts.scene.deformation_picked.connect(lambda i: do(commands.select_deformation, i))
        parts.scene.hovered.connect(self._hover)
        parts.radius_plot.profile_clicked.connect(
            lambda stack, index: do(commands.select_profile, stack, index)
        )
        parts.radius_plot.stack_chosen.connect(lambda i: do(commands.show_plot_stack, i))
        parts.section.step_requested.connect(lambda by: do(commands.step_profile, by))
        parts.map.spot_clicked.connect(lambda s, clock: do(commands.select_spot, s, clock))
        parts.map.deformation_clicked.connect(lambda i: do(commands.select_deformation, i))
        self.tool_bar.colour_chosen.connect(lambda c: do(commands.set_colour, c))
        self.tool_bar.limit_chosen.connect(lambda mm: do(commands.set_view, deviation_limit_mm=mm))
        self.status.cancel_requested.connect(self.jobs.cancel)

    def _connect_jobs(self) -> None:
        jobs, tell = self.jobs, self.panels.message.tell
        jobs.started.connect(self.status.start)
        jobs.progressed.connect(self.status.progress)
        jobs.cancelling.connect(self.status.show_cancelling)
        jobs.ended.connect(self.status.end)
        jobs.busy_changed.connect(lambda _: self._update_actions())
        jobs.cancelled.connect(lambda title: tell(f"{title} was cancelled."))
        jobs.failed.connect(lambda message, details: tell(message, "error", details))
        jobs.scan_read.connect(self._take_scan)
        jobs.detected.connect(self._take_result)
        jobs.written.connect(lambda path: tell(f"Saved “{path}”."))

    @property
    def document(self) -> Document:
        """The present document."""
        return self.history.document

    def do(self, command: Callable[..., Document], *args: Any, **kwargs: Any) -> None:
        """Carry out a command; what it objects to is told, and nothing changes."""
        try:
            self.history.do(command, *args, **kwargs)
        except PipecoreError as error:
            self.panels.message.tell(str(error), "warning")
            self._apply(self._state, everything=True)

    # Work

    def open_files(self, paths: list[Path]) -> None:
        """Read scans in the background."""
        self.jobs.open_files(paths, self.document.settings)

    def detect(self) -> None:
        """Detect on the active scan in the background."""
        # A number still being typed counts: it becomes a setting when its field is left.
        if (field := self.focusWidget()) is not None:
            field.clearFocus()
        if self.document.scan is not None:
            self.jobs.detect(self.document.scan.cloud, self.document.settings)

    def _take_scan(self, scan: Scan) -> None:
        self.panels.message.hide()
        self.do(commands.open_scan, scan)
        if scan.cloud.source is not None:
            files.remember(self.stored, scan.cloud.source)
            self.menu_actions.list_recent()

    def _take_result(self, cloud: PointCloud, result: Result) -> None:
        self.do(commands.set_result, cloud, result)
        hint = "" if result.elements else ". Check the length unit and the smallest radius"
        seconds = sum(result.seconds.values())
        took = f" Detected in {seconds:.0f} s." if seconds >= 1 else ""
        severity = "info" if result.elements else "warning"
        self.panels.message.tell(f"{summarise(result)}{hint}.{took}", severity)

    def _choose_in_tree(self, scan_index: int, kind: NodeKind, item_id: int) -> None:
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

    def _hover(self, point_index: int) -> None:
        scan = self.document.scan
        if scan is None or point_index < 0:
            self.status.cursor_position.clear()
            QToolTip.hideText()
            return
        self.status.cursor_position.setText(describe.coordinates(scan.cloud, point_index))
        text = describe.hover_text(scan, point_index)
        QToolTip.showText(QCursor.pos(), text, self.parts.scene)

    # States go to the parts

    def _show(self, document: Document) -> None:
        self._apply(resolve(document))

    def _apply(self, state: ViewState, *, everything: bool = False) -> None:
        before, self._state = self._state, state
        for name, part in self._consumers().items():
            if everything or getattr(state, name) != getattr(before, name):
                part(getattr(state, name))
        self._update_actions()

    def _consumers(self) -> dict[str, Callable[[Any], None]]:
        panels, parts = self.panels, self.parts
        return {
            "window": self._apply_window,
            "tree": panels.tree.apply,
            "stacks": panels.stacks.apply,
            "settings": panels.settings.apply,
            "table": panels.table.apply,
            "properties": self._apply_properties,
            "radius_plot": parts.radius_plot.apply,
            "section": parts.section.apply,
            "map": parts.map.apply,
            "scene": parts.scene.apply,
        }

    def _apply_window(self, state: WindowState) -> None:
        has_scan = state.scan is not None
        self.setWindowTitle(f"{state.scan.name} – PipeGUI" if state.scan else "PipeGUI")
        self.centre.setCurrentWidget(self.parts.scene if has_scan else self.panels.welcome)
        self.tool_bar.apply(state)
        self.status.apply(state)
        for name in VIEW_OPTIONS:
            self.actions_.set_checked(name, getattr(state.view, name))

    def _apply_properties(self, state: PropertiesState) -> None:
        self.panels.properties.apply(state)
        result = state.scan.result if state.scan else None
        title = describe.title(result, state.selection)
        self.panels.docks["Element"].setWindowTitle(title or "Element")

    def _update_actions(self) -> None:
        document, busy = self.document, self.jobs.is_busy
        self.actions_.update(
            {
                "scan": document.scan is not None,
                "scans": len(document.scans) > 1,
                "result": document.result is not None,
                "deformations": bool(document.result and document.result.deformations),
                "selection": self._state.window.has_selection,
                "hidden": bool(document.view.hidden_elements),
                "busy": busy,
                "idle": not busy,
                "undo": bool(self.history.undo_text),
                "redo": bool(self.history.redo_text),
            }
        )
        for name in ("undo", "redo"):
            what = getattr(self.history, f"{name}_text")
            self.actions_[name].setText(f"{name.capitalize()} {what.lower()}".strip())

    # Qt

    def _change_scheme(self) -> None:
        app = QApplication.instance()
        if isinstance(app, QApplication):
            theme.apply_theme(app)
        self.actions_.refresh_icons()
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
        self.stored.setValue("window/geometry", self.saveGeometry())
        self.stored.setValue("window/state", self.saveState(LAYOUT_VERSION))
        QApplication.styleHints().colorSchemeChanged.disconnect(self._change_scheme)
        self.jobs.close()
        self.parts.scene.close()
        super().closeEvent(event)
