"""Stacks: the cloud cut into parallel profiles, in several directions (paper, section 3.1)."""

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipecore.errors import SettingsError
from pipecore.geometry import unit
from pipecore.progress import Progress
from pipecore.settings import DirectionPreset, StackSettings
from pipecore.stacks.directions import AXES, DIAGONALS, automatic_directions
from pipecore.stacks.round_places import find_round_places
from pipecore.surface import Surface
from pipecore.types import Stack

__all__ = ["choose_stacks", "preset_directions"]

WIDTH_VOXELS = 2.0
"""Automatic profile width, in voxels."""
WIDE_WIDTH_RATIO = 2.5
"""Width of the wide profiles, in those of the narrow ones."""
SPARSE_VOXELS = 1.25
"""Places with at least this spacing, in voxels, are cut by wide profiles too."""


def preset_directions(preset: DirectionPreset) -> list[NDArray[np.float64]]:
    """Return the directions of a preset.

    Parameters
    ----------
    preset : DirectionPreset

    Returns
    -------
    list of ndarray, shape (3,)
        Unit vectors; none for presets that depend on the cloud.
    """
    match preset:
        case DirectionPreset.AXES:
            return list(AXES)
        case DirectionPreset.AXES_AND_DIAGONALS:
            return [*AXES, *DIAGONALS]
        case _:
            return []


def choose_stacks(
    surface: Surface,
    settings: StackSettings,
    max_radius: float,
    progress: Progress,
) -> tuple[Stack, ...]:
    """Return the stacks that the settings ask for: the preset's, then the user's own.

    Those of automatic width come again with wide profiles, for thinly scanned places.

    Parameters
    ----------
    surface : Surface
    settings : StackSettings
    max_radius : float
        Largest radius looked for, metres.
    progress : Progress

    Returns
    -------
    tuple of Stack

    Raises
    ------
    SettingsError
        If they ask for none.
    """
    width = settings.width_mm / 1e3 or WIDTH_VOXELS * surface.voxel
    named: list[tuple[str, ArrayLike, float]] = []
    if settings.preset is DirectionPreset.AUTOMATIC:
        found = automatic_directions(find_round_places(surface, max_radius, progress))
        named += [(f"auto {i}", d, width) for i, d in enumerate(found, start=1)]
    else:
        named += [(describe_direction(d), d, width) for d in preset_directions(settings.preset)]
    for x, y, z, *given_width in settings.directions:
        user_width = given_width[0] / 1e3 if given_width and given_width[0] else width
        named.append((describe_direction((x, y, z)), (x, y, z), user_width))
    if not named:
        raise SettingsError(
            "There are no stacks to cut; choose directions other than “none” or give your own."
        )
    stacks = [
        Stack(i, unit(direction), stack_width, 0.0, name)
        for i, (name, direction, stack_width) in enumerate(named, start=1)
    ]
    return (*stacks, *_wide_stacks(stacks, surface)) if not settings.width_mm else tuple(stacks)


def _wide_stacks(stacks: list[Stack], surface: Surface) -> list[Stack]:
    """The same directions cut wider, for the places where profiles would hold too few points.

    Stacks whose width the user gave stay as they are.
    """
    min_spacing = SPARSE_VOXELS * surface.voxel
    automatic = [s for s in stacks if s.width == WIDTH_VOXELS * surface.voxel]
    if not (surface.spacing >= min_spacing).any():
        return []
    return [
        replace(
            stack,
            stack_id=len(stacks) + i,
            width=WIDE_WIDTH_RATIO * stack.width,
            name=f"{stack.name}, wide",
            min_spacing=min_spacing,
        )
        for i, stack in enumerate(automatic, start=1)
    ]


def describe_direction(direction: ArrayLike) -> str:
    """Name a direction: X, Y, Z, or its components."""
    x, y, z = unit(direction)
    for name, component in zip("XYZ", (x, y, z), strict=True):
        if abs(component) > 1 - 1e-9:
            return name
    return f"({x:.2f}, {y:.2f}, {z:.2f})"
