"""Pictures of scenes, to see that they are what they claim."""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from tools.world.assembly import Role
from tools.world.scenes import WorldScene

COLOURS = {
    Role.PIPE: "#0072B2",
    Role.CLUTTER: "#999999",
    Role.CAP: "#CC79A7",
    Role.IGNORE: "#E69F00",
}
SHOWN = 40_000
"""Points of a picture."""


def picture(drawn: WorldScene, path: Path, title: str) -> None:
    """Draw a scene's points by the role of their bodies, from two sides."""
    rng = np.random.default_rng(0)
    rows = rng.permutation(len(drawn.cloud))[:SHOWN]
    points, body = drawn.cloud.xyz[rows], drawn.body[rows]
    colour = np.array([COLOURS[b.role] for b in drawn.bodies])[body]
    figure = Figure(figsize=(14, 7), layout="tight")
    for k, (elevation, azimuth) in enumerate(((25, -60), (25, 30))):
        axes = figure.add_subplot(1, 2, k + 1, projection="3d")
        axes.scatter(*points.T, c=colour, s=0.6, linewidths=0)
        axes.view_init(elevation, azimuth)
        axes.set_aspect("equal")
        stations = drawn.cloud.stations
        if len(stations) and k == 0:
            axes.scatter(*stations.T, c="red", s=30, marker="^")
    figure.suptitle(title, fontsize=9)
    figure.savefig(path, dpi=80)
