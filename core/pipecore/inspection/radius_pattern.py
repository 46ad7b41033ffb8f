"""Radius against profile: the pattern that was fitted, and the scatter about it."""

from dataclasses import dataclass

import numpy as np

from pipecore.geometry import Array
from pipecore.robust import robust_sd
from pipecore.types import Element, Profiles


@dataclass(frozen=True, eq=False)
class RadiusPattern:
    """Radius against profile of one stack (paper, figures 7 and 13), in metres if not scaled.

    Parameters
    ----------
    values, sd : ndarray, shape (m,)
        Semi-minor axes of the profiles and their standard deviations.
    fitted : ndarray, shape (m,)
        The element's radius there: constant, linear or a semicircle.
    moved : ndarray, shape (m,)
        The fitted pattern moved onto the median of the values.
    scatter : float
        Robust standard deviation of the values about it, nan without values.
    """

    values: Array
    sd: Array
    fitted: Array
    moved: Array
    scatter: float

    @property
    def middle(self) -> float:
        """Where a constant pattern lies when moved onto the values."""
        return float(self.moved.mean())

    def scaled(self, factor: float) -> "RadiusPattern":
        """Return the pattern in another unit, such as millimetres for a factor of 1000."""
        return RadiusPattern(
            factor * self.values,
            factor * self.sd,
            factor * self.fitted,
            factor * self.moved,
            factor * self.scatter,
        )


def radius_pattern(element: Element, profiles: Profiles) -> RadiusPattern:
    """Return the radii of an element's profiles with their pattern.

    Middle and scatter are the median and 1.4826 times the median absolute deviation: a
    dent, which the plot is to show, must not widen the band.

    Parameters
    ----------
    element : Element
    profiles : Profiles
        The element's profiles of one stack, m rows.

    Returns
    -------
    RadiusPattern
    """
    values = profiles.semi_minor
    fitted = np.asarray(element.radius_at(profiles.chainage), np.float64)
    off = (values - fitted)[np.isfinite(values)]
    middle = float(np.median(off)) if len(off) else np.nan
    scatter = robust_sd(off - middle) if len(off) else np.nan
    return RadiusPattern(values, profiles.semi_minor_sd, fitted, fitted + middle, scatter)


def profile_index_at(chainage: Array | float, profiles: Profiles) -> Array:
    """Return the profile index at chainages, with fractions between two profiles.

    Parameters
    ----------
    chainage : ndarray or float
        Metres.
    profiles : Profiles
        Of one element and one stack.

    Returns
    -------
    ndarray
        Of the shape of `chainage`.
    """
    order = np.argsort(profiles.chainage, kind="stable")
    known = profiles.chainage[order], profiles.profile_index[order].astype(np.float64)
    return np.asarray(np.interp(chainage, *known))
