"""Numbers behind the radius plot: the fitted pattern, the middle and its band. Qt-free."""

from dataclasses import dataclass

import numpy as np

from pipecore.geometry import Array
from pipecore.types import Element, Profiles


@dataclass(frozen=True, eq=False)
class Pattern:
    """Radius against profile of one stack, in millimetres.

    Parameters
    ----------
    values, sd : ndarray, shape (m,)
        Semi-minor axes of the ellipses and their standard deviations.
    fitted : ndarray, shape (m,)
        The element's radius there: constant, linear or a semicircle.
    moved : ndarray, shape (m,)
        The fitted pattern moved onto the middle of the values.
    spread : float
        Robust standard deviation of the values about it.
    """

    values: Array
    sd: Array
    fitted: Array
    moved: Array
    spread: float

    @property
    def middle(self) -> float:
        """Where a constant pattern lies when moved onto the values."""
        return float(self.moved.mean())


def pattern_of(element: Element, profiles: Profiles) -> Pattern:
    """Return what the radius plot shows of `profiles`.

    Middle and spread are the median and the median deviation × 1.4826: a dent, which is
    what the plot is to show, must not widen the band.
    """
    values = 1000 * profiles.semi_minor
    fitted = 1000 * np.asarray(element.radius_at(profiles.chainage), np.float64)
    off = (values - fitted)[np.isfinite(values)]
    middle = float(np.median(off)) if len(off) else np.nan
    spread = 1.4826 * float(np.median(np.abs(off - middle))) if len(off) else np.nan
    return Pattern(values, 1000 * profiles.semi_minor_sd, fitted, fitted + middle, spread)


def index_at(chainage: Array | float, profiles: Profiles) -> Array:
    """Profile index (with fractions) at `chainage`, from the profiles' own two columns."""
    order = np.argsort(profiles.chainage, kind="stable")
    known = profiles.chainage[order], profiles.profile_index[order].astype(np.float64)
    return np.interp(chainage, *known)
