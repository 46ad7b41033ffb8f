"""``pipecore detect``."""

import argparse
import importlib
import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from pipecore import io, parallel
from pipecore._kernels import local_surfaces
from pipecore._kernels.local_surfaces import fit_planes
from pipecore.cli.console import Console
from pipecore.cli.parser import given_settings
from pipecore.errors import WriteError
from pipecore.formatting import format_clock, format_measure
from pipecore.pipeline import detect
from pipecore.report import by_verdict, station_sentence, summarise, write_report
from pipecore.rules import depth_pct_od, load_rules, verdict_words
from pipecore.settings import SCHEDULER, Settings
from pipecore.tiling import GIB, detect_in_tiles, estimate_need
from pipecore.types import PointCloud, Result

SCHEDULER_VARIABLE = "PIPECORE_SCHEDULER"
"""Environment variable that names the dask scheduler, where no flag does."""


def run(args: argparse.Namespace, console: Console) -> None:
    """Read, detect, write the report, and say what was found."""
    settings = Settings()
    if args.settings:
        settings = Settings.from_toml(args.settings, lambda note: console.warn([note]))
    if address := os.environ.get(SCHEDULER_VARIABLE):
        settings = settings.replace({SCHEDULER: address})
    settings = settings.replace(given_settings(args))
    # What would fail at the end fails now.
    load_rules(settings.deformation.rule)
    check_output(args.output, args.overwrite)
    if args.threads:
        parallel.set_threads(args.threads)
    if not is_compiled():
        console.note(
            "The first detection on a machine compiles its kernels, which takes one to three "
            "minutes; later ones do without."
        )

    # What draws figures takes as long to import as to draw some; kernels leave time for it.
    ahead = "pipecore.report.html", "pipecore.report.figures"
    threading.Thread(target=lambda: list(map(importlib.import_module, ahead)), daemon=True).start()
    with _detected(args, settings, console) as (cloud, result):
        notes = write_report(args.output, cloud, result, overwrite=args.overwrite, progress=console)
        console.warn([n for n in result.notes if n not in cloud.notes])
        console.warn(notes)

    console.say(f"{summarise(result)}.")
    for line in deformation_lines(result):
        console.say(line)
    if result.station_check is not None:
        console.say(station_sentence(result.station_check))
    n_candidates = len(result.candidates) + result.n_more_candidates
    if n_candidates:
        were = "was" if n_candidates == 1 else "were"
        console.say(f"{n_candidates} more {were} nearly accepted: see candidates.csv")
    console.say(f"Report: {args.output / 'report.html'}")


def is_compiled() -> bool:
    """Return whether numba's cache holds compiled kernels."""
    stats = getattr(fit_planes, "stats", None)  # none where compiling is switched off
    cached = f"{Path(local_surfaces.__file__).stem}.fit_planes-*.nbi"
    return stats is None or any(Path(stats.cache_path).glob(cached))


@contextmanager
def _detected(
    args: argparse.Namespace, settings: Settings, console: Console
) -> Iterator[tuple[PointCloud, Result]]:
    """Read and detect, in tiles if the scan is larger than the memory it may take."""
    box = args.box and np.reshape(args.box, (2, 3))
    need = estimate_need(args.inputs, settings.tiling, box, settings.input.columns)
    if need.is_too_large:
        console.note(
            f"{need.n_points:,} points would take about {need.bytes_in_one_piece / GIB:.1f} GiB; "
            f"the limit is {need.limit / GIB:.1f} GiB, so they are processed in tiles."
        )
        beside = args.output.absolute().parent
        with detect_in_tiles(args.inputs, settings, console, beside, box) as found:
            console.warn(found[0].notes)
            yield found
        return
    cloud = io.read(args.inputs, box=box, progress=console, **vars(settings.input))
    console.warn(cloud.notes)
    yield cloud, detect(cloud, settings, console)


def check_output(directory: Path, overwrite: bool) -> None:
    """Raise `WriteError` if a report cannot be written into a folder: now, not at the end."""
    if directory.exists() and not directory.is_dir():
        raise WriteError(f"“{directory}” is a file; give a folder.")
    if not directory.absolute().parent.is_dir():
        raise WriteError(f"“{directory}” cannot be made: there is no folder “{directory.parent}”.")
    if not overwrite and directory.is_dir() and any(directory.iterdir()):
        raise WriteError(f"The folder “{directory}” is not empty; give another or use --overwrite.")


def deformation_lines(result: Result) -> list[str]:
    """Return the deformations as an aligned table, the worst first; [] if there are none."""
    rows = [("#", "kind", "element", "chainage", "clock", "depth (mm)", "% OD", "verdict")]
    for d in by_verdict(result):
        element = result.element(d.element_id)
        pct_od, _ = depth_pct_od(d, element)
        rows.append(
            (
                str(d.deformation_id),
                d.kind,
                element.label,
                f"{d.chainage:.2f} m",
                format_clock(d.clock),
                format_measure(1000 * d.depth, 1000 * d.depth_sd),
                f"{pct_od:.1f}" if np.isfinite(pct_od) else "",
                verdict_words(d),
            )
        )
    if len(rows) == 1:
        return []
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    to_the_right = {0, 3, 4, 5, 6}
    return [
        "  ".join(
            text.rjust(width) if i in to_the_right else text.ljust(width)
            for i, (text, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in rows
    ]
