"""``pipecore simulate``."""

import argparse
from dataclasses import replace

from pipecore import io
from pipecore.cli.console import Console
from pipecore.errors import WriteError
from pipecore.formatting import format_count
from pipecore.simulate import find_scene, scan


def run(args: argparse.Namespace, console: Console) -> None:
    """Scan a scene and write the cloud, with its truth beside it."""
    if args.output.suffix.lower() != ".laz":
        raise WriteError(f"The scan is written as LAZ: “{args.output}” must end with .laz.")
    scene = find_scene(args.scene)
    if args.seed is not None:
        scene = replace(scene, seed=args.seed)
    simulated = scan(scene, progress=console)
    truth_path = args.output.with_name("truth.json")
    with io.write_file(truth_path) as temporary:
        simulated.write_truth(temporary)
        io.write_laz(
            args.output,
            simulated.cloud,
            {"truth_element": simulated.truth_element, "station": simulated.station},
            progress=console,
        )
    truth = simulated.truth
    console.say(
        f"{format_count(len(simulated.cloud), 'point')} on "
        f"{format_count(len(truth.elements), 'element')} with "
        f"{format_count(len(truth.deformations), 'deformation')}."
    )
    console.say(f"Scan: {args.output}")
    console.say(f"Truth: {truth_path}")
