"""What the user can do to the 3D view, beside the commands on scans and results. Qt-free."""

import numpy as np

from pipegui.commands import select_parent, select_point, set_view
from pipegui.document import Document, Measurement, Point, Tool

POINT_SIZES = (0.4, 0.6, 0.8, 1.0, 1.3, 1.7, 2.2, 3.0, 4.0)
N_SAMPLED = 200_000


def set_point_size(document: Document, size: str) -> Document:
    """Draw points "larger", "smaller" or as large as "usual"."""
    step = {"larger": 1, "smaller": -1}.get(size)
    if step is None:
        return set_view(document, point_size=1.0)
    now = int(np.argmin(np.abs(np.array(POINT_SIZES) - document.view.point_size)))
    return set_view(document, point_size=POINT_SIZES[min(max(now + step, 0), len(POINT_SIZES) - 1)])


def fit_limits(document: Document) -> Document:
    """Choose deviation limits that hold 98 % of the points, in whole steps of 0.5 mm."""
    if document.result is None:
        return document
    deviation = document.result.deviation
    sample = np.abs(deviation[:: max(1, len(deviation) // N_SAMPLED)])
    sample = sample[np.isfinite(sample)]
    if not len(sample):
        return document
    limit_mm = 1000 * float(np.percentile(sample, 98))
    return set_view(document, deviation_limit_mm=max(np.ceil(2 * limit_mm) / 2, 0.5))


# Clicking and measuring


def choose_tool(document: Document, tool: Tool) -> Document:
    """Choose what a click does; the tool that is chosen already is put away."""
    if document.view.tool is tool:
        tool = Tool.SELECT
    return set_view(document, tool=tool, measuring_from=None)


def click_point(document: Document, point_index: int) -> Document:
    """Do with a point of the cloud what the tool does; -1 is beside all points."""
    view = document.view
    if view.tool is Tool.SELECT:
        return select_point(document, point_index)
    if point_index < 0 or document.scan is None:
        return document
    point = _point(document, point_index)
    if view.tool is Tool.COORDINATES:
        return _keep(document, Measurement(point))
    if view.measuring_from is None:
        return set_view(document, measuring_from=point)
    return _keep(document, Measurement(view.measuring_from, point))


def escape(document: Document) -> Document:
    """Give up the point, then the tool; else go up in what is selected."""
    if document.view.measuring_from is not None:
        return set_view(document, measuring_from=None)
    if document.view.tool is not Tool.SELECT:
        return set_view(document, tool=Tool.SELECT)
    return select_parent(document)


def delete_measurement(document: Document, number: int) -> Document:
    """Delete one measurement; -1 is the last."""
    kept = list(document.view.measurements)
    if kept:
        del kept[number]
    return set_view(document, measurements=tuple(kept))


def delete_measurements(document: Document) -> Document:
    """Delete all measurements."""
    return set_view(document, measurements=(), measuring_from=None)


def _point(document: Document, point_index: int) -> Point:
    assert document.scan is not None
    east, north, height = document.scan.cloud.xyz[point_index].tolist()
    return east, north, height


def _keep(document: Document, measurement: Measurement) -> Document:
    measurements = (*document.view.measurements, measurement)
    return set_view(document, measurements=measurements, measuring_from=None)
