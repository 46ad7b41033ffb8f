"""The tables of stations: ``stations.csv`` and ``pairs.csv``.

A correction is to be added: x' = pivot + R(x - pivot) + d, with the pivot in file coordinates. The
first station is held. What the pipes cannot tell is empty.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from pipecore.report.columns import Column, floats, integers, positions, texts
from pipecore.report.world import FileCoordinates
from pipecore.table import Table
from pipecore.types import Correction, Result


def stations_table(result: Result) -> Table:
    """Return the stations with their corrections as columns, one row for each.

    Parameters
    ----------
    result : Result

    Returns
    -------
    Table
        The names and the values of ``stations.csv``; without rows where the cloud is of one.
    """
    place = FileCoordinates.of(result)
    stations = result.station_check.stations if result.station_check else ()
    corrections = [s.correction for s in stations]
    return Table(
        [
            integers("station_id", [s.station_id for s in stations]),
            texts("source", [s.source for s in stations]),
            integers("n_points", [s.n_points for s in stations]),
            *positions("position", [s.position for s in stations], place),
            *_columns(corrections, place),
        ]
    )


def pairs_table(result: Result) -> Table:
    """Return how each two stations fit as columns, one row for each pair.

    Parameters
    ----------
    result : Result

    Returns
    -------
    Table
        The names and the values of ``pairs.csv``.
    """
    pairs = result.station_check.pairs if result.station_check else ()
    return Table(
        [
            integers("first_id", [p.first for p in pairs]),
            integers("second_id", [p.second for p in pairs]),
            *_columns([p.correction for p in pairs], FileCoordinates.of(result)),
            floats("residual_mm", [p.residual for p in pairs], 1e3, 3),
        ]
    )


def _columns(corrections: Sequence[Correction], place: FileCoordinates) -> Iterator[Column]:
    yield from positions("pivot", [c.pivot for c in corrections], place)
    for name, unit, attribute in (("d", "mm", "shift"), ("r", "mrad", "rotation")):
        for suffix in ("", "_sd"):
            values = np.reshape([getattr(c, attribute + suffix) for c in corrections], (-1, 3))
            for i, axis in enumerate("xyz"):
                yield floats(f"{name}{axis}{suffix}_{unit}", values[:, i], 1e3, 4)
    yield integers("n_elements", [c.n_elements for c in corrections])
    yield floats("rms_mm", [c.rms for c in corrections], 1e3, 3)
    yield texts("verdict", [str(c.verdict) for c in corrections])
    yield floats("distance_mm", [c.distance for c in corrections], 1e3, 3)
    yield floats("distance_sd_mm", [c.distance_sd for c in corrections], 1e3, 3)
    yield texts("untold", ["; ".join(_direction(v) for v in c.untold) for c in corrections])
    yield texts("reason", [str(c.reason) for c in corrections])


def _direction(vector: np.ndarray) -> str:
    return " ".join(f"{c:.3f}" for c in vector)
