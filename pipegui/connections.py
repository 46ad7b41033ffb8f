"""Which signal of the window becomes which command."""

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

from PySide6.QtGui import QGuiApplication

from pipecore.types import ReviewState
from pipegui.controllers import file_dialogs
from pipegui.controllers.remembered_choices import keep, keep_tab
from pipegui.i18n.texts import LANGUAGES, tr
from pipegui.model import commands, element_commands, result_queries, view_commands
from pipegui.model.document import Background, ProfileKey, Tool
from pipegui.model.presets import Presets
from pipegui.states import descriptions
from pipegui.style import theme
from pipegui.window.action_table import VIEW_OPTIONS
from pipegui.window.panel_focus import FocusInSight, go_to_next_panel

if TYPE_CHECKING:
    from pipegui.window.main_window import MainWindow


STANDARD_VIEWS = ("top", "bottom", "front", "back", "right", "left", "iso")


def handlers(window: "MainWindow") -> Mapping[str, Callable[..., object]]:
    """Return what each action of the menus does, by its name."""
    do, menu, scene = window.do, window.menu_actions, window.parts.scene
    edits = window.edits
    found: dict[str, Callable[..., object]] = {
        "open": menu.open,
        "open_project": window.projects.ask_open,
        "save": window.projects.save,
        "save_as": window.projects.save_as,
        "close_scan": lambda: do(commands.close_scan, window.document.active),
        "load_settings": menu.load_settings,
        "save_settings": menu.save_settings,
        "quit": window.close,
        "undo": lambda: _step_history(window, window.history.undo),
        "redo": lambda: _step_history(window, window.history.redo),
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
        "rename": edits.rename,
        "delete": edits.delete,
        "merge": edits.merge,
        "split": edits.split,
        "kind": edits.kind,
        "size": edits.size,
        "detect_around": edits.detect_around,
        "detect_in_box": edits.detect_in_box,
        "accept": lambda: edits.review(ReviewState.ACCEPTED),
        "reject": lambda: edits.review(ReviewState.REJECTED),
        "reopen": lambda: edits.review(ReviewState.OPEN),
        "hide": edits.hide,
        "zoom": scene.show_selection,
        "fit": scene.fit,
        "next_panel": lambda: go_to_next_panel(window, 1),
        "previous_panel": lambda: go_to_next_panel(window, -1),
        "next_scan": lambda: do(commands.step_scan),
        "detect": window.detect,
        "cancel": window.jobs.cancel,
        "add_stack": window.panels.open_stack_editor,
        "reset_settings": lambda: do(commands.reset_settings),
        "next_deformation": lambda: do(commands.step_deformation, 1),
        "previous_deformation": lambda: do(commands.step_deformation, -1),
        "isolate": lambda: do(commands.isolate),
        "show_all": lambda: do(commands.show_all),
        "export_report": menu.export_report,
        "export_picture": menu.export_picture,
        "demo": menu.open_demo,
        "search_actions": menu.search_actions,
        "shortcuts": menu.show_shortcuts,
        "about": menu.show_about,
        "fit_limits": lambda: do(view_commands.fit_limits),
    }
    for table in ("deformations", "elements", "profiles"):
        found[f"export_{table}"] = lambda table=table: menu.export_table(table)
    for name in STANDARD_VIEWS:
        found[f"view_{name}"] = lambda name=name: scene.set_standard_view(name)
    for size in ("larger", "smaller", "usual"):
        found[f"{size}_points"] = lambda size=size: do(view_commands.set_point_size, size)
    for background in Background:
        name = f"background_{background.name.lower()}"
        # A click on the one that is chosen chooses it again.
        found[name] = lambda _, b=background: do(commands.set_view, background=b)
    for appearance in theme.Appearance:
        name = f"appearance_{appearance.name.lower()}"
        found[name] = lambda _, a=appearance: menu.choose_appearance(a)
    for code in LANGUAGES:
        name = f"language_{code or 'system'}"
        found[name] = lambda _, c=code: menu.choose_language(c)
    for name in VIEW_OPTIONS:
        found[name] = lambda on, name=name: do(commands.set_view, **{name: on})
    return found


def connect_panels(window: "MainWindow") -> None:
    """Connect the panels and the tool bar."""
    do, panels = window.do, window.panels
    FocusInSight(window)
    panels.welcome.open_requested.connect(window.menu_actions.open)
    panels.welcome.demo_requested.connect(window.menu_actions.open_demo)
    panels.tree.chosen.connect(window.choose_in_tree)
    panels.tree.marked.connect(lambda ids: do(element_commands.mark_elements, ids))
    panels.tree.renamed.connect(window.edits.take_name)
    panels.tree.menu_requested.connect(window.edits.show_menu)
    panels.tree.visibility_changed.connect(lambda ids, hide: do(commands.set_hidden, ids, hide))
    panels.table.chosen.connect(lambda i: do(commands.select_deformation, i))
    panels.table.reviewed.connect(lambda ids, state: do(commands.set_review, ids, state))
    panels.table.commented.connect(lambda i, text: do(commands.set_comment, i, text))
    panels.settings.changed.connect(lambda k, v: do(commands.change_settings, {k: v}))
    panels.settings.keys_reset.connect(lambda keys: do(commands.reset_keys, keys))
    panels.settings.presets.chosen.connect(lambda settings: do(commands.apply_preset, settings))
    panels.settings.presets.failed.connect(lambda text: panels.message.tell(text, "error"))
    panels.settings.presets.use(Presets(file_dialogs.preset_folder()))
    panels.settings.reset_requested.connect(lambda: do(commands.reset_settings))
    panels.stacks.preset_chosen.connect(lambda preset: do(commands.set_preset, preset))
    panels.stacks.added.connect(lambda stack: do(commands.add_stack, stack))
    panels.stacks.edited.connect(lambda i, stack: do(commands.edit_stack, i, stack))
    panels.stacks.removed.connect(lambda i: do(commands.remove_stack, i))
    panels.stacks.shown.connect(lambda i: do(commands.show_stack, i))
    panels.stacks.editor.view_direction = window.parts.scene.view_direction
    panels.clip.changed.connect(lambda box: do(view_commands.set_clip_box, box))
    panels.clip.whole_requested.connect(lambda: do(view_commands.clip_to_scan))
    panels.clip.selection_requested.connect(lambda: do(view_commands.clip_to_selection))
    panels.clip.inverted.connect(lambda: do(view_commands.invert_clip))
    panels.clip.closed.connect(lambda: do(commands.set_view, clip_box=None))
    panels.profiles.chosen.connect(lambda i: do(view_commands.show_profile, i))
    panels.profiles.stepped.connect(lambda by: do(view_commands.step_stack_profile, by))
    panels.stacks.setting_changed.connect(lambda k, v: do(commands.change_settings, {k: v}))
    panels.stacks.points_wanted.connect(lambda: do(view_commands.choose_tool, Tool.MEASURE))
    panels.stacks.points_taken.connect(lambda: _take_points(window))
    bar = window.tool_bar
    bar.colour_chosen.connect(lambda colour: do(commands.set_colour, colour))
    bar.limits_chosen.connect(lambda limits: do(view_commands.set_limits, limits))
    bar.limit_chosen.connect(lambda mm: do(commands.set_view, deviation_limit_mm=mm))


def _step_history(window: "MainWindow", step: Callable[[], object]) -> None:
    """Go a step back or ahead; what was said of another step is not so any more."""
    window.panels.message.hide()
    step()


def _click(window: "MainWindow", point_index: int) -> None:
    """Do what the tool does; coordinates go to the clipboard as plain numbers too."""
    window.do(view_commands.click_point, point_index)
    scan, tool = window.document.scan, window.document.view.tool
    if tool is Tool.COORDINATES and scan is not None and point_index >= 0:
        world = scan.cloud.world(scan.cloud.xyz[point_index])
        QGuiApplication.clipboard().setText("\t".join(f"{v:.3f}" for v in world))
        window.statusBar().showMessage(
            tr("Copied: {coordinates}").format(
                coordinates=descriptions.coordinates(scan.cloud, point_index)
            ),
            4000,
        )


def connect_views(window: "MainWindow") -> None:
    """Connect the 3D view and the plots."""
    do, parts = window.do, window.parts
    parts.scene.picked.connect(lambda i: _click(window, i))
    parts.scene.clip_dragged.connect(lambda box: do(view_commands.set_clip_box, box))
    parts.scene.measurement_closed.connect(lambda i: do(view_commands.delete_measurement, i))
    parts.scene.deformation_picked.connect(lambda i: do(commands.select_deformation, i))
    parts.scene.hovered.connect(window.hover)
    parts.radius_plot.profile_clicked.connect(
        lambda stack, index: do(commands.select_profile, stack, index)
    )
    parts.radius_plot.profile_hovered.connect(lambda key: _mark_profile(window, key))
    parts.radius_plot.stack_chosen.connect(lambda i: do(commands.show_plot_stack, i))
    parts.radius_plot.pin_toggled.connect(lambda: do(commands.toggle_pin))
    parts.radius_plot.pins_cleared.connect(lambda: do(commands.set_view, pinned_elements=()))
    parts.section.spot_hovered.connect(lambda place: _mark_in_scene(window, place))
    parts.section.step_requested.connect(lambda by: do(commands.step_profile, by))
    parts.map.spot_clicked.connect(lambda s, clock: do(commands.select_spot, s, clock))
    parts.map.spot_hovered.connect(lambda place: _mark_in_scene(window, place))
    parts.scene.hovered.connect(lambda i: _mark_on_map(window, i))
    parts.map.deformation_clicked.connect(lambda i: do(commands.select_deformation, i))
    for plot in (parts.radius_plot, parts.section, parts.map, parts.preview):
        plot.save_requested.connect(
            lambda ending, plot=plot: window.menu_actions.save_plot(plot, ending)
        )


def _mark_in_scene(window: "MainWindow", place: tuple[float, float] | None) -> None:
    """Show in 3D what the cursor is at on the map."""
    result, element_id = window.document.result, window.document.selection.element_id
    spot = None
    if place is not None and result is not None and element_id:
        spot = result_queries.spot_on_surface(result, element_id, *place)
    window.parts.scene.mark_spot(spot)


def _mark_profile(window: "MainWindow", key: ProfileKey | None) -> None:
    """Show in 3D which profile the cursor is at in the radius plot."""
    result, element_id = window.document.result, window.document.selection.element_id
    profile = None
    if key is not None and result is not None and element_id:
        profile = result_queries.profile_at(result, element_id, key)
    window.parts.scene.mark_profile(profile)


def _mark_on_map(window: "MainWindow", point_index: int) -> None:
    """Show on the map what the cursor is at in 3D, if it is on the selected element."""
    scan, element_id = window.document.scan, window.document.selection.element_id
    place = None
    if scan is not None and scan.result is not None:
        place = result_queries.spot_of_point(scan.cloud, scan.result, element_id, point_index)
    window.parts.map.show_cursor(place)


def connect_previews(window: "MainWindow") -> None:
    """Connect the look at stacks and profiles before a detection."""
    previews, stacks, view = window.previews, window.panels.stacks, window.parts.preview
    previews.planned.connect(stacks.show_plan)
    previews.previewed.connect(view.apply)
    stacks.seen.connect(previews.watch_list)
    view.seen.connect(previews.watch_profile)
    view.chosen.connect(previews.choose)
    view.step_requested.connect(previews.step)

    def look(row: int) -> None:
        window.panels.show_plot(view)
        previews.choose(row)

    stacks.preview_wanted.connect(look)


def _take_points(window: "MainWindow") -> None:
    """Put the measuring tool away with the distance that gave a stack its direction."""
    window.do(view_commands.delete_measurement, -1)
    if window.document.view.tool is Tool.MEASURE:
        window.do(view_commands.choose_tool, Tool.MEASURE)


def keep_choices(window: "MainWindow") -> None:
    """Show plots and table as they were left last time."""
    parts, table = window.parts, window.panels.table
    keep(
        window.stored,
        {
            "radius": parts.radius_plot,
            "section": parts.section,
            "columns": table.columns,
            "filters": table.filters,
        },
    )
    assert window.panels.plots is not None
    keep_tab(window.stored, window.panels.plots)


def connect_jobs(window: "MainWindow") -> None:
    """Connect the long work to status bar, message bar and document."""
    jobs, status, tell = window.jobs, window.status, window.panels.message.tell
    status.cancel_requested.connect(jobs.cancel)
    jobs.started.connect(status.start)
    jobs.progressed.connect(status.progress)
    jobs.cancelling.connect(status.show_cancelling)
    jobs.glimpsed.connect(window.show_glimpse)
    jobs.ended.connect(window.end_glimpse)
    jobs.ended.connect(status.end)
    jobs.beside.connect(status.show_beside)
    jobs.busy_changed.connect(lambda _: window.update_actions())
    jobs.cancelled.connect(lambda title: tell(tr("{title} was cancelled.").format(title=title)))
    jobs.failed.connect(lambda message, details: tell(message, "error", details))
    jobs.scan_read.connect(window.take_scan)
    jobs.detected.connect(window.take_result)
    jobs.edited.connect(window.edits.take)
    if (rescue := window.projects.rescue) is not None:
        jobs.detected.connect(lambda *_: rescue.keep())
        jobs.edited.connect(lambda _: rescue.keep())
    jobs.written.connect(lambda path: tell(tr("Saved “{path}”.").format(path=path)))
