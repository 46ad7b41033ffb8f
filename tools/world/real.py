"""The scans of shared/data: what is known of them, and what is found."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pipecore import Settings, detect, read
from pipecore.settings import LengthUnit
from pipecore.types import ElementKind
from tools.study.store import table
from tools.world.running import Job

Row = dict[str, Any]
LONG_KINDS = (ElementKind.CYLINDER, ElementKind.CONE)


@dataclass(frozen=True)
class Known:
    """Pipes of a scan: their name, how many, and bounds of their radius in metres."""

    name: str
    count: int
    smallest: float
    largest: float


@dataclass(frozen=True)
class RealScan:
    """A file with what is known of it; `is_complete` if nothing else may be found there."""

    path: str
    known: tuple[Known, ...]
    is_complete: bool = True
    unit: LengthUnit = LengthUnit.METRE


SCANS = {
    "pump": RealScan(
        "pump_visual_ref.e57",
        (
            Known("risers", 2, 0.084, 0.092),
            Known("header", 1, 0.110, 0.120),
            Known("casings", 2, 0.360, 0.390),
        ),
        is_complete=False,
    ),
    "mug": RealScan("real/mug_noplane.pcd", (Known("mug", 1, 0.039, 0.042),)),
    "maple": RealScan("real/maple_tree.txt", (Known("trunk", 1, 0.364, 0.424),), False),
    "buttress": RealScan("real/buttressed_tree.txt", (Known("bole", 1, 0.1, 1.5),), False),
    "pines": RealScan("real/pine_stand.laz", (Known("stems", 9, 0.08, 0.15),), False),
    "box1": RealScan("real/box1.ply", ()),
    "box5": RealScan("real/box5.ply", ()),
    "table top": RealScan("real/table_top.pcd", ()),
    "pipe": RealScan(
        "real/pipe_mm.txt", (Known("pipe", 1, 0.0544, 0.0555),), unit=LengthUnit.MILLIMETRE
    ),
}
"""Radii of natural things are by eye and by robust refits, and wide for that."""


def jobs(folder: Path, names: Sequence[str]) -> list[Job]:
    """Return the detections of scans by their names."""
    return [(f"real-{name.replace(' ', '-')}", measure, (str(folder), name)) for name in names]


def measure(folder: str, name: str) -> Row:
    """Detect in one scan."""
    scan = SCANS[name]
    cloud = read(Path(folder) / scan.path, length_unit=scan.unit)
    result = detect(cloud, Settings().replace({"input.length_unit": scan.unit}))
    return {
        "name": name,
        "n_points": len(cloud),
        "elements": [
            {"kind": str(e.kind), "radius": e.radius, "length": e.axis.length, "arc": e.arc}
            for e in result.elements
        ],
        "deformations": [str(d.kind) for d in result.deformations],
    }


def summary(rows: Sequence[Row]) -> str:
    """Return a table of what is known and what was found of it."""
    lines = []
    for row in rows:
        scan = SCANS[row["name"]]
        long = [e for e in row["elements"] if e["kind"] in LONG_KINDS and e["length"] > e["radius"]]
        of_known = [[e for e in long if k.smallest <= e["radius"] <= k.largest] for k in scan.known]
        found = ", ".join(
            f"{k.name} {len(es)} for {k.count}" for k, es in zip(scan.known, of_known, strict=True)
        )
        radii = "; ".join(
            ", ".join(f"{1e3 * e['radius']:.1f}" for e in es[:12]) for es in of_known if es
        )
        kinds = Counter(e["kind"] for e in row["elements"])
        n_known = sum(k.count for k in scan.known)
        false = str(max(len(row["elements"]) - n_known, 0)) if scan.is_complete else "–"
        counted = ", ".join(f"{n} {k}" for k, n in kinds.most_common()) or "none"
        deformed = Counter(row["deformations"])
        lines.append([
            row["name"], found or "no pipe", radii or "–", counted, false,
            ", ".join(f"{n} {k}" for k, n in deformed.most_common()) or "–",
        ])  # fmt: skip
    head = [
        "scan", "known, found for how many", "their radii, mm", "elements", "false", "deformations",
    ]  # fmt: skip
    return table(head, lines)
