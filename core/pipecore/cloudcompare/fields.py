"""What is found, as scalar fields of CloudCompare's own clouds."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipecore.types import NO_ID, PointCloud, Result

SHOWN = "Pipe deviation (mm)"
"""The field that the clouds are coloured by."""

Values = NDArray[np.float32]


def write(clouds: Sequence[Any], cloud: PointCloud, result: Result) -> None:
    """Write the fields of a result; those of a result before are replaced.

    Parameters
    ----------
    clouds : sequence of pycc.ccPointCloud
        That `cloud` was joined of.
    cloud : PointCloud
    result : Result
    """
    first = 0
    values = point_values(cloud, result)
    for each in clouds:
        rows = slice(first, first + each.size())
        first = rows.stop
        for name, column in values.items():
            index = each.getScalarFieldIndexByName(name)
            if index is not None and index >= 0:
                each.deleteScalarField(index)
            index = each.addScalarField(name, column[rows])
            each.getScalarField(index).computeMinAndMax()
        shown = each.getScalarFieldIndexByName(SHOWN)
        each.getScalarField(shown).setSymmetricalScale(True)
        each.setCurrentDisplayedScalarField(shown)
        each.showSF(True)
        each.showSFColorsScale(True)


def point_values(cloud: PointCloud, result: Result) -> Mapping[str, Values]:
    """Return what a result says of every point; nan where it is on no element.

    Parameters
    ----------
    cloud : PointCloud
    result : Result

    Returns
    -------
    mapping of str to ndarray of float32, shape (n,)
        Element and run, deviation from the undeformed surface, chainage and clock.
    """
    none = np.full(len(cloud), np.nan, np.float32)
    element, run, chainage, clock = (none.copy() for _ in range(4))
    order = np.argsort(result.element_id, kind="stable")
    sorted_ids = result.element_id[order]
    for each in result.elements:
        ends = np.searchsorted(sorted_ids, [each.element_id, each.element_id + 1])
        rows = order[ends[0] : ends[1]]
        along, _, around = each.axis.pipe_coordinates(cloud.xyz[rows].astype(np.float64))
        element[rows], run[rows] = each.element_id, each.run_id
        chainage[rows] = along
        clock[rows] = np.mod(around, 2 * np.pi) * 6 / np.pi
    deviation = np.where(result.element_id == NO_ID, np.nan, 1000 * result.deviation)
    return {
        "Pipe element": element,
        "Pipe run": run,
        "Pipe chainage (m)": chainage,
        "Pipe clock (h)": clock,
        SHOWN: deviation.astype(np.float32),
    }
