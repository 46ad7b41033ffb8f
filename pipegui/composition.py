"""Making a window with its session and controllers, and connecting them."""

from dataclasses import dataclass
from pathlib import Path

from PySide6.QtCore import QSettings

from pipegui import connections
from pipegui.connections import Controllers
from pipegui.controllers import file_dialogs
from pipegui.controllers.autosave import Autosave
from pipegui.controllers.clicks import Clicks
from pipegui.controllers.cloud_exports import CloudExports
from pipegui.controllers.element_edits import ElementEdits
from pipegui.controllers.exports import Exports
from pipegui.controllers.hovering import Hovering
from pipegui.controllers.preferences import Preferences
from pipegui.controllers.project_session import ProjectSession
from pipegui.controllers.remembered_choices import remember_choices, remember_tab
from pipegui.controllers.rereading import Rereading
from pipegui.controllers.scans import Scans
from pipegui.controllers.session import Session
from pipegui.controllers.settings_files import SettingsFiles
from pipegui.controllers.text_columns import TextColumns
from pipegui.controllers.view_updates import ViewUpdates
from pipegui.model.presets import Presets
from pipegui.window.main_window import MainWindow
from pipegui.window.views import Views
from pipegui.work.job_queue import JobQueue
from pipegui.work.previews import Previews


@dataclass(frozen=True)
class Application:
    """A window, what it works on, and those that act for it."""

    window: MainWindow
    session: Session
    controllers: Controllers


def compose(
    views: Views, jobs: JobQueue, stored: QSettings, copies: Path | None = None
) -> Application:
    """Make a window and all that works for it.

    Parameters
    ----------
    views : Views
        The 3D view and the plots.
    jobs : JobQueue
        Reads and detects.
    stored : QSettings
        What is remembered from one start of the program to the next.
    copies : Path, optional
        Folder for copies of unsaved work; none are made without it.

    Returns
    -------
    Application
        Not yet shown. All goes when its window is deleted.
    """
    window = MainWindow(views, stored)
    panels = window.panels
    session = Session(jobs, stored, panels.message, window)
    project = ProjectSession(session, window, views.scene.camera)
    autosave = None
    if copies is not None:
        autosave = Autosave(
            session, copies, project.saving, project.snapshot, lambda: project.has_unsaved_work
        )
    rereading = Rereading(session)
    columns = TextColumns(session, window, rereading)
    controllers = Controllers(
        Scans(session, window, rereading, columns),
        rereading,
        columns,
        CloudExports(session, window),
        project,
        ElementEdits(session, window),
        Clicks(session),
        Hovering(session),
        Exports(session, window, views.scene.screenshot),
        SettingsFiles(session, window),
        Preferences(session),
        autosave,
    )
    previews = Previews(jobs, window)
    updates = ViewUpdates(session, connections.consumers(window, previews), window.apply_actions)
    window.actions_.connect(connections.handlers(window, session, controllers))
    connections.connect_panels(window, session, controllers)
    connections.connect_views(window, session, controllers)
    connections.connect_previews(window, previews)
    connections.connect_updates(window, session, controllers, updates)
    connections.connect_document(window, session, controllers)
    connections.connect_jobs(window, session, controllers)
    connections.connect_closing(window, session, controllers)

    panels.settings.presets.use(Presets(file_dialogs.preset_folder()))
    panels.stacks.editor.view_direction = views.scene.view_direction
    remember_choices(
        stored,
        {
            "radius": views.radius_plot,
            "section": views.section,
            "columns": panels.table.columns,
            "filters": panels.table.filters,
        },
    )
    remember_tab(stored, panels.plots)
    updates.refresh()
    window.recent_files.show_paths(file_dialogs.recent(stored))
    controllers.preferences.restore_appearance()
    controllers.preferences.show_language()
    return Application(window, session, controllers)
