"""Random sections of plants, the same for the same seed."""

import dataclasses
from dataclasses import replace
from typing import Any

import numpy as np

from pipecore.errors import SceneError
from pipecore.simulate.deforming import deform
from pipecore.simulate.planner import Planner
from pipecore.simulate.scene import Scanner, Scene
from pipecore.simulate.surroundings import Surroundings


def random_scene(
    seed: int,
    *,
    stations: int = 4,
    deformed: bool = True,
    clutter: bool = True,
    spacing: float = 0.01,
    noise: float = 0.002,
    scanner: Scanner | None = None,
) -> Scene:
    """Return a plausible section of a plant, about 9 × 7 × 4 m, the same for the same seed.

    Pipes touch, nearly touch, lie on beams and posts and cross in contact, but never
    penetrate each other.

    Parameters
    ----------
    seed : int
    stations : int
        Number of scanner stations around it, 1 to 6.
    deformed : bool
        Whether some pipes have dents, bulges, oval stretches or bows.
    clutter : bool
        Whether there are floor, wall, supports, trays, valves and people.
    spacing, noise : float
        Point spacing on the pipes and standard deviation of ranges, metres.
    scanner : Scanner, optional
        All other properties of the scanner.

    Returns
    -------
    Scene

    Raises
    ------
    SceneError
        If the number of stations is not within 1 to 6.
    """
    if not 1 <= stations <= 6:
        raise SceneError(f"A random scene has 1 to 6 stations, not {stations}.")
    planner = Planner(np.random.default_rng(seed))
    planner.add_racks()
    planner.add_vessel()
    planner.add_risers()
    planner.add_crossings()
    planner.add_oblique_pipes()
    surroundings = Surroundings(planner)
    if clutter:
        surroundings.add_clutter()
    positions = surroundings.find_stations(stations)
    runs = tuple(planner.room.runs)
    if deformed:
        runs = deform(runs, planner.is_free, positions, planner.rng)
    scene = Scene(
        runs,
        positions,
        tuple(planner.clutter),
        replace(scanner or Scanner(), spacing=spacing, noise=noise),
        seed=seed,
        name=f"random plant {seed}",
    )
    # Half of the plants stand askew to the coordinates, as real ones do.
    yaw_deg = float(planner.rng.uniform(0, 90)) if planner.rng.uniform() < 0.5 else 0.0
    askew: Scene = turned(scene, yaw_deg)
    return askew


def turned(thing: Any, yaw_deg: float) -> Any:
    """Return a scene, or anything in it, turned about the vertical through the local zero."""
    if dataclasses.is_dataclass(thing) and not isinstance(thing, type):
        changes = {
            f.name: turned(getattr(thing, f.name), yaw_deg)
            for f in dataclasses.fields(thing)
            if f.name not in {"size", "origin", "deformations"}
        }
        if "yaw_deg" in changes:
            changes["yaw_deg"] += yaw_deg
        return replace(thing, **changes)
    if isinstance(thing, tuple):
        if len(thing) == 3 and all(isinstance(c, float) for c in thing):
            c, s = np.cos(np.deg2rad(yaw_deg)), np.sin(np.deg2rad(yaw_deg))
            return (
                float(c * thing[0] - s * thing[1]),
                float(s * thing[0] + c * thing[1]),
                thing[2],
            )
        return tuple(turned(t, yaw_deg) for t in thing)
    return thing
