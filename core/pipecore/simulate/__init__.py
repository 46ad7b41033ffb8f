"""Simulated scans of pipe installations, with known truth."""

from pathlib import Path

from pipecore.errors import SceneError
from pipecore.resources import resource
from pipecore.simulate.pipes import random_pipe
from pipecore.simulate.plants import random_scene
from pipecore.simulate.scanner import SimulatedScan, scan
from pipecore.simulate.scene import Scanner, Scene
from pipecore.simulate.scenefile import load_scene, save_scene
from pipecore.simulate.truth import TrueDeformation, TrueElement, Truth, load_truth

__all__ = [
    "Scanner",
    "Scene",
    "SimulatedScan",
    "TrueDeformation",
    "TrueElement",
    "Truth",
    "find_scene",
    "load_scene",
    "load_truth",
    "random_pipe",
    "random_scene",
    "save_scene",
    "scan",
]


def find_scene(name: str) -> Scene:
    """Return the scene called "demo" or "random:SEED", or that of a TOML file.

    Parameters
    ----------
    name : str
        "demo", "random:SEED", or the path of a TOML file.

    Returns
    -------
    Scene

    Raises
    ------
    SceneError
        If there is no such scene or file, or the file is not valid.
    """
    if name == "demo":
        return load_scene(resource("demo", "demo.toml"))
    if name.startswith("random:"):
        seed = name.removeprefix("random:")
        if not seed.isdecimal():
            raise SceneError(f"“{seed}” is no seed; give a whole number, as in random:7.")
        return random_scene(int(seed))
    return load_scene(Path(name))
