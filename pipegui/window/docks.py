"""Where everything stands in the main window, as UI drawings have it."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from PySide6.QtCore import Qt, QTimer
from PySide6.QtWidgets import QDockWidget, QTabWidget, QVBoxLayout, QWidget

from pipegui.i18n.texts import mark, tr
from pipegui.panels.clip_bar import ClipBar
from pipegui.panels.deformation_table import DeformationTable
from pipegui.panels.message_bar import MessageBar
from pipegui.panels.profile_bar import ProfileBar
from pipegui.panels.project_tree import ProjectTree
from pipegui.panels.properties import PropertiesPanel
from pipegui.panels.settings_form import SettingsForm
from pipegui.panels.stacks_panel import StacksPanel
from pipegui.panels.welcome import Welcome

if TYPE_CHECKING:
    from pipegui.window.main_window import MainWindow

LEFT = Qt.DockWidgetArea.LeftDockWidgetArea
RIGHT = Qt.DockWidgetArea.RightDockWidgetArea
BOTTOM = Qt.DockWidgetArea.BottomDockWidgetArea
LAYOUT_VERSION = 1


@dataclass
class Panels:
    """The panels around the 3D view."""

    tree: ProjectTree
    stacks: StacksPanel
    settings: SettingsForm
    properties: PropertiesPanel
    table: DeformationTable
    message: MessageBar
    welcome: Welcome
    clip: ClipBar
    profiles: ProfileBar
    docks: dict[str, QDockWidget]
    plots: QTabWidget | None = None

    @classmethod
    def make(cls) -> "Panels":
        """Make the panels, not yet placed."""
        return cls(
            ProjectTree(),
            StacksPanel(),
            SettingsForm(),
            PropertiesPanel(),
            DeformationTable(),
            MessageBar(),
            Welcome(),
            ClipBar(),
            ProfileBar(),
            {},
        )

    def show_plot(self, widget: QWidget) -> None:
        """Bring a plot forward."""
        assert self.plots is not None
        self.docks["Element"].show()
        self.docks["Element"].raise_()
        self.plots.setCurrentWidget(widget)

    def open_stack_editor(self) -> None:
        """Bring the stacks panel forward with its editor open."""
        self.docks["Stacks"].show()
        self.docks["Stacks"].raise_()
        self.stacks.add()


def arrange(window: "MainWindow") -> None:
    """Place the panels and views in docks around the centre, as they were left last time."""
    panels, parts = window.panels, window.parts
    window.setDockOptions(
        window.DockOption.AllowTabbedDocks
        | window.DockOption.AllowNestedDocks
        | window.DockOption.AnimatedDocks
    )
    window.setTabPosition(LEFT, QTabWidget.TabPosition.North)
    window.setCorner(Qt.Corner.BottomLeftCorner, LEFT)
    window.setCorner(Qt.Corner.BottomRightCorner, BOTTOM)

    window.centre.addWidget(panels.welcome)
    window.centre.addWidget(parts.scene)
    centre = QWidget()
    column = QVBoxLayout(centre)
    column.setContentsMargins(0, 0, 0, 0)
    column.setSpacing(0)
    column.addWidget(panels.message)
    column.addWidget(window.centre, 1)
    column.addWidget(panels.profiles)
    column.addWidget(panels.clip)
    window.setCentralWidget(centre)

    panels.plots = plots = QTabWidget()
    plots.setObjectName("plots")
    plots.setDocumentMode(True)
    for title, widget in (
        (tr("Radius"), parts.radius_plot),
        (tr("Map"), parts.map),
        (tr("Section"), parts.section),
        (tr("Preview"), parts.preview),
    ):
        plots.addTab(widget, title)
    # A click on a tab means the plot: the arrow keys are then its own, not the tabs'.
    plots.tabBar().setFocusPolicy(Qt.FocusPolicy.TabFocus)
    plots.tabBarClicked.connect(lambda i: plots.widget(i).setFocus() if i >= 0 else None)

    _dock(window, mark("Project"), panels.tree, LEFT)
    _dock(window, mark("Stacks"), panels.stacks, LEFT)
    _dock(window, mark("Settings"), panels.settings, LEFT)
    _dock(window, mark("Element"), plots, RIGHT)
    _dock(window, mark("Properties"), panels.properties, RIGHT)
    _dock(window, mark("Deformations"), panels.table, BOTTOM)
    docks = panels.docks
    window.tabifyDockWidget(docks["Stacks"], docks["Settings"])
    docks["Stacks"].raise_()

    panel_menu = window.actions_.menus["Panels"]
    panel_menu.addSeparator()
    for dock in docks.values():
        panel_menu.addAction(dock.toggleViewAction())
    _restore(window)


def _dock(window: "MainWindow", title: str, widget: QWidget, area: Qt.DockWidgetArea) -> None:
    dock = QDockWidget(tr(title), window)
    dock.setObjectName(title)
    dock.setWidget(widget)
    window.panels.docks[title] = dock
    window.addDockWidget(area, dock)


def _restore(window: "MainWindow") -> None:
    geometry, state = (window.stored.value(f"window/{name}") for name in ("geometry", "state"))
    if geometry is None or not window.restoreGeometry(geometry):
        available = window.screen().availableGeometry()
        window.resize(min(1600, available.width()), min(1000, available.height()))
    if state is not None and window.restoreState(state, LAYOUT_VERSION):
        return
    # Docks take sizes only once the window has been laid out.
    QTimer.singleShot(0, window, lambda: _set_default_sizes(window))


def _set_default_sizes(window: "MainWindow") -> None:
    width, height = window.width(), window.height()
    docks = window.panels.docks
    across, down = Qt.Orientation.Horizontal, Qt.Orientation.Vertical
    sides = [max(248, width * 17 // 100), max(328, width * 27 // 100)]
    window.resizeDocks([docks["Project"], docks["Element"]], sides, across)
    window.resizeDocks([docks["Deformations"]], [max(190, height * 22 // 100)], down)
    halves = [height * 55 // 100, height * 45 // 100]
    window.resizeDocks([docks["Project"], docks["Stacks"]], halves, down)
    # Plots need the height more than a list does.
    share = 65 if height > 900 else 75
    plots = [height * share // 100, height * (100 - share) // 100]
    window.resizeDocks([docks["Element"], docks["Properties"]], plots, down)
