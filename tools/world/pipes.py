"""Lone pipes and other single bodies of the paper's kinds, each with one thing wrong with it."""

from collections.abc import Callable
from typing import Any

import numpy as np

from pipecore.types import DeformationKind, ElementKind
from tools.world.assembly import Assembly, Role, Run
from tools.world.shapes import (
    DENT_PROFILES,
    Bands,
    Crumple,
    Dent,
    Oval,
    Shape,
    Steps,
    Waves,
)
from tools.world.surfaces import Array, Patch, across
from tools.world.tubes import Arc, Line, tube

Rng = np.random.Generator
MIN_RADIUS, MAX_PIPE_RADIUS, MAX_RADIUS = 0.0168, 0.457, 3.0
"""DN 25, DN 900 and the largest vessel."""
SHORTEST = 0.11
"""Just above `elements.min_length_mm`, metres."""


def draw_radius(rng: Rng, low: float = MIN_RADIUS, high: float = MAX_PIPE_RADIUS) -> float:
    """Draw a radius, metres, evenly by its logarithm."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def draw_length(rng: Rng, radius: float) -> float:
    """Draw the length of a pipe, metres."""
    if radius > MAX_PIPE_RADIUS:
        return radius * rng.uniform(1.5, 4.0)
    return float(np.clip(radius * rng.uniform(8, 25), 0.4, 10.0))


def draw_oval(rng: Rng, radius: float, low: float = 0.01, high: float = 0.12) -> Oval:
    """Draw an ovality that turns slowly along the pipe."""
    return Oval(
        radius, rng.uniform(low, high), rng.uniform(0, 0.5), rng.uniform(0, np.pi),
        rng.uniform(-0.05, 0.05) / radius,
    )  # fmt: skip


def draw_rough(rng: Rng, radius: float) -> tuple[str, float, Shape]:
    """Draw what roughens a surface: its name, size over radius, and shape."""
    size = rng.uniform(0.003, 0.02)
    name = str(rng.choice(["corrosion", "bark", "cladding", "insulation bands"]))
    height = size * radius
    if name == "corrosion":
        return name, size, Waves.draw(rng, height / 2, (4, 16), (0.4 * radius, 3 * radius))
    if name == "bark":
        return name, size, Waves.draw(rng, height / 2, (8, 24), (1.5 * radius, 8 * radius))
    if name == "cladding":
        return name, size, Steps(height, rng.uniform(0.5, 1.0))
    return name, size, Bands(height, rng.uniform(0.25, 0.5), rng.uniform(0.02, 0.05))


def draw_dents(rng: Rng, radius: float, length: float, n: int) -> list[Dent]:
    """Draw dents at even distances along a pipe, up to 20 % of its diameter deep."""
    dents = []
    for k in range(n):
        extent = min(rng.uniform(0.4, 1.2) * 2 * radius, 0.9 * length / n)
        dents.append(
            Dent(
                rng.uniform(0.03, 0.2) * 2 * radius,
                extent * rng.uniform(0.8, 1.25),
                min(extent * rng.uniform(0.8, 1.25), 2.2 * radius),
                length * (k + 0.5) / n,
                rng.uniform(0, 2 * np.pi),
                radius,
                str(rng.choice(list(DENT_PROFILES))),
            )
        )
    return dents


def bowed(start: Array, direction: Array, length: float, depth: float, shape: str) -> Line:
    """Return a line bowed by `depth` metres in its middle.

    `shape` is "arc" (even curvature), "sag" (held level at its ends) or "kink".
    """

    def sideways(s: Array) -> Array:
        x = np.asarray(s) / length
        if shape == "arc":
            return 4 * depth * x * (1 - x)
        if shape == "sag":
            return 16 * depth * (x * (1 - x)) ** 2
        return depth * (1 - np.sqrt((2 * x - 1) ** 2 + 1e-4))

    return Line(start, direction, length, sideways)


def _straight(
    assembly: Assembly, rng: Rng, radius: float, direction: Array, shapes: list[Shape], name: str,
    length: float | None = None,
) -> None:  # fmt: skip
    length = draw_length(rng, radius) if length is None else length
    line = Line(-length / 2 * direction, direction, length)
    assembly.element(line, assembly.body(name, Role.PIPE), radius, shapes=shapes)


Drawn = dict[str, Any]
"""What was drawn; "most_spacing" (metres) is the widest that still shows it."""
Feature = Callable[[Assembly, Rng, float, Array], Drawn]


def plain(assembly: Assembly, rng: Rng, radius: float, direction: Array) -> Drawn:
    """Draw a round, straight pipe."""
    _straight(assembly, rng, radius, direction, [], "plain")
    return {}


def oval(assembly: Assembly, rng: Rng, radius: float, direction: Array) -> Drawn:
    """Draw a pipe that is oval all along."""
    shape = draw_oval(rng, radius)
    _straight(assembly, rng, radius, direction, [shape], "oval")
    return {"ovality": shape.ovality}


def rough(assembly: Assembly, rng: Rng, radius: float, direction: Array) -> Drawn:
    """Draw a pipe that is corroded, clad, insulated, or a tree's stem."""
    name, size, shape = draw_rough(rng, radius)
    _straight(assembly, rng, radius, direction, [shape], name)
    return {"roughness": size, "surface": name}


def dented(assembly: Assembly, rng: Rng, radius: float, direction: Array) -> Drawn:
    """Draw a pipe with one to four dents."""
    length = draw_length(rng, radius)
    dents = draw_dents(rng, radius, length, int(rng.integers(1, 5)))
    _straight(assembly, rng, radius, direction, list(dents), "dented", length)
    deepest = max(d.depth for d in dents)
    return {"n_dents": len(dents), "depth": deepest / (2 * radius)}


def bow(assembly: Assembly, rng: Rng, radius: float, direction: Array) -> Drawn:
    """Draw a pipe that is bowed or sags by up to 5 % of its length, or has a kink."""
    length = max(draw_length(rng, radius), 10 * radius)
    shape = str(rng.choice(["arc", "sag", "kink"]))
    # Of a bend radius below 20 r it would be a bend.
    depth = min(rng.uniform(0.005, 0.05) * length, length**2 / (160 * radius))
    if shape == "kink":
        depth = length / 4 * np.tan(np.deg2rad(rng.uniform(2, 8)))
    line = bowed(-length / 2 * direction, direction, length, depth, shape)
    kind = DeformationKind.KINK if shape == "kink" else DeformationKind.BOW
    assembly.element(line, assembly.body(shape, Role.PIPE), radius, bent=kind)
    return {"bow": depth / length, "shape": shape}


def damaged(assembly: Assembly, rng: Rng, radius: float, direction: Array) -> Drawn:
    """Draw a pipe that is flattened over a stretch, crumpled, or twisted and oval."""
    length = max(draw_length(rng, radius), 16 * radius)
    name = str(rng.choice(["flattened", "crumple", "twist"]))
    start, end = length / 2 - 3 * radius, length / 2 + 3 * radius
    shape: Shape
    if name == "flattened":
        phase = rng.uniform(0, np.pi)
        shape = Oval(radius, rng.uniform(0.06, 0.2), 0, phase, 0, start, end, 1.5 * radius)
    elif name == "crumple":
        shape = Crumple(rng.uniform(0.04, 0.1) * radius, 0.8 * radius, start, end)
    else:
        shape = Oval(radius, rng.uniform(0.04, 0.1), 0, rng.uniform(0, np.pi), np.pi / length)
    _straight(assembly, rng, radius, direction, [shape], name, length)
    return {"damage": name}


def walled(assembly: Assembly, rng: Rng, radius: float, direction: Array) -> Drawn:
    """Draw a round pipe whose inner surface is seen too, as in open or photographed pipes."""
    _straight(assembly, rng, radius, direction, [], "walled")
    wall = max(rng.uniform(0.03, 0.1) * radius, 0.003)
    outer = assembly.patches[0]
    axis = assembly.elements[0].axis
    inner = tube(
        Line(axis.start, axis.tangent(0.0), axis.length), lambda s, theta: radius - wall + 0 * s
    )
    assembly.patches.append(Patch(inner, outer.body))
    return {"wall": wall}


def spool(assembly: Assembly, rng: Rng, radius: float, direction: Array) -> Drawn:
    """Draw a short piece of pipe."""
    length = max(rng.uniform(0.3, 3.0) * radius, SHORTEST)
    _straight(assembly, rng, radius, direction, [], "spool", length)
    return {"length_radii": length / radius, "most_spacing": length / 6}


def cone(assembly: Assembly, rng: Rng, radius: float, direction: Array) -> Drawn:
    """Draw a cone without pipes: a hopper, a stack, a reducer, half of them eccentric."""
    length, end = radius * rng.uniform(1.5, 8.0), radius * rng.uniform(0.35, 0.8)
    eccentric = float(rng.choice([0.0, 1.0]))
    run = Run(assembly, "cone", -length / 2 * direction, direction, radius)
    run.reducer(length, end, eccentric)
    return {"eccentric": eccentric}


def sphere(assembly: Assembly, rng: Rng, radius: float, direction: Array) -> Drawn:
    """Draw a sphere."""
    assembly.sphere(np.zeros(3), radius, assembly.body("sphere", Role.PIPE))
    return {}


def capped(assembly: Assembly, rng: Rng, radius: float, direction: Array) -> Drawn:
    """Draw a pipe or vessel with domed ends."""
    length = draw_length(rng, radius)
    height = radius * rng.choice([0.5, 1.0])
    for sign in (-1, 1):
        run = Run(assembly, "capped", np.zeros(3), sign * direction, radius)
        run.position = length / 2 * sign * direction
        run.cap(height)
    _straight(assembly, rng, radius, direction, [], "capped", length)
    return {}


def torus(assembly: Assembly, rng: Rng, radius: float, direction: Array) -> Drawn:
    """Draw a bend without pipes, 8° to the whole ring."""
    angle = np.deg2rad(rng.choice([rng.uniform(8, 60), rng.uniform(60, 200), 360.0]))
    bend_radius = radius * rng.uniform(2.0, 10.0)
    arc = Arc(np.zeros(3), direction, across(direction)[0], bend_radius, angle)
    body = assembly.body("torus", Role.PIPE)
    # A few percent of ovality is what bending leaves.
    shape = Oval(radius, rng.uniform(0, 0.05))
    assembly.element(arc, body, radius, kind=ElementKind.TORUS, shapes=[shape])
    return {"angle_deg": float(np.rad2deg(angle))}


def coil(assembly: Assembly, rng: Rng, radius: float, direction: Array) -> Drawn:
    """Draw straights with return bends between them."""
    run = Run(assembly, "coil", np.zeros(3), direction, radius)
    length, bend_radius = radius * rng.uniform(4, 12), radius * rng.uniform(2, 5)
    for k in range(rng.integers(2, 5)):
        run.straight(length)
        run.bend(bend_radius, np.pi, 0.0 if k == 0 else np.pi)
    run.straight(length)
    return {}


FEATURES: dict[str, tuple[Feature, float]] = {
    "plain": (plain, 2.0),
    "oval": (oval, 3.0),
    "rough": (rough, 2.0),
    "dented": (dented, 3.0),
    "bow": (bow, 2.0),
    "damaged": (damaged, 1.5),
    "walled": (walled, 0.7),
    "spool": (spool, 1.0),
    "cone": (cone, 1.0),
    "sphere": (sphere, 1.0),
    "capped": (capped, 1.0),
    "torus": (torus, 1.5),
    "coil": (coil, 0.5),
}
"""What a lone body may be, and how often it is drawn against the others."""
