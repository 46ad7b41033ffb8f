"""Free ellipses by the method of the settings, one for each group of points."""

from collections.abc import Callable

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
        Groups that are worth the time of a fit: a nonlinear one takes tens of milliseconds.
    method : EllipseFit
    check : callable
        Called before each nonlinear fit; may raise to cancel.

    Returns
    -------
    PlaneEllipses
        nan where there is none or none is wanted; by a nonlinear method also where the points
        do not carry one.

    References
    ----------
    Paper, section 3.3.3, methods 1 and 2.
    """
    m = len(is_wanted)
    found = PlaneEllipses(np.full((m, 2), np.nan), *(np.full(m, np.nan) for _ in _NUMBERS))
    wanted = np.flatnonzero(is_wanted)
    if method is EllipseFit.DIRECT:
        if len(wanted) == 0:
            return found
        sizes = np.diff(starts)[wanted]
        wanted_starts = np.concatenate([[0], np.cumsum(sizes)])
        rows = np.arange(wanted_starts[-1]) + np.repeat(starts[wanted] - wanted_starts[:-1], sizes)
        direct = fit_direct_ellipses(points[rows], wanted_starts)
        found.centre[wanted] = direct.centre
        for name in _NUMBERS:
            getattr(found, name)[wanted] = getattr(direct, name)
        return found
    for i in wanted:
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
