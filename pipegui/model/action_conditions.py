"""Which actions make sense for a document: what they need, and whether it is there."""

from collections.abc import Mapping

from pipegui.model.document import ColourBy, Document, Selection, Tool
from pipegui.model.selection import elements_of
from pipegui.model.stations import has_stations


def action_conditions(document: Document, *, is_busy: bool) -> Mapping[str, bool]:
    """Return what actions may need, by the names in `ActionSpec.needs`.

    Parameters
    ----------
    document : Document
        What the user works on.
    is_busy : bool
        Whether something runs in the background that was asked for.
    """
    result, selection, view = document.result, document.selection, document.view
    elements = elements_of(result, selection) if result is not None else []
    has_selection = selection != Selection()
    return {
        "scan": document.scan is not None,
        "scans": len(document.scans) > 1,
        "stations": document.scan is not None and has_stations(document.scan.cloud),
        "text": document.scan is not None and document.scan.is_text,
        "result": result is not None,
        "deformations": result is not None and bool(result.deformations),
        "selection": has_selection,
        "escape": has_selection or view.tool is not Tool.SELECT,
        "elements": bool(elements),
        "one_element": bool(selection.element_id) and len(elements) == 1,
        "several_elements": len(elements) > 1 and bool(selection.others),
        "deformation": bool(selection.deformation_id),
        "candidate": bool(selection.candidate_id),
        "candidates": result is not None and bool(result.candidates),
        "stack": view.colour_by is ColourBy.PROFILE and bool(view.shown_stack),
        "box": view.clip_box is not None,
        "measured": bool(view.measurements),
        "hidden": bool(view.hidden_elements or view.hidden_stations),
        "part": bool(view.clip_box or view.hidden_elements or view.hidden_stations),
        "busy": is_busy,
        "idle": not is_busy,
    }
