"""Commands on the 3D view: clicks and measurements, clip box, colours, profiles of a stack."""

from dataclasses import replace

import numpy as np

from pipecore.geometry import Array, surface_points
from pipecore.types import Element, PointCloud
from pipegui.model import result_queries
from pipegui.model.cache import cached_with_owner
from pipegui.model.commands import set_view
from pipegui.model.document import ClipBox, ColourBy, Document, Limits, Measurement, Point, Tool
from pipegui.model.selection_commands import select_parent, select_point

POINT_SIZES = (0.4, 0.6, 0.8, 1.0, 1.3, 1.7, 2.2, 3.0, 4.0)
N_SAMPLED = 200_000


def set_point_size(document: Document, size: str) -> Document:
    """Draw points "larger", "smaller" or as large as "usual"."""
    step = {"larger": 1, "smaller": -1}.get(size)
    if step is None:
        return set_view(document, point_size=1.0)
    now = int(np.argmin(np.abs(np.array(POINT_SIZES) - document.view.point_size)))
    return set_view(document, point_size=POINT_SIZES[min(max(now + step, 0), len(POINT_SIZES) - 1)])


def set_limits(document: Document, limits: Limits) -> Document:
    """Choose the ends of the colours: heights in the world's metres, or intensities.

    Parameters
    ----------
    document : Document
        The present document.
    limits : (float, float)
        World heights in metres, or intensities, in any order.

    Returns
    -------
    Document
    """
    low, high = min(limits), max(limits)
    if document.scan is None or low == high:
        return document
    if document.view.colour_by is ColourBy.HEIGHT:
        base = float(document.scan.cloud.origin[2])
        return set_view(document, height_limits=(low - base, high - base))
    if document.view.colour_by is ColourBy.INTENSITY:
        return set_view(document, intensity_limits=(low, high))
    return document


def fit_limits(document: Document) -> Document:
    """Set limits that hold nearly all points; of deviations 98 %, in steps of 0.5 mm."""
    if document.view.colour_by is ColourBy.HEIGHT:
        return set_view(document, height_limits=None)
    if document.view.colour_by is ColourBy.INTENSITY:
        return set_view(document, intensity_limits=None)
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
    """Choose what a click does; choosing the chosen tool again goes back to selecting."""
    if document.view.tool is tool:
        tool = Tool.SELECT
    return set_view(document, tool=tool, measuring_from=None)


def click_point(document: Document, point_index: int) -> Document:
    """Use the chosen tool on a point of the cloud; -1 is a click beside all points.

    Parameters
    ----------
    document : Document
        The present document.
    point_index : int
        Which point of the active scan's cloud.

    Returns
    -------
    Document
    """
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
    """Give up the first point of a measurement, else the tool, else select the parent."""
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


def end_measuring(document: Document) -> Document:
    """Delete the last measurement, and put the measuring tool away if it is chosen."""
    document = delete_measurement(document, -1)
    return choose_tool(document, Tool.MEASURE) if document.view.tool is Tool.MEASURE else document


def _point(document: Document, point_index: int) -> Point:
    assert document.scan is not None
    east, north, height = document.scan.cloud.xyz[point_index].tolist()
    return east, north, height


def _keep(document: Document, measurement: Measurement) -> Document:
    measurements = (*document.view.measurements, measurement)
    return set_view(document, measurements=measurements, measuring_from=None)


# Clipping

MARGIN = 0.1
"""Around what is clipped to, metres."""
SMALLEST_BOX = 0.01


def switch_clip(document: Document) -> Document:
    """Clip to the whole scan, whose faces can then be dragged; or stop clipping."""
    if document.view.clip_box is not None:
        return set_view(document, clip_box=None)
    return clip_to_scan(document)


def invert_clip(document: Document) -> Document:
    """Show what is outside the clip box instead of what is in it, or the other way round.

    Outside of a box that holds the whole scan there is nothing to see: it is put around
    what is selected first, or around the middle.
    """
    box, scan = document.view.clip_box, document.scan
    if box is None or scan is None:
        return document
    low, high = extent(scan.cloud)
    if not box.is_inverted and (low >= box.low).all() and (high <= box.high).all():
        quarter = (high - low) / 4
        middle = ClipBox(_triple(low + quarter), _triple(high - quarter))
        box = clip_to_selection(set_clip_box(document, middle)).view.clip_box or middle
    return set_view(document, clip_box=replace(box, is_inverted=not box.is_inverted))


def clip_to_scan(document: Document) -> Document:
    """Let the clip box hold the whole scan."""
    if document.scan is None:
        return document
    low, high = extent(document.scan.cloud)
    return set_clip_box(document, ClipBox(_triple(low), _triple(high)))


def clip_to_selection(document: Document) -> Document:
    """Let the clip box hold what is selected, with a margin."""
    result, selection = document.result, document.selection
    if result is None:
        return document
    if selection.deformation_id:
        deformation = result.deformation(selection.deformation_id)
        element = result.element(deformation.element_id)
        points = _outline(element, deformation.chainage_start, deformation.chainage_end)
    else:
        chosen = [
            e
            for e in result.elements
            if (e.element_id == selection.element_id)
            or (not selection.element_id and selection.run_id and e.run_id == selection.run_id)
        ]
        if not chosen:
            return document
        points = np.concatenate([_outline(e, 0.0, e.axis.length) for e in chosen])
    low, high = points.min(axis=0) - MARGIN, points.max(axis=0) + MARGIN
    return set_clip_box(document, ClipBox(_triple(low), _triple(high)))


def set_clip_box(document: Document, box: ClipBox) -> Document:
    """Clip to a box; it keeps a centimetre along each axis."""
    is_inverted = box.is_inverted
    low, high = np.array(box.low), np.array(box.high)
    low, high = np.minimum(low, high), np.maximum(low, high)
    high = np.maximum(high, low + SMALLEST_BOX)
    return set_view(document, clip_box=ClipBox(_triple(low), _triple(high), is_inverted))


@cached_with_owner(maxsize=2)
def extent(cloud: PointCloud) -> tuple[Array, Array]:
    """Least and greatest local coordinates of a cloud.

    Parameters
    ----------
    cloud : PointCloud
        At least one point.

    Returns
    -------
    low, high : ndarray
        Local coordinates in metres, float64, shape (3,).
    """
    columns = cloud.xyz.T
    low = np.array([c.min() for c in columns], np.float64)
    return low, np.array([c.max() for c in columns], np.float64)


def _outline(element: Element, start: float, end: float) -> Array:
    """Points around a stretch of an element, shape (n, 3)."""
    clock = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    along, around = np.meshgrid(np.linspace(start, end, 16), clock)
    s = along.ravel()
    return surface_points(element.axis, s, element.radius_at(s), around.ravel())


def _triple(values: Array) -> Point:
    x, y, z = values.tolist()
    return x, y, z


# The profiles of a stack, one by one


def show_profile(document: Document, profile_index: int | None) -> Document:
    """Show one profile of the stack that is shown; None: all."""
    return set_view(document, shown_profile=profile_index)


def step_stack_profile(document: Document, by: int) -> Document:
    """Show the next (+1) or previous (-1) profile of the stack; the first if all are shown."""
    result, view = document.result, document.view
    if result is None or not view.shown_stack:
        return document
    indices = result_queries.profile_indices(result, view.shown_stack)
    if not len(indices):
        return document
    if view.shown_profile is None:
        return show_profile(document, int(indices[0 if by > 0 else -1]))
    place = int(np.searchsorted(indices, view.shown_profile)) + by
    return show_profile(document, int(indices[min(max(place, 0), len(indices) - 1)]))
