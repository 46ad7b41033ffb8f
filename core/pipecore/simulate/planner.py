"""Planning the pipes of a random plant: racks, risers, crossings, oblique pipes, vessels."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from pipecore.geometry import Array, unit
from pipecore.simulate.room import Room
from pipecore.simulate.scene import (
    Box,
    Branch,
    Cap,
    Clutter,
    Elbow,
    Flange,
    Piece,
    Reducer,
    Run,
    Sphere,
    Straight,
    Tee,
    Vector,
)
from pipecore.simulate.sizes import SIZES, PipeSize

RACK_LENGTH = 6.0
RACK_DEPTH = 3.0
NEAR_CONTACT = 0.01
"""Pipes that nearly touch are this far apart, metres."""
CLEARANCE = 0.03
"""Free pipes, which may bulge and bow, keep this distance, metres."""

PAINTS = ("galvanised", "steel", "stainless", "cladding", "blue", "green", "yellow", "grey")
ALONG, ACROSS, UP = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


def as_vector(values: Array) -> Vector:
    """Return an array of three as a scene has it."""
    x, y, z = (float(v) for v in values)
    return x, y, z


@dataclass
class Planner:
    """Places things one after the other; what does not fit is tried otherwise or left out."""

    rng: np.random.Generator
    room: Room = field(default_factory=Room)
    clutter: list[Clutter] = field(default_factory=list)
    is_free: list[bool] = field(default_factory=list)
    """By run: whether nothing supports or nearly touches it."""
    supports: list[float] = field(default_factory=list)
    """Heights of the rack's levels."""

    def _size(self, largest_dn: int = 400, smallest_dn: int = 40) -> PipeSize:
        fitting = [s for s in SIZES if smallest_dn <= s.dn <= largest_dn]
        return fitting[self.rng.integers(len(fitting))]

    def _paint(self) -> str:
        return PAINTS[self.rng.integers(len(PAINTS))]

    def _try(
        self, make: Callable[[], Run], gap: float, *, free: bool, n_tries: int = 8
    ) -> Run | None:
        for _ in range(n_tries):
            run = make()
            if self.room.add_run(run, gap):
                self.is_free.append(free)
                return run
        return None

    def add_racks(self) -> None:
        """Parallel pipes on two or three levels, each level lying on the same beams."""
        levels = [0.0, *np.sort(self.rng.uniform([0.9, 2.0], [1.4, 2.7]))]
        for i, level in enumerate(levels):
            largest = 400 if i < 2 else 250
            # The lowest pipes lie on the floor or just above it.
            bottom = float(level) if i else float(self.rng.choice([0.0, 0.02, 0.15]))
            self.supports.append(bottom)
            y, n_pipes = float(self.rng.uniform(0.0, 0.5)), int(self.rng.integers(3, 6))
            for _ in range(n_pipes):
                size = self._size(largest)
                gap = float(self.rng.choice([0.0, NEAR_CONTACT, 0.03, 0.12, 0.3]))
                y += gap + size.radius
                if y + size.radius > RACK_DEPTH:
                    break
                start = np.array([self.rng.uniform(0.0, 0.6), y, bottom + size.radius])
                for attempt in range(6):
                    pieces = self._rack_pieces(size, plain=attempt == 5)
                    run = Run(as_vector(start), ALONG, size.radius, pieces, "", self._paint())
                    if self.room.add_run(run, 0.0):
                        self.is_free.append(False)
                        break
                y += size.radius

    def _rack_pieces(self, size: PipeSize, *, plain: bool) -> tuple[Piece, ...]:
        length = RACK_LENGTH - float(self.rng.uniform(0.0, 1.5))
        if plain:
            return (Straight(length),)
        first = float(self.rng.uniform(0.25, 0.7)) * length
        rest = length - first
        makers = (self._interrupted, self._turning_off, self._offset)
        return makers[self.rng.integers(len(makers))](size, first, rest)

    def _interrupted(self, size: PipeSize, first: float, rest: float) -> tuple[Piece, ...]:
        """A straight with a flange, a reducer or a tee in it, or nothing."""
        reducer = Reducer(1.2 * size.outside_diameter, self._smaller(size).radius)
        fittings: list[Piece | None] = [self._flange(size), reducer, self._tee(size), None]
        fitting = fittings[self.rng.integers(len(fittings))]
        if fitting is None:
            return (Straight(first + rest),)
        return (Straight(first), fitting, Straight(rest))

    def _turning_off(self, size: PipeSize, first: float, rest: float) -> tuple[Piece, ...]:
        """A straight that ends in an elbow upwards or aside."""
        bend = size.bend_radius(float(self.rng.choice([1.5, 1.5, 3.0])))
        towards = (UP, ACROSS, (0.0, -1.0, 0.0))[self.rng.integers(3)]
        angle = 90.0
        if towards != UP:
            angle = float(self.rng.choice([90.0, 45.0, self.rng.uniform(20, 80)]))
        after = float(self.rng.uniform(0.4, 1.2))
        return (Straight(first + 0.3 * rest), Elbow(angle, bend, towards), Straight(after))

    def _offset(self, size: PipeSize, first: float, rest: float) -> tuple[Piece, ...]:
        """Two elbows that move the run aside."""
        bend = size.bend_radius(float(self.rng.choice([1.5, 3.0])))
        angle = float(self.rng.choice([45.0, 30.0, 60.0]))
        sides = (ACROSS, (0.0, -1.0, 0.0))
        i = int(self.rng.integers(2))
        return (
            Straight(0.6 * first),
            Elbow(angle, bend, sides[i]),
            Straight(float(self.rng.uniform(0.2, 0.6))),
            Elbow(angle, bend, sides[1 - i]),
            Straight(rest),
        )

    def _flange(self, size: PipeSize) -> Flange:
        return Flange(size.flange_diameter / 2, size.flange_thickness, size.n_bolts)

    def _smaller(self, size: PipeSize) -> PipeSize:
        i = SIZES.index(size)
        return SIZES[max(0, i - int(self.rng.integers(1, 4)))] if i else SIZES[1]

    def _tee(self, size: PipeSize) -> Tee:
        small = self._smaller(size) if size is not SIZES[0] else size
        reach = size.outside_diameter
        pieces: tuple[Piece, ...] = (Straight(reach + float(self.rng.uniform(0.2, 0.8))),)
        if self.rng.uniform() < 0.5:
            pieces += (self._flange(small), Straight(0.2))
        return Tee(2 * reach, Branch(UP, small.radius, pieces))

    def add_vessel(self) -> None:
        """A vessel or tank beside the rack, lying or standing, and at times a sphere."""
        radius = float(self.rng.uniform(0.35, 0.8))
        length = float(self.rng.uniform(1.2, 2.2))
        x, y = self.rng.uniform(1.0, 4.5), RACK_DEPTH + radius + self.rng.uniform(0.4, 0.9)
        pieces = (Cap(), Straight(length), Cap())
        paint = self._paint()
        if self.rng.uniform() < 0.5:
            z = radius + 0.3
            run = Run((x - length / 2, y, z), ALONG, radius, pieces, "vessel", paint)
            if self.room.add_run(run, 0.05):
                self.is_free.append(False)
                for s in (-0.3, 0.3):
                    self._saddle(np.array([x + s * length, y, z]), radius)
        else:
            z = radius / 2 + 0.1
            run = Run((x, y, z), UP, radius, pieces, "tank", paint)
            if self.room.add_run(run, 0.05):
                self.is_free.append(False)
        if self.rng.uniform() < 0.5:
            ball = float(self.rng.uniform(0.15, 0.35))
            size = self._size(80)
            x = float(self.rng.uniform(0.5, 5.0))
            z = float(self.rng.uniform(0.8, 1.6))

            def with_sphere() -> Run:
                start = (x, RACK_DEPTH + float(self.rng.uniform(0.3, 2.0)), z - 0.5 - ball)
                pieces = (Straight(0.5), Sphere(ball), Straight(0.5))
                return Run(start, UP, size.radius, pieces, "sphere", self._paint())

            self._try(with_sphere, 0.05, free=False)

    def _saddle(self, axis_point: Array, radius: float) -> None:
        """A plinth under a lying vessel, touching it along its middle."""
        top = axis_point[2] - radius
        size = np.array([0.12, 1.2 * radius, top])
        self.add_box(np.array([axis_point[0], axis_point[1], top / 2]), size, "concrete")

    def add_risers(self) -> None:
        """Verticals from the floor with a flange at the foot, most of them turning off."""
        for _ in range(int(self.rng.integers(2, 5))):
            self._try(self._riser, CLEARANCE, free=True)

    def _riser(self) -> Run:
        size = self._size(300)
        x, y = self.rng.uniform(-0.5, RACK_LENGTH), self.rng.uniform(-0.8, RACK_DEPTH + 1.0)
        height = float(self.rng.uniform(1.2, 3.0))
        pieces: tuple[Piece, ...] = (Straight(0.15), self._flange(size), Straight(height))
        if self.rng.uniform() < 0.7:
            bend = size.bend_radius(float(self.rng.choice([1.5, 3.0])))
            azimuth = self.rng.choice([0, np.pi / 2, np.pi, 3 * np.pi / 2])
            towards = (float(np.cos(azimuth)), float(np.sin(azimuth)), 0.0)
            angle = float(self.rng.choice([90.0, 90.0, 60.0]))
            pieces += (Elbow(angle, bend, towards), Straight(float(self.rng.uniform(0.5, 1.5))))
        return Run(
            as_vector(np.array([x, y, 0.0])), UP, size.radius, pieces, "riser", self._paint()
        )

    def add_crossings(self) -> None:
        """Pipes across the rack, lying in contact on its highest pipe."""
        for bottom in self.supports[1:]:
            x = float(self.rng.uniform(0.8, RACK_LENGTH - 2.0))
            size = self._size(150)
            on_level = [
                r
                for r in self.room.runs
                if r.direction == ALONG and abs(r.start[2] - r.radius - bottom) < 1e-6
            ]
            if not on_level:
                continue
            z = bottom + max(2 * r.radius for r in on_level) + size.radius
            start = (x, -0.4, z)
            run = Run(
                start, ACROSS, size.radius, (Straight(RACK_DEPTH + 0.6),), "crossing", self._paint()
            )
            if self.room.add_run(run, 0.0):
                self.is_free.append(False)

    def add_oblique_pipes(self) -> None:
        """Pipes in no main direction, some with an elbow of an odd angle."""
        for _ in range(int(self.rng.integers(2, 4))):
            self._try(self._oblique_pipe, CLEARANCE, free=True, n_tries=25)

    def _oblique_pipe(self) -> Run:
        size = self._size(200)
        direction = unit(self.rng.standard_normal(3) * [1.0, 1.0, 0.7])
        start = self.rng.uniform([0.0, -0.8, 0.8], [RACK_LENGTH, RACK_DEPTH + 1.5, 3.2])
        lengths = self.rng.uniform(0.7, 1.8, 2)
        if start[2] + min(direction[2], 0.0) * lengths.sum() < 0.3:
            direction[2] = abs(direction[2])
        pieces: tuple[Piece, ...] = (Straight(float(lengths[0])),)
        if self.rng.uniform() < 0.6:
            towards = as_vector(self.rng.standard_normal(3) * [1.0, 1.0, 0.3])
            angle = float(self.rng.uniform(15, 60))
            pieces += (
                Elbow(angle, size.bend_radius(3.0), towards),
                Straight(float(lengths[1])),
            )
        return Run(
            as_vector(start), as_vector(direction), size.radius, pieces, "oblique", self._paint()
        )

    def add_box(self, centre: Array, size: Array, material: str) -> None:
        """Add a block to the clutter if no pipe is in it."""
        if self.room.add_block(centre - size / 2, centre + size / 2):
            self.clutter.append(Box(as_vector(centre), as_vector(size), material=material))
