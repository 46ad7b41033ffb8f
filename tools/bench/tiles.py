"""Detection in tiles against one piece: `python -m tools.bench.tiles FILE GIB [GIB ...]`.

Tells seconds, CPU seconds and the highest memory of each, and which of the tables differ. A
limit of 0 is one piece; where that is not asked for, the first one given is compared with.
"""

import argparse
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from tools.bench.watching import Cost, run

TABLES = "elements.csv", "profiles.csv", "deformations.csv"
NO_LIMIT = 1024.0
"""GiB that no computer has: what is to be detected in one piece must not go over to tiles."""


def detect(cloud: Path, report: Path, gib: float) -> Cost:
    """Detect within a limit, or in one piece, in a process of its own."""
    command = [sys.executable, "-m", "pipecore", "detect", str(cloud), "-o", str(report)]
    return run([*command, "--tiling-memory-gib", str(gib or NO_LIMIT)])


def differing(report: Path, other: Path) -> list[str]:
    """Tables that are not the same, byte for byte."""
    return [n for n in TABLES if (report / n).read_bytes() != (other / n).read_bytes()]


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tools.bench.tiles", description=__doc__)
    parser.add_argument("cloud", type=Path, metavar="FILE")
    parser.add_argument("limits", type=float, nargs="+", metavar="GIB")
    parser.add_argument("--folder", type=Path, help="for the reports; default the system's")
    args = parser.parse_args()
    with TemporaryDirectory(dir=args.folder) as folder:
        reports: list[Path] = []
        for gib in args.limits:
            report = Path(folder) / f"report-{len(reports)}"
            cost = detect(args.cloud, report, gib)
            lines = (report / TABLES[0]).read_text(encoding="utf-8").count("\n") - 1
            differ = ", ".join(differing(report, reports[0])) if reports else "–"
            print(
                f"{f'{gib:g} GiB' if gib else 'one piece':10}  {cost.wall:7.1f} s  "
                f"{cost.cpu:7.1f} CPU s  {cost.memory / 2**30:6.2f} GiB  {lines} elements  "
                f"differ: {differ or 'none'}",
                flush=True,
            )
            for name, stage in cost.stages.items():
                print(
                    f"    {name:18} {stage.wall:7.1f} s  {stage.cpu:7.1f} CPU s  "
                    f"{stage.memory / 2**30:6.2f} GiB"
                )
            reports.append(report)
            for large in [*report.glob("*.laz"), *report.glob("*.json")]:
                large.unlink()


if __name__ == "__main__":
    main()
