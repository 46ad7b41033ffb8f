"""What an arc of points can say about a circle."""

import numpy as np
from numpy.typing import ArrayLike, NDArray


def radius_sd_factor(arc: ArrayLike) -> NDArray[np.float64]:
    """Return the standard deviation of a fitted radius in units of σ/√n, for n points on an arc.

    The Cramér-Rao bound of a circle with free centre: 1.0 for the full circle, 1.33 at
    240°, 2.3 at 180°, 5.6 at 120°.

    Parameters
    ----------
    arc : array_like
        Length of the arc over which the points are spread evenly, radians.

    Returns
    -------
    ndarray
        In the shape of `arc`.
    """
    half = np.clip(np.asarray(arc, dtype=np.float64) / 2, 1e-3, np.pi)
    mean = np.sin(half) / half
    mean_square = 0.5 + np.sin(2 * half) / (4 * half)
    return np.sqrt(mean_square / (mean_square - mean**2))
