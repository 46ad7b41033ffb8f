"""Clouds larger than memory: the same detection, in tiles on dask, through files.

>>> from pipecore.tiling import detect_in_tiles, estimate_need
>>> with detect_in_tiles([Path("plant.laz")], settings) as (cloud, result):
...     write_report("report", cloud, result)

Every step is cut where its result does not change: voxels into slabs of whole planes,
normals into the same slabs with a margin, profiles into batches of whole profiles. What
crosses the borders, segments and axes, is joined by the downsampled points that both sides share
and by the ellipses of all tiles together.
"""

from pipecore.tiling.detection import detect_in_tiles
from pipecore.tiling.memory import GIB, Need, estimate_need

__all__ = ["GIB", "Need", "detect_in_tiles", "estimate_need"]
