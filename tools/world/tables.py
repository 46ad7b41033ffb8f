"""Tables of what was found in the second world."""

from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np

from tools.study.store import table

Row = dict[str, Any]
PROPERTIES = ("feature", "view", "pattern", "fault")
RANGES: dict[str, tuple[float, ...]] = {
    "radius": (0.0, 0.03, 0.06, 0.12, 0.25, 0.5, 3.1),
    "ovality": (0.0, 0.03, 0.06, 0.09, 0.12),
    "roughness": (0.0, 0.007, 0.014, 0.02),
    "depth": (0.0, 0.07, 0.13, 0.2),
    "bow": (0.0, 0.01, 0.02, 0.05),
    "angle_deg": (0.0, 30.0, 90.0, 200.0, 361.0),
}
HEAD = [
    "", "scenes", "elements", "recall", "precision", "kind", "radius", "ovality", "whole",
    "missed", "false", "doubled, m",
]  # fmt: skip


def summary(rows: Sequence[Row]) -> str:
    """Return the tables by family, property and clutter."""
    parts = ["### By family", "", _groups(rows, lambda r: r["family"])]
    for family in sorted({r["family"] for r in rows}):
        mine = [r for r in rows if r["family"] == family]
        for name in PROPERTIES:
            if family == "clutter" or not any(name in r["properties"] for r in mine):
                continue
            parts += ["", f"### {family}, by {name}", "", _groups(mine, _named(name))]
        if family == "lone":
            for name, edges in RANGES.items():
                drawn = [r for r in mine if name in r["properties"]]
                if drawn:
                    by = _binned(name, edges)
                    parts += ["", f"### {family}, by {name}", "", _groups(drawn, by)]
    kinds = [r for r in rows if r["family"] in ("piping", "lone")]
    if kinds:
        parts += ["", "### Elements by kind", "", _by_kind(kinds)]
    parts += ["", "### False elements", "", _false(rows)]
    parts += [f"\n{len(rows)} detections, {sum(r['seconds'] for r in rows):.0f} CPU seconds."]
    return "\n".join(parts)


def _named(name: str) -> Callable[[Row], str]:
    return lambda row: row["properties"].get(name, "–")


def _binned(name: str, edges: tuple[float, ...]) -> Callable[[Row], str]:
    def by(row: Row) -> str:
        value = row["properties"][name]
        k = int(np.clip(np.searchsorted(edges, value, side="right"), 1, len(edges) - 1))
        return f"{edges[k - 1]:g} to {edges[k]:g}"

    return by


def _share(flags: Iterable[bool]) -> str:
    values = list(flags)
    return f"{np.mean(values):.3f}" if values else "–"


def _ratio(part: float, whole: float) -> str:
    return f"{part / whole:.3f}" if whole else "–"


def _groups(rows: Sequence[Row], by: Callable[[Row], str]) -> str:
    groups: dict[str, list[Row]] = defaultdict(list)
    for row in rows:
        groups[str(by(row))].append(row)
    lines = [_line(name, groups[name]) for name in sorted(groups, key=_sort_key)]
    return table(HEAD, lines)


def _sort_key(name: str) -> tuple[float, str]:
    first = name.split(maxsplit=1)[0]
    return (float(first), name) if first.replace(".", "").isdigit() else (-1.0, name)


def _line(name: str, rows: Sequence[Row]) -> list[str]:
    elements = [e for r in rows for e in r["elements"]]
    pipes = [e for e in elements if not e["is_branched"]]
    total = {k: sum(r[k] for r in rows) for k in ("visible", "found", "reported", "real")}
    return [
        name,
        str(len(rows)),
        str(len(elements)),
        _ratio(total["found"], total["visible"]),
        _ratio(total["real"], total["reported"]),
        _share(e["is_kind_right"] for e in elements),
        _share(e["is_radius_right"] for e in elements),
        _share(e["is_ovality_right"] for e in elements if "is_ovality_right" in e),
        _share(e["is_whole"] for e in pipes),
        str(sum(not e["is_found"] for e in elements)),
        str(sum(len(r["false"]) for r in rows)),
        f"{sum(r['doubled'] for r in rows):.1f}",
    ]


def _by_kind(rows: Sequence[Row]) -> str:
    groups: dict[str, list[Row]] = defaultdict(list)
    for row in rows:
        for element in row["elements"]:
            groups[f"{row['family']}: {element['kind']}"].append(element)
    lines = []
    for name, elements in sorted(groups.items()):
        taken = Counter(
            e["found_kind"] for e in elements if e["is_found"] and not e["is_kind_right"]
        )
        lines.append([
            name, str(len(elements)), _share(e["is_found"] for e in elements),
            _share(e["is_kind_right"] for e in elements),
            _share(e["is_radius_right"] for e in elements),
            _share(e["is_whole"] for e in elements if not e["is_branched"]),
            ", ".join(f"{n} {k}" for k, n in taken.most_common()) or "–",
        ])  # fmt: skip
    return table(["", "elements", "found", "kind", "radius", "whole", "taken for"], lines)


def _false(rows: Sequence[Row]) -> str:
    """How often things were there, and how many elements were found on them."""
    found = Counter(name for r in rows for name in r["false"])
    there = Counter(name for r in rows for name in r["properties"].get("things", []))
    there["room"] = sum(r["family"] != "lone" for r in rows)
    names = sorted(set(found) | set(there), key=lambda n: (-found[n], n))
    lines = [[n, str(there[n]) if n in there else "–", str(found[n])] for n in names]
    return table(["", "times there", "false elements"], lines)
