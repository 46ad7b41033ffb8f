"""What the colours of the points mean, in words and numbers. Qt- and VTK-free."""

from dataclasses import dataclass

import numpy as np

from pipecore.formatting import MINUS
from pipecore.types import ElementKind, PointCloud, Result
from pipegui.i18n.texts import first_capital, mark, tr
from pipegui.model.colour_limits import height_limits, intensity_limits, n_decimals
from pipegui.model.document import ColourBy, Limits, ViewOptions
from pipegui.model.stations import stations_of
from pipegui.scene.colouring import (
    KIND_COLOUR,
    NO_ELEMENT,
    PROFILE_COLOURS,
    SOUND,
    effective,
    stack_of,
)
from pipegui.states.descriptions import point_count
from pipegui.states.hover_texts import station_label
from pipegui.style.colour_maps import (
    DEVIATION,
    HEIGHT,
    INTENSITY,
    Colours,
    rgb,
    station_colour,
)
from pipegui.style.colours import VERDICT

MOST_LISTED, LONGEST_NAME = 12, 28
"""Stations, and characters of their names, that a legend has room for."""

Swatch = tuple[tuple[int, int, int], str]

KIND_NAME = {
    ElementKind.CYLINDER: mark("Pipe"),
    ElementKind.TORUS: mark("Bend"),
    ElementKind.CONE: mark("Reducer"),
    ElementKind.SPHERE: mark("Sphere"),
    ElementKind.FLANGE: mark("Flange"),
    ElementKind.TEE: mark("Tee"),
    ElementKind.OTHER: mark("Other"),
}


@dataclass(frozen=True, eq=False)
class Legend:
    """A scale with ticks, or a list of swatches.

    Parameters
    ----------
    title : str
    scale : ndarray of uint8, shape (n, 3), optional
        Colours from the low to the high end.
    ticks : tuple of (float, str)
        Place on the scale (0 … 1) and its text.
    swatches : tuple of ((r, g, b), str)
    """

    title: str
    scale: Colours | None = None
    ticks: tuple[tuple[float, str], ...] = ()
    swatches: tuple[Swatch, ...] = ()


def make_legend(cloud: PointCloud, result: Result | None, view: ViewOptions) -> Legend | None:
    """Return what the colours mean, or None where they speak for themselves."""
    colour_by = effective(view.colour_by, cloud, result)
    if colour_by is ColourBy.DEVIATION:
        return Legend(tr("Deviation, mm"), DEVIATION, _deviation_ticks(view.deviation_limit_mm))
    if colour_by is ColourBy.HEIGHT:
        low, high = (h + float(cloud.origin[2]) for h in height_limits(cloud, view))
        return Legend(tr("Height, m"), HEIGHT, _ticks((low, high)))
    if colour_by is ColourBy.INTENSITY:
        return Legend(tr("Intensity"), INTENSITY, _ticks(intensity_limits(cloud, view)))
    if colour_by is ColourBy.STATION:
        return Legend(tr("Station"), swatches=_station_swatches(cloud))
    return _result_legend(colour_by, result, view) if result is not None else None


def _result_legend(colour_by: ColourBy, result: Result, view: ViewOptions) -> Legend | None:
    if colour_by is ColourBy.KIND:
        kinds = {e.kind for e in result.elements}
        return Legend(tr("Kind"), swatches=tuple(_swatch(k) for k in KIND_COLOUR if k in kinds))
    if colour_by is ColourBy.VERDICT:
        return Legend(tr("Verdict"), swatches=_verdict_swatches(result))
    if colour_by is ColourBy.PROFILE:
        return _profile_legend(result, view)
    return None


def _station_swatches(cloud: PointCloud) -> tuple[Swatch, ...]:
    stations = stations_of(cloud)
    listed = stations if len(stations) <= MOST_LISTED else stations[: MOST_LISTED - 1]
    swatches = [
        (
            station_colour(station.station_id),
            f"{_elided(station_label(station))} · {point_count(station.n_points)}",
        )
        for station in listed
    ]
    if n_more := len(stations) - len(listed):
        swatches.append((NO_ELEMENT, tr("and {n} more").format(n=n_more)))
    return tuple(swatches)


def _elided(name: str) -> str:
    """Return a name without its middle where it is long."""
    half = LONGEST_NAME // 2
    return name if len(name) <= LONGEST_NAME else f"{name[:half]}…{name[-half:]}"


def _ticks(limits: Limits) -> tuple[tuple[float, str], ...]:
    low, high = limits
    decimals = n_decimals(limits)
    shares = np.linspace(0, 1, 5).tolist()
    values = (f"{low + share * (high - low):.{decimals}f}" for share in shares)
    return tuple((s, v.replace("-", MINUS)) for s, v in zip(shares, values, strict=True))


def _deviation_ticks(limit_mm: float) -> tuple[tuple[float, str], ...]:
    signs = (MINUS, MINUS, "", "+", "+")
    shares = np.linspace(0, 1, 5).tolist()
    return tuple(
        (share, f"{sign}{abs(2 * share - 1) * limit_mm:g}")
        for share, sign in zip(shares, signs, strict=True)
    )


def _swatch(kind: ElementKind) -> Swatch:
    red, green, blue = KIND_COLOUR[kind].tolist()
    return (red, green, blue), tr(KIND_NAME[kind])


def _verdict_swatches(result: Result) -> tuple[Swatch, ...]:
    given = {d.verdict for d in result.deformations}
    colours = [(rgb(VERDICT[v]), first_capital(tr(v))) for v in VERDICT if v in given]
    return (*reversed(colours), (SOUND, tr("No deformation")))


def _profile_legend(result: Result, view: ViewOptions) -> Legend:
    stack = stack_of(result, view.shown_stack)
    if stack is None:
        return Legend(tr("No stack is shown: tick one in the stacks panel."))
    if view.shown_profile is not None:
        return Legend(
            tr("One profile of {stack}").format(
                stack=stack.name or tr("stack {stack_id}").format(stack_id=stack.stack_id)
            ),
            swatches=((NO_ELEMENT, tr("of no element")),),
        )
    even, odd = (tuple(c) for c in PROFILE_COLOURS.tolist())
    return Legend(
        tr("{stack}, {width:.0f} mm wide").format(
            stack=stack.name or tr("Stack {stack_id}").format(stack_id=stack.stack_id),
            width=1000 * stack.width,
        ),
        swatches=((even, tr("even profiles")), (odd, tr("odd profiles"))),
    )
