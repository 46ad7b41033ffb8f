"""``pipecore convert``."""

import argparse
from pathlib import Path

import numpy as np

from pipecore import io
from pipecore.cli.console import Console
from pipecore.cli.parser import given_settings
from pipecore.errors import WriteError
from pipecore.formatting import format_count
from pipecore.io.writing import WRITTEN
from pipecore.settings import Settings


def run(args: argparse.Namespace, console: Console) -> None:
    """Read scans with all that they hold, and write them in another format."""
    output: Path = args.output
    # What would fail at the end fails now.
    if output.suffix.lower() not in WRITTEN:
        raise WriteError(f"“{output}” must end in one of {', '.join(WRITTEN)}.")
    settings = Settings().replace(given_settings(args))
    cloud = io.read(
        args.inputs,
        box=args.box and np.reshape(args.box, (2, 3)),
        has_fields=True,
        progress=console,
        **vars(settings.input),
    )
    console.warn(cloud.notes)
    console.warn(io.write(cloud, output, progress=console))
    console.say(f"{format_count(len(cloud), 'point')}: {output}")
