"""What is measured of a section: diameters, the deepest place. Qt-free."""

from dataclasses import dataclass

import numpy as np

from pipecore.geometry import Array
from pipecore.report.format import format_clock
from pipecore.types import Profiles
from pipegui.i18n.reason_texts import reason_text
from pipegui.i18n.texts import format_measure, mark, tr
from pipegui.plots.exaggeration import deviations
from pipegui.states.section import Ellipse, SectionCut

TELLING = 3.0
"""A deviation is a dimension if it is this many times its standard deviation."""
N_CLOCKS = 720


@dataclass(frozen=True, eq=False)
class Dimension:
    """A distance in a section, in millimetres, between two places in its plane."""

    name: str
    value_mm: float
    sd_mm: float
    ends_uv: Array

    @property
    def value(self) -> str:
        """Value with its uncertainty."""
        return format_measure(self.value_mm, self.sd_mm, "mm")

    @property
    def text(self) -> str:
        """Name and value."""
        return f"{tr(self.name)} {self.value}"


def curve_points(cut: SectionCut) -> list[Array]:
    """The fitted curve in the section's plane, one piece a span, shape (n, 2), millimetres."""
    if cut.curve is None:
        return []
    return [_on_curve(cut, clocks) for clocks in cut.curve.clocks()]


def dimensions(cut: SectionCut) -> list[Dimension]:
    """Largest and smallest diameter, if seen all round, and the deepest place, if it is one."""
    return [*_diameters(cut), *_depth(cut)]


def _diameters(cut: SectionCut) -> list[Dimension]:
    curve = cut.curve
    if curve is None or not curve.is_closed:
        return []
    clocks = np.linspace(0, np.pi, N_CLOCKS // 2, endpoint=False)
    sums = curve.radius_at(clocks) + curve.radius_at(clocks + np.pi)
    found = []
    for name, row in (("Dmax", int(np.argmax(sums))), ("Dmin", int(np.argmin(sums)))):
        ends = np.array([clocks[row], clocks[row] + np.pi])
        sd = 1000 * float(np.linalg.norm(curve.radius_sd_at(ends)))
        found.append(Dimension(name, 1000 * float(sums[row]), sd, _on_curve(cut, ends)))
    return found


def _depth(cut: SectionCut) -> list[Dimension]:
    curve = cut.curve
    if curve is None:
        return []
    clocks = np.concatenate(curve.clocks())
    points = _on_curve(cut, clocks)
    off = deviations(points, cut.reference)
    # Where the curve is known: its ends swing.
    sd = 1000 * curve.radius_sd_at(clocks)
    row = int(np.argmax(np.abs(off) - TELLING * sd))
    if not abs(off[row]) > TELLING * sd[row]:
        return []
    foot = points[row] - off[row] * _away(points[row], cut.reference)
    name = mark("Depth") if off[row] < 0 else mark("Height")
    ends = np.stack([foot, points[row]])
    return [Dimension(name, abs(float(off[row])), float(sd[row]), ends)]


def clock_of(place_uv: Array, reference: Ellipse) -> float:
    """Clock angle of a place in the plane, radians."""
    u, v = np.asarray(place_uv) - reference.centre_uv
    return float(np.mod(np.arctan2(u, v), 2 * np.pi))


def _on_curve(cut: SectionCut, clocks: Array) -> Array:
    assert cut.curve is not None
    rho = 1000 * cut.curve.radius_at(clocks)
    directions = np.stack([np.sin(clocks), np.cos(clocks)], axis=1)
    return np.asarray(cut.reference.centre_uv) + rho[:, None] * directions


def _away(place_uv: Array, reference: Ellipse) -> Array:
    offset = place_uv - np.asarray(reference.centre_uv)
    return np.asarray(offset / np.linalg.norm(offset))


def dimensions_text(profile: Profiles, cut: SectionCut) -> str:
    """Return what is measured of the section, as far as the scan carries it."""
    radius = format_measure(1000 * profile.radius[0], 1000 * profile.radius_sd[0], "mm")
    parts = [
        tr("Radius not measurable: little is seen, and that is deformed")
        if cut.is_askew
        else tr("Radius {radius}").format(radius=radius),
        tr("arc seen {arc:.0f}°").format(arc=np.rad2deg(profile.arc[0])),
    ]
    found = dimensions(cut)
    ovality = float(profile.ovality[0])
    if not any(d.name == "Dmax" for d in found):
        if np.isfinite(ovality):
            half = ovality * float(profile.radius[0])
            for name, side in (("Dmax", 1), ("Dmin", -1)):
                value = 1000 * (2 * profile.radius[0] + side * half)
                parts.append(f"{name} {format_measure(value, unit='mm')}")
        else:
            parts.append(tr("diameters not measurable: too little arc"))
    for dimension in found:
        text = dimension.text
        if dimension.name in ("Depth", "Height"):
            text += tr(" at {clock}").format(
                clock=format_clock(clock_of(dimension.ends_uv[1], cut.reference))
            )
        parts.append(text)
    if np.isfinite(ovality):
        parts.append(
            tr("ovality {ovality}").format(ovality=format_measure(100 * ovality, unit="%"))
        )
    if cut.curve is None:
        parts.append(tr("no fitted curve: {no_curve}").format(no_curve=reason_text(cut.no_curve)))
    return " · ".join(parts)
