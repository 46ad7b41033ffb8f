"""What each profile across an element shows of a deformation (paper, figures 12 to 15).

The deviation of the centre and the drop of the semi-minor axis stand in the table of
profiles; here the smooth curve through each profile's points adds how its curvature varies.
"""

from collections.abc import Callable

import numpy as np

from pipecore._kernels.grouping import group_from
from pipecore.deformation import section_curve
from pipecore.geometry import Array
from pipecore.types import Element, Profiles

PROFILES_PER_CHECK = 200
"""Profiles between two checks for a cancel: some hundredths of a second."""


def curvature_variations(
    element: Element,
    places: tuple[Array, Array, Array],
    profiles: Profiles,
    width: float,
    check: Callable[[], None] = lambda: None,
) -> Array:
    """Return how much the curvature varies around each profile of an element's own stack.

    Parameters
    ----------
    element : Element
    places : tuple of ndarray
        Pipe coordinates (n,) of the points of its surface.
    profiles : Profiles
        Of its own stack, m rows.
    width : float
        With which they were cut, metres.
    check : callable
        Called now and then; may raise to cancel.

    Returns
    -------
    ndarray, shape (m,)
        See `SectionCurve.curvature_variation`; nan where the points carry no curve.
    """
    variation = np.full(len(profiles), np.nan)
    if len(profiles) == 0:
        return variation
    chainage, rho, clock = places
    index = np.floor(chainage / width).astype(np.int32)
    order, starts = group_from(index, 0, max(int(index.max()), 0) + 1)
    index, rho, clock = index[order], rho[order], clock[order]
    # A taper within a profile is no thickness of the section.
    middle = np.asarray((index + 0.5) * width, np.float64)
    rho = rho + (element.radius_at(middle) - element.radius_at(chainage[order]))
    first, last = starts[profiles.profile_index], starts[profiles.profile_index + 1]
    for start in range(0, len(variation), PROFILES_PER_CHECK):
        check()
        rows = slice(start, start + PROFILES_PER_CHECK)
        variation[rows] = section_curve.curvature_variations(clock, rho, first[rows], last[rows])
    return variation
