"""How long a detection takes and what memory it needs: `python -m tools.bench [--points 1 4]`.

Whole processes, as a user starts them, on simulated plants side by side; nothing is asserted
about time. Writes `docs/performance.md`. The clouds are kept in out/bench. Not for Windows,
which does not tell what memory a process that has ended had needed.
"""

import argparse
import json
import os
import pickle
import shutil
import sys
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from tools.bench import page
from tools.bench.page import Line, PeerLine
from tools.bench.peers import PEERS, NotThereError
from tools.bench.watching import Cost, run

ROOT = Path(__file__).parents[2]
OUT = ROOT / "out" / "bench"
DEMO = ROOT / "resources" / "demo" / "demo.laz"

KEPT = OUT / "lines.pickle"
"""What has been measured: lines, those of other programs and the size of their cloud; read
again by `--add`."""

Kept = tuple[dict[tuple[int, int], Line], list[PeerLine], float]

READ_WITH_LASPY = "import sys, laspy; laspy.read(sys.argv[1]).xyz"


def detect(
    cloud: Path, report: Path, threads: int, **environment: str
) -> tuple[Cost, dict[str, Any]]:
    """Detect in a process of its own; what it took, and what it wrote as result.json."""
    shutil.rmtree(report, ignore_errors=True)
    command = [sys.executable, "-m", "pipecore", "detect", str(cloud), "-o", str(report)]
    cost = run([*command, "--threads", str(threads)], **environment)
    result: dict[str, Any] = json.loads((report / "result.json").read_text(encoding="utf-8"))
    return cost, result


def compiling_seconds(threads: int) -> float:
    """How many CPU seconds more the first detection takes, which compiles the kernels."""
    report = OUT / "report-demo"
    with TemporaryDirectory() as empty:
        first, _ = detect(DEMO, report, threads, NUMBA_CACHE_DIR=empty)
        later, _ = detect(DEMO, report, threads, NUMBA_CACHE_DIR=empty)
    # The usual cache is filled too before anything is measured.
    detect(DEMO, report, threads)
    return first.cpu - later.cpu


def cloud_of(million: float) -> Path:
    """Return the file of so many million points; it is made if it is not there."""
    cloud = OUT / f"plants-{million:g}.las"
    if not cloud.exists():
        part = cloud.with_suffix(".part.las")
        run([sys.executable, "-m", "tools.bench.clouds", str(part), str(million)])
        part.rename(cloud)
    return cloud


def measure(points: Sequence[float], threads: Sequence[int], kept: Kept) -> None:
    """Measure detections of all sizes and numbers of threads, with laspy beside each."""
    lines = kept[0]
    for million in points:
        cloud = cloud_of(million)
        for n_threads in threads:
            # Before and after, and the faster counts: the machine has other things to do.
            first = run([sys.executable, "-c", READ_WITH_LASPY, str(cloud)])
            cost, result = detect(cloud, OUT / f"report-{million:g}", n_threads)
            second = run([sys.executable, "-c", READ_WITH_LASPY, str(cloud)])
            reading = min(first, second, key=lambda c: c.wall)
            n_elements = len(result["elements"])
            line = Line(result["n_cloud_points"], n_threads, n_elements, cost, reading)
            lines[line.n_points, n_threads] = line
            KEPT.write_bytes(pickle.dumps(kept))
            print(page.row_of(line), flush=True)


def measure_peers(million: float) -> list[PeerLine]:
    """Measure the other programs on one cloud."""
    cloud = cloud_of(million)
    lines = []
    for name, peer in PEERS.items():
        try:
            lines.append(PeerLine(name, peer(cloud, OUT)))
        except NotThereError as missing:
            lines.append(PeerLine(name, None, str(missing)))
        print(page.peer_row_of(lines[-1]), flush=True)
    return lines


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tools.bench", description=__doc__)
    parser.add_argument(
        "--points", type=float, nargs="+", default=[1, 4, 16, 44], metavar="MILLION",
        help="default 1 4 16 44",
    )  # fmt: skip
    parser.add_argument("--threads", type=int, nargs="+", default=[1, os.cpu_count() or 1])
    parser.add_argument(
        "--peers", type=float, default=4.0, metavar="MILLION",
        help="points of the cloud given to other programs, 0 for none; default 4",
    )  # fmt: skip
    parser.add_argument(
        "--add", action="store_true",
        help="keep what former runs have measured of other sizes: large ones take their time",
    )  # fmt: skip
    args = parser.parse_args()
    OUT.mkdir(parents=True, exist_ok=True)
    compiling = compiling_seconds(max(args.threads))
    kept: Kept = {}, [], 0.0
    if args.add and KEPT.exists():
        kept = pickle.loads(KEPT.read_bytes())  # our own file
    if args.peers:
        kept = kept[0], measure_peers(args.peers), args.peers
    measure(args.points, sorted(set(args.threads)), kept)
    lines, peers, million = kept
    page.write([lines[key] for key in sorted(lines)], peers, million, compiling, sys.argv[1:])


if __name__ == "__main__":
    main()
