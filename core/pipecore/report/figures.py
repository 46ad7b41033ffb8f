"""Small figures of one deformation, as SVG to stand inside a page.

Left the radius along the element; right what shows the kind best: the unrolled map of a
dent or bulge, the section of an ovality, the path of the centres of a bow or kink.
"""

import numpy as np
from numpy.typing import NDArray

from pipecore.report.format import MINUS, format_clock
from pipecore.report.panel import (
    BLUE,
    GREY,
    INK,
    VERMILION,
    Limits,
    Panel,
    figure,
    limits_of,
)
from pipecore.types import (
    OWN_STACK,
    Array,
    Deformation,
    DeformationKind,
    Element,
    PointCloud,
    Result,
)

WIDTH, HEIGHT = 533.0, 166.0
LEFT = (34.0, 18.0, 234.0, 116.0)
RIGHT = (306.0, 18.0, 187.0, 116.0)
COLOUR_BAR = (506.0, 18.0, 6.0, 116.0)
"""Left, top, width and height of the panels, points."""

FINEST_CELLS_AROUND = 60
POINTS_PER_CELL = 6
SECTION_CELLS = 72

Points = tuple[Array, Array, Array]
"""Chainage, clock and deviation of an element's points."""


def draw_deformation(
    deformation: Deformation, cloud: PointCloud, result: Result, rows: NDArray[np.intp]
) -> str:
    """Return the figure of one deformation as an ``<svg>`` element.

    `rows` are those of the cloud's points that are the element's.
    """
    element = result.element(deformation.element_id)
    panels = [_draw_radius(deformation, element, result)]
    if deformation.kind in (DeformationKind.BOW, DeformationKind.KINK):
        panels.append(_draw_centres(deformation, element, result))
    else:
        points = _points_of(element, cloud, result, rows)
        if deformation.kind is DeformationKind.OVALITY:
            panels.append(_draw_section(deformation, element, points))
        else:
            panels += _draw_map(deformation, element, points)
    return figure(WIDTH, HEIGHT, panels, f"{deformation.kind} on {element.label}")


def _along(element: Element) -> Limits:
    """Limits of a panel whose x is the chainage."""
    room = 0.03 * element.axis.length
    return -room, element.axis.length + room


def _mark_extent(panel: Panel, deformation: Deformation) -> None:
    panel.band(deformation.chainage_start, deformation.chainage_end, VERMILION)
    panel.vertical(deformation.chainage, VERMILION)


def _draw_radius(deformation: Deformation, element: Element, result: Result) -> Panel:
    profiles = result.profiles.of_element(element.element_id, OWN_STACK)
    chainage = np.linspace(0, element.axis.length, 50)
    fitted = 1000 * np.asarray(element.radius_at(chainage))
    minor, sd = 1000 * profiles.semi_minor, 1000 * np.nan_to_num(profiles.semi_minor_sd)
    panel = Panel(
        LEFT,
        _along(element),
        limits_of(fitted, minor - sd, minor + sd, margin=0.25),
        title=f"{element.label}: radius (mm)",
        x_label="chainage (m)",
    )
    _mark_extent(panel, deformation)
    panel.line(chainage, fitted, GREY, 1.0)
    panel.line(*broken_at_gaps(profiles.chainage, minor), BLUE, 0.8)
    panel.bars(profiles.chainage, minor - sd, minor + sd, INK)
    panel.points(profiles.chainage, minor, INK, 2.1)
    is_at_the_start = deformation.chainage < 0.5 * element.axis.length
    panel.legend(
        [("fitted", GREY, 1.0), ("semi-minor axis ± sd", INK, 2.1)], is_on_the_right=is_at_the_start
    )
    return panel


def broken_at_gaps(chainage: Array, values: Array) -> tuple[Array, Array]:
    """Return a line's points with a nan wherever profiles are missing between two of them."""
    if len(chainage) < 3:
        return chainage, values
    step = np.diff(chainage)
    after = np.flatnonzero(step > 2.5 * np.median(step)) + 1
    return np.insert(chainage, after, np.nan), np.insert(values, after, np.nan)


def _drawn_depth(deformation: Deformation) -> float:
    """Depth that a drawing is scaled to, metres: some centimetre where it is not known."""
    return max(deformation.depth, 0.001) if np.isfinite(deformation.depth) else 0.01


def _points_of(
    element: Element, cloud: PointCloud, result: Result, rows: NDArray[np.intp]
) -> Points:
    """Chainage, clock and deviation of an element's points."""
    chainage, _, clock = element.axis.pipe_coordinates(np.asarray(cloud.xyz[rows], np.float64))
    return chainage, clock, np.asarray(result.deviation[rows], np.float64)


def _draw_map(deformation: Deformation, element: Element, points: Points) -> list[Panel]:
    """The map, and the bar that tells its colours."""
    chainage, clock, deviation = points
    reach = (deformation.chainage_end - deformation.chainage_start) / 2 + 2 * element.radius
    low = max(0.0, deformation.chainage - reach)
    high = min(element.axis.length, deformation.chainage + reach)
    # The deformation stands in the middle of the map, wherever it is on the clock.
    middle = deformation.clock if np.isfinite(deformation.clock) else np.pi
    around = np.mod(clock - middle + np.pi, 2 * np.pi) - np.pi
    valid = np.isfinite(deviation) & (chainage >= low) & (chainage <= high)
    n_around = _cells_around(int(valid.sum()), high - low, element)
    shape = n_around, max(1, round((high - low) * n_around / (2 * np.pi * element.radius)))
    row = _cells_of(around[valid], -np.pi, np.pi, shape[0])
    cell = row * shape[1] + _cells_of(chainage[valid], low, high, shape[1])
    count = np.bincount(cell, minlength=shape[0] * shape[1]).reshape(shape)
    total = np.bincount(cell, deviation[valid], shape[0] * shape[1]).reshape(shape)
    mean = np.where(count > 0, total / np.maximum(count, 1), np.nan)

    limit = float(np.ceil(1000 * _drawn_depth(deformation)))
    panel = Panel(
        RIGHT,
        (low, high),
        (np.pi, -np.pi),
        title="deviation (mm), unrolled; blue inward, red outward",
        x_label="chainage (m)",
        y_ticks=_clock_ticks(middle),
    )
    panel.cells(1000 * mean, limit)
    panel.cross(deformation.chainage, 0.0, "black")
    ticks = [(value, f"{value:.0f}".replace("-", MINUS)) for value in (-limit, 0.0, limit)]
    bar = Panel(COLOUR_BAR, (0.0, 1.0), (-limit, limit), y_ticks=ticks, is_on_the_right=True)
    bar.cells(np.linspace(limit, -limit, 64)[:, None], limit)
    return [panel, bar]


def _cells_of(values: Array, low: float, high: float, n: int) -> NDArray[np.intp]:
    """Which of n equal cells values between two limits are in."""
    share = (values - low) / (high - low)
    return np.minimum(np.floor(share * n), n - 1).astype(np.intp)


def _cells_around(n_points: int, length: float, element: Element) -> int:
    """Number of square cells around the pipe that leaves some points in each that is seen."""
    seen_area = length * element.radius * max(element.arc, 0.1)
    cell = np.sqrt(POINTS_PER_CELL * seen_area / max(n_points, 1))
    return int(np.clip(2 * np.pi * element.radius / cell, 12, FINEST_CELLS_AROUND))


def _clock_ticks(middle: float) -> list[tuple[float, str]]:
    hours = np.arange(0, 2 * np.pi, np.pi / 2)
    ticks = np.mod(hours - middle + np.pi, 2 * np.pi) - np.pi
    return [(at, format_clock(hour)) for at, hour in zip(ticks.tolist(), hours, strict=True)]


def _draw_section(deformation: Deformation, element: Element, points: Points) -> Panel:
    chainage, clock, deviation = points
    half = max(0.02, (deformation.chainage_end - deformation.chainage_start) / 6)
    near = (np.abs(chainage - deformation.chainage) < half) & np.isfinite(deviation)
    angle, mean = _means_around(clock[near], deviation[near])
    radius = float(element.radius_at(deformation.chainage))
    # So exaggerated that the deviation is a fifth of the radius, by a round factor.
    exaggeration = max(1, round(radius / 5 / _drawn_depth(deformation)))
    circle = np.linspace(0, 2 * np.pi, 181)

    def drawn(at: Array, departure: Array | float) -> tuple[Array, Array]:
        r = 1000 * (radius + exaggeration * np.asarray(departure))
        return np.asarray(r * np.sin(at)), np.asarray(r * np.cos(at))

    oval = np.zeros_like(circle)
    if np.isfinite(deformation.depth) and np.isfinite(deformation.clock):
        oval = deformation.depth * np.cos(2 * (circle - deformation.clock))
    round_one, oval_one, seen = drawn(circle, 0.0), drawn(circle, oval), drawn(angle, mean)
    shapes = np.concatenate([*round_one, *oval_one, *seen])
    most = 1.12 * float(np.abs(shapes).max())
    side = RIGHT[3]
    panel = Panel(
        (RIGHT[0] + (RIGHT[2] - side) / 2, RIGHT[1], side, side),
        (-most, most),
        (-most, most),
        title=f"section, 12:00 up, deviations × {exaggeration}",
        x_label="mm",
    )
    panel.line(*round_one, GREY, 1.0)
    if oval.any():
        panel.line(*oval_one, BLUE, 1.0)
    panel.points(*seen, INK, 2.4)
    return panel


def _means_around(clock: Array, deviation: Array) -> tuple[Array, Array]:
    """Clock and mean deviation of the points in each cell around the pipe that has some."""
    cell = np.floor(clock / (2 * np.pi) * SECTION_CELLS).astype(np.intp) % SECTION_CELLS
    count = np.bincount(cell, minlength=SECTION_CELLS)
    total = np.bincount(cell, weights=deviation, minlength=SECTION_CELLS)
    seen = count > 0
    middle = (np.arange(SECTION_CELLS) + 0.5) * 2 * np.pi / SECTION_CELLS
    return middle[seen], total[seen] / count[seen]


def _draw_centres(deformation: Deformation, element: Element, result: Result) -> Panel:
    profiles = result.profiles.of_element(element.element_id, OWN_STACK)
    distance = 1000 * profiles.centre_deviation
    panel = Panel(
        RIGHT,
        _along(element),
        (0.0, limits_of(distance, margin=0.08)[1]),
        title="distance of the centres from the axis (mm)",
        x_label="chainage (m)",
    )
    _mark_extent(panel, deformation)
    panel.line(*broken_at_gaps(profiles.chainage, distance), INK, 0.6)
    panel.points(profiles.chainage, distance, INK, 2.4)
    return panel
