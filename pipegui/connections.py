"""Which signal leads to which command, and which view shows which part of the state."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from pipecore.settings import LengthUnit
from pipecore.types import ReviewState
from pipegui.controllers import file_dialogs
from pipegui.controllers.autosave import Autosave
from pipegui.controllers.clicks import Clicks
from pipegui.controllers.cloud_exports import CloudExports
from pipegui.controllers.element_edits import ElementEdits
from pipegui.controllers.exports import Exports
from pipegui.controllers.hovering import Hovering
from pipegui.controllers.preferences import Preferences
from pipegui.controllers.project_session import ProjectSession
from pipegui.controllers.rereading import Rereading
from pipegui.controllers.scans import Scans
from pipegui.controllers.session import Session
from pipegui.controllers.settings_files import SettingsFiles
from pipegui.controllers.text_columns import TextColumns
from pipegui.controllers.view_updates import ViewUpdates
from pipegui.i18n.texts import LANGUAGES, tr
from pipegui.model import commands, element_commands, selection_commands, view_commands
from pipegui.model.document import Background, ColourBy, Tool
from pipegui.style.theme import Appearance
from pipegui.window.action_table import VIEW_OPTIONS
from pipegui.window.context_menu import show_context_menu
from pipegui.window.main_window import MainWindow
from pipegui.work.crash_guard import CrashGuard
from pipegui.work.previews import Previews

STANDARD_VIEWS = ("top", "bottom", "front", "back", "right", "left", "iso")


@dataclass(frozen=True)
class Controllers:
    """All controllers of a session."""

    scans: Scans
    rereading: Rereading
    columns: TextColumns
    cloud_exports: CloudExports
    project: ProjectSession
    element_edits: ElementEdits
    clicks: Clicks
    hovering: Hovering
    exports: Exports
    settings_files: SettingsFiles
    preferences: Preferences
    autosave: Autosave | None
    """None where no copies of unsaved work are kept."""


def handlers(
    window: MainWindow, session: Session, controllers: Controllers
) -> Mapping[str, Callable[..., object]]:
    """Return what each action of the menus does, by the action's name."""
    do, scene, panels = session.do, window.views.scene, window.panels
    scans, project, exports = controllers.scans, controllers.project, controllers.exports
    edits, preferences = controllers.element_edits, controllers.preferences
    found: dict[str, Callable[..., object]] = {
        "open": scans.ask_open,
        "open_text": controllers.columns.ask_open,
        "change_columns": controllers.columns.change_active,
        "open_project": project.ask_open,
        "save": project.save,
        "save_as": project.save_as,
        "close_scan": scans.close_active,
        "join_scans": controllers.rereading.join_all,
        "load_settings": controllers.settings_files.load,
        "save_settings": controllers.settings_files.save,
        "quit": window.close,
        "undo": session.undo,
        "redo": session.redo,
        "go_up": lambda: do(view_commands.escape),
        "clip": lambda _: do(view_commands.switch_clip),
        "clip_to_selection": lambda: do(view_commands.clip_to_selection),
        "invert_clip": lambda _: do(view_commands.invert_clip),
        "next_profile": lambda: do(view_commands.step_stack_profile, 1),
        "previous_profile": lambda: do(view_commands.step_stack_profile, -1),
        "measure": lambda _: do(view_commands.choose_tool, Tool.MEASURE),
        "coordinates": lambda _: do(view_commands.choose_tool, Tool.COORDINATES),
        "delete_measurement": lambda: do(view_commands.delete_measurement, -1),
        "delete_measurements": lambda: do(view_commands.delete_measurements),
        "rename": panels.rename_in_tree,
        "delete": edits.delete,
        "merge": edits.merge,
        "split": edits.split,
        "kind": edits.kind,
        "size": edits.size,
        "answer": edits.answer,
        "detect_around": edits.detect_around,
        "detect_in_box": edits.detect_in_box,
        "accept": lambda: edits.review(ReviewState.ACCEPTED),
        "reject": lambda: edits.review(ReviewState.REJECTED),
        "reopen": lambda: edits.review(ReviewState.OPEN),
        "accept_candidate": edits.accept_candidate,
        "dismiss_candidate": edits.dismiss_candidate,
        "dismiss_candidates": lambda: do(element_commands.dismiss_all_candidates),
        "hide": edits.hide,
        "zoom": scene.show_selection,
        "fit": scene.fit,
        "next_panel": lambda: window.go_to_next_panel(1),
        "previous_panel": lambda: window.go_to_next_panel(-1),
        "next_scan": lambda: do(commands.step_scan),
        "detect": scans.detect,
        "cancel": session.jobs.cancel,
        "add_stack": panels.open_stack_editor,
        "reset_settings": lambda: do(commands.reset_settings),
        "next_deformation": lambda: do(selection_commands.step_deformation, 1),
        "previous_deformation": lambda: do(selection_commands.step_deformation, -1),
        "colour_by_station": lambda: do(commands.set_colour, ColourBy.STATION),
        "isolate": lambda: do(commands.isolate),
        "show_all": lambda: do(commands.show_all),
        "export_cloud": controllers.cloud_exports.export_cloud,
        "export_shown": controllers.cloud_exports.export_shown,
        "export_selection": controllers.cloud_exports.export_selection,
        "export_report": exports.export_report,
        "export_picture": exports.export_picture,
        "demo": scans.open_demo,
        "search_actions": window.search_actions,
        "shortcuts": window.show_shortcuts,
        "about": window.show_about,
        "fit_limits": lambda: do(view_commands.fit_limits),
    }
    for table in ("deformations", "elements", "profiles"):
        found[f"export_{table}"] = lambda table=table: exports.export_table(table)
    for name in STANDARD_VIEWS:
        found[f"view_{name}"] = lambda name=name: scene.set_standard_view(name)
    for size in ("larger", "smaller", "usual"):
        found[f"{size}_points"] = lambda size=size: do(view_commands.set_point_size, size)
    for background in Background:
        name = f"background_{background.name.lower()}"
        # A click on the one that is chosen chooses it again.
        found[name] = lambda _, b=background: do(commands.set_view, background=b)
    for unit in LengthUnit:
        # A click on the one that is chosen chooses it again.
        found[f"unit_{unit}"] = lambda _, u=unit: controllers.rereading.in_unit(u)
    for appearance in Appearance:
        name = f"appearance_{appearance.name.lower()}"
        found[name] = lambda _, a=appearance: preferences.choose_appearance(a)
    for code in LANGUAGES:
        name = f"language_{code or 'system'}"
        found[name] = lambda _, c=code: preferences.choose_language(c)
    for name in VIEW_OPTIONS:
        found[name] = lambda on, name=name: do(commands.set_view, **{name: on})
    return found


def consumers(window: MainWindow, previews: Previews) -> Mapping[str, Callable[[Any], object]]:
    """Return who shows each part of a `ViewState`, by the part's name."""
    panels, views = window.panels, window.views
    return {
        "window": window.apply,
        "tree": panels.tree.apply,
        "stacks": panels.stacks.apply,
        "planning": previews.apply,
        "settings": panels.settings.apply,
        "table": panels.table.apply,
        "clip": panels.clip.apply,
        "profile_bar": panels.profiles.apply,
        "properties": window.apply_properties,
        "radius_plot": views.radius_plot.apply,
        "section": views.section.apply,
        "map": views.map.apply,
        "scene": views.scene.apply,
    }


def connect_panels(window: MainWindow, session: Session, controllers: Controllers) -> None:
    """Connect the panels and the tool bar."""
    do, panels, bar = session.do, window.panels, window.tool_bar
    edits, scans = controllers.element_edits, controllers.scans
    panels.welcome.open_requested.connect(scans.ask_open)
    panels.welcome.demo_requested.connect(scans.open_demo)
    panels.tree.chosen.connect(controllers.clicks.click_row)
    panels.tree.marked.connect(lambda ids: do(element_commands.mark_elements, ids))
    panels.tree.renamed.connect(edits.name)
    panels.tree.menu_requested.connect(
        lambda kind, position: show_context_menu(window, window.actions_, kind, position)
    )
    panels.tree.visibility_changed.connect(lambda ids, hide: do(commands.set_hidden, ids, hide))
    panels.tree.stations_hidden.connect(
        lambda ids, hide: do(commands.set_stations_hidden, ids, hide)
    )
    panels.table.chosen.connect(lambda i: do(selection_commands.select_deformation, i))
    panels.table.reviewed.connect(lambda ids, state: do(commands.set_review, ids, state))
    panels.table.commented.connect(lambda i, text: do(commands.set_comment, i, text))
    panels.settings.changed.connect(lambda k, v: do(commands.change_settings, {k: v}))
    panels.settings.keys_reset.connect(lambda keys: do(commands.reset_keys, keys))
    panels.settings.presets.chosen.connect(lambda settings: do(commands.apply_preset, settings))
    panels.settings.presets.failed.connect(lambda text: session.show_message(text, "error"))
    panels.settings.reset_requested.connect(lambda: do(commands.reset_settings))
    panels.stacks.preset_chosen.connect(lambda preset: do(commands.set_preset, preset))
    panels.stacks.added.connect(lambda stack: do(commands.add_stack, stack))
    panels.stacks.edited.connect(lambda i, stack: do(commands.edit_stack, i, stack))
    panels.stacks.removed.connect(lambda i: do(commands.remove_stack, i))
    panels.stacks.shown.connect(lambda i: do(commands.show_stack, i))
    panels.stacks.setting_changed.connect(lambda k, v: do(commands.change_settings, {k: v}))
    panels.stacks.points_wanted.connect(lambda: do(view_commands.choose_tool, Tool.MEASURE))
    panels.stacks.points_taken.connect(lambda: do(view_commands.end_measuring))
    panels.clip.changed.connect(lambda box: do(view_commands.set_clip_box, box))
    panels.clip.whole_requested.connect(lambda: do(view_commands.clip_to_scan))
    panels.clip.selection_requested.connect(lambda: do(view_commands.clip_to_selection))
    panels.clip.inverted.connect(lambda: do(view_commands.invert_clip))
    panels.clip.closed.connect(lambda: do(commands.set_view, clip_box=None))
    panels.profiles.chosen.connect(lambda i: do(view_commands.show_profile, i))
    panels.profiles.stepped.connect(lambda by: do(view_commands.step_stack_profile, by))
    bar.colour_chosen.connect(lambda colour: do(commands.set_colour, colour))
    bar.limits_chosen.connect(lambda limits: do(view_commands.set_limits, limits))
    bar.limit_chosen.connect(lambda mm: do(commands.set_view, deviation_limit_mm=mm))


def connect_views(window: MainWindow, session: Session, controllers: Controllers) -> None:
    """Connect the 3D view and the plots."""
    do, views = session.do, window.views
    clicks, hovering = controllers.clicks, controllers.hovering
    views.scene.picked.connect(clicks.click_point)
    views.scene.clip_dragged.connect(lambda box: do(view_commands.set_clip_box, box))
    views.scene.measurement_closed.connect(lambda i: do(view_commands.delete_measurement, i))
    views.scene.deformation_picked.connect(lambda i: do(selection_commands.select_deformation, i))
    views.scene.hovered.connect(hovering.hover_point)
    views.scene.station_hovered.connect(hovering.hover_station)
    views.radius_plot.profile_clicked.connect(
        lambda s, i: do(selection_commands.select_profile, s, i)
    )
    views.radius_plot.profile_hovered.connect(hovering.hover_profile)
    views.radius_plot.stack_chosen.connect(lambda i: do(commands.show_plot_stack, i))
    views.radius_plot.pin_toggled.connect(lambda: do(commands.toggle_pin))
    views.radius_plot.pins_cleared.connect(lambda: do(commands.set_view, pinned_elements=()))
    views.section.spot_hovered.connect(hovering.hover_spot)
    views.section.step_requested.connect(lambda by: do(selection_commands.step_profile, by))
    views.map.spot_clicked.connect(lambda s, clock: do(selection_commands.select_spot, s, clock))
    views.map.spot_hovered.connect(hovering.hover_spot)
    views.map.deformation_clicked.connect(lambda i: do(selection_commands.select_deformation, i))
    for plot in (views.radius_plot, views.section, views.map, views.preview):
        plot.save_requested.connect(
            lambda ending, plot=plot: controllers.exports.save_plot(plot, ending)
        )
    clicks.copied.connect(window.show_status)
    hovering.coordinates_changed.connect(window.status.cursor_position.setText)
    hovering.description_changed.connect(window.show_tool_tip)
    hovering.spot_changed.connect(views.scene.mark_spot)
    hovering.profile_changed.connect(views.scene.mark_profile)
    hovering.place_changed.connect(views.map.show_cursor)


def connect_previews(window: MainWindow, previews: Previews) -> None:
    """Connect the previews of stacks and profiles before a detection."""
    stacks, view = window.panels.stacks, window.views.preview
    previews.planned.connect(stacks.show_plan)
    previews.previewed.connect(view.apply)
    stacks.seen.connect(previews.set_list_visible)
    stacks.preview_wanted.connect(lambda _: window.panels.show_plot(view))
    stacks.preview_wanted.connect(previews.choose)
    view.seen.connect(previews.set_profile_visible)
    view.chosen.connect(previews.choose)
    view.step_requested.connect(previews.step)


def connect_document(window: MainWindow, session: Session, controllers: Controllers) -> None:
    """Connect what follows from a change of the document: title, menus, camera, copies."""
    project, preferences = controllers.project, controllers.preferences
    history, autosave = session.history, controllers.autosave
    session.changed.connect(lambda _: project.show_title())
    project.title_changed.connect(window.show_title)
    project.camera_read.connect(window.views.scene.set_camera)
    window.history_menu.chosen.connect(history.go_to)
    window.actions_.menus["Edit"].aboutToShow.connect(
        lambda: window.history_menu.show_steps(history.steps, history.n_done)
    )
    window.recent_files.chosen.connect(lambda path: controllers.scans.open_files([path]))
    for source in (project, controllers.scans):
        source.recent_files_changed.connect(
            lambda: window.recent_files.show_paths(file_dialogs.recent(session.stored))
        )
    window.files_dropped.connect(controllers.scans.open_files)
    controllers.scans.project_chosen.connect(project.open)
    preferences.checked.connect(window.actions_.set_checked)
    if autosave is not None:
        project.saved.connect(autosave.on_saved)
        project.recovered.connect(autosave.adopt)
        autosave.recovery_requested.connect(project.recover)


def connect_updates(
    window: MainWindow, session: Session, controllers: Controllers, updates: ViewUpdates
) -> None:
    """Connect the document to the views."""
    session.changed.connect(updates.show)
    session.refused.connect(updates.refresh)
    session.jobs.busy_changed.connect(lambda _: updates.update_actions())
    controllers.preferences.colours_changed.connect(window.refresh_icons)
    controllers.preferences.colours_changed.connect(updates.refresh)


def connect_jobs(window: MainWindow, session: Session, controllers: Controllers) -> None:
    """Connect the work in the background to status bar, message bar and document."""
    jobs, status, show = session.jobs, window.status, session.show_message
    status.cancel_requested.connect(jobs.cancel)
    jobs.started.connect(status.start)
    jobs.progressed.connect(status.progress)
    jobs.cancelling.connect(status.show_cancelling)
    jobs.part_read.connect(window.show_partial_cloud)
    jobs.ended.connect(window.end_partial_cloud)
    jobs.ended.connect(status.end)
    jobs.parallel_changed.connect(status.show_beside)
    jobs.cancelled.connect(lambda title: show(tr("{title} was cancelled.").format(title=title)))
    jobs.failed.connect(lambda message, details: show(message, "error", details))
    jobs.scan_read.connect(controllers.scans.on_scan_read)
    jobs.scan_read_again.connect(controllers.scans.on_scan_read_again)
    jobs.read_failed.connect(controllers.scans.on_read_failed)
    controllers.columns.chosen.connect(controllers.scans.read)
    jobs.detected.connect(controllers.scans.on_detected)
    jobs.edited.connect(controllers.element_edits.on_edited)
    jobs.written.connect(lambda path: show(tr("Saved “{path}”.").format(path=path)))
    if (autosave := controllers.autosave) is not None:
        jobs.detected.connect(lambda *_: autosave.save_copy())
        jobs.edited.connect(lambda _: autosave.save_copy())


def connect_crash_guard(guard: CrashGuard, session: Session, controllers: Controllers) -> None:
    """Connect unexpected exceptions to the message bar and the copy of unsaved work."""
    guard.happened.connect(lambda message, details: session.show_message(message, "error", details))
    if (autosave := controllers.autosave) is not None:
        guard.happened.connect(lambda *_: autosave.save_copy())


def connect_closing(window: MainWindow, session: Session, controllers: Controllers) -> None:
    """Connect what has to end when the window closes."""
    window.may_close = controllers.project.may_close
    window.closing.connect(controllers.preferences.close)
    window.closing.connect(session.jobs.close)
    window.closing.connect(controllers.project.close)
    if controllers.autosave is not None:
        window.closing.connect(controllers.autosave.close)
