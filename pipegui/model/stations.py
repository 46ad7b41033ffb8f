"""The stations of a cloud: what each is called, where it is, and how many points it has."""

from dataclasses import dataclass

import numpy as np

from pipecore.types import PointCloud
from pipegui.model.cache import cached_with_owner
from pipegui.model.document import Point

BLOCK = 4_000_000
"""Points counted at a time: their ids are widened for it."""


@dataclass(frozen=True)
class Station:
    """A station of a cloud.

    Parameters
    ----------
    station_id : int
    name : str
        As the file calls it, without the file's own name where all are of one file; "" where
        it has none.
    n_points : int
        0 where the points do not say from which station they are.
    position : (float, float, float), optional
        Of the scanner, local coordinates in metres.
    """

    station_id: int
    name: str
    n_points: int
    position: Point | None


@cached_with_owner(maxsize=1)
def stations_of(cloud: PointCloud) -> tuple[Station, ...]:
    """Return the stations of a cloud in the order of their ids, () where nothing tells them."""
    n_stations = max(len(cloud.station_names), len(cloud.stations))
    counts = np.zeros(n_stations + 1, np.int64)
    if cloud.station is not None:
        for start in range(0, len(cloud), BLOCK):
            ids = cloud.station[start : start + BLOCK]
            counts += np.bincount(ids, minlength=n_stations + 1)
    names = _short(cloud.station_names) or ("",) * n_stations
    return tuple(
        Station(i, names[i - 1], int(counts[i]), _position(cloud, i))
        for i in range(1, n_stations + 1)
    )


def has_stations(cloud: PointCloud) -> bool:
    """Return whether points are of one of several stations."""
    return cloud.station is not None and len(cloud.station_names) > 1


def _position(cloud: PointCloud, station_id: int) -> Point | None:
    if station_id > len(cloud.stations) or not np.isfinite(cloud.stations[station_id - 1]).all():
        return None
    x, y, z = cloud.stations[station_id - 1].tolist()
    return x, y, z


def _short(names: tuple[str, ...]) -> tuple[str, ...]:
    """Return names without that of the file before the colon, if it is the same for all."""
    files = {name.partition(": ")[0] for name in names}
    if len(files) == 1 and all(": " in name for name in names):
        return tuple(name.partition(": ")[2] for name in names)
    return names
