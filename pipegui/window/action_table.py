"""All actions of the window in one table: what people read, and where it stands in the menus.

An action is a name, its texts, and what has to be there for it to make sense. What it does is
given by name to `pipegui.window.actions.Actions`, so that the table stays a table.
"""

from dataclasses import dataclass, replace

from pipecore.settings import LengthUnit
from pipegui.i18n.texts import LANGUAGES
from pipegui.model.document import Background
from pipegui.states.unit_texts import UNIT_NAMES
from pipegui.style import theme


@dataclass(frozen=True)
class ActionSpec:
    """One action; `needs` are conditions that must hold, by the names of `Actions.update`."""

    name: str
    text: str
    tip: str
    icon: str = ""
    shortcut: str = ""
    needs: str = ""
    is_checkable: bool = False
    submenu: str = ""
    """Title of the menu within the menu in which it stands."""


_A = ActionSpec
_SEPARATOR = None


def _option(name: str, text: str, tip: str, shortcut: str = "") -> ActionSpec:
    return ActionSpec(name, text, tip, "", shortcut, "scan", is_checkable=True)


def _background(background: Background) -> ActionSpec:
    name = f"background_{background.name.lower()}"
    tip = "What lies behind the points"
    return ActionSpec(name, str(background), tip, is_checkable=True)


def _appearance(appearance: theme.Appearance) -> ActionSpec:
    name = f"appearance_{appearance.name.lower()}"
    tip = "Colours of the window"
    return ActionSpec(name, str(appearance), tip, is_checkable=True)


def _language(code: str) -> ActionSpec:
    name, tip = f"language_{code or 'system'}", "Language of the window"
    return ActionSpec(name, LANGUAGES[code], tip, is_checkable=True)


def _unit(unit: LengthUnit) -> ActionSpec:
    tip = "Read the scan anew with its coordinates in this unit"
    return ActionSpec(f"unit_{unit}", UNIT_NAMES[unit], tip, "", "", "scan", is_checkable=True)


def _inside(title: str, *specs: ActionSpec) -> tuple[ActionSpec, ...]:
    """Put actions into a menu within the menu."""
    return tuple(replace(spec, submenu=title) for spec in specs)


MENUS: dict[str, tuple[ActionSpec | None, ...]] = {
    "File": (
        _A("open", "Open…", "Open laser scans", "folder-open-outline", "Ctrl+O"),
        _A(
            "open_text",
            "Open text with columns…",
            "Open text files and say what their columns hold",
            "table-column",
        ),
        _A("open_project", "Open project…", "Open saved work", "", "Ctrl+Shift+O"),
        _A(
            "save",
            "Save project",
            "Keep results, edits, reviews and settings in one file",
            "content-save-outline",
            "Ctrl+S",
            "scan",
        ),
        _A(
            "save_as",
            "Save project as…",
            "Keep the work as another file",
            "",
            "Ctrl+Shift+S",
            "scan",
        ),
        _SEPARATOR,
        _A("close_scan", "Close scan", "Close the active scan", "close", "Ctrl+W", "scan"),
        _SEPARATOR,
        _A("load_settings", "Load settings…", "Take the settings of a TOML file", "tune-variant"),
        _A("save_settings", "Save settings…", "Save the settings as a TOML file"),
        _SEPARATOR,
        _A("quit", "Quit", "Close the window", "", "Ctrl+Q"),
    ),
    "Edit": (
        _A("undo", "Undo", "Take the last step back", "undo", "Ctrl+Z", "undo"),
        _A("redo", "Redo", "Do it again", "redo", "Ctrl+Shift+Z", "redo"),
        _SEPARATOR,
        _A("rename", "Rename", "Name the selected element or scan", "", "F2", "scan"),
        _A("delete", "Delete", "Delete the selected elements", "delete-outline", "Del", "elements"),
        _A(
            "merge",
            "Merge elements",
            "Make one of the selected elements on one line or arc",
            "set-merge",
            "Ctrl+M",
            "several_elements idle",
        ),
        _A("split", "Split element…", "Cut the element", "set-split", "", "one_element idle"),
        _A(
            "kind",
            "Kind of element…",
            "Set whether it is a pipe, a bend or a fitting",
            "",
            "",
            "one_element idle",
        ),
        _A("size", "Nominal size…", "Set its catalogue size", "", "", "one_element"),
        _A(
            "answer",
            "Answer…",
            "Answer what the acceptance rules ask: on a weld, a whole joint, clad, …",
            "",
            "",
            "one_element",
        ),
        _SEPARATOR,
        _A(
            "go_up",
            "Select parent",
            "Select what contains the selection",
            "arrow-up",
            "Esc",
            "escape",
        ),
    ),
    "View": (
        _A("fit", "Fit to view", "Show the whole scan", "fit-to-screen-outline", "F", "scan"),
        _A(
            "zoom",
            "Zoom to selection",
            "Move the camera to the selection",
            "magnify-plus-outline",
            "Z",
            "selection",
        ),
        *_inside(
            "Standard views",
            _A("view_top", "From above", "Look down", "axis-z-arrow", "7", "scan"),
            _A("view_bottom", "From below", "Look up", "", "Ctrl+7", "scan"),
            _A("view_front", "From the south", "Look along +Y", "axis-y-arrow", "1", "scan"),
            _A("view_back", "From the north", "Look along −Y", "", "Ctrl+1", "scan"),
            _A("view_right", "From the east", "Look along −X", "axis-x-arrow", "3", "scan"),
            _A("view_left", "From the west", "Look along +X", "", "Ctrl+3", "scan"),
            _A("view_iso", "From a corner", "Look from a corner", "axis-arrow", "0", "scan"),
        ),
        _option(
            "is_parallel", "Orthographic", "Parallel projection: equal lengths look equal", "5"
        ),
        _option("fly", "Fly to the selection", "Move the camera to what is selected"),
        _SEPARATOR,
        _option("show_points", "Points", "Show the points", "P"),
        _option("show_axes", "Axes", "Show the axes of the elements", "A"),
        _option("show_ellipses", "Ellipses", "Show the ellipses of the profiles", "E"),
        _option("show_surfaces", "Fitted surfaces", "Show the fitted shapes, translucent", "S"),
        _option("show_labels", "Labels", "Name the deformations in the 3D view", "L"),
        _option("show_stations", "Scanner positions", "Mark where the scanner stood"),
        *_inside(
            "Profiles of a stack",
            _A(
                "next_profile",
                "Next profile of the stack",
                "Go on to the next one",
                "",
                ".",
                "stack",
            ),
            _A(
                "previous_profile",
                "Previous profile of the stack",
                "Go back to the one before",
                "",
                ",",
                "stack",
            ),
        ),
        *_inside(
            "Drawing of points",
            _A("larger_points", "Larger points", "Draw points larger", "", "+", "scan"),
            _A("smaller_points", "Smaller points", "Draw points smaller", "", "-", "scan"),
            _A(
                "usual_points",
                "Default point size",
                "Draw points at their default size",
                "",
                "",
                "scan",
            ),
            _A(
                "colour_by_station",
                "Colour by station",
                "Give the points of each station a colour of their own",
                "",
                "",
                "stations",
            ),
            _option(
                "eye_dome",
                "Eye-dome lighting (EDL)",
                "Darken steps in depth: shapes show without colour",
            ),
        ),
        _A(
            "fit_limits",
            "Auto colour range",
            "Set the colour range so that it holds nearly all points",
            "",
            "",
            "scan",
        ),
        _SEPARATOR,
        _A(
            "clip",
            "Clip box",
            "Show only what is in a box; drag its faces",
            "crop-free",
            "B",
            "scan",
            is_checkable=True,
        ),
        _A(
            "clip_to_selection",
            "Clip to the selection",
            "Show only what is around the selection",
            "crop",
            "Shift+B",
            "selection",
        ),
        _A(
            "invert_clip",
            "Invert clip box",
            "Show what is outside the box instead of what is in it",
            "",
            "Ctrl+B",
            "box",
            is_checkable=True,
        ),
        _A(
            "measure",
            "Measure distance",
            "Measure between two points",
            "ruler",
            "M",
            "scan",
            is_checkable=True,
        ),
        _A(
            "coordinates",
            "Pick coordinates",
            "Click a point to see and copy its coordinates",
            "crosshairs-gps",
            "C",
            "scan",
            is_checkable=True,
        ),
        *_inside(
            "Measurements",
            _A(
                "delete_measurement",
                "Delete last measurement",
                "Take the last measurement away",
                "",
                "Backspace",
                "measured",
            ),
            _A(
                "delete_measurements",
                "Delete all measurements",
                "Take all measurements away",
                "",
                "",
                "measured",
            ),
        ),
        _SEPARATOR,
        *_inside("Background", *(_background(b) for b in Background)),
        *_inside("Appearance", *(_appearance(a) for a in theme.Appearance)),
        *_inside("Language", *(_language(code) for code in LANGUAGES)),
        *_inside(
            "Panels",
            _A("next_panel", "Next panel", "Give the keyboard to the next panel", "", "F6"),
            _A("previous_panel", "Previous panel", "Back to the panel before", "", "Shift+F6"),
        ),
    ),
    "Cloud": (
        _A("next_scan", "Next scan", "Look at the next open scan", "", "Ctrl+Tab", "scans"),
        _A(
            "join_scans",
            "Join all scans",
            "Take all open scans as one cloud, each of them a station",
            "set-merge",
            "",
            "scans",
        ),
        _SEPARATOR,
        _A(
            "change_columns",
            "Columns of the text…",
            "Say what the columns of the scan's text file hold, and read it anew",
            "table-column",
            "",
            "text",
        ),
        *_inside("Length unit", *(_unit(unit) for unit in LengthUnit)),
    ),
    "Detect": (
        _A(
            "detect",
            "Detect",
            "Find pipes and their deformations",
            "magnify-scan",
            "Ctrl+D",
            "scan idle",
        ),
        _A(
            "detect_around",
            "Detect again around the selection",
            "Find the elements around the selected ones anew, with the present settings",
            "magnify-scan",
            "",
            "elements idle",
        ),
        _A(
            "detect_in_box",
            "Detect again in the box",
            "Find the elements in the clipping box anew, with the present settings",
            "",
            "",
            "result box idle",
        ),
        _A("cancel", "Cancel", "Stop what is running", "stop-circle-outline", "Ctrl+.", "busy"),
        _SEPARATOR,
        _A("add_stack", "Add stack…", "Cut along one more direction", "layers-plus"),
        _A("reset_settings", "Reset settings", "Back to the defaults", "restore"),
    ),
    "Review": (
        _A(
            "next_deformation",
            "Next deformation",
            "The next one, the worst first",
            "chevron-right",
            "N",
            "deformations",
        ),
        _A(
            "previous_deformation",
            "Previous deformation",
            "The one before",
            "chevron-left",
            "Shift+N",
            "deformations",
        ),
        _SEPARATOR,
        _A(
            "accept",
            "Accept deformation",
            "Mark it as acceptable",
            "check",
            "Ctrl+Return",
            "deformation",
        ),
        _A(
            "reject",
            "Reject deformation",
            "Mark it as not acceptable",
            "close",
            "Ctrl+Backspace",
            "deformation",
        ),
        _A("reopen", "Leave deformation open", "Mark it as not yet decided", "", "", "deformation"),
        _SEPARATOR,
        _A(
            "accept_candidate",
            "Accept as element",
            "Measure what was not accepted like any other element",
            "check",
            "",
            "candidate idle",
        ),
        _A(
            "dismiss_candidate",
            "Dismiss",
            "Take it from the list of what was not accepted",
            "close",
            "",
            "candidate",
        ),
        _A(
            "dismiss_candidates",
            "Dismiss all that was not accepted",
            "Empty the list of what was not accepted",
            "",
            "",
            "candidates",
        ),
        _SEPARATOR,
        _A("isolate", "Isolate", "Hide all but the selection", "eye-outline", "I", "elements"),
        _A("hide", "Hide", "Hide the selection", "eye-off-outline", "H", "elements"),
        _A("show_all", "Show all", "Show what is hidden", "eye-check-outline", "Shift+I", "hidden"),
    ),
    "Export": (
        _A(
            "export_report",
            "Report folder…",
            "All tables, the classified cloud and a report to print",
            "file-chart-outline",
            "Ctrl+E",
            "result idle",
        ),
        _SEPARATOR,
        *_inside(
            "Points",
            _A(
                "export_cloud",
                "Whole cloud…",
                "Write the scan as LAS, LAZ, PLY or E57",
                "scatter-plot-outline",
                "",
                "scan",
            ),
            _A(
                "export_shown",
                "What is shown…",
                "Write the points in the clip box that are not hidden",
                "",
                "",
                "part",
            ),
            _A(
                "export_selection",
                "Selected elements…",
                "Write the points of the selected elements",
                "",
                "",
                "elements",
            ),
        ),
        _SEPARATOR,
        _A(
            "export_deformations",
            "Deformations as CSV…",
            "The table of deformations",
            "file-delimited-outline",
            needs="result",
        ),
        _A("export_elements", "Elements as CSV…", "The table of elements", needs="result"),
        _A("export_profiles", "Profiles as CSV…", "The table of profiles", needs="result"),
        _SEPARATOR,
        _A(
            "export_picture", "Picture…", "Save what the 3D view shows", "image-outline", "", "scan"
        ),
    ),
    "Help": (
        _A("demo", "Try the demo", "Open the demo scan", "play-circle-outline"),
        _A(
            "search_actions",
            "Search actions…",
            "Find an action by its name",
            "magnify",
            "Ctrl+Shift+P",
        ),
        _A("shortcuts", "Keyboard shortcuts", "List all keys", "keyboard-outline", "F1"),
        _SEPARATOR,
        _A("about", "About PipeGUI", "Version and licences", "information-outline"),
    ),
}

VIEW_OPTIONS = (
    "show_points",
    "show_axes",
    "show_ellipses",
    "show_surfaces",
    "show_labels",
    "show_stations",
    "fly",
    "is_parallel",
    "eye_dome",
)
"""Actions that switch the field of `ViewOptions` with their name."""

SPECS = tuple(spec for menu in MENUS.values() for spec in menu if spec is not None)
