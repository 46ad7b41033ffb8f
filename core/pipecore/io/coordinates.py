"""What a file's coordinates tell of their unit and steps, and the words for it."""

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from pipecore.errors import ReadError
from pipecore.io.crs import ReferenceSystem
from pipecore.io.source import Source
from pipecore.notes import Note
from pipecore.rounding import measured_step, sampled_runs
from pipecore.settings import LengthUnit
from pipecore.types import Array
from pipecore.units import FileUnit

UNIT_LABELS = {
    "m": "metres",
    "mm": "millimetres",
    "in": "inches",
    "ft": "feet",
    "us-ft": "US survey feet",
}
COARSE_STEP = 0.002
"""Steps from which on rounding is worth a word, metres: it adds an SD of 0.6 mm."""
WIDEST_SPACING, WIDEST_UNNAMED, NARROWEST_SPACING = 0.5, 0.2, 2e-5
"""Points of a scan of pipes are no further (the second, where no reference system names the unit),
and no nearer than this, metres."""
WIDEST_DEGREES, STEEPEST = 0.01, 20.0
"""Coordinates without a system look like degrees if x and y spread over no more than the
first (about a kilometre), and heights over at least so many times as much."""


def unit_of(
    sources: Sequence[tuple[Path, ReferenceSystem]], length_unit: LengthUnit
) -> tuple[FileUnit, ReferenceSystem, tuple[Note, ...]]:
    """Return the unit of files that are taken as one cloud, and the system they are in.

    Raises
    ------
    ReadError
        If they are in different systems.
    """
    named = [(path, system) for path, system in sources if system.name or system.plan]
    path, system = named[0] if named else (sources[0][0], ReferenceSystem())
    for other_path, other in named[1:]:
        if not system.agrees_with(other):
            raise ReadError(
                "“{name}” is in {system}, “{other_name}” in {other_system}; bring them into one "
                "reference system.",
                name=path.name,
                system=_described(system),
                other_name=other_path.name,
                other_system=_described(other),
            )
    if length_unit is not LengthUnit.AUTO:
        return FileUnit.of(length_unit), system, ()
    if system.is_geographic:
        return FileUnit(), system, (_degrees_note(path, system),)
    if system.plan is None:
        return FileUnit(), system, ()
    unit = FileUnit.of_lengths(system.plan, system.height or system.plan)
    return unit, system, _unit_notes(path, system, unit)


def _described(system: ReferenceSystem) -> str:
    name = f"“{system.name}”" if system.name else "a system without a name"
    if system.plan is None:
        return name
    unit = FileUnit.of_lengths(system.plan, system.height or system.plan)
    return f"{name} ({unit})"


def _unit_notes(path: Path, system: ReferenceSystem, unit: FileUnit) -> tuple[Note, ...]:
    if unit.metres == 1.0 and unit.height_metres == 1.0:
        return ()
    if unit.name == unit.height_name:
        return (
            Note(
                "Coordinates of “{name}” are taken as {unit}, as its reference system “{system}” "
                "names it; results are in metres and millimetres.",
                name=path.name,
                unit=_spelled(unit.name),
                system=system.name or "unnamed",
            ),
        )
    return (
        Note(
            "Coordinates of “{name}” are taken as {unit} in plan and {height_unit} in height, as "
            "its reference system “{system}” names them; results are in metres and millimetres.",
            name=path.name,
            unit=_spelled(unit.name),
            height_unit=_spelled(unit.height_name),
            system=system.name or "unnamed",
        ),
    )


def _spelled(name: str) -> str:
    return UNIT_LABELS.get(name, name)


def _degrees_note(path: Path, system: ReferenceSystem) -> Note:
    return Note(
        "Coordinates of “{name}” are degrees ({system}), not lengths, so that nothing can be "
        "measured: bring it into a projected system, such as UTM, first.",
        name=path.name,
        system=system.name or "geographic",
    )


def sense_notes(
    path: Path,
    unit: FileUnit,
    crs: str,
    spacing: float,
    low: Array,
    high: Array,
    *,
    is_angular: bool = False,
) -> tuple[Note, ...]:
    """Return what is odd about a cloud if its coordinates are in this unit.

    Parameters
    ----------
    path : Path
    unit : FileUnit
    crs : str
        Name of its reference system, or "".
    spacing : float
        Distance of a point from its nearest neighbour, metres; nan if not known.
    low, high : ndarray
        Lowest and highest coordinates, in the file's unit, shape (3,).
    is_angular : bool
        Whether they are known to be degrees.
    """
    extent = high - low
    if is_angular:
        return ()
    if not crs and _looks_like_degrees(low, high):
        return (
            Note(
                "Coordinates of “{name}” look like degrees: x and y spread over {plan:.2g}, "
                "heights over {height:.2g}. Nothing can be measured in degrees: bring them into a "
                "projected system first.",
                name=path.name,
                plan=float(max(extent[:2])),
                height=float(extent[2]),
            ),
        )
    widest = WIDEST_SPACING if crs else WIDEST_UNNAMED
    if spacing > widest or 0 < spacing < NARROWEST_SPACING:
        return (
            Note(
                "If “{name}” is in {unit}, its points are {spacing:.2g} m apart and spread over "
                "{extent} m; if that cannot be, choose another length unit, such as {other}.",
                name=path.name,
                unit=str(unit),
                spacing=spacing,
                extent=_rounded(float(np.max(extent * unit.factors))),
                other="mm" if spacing > widest else "m",
            ),
        )
    return ()


def _rounded(metres: float) -> str:
    return f"{metres:,.0f}" if metres >= 100 else f"{metres:.3g}"


def _looks_like_degrees(low: Array, high: Array) -> bool:
    """Whether x and y may be degrees: within their bounds, and spread over next to nothing."""
    extent = high - low
    is_bounded = (np.abs([low[0], high[0]]) <= 360).all() and (
        np.abs([low[1], high[1]]) <= 90
    ).all()
    plan = max(extent[:2])
    return bool(is_bounded and 0 < plan < WIDEST_DEGREES and extent[2] > STEEPEST * plan)


def notes_on_steps(
    path: Path, source: Source, xyz: Array, unit: FileUnit
) -> tuple[tuple[Note, ...], float]:
    """Return a note on coarse coordinates, and their steps in metres.

    Parameters
    ----------
    path : Path
    source : Source
    xyz : ndarray
        Points of the file in its unit, shape (m, 3), float64.
    unit : FileUnit
    """
    sample = sampled_runs(xyz)
    step = float((max(source.step, measured_step(sample)) * unit.factors).max())
    if not source.step and (sample == sample.astype(np.float32)).all():
        of_float32 = float((float32_steps(sample) * unit.factors).max())
        if of_float32 >= max(step, COARSE_STEP):
            return (_float32_note(path, of_float32),), of_float32
    if not step >= COARSE_STEP * (1 - 1e-6):
        return (), step
    return (
        Note(
            "Coordinates of “{name}” are rounded to {step:.3g} mm, which adds an uncertainty of "
            "{sd:.2g} mm to each.",
            name=path.name,
            step=1000 * step,
            sd=1000 * step / math.sqrt(12),
        ),
    ), step


def _float32_note(path: Path, step: float) -> Note:
    return Note(
        "“{name}” keeps coordinates as 32-bit numbers, which so far from zero step by "
        "{step:.3g} m; export it anew with 64-bit numbers, or shifted to near zero.",
        name=path.name,
        step=step,
    )


def float32_steps(xyz: Array) -> Array:
    """Steps of 32-bit numbers as large as the largest of these coordinates, shape (3,)."""
    largest = np.abs(xyz).max(axis=0).astype(np.float32)
    return np.asarray(np.spacing(largest), dtype=np.float64)


def header_bounds_notes(
    path: Path, source: Source, low: Array, high: Array, slack: float = 0.0
) -> tuple[Note, ...]:
    """Return a note if a header's box is not that of the points.

    Parameters
    ----------
    path : Path
    source : Source
        Read to its end.
    low, high : ndarray
        Lowest and highest coordinates of the points, in the file's unit.
    slack : float
        How far off they may be.
    """
    if source.bounds is None or source.left_out.total() or not (low <= high).all():
        return ()
    slack += 1.5 * max(source.step, 1e-9) + 1e-9 * np.abs([low, high]).max()
    if (np.abs(source.bounds - [low, high]) <= slack).all():
        return ()
    return (
        Note(
            "The header of “{name}” gives a wrong extent; that of its points is used.",
            name=path.name,
        ),
    )
