"""Whether there is room for a pipe: distances between surfaces of runs and blocks."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from pipecore.geometry import Array
from pipecore.simulate.placing import place_runs
from pipecore.simulate.scene import Run, Scene

SAMPLE_STEP = 0.02
"""Distance of the sampled spheres along the axes, metres."""


@dataclass(frozen=True, eq=False)
class Body:
    """A run as spheres along its axes."""

    centres: Array
    radii: Array

    @classmethod
    def of(cls, run: Run) -> "Body":
        """Sample all elements of `run`; the last spheres reach over its domes, too."""
        centres, radii = [], []
        for placed in place_runs(Scene((run,), ())).elements:
            element = placed.element
            n_samples = max(2, int(np.ceil(element.axis.length / SAMPLE_STEP)) + 1)
            chainage = np.linspace(0.0, element.axis.length, n_samples)
            centres.append(element.axis.at(chainage))
            radii.append(element.radius_at(chainage))
        return cls(np.concatenate(centres), np.concatenate(radii))

    def gap(self, other: "Body") -> float:
        """Distance between the surfaces; negative if they penetrate."""
        smallest = np.inf
        for radius, tree in other._trees:
            distance, _ = tree.query(self.centres)
            smallest = min(smallest, float((distance - self.radii - radius).min()))
        return smallest

    def gap_to_block(self, low: Array, high: Array) -> float:
        """Distance between the surface and a block along the axes of coordinates."""
        nearest = np.clip(self.centres, low, high)
        distance = np.linalg.norm(self.centres - nearest, axis=1)
        return float((distance - self.radii).min())

    @cached_property
    def _trees(self) -> list[tuple[float, Any]]:
        """The centres by radius: the nearest centre need not have the nearest surface."""
        return [(float(r), cKDTree(self.centres[self.radii == r])) for r in np.unique(self.radii)]


@dataclass
class Room:
    """The runs and blocks placed so far. Nothing may penetrate anything."""

    runs: list[Run] = field(default_factory=list)
    bodies: list[Body] = field(default_factory=list)
    blocks: list[tuple[Array, Array]] = field(default_factory=list)

    def add_run(self, run: Run, gap: float, gap_to_blocks: float = 0.0) -> bool:
        """Add `run` if it keeps its distances; say whether it did."""
        body = Body.of(run)
        tolerance = 1e-4
        if any(body.gap(other) < gap - tolerance for other in self.bodies):
            return False
        if any(body.gap_to_block(*b) < gap_to_blocks - tolerance for b in self.blocks):
            return False
        self.runs.append(run)
        self.bodies.append(body)
        return True

    def add_block(self, low: Array, high: Array) -> bool:
        """Add a block if no pipe is in it (touching is allowed); say whether it was."""
        if any(body.gap_to_block(low, high) < -1e-4 for body in self.bodies):
            return False
        self.blocks.append((low, high))
        return True

    def is_free(self, point: Array, distance: float) -> bool:
        """Whether nothing is within `distance` of a point."""
        spot = Body(point[None], np.array([distance]))
        return all(spot.gap(b) > 0 for b in self.bodies) and all(
            spot.gap_to_block(*b) > 0 for b in self.blocks
        )
