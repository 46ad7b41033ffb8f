"""One place, one row: what the map and the profiles found, put together."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pipecore.deformation.criteria import CURVE_WINDOW, ProfileCriteria
from pipecore.deformation.deviation_map import Grid
from pipecore.types import Deformation, DeformationKind, SeenBy

CRUSHED_SHARE = 0.55
"""A pipe whose smallest diameter is less than this share of its own is crushed: neither dent
nor ovality describes it, and a dent to the axis leaves half of the diameter."""

WHOLE_LINE = (DeformationKind.BOW, DeformationKind.KINK)
"""Kinds that move the axis of the whole element."""

CRUMPLE_REACH = 1.0
"""Radii beyond the significant rings of a crumple where its smaller ones may be."""

LINE_REACH = 1.0
"""Diameters to either side of a kink that are looked at for it."""


def merge(
    found: Sequence[Deformation], crumples: Sequence[Deformation], criteria: ProfileCriteria
) -> list[Deformation]:
    """Return the deformations of an element, each with all that saw it.

    Parameters
    ----------
    found : sequence of Deformation
        Of the map and of the contour.
    crumples : sequence of Deformation
        What lies within one of them is part of it.
    criteria : ProfileCriteria

    Returns
    -------
    list of Deformation
        In no order.
    """
    reach = CRUMPLE_REACH * criteria.grid.radius
    left = [d for d in found if not any(_is_part(d, crumple, reach) for crumple in crumples)]
    absorbed = [
        replace(c, seen_by=_joined(c, *(d for d in found if _is_part(d, c, reach))))
        for c in crumples
    ]
    return [_completed(d, criteria) for d in (*left, *absorbed)]


def _is_part(d: Deformation, crumple: Deformation, reach: float) -> bool:
    """Whether a place is one of a crumple's rings, or the crumple seen otherwise."""
    is_inside = crumple.chainage_start - reach <= d.chainage <= crumple.chainage_end + reach
    return d.kind not in WHOLE_LINE and is_inside


def _joined(*deformations: Deformation) -> tuple[SeenBy, ...]:
    return tuple(c for c in SeenBy if any(c in d.seen_by for d in deformations))


def _completed(d: Deformation, criteria: ProfileCriteria) -> Deformation:
    """Return a deformation with the criteria that are significant there, and its diameters."""
    grid = criteria.grid
    rows = _rows_of(d, grid)
    also = {c for c, flags in criteria.seen.items() if flags[rows].any()}
    seen_by = tuple(c for c in SeenBy if c in d.seen_by or c in also)
    # Rings are shorter than what is pooled for a curve.
    window = 0.0 if d.kind is DeformationKind.CRUMPLE else CURVE_WINDOW
    largest, smallest = criteria.diameters(rows.start, rows.stop - 1, window)
    kind = d.kind
    if kind not in WHOLE_LINE and smallest < CRUSHED_SHARE * 2 * grid.radius:
        kind = DeformationKind.CRUSHED
    return replace(d, kind=kind, seen_by=seen_by, dmax=largest, dmin=smallest)


def _rows_of(d: Deformation, grid: Grid) -> slice:
    """Rows that a deformation is looked for in: its extent; of a kink the place."""
    start, end = d.chainage_start, d.chainage_end
    if d.kind is DeformationKind.KINK:
        reach = LINE_REACH * 2 * grid.radius
        start, end = d.chainage - reach, d.chainage + reach
    first, last = np.clip(np.array([start, end]) / grid.row_size, 0, grid.n_rows - 1).astype(int)
    return slice(int(first), int(last) + 1)
