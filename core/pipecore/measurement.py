"""Measuring elements at full resolution: their deviations, deformations and normal stacks."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipecore.allocation import Allocate, in_memory
from pipecore.deformation import curvature_variations, find_deformations
from pipecore.elements import BuiltElements, NearbyPoints
from pipecore.elements.sections import cut_normal_stack
from pipecore.parallel import for_items
from pipecore.progress import Progress
from pipecore.settings import DeformationSettings, EllipseFit
from pipecore.types import NO_ID, Deformation, Element, Profiles

Array = NDArray[np.float64]

N_SAMPLES = 16
"""Places along an axis at which its neighbours are looked for."""


@dataclass(frozen=True, eq=False)
class Measurement:
    """What the cloud's points tell of the elements.

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


def measure_elements(
    built: BuiltElements,
    nearby: NearbyPoints,
    n_points: int,
    width: float,
    settings: DeformationSettings,
    fit: EllipseFit,
    progress: Progress,
    others: tuple[Element, ...] = (),
    allocate: Allocate = in_memory,
) -> Measurement:
    """Measure every element on all points around it.

    `others` are not measured, but what touches an element there is no deformation of it.
    `allocate` makes the arrays with a value for each point of the cloud.
    """
    everything = built.elements + others
    boxes = bounding_boxes(everything)
    element_id, deviation = _of_no_element(n_points, allocate)
    measured: dict[int, _Measured] = {}
    # The largest first: at the end of one that is begun late the other threads would wait.
    order = sorted(range(len(built.elements)), key=lambda i: -_size(built.elements[i]))
    assigning = Lock()

    def work(k: int, check: Callable[[], None]) -> None:
        element = built.elements[order[k]]
        neighbours = neighbours_of(element, everything, boxes)
        found = _measure(element, neighbours, nearby, width, settings, fit, check)
        with assigning:
            _assign(found, element_id, deviation)
            measured[order[k]] = replace(found, index=_NONE, deviation=_NONE)

    for_items(work, len(order), "deformations", progress)
    in_order = [measured[i] for i in range(len(order))]
    progress.update("deformations", 1.0)
    return Measurement(
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
class _Measured:
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
    width: float,
    settings: DeformationSettings,
    fit: EllipseFit,
    check: Callable[[], None],
) -> _Measured:
    radius = max(element.radius, element.radius_end)
    thinned = nearby.thinned(element.axis, radius, 0.5 * radius)
    index, xyz, normals = nearby.of_cloud(thinned)
    finding = find_deformations(element, xyz, normals, neighbours, settings)
    check()
    own = finding.points[finding.belongs]
    places = own.chainage, own.distance, own.clock
    spacing = nearby.usual_spacing(thinned)
    section_width = max(width, 0.1 * element.radius, 2.5 * spacing)
    rows = cut_normal_stack(element, places, section_width, spacing, fit, check)
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
    return _Measured(
        complete,
        rows,
        finding.deformations,
        index[finding.belongs],
        finding.deviation[finding.belongs],
    )


def _assign(
    found: _Measured, element_id: NDArray[np.int32], deviation: NDArray[np.float32]
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


def bounding_boxes(elements: Sequence[Element]) -> tuple[Array, Array, Array]:
    """Lowest and highest coordinates of the elements' axes, each (n, 3), and their radii (n,)."""
    low, high = np.empty((2, len(elements), 3))
    for i, element in enumerate(elements):
        samples = element.axis.at(np.linspace(0.0, element.axis.length, N_SAMPLES))
        # Between its samples an arc leaves their box by less than half a step.
        half_step = 0.5 * element.axis.length / (N_SAMPLES - 1)
        low[i], high[i] = samples.min(axis=0) - half_step, samples.max(axis=0) + half_step
    return low, high, np.array([max(e.radius, e.radius_end) for e in elements])


def neighbours_of(
    element: Element, elements: Sequence[Element], boxes: tuple[Array, Array, Array]
) -> list[Element]:
    """Elements whose surfaces may come near: their axis passes within reach of its own.

    `boxes` are those of the elements' axes and their radii; most are far off by them alone.
    """
    samples = element.axis.at(np.linspace(0.0, element.axis.length, N_SAMPLES))
    step = element.axis.length / (N_SAMPLES - 1)
    radius = max(element.radius, element.radius_end)
    low, high, radii = boxes
    # Within reach of an end along the axis, and of the axis across it.
    furthest = (2.0 * (1.2 * (radius + radii) + step))[:, None]
    apart = (low - furthest > samples.max(axis=0)) | (high + furthest < samples.min(axis=0))
    near = []
    for i in np.flatnonzero(~apart.any(axis=1)).tolist():
        other = elements[i]
        if other is element:
            continue
        chainage, rho, _ = other.axis.pipe_coordinates(samples)
        reach = 1.2 * (radius + radii[i]) + step
        beside = (rho < reach) & (chainage > -reach) & (chainage < other.axis.length + reach)
        if beside.any():
            near.append(other)
    return near
