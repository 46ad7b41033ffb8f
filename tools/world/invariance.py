"""What is found again when a cloud is shifted, turned, mirrored, shuffled or in feet."""

import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from pipecore import Settings, detect, read
from pipecore.io.writing import write_laz
from pipecore.settings import LengthUnit
from pipecore.simulate import random_scene, scan
from pipecore.types import PointCloud
from tests.conftest import SHARED_DATA
from tools.study.store import table
from tools.world.running import Job

Array = NDArray[np.float64]
Row = dict[str, Any]
SHARED = {
    "pump": "pump_visual_ref.e57",
    "maple": "real/maple_tree.txt",
    "buttress": "real/buttressed_tree.txt",
    "pines": "real/pine_stand.laz",
}
MAX_SHIFT = 0.5
RADIUS_RATIO, OVERLAP, SIDEWAYS = 0.02, 0.8, 0.25
"""Two elements are one if they are of one kind, their radii differ by less than a ratio, and
each covers this share of the other's axis, no further from it than this share of the radius."""
N_SAMPLES = 41
DENT_DISTANCE, DENT_DEPTH = 0.5, 0.25
"""In radii, and as a ratio of depths."""


def cloud_named(name: str) -> PointCloud:
    """Return a cloud: a key of `SHARED`, "plant:SEED" or "FAMILY:SEED" of the second world."""
    if name in SHARED:
        return read(SHARED_DATA / SHARED[name])
    kind, _, seed = name.partition(":")
    if kind == "plant":
        return scan(random_scene(int(seed), stations=2)).cloud
    from tools.world import scene

    return scene(int(seed), kind).cloud


def changes(n: int) -> list[str]:
    """Return the names of the changes of a cloud: "as it is" is the first."""
    numbered = [f"{what} {k}" for what in ("shift", "turn") for k in range(1, n + 1)]
    return ["as it is", *numbered, "mirror", "shuffle", "feet"]


def jobs(clouds: Sequence[str], n: int) -> list[Job]:
    """Return the detections of clouds under `n` shifts, `n` turns and the other changes."""
    return [
        (
            f"invariance-{cloud}-{change}".replace(":", "-").replace(" ", "-"),
            measure,
            (cloud, change),
        )
        for cloud in clouds
        for change in changes(n)
    ]


def measure(cloud_name: str, change: str) -> Row:
    """Detect in a changed cloud; return what was found in the frame of the unchanged one."""
    cloud = cloud_named(cloud_name)
    matrix, shift = _motion(change)
    world = cloud.world(cloud.xyz)
    centre = world.mean(axis=0)
    moved = (world - centre) @ matrix.T + centre + shift
    stations = (cloud.stations + cloud.origin - centre) @ matrix.T + centre + shift - cloud.origin
    # Colours and classes are no part of it.
    changed = PointCloud(
        cloud.origin,
        np.ascontiguousarray(moved - cloud.origin, cloud.xyz.dtype),
        stations=stations,
    )
    settings = Settings()
    if change == "shuffle":
        order = np.random.default_rng(1).permutation(len(cloud))
        changed = replace(changed, xyz=np.ascontiguousarray(changed.xyz[order]))
    if change == "feet":
        settings = settings.replace({"input.length_unit": "ft"})
        changed = _through_feet(changed)
    result = detect(changed, settings)

    def back(points: Array) -> list[list[float]]:
        at_home = (points + result.origin - centre - shift) @ matrix + centre
        return np.round(at_home, 6).tolist()

    return {
        "cloud": cloud_name,
        "change": change,
        "elements": [
            {
                "kind": str(e.kind),
                "radius": e.radius,
                "axis": back(e.axis.at(np.linspace(0, e.axis.length, N_SAMPLES))),
            }
            for e in result.elements
        ],
        "deformations": [
            {
                "kind": str(d.kind),
                "depth": d.depth,
                "radius": result.element(d.element_id).radius,
                "peak": back(d.peak[None])[0],
            }
            for d in result.deformations
        ],
    }


def _motion(change: str) -> tuple[Array, Array]:
    """Rotation or reflection, and shift."""
    what, _, k = change.partition(" ")
    rng = np.random.default_rng([len(what), int(k) if k.isdigit() else 0])
    if what == "shift":
        return np.eye(3), rng.uniform(-MAX_SHIFT, MAX_SHIFT, 3)
    if what == "turn":
        return Rotation.random(random_state=int(rng.integers(1 << 31))).as_matrix(), np.zeros(3)
    return np.diag([-1.0, 1.0, 1.0] if what == "mirror" else [1.0, 1.0, 1.0]), np.zeros(3)


def _through_feet(cloud: PointCloud) -> PointCloud:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "feet.laz"
        write_laz(path, cloud, length_unit=LengthUnit.FOOT)
        return replace(read(path, length_unit=LengthUnit.FOOT), stations=cloud.stations)


def is_same_element(one: Row, other: Row) -> bool:
    """Whether two elements agree in kind, radius and where they are."""
    if one["kind"] != other["kind"]:
        return False
    if abs(other["radius"] / one["radius"] - 1) > RADIUS_RATIO:
        return False
    a, b = np.array(one["axis"]), np.array(other["axis"])
    near = SIDEWAYS * max(one["radius"], other["radius"])
    return _covered(a, b, near) >= OVERLAP and _covered(b, a, near) >= OVERLAP


def _covered(points: Array, line: Array, near: float) -> float:
    """Share of points that lie by a polyline, not beyond its ends."""
    start, step = line[:-1], np.diff(line, axis=0)
    along = np.einsum("pij,ij->pi", points[:, None] - start, step)
    t = np.clip(along / np.maximum((step**2).sum(axis=1), 1e-18), 0, 1)
    foot = start + t[..., None] * step
    return float((np.linalg.norm(points[:, None] - foot, axis=2).min(axis=1) <= near).mean())


def is_same_deformation(one: Row, other: Row) -> bool:
    """Whether two deformations agree in kind, place and depth."""
    off = np.linalg.norm(np.subtract(one["peak"], other["peak"]))
    is_near = off <= DENT_DISTANCE * one["radius"] or one["kind"] in ("bow", "ovality")
    is_deep = abs(other["depth"] / one["depth"] - 1) <= DENT_DEPTH if one["depth"] else True
    return one["kind"] == other["kind"] and bool(is_near) and is_deep


def again(before: Sequence[Row], after: Sequence[Row], same: Any) -> int:
    """Return how many of `before` have a partner in `after`; each stands for one only."""
    left, n = list(after), 0
    for one in before:
        partner = next((k for k, other in enumerate(left) if same(one, other)), None)
        if partner is not None:
            left.pop(partner)
            n += 1
    return n


def summary(rows: Sequence[Row]) -> str:
    """Return a table of the shares found again and of what is new, by cloud and change."""
    lines = []
    for cloud in dict.fromkeys(r["cloud"] for r in rows):
        mine = [r for r in rows if r["cloud"] == cloud]
        base = mine[0]
        for what in ("shift", "turn", "mirror", "shuffle", "feet"):
            group = [r for r in mine[1:] if r["change"].split()[0] == what]
            if group:
                lines.append([cloud, what, *_counts(base, group)])
    head = ["cloud", "change", "elements", "found again", "worst", "new", "deformations", "again"]
    return table(head, lines)


def _counts(base: Row, group: Sequence[Row]) -> list[str]:
    n = len(base["elements"])
    found = [again(base["elements"], r["elements"], is_same_element) for r in group]
    new = [len(r["elements"]) - f for r, f in zip(group, found, strict=True)]
    m = len(base["deformations"])
    dents = [again(base["deformations"], r["deformations"], is_same_deformation) for r in group]
    return [
        str(n),
        f"{np.mean(found) / n:.3f}" if n else "–",
        f"{min(found) / n:.3f}" if n else "–",
        f"{np.mean(new) / n:.3f}" if n else f"{np.mean(new):.1f}",
        str(m),
        f"{np.mean(dents) / m:.3f}" if m else "–",
    ]
