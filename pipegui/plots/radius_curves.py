"""What the radius plot shows of one element: its points, their range, and them as numbers."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PySide6.QtGui import QColor

from pipecore.formatting import cell
from pipecore.geometry import Array
from pipecore.inspection.radius_pattern import RadiusPattern, radius_pattern
from pipecore.inspection.section import radius_is_measurable
from pipecore.rules import MEASURE_TEXTS, DentLimit
from pipecore.types import Element, Profiles, Verdict
from pipegui.i18n.texts import format_measure, label_of, tr
from pipegui.plots.chart import faint
from pipegui.plots.export import Table
from pipegui.style import theme
from pipegui.style.colour_maps import QUALITATIVE
from pipegui.style.colours import VERDICT


@dataclass(frozen=True, eq=False)
class Curve:
    """One element's profiles as they are plotted."""

    element: Element
    profiles: Profiles
    pattern_mm: RadiusPattern
    """In millimetres."""
    x: Array
    colour: QColor


def curve_of(element: Element, profiles: Profiles, x: Array, colour: QColor) -> Curve:
    """Return an element's profiles as they are plotted at places `x`."""
    pattern_mm = radius_pattern(element, profiles).scaled(1000)
    return Curve(element, profiles, pattern_mm, x, colour)


def free_radius_mm(profiles: Profiles) -> Array:
    """Return the radii of the free circles, nan where they are not the pipe's, millimetres."""
    return np.where(radius_is_measurable(profiles), 1000 * profiles.radius, np.nan)


def range_of(values: Array, fitted: Array, curve: Curve) -> tuple[float, float] | None:
    """Lowest and highest value to be shown: a few wild ones must not flatten the rest."""
    values = values[np.isfinite(values)]
    if not len(values):
        return None
    low, high = np.percentile(values, [2, 98])
    low, high = min(low, fitted.min()), max(high, fitted.max())
    room = max(0.6 * (high - low), 4 * curve.pattern_mm.scatter, 0.5)
    return float(max(values.min(), low - room)), float(min(values.max(), high + room))


def table_of(curves: Sequence[Curve]) -> Table:
    """Return the profiles of the elements, one element after the other."""
    table: dict[str, list[str]] = {}

    def put(title: str, values: Array | NDArray[np.int32], decimals: int) -> None:
        table.setdefault(title, []).extend(cell(float(v), decimals) for v in values)

    for curve in curves:
        rows, pattern = curve.profiles, curve.pattern_mm
        table.setdefault("element", []).extend([curve.element.label] * len(rows))
        put("profile_index", rows.profile_index, 0)
        put("chainage_m", rows.chainage, 4)
        put("semi_minor_mm", pattern.values, 3)
        put("semi_minor_sd_mm", pattern.sd, 3)
        put("radius_mm", free_radius_mm(rows), 3)
        put("radius_sd_mm", 1000 * rows.radius_sd, 3)
        put("fitted_mm", pattern.fitted, 3)
        put("centre_deviation_mm", 1000 * rows.centre_deviation, 3)
        put("ovality_pct", 100 * rows.ovality, 3)
        put("arc_deg", np.rad2deg(rows.arc), 1)
    return table


def key_of(sign: str, colour: QColor, text: str) -> str:
    """Part of the key: a sign in its colour and what it stands for."""
    coloured = f'<span style="color:{colour.name()}">{sign}</span>'
    return f"{coloured}&nbsp;{text.replace(' ', '&nbsp;')}" if text else coloured


def row_text(profiles: Profiles, row: int) -> str:
    """Return the readout of a profile."""
    radius = format_measure(free_radius_mm(profiles)[row], 1000 * profiles.radius_sd[row], "mm")
    centre = format_measure(1000 * profiles.centre_deviation[row], unit="mm")
    index, chainage = profiles.profile_index[row], profiles.chainage[row]
    text = tr("Profile {index} · {chainage:.3f} m · radius {radius} · centre off {centre}")
    return text.format(index=index, chainage=chainage, radius=radius, centre=centre)


def limit_text(limit: DentLimit) -> str:
    """Return which rule sets the limit for dents, and what it asks for."""
    criterion = limit.criterion
    asked = tr(MEASURE_TEXTS[criterion.measure]).format(criterion.limit)
    return f"{tr(limit.rule.title)}\n{asked}"


def legend(
    curve: Curve,
    pinned: Sequence[Curve],
    shows: Callable[[str], bool],
    limit: DentLimit | None,
) -> str:
    """Return the legend of the plot, as rich text."""
    pattern, data = curve.pattern_mm, curve.colour
    spread = format_measure(pattern.scatter, unit="mm", decimals=2)
    scatter = tr("scatter ± {spread}").format(spread=spread)
    if np.ptp(pattern.fitted) < 1e-6:  # else it is not one number
        middle = format_measure(pattern.middle, decimals=2)
        scatter = tr("median {middle}, {scatter}").format(middle=middle, scatter=scatter)
    parts = []
    if shows("semi_minor"):
        name = tr("semi-minor axis") if not pinned else label_of(curve.element)
        parts.append(key_of("●", data, name))
    parts += [key_of("●", c.colour, label_of(c.element)) for c in pinned]
    if shows("free_radius"):
        violet = QColor(*QUALITATIVE[-1].tolist())
        parts.append(key_of("◇", violet, tr("free circle")))
    if shows("fitted"):
        parts.append(key_of("━", theme.colour("text"), tr("fitted")))
    if shows("band"):
        parts.append(key_of("╍", data, "") + key_of("▒", faint(data, 1), scatter))
    if shows("limit") and limit is not None:
        text = tr("limit for dents {depth:.1f} mm").format(depth=1000 * limit.depth)
        parts.append(key_of("╍", QColor(VERDICT[Verdict.REJECT]), text))
    return "&nbsp; ".join(parts)
