"""Detect every scan of a folder: a report each, and one table of all deformations.

    python examples/batch_over_a_folder.py scans out/reports

A scan that cannot be read does not end the others. What was done before is not done again.
"""

import csv
import sys
from pathlib import Path

import pipecore

ENDINGS = {".las", ".laz", ".e57", ".ply", ".pcd", ".pts", ".xyz"}


def main(scans: str, reports: str) -> int:
    """Write the reports and ``deformations.csv``; return how many scans failed."""
    Path(reports).mkdir(parents=True, exist_ok=True)
    n_failed = 0
    rows: list[dict[str, object]] = []
    for scan in sorted(p for p in Path(scans).iterdir() if p.suffix.lower() in ENDINGS):
        folder = Path(reports) / scan.name
        try:
            result = saved_result(scan, folder)
        except pipecore.PipecoreError as error:
            print(f"{scan.name}: {error}", file=sys.stderr)
            n_failed += 1
            continue
        print(f"{scan.name}: {len(result.elements)} elements, {len(result.deformations)} found")
        rows += [{"scan": scan.name} | row for row in result.deformations_table().rows()]

    if rows:
        path = Path(reports) / "deformations.csv"
        with path.open("w", encoding="utf-8", newline="") as file:
            writer = csv.DictWriter(file, list(rows[0]))
            writer.writeheader()
            writer.writerows(rows)
    return n_failed


def saved_result(scan: Path, folder: Path) -> pipecore.Result:
    """The result of a scan: from its report if there is one, else detected and saved."""
    if folder.is_dir():
        return pipecore.load(folder)
    cloud = pipecore.read(scan)
    result = pipecore.detect(cloud)
    result.save(folder, cloud)
    return result


if __name__ == "__main__":
    sys.exit(1 if main(*sys.argv[1:]) else 0)
