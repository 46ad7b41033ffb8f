"""The page docs/performance.md."""

import math
import os
import platform
import re
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

from tools.bench.watching import Cost, Stage

PAGE = Path(__file__).parents[2] / "docs" / "performance.md"
REPORT = ("writing profiles", "writing result", "drawing figures", "writing", "end")
"""What belongs to the report."""
WITH_PROFILES = ("profiles", "segments", "ellipses", "axes")
WHOLE_COLUMNS = (
    "million points", "threads", "elements", "seconds", "CPU seconds", "CPU s a million", "peak GB",
    "laspy: seconds", "laspy: CPU seconds", "laspy: peak GB", "times laspy", "times laspy, CPU",
)  # fmt: skip


@dataclass(frozen=True)
class Line:
    """A detection, and laspy's reading of the same file."""

    n_points: int
    threads: int
    n_elements: int
    cost: Cost
    reading: Cost


@dataclass(frozen=True)
class PeerLine:
    """Another program on the same cloud; without a cost it is `missing` something."""

    name: str
    cost: Cost | None
    missing: str = ""


def row_of(line: Line) -> str:
    """Return a row of the table of whole processes."""
    million = line.n_points / 1e6
    cost, reading = line.cost, line.reading
    return (
        f"| {million:.2f} | {line.threads} | {line.n_elements} | {cost.wall:.1f} | {cost.cpu:.1f} "
        f"| {cost.cpu / million:.2f} | {cost.memory / 1e9:.2f} | {reading.wall:.2f} "
        f"| {reading.cpu:.2f} | {reading.memory / 1e9:.2f} | {cost.wall / reading.wall:.1f} "
        f"| {cost.cpu / reading.cpu:.1f} |"
    )


def peer_row_of(line: PeerLine) -> str:
    """Return a row of the table of other programs."""
    if line.cost is None:
        return f"| {line.name} | not measured: {line.missing} is not here | | |"
    c = line.cost
    return f"| {line.name} | {c.wall:.1f} | {c.cpu:.1f} | {c.memory / 1e9:.2f} |"


def write(
    lines: Sequence[Line],
    peers: Sequence[PeerLine],
    peers_million: float,
    compiling: float,
    arguments: Sequence[str],
) -> None:
    """Write the page."""
    text = f"""# How fast PipeGUI is, and what memory it needs

Measured by `{" ".join(["python -m tools.bench", *arguments])}` on {machine()}.

Each line is one whole process, `pipecore detect` on a LAS file with the default settings, from
its start to the written report. The kernels had been compiled before: the first detection on
a machine takes {compiling:.0f} CPU seconds longer. The clouds are simulated plants side by side
(`tools/bench/clouds.py`: six different ones of about 3 million points, then the same turned; 4
stations, 1 cm spacing, 2 mm noise). laspy beside it only reads the same file's coordinates, in a
process of its own, before and after; the faster one counts. CPU seconds are of all cores
together; they tell more than wall seconds where the machine had other work.

{_table(WHOLE_COLUMNS, [row_of(line) for line in lines])}

{_growth(lines)}

## By stage

CPU seconds, and the highest memory in GB while the stage ran, by the stages that the command
tells of. *Profiles* holds the cutting of stacks, the joining of segments, the ellipses and the
axes; *report* the tables, figures and the cloud with its segments.

{_stages(lines)}
"""
    if peers:
        ours = [line for line in lines if line.n_points == round(peers_million * 1e6)]
        rows = [
            f"| **PipeGUI**: everything, {line.threads} thread{'s' * (line.threads > 1)} "
            f"| {line.cost.wall:.1f} | {line.cost.cpu:.1f} | {line.cost.memory / 1e9:.2f} |"
            for line in ours
        ]
        text += f"""
## Beside other programs

On the cloud of {peers_million:g} million points, with their files made before and not counted, with
as many threads as each takes of itself. None of them measures deformations.

{
            _table(
                ("program", "seconds", "CPU seconds", "peak GB"),
                [*rows, *map(peer_row_of, peers)],
                left=1,
            )
        }
"""
    PAGE.write_text(f"{text}\n{_other_parts()}", encoding="utf-8")


def _other_parts() -> str:
    """What other benches have written into the page, between their marks."""
    old = PAGE.read_text(encoding="utf-8") if PAGE.exists() else ""
    marked = re.findall(r"<!-- (\w+): begin -->.*?<!-- \1: end -->\n?", old, re.DOTALL)
    return "\n".join(
        old[old.index(f"<!-- {name}: begin -->") : old.index(end) + len(end) + 1]
        for name in marked
        for end in [f"<!-- {name}: end -->"]
    )


def _growth(lines: Sequence[Line]) -> str:
    """Say how the cost grows, against N log N."""
    threads = max((line.threads for line in lines), default=0)
    by_size = [line for line in lines if line.threads == threads]
    if len(by_size) < 2:
        return ""
    a, b = by_size[0], by_size[-1]
    cost = b.cost.cpu / a.cost.cpu
    size = b.n_points / a.n_points
    n_log_n = size * math.log(b.n_points) / math.log(a.n_points)
    return (
        f"From {a.n_points / 1e6:g} to {b.n_points / 1e6:g} million points ({size:.0f} times as "
        f"many) the CPU seconds grow {cost:.1f} times; N log N grows {n_log_n:.1f} times."
    )


def _stages(lines: Sequence[Line]) -> str:
    columns = ["start", "reading", "thinning", "normals", "directions", "profiles", "elements"]
    columns += ["deformations", "report"]
    rows = []
    columns += sorted({s for line in lines for s in line.cost.stages if _column(s) not in columns})
    for line in lines:
        merged: dict[str, Stage] = {}
        for name, stage in line.cost.stages.items():
            key = _column(name)
            old = merged.get(key, Stage(0.0, 0.0, 0))
            merged[key] = Stage(
                old.wall + stage.wall, old.cpu + stage.cpu, max(old.memory, stage.memory)
            )
        cells = [
            f"{merged[c].cpu:.1f}, {merged[c].memory / 1e9:.1f}" if c in merged else ""
            for c in columns
        ]
        rows.append(f"| {line.n_points / 1e6:.2f} | {line.threads} | {' | '.join(cells)} |")
    return _table(("million points", "threads", *columns), rows)


def _column(stage: str) -> str:
    """Return the column of a stage."""
    return "report" if stage in REPORT else "profiles" if stage in WITH_PROFILES else stage


def _table(columns: Sequence[str], rows: Sequence[str], left: int = 0) -> str:
    head = f"| {' | '.join(columns)} |"
    rule = "| " + " | ".join(["---"] * left + ["--:"] * (len(columns) - left)) + " |"
    return "\n".join([head, rule, *rows])


def machine() -> str:
    """Describe this machine."""
    n_cores = os.cpu_count()
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 1e9
    libraries = ", ".join(f"{name} {version(name)}" for name in ("numpy", "numba", "laspy"))
    return (
        f"{n_cores} cores ({platform.machine()}) with {memory:.0f} GB of memory, "
        f"{platform.system()}, load average {os.getloadavg()[0]:.1f} at the end (this bench alone "
        f"makes about {n_cores}), Python {platform.python_version()}, {libraries}"
    )
