"""The page's section on stations: whether they fit together, and where they disagree."""

from typing import Any

import numpy as np
from markupsafe import Markup

from pipecore.formatting import NOT_MEASURABLE, format_count, format_measure
from pipecore.report.page_tables import PageColumn
from pipecore.types import (
    Array,
    Correction,
    Disagreement,
    Result,
    StationCheck,
    StationVerdict,
)

WORST_SHOWN = 12
DOUBLE_WALL_SDS, MOST_NOISE = 3.0, 0.004
"""Walls that lie further apart than so many times the noise, of at most so many metres, are two."""
MAP_WIDTH, MAP_MARGIN = 900.0, 30.0
COLOURS = ((0.001, "#00704f"), (0.002, "#8a8a00"), (0.005, "#c56a00"), (np.inf, "#a8003c"))
"""Of disagreements up to so many metres."""


def stations_of_page(result: Result) -> dict[str, Any] | None:
    """Return what the page says of the stations, or None where the cloud is of one."""
    check = result.station_check
    if check is None:
        return None
    columns = [PageColumn("Station", numeric=False), PageColumn("Source", numeric=False)]
    return {
        "verdict": station_sentence(check),
        "table": {
            "columns": [*columns, *_correction_columns()],
            "rows": [[str(s.station_id), s.source, *_cells(s.correction)] for s in check.stations],
        },
        "pairs": {
            "columns": [
                PageColumn("Pair", numeric=False),
                *_correction_columns(),
                PageColumn("Left after the adjustment (mm)"),
            ],
            "rows": [
                [f"{p.first} – {p.second}", *_cells(p.correction), _thousandths(p.residual)]
                for p in check.pairs
            ],
        },
        "worst": _worst(result, check),
        "map": _map(result, check),
        "legend": [
            (colour, f"up to {1e3 * limit:g} mm" if np.isfinite(limit) else "more")
            for limit, colour in COLOURS
        ],
    }


def station_sentence(check: StationCheck) -> str:
    """Say in a sentence or two whether the stations fit together.

    Parameters
    ----------
    check : StationCheck

    Returns
    -------
    str
    """
    ids = {
        verdict: [str(s.station_id) for s in check.stations if s.correction.verdict is verdict]
        for verdict in StationVerdict
    }
    off, untold = ids[StationVerdict.DOES_NOT_FIT], ids[StationVerdict.NOT_MEASURABLE]
    n = len(check.stations)
    if off:
        do = "does" if len(off) == 1 else "do"
        return (
            f"{format_count(len(off), 'station')} of {n} {do} not fit ({', '.join(off)}): "
            "what was measured on pipes that they share with others is not to be trusted."
        )
    if not check.disagreements:
        return (
            f"No pipe was seen by two of the {n} stations at the same place, so nothing can be "
            "told of how they fit. If the files are tiles of one scan, nothing has to."
        )
    if untold:
        return (
            f"Whether all {n} stations fit cannot be told wholly from these pipes (station "
            f"{', '.join(untold)}); nothing that can be told is amiss."
        )
    return f"All {n} stations fit together."


def is_double_wall(disagreement: Disagreement, noise: float) -> bool:
    """Return whether an element is seen as two walls, one beside the other.

    Parameters
    ----------
    disagreement : Disagreement
    noise : float
        Of one point, metres.

    Returns
    -------
    bool
    """
    return bool(disagreement.before > DOUBLE_WALL_SDS * min(noise, MOST_NOISE))


def _correction_columns() -> list[PageColumn]:
    return [
        PageColumn("Fits?", numeric=False),
        PageColumn("Off by (mm)"),
        PageColumn("Shift x, y, z (mm)"),
        PageColumn("Rotation x, y, z (mrad)"),
        PageColumn("Elements"),
        PageColumn("In words", numeric=False),
    ]


def _cells(c: Correction) -> list[str]:
    off = format_measure(1e3 * c.distance, 1e3 * c.distance_sd)
    return [
        str(c.verdict),
        off if np.isfinite(c.distance) else NOT_MEASURABLE,
        ", ".join(map(_thousandths, c.shift)),
        ", ".join(map(_thousandths, c.rotation)),
        str(c.n_elements),
        str(c.reason),
    ]


def _thousandths(value: float) -> str:
    return f"{1e3 * value:.2f}" if np.isfinite(value) else "?"


def _worst(result: Result, check: StationCheck) -> dict[str, Any]:
    """The elements on which stations disagree most; double walls are named."""
    columns = [
        PageColumn("Element", numeric=False),
        PageColumn("Stations", numeric=False),
        PageColumn("Apart as scanned (mm)"),
        PageColumn("Apart once moved (mm)"),
        PageColumn("Remark", numeric=False),
    ]
    known = {e.element_id: e for e in result.elements}
    apart = [d for d in check.disagreements if d.element_id in known]
    rows = [
        [
            known[d.element_id].label,
            " + ".join(map(str, d.stations)),
            _thousandths(d.before),
            _thousandths(d.after),
            "double wall" if is_double_wall(d, known[d.element_id].rms) else "",
        ]
        for d in sorted(apart, key=lambda d: (-d.before, d.element_id))[:WORST_SHOWN]
    ]
    return {"columns": columns, "rows": rows}


def _map(result: Result, check: StationCheck) -> Markup:
    """A plan of the elements, coloured by how far their stations disagree."""
    apart = {d.element_id: d.before for d in check.disagreements}
    axes = {
        e.element_id: e.axis.at(np.linspace(0.0, e.axis.length, 9))[:, :2] for e in result.elements
    }
    known = [s for s in check.stations if np.isfinite(s.position).all()]
    if not axes:
        return Markup("")
    everything = np.concatenate([*axes.values(), *(s.position[None, :2] for s in known)])
    low, high = everything.min(axis=0), everything.max(axis=0)
    scale = (MAP_WIDTH - 2 * MAP_MARGIN) / max(float(np.max(high - low)), 1e-3)
    width, height = 2 * MAP_MARGIN + scale * (high - low)

    def place(xy: Array) -> Array:
        x, y = (MAP_MARGIN + scale * (xy - low)).T
        return np.column_stack([x, height - y])

    drawn = [_line(place(xy), apart.get(i)) for i, xy in axes.items()]
    for station in known:
        ((x, y),) = place(station.position[None, :2])
        drawn.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="6"/>')
        drawn.append(f'<text x="{x + 9:.1f}" y="{y + 5:.1f}">{station.station_id}</text>')
    box = f'viewBox="0 0 {width:.0f} {height:.0f}" role="img" font-size="14"'
    return Markup(f"<svg {box}>{''.join(drawn)}</svg>")


def _line(xy: Array, apart: float | None) -> str:
    colour = "#c4c9cf"
    if apart is not None:
        colour = next(name for limit, name in COLOURS if apart <= limit)
    points = " ".join(f"{x:.1f},{y:.1f}" for x, y in xy)
    return f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="3"/>'
