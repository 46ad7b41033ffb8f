"""Where the camera goes to show a selection. Nothing here knows VTK."""

from dataclasses import replace

import numpy as np

from pipecore.geometry import Array, unit
from pipecore.types import Deformation, Element, ElementKind, Profiles, SurfaceOfRevolution
from pipegui.scene import pose as poses
from pipegui.scene import shapes
from pipegui.scene.pose import VIEW_ANGLE, Pose
from pipegui.states.view_state import SceneState

ELEMENT_MARGIN = 1.6
"""Some of the surroundings help to see where an element is."""
SMALLEST_SHARE = 0.15
"""Of the picture's height; smaller things do not count as seen well."""

OPEN = 0.35
"""Ratio of the axes of a circle as seen, from which it looks like one."""
ASIDE = np.deg2rad(20)
LOOK_ROUND = np.deg2rad(35)


def aim(state: SceneState, pose: Pose, aspect: float, *, stay_if_seen: bool) -> Pose | None:
    """Return the pose that shows the selection of `state`, or None to stay.

    Parameters
    ----------
    state : SceneState
    pose : Pose
        Where the camera is.
    aspect : float
        Width over height of the picture.
    stay_if_seen : bool
        Whether to stay where the selected element or run is already seen well.
    """
    result, selection = state.result, state.selection
    if result is None:
        return None
    if state.profile is not None:
        return _aim_at_profile(state.profile, pose)
    if selection.deformation_id:
        deformation = result.deformation(selection.deformation_id)
        return _aim_at_deformation(
            deformation, result.element(deformation.element_id), pose, aspect
        )
    elements: tuple[SurfaceOfRevolution, ...] = tuple(
        e
        for e in result.elements
        if (e.element_id == selection.element_id if selection.element_id else True)
        and selection.run_id == e.run_id
    )
    if selection.candidate_id:
        elements = (result.candidate(selection.candidate_id),)
    if not elements:
        return None
    points = shapes.outline(elements)
    if stay_if_seen and _is_seen(points, pose, aspect):
        return None
    return poses.framing(pose, points, aspect, ELEMENT_MARGIN)


def _aim_at_profile(profile: Profiles, pose: Pose) -> Pose:
    """Follow from profile to profile; turn only where the ellipse would look like a line."""
    radius, normal = float(profile.radius[0]), profile.normal[0]
    distance = float(np.clip(pose.distance, 12 * radius, 30 * radius))
    pose = replace(pose, focus=profile.centre[0], distance=distance)
    turned = [
        replace(pose, heading=pose.heading + turn, elevation=float(np.clip(tilt, -1.2, 1.2)))
        for turn, tilt in (
            (0.0, pose.elevation),
            (LOOK_ROUND, pose.elevation),
            (-LOOK_ROUND, pose.elevation),
            (0.0, pose.elevation + LOOK_ROUND),
            (0.0, pose.elevation - LOOK_ROUND),
        )
    ]
    open_enough = (p for p in turned if abs(p.forward @ normal) > OPEN)
    return next(open_enough, max(turned, key=lambda p: abs(p.forward @ normal)))


def _aim_at_deformation(
    deformation: Deformation, element: Element, pose: Pose, aspect: float
) -> Pose:
    """Look at the peak from outside, with enough of the pipe around it."""
    if element.kind is ElementKind.SPHERE:
        inside = element.centre
    else:
        inside = element.axis.at(float(np.clip(deformation.chainage, 0, element.axis.length)))
    pose = poses.looking_along(pose, unit(inside - deformation.peak))
    # A little from the side: depth shows where a pipe is not seen square on.
    pose = replace(pose, heading=pose.heading + ASIDE)
    half = max(1.5 * deformation.length, 6.0 * element.radius, 0.3)
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    return poses.framing(pose, inside + half / np.sqrt(3) * corners, aspect)


def _is_seen(points: Array, pose: Pose, aspect: float) -> bool:
    offset = points - pose.position
    depth = offset @ pose.forward
    if (depth <= 0).any():
        return False
    half = np.tan(VIEW_ANGLE / 2)
    x, y = offset @ pose.right / depth / half / aspect, offset @ pose.up / depth / half
    inside = (np.abs(x) < 1) & (np.abs(y) < 1)
    size = max(np.ptp(x) * aspect, np.ptp(y)) / 2
    return bool(inside.all() and size > SMALLEST_SHARE)
