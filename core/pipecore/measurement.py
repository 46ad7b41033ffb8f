"""Measuring elements at full resolution: their deviations, deformations and normal stacks."""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from pipecore.deformation import curvature_variations, find_deformations
from pipecore.elements import BuiltElements, NearbyPoints
from pipecore.elements.sections import cut_normal_stack
from pipecore.progress import Progress
from pipecore.settings import DeformationSettings, EllipseFit
from pipecore.types import NO_ID, Deformation, Element, Profiles


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
) -> Measurement:
    """Measure every element on all points around it.

    `others` are not measured, but what touches an element there is no deformation of it.
    """
    element_id = np.full(n_points, NO_ID, np.int32)
    deviation = np.full(n_points, np.nan, np.float32)
    elements, profiles = [], []
    deformations: list[Deformation] = []
    for i, element in enumerate(built.elements):
        progress.update("deformations", i / len(built.elements))
        radius = max(element.radius, element.radius_end)
        thinned = nearby.thinned(element.axis, radius, 0.5 * radius)
        index, xyz, normals = nearby.of_cloud(thinned)
        finding = find_deformations(
            element,
            xyz,
            normals,
            neighbours_of(element, built.elements + others),
            settings,
        )
        own = index[finding.belongs]
        # Where elements meet, a point is of the one that it fits better.
        taken = element_id[own] != NO_ID
        closer = ~taken | (np.abs(finding.deviation[finding.belongs]) < np.abs(deviation[own]))
        element_id[own[closer]] = element.element_id
        deviation[own[closer]] = finding.deviation[finding.belongs][closer]
        spacing = nearby.usual_spacing(thinned)
        section_width = max(width, 0.1 * element.radius, 2.5 * spacing)
        check = partial(progress.update, "deformations", (i + 0.5) / len(built.elements))
        rows = cut_normal_stack(
            element,
            xyz[finding.belongs],
            section_width,
            spacing,
            fit,
            check,
        )
        rows = replace(
            rows,
            curvature_variation=curvature_variations(
                element, xyz[finding.belongs], rows, section_width, check
            ),
        )
        elements.append(
            replace(
                element,
                n_points=len(own),
                n_profiles=len(rows),
                arc=float(np.median(rows.arc)) if len(rows) else element.arc,
                ovality=finding.ovality,
                ovality_sd=finding.ovality_sd,
                straightness=finding.straightness,
                not_measurable=finding.not_measurable,
            )
        )
        profiles.append(rows)
        deformations += finding.deformations
    progress.update("deformations", 1.0)
    return Measurement(
        tuple(elements),
        Profiles.concatenate(profiles),
        tuple(deformations),
        element_id,
        deviation,
    )


def neighbours_of(element: Element, elements: tuple[Element, ...]) -> list[Element]:
    """Elements whose surfaces may come near: their axis passes within reach of its own."""
    samples = element.axis.at(np.linspace(0.0, element.axis.length, 16))
    step = element.axis.length / 15
    radius = max(element.radius, element.radius_end)
    near = []
    for other in elements:
        if other is element:
            continue
        other_radius = max(other.radius, other.radius_end)
        chainage, rho, _ = other.axis.pipe_coordinates(samples)
        reach = 1.2 * (radius + other_radius) + step
        beside = (rho < reach) & (chainage > -reach) & (chainage < other.axis.length + reach)
        if beside.any():
            near.append(other)
    return near
