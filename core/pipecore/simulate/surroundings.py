"""What stands around the pipes of a random plant, and where its scanner stands."""

from dataclasses import dataclass

import numpy as np

from pipecore.geometry import unit
from pipecore.simulate.planner import (
    ACROSS,
    ALONG,
    NEAR_CONTACT,
    RACK_DEPTH,
    RACK_LENGTH,
    UP,
    Planner,
    as_vector,
)
from pipecore.simulate.scene import (
    Beam,
    Box,
    Person,
    Straight,
    Tray,
    TrayStyle,
    Valve,
    Vector,
    Wire,
)


@dataclass
class Surroundings:
    """Clutter and stations for the pipes of a plan."""

    plan: Planner
    wall_y: float = -2.0
    """Face of the wall behind the rack, or as far as stations may stand without one."""

    def add_clutter(self) -> None:
        """Floor, wall, supports under the levels, tray, valves, cabinet, rods and someone."""
        low_y = min(float((b.centres[:, 1] - b.radii).min()) for b in self.plan.room.bodies)
        length, middle = RACK_LENGTH + 3.0, RACK_LENGTH / 2
        self.plan.clutter.append(Box((middle, 2.2, -0.05), (length, 9.0, 0.1)))
        self.wall_y = low_y - float(self.plan.rng.choice([NEAR_CONTACT, 0.05, 0.3]))
        self.plan.clutter.append(
            Box((middle, self.wall_y - 0.05, 1.7), (length, 0.1, 3.4), material="plaster")
        )
        self.plan.room.blocks.append(
            (np.array([-5.0, self.wall_y - 0.1, 0.0]), np.array([12.0, self.wall_y, 3.4]))
        )
        for level in self.plan.supports[1:]:
            for x in self.plan.rng.uniform([0.3, 2.4, 4.2], [1.2, 3.4, 5.4]):
                self._support(float(x), level)
        self._tray()
        for _ in range(3):
            self._valve()
        self._cabinet()
        for _ in range(3):
            self._wire()
        if self.plan.rng.uniform() < 0.5:
            foot = self.plan.rng.uniform([0.0, RACK_DEPTH + 0.6, 0.0], [RACK_LENGTH, 5.0, 0.0])
            low, high = foot - np.array([0.3, 0.3, 0.0]), foot + np.array([0.3, 0.3, 1.8])
            if self.plan.room.add_block(low, high):
                self.plan.clutter.append(
                    Person(as_vector(foot), yaw_deg=float(self.plan.rng.uniform(0, 360)))
                )

    def _support(self, x: float, level: float) -> None:
        """A beam under a level on two posts; a post alone under each pipe if it cannot be."""
        height, width = 0.16, 0.09
        low = np.array([x - width / 2, -0.1, level - height])
        high = np.array([x + width / 2, RACK_DEPTH + 0.1, level])
        if self.plan.room.add_block(low, high):
            self.plan.clutter.append(
                Beam((x, -0.1, level), (x, RACK_DEPTH + 0.1, level), height, width)
            )
            for y in (-0.05, RACK_DEPTH + 0.05):
                top = level - height
                self.plan.add_box(np.array([x, y, top / 2]), np.array([0.1, 0.1, top]), "red oxide")
            return
        for run in self.plan.room.runs:
            if run.direction == ALONG and abs(run.start[2] - run.radius - level) < 1e-6:
                centre = np.array([x, run.start[1], level / 2])
                self.plan.add_box(centre, np.array([0.08, 0.08, level]), "red oxide")

    def _tray(self) -> None:
        for _ in range(10):
            y, z = self.plan.rng.uniform([-0.2, 0.3], [RACK_DEPTH + 0.5, 3.1])
            width = float(self.plan.rng.choice([0.15, 0.3, 0.4]))
            low = np.array([0.0, y - width / 2, z])
            high = np.array([RACK_LENGTH, y + width / 2, z + 0.06])
            if self.plan.room.add_block(low, high):
                style = list(TrayStyle)[self.plan.rng.integers(2)]
                self.plan.clutter.append(Tray((0.0, y, z), (RACK_LENGTH, y, z), width, style=style))
                return

    def _valve(self) -> None:
        """A valve around a straight of some run, where its bonnet and wheel have room."""
        index = int(self.plan.rng.integers(len(self.plan.room.runs)))
        run = self.plan.room.runs[index]
        if not isinstance(run.pieces[0], Straight) or run.radius > 0.12:
            return
        direction = unit(run.direction)
        stem = np.array(UP if abs(direction[2]) < 0.8 else ACROSS)
        stem = unit(stem - (stem @ direction) * direction)
        share = self.plan.rng.uniform(0.3, 0.7)
        centre = np.array(run.start) + share * run.pieces[0].length * direction
        others = [b for i, b in enumerate(self.plan.room.bodies) if i != index]
        r = run.radius
        body = np.array([centre + h * stem for h in np.linspace(0.0, 4.4 * r, 8)])
        # A sphere of the body's half diagonal must keep clear of all other pipes.
        if all(
            np.linalg.norm(b.centres - p, axis=1).min() > b.radii.max() + 2.0 * r
            for b in others
            for p in body
        ):
            self.plan.clutter.append(
                Valve(as_vector(centre), as_vector(direction), as_vector(stem), r)
            )

    def _cabinet(self) -> None:
        size = self.plan.rng.uniform([0.4, 0.3, 0.8], [1.0, 0.6, 2.0])
        x, y = self.plan.rng.uniform([-1.0, -0.5], [RACK_LENGTH + 0.5, RACK_DEPTH + 2.0])
        self.plan.add_box(np.array([x, y, size[2] / 2]), size, "grey")

    def _wire(self) -> None:
        ends = self.plan.rng.uniform([-0.5, -0.3, 1.0], [RACK_LENGTH, RACK_DEPTH, 3.3], (2, 3))
        along = np.linspace(0.0, 1.0, 8)[:, None]
        points = ends[0] + along * (ends[1] - ends[0])
        points[:, 2] -= 0.3 * (4 * along * (1 - along))[:, 0]
        if all(self.plan.room.is_free(p, 0.03) for p in points):
            self.plan.clutter.append(Wire(tuple(as_vector(p) for p in points)))

    def find_stations(self, n_stations: int) -> tuple[Vector, ...]:
        """Places around the rack with room for a tripod."""
        wished = [
            (1.3, RACK_DEPTH + 2.4),
            (-1.2, 1.4),
            (RACK_LENGTH + 1.1, 1.4),
            (4.7, RACK_DEPTH + 2.4),
            (-0.8, RACK_DEPTH + 1.5),
            (RACK_LENGTH + 0.8, RACK_DEPTH + 1.5),
        ]
        low, high = np.array([-1.4, self.wall_y + 0.6]), np.array([RACK_LENGTH + 1.4, 6.6])
        found: list[Vector] = []
        spread = 0.1
        while len(found) < n_stations:
            place = wished[len(found)] + spread * self.plan.rng.standard_normal(2)
            position = np.array([*place, self.plan.rng.uniform(1.4, 1.9)])
            is_inside = bool(np.all((place > low) & (place < high)))
            if is_inside and self.plan.room.is_free(position, 0.8):
                found.append(as_vector(position))
                spread = 0.1
            spread = min(1.1 * spread, 2.0)
        return tuple(found)
