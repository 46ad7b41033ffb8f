"""A second world to test in: scenes that break the habits of the plant simulator.

Its surfaces are exact, drawn by seed and sampled by code of its own (no ray casting): pipes
that are oval, rough, dented, bowed; views from all round or few places; scan lines, grids,
uneven density; noise in all directions, shared by neighbours, rounded; and things that are no
pipes. The truth has the form of `pipecore.simulate.truth`.

>>> from tools.world import scene
>>> drawn = scene(7, "lone")
>>> drawn.cloud, drawn.truth
"""

from tools.world.families import FAMILIES, scene
from tools.world.scenes import WorldScene

__all__ = ["FAMILIES", "WorldScene", "scene"]
