"""``pipecore info``."""

import argparse

import numpy as np

from pipecore import io
from pipecore.cli.console import Console
from pipecore.cli.parser import given_settings
from pipecore.formatting import format_count
from pipecore.settings import Settings


def run(args: argparse.Namespace, console: Console) -> None:
    """Say what is in a file."""
    settings = Settings().replace(given_settings(args))
    info = io.info(args.file, progress=console, **vars(settings.input))
    # Four decimals: a tenth of a millimetre if the unit is metres.
    low, high = ("  ".join(f"{c:.4f}" for c in corner) for corner in (info.minimum, info.maximum))
    size = " × ".join(f"{c:.4g}" for c in info.maximum - info.minimum)
    left_out = ", ".join(f"{n:,} {reason}" for reason, n in info.left_out.items() if n)
    lines = [
        ("File", info.path.name),
        ("Format", info.format),
        ("Points", f"{info.n_points:,}"),
        ("Left out", left_out or "none"),
        ("Extent", size),
        ("Lowest x, y, z", low),
        ("Highest x, y, z", high),
        ("Spacing", f"{info.spacing:.2g}" if np.isfinite(info.spacing) else "not measurable"),
        ("Fields", ", ".join(info.fields) or "coordinates only"),
        ("CRS", info.crs or "not given"),
        ("Unit", str(info.unit)),
        ("Scans", _scans(info.n_scans, info.n_stations)),
    ]
    for name, value in lines:
        console.say(f"{name:<16} {value}")
    console.say("Lengths are in the unit of the file.")
    if info.stations:
        console.say()
        _list_stations(info.stations, console)
    if info.notes:
        console.say()
    for note in info.notes:
        console.say(f"Note: {note}")


def _scans(n_scans: int, n_stations: int) -> str:
    return f"{n_scans}, {format_count(n_stations, 'scanner position')} known"


def _list_stations(stations: tuple[io.StationInfo, ...], console: Console) -> None:
    console.say(f"{'Station':>8} {'Points':>14}  Scanner at x, y, z; from")
    for number, station in enumerate(stations, start=1):
        place = "  ".join(f"{c:.4f}" for c in station.position or ())
        console.say(f"{number:>8} {station.n_points:>14,}  {place or 'not known'}; {station.name}")
