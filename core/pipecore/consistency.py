"""Whether the parts of a result that was read from a file go together."""

import numpy as np

from pipecore.geometry import ArcAxis, CurveAxis, LineAxis
from pipecore.types import NO_ID, OWN_STACK, Element, Result


def check_result(result: Result) -> None:
    """Check that ids are in order, positions finite, and that nothing refers to what is not there.

    Parameters
    ----------
    result : Result

    Raises
    ------
    ValueError
        If parts of the result do not go together.
    """
    _check_ids("stacks", [s.stack_id for s in result.stacks])
    ids = [e.element_id for e in result.elements]
    _check_ids("elements", ids)
    _check_ids("deformations", [d.deformation_id for d in result.deformations])
    if not result.stacks and result.elements:
        raise ValueError("there are elements without stacks")
    for stack in result.stacks:
        _check_vectors(stack.direction)
        if not stack.width > 0:
            raise ValueError("a stack has no width")
    for element in result.elements:
        _check_element(element)
    _check_vectors(result.origin)
    if result.station_check is not None:
        _check_ids("stations", [s.station_id for s in result.station_check.stations])
    _check_ids("candidates", [c.candidate_id for c in result.candidates])
    for candidate in result.candidates:
        numbers = (candidate.axis.length, candidate.radius, candidate.radius_end)
        if not all(np.isfinite(n) and n > 0 for n in numbers):
            raise ValueError(f"candidate {candidate.candidate_id} has no size")
    for deformation in result.deformations:
        _check_vectors(deformation.peak)
    own = {d.element_id for d in result.deformations} | set(result.profiles.element_id.tolist())
    own |= set(result.own_settings)
    of_points = {int(result.element_id.min(initial=NO_ID)), int(result.element_id.max(initial=0))}
    if not own <= set(ids) or not of_points <= {NO_ID, *ids}:
        raise ValueError("something belongs to an element that is not there")
    present = np.zeros(max([0, *ids]) + 1, np.bool_)
    present[[NO_ID, *ids]] = True
    if not present[result.element_id].all():
        raise ValueError("points belong to an element that is not there")
    stacks = {OWN_STACK, *(s.stack_id for s in result.stacks)}
    if not set(result.profiles.stack_id.tolist()) <= stacks:
        raise ValueError("profiles belong to a stack that is not there")
    if int(result.segment_id.min(initial=0)) < 0:
        raise ValueError("its segments are not numbered")


def _check_ids(what: str, ids: list[int]) -> None:
    if ids != sorted(set(ids)) or (ids and ids[0] <= NO_ID):
        raise ValueError(f"its {what} are not in the order of their numbers")


LEAST_STEPS = 4
"""A curve with fewer steps is no cubic spline."""


def _check_vectors(*vectors: np.ndarray) -> None:
    for vector in vectors:
        if vector.shape != (3,) or not np.isfinite(vector).all():
            raise ValueError("a position is not three finite numbers")


def _check_element(element: Element) -> None:
    axis = element.axis
    match axis:
        case LineAxis():
            _check_vectors(axis.start, axis.direction)
        case ArcAxis():
            _check_vectors(axis.centre, axis.normal, axis.towards_start)
        case CurveAxis():
            _check_vectors(axis.start, axis.end)
            is_even = len(axis.up) == len(axis.right) >= LEAST_STEPS
            if not is_even or not np.isfinite([axis.up, axis.right]).all():
                raise ValueError(f"the curve of element {element.element_id} is none")
    numbers = (axis.length, element.radius, element.radius_end)
    if not all(np.isfinite(n) and n > 0 for n in numbers) or element.run_id <= NO_ID:
        raise ValueError(f"element {element.element_id} has no length, radius or run")
    if element.centre.shape != (3,):
        raise ValueError("a position is not three finite numbers")
