"""Measuring elements at full resolution: their deviations, deformations and normal stacks."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipecore.allocation import Allocate, in_memory
from pipecore.deformation import curvature_variations, find_deformations
from pipecore.elements import NearbyPoints
from pipecore.measurement.adjacency import bounding_boxes, neighbours_of
from pipecore.measurement.sections import cut_normal_stack
from pipecore.parallel import for_items
from pipecore.progress import Progress
from pipecore.settings import DeformationSettings, EllipseFit
from pipecore.types import NO_ID, Deformation, Element, Profiles

Array = NDArray[np.float64]

DEEPEST = 0.05
"""Damage is looked for down to this distance from the axis, in radii."""


@dataclass(frozen=True, eq=False)
class MeasuredElements:
    """Elements measured at full resolution.

    Parameters
    ----------
    elements : tuple of Element
        Complete with counts, ovality and straightness.
    profiles : Profiles
        The normal stack of each element.
    deformations : tuple of Deformation
        In the order of the elements, not yet judged.
    element_id : ndarray of int32, shape (n,)
    deviation : ndarray of float32, shape (n,)
        Per point of the cloud; see `Result`.
    """

    elements: tuple[Element, ...]
    profiles: Profiles
    deformations: tuple[Deformation, ...]
    element_id: NDArray[np.int32]
    deviation: NDArray[np.float32]


@dataclass(frozen=True)
class MeasuringOptions:
    """How elements are measured.

    Parameters
    ----------
    profile_width : float
        Least width of the profiles of normal stacks, metres.
    deformations : DeformationSettings
    fit : EllipseFit
        How free ellipses are fitted.
    """

    profile_width: float
    deformations: DeformationSettings
    fit: EllipseFit


def measure_elements(
    elements: Sequence[Element],
    nearby: NearbyPoints,
    n_points: int,
    options: MeasuringOptions,
    progress: Progress,
    others: Sequence[Element] = (),
    allocate: Allocate = in_memory,
) -> MeasuredElements:
    """Measure every element on all points of the cloud around it.

    Parameters
    ----------
    elements : sequence of Element
    nearby : NearbyPoints
        Of the cloud.
    n_points : int
        Number of points of the cloud.
    options : MeasuringOptions
    progress : Progress
        Receives fractions of the stage "deformations".
    others : sequence of Element
        Elements that are not measured; where they touch one there is no deformation of it.
    allocate : callable
        Makes the arrays with a value for each point of the cloud.

    Returns
    -------
    MeasuredElements

    Raises
    ------
    CancelledError
        From `progress`.
    """
    everything = (*elements, *others)
    boxes = bounding_boxes(everything)
    element_id, deviation = _of_no_element(n_points, allocate)
    measured: dict[int, _MeasuredElement] = {}
    # The largest first: at the end of one that is begun late the other threads would wait.
    order = sorted(range(len(elements)), key=lambda i: -_size(elements[i]))
    assigning = Lock()

    def work(k: int, check: Callable[[], None]) -> None:
        element = elements[order[k]]
        neighbours = neighbours_of(element, everything, boxes)
        found = _measure(element, neighbours, nearby, options, check)
        with assigning:
            _assign(found, element_id, deviation)
            measured[order[k]] = replace(found, index=_NONE, deviation=_NONE)

    for_items(work, len(order), "deformations", progress)
    in_order = [measured[i] for i in range(len(order))]
    progress.update("deformations", 1.0)
    return MeasuredElements(
        tuple(m.element for m in in_order),
        Profiles.concatenate([m.profiles for m in in_order]),
        tuple(d for m in in_order for d in m.deformations),
        element_id,
        deviation,
    )


def _of_no_element(
    n_points: int, allocate: Allocate
) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
    """Element and deviation of points that are of no element."""
    element_id: NDArray[np.int32] = allocate("element_id", (n_points,), np.int32)
    deviation: NDArray[np.float32] = allocate("deviation", (n_points,), np.float32)
    element_id[:] = NO_ID
    deviation[:] = np.nan
    return element_id, deviation


@dataclass(frozen=True, eq=False)
class _MeasuredElement:
    """One element with what was measured of it; its points with their deviations."""

    element: Element
    profiles: Profiles
    deformations: tuple[Deformation, ...]
    index: NDArray[np.intp]
    deviation: NDArray[np.float32]


_NONE: NDArray[Any] = np.empty(0)


def _measure(
    element: Element,
    neighbours: list[Element],
    nearby: NearbyPoints,
    options: MeasuringOptions,
    check: Callable[[], None],
) -> _MeasuredElement:
    radius = max(element.radius, element.radius_end)
    downsampled = nearby.around_axis(element.axis, radius, 0.5 * radius, DEEPEST)
    index, xyz, normals = nearby.full_resolution_with_normals(downsampled)
    finding = find_deformations(
        element, xyz, normals, neighbours, options.deformations, nearby.rounding
    )
    check()
    own = finding.points[finding.belongs]
    places = own.chainage, own.distance, own.clock
    spacing = nearby.usual_spacing(downsampled)
    section_width = max(options.profile_width, 0.1 * element.radius, 2.5 * spacing)
    rows = cut_normal_stack(element, places, section_width, spacing, options.fit, check)
    variation = curvature_variations(element, places, rows, section_width, check)
    rows = replace(rows, curvature_variation=variation)
    complete = replace(
        element,
        n_points=len(own.chainage),
        n_profiles=len(rows),
        arc=float(np.median(rows.arc)) if len(rows) else element.arc,
        ovality=finding.ovality,
        ovality_sd=finding.ovality_sd,
        straightness=finding.straightness,
        not_measurable=finding.not_measurable,
    )
    return _MeasuredElement(
        complete,
        rows,
        finding.deformations,
        index[finding.belongs],
        finding.deviation[finding.belongs],
    )


def _assign(
    found: _MeasuredElement, element_id: NDArray[np.int32], deviation: NDArray[np.float32]
) -> None:
    """Give an element its points: where elements meet, a point is of the one it fits better.

    Of two that it fits alike it is the first one's, in whatever order they come.
    """
    other = element_id[found.index]
    here, there = np.abs(found.deviation), np.abs(deviation[found.index])
    is_first = found.element.element_id < other
    closer = (other == NO_ID) | (here < there) | ((here == there) & is_first)
    own = found.index[closer]
    element_id[own] = found.element.element_id
    deviation[own] = found.deviation[closer]


def _size(element: Element) -> float:
    """About how many points an element has beside others: the area of its surface."""
    return element.axis.length * max(element.radius, element.radius_end)
