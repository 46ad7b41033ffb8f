"""Small figures of one deformation, as SVG to stand inside a page.

Left the radius along the element; right what shows the kind best: the unrolled map of a
dent or bulge, the section of an ovality, the path of the centres of a bow or kink.
"""

import io
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from pipecore.formatting import format_clock
from pipecore.inspection.deviation_grid import clock_from, grid_deviation
from pipecore.inspection.points import ElementPoints, element_points
from pipecore.inspection.radius_pattern import radius_pattern
from pipecore.types import (
    OWN_STACK,
    Array,
    Deformation,
    DeformationKind,
    Element,
    PointCloud,
    Result,
)

INK = "#333333"
BLUE, VERMILION, GREY = "#0072B2", "#D55E00", "#8a8a8a"
STYLE: dict[Any, Any] = {
    "font.family": "sans-serif",
    "font.size": 8.0,
    "axes.edgecolor": GREY,
    "axes.labelcolor": INK,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "xtick.color": INK,
    "ytick.color": INK,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "axes.titlesize": 8.0,
    "axes.titlelocation": "left",
    # Text stays text (searched, in the page's font), ids are the same in every run.
    "svg.fonttype": "none",
    "svg.hashsalt": "pipecore",
}
RIGHT = (0.57, 0.19, 0.35, 0.70)
COLOUR_BAR = (0.93, 0.19, 0.012, 0.70)

SECTION_CELLS = 72


def draw_deformation(
    deformation: Deformation, cloud: PointCloud, result: Result, rows: NDArray[np.intp]
) -> str:
    """Return the figure of one deformation as an ``<svg>`` element.

    `rows` are those of the cloud's points that are the element's.
    """
    element = result.element(deformation.element_id)
    points = element_points(cloud, result, element.element_id, rows)
    with mpl.rc_context(STYLE):
        # Places by hand: a layout engine takes as long as all the drawing.
        figure = Figure(figsize=(7.4, 2.3))
        left, right = figure.add_axes((0.06, 0.19, 0.44, 0.70)), figure.add_axes(RIGHT)
        left.patch.set_visible(False)
        _draw_radius(left, deformation, element, result)
        if deformation.kind in (DeformationKind.DENT, DeformationKind.BULGE):
            _draw_map(right, deformation, element, points)
        elif deformation.kind is DeformationKind.OVALITY:
            _draw_section(right, deformation, element, points)
        else:
            _draw_centres(right, deformation, element, result)
        text = io.StringIO()
        figure.savefig(text, format="svg", facecolor="none", metadata={"Date": None})
    svg = text.getvalue()
    return svg[svg.index("<svg") :]


def _mark_extent(axes: Axes, deformation: Deformation) -> None:
    axes.axvspan(
        deformation.chainage_start, deformation.chainage_end, color=VERMILION, alpha=0.12, lw=0
    )
    axes.axvline(deformation.chainage, color=VERMILION, lw=0.8)


def _draw_radius(axes: Axes, deformation: Deformation, element: Element, result: Result) -> None:
    profiles = result.profiles.of_element(element.element_id, OWN_STACK)
    pattern = radius_pattern(element, profiles)
    _mark_extent(axes, deformation)
    chainage = np.linspace(0, element.axis.length, 50)
    axes.plot(chainage, 1000 * element.radius_at(chainage), color=GREY, lw=1.0, label="fitted")
    axes.plot(
        *broken_at_gaps(profiles.chainage, 1000 * pattern.values),
        color=BLUE,
        lw=0.8,
    )
    axes.errorbar(
        profiles.chainage,
        1000 * pattern.values,
        yerr=1000 * np.nan_to_num(pattern.sd),
        fmt=".",
        ms=2.5,
        color=INK,
        elinewidth=0.5,
        label="semi-minor axis ± sd",
    )
    axes.set(xlabel="chainage (m)", title=f"{element.label}: radius (mm)")
    axes.legend(frameon=False, fontsize=7, ncols=3, handlelength=1.2, columnspacing=1.0)
    axes.margins(y=0.25)


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


def _draw_map(
    axes: Axes, deformation: Deformation, element: Element, points: ElementPoints
) -> None:
    reach = (deformation.chainage_end - deformation.chainage_start) / 2 + 2 * element.radius
    low = max(0.0, deformation.chainage - reach)
    high = min(element.axis.length, deformation.chainage + reach)
    # The deformation stands in the middle of the map, wherever it is on the clock.
    middle = deformation.clock if np.isfinite(deformation.clock) else np.pi
    grid = grid_deviation(element, points, extent=(low, high), centre_clock=middle)
    limit = float(np.ceil(1000 * _drawn_depth(deformation)))
    axes.set_facecolor("#eeeeee")  # holes stay holes
    image = axes.imshow(
        1000 * grid.deviation.T,
        extent=(low, high, np.pi, -np.pi),
        aspect="auto",
        cmap="RdBu_r",
        vmin=-limit,
        vmax=limit,
        interpolation="nearest",
    )
    axes.plot(deformation.chainage, 0, "+", color="black", ms=7, mew=1.0)
    axes.set(xlabel="chainage (m)", title="deviation (mm), unrolled; blue inward, red outward")
    _set_clock_ticks(axes, middle)
    figure = axes.figure
    figure.colorbar(image, cax=figure.add_axes(COLOUR_BAR), ticks=[-limit, 0, limit])


def _set_clock_ticks(axes: Axes, middle: float) -> None:
    hours = np.arange(0, 2 * np.pi, np.pi / 2)
    axes.set_yticks(clock_from(hours, middle), [format_clock(hour) for hour in hours])


def _draw_section(
    axes: Axes, deformation: Deformation, element: Element, points: ElementPoints
) -> None:
    angle, mean = section_around(deformation, element, points)
    radius = float(element.radius_at(deformation.chainage))
    # So exaggerated that the deviation is a fifth of the radius, by a round factor.
    exaggeration = max(1, round(radius / 5 / _drawn_depth(deformation)))
    circle = np.linspace(0, 2 * np.pi, 181)

    def draw(at: Array, departure: Array | float, *style: str, **look: Any) -> None:
        r = 1000 * (radius + exaggeration * departure)
        axes.plot(r * np.sin(at), r * np.cos(at), *style, **look)

    draw(circle, 0.0, color=GREY, lw=1.0)
    if np.isfinite(deformation.depth) and np.isfinite(deformation.clock):
        oval = deformation.depth * np.cos(2 * (circle - deformation.clock))
        draw(circle, oval, color=BLUE, lw=1.0)
    draw(angle, mean, ".", ms=3, color=INK)
    axes.set_aspect("equal")
    axes.margins(0.12)
    axes.set(
        xlabel="mm",
        title=f"section, 12:00 up, departures × {exaggeration}",
    )


def section_around(
    deformation: Deformation, element: Element, points: ElementPoints
) -> tuple[Array, Array]:
    """Clock and mean height over the fitted radius of the points around an ovality's peak.

    Not their deviations: those are from the section's own curve, which is oval itself.
    """
    half = max(0.02, (deformation.chainage_end - deformation.chainage_start) / 6)
    is_near = np.abs(points.chainage - deformation.chainage) < half
    is_near &= np.isfinite(points.deviation)
    height = points.distance - element.radius_at(points.chainage)
    return _means_around(points.clock[is_near], height[is_near])


def _means_around(clock: Array, height: Array) -> tuple[Array, Array]:
    """Clock and mean height of the points in each cell around the pipe that has some."""
    cell = np.floor(clock / (2 * np.pi) * SECTION_CELLS).astype(np.intp) % SECTION_CELLS
    count = np.bincount(cell, minlength=SECTION_CELLS)
    total = np.bincount(cell, weights=height, minlength=SECTION_CELLS)
    seen = count > 0
    middle = (np.arange(SECTION_CELLS) + 0.5) * 2 * np.pi / SECTION_CELLS
    return middle[seen], total[seen] / count[seen]


def _draw_centres(axes: Axes, deformation: Deformation, element: Element, result: Result) -> None:
    profiles = result.profiles.of_element(element.element_id, OWN_STACK)
    _mark_extent(axes, deformation)
    path = broken_at_gaps(profiles.chainage, 1000 * profiles.centre_deviation)
    axes.plot(*path, ".-", ms=3, lw=0.6, color=INK)
    axes.set(xlabel="chainage (m)", title="distance of the centres from the axis (mm)")
    axes.set_ylim(bottom=0)
