"""The docks: which panel and plot stands where in the main window."""

from dataclasses import dataclass, field

from PySide6.QtCore import QSettings, Qt, QTimer
from PySide6.QtWidgets import QDockWidget, QMainWindow, QMenu, QTabWidget, QWidget

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
from pipegui.window.views import Views

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
    plots: QTabWidget
    """The plots, a tab each."""
    docks: dict[str, QDockWidget] = field(default_factory=dict)
    """By their titles in English."""

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
            QTabWidget(),
        )

    def show_plot(self, widget: QWidget) -> None:
        """Bring a plot forward."""
        self._raise("Element")
        self.plots.setCurrentWidget(widget)

    def open_stack_editor(self) -> None:
        """Bring the stacks panel forward with its editor open."""
        self._raise("Stacks")
        self.stacks.add()

    def rename_in_tree(self) -> None:
        """Bring the project tree forward, and let the user name what is selected in it."""
        self._raise("Project")
        self.tree.rename()

    def _raise(self, title: str) -> None:
        self.docks[title].show()
        self.docks[title].raise_()


def arrange(window: QMainWindow, panels: Panels, views: Views, panel_menu: QMenu) -> None:
    """Put the panels and plots into docks around the window's centre.

    Parameters
    ----------
    window : QMainWindow
        Takes the docks.
    panels, views : Panels, Views
        What is put into them; `panels.docks` is filled.
    panel_menu : QMenu
        Takes an action for each dock that shows or hides it.
    """
    window.setDockOptions(
        QMainWindow.DockOption.AllowTabbedDocks
        | QMainWindow.DockOption.AllowNestedDocks
        | QMainWindow.DockOption.AnimatedDocks
    )
    window.setTabPosition(LEFT, QTabWidget.TabPosition.North)
    window.setCorner(Qt.Corner.BottomLeftCorner, LEFT)
    window.setCorner(Qt.Corner.BottomRightCorner, BOTTOM)
    _fill_tabs(panels.plots, views)
    for title, widget, area in (
        (mark("Project"), panels.tree, LEFT),
        (mark("Stacks"), panels.stacks, LEFT),
        (mark("Settings"), panels.settings, LEFT),
        (mark("Element"), panels.plots, RIGHT),
        (mark("Properties"), panels.properties, RIGHT),
        (mark("Deformations"), panels.table, BOTTOM),
    ):
        dock = QDockWidget(tr(title), window)
        dock.setObjectName(title)
        dock.setWidget(widget)
        panels.docks[title] = dock
        window.addDockWidget(area, dock)
    window.tabifyDockWidget(panels.docks["Stacks"], panels.docks["Settings"])
    panels.docks["Stacks"].raise_()
    panel_menu.addSeparator()
    for dock in panels.docks.values():
        panel_menu.addAction(dock.toggleViewAction())


def _fill_tabs(plots: QTabWidget, views: Views) -> None:
    plots.setObjectName("plots")
    plots.setDocumentMode(True)
    plots.addTab(views.radius_plot, tr("Radius"))
    plots.addTab(views.map, tr("Map"))
    plots.addTab(views.section, tr("Section"))
    plots.addTab(views.preview, tr("Preview"))
    # A click on a tab means the plot: the arrow keys are then its own, not the tabs'.
    plots.tabBar().setFocusPolicy(Qt.FocusPolicy.TabFocus)

    def focus(i: int) -> None:
        if (plot := plots.widget(i)) is not None:
            plot.setFocus()

    plots.tabBarClicked.connect(focus)


def restore_layout(window: QMainWindow, docks: dict[str, QDockWidget], stored: QSettings) -> None:
    """Place window and docks as they were left last time, else as suits the screen."""
    geometry, state = (stored.value(f"window/{name}") for name in ("geometry", "state"))
    if geometry is None or not window.restoreGeometry(geometry):
        available = window.screen().availableGeometry()
        window.resize(min(1600, available.width()), min(1000, available.height()))
    if state is not None and window.restoreState(state, LAYOUT_VERSION):
        return
    # Docks take sizes only once the window has been laid out.
    QTimer.singleShot(0, window, lambda: _set_default_sizes(window, docks))


def store_layout(window: QMainWindow, stored: QSettings) -> None:
    """Store where window and docks are."""
    stored.setValue("window/geometry", window.saveGeometry())
    stored.setValue("window/state", window.saveState(LAYOUT_VERSION))


def _set_default_sizes(window: QMainWindow, docks: dict[str, QDockWidget]) -> None:
    width, height = window.width(), window.height()
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
