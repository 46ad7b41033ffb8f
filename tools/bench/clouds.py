"""Clouds of any size, plants side by side: `python -m tools.bench.clouds FILE MILLION`.

The first plants are all different; then they come again, turned about the vertical every
other time, so that hundreds of millions of points are made in minutes.
"""

import sys
from collections.abc import Iterator
from pathlib import Path

import laspy
import numpy as np

from pipecore.simulate import random_scene, scan

FIRST_SEED, N_DIFFERENT = 1000, 6
GAP = 2.0
"""Between two plants, metres."""
STEP = 1e-4
"""Of the coordinates written, metres."""

Plant = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Coordinates from the plant's lowest corner, intensity and colour of its points."""


def make_plant(seed: int) -> Plant:
    """Scan a random plant; its points in the scanner's order."""
    cloud = scan(random_scene(seed, stations=4)).cloud
    assert cloud.intensity is not None
    assert cloud.rgb is not None
    xyz = np.asarray(cloud.xyz, np.float64)
    low, high = cloud.intensity.min(), cloud.intensity.max()
    intensity = (65535 * (cloud.intensity - low) / (high - low)).astype(np.uint16)
    return xyz - xyz.min(axis=0), intensity, cloud.rgb


def plants() -> Iterator[Plant]:
    """Yield plants without end: the different ones, then turned and not turned ones of them."""
    made: list[Plant] = []
    for seed in range(FIRST_SEED, FIRST_SEED + N_DIFFERENT):
        made.append(make_plant(seed))
        yield made[-1]
    is_turned = True
    while True:
        for xyz, intensity, rgb in made:
            if is_turned:
                turned = xyz * [-1.0, -1.0, 1.0]
                yield turned - turned.min(axis=0), intensity, rgb
            else:
                yield xyz, intensity, rgb
        is_turned = not is_turned


def write_cloud(path: Path, million: float) -> None:
    """Write a LAS or LAZ file of plants with together so many million points.

    The last plant is cut off where the size is reached, across, so that its spacing stays.
    """
    wanted = round(1e6 * million)
    header = laspy.LasHeader(version="1.4", point_format=7)
    header.scales = np.full(3, STEP)
    n_points, edge = 0, 0.0
    with laspy.open(path, mode="w", header=header) as writer:
        for xyz, intensity, rgb in plants():
            nearest_first = np.argsort(xyz[:, 0], kind="stable")[: wanted - n_points]
            rows = np.sort(nearest_first)
            points = laspy.ScaleAwarePointRecord.zeros(len(rows), header=header)
            place = xyz[rows]
            place[:, 0] += edge
            for axis, name in enumerate("XYZ"):
                points[name] = np.round(place[:, axis] / STEP).astype(np.int32)
            points["intensity"] = intensity[rows]
            for colour, name in enumerate(("red", "green", "blue")):
                points[name] = rgb[rows, colour].astype(np.uint16) * 257
            writer.write_points(points)
            n_points, edge = n_points + len(rows), float(place[:, 0].max()) + GAP
            if n_points >= wanted:
                return


if __name__ == "__main__":
    write_cloud(Path(sys.argv[1]), float(sys.argv[2]))
