"""Clouds of any size, plants side by side: `python -m tests.bench.clouds FILE MILLION`."""

import sys
from pathlib import Path

import numpy as np

from pipecore.io.writing import write_laz
from pipecore.simulate import random_scene, scan
from pipecore.types import PointCloud

FIRST_SEED = 1000
GAP = 2.0
"""Between two plants, metres."""


def write_cloud(path: Path, million: float) -> None:
    """Write a LAZ file of plants with together so many million points.

    The last plant is cut off where the size is reached, across, so that its spacing stays.
    """
    wanted = round(1e6 * million)
    tiles: list[PointCloud] = []
    n_points, edge, seed = 0, 0.0, FIRST_SEED
    while n_points < wanted:
        cloud = scan(random_scene(seed, stations=4)).cloud
        nearest_first = np.argsort(cloud.xyz[:, 0], kind="stable")[: wanted - n_points]
        rows = np.sort(nearest_first)
        xyz = cloud.xyz[rows]
        xyz[:, 0] += edge - xyz[:, 0].min()
        assert cloud.intensity is not None
        assert cloud.rgb is not None
        tiles.append(PointCloud(np.zeros(3), xyz, cloud.intensity[rows], cloud.rgb[rows]))
        n_points, edge, seed = n_points + len(xyz), float(xyz[:, 0].max()) + GAP, seed + 1
    whole = PointCloud(
        np.zeros(3),
        np.concatenate([t.xyz for t in tiles]),
        np.concatenate([t.intensity for t in tiles if t.intensity is not None]),
        np.concatenate([t.rgb for t in tiles if t.rgb is not None]),
    )
    write_laz(path, whole)


if __name__ == "__main__":
    write_cloud(Path(sys.argv[1]), float(sys.argv[2]))
