"""``pipecore info``."""

import argparse

import numpy as np

from pipecore import io
from pipecore.cli.console import Console
from pipecore.formatting import format_count


def run(args: argparse.Namespace, console: Console) -> None:
    """Say what is in a file."""
    info = io.info(args.file, progress=console)
    # Four decimals: a tenth of a millimetre if the unit is metres.
    low, high = ("  ".join(f"{c:.4f}" for c in corner) for corner in (info.minimum, info.maximum))
    size = " × ".join(f"{c:.4g}" for c in info.maximum - info.minimum)
    lines = [
        ("File", info.path.name),
        ("Format", info.format),
        ("Points", f"{info.n_points:,}"),
        ("Extent", size),
        ("Lowest x, y, z", low),
        ("Highest x, y, z", high),
        ("Spacing", f"{info.spacing:.2g}" if np.isfinite(info.spacing) else "not measurable"),
        ("Fields", ", ".join(info.fields) or "coordinates only"),
        ("CRS", info.crs or "not given"),
        ("Scans", _scans(info.n_scans, info.n_stations)),
    ]
    for name, value in lines:
        console.say(f"{name:<16} {value}")
    console.say("Lengths are in the unit of the file.")


def _scans(n_scans: int, n_stations: int) -> str:
    return f"{n_scans}, {format_count(n_stations, 'scanner position')} known"
