"""In which unit and steps the coordinates of a cloud are written."""

from dataclasses import dataclass

import numpy as np

from pipecore.io.crs import from_wkt
from pipecore.io.source import CHUNK_POINTS
from pipecore.robust import sample_evenly
from pipecore.types import Array, Floats, PointCloud, Storage
from pipecore.units import FileUnit

USUAL_STEP = 1e-4
"""Step of coordinates whose own is not asked for, metres."""
FINEST_STEP, COARSEST_STEP = 1e-6, 0.1
"""Coordinates that are in no decimal steps, such as 32-bit numbers, are kept to the first,
metres; coordinates in steps are looked for up to the second, in the file's unit."""
SAMPLE_POINTS = 10_000


@dataclass(frozen=True, eq=False)
class Place:
    """Unit and steps of the coordinates in a file that is written.

    Parameters
    ----------
    unit : FileUnit
    steps, offsets : ndarray
        In this unit, shape (3,).
    storage : Storage, optional
        How the cloud's own file keeps coordinates, if they are written so again.
    """

    unit: FileUnit
    steps: Array
    offsets: Array
    storage: Storage | None = None

    def coordinates(self, cloud: PointCloud, rows: slice) -> Array:
        """Coordinates of some points in the file's unit, as those of its own file."""
        world = _in_unit(cloud, cloud.xyz[rows], self.unit)
        if self.storage is None:
            return world
        return np.asarray(np.round((world - self.offsets) / self.steps) * self.steps + self.offsets)

    def extremes(self, cloud: PointCloud) -> tuple[Array, Array]:
        """Lowest and highest coordinates in the file's unit; infinite if there are none."""
        low = cloud.xyz.min(axis=0, initial=np.inf).astype(np.float64)
        high = cloud.xyz.max(axis=0, initial=-np.inf).astype(np.float64)
        factors = self.unit.factors
        return (low + cloud.origin) / factors, (high + cloud.origin) / factors


def place_of(cloud: PointCloud, unit: FileUnit | None = None, *, is_fine: bool = False) -> Place:
    """Return how to write a cloud's coordinates: as its own file does, where that is known.

    Parameters
    ----------
    cloud : PointCloud
    unit : FileUnit, optional
        If not that of the cloud's file.
    is_fine : bool
        Whether to look for the steps that carry all digits, where the cloud's file has none;
        else they are 0.1 mm.
    """
    storage = cloud.storage
    if storage is not None:
        own = storage.unit or cloud.unit
        if unit in (None, own) and _is_on_steps(cloud, own, storage):
            return Place(own, storage.steps, storage.offsets, storage)
    unit = unit or _unit_of(cloud)
    offsets = np.round(cloud.origin / unit.factors)
    # A power of ten, so that readers show round numbers.
    usual = 10.0 ** np.floor(np.log10(USUAL_STEP / unit.metres) + 1e-9)
    step = _decimal_step(cloud, unit) if is_fine else usual
    return Place(unit, np.full(3, step), offsets)


def _in_unit(cloud: PointCloud, xyz: Floats, unit: FileUnit) -> Array:
    world = cloud.world(xyz.astype(np.float64))
    return world if (unit.factors == 1.0).all() else world / unit.factors


def _unit_of(cloud: PointCloud) -> FileUnit:
    """Unit of a cloud's reference system if its file, such as E57, is in metres all the same."""
    if cloud.crs_wkt and cloud.unit == FileUnit():
        system = from_wkt(cloud.crs_wkt)
        if system.plan is not None:
            return FileUnit.of_lengths(system.plan, system.height or system.plan)
    return cloud.unit


def _resolution(cloud: PointCloud, xyz: Floats, world: Array, unit: FileUnit) -> Array:
    """How exactly coordinates are known, in a unit, from the kinds of numbers they are kept in."""
    local = np.spacing(np.abs(xyz)).astype(np.float64) / unit.factors
    return np.asarray(local + 4 * np.spacing(np.abs(world)))


def _is_on_steps(cloud: PointCloud, unit: FileUnit, storage: Storage) -> bool:
    """Whether points are where their own file can hold them; moved ones are not."""
    sample = sample_evenly(cloud.xyz, SAMPLE_POINTS)
    world = _in_unit(cloud, sample, unit)
    off = np.abs(world - storage.offsets) % storage.steps
    off = np.minimum(off, storage.steps - off)
    return bool((off <= _resolution(cloud, sample, world, unit)).all())


def _decimal_step(cloud: PointCloud, unit: FileUnit) -> float:
    """Coarsest power of ten of which all coordinates are multiples, else a very fine one."""
    step = COARSEST_STEP
    finest = 10.0 ** np.floor(np.log10(FINEST_STEP / unit.metres) + 1e-9)
    sample = sample_evenly(cloud.xyz, SAMPLE_POINTS)
    while step > 1.5 * finest and not (
        _are_multiples(cloud, sample, unit, step)
        and all(
            _are_multiples(cloud, cloud.xyz[start : start + CHUNK_POINTS], unit, step)
            for start in range(0, len(cloud), CHUNK_POINTS)
        )
    ):
        step = float(f"{step / 10:.0e}")
    return step


def _are_multiples(cloud: PointCloud, xyz: Floats, unit: FileUnit, step: float) -> bool:
    world = _in_unit(cloud, xyz, unit)
    resolution = _resolution(cloud, xyz, world, unit)
    # What is known less well than the step is a multiple of anything.
    if not len(world) or resolution.max() > 0.05 * step:
        return False
    return bool((np.abs(world - np.round(world / step) * step) <= resolution).all())
