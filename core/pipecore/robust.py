"""Robust statistics: scale from the median absolute deviation, Tukey's biweight, even samples.

The constants are plain numbers, so that compiled kernels can use them too.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MAD_TO_SD = 1.4826
"""Standard deviation of normal noise over its median absolute deviation, 1 / Φ⁻¹(3/4)."""
TUKEY_REACH = 4.685
"""Where Tukey's biweight reaches zero, in standard deviations: 95 % as efficient as least
squares on normal noise (Holland & Welsch 1977)."""


def robust_sd(deviations: Array) -> float:
    """Standard deviation from the median absolute deviation.

    Parameters
    ----------
    deviations : ndarray, shape (n,)
        Deviations from the middle, such as residuals of a fit, in any unit; n > 0.

    Returns
    -------
    float
        In the unit of `deviations`.
    """
    return float(MAD_TO_SD * np.median(np.abs(deviations)))


def tukey_weights(scaled: Array) -> Array:
    """Weights of Tukey's biweight, (1 - q²)², zero from |q| = 1 on.

    Parameters
    ----------
    scaled : ndarray, shape (n,)
        Residuals over the reach; see `TUKEY_REACH`.

    Returns
    -------
    ndarray, shape (n,)
    """
    return np.where(np.abs(scaled) < 1, (1 - scaled**2) ** 2, 0.0)


def sample_evenly(rows: NDArray[Any], limit: int) -> NDArray[Any]:
    """Return at most `limit` rows of an array, evenly spread over it, in their order.

    Parameters
    ----------
    rows : ndarray, shape (n, ...)
    limit : int

    Returns
    -------
    ndarray, shape (min(n, limit), ...)
    """
    if len(rows) <= limit:
        return rows
    return rows[np.linspace(0, len(rows) - 1, limit).astype(np.intp)]
