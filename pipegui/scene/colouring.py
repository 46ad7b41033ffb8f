"""What colour each point has. Qt- and VTK-free."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipecore.report.summary import by_verdict
from pipecore.types import NO_ID, Element, ElementKind, PointCloud, Result, Stack
from pipegui.model.cache import cached_with_owner
from pipegui.model.colour_limits import height_limits, intensity_limits
from pipegui.model.document import ClipBox, ColourBy, ViewOptions
from pipegui.model.stations import has_stations
from pipegui.scene.colour_assignment import colour_apart, neighbouring_ids
from pipegui.style.colour_maps import (
    BLOCK,
    HEIGHT,
    INTENSITY,
    KINDS,
    QUALITATIVE,
    Colours,
    deviation_colours,
    look_up,
    rgb,
    station_colour,
)
from pipegui.style.colours import VERDICT

MUTED = {False: (217, 221, 227), True: (70, 76, 84)}
"""Points that the colouring says nothing about, on light and on dark background."""

KIND_COLOUR = dict(zip(ElementKind, KINDS, strict=True))
NO_ELEMENT = (128, 128, 128)
SOUND = (157, 190, 217)
"""Where a pipe has no deformation, in the colours of the verdicts."""
PROFILE_COLOURS = QUALITATIVE[[0, 1]]

Rows = NDArray[np.integer] | slice
ALL = slice(None)
SMALL_BLOCK = 65_536

NEEDS_RESULT = {
    ColourBy.SEGMENT,
    ColourBy.ELEMENT,
    ColourBy.KIND,
    ColourBy.DEVIATION,
    ColourBy.PROFILE,
    ColourBy.VERDICT,
}


def effective(colour_by: ColourBy, cloud: PointCloud, result: Result | None) -> ColourBy:
    """Return `colour_by`, or the next best that this cloud and result can show."""
    if result is None and colour_by in NEEDS_RESULT:
        colour_by = ColourBy.RGB
    if colour_by is ColourBy.STATION and not has_stations(cloud):
        colour_by = ColourBy.RGB
    if colour_by is ColourBy.RGB and cloud.rgb is None:
        colour_by = ColourBy.INTENSITY
    if colour_by is ColourBy.INTENSITY and cloud.intensity is None:
        colour_by = ColourBy.HEIGHT
    return colour_by


def colour_points(
    cloud: PointCloud,
    result: Result | None,
    view: ViewOptions,
    *,
    dark: bool = False,
    rows: Rows = ALL,
) -> Colours:
    """Return the colours of some points of the cloud or of all, uint8, shape (n, 3)."""
    colour_by = effective(view.colour_by, cloud, result)
    asked = _Asked(cloud, view, MUTED[dark], rows)
    if colour_by is ColourBy.RGB and cloud.rgb is not None:
        return cloud.rgb[rows]
    if colour_by is ColourBy.INTENSITY and cloud.intensity is not None:
        return _by_intensity(asked, cloud.intensity)
    if colour_by is ColourBy.STATION and cloud.station is not None:
        return _by_station(asked, cloud.station)
    if result is None or colour_by not in _BY_RESULT:
        return _by_height(asked)
    return _BY_RESULT[colour_by](asked, result)


def visible_points(
    cloud: PointCloud,
    result: Result | None,
    hidden: frozenset[int],
    box: ClipBox | None = None,
    rows: Rows = ALL,
    hidden_stations: frozenset[int] = frozenset(),
) -> NDArray[np.bool_] | None:
    """Return which points are shown by the box and not of what is hidden, None if all are.

    Of the `rows` of the cloud, by default of all; `hidden` are elements.
    """
    seen = None if box is None else points_in(box, cloud.xyz[rows])
    if result is not None and hidden:
        shown = np.ones(_n_ids(result), np.bool_)
        shown[[i for i in hidden if i < len(shown)]] = False
        is_shown = shown[result.element_id[rows]]
        seen = is_shown if seen is None else seen & is_shown
    if cloud.station is not None and hidden_stations:
        is_shown = _shown_stations(cloud, hidden_stations)[cloud.station[rows]]
        seen = is_shown if seen is None else seen & is_shown
    return seen


def _shown_stations(cloud: PointCloud, hidden: frozenset[int]) -> NDArray[np.bool_]:
    """Return whether a station is shown, by its id."""
    shown = np.ones(len(cloud.station_names) + 1, np.bool_)
    shown[[i for i in hidden if i < len(shown)]] = False
    return shown


def points_in(box: ClipBox, xyz: NDArray[np.floating]) -> NDArray[np.bool_]:
    """Return which points lie in a box, or outside if it is inverted."""
    inside = np.empty(len(xyz), np.bool_)
    # In the points' own type: as float64 they would take room three times over.
    low, high = np.array(box.low, xyz.dtype), np.array(box.high, xyz.dtype)
    # In blocks that stay near the processor for all of their comparisons.
    for start in range(0, len(xyz), SMALL_BLOCK):
        at = slice(start, start + SMALL_BLOCK)
        x, y, z = np.ascontiguousarray(xyz[at].T)
        part = (x >= low[0]) & (x <= high[0])
        part &= (y >= low[1]) & (y <= high[1])
        part &= (z >= low[2]) & (z <= high[2])
        inside[at] = part
    return np.logical_not(inside, out=inside) if box.is_inverted else inside


def visible_elements(result: Result | None, hidden: frozenset[int]) -> tuple[Element, ...]:
    """Return the elements that are not hidden."""
    if result is None:
        return ()
    return tuple(e for e in result.elements if e.element_id not in hidden)


def _n_ids(result: Result) -> int:
    """Length of a table by the ids of elements: ids of deleted ones leave gaps."""
    return max((e.element_id for e in result.elements), default=NO_ID) + 1


def _look_up_ids(table: Colours, ids: NDArray[np.integer]) -> Colours:
    return np.asarray(table[ids])


def _ids(result: Result, colour_by: ColourBy) -> NDArray[np.int32]:
    return result.segment_id if colour_by is ColourBy.SEGMENT else result.element_id


def _share(values: NDArray[np.floating], limits: tuple[float, float]) -> NDArray[np.floating]:
    low, high = limits
    return (values - low) / max(high - low, 1e-12)


@cached_with_owner(maxsize=2)
def _apart(result: Result, cloud: PointCloud, colour_by: ColourBy) -> NDArray[np.intp]:
    """Return an index into `QUALITATIVE` for each id; neighbours get different ones."""
    ids = _ids(result, colour_by)
    pairs = neighbouring_ids(cloud.xyz, ids)
    return colour_apart(int(ids.max(initial=0)), pairs, len(QUALITATIVE))


@dataclass(frozen=True, eq=False)
class _Asked:
    """What is to be coloured, and how."""

    cloud: PointCloud
    view: ViewOptions
    muted: tuple[int, int, int]
    rows: Rows


def _by_intensity(asked: _Asked, intensity: NDArray[np.floating]) -> Colours:
    share = _share(intensity[asked.rows], intensity_limits(asked.cloud, asked.view))
    return look_up(INTENSITY, share, asked.muted)


def _by_height(asked: _Asked) -> Colours:
    share = _share(asked.cloud.xyz[asked.rows, 2], height_limits(asked.cloud, asked.view))
    return look_up(HEIGHT, share, asked.muted)


def _by_station(asked: _Asked, station: NDArray[np.uint16]) -> Colours:
    ids = range(1, len(asked.cloud.station_names) + 1)
    table = np.array([asked.muted, *map(station_colour, ids)], np.uint8)
    return _look_up_ids(table, station[asked.rows])


def _by_deviation(asked: _Asked, result: Result) -> Colours:
    deviation_mm = 1000 * result.deviation[asked.rows]
    return deviation_colours(deviation_mm, asked.view.deviation_limit_mm, asked.muted)


def _by_kind(asked: _Asked, result: Result) -> Colours:
    table = np.full((_n_ids(result), 3), asked.muted, np.uint8)
    for element in result.elements:
        table[element.element_id] = KIND_COLOUR[element.kind]
    return _look_up_ids(table, result.element_id[asked.rows])


def _by_id(asked: _Asked, result: Result) -> Colours:
    table = QUALITATIVE[_apart(result, asked.cloud, asked.view.colour_by)]
    table[NO_ID] = asked.muted
    return _look_up_ids(table, _ids(result, asked.view.colour_by)[asked.rows])


def _by_verdict(asked: _Asked, result: Result) -> Colours:
    """Deformed stretches in the colour of their verdict, the worst over the others."""
    table = np.full((_n_ids(result), 3), SOUND, np.uint8)
    table[NO_ID] = asked.muted
    ids, xyz = result.element_id[asked.rows], asked.cloud.xyz[asked.rows]
    colours = table[ids]
    for deformation in reversed(by_verdict(result)):
        at = np.flatnonzero(ids == deformation.element_id)
        axis = result.element(deformation.element_id).axis
        chainage, _, _ = axis.pipe_coordinates(xyz[at].astype(np.float64))
        low, high = deformation.chainage_start, deformation.chainage_end
        colours[at[(chainage >= low) & (chainage <= high)]] = rgb(VERDICT[deformation.verdict])
    return colours


def _by_profile(asked: _Asked, result: Result) -> Colours:
    """Colours that alternate from profile to profile; fainter where there is no segment.

    Where one profile is shown alone, the others are muted; see `profile_points` for it.
    """
    muted, ids = np.array(asked.muted, np.uint8), result.segment_id[asked.rows]
    stack = stack_of(result, asked.view.shown_stack)
    if stack is None or asked.view.shown_profile is not None:
        return np.broadcast_to(muted, (len(ids), 3)).copy()
    faint = (PROFILE_COLOURS.astype(np.int32) + 2 * muted.astype(np.int32)) // 3
    table = np.stack([faint, PROFILE_COLOURS]).astype(np.uint8)
    parity = stack.profile_index(asked.cloud.xyz[asked.rows]) % 2
    return np.asarray(table[(ids != NO_ID).astype(np.intp), parity])


def profile_rows(cloud: PointCloud, stack: Stack, profile_index: int) -> NDArray[np.intp]:
    """Return the indices in the cloud of the points in one profile."""
    start = stack.offset + profile_index * stack.width
    # In the points' own type: as float64 they would take room twice over.
    direction: NDArray[np.floating] = stack.direction.astype(cloud.xyz.dtype)
    # In blocks: with a large cloud there is no memory for a number for each point.
    found = []
    for first in range(0, len(cloud), BLOCK):
        along = np.dot(cloud.xyz[first : first + BLOCK], direction)
        found.append(first + np.flatnonzero((along >= start) & (along < start + stack.width)))
    return np.concatenate(found)


def profile_colours(cloud: PointCloud, result: Result, rows: NDArray[np.intp]) -> Colours:
    """Return the colours of a profile's points, each as its element, grey where there is none."""
    table = QUALITATIVE[_apart(result, cloud, ColourBy.ELEMENT)]
    table[NO_ID] = NO_ELEMENT
    return _look_up_ids(table, result.element_id[rows])


def stack_of(result: Result, stack_id: int) -> Stack | None:
    """Return the stack with this id, if there is one."""
    return next((s for s in result.stacks if s.stack_id == stack_id), None)


_BY_RESULT = {
    ColourBy.DEVIATION: _by_deviation,
    ColourBy.KIND: _by_kind,
    ColourBy.SEGMENT: _by_id,
    ColourBy.ELEMENT: _by_id,
    ColourBy.PROFILE: _by_profile,
    ColourBy.VERDICT: _by_verdict,
}
