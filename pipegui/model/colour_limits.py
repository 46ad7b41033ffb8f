"""The range of heights or intensities that the colours of the points span."""

import numpy as np

from pipecore.types import PointCloud
from pipegui.model.cache import cached_with_owner
from pipegui.model.document import ColourBy, Limits, ViewOptions

# Ranges are computed once for each cloud.


@cached_with_owner(maxsize=4)
def intensity_range(cloud: PointCloud) -> Limits:
    """Return the intensities between which nearly all points lie."""
    assert cloud.intensity is not None
    sample = cloud.intensity[:: max(1, len(cloud) // 100_000)]
    low, high = np.nanpercentile(sample, [2, 98])
    return float(low), float(high)


def has_contrast(cloud: PointCloud) -> bool:
    """Return whether intensities differ: some files have the same one for all points."""
    low, high = intensity_range(cloud)
    return low < high


@cached_with_owner(maxsize=4)
def height_range(cloud: PointCloud) -> Limits:
    """Return the local heights between which nearly all points lie."""
    sample = cloud.xyz[:: max(1, len(cloud) // 100_000), 2]
    low, high = np.percentile(sample, [0.5, 99.5])
    return float(low), float(high)


def height_limits(cloud: PointCloud, view: ViewOptions) -> Limits:
    """Return the local heights at the ends of the colours: those chosen, else `height_range`."""
    return view.height_limits or height_range(cloud)


def intensity_limits(cloud: PointCloud, view: ViewOptions) -> Limits:
    """Return the intensities at the ends of the colours: those chosen, else `intensity_range`."""
    return view.intensity_limits or intensity_range(cloud)


def shown_limits(cloud: PointCloud, view: ViewOptions) -> Limits | None:
    """Return the ends of the colours as the window shows them: heights in world metres.

    None where colours have no such ends.
    """
    if view.colour_by is ColourBy.HEIGHT:
        low, high = height_limits(cloud, view)
        base = float(cloud.origin[2])
        return low + base, high + base
    if view.colour_by is ColourBy.INTENSITY and cloud.intensity is not None:
        return intensity_limits(cloud, view)
    return None


def n_decimals(limits: Limits) -> int:
    """Return how many decimals distinguish values between the limits."""
    span = abs(limits[1] - limits[0])
    return int(np.clip(2 - np.floor(np.log10(max(span, 1e-9))), 0, 4))
