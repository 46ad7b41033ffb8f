"""Selections: of an id, of a spot on the surface, and of the same thing in another result.

A selection always has what contains it: run, element.
"""

from collections.abc import Mapping

import numpy as np

from pipecore.geometry import Array
from pipecore.report.summary import by_verdict
from pipecore.types import (
    NO_ID,
    OWN_STACK,
    Candidate,
    Deformation,
    Element,
    ElementKind,
    Result,
    Review,
    SurfaceOfRevolution,
)
from pipegui.model.document import ProfileKey, Selection


def selection_of_element(result: Result, element_id: int) -> Selection:
    """Select an element, or nothing for `NO_ID`."""
    if not element_id:
        return Selection()
    return Selection(run_id=result.element(element_id).run_id, element_id=element_id)


def selection_of_deformation(result: Result, deformation_id: int) -> Selection:
    """Select a deformation on its element, or nothing for `NO_ID`."""
    if not deformation_id:
        return Selection()
    element_id = result.deformation(deformation_id).element_id
    run_id = result.element(element_id).run_id
    return Selection(run_id, element_id, deformation_id)


def selection_at_spot(result: Result, element_id: int, chainage: float, clock: float) -> Selection:
    """Select what is at a spot of an element's surface: a deformation, else the profile there.

    Parameters
    ----------
    result : Result
        The result to select in.
    element_id : int
        The element.
    chainage : float
        Along the element's axis, metres.
    clock : float
        Angle around the axis, radians.

    Returns
    -------
    Selection
    """
    element = result.element(element_id)
    radius = float(element.radius_at(chainage))
    for deformation in result.deformations_of(element_id):
        off_peak = abs((clock - deformation.clock + np.pi) % (2 * np.pi) - np.pi) * radius
        is_along = deformation.chainage_start <= chainage <= deformation.chainage_end
        if is_along and off_peak <= deformation.width / 2:
            return selection_of_deformation(result, deformation.deformation_id)
    profile = nearest_profile(result, element_id, chainage)
    return Selection(element.run_id, element_id, profile=profile)


def elements_of(result: Result, selection: Selection) -> list[int]:
    """Ids of the selected elements: one, several, or those of the selected run."""
    if selection.element_id:
        return sorted({selection.element_id, *selection.others})
    return [e.element_id for e in result.elements if e.run_id == selection.run_id != NO_ID]


def nearest_profile(
    result: Result, element_id: int, chainage: float, stack_id: int = OWN_STACK
) -> ProfileKey | None:
    """The profile of an element that is nearest to a chainage, if it has any in the stack."""
    rows = result.profiles.of_element(element_id, stack_id)
    if not len(rows):
        return None
    nearest = int(np.argmin(np.abs(rows.chainage - chainage)))
    return ProfileKey(stack_id, int(rows.profile_index[nearest]))


def shown_profile(result: Result, selection: Selection) -> ProfileKey | None:
    """The profile whose section is shown: the selected one, else the one at the dent's peak."""
    if selection.profile is not None:
        return selection.profile
    if selection.deformation_id:
        peak = result.deformation(selection.deformation_id).chainage
        return nearest_profile(result, selection.element_id, peak)
    return None


def worst_deformation(result: Result) -> int:
    """Return the id of the most urgent deformation, `NO_ID` if there are none."""
    return by_verdict(result)[0].deformation_id if result.deformations else NO_ID


def carry_over_selection(selection: Selection, old: Result | None, new: Result | None) -> Selection:
    """Return the same selection in another result of the same cloud, as far as it is there.

    Parameters
    ----------
    selection : Selection
        What is selected in `old`.
    old, new : Result or None
        Two results of one cloud.

    Returns
    -------
    Selection
        Of the element about the same axis with about the same radius, the deformation of the
        same kind whose peak is nearest, and the profile nearest to the same place.
    """
    if old is new:
        return selection
    if old is None or new is None:
        return Selection()
    if selection.candidate_id:
        return _of_candidate(old.candidate(selection.candidate_id), new)
    if not selection.element_id:
        return Selection(run_id=_same_run(selection.run_id, old, new))
    element = old.element(selection.element_id)
    twin = _same_element(element, new)
    if twin is None:
        return Selection()
    kept = selection_of_element(new, twin.element_id)
    if selection.deformation_id:
        same = _same_deformation(old.deformation(selection.deformation_id), twin, new)
        if same is not None:
            kept = selection_of_deformation(new, same.deformation_id)
    if selection.profile is not None:
        rows = old.profiles.of_element(element.element_id, selection.profile.stack_id)
        row = rows.profile_index == selection.profile.profile_index
        if row.any():
            chainage, _, _ = twin.axis.pipe_coordinates(rows.centre[row][:1])
            profile = nearest_profile(new, twin.element_id, float(chainage[0]))
            kept = Selection(kept.run_id, kept.element_id, kept.deformation_id, profile)
    return kept


def _of_candidate(candidate: Candidate, new: Result) -> Selection:
    """Select the same candidate where it still is one, else the element that it has become."""
    if any(c is candidate for c in new.candidates):
        return Selection(candidate_id=candidate.candidate_id)
    twin = _same_element(candidate, new)
    return selection_of_element(new, twin.element_id if twin is not None else NO_ID)


def _same_run(run_id: int, old: Result, new: Result) -> int:
    """Id of the run that the longest element of a run is in that is found again."""
    elements = (e for e in old.elements if e.run_id == run_id != NO_ID)
    longest_first = sorted(elements, key=lambda e: -e.axis.length)
    twins = (_same_element(e, new) for e in longest_first)
    return next((twin.run_id for twin in twins if twin is not None), NO_ID)


def carry_over_reviews(
    reviews: Mapping[int, Review], old: Result | None, new: Result
) -> Mapping[int, Review]:
    """Return what was said of deformations for those that are found again.

    Parameters
    ----------
    reviews : mapping
        Reviews of deformations of `old`, by their ids.
    old, new : Result
        Two results of one cloud; `old` may be None.

    Returns
    -------
    mapping
        The reviews by the ids of `new`.
    """
    if old is None or old is new:
        return reviews
    kept: dict[int, Review] = {}
    for deformation_id, review in sorted(reviews.items()):
        deformation = old.deformation(deformation_id)
        twin = _same_element(old.element(deformation.element_id), new)
        same = _same_deformation(deformation, twin, new) if twin is not None else None
        if same is not None:
            kept.setdefault(same.deformation_id, review)
    return kept


def _middle(surface: SurfaceOfRevolution) -> Array:
    if surface.kind is ElementKind.SPHERE:
        return surface.centre
    return surface.axis.at(surface.axis.length / 2)


def _same_element(surface: SurfaceOfRevolution, result: Result) -> Element | None:
    """The element of `result` about the same axis with about the same radius."""
    middle = _middle(surface)
    best, least = None, 0.5
    for element in result.elements:
        if element.kind is ElementKind.SPHERE:
            offset = float(np.linalg.norm(middle - element.centre))
        else:
            chainage, off_axis, _ = element.axis.pipe_coordinates(middle[None])
            beyond = max(-chainage[0], chainage[0] - element.axis.length, 0.0)
            offset = float(off_axis[0]) + beyond
        difference = (abs(element.radius - surface.radius) + offset) / surface.radius
        if difference < least:
            best, least = element, difference
    return best


def _same_deformation(
    deformation: Deformation, element: Element, result: Result
) -> Deformation | None:
    """The deformation of the same kind on `element` whose peak is nearest, within a radius."""
    candidates = [
        (float(np.linalg.norm(d.peak - deformation.peak)), d.deformation_id, d)
        for d in result.deformations_of(element.element_id)
        if d.kind is deformation.kind
    ]
    nearest = min(candidates, default=None)
    return nearest[2] if nearest is not None and nearest[0] < element.radius else None
