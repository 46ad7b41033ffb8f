"""What an ovality that a narrow arc cannot show would look like: a bow, a dent or a bulge."""

import numpy as np

from pipecore.deformation.contour import harmonics
from pipecore.deformation.deviation_map import DeviationMap
from pipecore.deformation.patches import Patch

MAX_HIDDEN_OVALITY = 0.08
"""The largest ovality that rules allow (B31.3, bends), as a ratio: what it could fake is not
reported where ovality is not measurable."""

LOBE = np.deg2rad(60.0)
"""What is wider around the pipe may be a lobe of an oval section."""

LONG_DIAMETERS = 2.0
"""What is as wide and longer than this may be a lobe of any size: damage that long is ovality
as often as it is a dent."""


def faked_bow(cells: DeviationMap) -> float:
    """Return by how much a hidden ovality could move the fitted centre.

    Parameters
    ----------
    cells : DeviationMap

    Returns
    -------
    float
        Metres.
    """
    grid = cells.grid
    seen = np.count_nonzero(cells.covered, axis=0) >= 0.5 * cells.covered.any(axis=1).sum()
    if np.count_nonzero(seen) < 3:
        return np.inf
    phi = harmonics(grid.clocks[seen], 5)
    shift, *_ = np.linalg.lstsq(phi[:, :3], phi[:, 3:], rcond=None)
    gain = float(np.linalg.norm(shift[1:3], ord=2))
    return gain * MAX_HIDDEN_OVALITY * grid.radius / 2


def may_be_ovality(patch: Patch) -> bool:
    """Return whether a dent or bulge could be a lobe of a hidden ovality.

    Parameters
    ----------
    patch : Patch

    Returns
    -------
    bool
    """
    if patch.bump.width < LOBE * patch.radius:
        return False
    is_long = patch.bump.length > LONG_DIAMETERS * 2 * patch.radius
    return bool(is_long or abs(patch.bump.height) < MAX_HIDDEN_OVALITY / 2 * patch.radius)
