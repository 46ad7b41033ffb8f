"""Random deformations of given runs."""

from dataclasses import replace

import numpy as np

from pipecore.simulate.placing import place_runs
from pipecore.simulate.scene import (
    Bow,
    Bulge,
    DeformationSpec,
    Dent,
    DentShape,
    Ovality,
    Run,
    Scene,
    Straight,
    Vector,
)
from pipecore.types import DeformationKind


def deform(
    runs: tuple[Run, ...],
    is_free: list[bool],
    stations: tuple[Vector, ...],
    rng: np.random.Generator,
) -> tuple[Run, ...]:
    """Return the runs, about a third of their straights longer than 0.7 m deformed.

    Most deformations face one of the stations, whatever stands between. Only dents are
    put on runs that are not free: they cannot penetrate what touches the run.
    """
    result = []
    for run, free in zip(runs, is_free, strict=True):
        pieces = []
        for i, piece in enumerate(run.pieces):
            pieces.append(piece)
            if not isinstance(piece, Straight) or piece.length < 0.7 or rng.uniform() > 0.35:
                continue
            up_to_here = replace(run, pieces=run.pieces[: i + 1])
            element = place_runs(Scene((up_to_here,), ())).elements[-1].element
            station = np.array(stations[rng.integers(len(stations))])
            (facing,) = element.axis.pipe_coordinates(station[None])[2]
            clock_deg = float((np.rad2deg(facing) + 40 * rng.standard_normal()) % 360)
            spec = random_deformation(piece.length, element.radius, clock_deg, rng, free=free)
            pieces[-1] = replace(piece, deformations=(spec,))
        result.append(replace(run, pieces=tuple(pieces)))
    return tuple(result)


def random_deformation(
    length: float, radius: float, clock_deg: float, rng: np.random.Generator, *, free: bool
) -> DeformationSpec:
    """Return a deformation for a straight of `length`; of any kind if it stands `free`."""
    kinds = [DeformationKind.DENT] * 4
    if free:
        kinds += [DeformationKind.BULGE, DeformationKind.OVALITY, DeformationKind.BOW]
    kind = kinds[rng.integers(len(kinds))]
    if kind is DeformationKind.OVALITY:
        extent = min(1.0, 0.8 * length)
        start = float(rng.uniform(0.05 * length, 0.95 * length - extent))
        return Ovality(float(rng.uniform(0.03, 0.08)), clock_deg, start, start + extent)
    if kind is DeformationKind.BOW:
        return Bow(min(float(rng.uniform(0.004, 0.012)) * length, 0.02), clock_deg)
    extents = 2 * radius * rng.uniform(0.5, 1.0, 2)
    extent = float(np.clip(extents[0], 0.08, 0.4 * length))
    width = float(np.clip(extents[1], 0.06, 2.5 * radius))
    chainage = float(rng.uniform(0.1 * length + extent / 2, 0.9 * length - extent / 2))
    depth = float(np.clip(rng.uniform(0.03, 0.12) * 2 * radius, 0.005, 0.03))
    if kind is DeformationKind.BULGE:
        return Bulge(chainage, clock_deg, depth, extent, width)
    shape = rng.choice([DentShape.SMOOTH, DentShape.SMOOTH, DentShape.FLAT, DentShape.SHARP])
    return Dent(chainage, clock_deg, depth, extent, width, DentShape(shape))
