"""How long a detection takes and what memory it needs: `python -m tests.bench [--points 1 4]`.

Whole processes, as a user starts them, on simulated plants side by side; nothing is asserted
about time. Writes `docs/performance.md`. The clouds are kept in out/bench. Not for Windows,
which does not tell what memory a process that has ended had needed.
"""

import argparse
import json
import os
import platform
import shutil
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

ROOT = Path(__file__).parents[2]
OUT = ROOT / "out" / "bench"
PAGE = ROOT / "docs" / "performance.md"
DEMO = ROOT / "resources" / "demo" / "demo.laz"

READ_WITH_LASPY = "import sys, laspy; laspy.read(sys.argv[1]).xyz"
KIBIBYTES = 1 if sys.platform == "darwin" else 1024
"""Unit of ru_maxrss in bytes."""


@dataclass(frozen=True)
class Cost:
    """What a process took: seconds of wall and of all cores, and bytes."""

    wall: float
    cpu: float
    memory: int


def run(command: Sequence[str], **environment: str) -> Cost:
    """Run a process to its end and return what it took; it has to end well.

    Linux counts what this process itself had needed as the other's from its start, so this
    one imports nothing that is large.
    """
    begin = time.perf_counter()
    pid = os.posix_spawn(command[0], command, os.environ | environment)
    _, status, usage = os.wait4(pid, 0)
    wall = time.perf_counter() - begin
    if os.waitstatus_to_exitcode(status) != 0:
        raise SystemExit(f"This failed: {' '.join(command)}")
    return Cost(wall, usage.ru_utime + usage.ru_stime, usage.ru_maxrss * KIBIBYTES)


def detect(
    cloud: Path, report: Path, threads: int, **environment: str
) -> tuple[Cost, dict[str, Any]]:
    """Detect in a process of its own; what it took, and what it wrote as result.json."""
    shutil.rmtree(report, ignore_errors=True)
    command = [sys.executable, "-m", "pipecore", "detect", str(cloud), "-o", str(report)]
    cost = run([*command, "--quiet", "--threads", str(threads)], **environment)
    result: dict[str, Any] = json.loads((report / "result.json").read_text(encoding="utf-8"))
    return cost, result


def compiling_seconds(threads: int) -> float:
    """How much longer the first detection takes, which compiles the kernels."""
    report = OUT / "report-demo"
    with TemporaryDirectory() as empty:
        first, _ = detect(DEMO, report, threads, NUMBA_CACHE_DIR=empty)
        later, _ = detect(DEMO, report, threads, NUMBA_CACHE_DIR=empty)
    # The usual cache is filled too before anything is measured.
    detect(DEMO, report, threads)
    return first.wall - later.wall


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.bench", description=__doc__)
    parser.add_argument(
        "--points", type=float, nargs="+", default=[1, 4], metavar="MILLION", help="default 1 4"
    )
    parser.add_argument("--threads", type=int, default=os.cpu_count() or 1)
    args = parser.parse_args()
    OUT.mkdir(parents=True, exist_ok=True)
    compiling = compiling_seconds(args.threads)
    whole, stages, names = [], [], []
    for million in args.points:
        cloud = OUT / f"plants-{million:g}.laz"
        if not cloud.exists():
            run([sys.executable, "-m", "tests.bench.clouds", str(cloud), str(million)])
        reading = run([sys.executable, "-c", READ_WITH_LASPY, str(cloud)])
        cost, result = detect(cloud, OUT / f"report-{million:g}", args.threads)
        n_million = result["n_cloud_points"] / 1e6
        seconds = result["seconds"]
        names = list(seconds)
        whole.append(
            f"| {n_million:.2f} | {len(result['elements'])} | {cost.wall:.1f} | {cost.cpu:.1f} "
            f"| {cost.wall / n_million:.1f} | {cost.memory / 1e9:.2f} | {reading.wall:.1f} "
            f"| {reading.memory / 1e9:.2f} | {cost.wall / reading.wall:.1f} |"
        )
        rest = cost.wall - sum(seconds.values())
        cells = " | ".join(f"{s:.1f}" for s in [*seconds.values(), rest])
        stages.append(f"| {n_million:.2f} | {cells} |")
        print(whole[-1], stages[-1], sep="\n", flush=True)
    PAGE.write_text(
        _page(args.points, args.threads, compiling, whole, stages, names), encoding="utf-8"
    )


def _page(
    points: list[float],
    threads: int,
    compiling: float,
    whole: list[str],
    stages: list[str],
    names: list[str],
) -> str:
    sizes = " ".join(f"{p:g}" for p in points)
    return f"""# How fast PipeGUI is, and what memory it needs

Measured by `python -m tests.bench --points {sizes} --threads {threads}` on {_machine()}.

Each line is one whole process, `pipecore detect` on a LAZ file with the default settings, from
its start to the written report. The kernels had been compiled before: the first detection on
a machine takes {compiling:.0f} s longer. The clouds are random simulated plants side by side
(seeds from 1000, 4 stations, 1 cm spacing, 2 mm noise). laspy beside it only reads the same
file's coordinates, in a process of its own.

| million points | elements | seconds | CPU seconds | seconds a million | peak GB | laspy: seconds \
| laspy: peak GB | times laspy |
| --: | --: | --: | --: | --: | --: | --: | --: | --: |
{chr(10).join(whole)}

Seconds by stage; the last column is all the rest, which is starting, reading and the report:

| million points | {" | ".join(names)} | rest |
| --: {"| --: " * (len(names) + 1)}|
{chr(10).join(stages)}
"""


def _machine() -> str:
    n_cores = os.cpu_count()
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 1e9
    libraries = ", ".join(f"{name} {version(name)}" for name in ("numpy", "numba", "laspy"))
    return (
        f"{n_cores} cores ({platform.machine()}) with {memory:.0f} GB of memory, "
        f"{platform.system()}, load average {os.getloadavg()[0]:.1f} at the end, "
        f"Python {platform.python_version()}, {libraries}"
    )


if __name__ == "__main__":
    main()
