"""What is said of a section: its dimensions in words. Qt-free."""

import numpy as np

from pipecore.formatting import format_clock
from pipecore.inspection.dimensions import Dimension, DimensionKind, measure_dimensions
from pipecore.inspection.section import Section
from pipegui.i18n.reason_texts import reason_text
from pipegui.i18n.texts import format_measure, mark, tr

NAMES = {
    DimensionKind.DMAX: "Dmax",
    DimensionKind.DMIN: "Dmin",
    DimensionKind.DEPTH: mark("Depth"),
    DimensionKind.HEIGHT: mark("Height"),
}


def value_text(dimension: Dimension) -> str:
    """Return the value with its uncertainty: "12.3 ± 0.4 mm"."""
    return format_measure(1000 * dimension.value, 1000 * dimension.sd, "mm")


def dimension_text(dimension: Dimension) -> str:
    """Return name and value: "Depth 12.3 ± 0.4 mm"."""
    return f"{tr(NAMES[dimension.kind])} {value_text(dimension)}"


def section_text(section: Section) -> str:
    """Return what is measured of a section, as far as the scan carries it."""
    profile, dimensions = section.profile, measure_dimensions(section)
    radius = format_measure(1000 * profile.radius[0], 1000 * profile.radius_sd[0], "mm")
    parts = [
        tr("Radius {radius}").format(radius=radius)
        if section.is_radius_measurable
        else tr("Radius not measurable: little is seen, and that is deformed"),
        tr("arc seen {arc:.0f}°").format(arc=np.rad2deg(profile.arc[0])),
    ]
    if not any(d.is_diameter for d in dimensions):
        parts.append(tr("diameters not measurable: too little arc"))
    for dimension in dimensions:
        text = dimension_text(dimension)
        if not dimension.is_diameter:
            clock = float(section.reference.clock(dimension.ends_uv[1:])[0])
            text += tr(" at {clock}").format(clock=format_clock(clock))
        parts.append(text)
    ovality = float(profile.ovality[0])
    if np.isfinite(ovality):
        parts.append(
            tr("ovality {ovality}").format(ovality=format_measure(100 * ovality, unit="%"))
        )
    if section.curve is None:
        parts.append(tr("no fitted curve: {reason}").format(reason=reason_text(section.no_curve)))
    return " · ".join(parts)
