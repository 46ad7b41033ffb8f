"""Where the camera is: turning, moving and flying it, as functions from pose to pose.

The camera is a turntable's: height stays up, and a heading and an elevation say where
it looks. Nothing here knows VTK.
"""

from dataclasses import dataclass, replace

import numpy as np

from pipecore.geometry import Array

VIEW_ANGLE = np.deg2rad(35.0)
MIN_DISTANCE = 0.02
STEEPEST = np.pi / 2

STANDARD_VIEWS = {
    "top": (0.0, 90.0),
    "bottom": (0.0, -90.0),
    "front": (0.0, 0.0),
    "back": (180.0, 0.0),
    "right": (-90.0, 0.0),
    "left": (90.0, 0.0),
    "iso": (-35.0, 30.0),
}
"""Heading and elevation in degrees."""


@dataclass(frozen=True, eq=False)
class Pose:
    """A camera that looks at `focus` from `distance` metres.

    Parameters
    ----------
    focus : ndarray, shape (3,)
    distance : float
    heading : float
        Compass direction in which it looks, radians clockwise from grid north (+Y).
    elevation : float
        How far it looks down, radians; π/2 is straight down with north up.
    """

    focus: Array
    distance: float
    heading: float = np.deg2rad(STANDARD_VIEWS["iso"][0])
    elevation: float = np.deg2rad(STANDARD_VIEWS["iso"][1])

    @property
    def forward(self) -> Array:
        """Unit vector in which the camera looks."""
        flat = np.cos(self.elevation)
        return np.array(
            [np.sin(self.heading) * flat, np.cos(self.heading) * flat, -np.sin(self.elevation)]
        )

    @property
    def right(self) -> Array:
        """Unit vector to the right of the picture."""
        return np.array([np.cos(self.heading), -np.sin(self.heading), 0.0])

    @property
    def up(self) -> Array:
        """Unit vector to the top of the picture."""
        return np.cross(self.right, self.forward)

    @property
    def position(self) -> Array:
        """Where the camera stands."""
        return self.focus - self.distance * self.forward


def orbit(pose: Pose, turn: float, tilt: float, pivot: Array) -> Pose:
    """Return the pose turned by `turn` and tilted by `tilt` radians; `pivot` keeps its place."""
    turned = replace(
        pose,
        heading=pose.heading + turn,
        elevation=float(np.clip(pose.elevation + tilt, -STEEPEST, STEEPEST)),
    )
    offset = pivot - pose.position
    seen = [offset @ axis for axis in (pose.right, pose.up, pose.forward)]
    axes = (turned.right, turned.up, turned.forward)
    position = pivot - sum(s * axis for s, axis in zip(seen, axes, strict=True))
    return replace(turned, focus=position + pose.distance * turned.forward)


def pan(pose: Pose, right: float, up: float) -> Pose:
    """Return the pose moved by metres to the right and up in the picture."""
    return replace(pose, focus=pose.focus + right * pose.right + up * pose.up)


def zoom(pose: Pose, factor: float, target: Array) -> Pose:
    """Return the pose with all distances to `target` times `factor`; `target` keeps its place."""
    factor = max(factor, MIN_DISTANCE / pose.distance)
    position = target + factor * (pose.position - target)
    distance = factor * pose.distance
    return replace(pose, distance=distance, focus=position + distance * pose.forward)


def standard_view(pose: Pose, name: str) -> Pose:
    """Return the pose looking from a standard side, such as "top"."""
    heading, elevation = np.deg2rad(STANDARD_VIEWS[name])
    return replace(pose, heading=heading, elevation=elevation)


def looking_along(pose: Pose, forward: Array, *, steepest: float = np.deg2rad(50)) -> Pose:
    """Return the pose looking along `forward`, no steeper than `steepest` up or down."""
    flat = float(np.hypot(forward[0], forward[1]))
    elevation = float(np.arctan2(-forward[2], flat))
    # Straight down or up has no heading: keep the one there is.
    heading = np.arctan2(forward[0], forward[1]) if flat > 0.2 else pose.heading
    return replace(
        pose, heading=float(heading), elevation=float(np.clip(elevation, -steepest, steepest))
    )


def framing(
    pose: Pose, points: Array, aspect: float, margin: float = 1.15, *, parallel: bool = False
) -> Pose:
    """Return the pose moved so that `points` (n, 3) fill the picture but for a margin.

    Parameters
    ----------
    aspect : float
        Width over height of the picture.
    margin : float
        1 leaves none.
    parallel : bool
        Whether the picture is drawn without perspective.
    """
    axes = np.stack([pose.right, pose.up, pose.forward])
    seen = points @ axes.T
    if parallel:
        low, high = seen.min(axis=0), seen.max(axis=0)
        half = float(((high - low)[:2] / [aspect, 1.0]).max()) / 2 * margin
        distance = max(half / np.tan(VIEW_ANGLE / 2), 10 * MIN_DISTANCE)
        return replace(pose, focus=(low + high) / 2 @ axes, distance=distance)
    # A point at depth d is in the picture if it is at most d · slope to the side: two planes
    # through the camera for each side, and the camera is where those that touch meet.
    slope = np.tan(VIEW_ANGLE / 2) / margin * np.array([aspect, 1.0])
    low = (seen[:, :2] - slope * seen[:, 2:]).max(axis=0)
    high = (seen[:, :2] + slope * seen[:, 2:]).min(axis=0)
    across = (low + high) / 2
    middle = (seen[:, 2].min() + seen[:, 2].max()) / 2
    behind = float(((high - low) / (2 * slope)).min())
    distance = max(middle - behind, 10 * MIN_DISTANCE)
    return replace(pose, focus=np.append(across, middle) @ axes, distance=distance)


def between(start: Pose, end: Pose, share: float) -> Pose:
    """Return the pose at `share` (0 … 1) of the way, turning the short way round."""
    turn = np.mod(end.heading - start.heading + np.pi, 2 * np.pi) - np.pi
    return Pose(
        (1 - share) * start.focus + share * end.focus,
        float(start.distance ** (1 - share) * end.distance**share),
        start.heading + share * turn,
        start.elevation + share * (end.elevation - start.elevation),
    )
