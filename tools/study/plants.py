"""Whole detections of random plants against their truth."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from pipecore import detect
from pipecore.simulate import random_scene, scan
from pipecore.simulate.scoring import score
from tools.study.store import measured, table

Rows = list[dict[str, Any]]


@dataclass(frozen=True)
class Target:
    """A figure that issue 3 asks for, and how it is read from the plants."""

    name: str
    of: Callable[[Rows], float]
    worst: Callable[[Rows], float]
    wanted: float
    is_floor: bool
    unit: str = ""


def write(stations: int, first_seed: int, n: int) -> str:
    """Measure and return the section's text."""
    seeds = range(first_seed, first_seed + n)
    rows = [
        measured(f"plant-{stations}-{s}", lambda s=s: measure_plant(s, stations)) for s in seeds
    ]
    limits = TARGETS[stations]
    summary = table(
        ["", "median of plants", "worst plant", "wanted (median)", ""],
        [_line(t, rows) for t in limits],
    )
    radius = np.abs([e for r in rows for e in r["radius_errors"]])
    scores = radius / [s for r in rows for s in r["radius_sds"]]
    one_sd, two_sd = 100 * (scores < 1).mean(), 100 * (scores < 2).mean()
    off = 1e3 * np.quantile(radius, [0.5, 0.95, 1.0])
    per_plant = table(
        ["seed", "recall", "precision", "kinds", "radius, mm", "worst, mm", "axis, mm",
         "bend radius, %", "false, m", "million points", "s"],
        [_plant_line(r) for r in rows],
    )  # fmt: skip
    kinds = "; ".join(_kinds(rows))
    few = f" These are few: at least {ENOUGH} are wanted." if n < ENOUGH else ""
    return f"""
{n} random plants, seeds {seeds[0]} to {seeds[-1]}, {stations} station{"s" * (stations > 1)},
2 mm noise, 1 cm spacing.{few}

{summary}

Radii of all {len(radius)} elements of the right kind together: median error {off[0]:.2f} mm,
95 % within {off[1]:.2f} mm, worst {off[2]:.1f} mm (wanted: {WORST_RADIUS}). The reported standard
deviation of the radius holds {one_sd:.0f} % of the errors within one (wanted: 60–76 %) and
{two_sd:.0f} % within two (wanted: at least 90 %).

Kinds found right, of those that are visible: {kinds}.

{per_plant}
"""


def measure_plant(seed: int, stations: int) -> dict[str, Any]:
    """Figures of one plant, as plain numbers."""
    scanned = scan(random_scene(seed, stations=stations))
    begin = time.perf_counter()
    result = detect(scanned.cloud)
    seconds = time.perf_counter() - begin
    s = score(result, scanned.truth)
    return {
        "seed": seed,
        "n_points": len(scanned.cloud),
        "seconds": seconds,
        "recall": s.recall,
        "precision": s.precision,
        "visible_length": s.visible_length,
        "reported_length": s.reported_length,
        "kinds": s.kind_share(),
        "kinds_right": s.kinds_right,
        "kinds_judged": s.kinds_judged,
        "radius_errors": list(s.radius_errors.values()),
        "radius_sds": list(s.radius_sds.values()),
        "axis_error": s.median_axis_error,
        "bend_errors": list(s.bend_radius_errors.values()),
    }


def _median_of(key: str) -> Callable[[Rows], float]:
    return lambda rows: float(np.nanmedian([r[key] for r in rows]))


def _radius(row: dict[str, Any]) -> float:
    return 1e3 * float(np.median(np.abs(row["radius_errors"]))) if row["radius_errors"] else np.nan


def _bends(row: dict[str, Any]) -> list[float]:
    return [100 * abs(e) for e in row["bend_errors"]]


def _all_bends(rows: Rows) -> list[float]:
    return [e for r in rows for e in _bends(r)] or [np.nan]


def _targets(recall: float, radius: float) -> list[Target]:
    return [
        Target("recall", _median_of("recall"), lambda rows: min(r["recall"] for r in rows),
               recall, True),
        Target("precision", _median_of("precision"),
               lambda rows: min(r["precision"] for r in rows), 0.99, True),
        Target("kinds right", _median_of("kinds"), lambda rows: min(r["kinds"] for r in rows),
               0.95, True),
        Target("radius error", lambda rows: float(np.nanmedian([_radius(r) for r in rows])),
               lambda rows: float(np.nanmax([_radius(r) for r in rows])), radius, False, "mm"),
        Target("axis error", lambda rows: 1e3 * _median_of("axis_error")(rows),
               lambda rows: 1e3 * float(np.nanmax([r["axis_error"] for r in rows])),
               0.25, False, "mm"),
        Target("bend radius error", lambda rows: float(np.median(_all_bends(rows))),
               lambda rows: float(np.max(_all_bends(rows))), 2.0, False, "%"),
    ]  # fmt: skip


TARGETS = {4: _targets(0.98, 0.1), 1: _targets(0.97, 0.15)}
WORST_RADIUS = "2 mm"
ENOUGH = 20


def _line(target: Target, rows: Rows) -> list[str]:
    value = target.of(rows)
    reached = value >= target.wanted if target.is_floor else value <= target.wanted
    digits = ".3f" if target.is_floor else ".2f"
    sign = "≥" if target.is_floor else "≤"
    return [
        target.name,
        f"{value:{digits}} {target.unit}",
        f"{target.worst(rows):{digits}} {target.unit}",
        f"{sign} {target.wanted:g} {target.unit}",
        "reached" if reached else "**falls short**",
    ]


def _plant_line(row: dict[str, Any]) -> list[str]:
    worst = 1e3 * max(map(abs, row["radius_errors"]), default=np.nan)
    false = (1 - row["precision"]) * row["reported_length"]
    bends = _bends(row)
    return [
        f"{row['seed']}",
        f"{row['recall']:.3f}",
        f"{row['precision']:.3f}",
        f"{row['kinds']:.2f}",
        f"{_radius(row):.2f}",
        f"{worst:.1f}",
        f"{1e3 * row['axis_error']:.2f}",
        f"{np.median(bends):.1f}" if bends else "–",
        f"{false:.2f}",
        f"{row['n_points'] / 1e6:.2f}",
        f"{row['seconds']:.0f}",
    ]


def _kinds(rows: Rows) -> list[str]:
    names = sorted({k for r in rows for k in r["kinds_judged"]})
    return [
        f"{k} {sum(r['kinds_right'].get(k, 0) for r in rows)} of "
        f"{sum(r['kinds_judged'].get(k, 0) for r in rows)}"
        for k in names
    ]
