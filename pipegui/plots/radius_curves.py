"""What the radius plot shows of one element: its points, their range, and them as numbers."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from PySide6.QtGui import QColor

from pipecore.geometry import Array
from pipecore.report.format import cell
from pipecore.types import Element, Profiles
from pipegui.plots.export import Table
from pipegui.plots.pattern import Pattern


@dataclass(frozen=True, eq=False)
class Curve:
    """One element's profiles as they are plotted."""

    element: Element
    profiles: Profiles
    pattern: Pattern
    x: Array
    colour: QColor


def range_of(values: Array, fitted: Array, curve: Curve) -> tuple[float, float] | None:
    """Lowest and highest value to be shown: a few wild ones must not flatten the rest."""
    values = values[np.isfinite(values)]
    if not len(values):
        return None
    low, high = np.percentile(values, [2, 98])
    low, high = min(low, fitted.min()), max(high, fitted.max())
    room = max(0.6 * (high - low), 4 * curve.pattern.spread, 0.5)
    return float(max(values.min(), low - room)), float(min(values.max(), high + room))


def table_of(curves: Sequence[Curve]) -> Table:
    """The profiles of the elements, one after the other."""
    table: dict[str, list[str]] = {}

    def put(title: str, values: Array, decimals: int) -> None:
        table.setdefault(title, []).extend(cell(float(v), decimals) for v in values)

    for curve in curves:
        rows, pattern = curve.profiles, curve.pattern
        table.setdefault("element", []).extend([curve.element.label] * len(rows))
        put("profile_index", rows.profile_index, 0)
        put("chainage_m", rows.chainage, 4)
        put("semi_minor_mm", pattern.values, 3)
        put("semi_minor_sd_mm", pattern.sd, 3)
        put("radius_mm", 1000 * rows.radius, 3)
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
