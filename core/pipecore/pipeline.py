"""The pipeline, in the paper's order, wherever the points are."""

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import TypeVar

import numpy as np

from pipecore.axes import join_centres
from pipecore.deformation import relate_deformations
from pipecore.elements import NearbyPoints, build_elements, find_pieces
from pipecore.elements.sections import tabulate_ellipses
from pipecore.ellipses import Ellipses
from pipecore.measurement import measure_elements
from pipecore.progress import NoProgress, Progress
from pipecore.rules import Rule, judge, load_rule
from pipecore.segments import Overlay
from pipecore.settings import Settings
from pipecore.stacks import choose_stacks
from pipecore.types import Deformation, Element, PointCloud, Profiles, Result
from pipecore.workspace import InMemory, Workspace, spread

STAGES = {
    "thinning": 0.08,
    "normals": 0.10,
    "directions": 0.04,
    "profiles": 0.28,
    "segments": 0.03,
    "ellipses": 0.02,
    "axes": 0.03,
    "elements": 0.22,
    "deformations": 0.20,
}
"""The stages in their order, with the share of the time that each usually takes."""


def detect(
    cloud: PointCloud, settings: Settings = Settings(), progress: Progress = NoProgress()
) -> Result:
    """Find the elements of a cloud and their deformations.

    Parameters
    ----------
    cloud : PointCloud
    settings : Settings
    progress : Progress
        Told the stages of `STAGES`.

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
    """
    return detect_in(InMemory(cloud), settings, progress)


def detect_in(points: Workspace, settings: Settings, progress: Progress) -> Result:
    """Find the elements of a workspace's cloud and their deformations; see `detect`."""
    cloud = points.cloud
    rule = load_rule(settings.deformation.rule)
    if len(cloud) == 0:
        return _nothing_found(cloud, settings)
    seconds: dict[str, float] = {}
    with _timed(seconds, "surface"):
        surface = points.sample_surface(settings.thinning, progress)
    with _timed(seconds, "stacks"):
        stacks = choose_stacks(surface, settings.stacks, progress, points.local_axes)
        overlay, found = Overlay(len(surface.xyz), points.allocate), []
        uneven = points.leave_out_planes(surface, overlay.add_planes, settings, progress)
    for stack, span in _shares(stacks):
        # Stack by stack: the curves of all together need more memory than the cloud.
        with _timed(seconds, "profiles"):
            for curve_points, starts, own in points.cut(uneven, stack, settings, progress, span):
                overlay.add(curve_points, starts)
                found.append(own)
    del uneven
    with _timed(seconds, "segments"):
        segments = overlay.number_segments(progress)
        segment_id = spread(segments, surface.behind, points.allocate, progress)
    with _timed(seconds, "ellipses"):
        progress.update("ellipses", 0.0)
        ellipses = Ellipses.concatenate(found)
        found.clear()  # the same again
    with _timed(seconds, "axes"):
        chains = join_centres(ellipses, progress)
    with _timed(seconds, "elements"):
        pieces = find_pieces(ellipses, chains, progress)
        nearby = NearbyPoints(cloud, surface, progress, points.allocate)
        built = build_elements(pieces, nearby, settings.elements, progress)
        profiles = tabulate_ellipses(built.elements, ellipses)
    with _timed(seconds, "deformations"):
        measured = measure_elements(
            built,
            nearby,
            len(cloud),
            stacks[0].width,
            settings.deformation,
            settings.ellipses.fit,
            progress,
            allocate=points.allocate,
        )
        deformations = judge_deformations(measured.deformations, measured.elements, rule)
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
        seconds=seconds,
    )


def _nothing_found(cloud: PointCloud, settings: Settings) -> Result:
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
    )


def judge_deformations(
    deformations: tuple[Deformation, ...], elements: tuple[Element, ...], rule: Rule
) -> tuple[Deformation, ...]:
    """Number the deformations, relate them to their surroundings, judge them by a rule."""
    numbered = [replace(d, deformation_id=i) for i, d in enumerate(deformations, start=1)]
    return tuple(
        replace(d, rule=rule.name, verdict=judge(d, elements[d.element_id - 1], rule))
        for d in relate_deformations(numbered, elements)
    )


Item = TypeVar("Item")


def _shares(items: Sequence[Item]) -> Iterator[tuple[Item, tuple[float, float]]]:
    """Each item with the part of its stage that it is."""
    for i, item in enumerate(items):
        yield item, (i / len(items), (i + 1) / len(items))


@contextmanager
def _timed(seconds: dict[str, float], step: str) -> Iterator[None]:
    start = time.perf_counter()
    yield
    seconds[step] = seconds.get(step, 0.0) + time.perf_counter() - start
