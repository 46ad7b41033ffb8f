"""Elements fitted to their points and measured anew, in the place of others."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pipecore.editing.changes import with_settings, without
from pipecore.elements import NearbyPoints
from pipecore.elements.refinement.extent import MAX_SECTORS, section_misfit
from pipecore.elements.refinement.guess import axis_through
from pipecore.elements.refinement.sampled_fits import fit_measured
from pipecore.elements.refinement.surface_fits import ArcSurface, LineSurface
from pipecore.ellipses import radius_sd_factor
from pipecore.geometry import ArcAxis, Array, CurveAxis
from pipecore.measurement import MeasuringOptions, measure_elements
from pipecore.progress import Progress, Renamed
from pipecore.settings import ThinningSettings
from pipecore.surface import sample_surface
from pipecore.types import (
    NO_ID,
    OWN_STACK,
    Deformation,
    Element,
    ElementKind,
    Floats,
    PointCloud,
    Profiles,
    Result,
)

AROUND_RADII = 2.0
"""Points within this many radii of the axis take part in measuring."""
MARGIN_M = 0.05
"""... and within this of it, metres, so that points at the edge have their neighbours."""


@dataclass(frozen=True, eq=False)
class RefittedElement:
    """An element after its fit; as it was where the points determine none."""

    element: Element
    is_fitted: bool


def fit_shape(
    element: Element, part: PointCloud, thinning: ThinningSettings, progress: Progress
) -> RefittedElement:
    """Fit an element's surface to its points between its ends, as a detection does.

    Parameters
    ----------
    element : Element
        Where to start; its axis is kept in length, up to the fit's own change.
    part : PointCloud
        Points of its surface, and perhaps some beyond its ends.
    thinning : ThinningSettings
    progress : Progress
        Receives the stage "fitting".

    Raises
    ------
    CancelledError
        From `progress`.
    """
    chainage, _, _ = element.axis.pipe_coordinates(part.xyz.astype(np.float64))
    between = np.flatnonzero((chainage >= 0) & (chainage <= element.axis.length))
    if len(between) == 0:
        return RefittedElement(element, is_fitted=False)
    part = part_of(part, between)
    surface = sample_surface(part, thinning, Renamed(progress, "fitting"))
    nearby, downsampled = NearbyPoints(part, surface), np.arange(len(surface.xyz))
    model, scale = _model_of(element), 3.0 * max(element.rms, 0.001)
    fit = fit_measured(model, downsampled, nearby, scale, nearby.usual_spacing(downsampled))
    if fit is None:
        return RefittedElement(element, is_fitted=False)
    xyz = part.xyz.astype(np.float64)
    axis = axis_through(fit.model, np.stack([element.axis.start, element.axis.end]))
    residual, _, _ = fit.model.residuals(xyz)
    _, _, clock = axis.pipe_coordinates(xyz)
    misfit = section_misfit(clock, residual, element.arc, nearby.rounding)
    n_sectors = max(element.arc / (2 * np.pi) * MAX_SECTORS, 1.0)
    by_noise = 0.5 * np.pi * fit.sigma**2 * n_sectors / max(len(xyz), 1)
    excess = max(misfit**2 - by_noise, 0.0)
    factor = float(radius_sd_factor(element.arc))
    radii = fit.model.radius, fit.model.radius
    if isinstance(fit.model, LineSurface):
        radii = fit.model.radius_at(axis.start), fit.model.radius_at(axis.end)
    return RefittedElement(
        replace(
            element,
            axis=axis,
            radius=float(radii[0]),
            radius_end=float(radii[1]),
            radius_sd=float(np.hypot(fit.radius_sd, factor * np.sqrt(excess / n_sectors))),
            centre=fit.model.centre if isinstance(fit.model, ArcSurface) else element.centre,
            rms=fit.sigma,
        ),
        is_fitted=True,
    )


def _model_of(element: Element) -> LineSurface | ArcSurface:
    axis = element.axis
    if isinstance(axis, ArcAxis):
        return ArcSurface(axis.centre, axis.normal, axis.bend_radius, element.radius)
    line = axis.chord if isinstance(axis, CurveAxis) else axis
    is_tapered = element.kind is ElementKind.CONE
    slope = (element.radius_end - element.radius) / axis.length if is_tapered else 0.0
    half = line.length / 2
    return LineSurface(
        line.at(half), line.direction, element.radius + slope * half, slope, is_tapered
    )


def measure_anew(
    cloud: PointCloud,
    result: Result,
    gone: Collection[int],
    elements: Sequence[Element],
    progress: Progress,
) -> Result:
    """Put measured elements in the place of others.

    Parameters
    ----------
    cloud : PointCloud
    result : Result
    gone : collection of int
        Ids of the elements that they replace.
    elements : sequence of Element
        With their ids, axes and radii. They are measured with the settings of the first
        one that they replace.
    progress : Progress
    """
    settings = result.settings_of(elements[0].element_id)
    rest = without(result, gone)
    index = points_near(cloud, elements)
    part = part_of(cloud, index)
    surface = sample_surface(part, settings.thinning, progress)
    measured = measure_elements(
        elements,
        NearbyPoints(part, surface),
        len(part),
        MeasuringOptions(result.stacks[0].width, settings.deformation, settings.ellipses.fit),
        progress,
        others=rest.elements,
    )
    first_id = max([d.deformation_id for d in result.deformations], default=0) + 1
    own = {e.element_id: e for e in measured.elements}
    deformations = tuple(
        replace(d, deformation_id=i) for i, d in enumerate(measured.deformations, start=first_id)
    )
    of_stacks = result.profiles[
        np.isin(result.profiles.element_id, list(gone)) & (result.profiles.stack_id != OWN_STACK)
    ]
    tables = [measured.profiles, *(_of_stacks_on(e, of_stacks) for e in measured.elements)]
    changed = _inserted(
        rest,
        measured.elements,
        Profiles.concatenate(tables),
        deformations,
        (index, measured.element_id, measured.deviation),
    )
    return with_settings(changed, own, settings)


def _inserted(
    rest: Result,
    elements: tuple[Element, ...],
    profiles: Profiles,
    deformations: tuple[Deformation, ...],
    points: tuple[NDArray[np.intp], NDArray[np.int32], NDArray[np.float32]],
) -> Result:
    """The result with more elements; a point goes to the element that it fits better."""
    index, element_id, deviation = points
    before = rest.deviation[index]
    is_free = rest.element_id[index] == NO_ID
    with np.errstate(invalid="ignore"):
        won = (element_id != NO_ID) & (is_free | (np.abs(deviation) < np.abs(before)))
    all_ids, all_deviations = rest.element_id.copy(), rest.deviation.copy()
    all_ids[index[won]] = element_id[won]
    all_deviations[index[won]] = deviation[won]
    return replace(
        rest,
        elements=tuple(sorted((*rest.elements, *elements), key=lambda e: e.element_id)),
        deformations=(*rest.deformations, *deformations),
        profiles=Profiles.concatenate([rest.profiles, profiles]),
        element_id=all_ids,
        deviation=all_deviations,
    )


def _of_stacks_on(element: Element, profiles: Profiles) -> Profiles:
    """The rows of the stacks that lie on an element, told about its axis."""
    chainage, rho, _ = element.axis.pipe_coordinates(profiles.centre)
    rows = np.flatnonzero((chainage >= 0) & (chainage <= element.axis.length))
    rows = rows[np.lexsort((chainage[rows], profiles.stack_id[rows]))]
    chosen = profiles[rows]
    return replace(
        chosen,
        element_id=np.full(len(rows), element.element_id, np.int32),
        chainage=chainage[rows],
        centre_deviation=rho[rows],
        radius_deviation=chosen.radius - element.radius_at(chainage[rows]),
    )


def points_near(cloud: PointCloud, elements: Sequence[Element]) -> NDArray[np.intp]:
    """Indices of the points in the neighbourhood of some elements, in order."""
    near = np.zeros(len(cloud), np.bool_)
    for element in elements:
        axis = element.axis
        reach = AROUND_RADII * max(element.radius, element.radius_end) + MARGIN_M
        samples = axis.at(np.linspace(0.0, axis.length, 64))
        slack = reach + axis.length / 63
        low, high = samples.min(axis=0) - slack, samples.max(axis=0) + slack
        index = np.flatnonzero(in_box(cloud, low, high))
        chainage, rho, _ = axis.pipe_coordinates(cloud.xyz[index].astype(np.float64))
        beside = (chainage > -reach) & (chainage < axis.length + reach) & (rho < reach)
        near[index[beside]] = True
    return np.flatnonzero(near)


def in_box(cloud: PointCloud, low: Array, high: Array) -> NDArray[np.bool_]:
    """Which points lie in an upright box in local coordinates."""
    inside = np.ones(len(cloud), np.bool_)
    for axis in range(3):
        along = cloud.xyz[:, axis]
        inside &= (along >= low[axis]) & (along <= high[axis])
    return inside


def part_of(cloud: PointCloud, index: NDArray[np.intp]) -> PointCloud:
    """A cloud of some points alone, in the same local coordinates."""
    xyz: Floats = cloud.xyz[index]
    return PointCloud(cloud.origin, xyz, stations=cloud.stations, source=cloud.source)
