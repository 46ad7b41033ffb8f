"""Accepting what a detection nearly accepted, or dismissing it."""

from collections.abc import Collection
from dataclasses import replace

import numpy as np

from pipecore.catalogues import with_sizes
from pipecore.editing.changes import noted
from pipecore.editing.refitting import fit_shape, measure_anew, part_of, points_near
from pipecore.errors import EditError
from pipecore.progress import NoProgress, Progress
from pipecore.types import NO_ID, Array, Candidate, Element, ElementKind, PointCloud, Result

BY_PERSON = "person"
BAND_SIGMAS, BAND_RADII = 4.0, 0.02
"""Points this near to the surface take part in its fit: scatters about it, or shares of radius."""


def accept_candidate(
    cloud: PointCloud, result: Result, candidate_id: int, progress: Progress = NoProgress()
) -> Result:
    """Make an element of a candidate: fitted and measured like any other, a run of its own.

    Parameters
    ----------
    cloud : PointCloud
        The cloud that the result is of.
    result : Result
    candidate_id : int
    progress : Progress

    Returns
    -------
    Result
        With the element, whose `accepted_by` is "person", and the change noted in `edits`.

    Raises
    ------
    EditError
        If there is no such candidate.
    CancelledError
        From `progress`.
    """
    candidate = _find(result, candidate_id)
    element = _element(candidate, result)
    index = points_near(cloud, [element])
    index = index[result.element_id[index] == NO_ID]
    on_surface = index[_is_near(element, cloud.xyz[index].astype(np.float64))]
    if element.kind is not ElementKind.SPHERE:
        part = part_of(cloud, on_surface)
        element = fit_shape(element, part, result.settings.thinning, progress).element
    element = with_sizes(element, result.settings.elements)
    changed = measure_anew(cloud, _without(result, {candidate_id}), (), [element], progress)
    return noted(changed, f"accepted {element.label}, which was not accepted")


def dismiss_candidates(result: Result, candidate_ids: Collection[int]) -> Result:
    """Leave out candidates that a person has looked at and does not want.

    Parameters
    ----------
    result : Result
    candidate_ids : collection of int

    Returns
    -------
    Result
        With the change noted in `edits`.

    Raises
    ------
    EditError
        If there is no such candidate.
    """
    gone = [_find(result, i) for i in sorted(set(candidate_ids))]
    rest = _without(result, {c.candidate_id for c in gone})
    return noted(rest, f"dismissed {', '.join(c.label for c in gone)}")


def _find(result: Result, candidate_id: int) -> Candidate:
    try:
        return result.candidate(candidate_id)
    except KeyError as error:
        raise EditError(
            "There is no candidate {candidate_id}.", candidate_id=candidate_id
        ) from error


def _without(result: Result, candidate_ids: Collection[int]) -> Result:
    rest = (c for c in result.candidates if c.candidate_id not in candidate_ids)
    return replace(result, candidates=tuple(rest))


def _element(candidate: Candidate, result: Result) -> Element:
    return Element(
        element_id=max((e.element_id for e in result.elements), default=0) + 1,
        run_id=max((e.run_id for e in result.elements), default=0) + 1,
        kind=candidate.kind,
        axis=candidate.axis,
        radius=candidate.radius,
        radius_sd=candidate.radius_sd,
        radius_end=candidate.radius_end,
        centre=candidate.centre,
        n_points=0,
        n_profiles=0,
        arc=candidate.arc,
        rms=candidate.rms,
        accepted_by=BY_PERSON,
    )


def _is_near(element: Element, xyz: Array) -> Array:
    chainage, rho, _ = element.axis.pipe_coordinates(xyz)
    band = max(BAND_SIGMAS * element.rms, BAND_RADII * element.radius)
    return np.asarray(np.abs(rho - element.radius_at(chainage)) < band)
