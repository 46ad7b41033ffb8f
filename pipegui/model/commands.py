"""What the user can do to a document: functions from a document to the next one.

A command with `undo_text` is a step that can be undone; the others (view, selection)
change the present document only.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeVar

from pipecore.settings import JUDGING_KEYS, DirectionPreset, Settings
from pipecore.types import NO_ID, PointCloud, Result, Review, ReviewState
from pipegui.i18n.texts import mark
from pipegui.model import presets
from pipegui.model.colour_limits import has_contrast
from pipegui.model.document import (
    ColourBy,
    Document,
    Scan,
    Selection,
    Tool,
    ViewOptions,
)
from pipegui.model.selection import (
    carry_over_reviews,
    carry_over_selection,
    elements_of,
    selection_of_deformation,
    worst_deformation,
)
from pipegui.model.selection_commands import select_parent
from pipegui.model.stations import has_stations

Command = TypeVar("Command", bound=Callable[..., Document])

MAX_PINNED = 6
"""Elements that can be compared in one plot."""

NEEDS_RESULT = {
    ColourBy.SEGMENT,
    ColourBy.ELEMENT,
    ColourBy.KIND,
    ColourBy.DEVIATION,
    ColourBy.PROFILE,
    ColourBy.VERDICT,
}


def step(undo_text: str | Callable[..., str]) -> Callable[[Command], Command]:
    """Mark a command as a step of the history, and name the step.

    Parameters
    ----------
    undo_text : str or callable
        The name; a function gets the command's arguments before the command is carried out.
    """

    def marked(command: Command) -> Command:
        command.undo_text = undo_text  # type: ignore[attr-defined]
        return command

    return marked


# Scans and results


@step(mark("Open"))
def open_scan(document: Document, scan: Scan) -> Document:
    """Add a scan and make it the active one."""
    return activate_scan(replace(document, scans=(*document.scans, scan)), len(document.scans))


@step(mark("Close"))
def close_scan(document: Document, index: int) -> Document:
    """Remove a scan; the one before it becomes active."""
    scans = document.scans[:index] + document.scans[index + 1 :]
    return activate_scan(replace(document, scans=scans, active=0), max(index - 1, 0))


@step(mark("Read again"))
def replace_scan(document: Document, cloud: PointCloud, scan: Scan) -> Document:
    """Put a scan in the place of the one with `cloud`; nothing changes if that was closed."""
    return _put_in_place(document, [cloud], scan)


@step(mark("Join scans"))
def join_scans(document: Document, clouds: Sequence[PointCloud], scan: Scan) -> Document:
    """Put one scan in the place of those with these clouds, and colour it by its stations."""
    joined = _put_in_place(document, clouds, scan)
    is_told = joined is not document and has_stations(scan.cloud)
    return set_colour(joined, ColourBy.STATION) if is_told else joined


def _put_in_place(document: Document, clouds: Sequence[PointCloud], scan: Scan) -> Document:
    gone = {id(cloud) for cloud in clouds}
    places = [i for i, other in enumerate(document.scans) if id(other.cloud) in gone]
    if not places:
        return document
    scans = [other for other in document.scans if id(other.cloud) not in gone]
    scans.insert(places[0], scan)
    return activate_scan(replace(document, scans=tuple(scans)), places[0])


def activate_scan(document: Document, index: int) -> Document:
    """Make another scan the active one."""
    document = replace(document, active=index, selection=Selection())
    view = replace(
        document.view,
        hidden_elements=frozenset(),
        hidden_stations=frozenset(),
        shown_stack=NO_ID,
        shown_profile=None,
        pinned_elements=(),
        clip_box=None,
        tool=Tool.SELECT,
        measurements=(),
        measuring_from=None,
        height_limits=None,
        intensity_limits=None,
    )
    if document.scan is not None and view.colour_by not in colours_of(document.scan):
        view = replace(view, colour_by=colours_of(document.scan)[0])
    return replace(document, view=view)


def step_scan(document: Document) -> Document:
    """Make the next open scan the active one."""
    return activate_scan(document, (document.active + 1) % max(len(document.scans), 1))


@step(mark("Detect"))
def set_result(document: Document, cloud: PointCloud, result: Result) -> Document:
    """Set the result of a detection on `cloud`; keep the selection, else select the worst dent.

    Nothing changes if the scan has been closed meanwhile.
    """
    index = next((i for i, scan in enumerate(document.scans) if scan.cloud is cloud), None)
    if index is None:
        return document
    old = document.scans[index].result
    scans = list(document.scans)
    reviews = carry_over_reviews(scans[index].reviews, old, result)
    scans[index] = replace(scans[index], result=result, reviews=reviews)
    selection = document.selection
    if index == document.active:
        selection = carry_over_selection(selection, old, result)
        if selection == Selection():
            selection = selection_of_deformation(result, worst_deformation(result))
    view = document.view
    if index == document.active:
        is_kept = view.colour_by in NEEDS_RESULT or not result.elements
        colour = view.colour_by if is_kept else ColourBy.DEVIATION
        view = replace(view, colour_by=colour, hidden_elements=frozenset(), shown_stack=NO_ID)
        view = replace(view, pinned_elements=())  # their numbers mean others now
        if colour is ColourBy.PROFILE:
            view = replace(view, colour_by=ColourBy.DEVIATION)
    return replace(document, scans=tuple(scans), selection=selection, view=view)


# Reviewing


@step(mark("Review"))
def set_review(document: Document, deformation_ids: Iterable[int], state: ReviewState) -> Document:
    """Accept deformations, reject them, or leave them open again."""
    return _reviewed(document, {i: {"state": state} for i in deformation_ids})


@step(mark("Comment"))
def set_comment(document: Document, deformation_id: int, comment: str) -> Document:
    """Set the comment on a deformation."""
    return _reviewed(document, {deformation_id: {"comment": comment.strip()}})


def _reviewed(document: Document, changes: Mapping[int, Mapping[str, Any]]) -> Document:
    scan = document.scan
    if scan is None:
        return document
    changed = {i: replace(scan.review(i), **change) for i, change in changes.items()}
    reviews = {i: r for i, r in (dict(scan.reviews) | changed).items() if r != Review()}
    if reviews == scan.reviews:
        return document
    return _with_scan(document, replace(scan, reviews=reviews))


def _with_scan(document: Document, scan: Scan) -> Document:
    """Put a scan in the place of the active one."""
    scans = list(document.scans)
    scans[document.active] = scan
    return replace(document, scans=tuple(scans))


def colours_of(scan: Scan) -> tuple[ColourBy, ...]:
    """Return what a scan's points can be coloured by, the most useful first."""
    has = {
        ColourBy.RGB: scan.cloud.rgb is not None,
        ColourBy.INTENSITY: scan.cloud.intensity is not None and has_contrast(scan.cloud),
        ColourBy.HEIGHT: True,
        ColourBy.STATION: has_stations(scan.cloud),
    } | dict.fromkeys(
        (
            ColourBy.DEVIATION,
            ColourBy.VERDICT,
            ColourBy.ELEMENT,
            ColourBy.KIND,
            ColourBy.SEGMENT,
            ColourBy.PROFILE,
        ),
        scan.result is not None,
    )
    return tuple(colour for colour, there in has.items() if there)


# Settings and stacks


@step(mark("Change settings"))
def change_settings(document: Document, changes: Mapping[str, Any]) -> Document:
    """Change settings by dotted key; raises `SettingsError` if a value does not fit."""
    return _with_settings(document, document.settings.replace(changes))


def _with_settings(document: Document, settings: Settings) -> Document:
    """The document with other settings; those of judging judge all results at once."""
    changes = {
        key: settings.get(key)
        for key in JUDGING_KEYS
        if settings.get(key) != document.settings.get(key)
    }
    document = replace(document, settings=settings)
    if not changes or not any(scan.result is not None for scan in document.scans):
        return document
    from pipecore.editing import judge_again  # noqa: PLC0415 - loads numba

    judged = (
        scan if scan.result is None else replace(scan, result=judge_again(scan.result, changes))
        for scan in document.scans
    )
    return replace(document, scans=tuple(judged))


@step(mark("Reset settings"))
def reset_settings(document: Document) -> Document:
    """Reset all settings to their defaults, except the user's own stacks."""
    stacks = {"stacks.directions": document.settings.stacks.directions}
    return _with_settings(document, Settings().replace(stacks))


@step(mark("Reset settings"))
def reset_keys(document: Document, keys: Iterable[str]) -> Document:
    """Reset some settings to their defaults, by dotted key."""
    defaults = Settings()
    return change_settings(document, {key: defaults.get(key) for key in keys})


@step(mark("Preset"))
def apply_preset(document: Document, settings: Settings) -> Document:
    """Apply a preset, except to settings that depend on the scan."""
    return _with_settings(document, presets.applied(document.settings, settings))


@step(mark("Load settings"))
def load_settings(document: Document, settings: Settings) -> Document:
    """Replace all settings."""
    return _with_settings(document, settings)


@step(mark("Change directions"))
def set_preset(document: Document, preset: DirectionPreset) -> Document:
    """Set which stacks are cut in addition to the user's own."""
    return change_settings(document, {"stacks.preset": preset})


@step(mark("Add stack"))
def add_stack(document: Document, direction: tuple[float, ...]) -> Document:
    """Add a stack of the user's own: (x, y, z) or (x, y, z, width in mm)."""
    directions = (*document.settings.stacks.directions, direction)
    return change_settings(document, {"stacks.directions": directions})


@step(mark("Edit stack"))
def edit_stack(document: Document, index: int, direction: tuple[float, ...]) -> Document:
    """Change one of the user's own stacks."""
    directions = list(document.settings.stacks.directions)
    directions[index] = direction
    return change_settings(document, {"stacks.directions": tuple(directions)})


@step(mark("Remove stack"))
def remove_stack(document: Document, index: int) -> Document:
    """Remove one of the user's own stacks."""
    directions = document.settings.stacks.directions
    directions = directions[:index] + directions[index + 1 :]
    return change_settings(document, {"stacks.directions": directions})


# Looking


def set_view(document: Document, **changes: Any) -> Document:
    """Change how things are shown, by the names of `ViewOptions`."""
    return replace(document, view=replace(document.view, **changes))


def show_stack(document: Document, stack_id: int) -> Document:
    """Show one stack's profiles in colour; `NO_ID` goes back to the deviation."""
    colour_by = ColourBy.DEVIATION if stack_id == NO_ID else ColourBy.PROFILE
    return set_view(document, shown_stack=stack_id, shown_profile=None, colour_by=colour_by)


def set_colour(document: Document, colour_by: ColourBy) -> Document:
    """Set what points are coloured by; for profiles, the first stack if none is shown yet."""
    if colour_by is ColourBy.PROFILE and document.result is not None:
        stacks = document.result.stacks
        shown = document.view.shown_stack or (stacks[0].stack_id if stacks else NO_ID)
        return set_view(document, colour_by=colour_by, shown_stack=shown)
    return set_view(document, colour_by=colour_by, shown_stack=NO_ID, shown_profile=None)


def show_plot_stack(document: Document, stack_id: int) -> Document:
    """Set the stack of the radius plot; a selected profile of another stack is deselected."""
    document = set_view(document, plot_stack=stack_id)
    profile = document.selection.profile
    if profile is not None and profile.stack_id != stack_id:
        return select_parent(document)
    return document


def toggle_pin(document: Document) -> Document:
    """Pin the selected element in the radius plot, or unpin it; at most `MAX_PINNED` stay."""
    element_id, pinned = document.selection.element_id, document.view.pinned_elements
    if not element_id:
        return document
    if element_id in pinned:
        pinned = tuple(i for i in pinned if i != element_id)
    else:
        pinned = (*pinned, element_id)[-MAX_PINNED:]
    return set_view(document, pinned_elements=pinned)


@step(mark("Show or hide"))
def set_hidden(document: Document, element_ids: Iterable[int], hidden: bool) -> Document:
    """Hide elements, or show them again."""
    before, ids = document.view.hidden_elements, frozenset(element_ids)
    return set_view(document, hidden_elements=before | ids if hidden else before - ids)


@step(mark("Show or hide"))
def set_stations_hidden(document: Document, station_ids: Iterable[int], hidden: bool) -> Document:
    """Hide the points of stations, or show them again."""
    before, ids = document.view.hidden_stations, frozenset(station_ids)
    return set_view(document, hidden_stations=before | ids if hidden else before - ids)


@step(mark("Isolate"))
def isolate(document: Document) -> Document:
    """Hide all elements but those of the selection."""
    result, selection = document.result, document.selection
    if result is None:
        return document
    kept = set(elements_of(result, selection))
    if not kept:
        return document
    hidden = frozenset(e.element_id for e in result.elements) - kept
    return set_view(document, hidden_elements=hidden)


@step(mark("Show all"))
def show_all(document: Document) -> Document:
    """Show all hidden elements and stations again."""
    return set_view(document, hidden_elements=frozenset(), hidden_stations=frozenset())


def after_undo(present: Document, target: Document) -> Document:
    """Return `target` with the view and selection of `present`: undo changes the work only."""
    if present.scan is None or target.scan is None:
        return target
    if present.scan.cloud is not target.scan.cloud:
        return target
    view: ViewOptions = replace(
        present.view,
        hidden_elements=target.view.hidden_elements,
        hidden_stations=target.view.hidden_stations,
    )
    if view.colour_by not in colours_of(target.scan):
        view = replace(view, colour_by=target.view.colour_by, shown_stack=NO_ID)
    selection = carry_over_selection(present.selection, present.result, target.result)
    return replace(target, view=view, selection=selection)
