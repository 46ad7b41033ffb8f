"""Detecting again in a part of the cloud, with settings that suit it."""

from collections.abc import Collection
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pipecore.editing.changes import find, noted, with_settings, without
from pipecore.editing.refitting import in_box, part_of, points_near
from pipecore.errors import EditError
from pipecore.pipeline import detect
from pipecore.progress import NoProgress, Progress
from pipecore.settings import Settings
from pipecore.types import NO_ID, Element, PointCloud, Profiles, Result, Stack

Indices = NDArray[np.intp]
MIN_SHARE_WITHIN = 0.9
"""An element is replaced if at least this share of its points lies in the part."""
MAX_SHARE_OF_KEPT = 0.5
"""A found element is dropped if more of its points than this share belong to elements that stay."""
MIN_SHARE_OF_FORMER = 0.3
"""A found element is a former one if it has at least this share of its points from it."""


def points_around(cloud: PointCloud, result: Result, element_ids: list[int]) -> Indices:
    """Return the indices of the points around elements, those of what touches them included.

    Parameters
    ----------
    cloud : PointCloud
        The cloud that the result is of.
    result : Result
    element_ids : list of int

    Returns
    -------
    ndarray of int

    Raises
    ------
    EditError
        If there is no such element.
    """
    return points_near(cloud, [find(result, i) for i in element_ids])


def points_in_box(cloud: PointCloud, low: tuple[float, ...], high: tuple[float, ...]) -> Indices:
    """Return the indices of the points in a box along the axes of coordinates.

    Parameters
    ----------
    cloud : PointCloud
    low, high : tuple of float
        Lowest and highest corner, local coordinates, metres.

    Returns
    -------
    ndarray of int
    """
    return np.flatnonzero(in_box(cloud, np.asarray(low), np.asarray(high)))


def detect_again(
    cloud: PointCloud,
    result: Result,
    index: Indices,
    settings: Settings,
    progress: Progress = NoProgress(),
    replaced: Collection[int] | None = None,
) -> Result:
    """Detect in a part of the cloud and replace the elements that were there.

    Elements that lie in the part are replaced, or those that are named; one that only
    reaches into the part stays, and is not found a second time. What is found again keeps
    its id, run and name.

    Parameters
    ----------
    cloud : PointCloud
    result : Result
    index : ndarray of int
        The points of the part; see `points_around` and `points_in_box`.
    settings : Settings
    progress : Progress
    replaced : collection of int, optional
        Ids of the elements to be replaced, where others in the part are to stay.

    Returns
    -------
    Result
        With the change noted in `edits`.

    Raises
    ------
    EditError
        If the part holds no points.
    CancelledError
        From `progress`.
    """
    if len(index) == 0:
        raise EditError("There are no points to detect on.")
    found = detect(part_of(cloud, index), settings, progress)
    n_ids = max([e.element_id for e in result.elements], default=0) + 1
    before = result.element_id[index]
    n_within = np.bincount(before, minlength=n_ids)
    n_all = np.bincount(result.element_id, minlength=n_ids)
    gone = {
        e.element_id
        for e in result.elements
        if replaced is None and n_within[e.element_id] >= MIN_SHARE_WITHIN * n_all[e.element_id]
    }
    gone |= {find(result, i).element_id for i in replaced or ()}
    rest = without(result, gone)
    is_kept = rest.element_id[index] != NO_ID
    n_found = np.bincount(found.element_id, minlength=len(found.elements) + 1)
    n_kept = np.bincount(found.element_id, is_kept, minlength=len(found.elements) + 1)
    taken = [
        e
        for e in found.elements
        if n_kept[e.element_id] <= MAX_SHARE_OF_KEPT * n_found[e.element_id]
    ]
    new_id = _ids(taken, found, before, gone, n_ids)
    stacks, stack_ids = _joined_stacks(result.stacks, found.stacks)
    elements = _numbered(taken, new_id, result)
    joined = _joined(rest, result, found, index, elements, stacks, stack_ids)
    return noted(
        with_settings(joined, {e.element_id for e in elements.values()}, settings),
        f"detected again among {len(index)} points: {len(taken)} elements",
    )


def _ids(
    taken: list[Element],
    found: Result,
    before: NDArray[np.int32],
    gone: set[int],
    next_id: int,
) -> dict[int, int]:
    """Id of each found element in the whole: its former one, or a new one."""
    claims = []
    for element in taken:
        owners = before[found.element_id == element.element_id]
        counts = np.bincount(owners)
        claims += [
            (-int(counts[i]), element.element_id, int(i))
            for i in np.flatnonzero(counts >= MIN_SHARE_OF_FORMER * len(owners))
            if int(i) in gone
        ]
    given: dict[int, int] = {}
    for _, new, former in sorted(claims):
        if new not in given and former not in given.values():
            given[new] = former
    for element in taken:
        if element.element_id not in given:
            given[element.element_id] = next_id
            next_id += 1
    return given


def _numbered(taken: list[Element], new_id: dict[int, int], result: Result) -> dict[int, Element]:
    """The found elements by their ids in the part, with ids, runs and names of the whole."""
    former = {e.element_id: e for e in result.elements}
    run_of: dict[int, int] = {}
    for element in taken:
        if (same := former.get(new_id[element.element_id])) is not None:
            run_of.setdefault(element.run_id, same.run_id)
    next_run = max([e.run_id for e in result.elements], default=0) + 1
    numbered = {}
    for element in taken:
        if element.run_id not in run_of:
            run_of[element.run_id], next_run = next_run, next_run + 1
        same = former.get(new_id[element.element_id])
        numbered[element.element_id] = replace(
            element,
            element_id=new_id[element.element_id],
            run_id=run_of[element.run_id],
            name=same.name if same is not None else "",
        )
    return numbered


def _joined_stacks(
    stacks: tuple[Stack, ...], more: tuple[Stack, ...]
) -> tuple[tuple[Stack, ...], dict[int, int]]:
    """All stacks, the same ones once, and the ids that the later ones have among them."""
    joined, ids = list(stacks), {}
    for stack in more:
        same = next((s for s in joined if _are_same(s, stack)), None)
        if same is None:
            same = replace(stack, stack_id=max([s.stack_id for s in joined], default=0) + 1)
            joined.append(same)
        ids[stack.stack_id] = same.stack_id
    return tuple(joined), ids


def _are_same(a: Stack, b: Stack) -> bool:
    numbers = (a.width, a.offset, a.min_spacing), (b.width, b.offset, b.min_spacing)
    return bool(np.allclose(a.direction, b.direction, atol=1e-9)) and np.allclose(*numbers)


def _joined(
    rest: Result,
    result: Result,
    found: Result,
    index: Indices,
    elements: dict[int, Element],
    stacks: tuple[Stack, ...],
    stack_ids: dict[int, int],
) -> Result:
    ids = np.zeros(max([e.element_id for e in found.elements], default=0) + 1, np.int32)
    for old, element in elements.items():
        ids[old] = element.element_id
    point_ids = ids[found.element_id]
    won = (point_ids != NO_ID) & (rest.element_id[index] == NO_ID)
    element_id, deviation = rest.element_id.copy(), rest.deviation.copy()
    element_id[index[won]] = point_ids[won]
    deviation[index[won]] = found.deviation[won]
    segment_id = rest.segment_id.copy()
    first_segment = int(segment_id.max(initial=0))
    segment_id[index] = np.where(found.segment_id > 0, found.segment_id + first_segment, NO_ID)
    rows = found.profiles[np.isin(found.profiles.element_id, list(elements))]
    rows = replace(
        rows,
        element_id=ids[rows.element_id],
        stack_id=np.array([stack_ids.get(int(i), int(i)) for i in rows.stack_id], np.int32),
    )
    first_id = max([d.deformation_id for d in result.deformations], default=0) + 1
    deformations = [d for d in found.deformations if d.element_id in elements]
    return replace(
        rest,
        stacks=stacks,
        elements=tuple(sorted((*rest.elements, *elements.values()), key=lambda e: e.element_id)),
        profiles=Profiles.concatenate([rest.profiles, rows]),
        deformations=(
            *rest.deformations,
            *(
                replace(d, deformation_id=i, element_id=int(ids[d.element_id]))
                for i, d in enumerate(deformations, start=first_id)
            ),
        ),
        segment_id=segment_id,
        element_id=element_id,
        deviation=deviation,
    )
