"""Lone pipes in series: ovality by size and noise (issue 15), and the worst damage (issue 16)."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pipecore import detect
from pipecore.types import DeformationKind, ElementKind, Result
from tools.study.store import table
from tools.world.assembly import Assembly, Role, Run
from tools.world.judging import judge
from tools.world.noise import Noise
from tools.world.pipes import bowed
from tools.world.running import Job
from tools.world.scenes import WorldScene, scanned
from tools.world.shapes import Crumple, Dent, Oval, Shape
from tools.world.surfaces import Array, across, random_direction
from tools.world.tubes import Arc, Line
from tools.world.viewing import Pattern, View

Row = dict[str, Any]
Rng = np.random.Generator

RADII = (0.0302, 0.0572, 0.1095, 0.2032, 0.3048, 0.457, 1.0, 3.0)
"""DN 50, 100, 200, 400, 600 and 900, and two vessels, metres."""
OVALITIES = (0.0, 0.02, 0.04, 0.06, 0.08, 0.1, 0.12)
NOISES = (0.0003, 0.001, 0.003)
ALL_ROUND = np.empty((0, 3))


def ovality_jobs() -> list[Job]:
    """Return a detection for each cell of the table."""
    return [
        (f"oval-{1e3 * r:.0f}-{100 * o:.0f}-{1e3 * n:g}", measure_oval, (r, o, n))
        for r in RADII
        for o in OVALITIES
        for n in NOISES
    ]


def measure_oval(radius: float, ovality: float, noise: float) -> Row:
    """Detect one pipe all round, with points every 0.05 r, between 3 and 20 mm.

    With fewer points a section's shape is taken for noise, and gates of noise say nothing.
    """
    rng = np.random.default_rng([int(1e4 * radius), int(1e3 * ovality), int(1e5 * noise)])
    length = radius * (10.0 if radius < 0.5 else 3.0)
    shape = Oval(radius, ovality, 0.2, rng.uniform(0, np.pi), 0.02 / radius)
    assembly = _assembly(rng, radius, length, [shape])
    view = View(ALL_ROUND, Pattern.EVEN, float(np.clip(0.05 * radius, 0.003, 0.02)))
    drawn = scanned(assembly, view, Noise(isotropic=noise), rng, {})
    row = judge(drawn, detect(drawn.cloud))
    return row | {"at": [radius, ovality, noise]}


def _verdict(row: Row) -> str:
    """Say what is wrong in a cell, by letters; ✓ if nothing."""
    (element,) = row["elements"]
    if not element["is_found"]:
        return "missed"
    wrong = [
        letter
        for letter, flag in zip("krow", ("kind", "radius", "ovality", "whole"), strict=True)
        if not element.get("is_whole" if flag == "whole" else f"is_{flag}_right", False)
    ]
    wrong += ["f"] if row["n_reported"] > 1 else []
    return "".join(wrong) or "✓"


def ovality_table(rows: Sequence[Row]) -> str:
    """Return a line per size and noise, a column per ovality, and how many are right."""
    cells = {tuple(r["at"]): _verdict(r) for r in rows}
    head = ["r, mm; noise, mm", *(f"{100 * o:g} %" for o in OVALITIES)]
    lines = [
        [f"{1e3 * r:.0f}; {1e3 * n:g}", *(cells[r, o, n] for o in OVALITIES)]
        for r in RADII
        for n in NOISES
    ]
    right = sum(c == "✓" for c in cells.values())
    missed = sum(c == "missed" for c in cells.values())
    legend = (
        f"{right} of {len(cells)} right, {missed} missed. Wrong are: k kind, r radius (0.3 % or "
        "3 SD), o ovality (10 % of it or 3 SD), w not whole, f other elements beside it."
    )
    return f"{table(head, lines)}\n\n{legend}"


@dataclass(frozen=True)
class Expected:
    """What should be told of a place: any of `kinds`, from `start` to `end`, its size.

    `size` is a depth (metres) or, with `is_ovality`, a ratio; nan where none is asked.
    """

    kinds: tuple[str, ...]
    start: float
    end: float
    size: float = np.nan
    is_ovality: bool = False


Scene = tuple[Assembly, View, Expected | None]
RADIUS, LENGTH = 0.1, 3.0
EVEN = View(ALL_ROUND, Pattern.EVEN, 0.01)


def _assembly(rng: Rng, radius: float, length: float, shapes: Sequence[Shape]) -> Assembly:
    assembly = Assembly()
    direction = random_direction(rng)
    line = Line(-length / 2 * direction, direction, length)
    assembly.element(line, assembly.body("pipe", Role.PIPE), radius, shapes=shapes)
    return assembly


def _one_side(assembly: Assembly, spacing: float) -> View:
    axis = assembly.elements[0].axis
    station = axis.at(axis.length / 2) + 4.0 * across(axis.tangent(0.0))[1]
    return View(station[None], Pattern.EVEN, spacing)


def _dent(depth: float, radius: float = RADIUS, spacing: float = 0.01) -> Callable[[Rng], Scene]:
    def draw(rng: Rng) -> Scene:
        angle = rng.uniform(0, 2 * np.pi)
        scale = radius / RADIUS
        dent = Dent(depth, 0.25 * scale, 0.16 * scale, LENGTH / 2, angle, radius)
        expected = Expected(("dent", "crushed"), dent.start, dent.end, depth)
        return _assembly(rng, radius, LENGTH, [dent]), replace(EVEN, spacing=spacing), expected

    return draw


def _flattened(ovality: float) -> Callable[[Rng], Scene]:
    def draw(rng: Rng) -> Scene:
        start, end = LENGTH / 2 - 0.3, LENGTH / 2 + 0.3
        shape = Oval(RADIUS, ovality, 0.0, rng.uniform(0, np.pi), 0.0, start, end, 0.15)
        expected = Expected(("ovality", "crushed"), start, end, ovality, is_ovality=True)
        return _assembly(rng, RADIUS, LENGTH, [shape]), EVEN, expected

    return draw


def _crumple(rng: Rng) -> Scene:
    start, end = LENGTH / 2 - 0.2, LENGTH / 2 + 0.2
    shape = Crumple(0.008, 0.1, start, end)
    return _assembly(rng, RADIUS, LENGTH, [shape]), EVEN, Expected(("crumple",), start, end)


def _twist(*, is_one_sided: bool) -> Callable[[Rng], Scene]:
    def draw(rng: Rng) -> Scene:
        shape = Oval(RADIUS, 0.06, 0.0, rng.uniform(0, np.pi), np.pi / 2)
        assembly = _assembly(rng, RADIUS, 2.0, [shape])
        view = _one_side(assembly, 0.01) if is_one_sided else EVEN
        return assembly, view, Expected(("twist", "ovality"), 0.0, 2.0, 0.06, is_ovality=True)

    return draw


def _kink(angle_deg: float) -> Callable[[Rng], Scene]:
    def draw(rng: Rng) -> Scene:
        direction = random_direction(rng)
        depth = LENGTH / 4 * np.tan(np.deg2rad(angle_deg))
        line = bowed(np.zeros(3), direction, LENGTH, depth, "kink")
        assembly = Assembly()
        body = assembly.body("kink", Role.PIPE)
        assembly.element(line, body, RADIUS, bent=DeformationKind.KINK)
        return assembly, EVEN, Expected(("kink",), LENGTH / 3, 2 * LENGTH / 3, depth)

    return draw


def _dented_sphere(depth: float) -> Callable[[Rng], Scene]:
    def draw(rng: Rng) -> Scene:
        assembly = Assembly()
        radius, direction = 0.25, random_direction(rng)
        element_id = assembly.sphere(np.zeros(3), radius, assembly.body("sphere", Role.PIPE))
        patch = assembly.patches[0]
        at = patch.at

        def dented(u: Array, v: Array) -> Array:
            points = at(u, v)
            angle = np.arccos(np.clip(points @ direction / radius, -1, 1))
            rho = np.minimum(angle / 0.5, 1.0)
            return points * (1 - depth / radius * np.cos(np.pi * rho / 2) ** 2)[:, None]

        assembly.patches[0] = replace(patch, at=dented)
        assert element_id == 1
        return assembly, EVEN, Expected(("dent",), 0.0, 2 * radius, depth)

    return draw


def _cone(rng: Rng) -> Scene:
    assembly = Assembly()
    run = Run(assembly, "cone", np.zeros(3), random_direction(rng), 0.2)
    run.reducer(1.0, 0.1, 0.0)
    return assembly, EVEN, None


def _sphere(rng: Rng) -> Scene:
    assembly = Assembly()
    assembly.sphere(rng.normal(size=3), 0.25, assembly.body("sphere", Role.PIPE))
    return assembly, replace(EVEN, spacing=0.02), None


def _ring(rng: Rng) -> Scene:
    assembly = Assembly()
    direction = random_direction(rng)
    arc = Arc(np.zeros(3), direction, across(direction)[0], 0.5, 2 * np.pi)
    body = assembly.body("ring", Role.PIPE)
    assembly.element(arc, body, 0.15, kind=ElementKind.TORUS)
    return assembly, EVEN, None


def _coaxial(gap: float) -> Callable[[Rng], Scene]:
    def draw(rng: Rng) -> Scene:
        assembly = _assembly(rng, RADIUS, 2.0, [])
        axis = assembly.elements[0].axis
        line = Line(axis.start, axis.tangent(0.0), 2.0)
        assembly.element(line, assembly.body("outer", Role.PIPE), RADIUS + gap)
        return assembly, replace(EVEN, spacing=0.02), None

    return draw


def _thin_one_side(rng: Rng) -> Scene:
    assembly = _assembly(rng, RADIUS, LENGTH, [])
    return assembly, _one_side(assembly, 0.05), None


LINES: dict[str, Callable[[Rng], Scene]] = {
    "dent 250 × 160 mm, 20 mm deep": _dent(0.02),
    "dent 250 × 160 mm, 40 mm deep": _dent(0.04),
    "dent 250 × 160 mm, 80 mm deep": _dent(0.08),
    "flattened by 6 % over 0.6 m": _flattened(0.06),
    "flattened by 10 % over 0.6 m": _flattened(0.10),
    "flattened by 15 % over 0.6 m": _flattened(0.15),
    "flattened by 20 % over 0.6 m": _flattened(0.20),
    "crumple: rings ± 8 mm over 0.4 m": _crumple,
    "6 % oval, turning 180° over 2 m": _twist(is_one_sided=False),
    "6 % oval, turning, from one side": _twist(is_one_sided=True),
    "kink of 3°": _kink(3.0),
    "kink of 8°": _kink(8.0),
    "sphere with a dent, 20 mm": _dented_sphere(0.02),
    "sphere with a dent, 60 mm": _dented_sphere(0.06),
    "lone cone 200 → 100": _cone,
    "lone sphere r 250 at 20 mm": _sphere,
    "torus of 360°": _ring,
    "coaxial, 40 mm apart, 20 mm spacing": _coaxial(0.04),
    "coaxial, 50 mm apart, 20 mm spacing": _coaxial(0.05),
    "50 mm spacing: dent of 30 mm, r 150": _dent(0.03, 0.15, 0.05),
    "50 mm spacing: r 100 from one side": _thin_one_side,
}
"""The table of issue 16: a lone pipe r 100 mm, 10 mm spacing, 2 mm noise, all round."""


def damage_jobs(draws: int) -> list[Job]:
    """Return detections of each line, with as many draws."""
    return [
        (f"damage-{k}-{seed}", measure_damage, (name, seed))
        for k, name in enumerate(LINES)
        for seed in range(draws)
    ]


def measure_damage(name: str, seed: int) -> Row:
    """Detect one draw of a line."""
    rng = np.random.default_rng([list(LINES).index(name), seed])
    assembly, view, expected = LINES[name](rng)
    drawn = scanned(assembly, view, Noise(beam=0.002), rng, {})
    result = detect(drawn.cloud)
    return judge(drawn, result) | {"line": name} | _told(drawn, result, expected)


def _told(drawn: WorldScene, result: Result, expected: Expected | None) -> Row:
    """What the table of deformations says of the place, and how many rows lie elsewhere."""
    if expected is None:
        return {"is_told": None, "elsewhere": len(result.deformations)}
    axis = drawn.truth.elements[0].axis
    shift = result.origin - drawn.truth.origin
    there = []
    for d in result.deformations:
        chainage = axis.pipe_coordinates((d.peak + shift)[None])[0][0]
        if expected.start - 0.1 <= chainage <= expected.end + 0.1:
            there.append(d)
    right = [d for d in there if str(d.kind) in expected.kinds]
    sizes = [(d.ovality if expected.is_ovality else d.depth) / expected.size for d in right]
    return {
        "is_told": bool(there),
        "is_kind_told": bool(right),
        "is_one": len(there) == 1,
        "size": min(sizes, key=lambda s: abs(s - 1), default=None),
        "elsewhere": len(result.deformations) - len(there),
    }


def damage_table(rows: Sequence[Row]) -> str:
    """Return a line per kind of damage: how many draws were right, in what."""
    lines = []
    for name in LINES:
        mine = [r for r in rows if r["line"] == name]
        n = len(mine)
        asked = [r for r in mine if r["is_told"] is not None]
        sizes = [r["size"] for r in asked if r.get("size")]

        def share(flag: str, of: list[Row] = asked) -> str:
            return f"{sum(bool(r[flag]) for r in of)} of {len(of)}" if of else "–"

        def all_right(flag: str, rows: list[Row] = mine, n: int = n) -> str:
            right = sum(bool(r["elements"]) and all(e[flag] for e in r["elements"]) for r in rows)
            return f"{right} of {n}"

        lines.append(
            [
                name,
                all_right("is_kind_right"),
                all_right("is_whole"),
                all_right("is_radius_right"),
                share("is_told"),
                share("is_kind_told"),
                f"{np.median(sizes):.2f}" if sizes else "–",
                str(sum(r["elsewhere"] for r in mine)),
                str(sum(len(r["false"]) for r in mine)),
            ]
        )
    head = [
        "", "kind", "whole", "radius", "place told", "as its kind", "size / true",
        "told elsewhere", "false elements",
    ]  # fmt: skip
    return table(head, lines)
