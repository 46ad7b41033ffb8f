"""Free ellipses by the method of the settings, one for each group of points."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pipecore.ellipses.direct import PlaneEllipses, fit_direct_ellipses
from pipecore.ellipses.nonlinear import fit_nonlinear_ellipse
from pipecore.settings import EllipseFit

Array = NDArray[np.float64]


def fit_free_ellipses(
    points: Array,
    starts: NDArray[np.int64],
    is_wanted: NDArray[np.bool_],
    method: EllipseFit,
    check: Callable[[], None] = lambda: None,
) -> PlaneEllipses:
    """Fit an ellipse to each wanted group of points.

    Parameters
    ----------
    points : ndarray, shape (n, 2)
        Grouped.
    starts : ndarray of int, shape (m + 1,)
        Where each group starts; the last entry is n. No group is empty.
    is_wanted : ndarray of bool, shape (m,)
        Groups that are worth the time of a nonlinear fit, tens of milliseconds each.
    method : EllipseFit
    check : callable
        Called before each nonlinear fit; may raise to cancel.

    Returns
    -------
    PlaneEllipses
        nan where there is none; by a nonlinear method also where the points do not carry
        one, or are not wanted.

    References
    ----------
    Paper, section 3.3.3, methods 1 and 2.
    """
    ellipses = fit_direct_ellipses(points, starts)
    if method is EllipseFit.DIRECT:
        return ellipses
    m = len(is_wanted)
    found = replace(
        ellipses, centre=np.full((m, 2), np.nan), **{k: np.full(m, np.nan) for k in _NUMBERS}
    )
    for i in np.flatnonzero(is_wanted):
        check()
        fit = fit_nonlinear_ellipse(
            points[starts[i] : starts[i + 1]], robust=method is EllipseFit.ROBUST
        )
        if fit:
            found.centre[i] = fit.centre
            for name in _NUMBERS:
                getattr(found, name)[i] = getattr(fit, name)
    return found


_NUMBERS = ("semi_major", "semi_minor", "angle", "rss")
