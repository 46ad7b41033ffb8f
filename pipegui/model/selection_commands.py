"""Commands that select: what a click, a key or a row of a table leads to.

Commands as in `pipegui.model.commands`; none is a step of the history.
"""

from dataclasses import replace

import numpy as np

from pipecore.report.summary import by_verdict
from pipecore.types import NO_ID
from pipegui.model.document import Document, ProfileKey, Selection
from pipegui.model.selection import (
    selection_at_spot,
    selection_of_deformation,
    selection_of_element,
    shown_profile,
)


def select(document: Document, selection: Selection) -> Document:
    """Select something."""
    return replace(document, selection=selection)


def select_run(document: Document, run_id: int) -> Document:
    """Select a run."""
    return select(document, Selection(run_id=run_id))


def select_element(document: Document, element_id: int) -> Document:
    """Select an element."""
    if document.result is None:
        return document
    return select(document, selection_of_element(document.result, element_id))


def select_deformation(document: Document, deformation_id: int) -> Document:
    """Select a deformation and its element."""
    if document.result is None:
        return document
    return select(document, selection_of_deformation(document.result, deformation_id))


def select_candidate(document: Document, candidate_id: int) -> Document:
    """Select what was not accepted."""
    return select(document, Selection(candidate_id=candidate_id))


def select_point(document: Document, point_index: int) -> Document:
    """Select the element of a point of the cloud; nothing for -1."""
    if document.result is None:
        return document
    element_id = NO_ID if point_index < 0 else int(document.result.element_id[point_index])
    return select_element(document, element_id)


def select_profile(document: Document, stack_id: int, profile_index: int) -> Document:
    """Select a profile of the selected element, within the selected deformation if any."""
    selection = replace(document.selection, profile=ProfileKey(stack_id, profile_index))
    return select(document, selection)


def select_spot(document: Document, chainage: float, clock: float) -> Document:
    """Select what is at a spot of the selected element's surface.

    Parameters
    ----------
    document : Document
        The present document.
    chainage : float
        Along the element's axis, metres.
    clock : float
        Angle around the axis, radians.

    Returns
    -------
    Document
    """
    if document.result is None or not document.selection.element_id:
        return document
    spot = selection_at_spot(document.result, document.selection.element_id, chainage, clock)
    return select(document, spot)


def select_parent(document: Document) -> Document:
    """Select the parent: profile → deformation → element → run → nothing."""
    return select(document, document.selection.parent())


def step_profile(document: Document, by: int) -> Document:
    """Select the next (+1) or previous (-1) profile of the stack that is shown."""
    result, selection = document.result, document.selection
    shown = shown_profile(result, selection) if result else None
    if result is None or shown is None:
        return document
    rows = result.profiles.of_element(selection.element_id, shown.stack_id)
    here = int(np.flatnonzero(rows.profile_index == shown.profile_index)[0])
    there = min(max(here + by, 0), len(rows) - 1)
    return select_profile(document, shown.stack_id, int(rows.profile_index[there]))


def step_deformation(document: Document, by: int) -> Document:
    """Select the next (+1) or previous (-1) deformation, in order of urgency."""
    if document.result is None or not document.result.deformations:
        return document
    ids = [d.deformation_id for d in by_verdict(document.result)]
    current = document.selection.deformation_id
    place = (ids.index(current) + by) % len(ids) if current in ids else 0
    return select_deformation(document, ids[place])
