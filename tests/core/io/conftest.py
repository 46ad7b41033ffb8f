"""Points whose truth is known, in no format yet."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pipecore.types import PointCloud

FAR = np.array([10_000_000.0, 5_400_000.0, 120.0])


@dataclass(frozen=True)
class Points:
    """World coordinates in metres, whole tenths of a millimetre, and what goes with them."""

    xyz: NDArray[np.float64]
    intensity: NDArray[np.int64]
    rgb: NDArray[np.uint8]

    def hold(self, cloud: PointCloud, tolerance: float = 1e-4) -> bool:
        """Tell whether a cloud is these points, in their order."""
        world = cloud.world(cloud.xyz.astype(np.float64))
        return world.shape == self.xyz.shape and bool(np.abs(world - self.xyz).max() <= tolerance)

    def rows(self) -> list[tuple[Any, ...]]:
        """Return x, y, z, intensity, red, green, blue of each point."""
        return [
            (*p, i, *c)
            for p, i, c in zip(
                self.xyz.tolist(), self.intensity.tolist(), self.rgb.tolist(), strict=True
            )
        ]


def make_points(rng: np.random.Generator, n: int = 1000) -> Points:
    """Return points in a box of 60 m that is 10,000 km from zero."""
    return Points(
        np.round(FAR + rng.uniform(-30, 30, (n, 3)), 4),
        rng.integers(0, 65536, n),
        rng.integers(0, 256, (n, 3), dtype=np.uint8),
    )


@pytest.fixture
def points(rng: np.random.Generator) -> Points:
    return make_points(rng)
