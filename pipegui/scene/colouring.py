"""What colour each point has. Qt- and VTK-free."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from pipecore.types import NO_ID, Element, ElementKind, PointCloud, Result
from pipegui.colour_maps import (
    HEIGHT,
    INTENSITY,
    QUALITATIVE,
    Colours,
    deviation_colours,
    look_up,
)
from pipegui.document import ColourBy, ViewOptions
from pipegui.scene.neighbours import colour_apart, neighbouring_ids

MUTED = {False: (217, 221, 227), True: (70, 76, 84)}
"""Points that the colouring says nothing about, on light and on dark background."""

KIND_COLOUR = {
    ElementKind.CYLINDER: QUALITATIVE[0],
    ElementKind.TORUS: QUALITATIVE[1],
    ElementKind.CONE: QUALITATIVE[2],
    ElementKind.SPHERE: QUALITATIVE[3],
    ElementKind.FLANGE: QUALITATIVE[4],
    ElementKind.TEE: QUALITATIVE[5],
    ElementKind.OTHER: QUALITATIVE[9],
}
PROFILE_COLOURS = QUALITATIVE[[0, 1]]

NEEDS_RESULT = {
    ColourBy.SEGMENT,
    ColourBy.ELEMENT,
    ColourBy.KIND,
    ColourBy.DEVIATION,
    ColourBy.PROFILE,
}


def effective(colour_by: ColourBy, cloud: PointCloud, result: Result | None) -> ColourBy:
    """Return `colour_by`, or the next best that this cloud and result can show."""
    if result is None and colour_by in NEEDS_RESULT:
        colour_by = ColourBy.RGB
    if colour_by is ColourBy.RGB and cloud.rgb is None:
        colour_by = ColourBy.INTENSITY
    if colour_by is ColourBy.INTENSITY and cloud.intensity is None:
        colour_by = ColourBy.HEIGHT
    return colour_by


def colour_points(
    cloud: PointCloud, result: Result | None, view: ViewOptions, *, dark: bool = False
) -> Colours:
    """Return the colour of every point, uint8, shape (n, 3)."""
    colour_by = effective(view.colour_by, cloud, result)
    return _COLOURING[colour_by](cloud, result, view, MUTED[dark])


def visible_points(result: Result | None, hidden: frozenset[int]) -> NDArray[np.bool_] | None:
    """Return which points are not of hidden elements, or None if all are seen."""
    if result is None or not hidden:
        return None
    shown = np.ones(len(result.elements) + 1, np.bool_)
    shown[[i for i in hidden if i < len(shown)]] = False
    return shown[result.element_id]


def visible_elements(result: Result | None, hidden: frozenset[int]) -> tuple[Element, ...]:
    """Return the elements that are not hidden."""
    if result is None:
        return ()
    return tuple(e for e in result.elements if e.element_id not in hidden)


def _ids(result: Result, colour_by: ColourBy) -> NDArray[np.int32]:
    return result.segment_id if colour_by is ColourBy.SEGMENT else result.element_id


def _share(values: NDArray[np.floating], limits: tuple[float, float]) -> NDArray[np.floating]:
    low, high = limits
    return (values - low) / max(high - low, 1e-12)


# Ranges and colourings are of a whole cloud; kept while it is looked at.


@lru_cache(maxsize=4)
def intensity_range(cloud: PointCloud) -> tuple[float, float]:
    """Return the intensities between which nearly all points lie."""
    sample = cloud.intensity[:: max(1, len(cloud) // 100_000)]
    low, high = np.nanpercentile(sample, [2, 98])
    return float(low), float(high)


@lru_cache(maxsize=4)
def height_range(cloud: PointCloud) -> tuple[float, float]:
    """Return the local heights between which nearly all points lie."""
    sample = cloud.xyz[:: max(1, len(cloud) // 100_000), 2]
    low, high = np.percentile(sample, [0.5, 99.5])
    return float(low), float(high)


@lru_cache(maxsize=4)
def _apart(cloud: PointCloud, result: Result, colour_by: ColourBy) -> NDArray[np.intp]:
    """Index into `QUALITATIVE` for each id."""
    ids = _ids(result, colour_by)
    pairs = neighbouring_ids(cloud.xyz, ids)
    return colour_apart(int(ids.max(initial=0)), pairs, len(QUALITATIVE))


Muted = tuple[int, int, int]


def _by_rgb(cloud: PointCloud, _: None, __: ViewOptions, ___: Muted) -> Colours:
    return cloud.rgb


def _by_intensity(cloud: PointCloud, _: None, __: ViewOptions, muted: Muted) -> Colours:
    return look_up(INTENSITY, _share(cloud.intensity, intensity_range(cloud)), muted)


def _by_height(cloud: PointCloud, _: None, __: ViewOptions, muted: Muted) -> Colours:
    return look_up(HEIGHT, _share(cloud.xyz[:, 2], height_range(cloud)), muted)


def _by_deviation(_: PointCloud, result: Result, view: ViewOptions, muted: Muted) -> Colours:
    return deviation_colours(1000 * result.deviation, view.deviation_limit_mm, muted)


def _by_kind(_: PointCloud, result: Result, __: ViewOptions, muted: Muted) -> Colours:
    table = np.array([muted, *(KIND_COLOUR[e.kind] for e in result.elements)], np.uint8)
    return table[result.element_id]


def _by_id(cloud: PointCloud, result: Result, view: ViewOptions, muted: Muted) -> Colours:
    table = QUALITATIVE[_apart(cloud, result, view.colour_by)]
    table[NO_ID] = muted
    return table[_ids(result, view.colour_by)]


def _by_profile(cloud: PointCloud, result: Result, view: ViewOptions, muted: Muted) -> Colours:
    """Colours that alternate from profile to profile; fainter where there is no segment."""
    stack = next((s for s in result.stacks if s.stack_id == view.shown_stack), None)
    if stack is None:
        return np.broadcast_to(np.array(muted, np.uint8), (len(cloud), 3)).copy()
    faint = (PROFILE_COLOURS.astype(np.int32) + 2 * np.array(muted)) // 3
    table = np.stack([faint, PROFILE_COLOURS]).astype(np.uint8)
    return table[(result.segment_id != NO_ID).astype(np.intp), stack.profile_index(cloud.xyz) % 2]


_COLOURING = {
    ColourBy.RGB: _by_rgb,
    ColourBy.INTENSITY: _by_intensity,
    ColourBy.HEIGHT: _by_height,
    ColourBy.DEVIATION: _by_deviation,
    ColourBy.KIND: _by_kind,
    ColourBy.SEGMENT: _by_id,
    ColourBy.ELEMENT: _by_id,
    ColourBy.PROFILE: _by_profile,
}
