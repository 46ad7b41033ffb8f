"""The pipeline, in the paper's order, wherever the points are."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from pipecore.axes import join_centres
from pipecore.deformation import relate_deformations
from pipecore.elements import NearbyPoints, build_elements, propose_surfaces
from pipecore.ellipses import Ellipses
from pipecore.measurement import MeasuringOptions, measure_elements, tabulate_ellipses
from pipecore.nothing_found import nothing_found_notes
from pipecore.progress import NoProgress, Progress
from pipecore.rules import judge_all, load_rules
from pipecore.segments import StackOverlay
from pipecore.settings import Settings
from pipecore.stacks import choose_stacks
from pipecore.stations import check_stations
from pipecore.types import Deformation, Element, PointCloud, Profiles, Result
from pipecore.unit_sense import unit_notes
from pipecore.workspace import InMemory, Workspace, labels_to_full_cloud

STAGES = {
    "thinning": 0.08,
    "normals": 0.10,
    "directions": 0.04,
    "profiles": 0.28,
    "segments": 0.03,
    "ellipses": 0.02,
    "axes": 0.03,
    "elements": 0.21,
    "stations": 0.03,
    "deformations": 0.18,
}
"""The stages in their order, with the share of the time that each usually takes."""


def detect(
    cloud: PointCloud | ArrayLike,
    settings: Settings = Settings(),
    progress: Progress = NoProgress(),
) -> Result:
    """Find the elements of a cloud and their deformations.

    Parameters
    ----------
    cloud : PointCloud or array_like
        Points as an array of shape (n, 3) are taken as `PointCloud.from_points` takes them.
    settings : Settings
    progress : Progress
        Receives the stages of `STAGES`.

    Returns
    -------
    Result
        With no elements if the cloud shows none.

    Raises
    ------
    CancelledError
        If `progress` raises it.
    SettingsError
        If the acceptance rule of the settings cannot be read, or they ask for no stacks.
    TypeError, ValueError
        If the points are not an array of real, finite numbers of shape (n, 3), or the settings
        are none.
    """
    if not isinstance(settings, Settings):
        raise TypeError(f"the settings must be pipecore.Settings, not {type(settings).__name__}")
    if not isinstance(cloud, PointCloud):
        cloud = PointCloud.from_points(cloud)
    return detect_in(InMemory(cloud), settings, progress)


def detect_in(workspace: Workspace, settings: Settings, progress: Progress) -> Result:
    """Find the elements of a workspace's cloud and their deformations; see `detect`.

    Parameters
    ----------
    workspace : Workspace
        Holds the cloud in memory or in tiles.
    settings : Settings
    progress : Progress

    Returns
    -------
    Result

    Raises
    ------
    CancelledError, SettingsError
        See `detect`.
    """
    cloud, timer = workspace.cloud, StepTimer()
    load_rules(settings.deformation.rule)  # what would fail at the end fails now
    if len(cloud) == 0:
        return _empty_result(cloud, settings)
    with timer("surface"):
        surface = workspace.sample_surface(settings.thinning, progress)
    with timer("stacks"):
        stacks = choose_stacks(surface, settings.stacks, settings.elements.max_radius, progress)
        overlay, fits = StackOverlay(len(surface.xyz), workspace.allocate), []
        max_radius = settings.elements.max_radius
        for first, plane in workspace.remove_planes(surface, max_radius, progress):
            overlay.add_planes(first, plane)
    with timer("profiles"):
        for points, starts, of_curves in workspace.cut_stacks(stacks, settings, progress):
            overlay.add(points, starts)
            fits.append(of_curves)
    with timer("segments"):
        segments = overlay.number_segments(progress)
        members = surface.full_resolution_points
        segment_id = labels_to_full_cloud(segments, members, workspace.allocate, progress)
    with timer("ellipses"):
        progress.update("ellipses", 0.0)
        ellipses = Ellipses.concatenate(fits)
        fits.clear()
    with timer("axes"):
        chains = join_centres(ellipses, progress)
    with timer("elements"):
        proposals = propose_surfaces(ellipses, chains, progress)
        nearby = NearbyPoints(cloud, surface, progress, workspace.allocate)
        elements, candidates, n_more = build_elements(
            proposals, nearby, settings.elements, progress
        )
        profiles = tabulate_ellipses(elements, ellipses)
    with timer("stations"):
        progress.update("stations", 0.0)
        tolerance = settings.stations.tolerance_mm / 1e3
        check = check_stations(cloud, elements, nearby, tolerance, progress)
    with timer("deformations"):
        measuring = MeasuringOptions(stacks[0].width, settings.deformation, settings.ellipses.fit)
        measured = measure_elements(
            elements, nearby, len(cloud), measuring, progress, allocate=workspace.allocate
        )
        deformations = judge_deformations(measured.deformations, measured.elements, settings)
    return Result(
        settings=settings,
        origin=cloud.origin,
        source=cloud.source,
        n_cloud_points=len(cloud),
        stacks=stacks,
        elements=measured.elements,
        profiles=Profiles.concatenate([measured.profiles, profiles]),
        deformations=deformations,
        segment_id=segment_id,
        element_id=measured.element_id,
        deviation=measured.deviation,
        seconds=timer.seconds,
        unit=cloud.unit,
        notes=(
            *cloud.notes,
            *unit_notes(cloud, measured.elements, settings),
            *(() if elements else nothing_found_notes(surface, candidates, settings)),
        ),
        candidates=candidates,
        n_more_candidates=n_more,
        station_check=check,
    )


def _empty_result(cloud: PointCloud, settings: Settings) -> Result:
    """The result for a cloud without points."""
    return Result(
        settings=settings,
        origin=cloud.origin,
        source=cloud.source,
        n_cloud_points=0,
        stacks=(),
        elements=(),
        profiles=Profiles.empty(),
        deformations=(),
        segment_id=np.empty(0, np.int32),
        element_id=np.empty(0, np.int32),
        deviation=np.empty(0, np.float32),
        seconds={},
        unit=cloud.unit,
        notes=cloud.notes,
    )


def judge_deformations(
    deformations: tuple[Deformation, ...], elements: tuple[Element, ...], settings: Settings
) -> tuple[Deformation, ...]:
    """Number the deformations, relate them to their surroundings, judge them by the rules.

    Parameters
    ----------
    deformations : tuple of Deformation
    elements : tuple of Element
        All, in the order of their ids.
    settings : Settings

    Returns
    -------
    tuple of Deformation
        With ids from 1, neighbours, rules and verdicts.
    """
    numbered = [replace(d, deformation_id=i) for i, d in enumerate(deformations, start=1)]
    return judge_all(relate_deformations(numbered, elements), elements, lambda _: settings)


class StepTimer:
    """Sums up how long the steps of a detection take.

    >>> timer = StepTimer()
    >>> with timer("surface"):
    ...     pass
    >>> list(timer.seconds)
    ['surface']
    """

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    @contextmanager
    def __call__(self, step: str) -> Iterator[None]:
        """Time what is done within the context; several times add up."""
        start = time.perf_counter()
        yield
        self.seconds[step] = self.seconds.get(step, 0.0) + time.perf_counter() - start
