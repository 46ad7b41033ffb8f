"""Simulated scans of pipe installations, with known truth."""

from pipecore.simulate.scanner import Scan, scan
from pipecore.simulate.scene import Scene
from pipecore.simulate.scenefile import load_scene, save_scene
from pipecore.simulate.truth import TrueDeformation, TrueElement, Truth, load_truth

__all__ = [
    "Scan",
    "Scene",
    "TrueDeformation",
    "TrueElement",
    "Truth",
    "load_scene",
    "load_truth",
    "save_scene",
    "scan",
]
