"""The families of scenes: what stands in them, how they are looked at, with which noise."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from tools.world import pipes, systems
from tools.world.assembly import Assembly, Role
from tools.world.clutter import CLUTTER, hose_heap
from tools.world.noise import Noise
from tools.world.scenes import WorldScene, scanned
from tools.world.surfaces import Array, quad, random_direction, unit
from tools.world.tubes import Line
from tools.world.viewing import Pattern, View

Rng = np.random.Generator
UP = np.array([0.0, 0.0, 1.0])


def draw_noise(rng: Rng, radius: float, spacing: float) -> tuple[str, Noise]:
    """Draw one fault, or little noise along the beam; its size follows the smallest radius."""
    largest = min(0.006, 0.05 * radius)
    sd = float(np.exp(rng.uniform(np.log(0.0003), np.log(max(largest, 0.0004)))))
    little = Noise(beam=min(sd, 0.002))
    choices: dict[str, Noise] = {
        "beam": Noise(beam=min(sd, 0.003)),
        "isotropic": Noise(isotropic=sd),
        "correlated": Noise(
            isotropic=sd / 2, correlated=0.7 * sd, reach=spacing * rng.uniform(1, 3)
        ),
        "rounding": Noise(
            beam=min(sd, 0.001),
            rounding=float(rng.choice([r for r in (0.001, 0.005, 0.01) if r <= 0.1 * radius])),
        ),
        "duplicates": Noise(isotropic=sd, rounding=0.001, duplicates=int(rng.integers(2, 31))),
        "offset": Noise(
            beam=min(sd, 0.002),
            offset=float(np.exp(rng.uniform(np.log(0.001), np.log(min(0.01, 0.08 * radius))))),
        ),
        "mixed": Noise(beam=min(sd, 0.003), mixed=0.03, stray=0.002),
        "stray": Noise(beam=min(sd, 0.003), stray=float(rng.uniform(0.002, 0.02))),
    }
    weights = {"beam": 3.0, "isotropic": 3.0, "correlated": 2.0}
    if radius < 0.02:
        del choices["rounding"]
    names = list(choices)
    p = np.array([weights.get(n, 1.0) for n in names])
    name = str(rng.choice(names, p=p / p.sum()))
    return name, choices.get(name, little)


def _lone_view(rng: Rng, radius: float, direction: Array, reach: float) -> tuple[str, View]:
    """All round or from stations that stand beside it."""
    name = str(rng.choice(["all round", "1 station", "2 stations", "3 stations"]))
    n = 0 if name == "all round" else int(name[0])
    # One side carries less: more points are needed there.
    widest = (0.5 if n != 1 else 0.3) * radius
    spacing = float(np.exp(rng.uniform(np.log(0.003), np.log(min(max(widest, 0.004), 0.05)))))
    pattern = Pattern(rng.choice(list(Pattern), p=[0.35, 0.2, 0.15, 0.12, 0.08, 0.1]))
    along = 0.002
    if pattern in (Pattern.LINES, Pattern.STRIPS):
        spacing, along = rng.uniform(0.015, 0.03), min(0.1 * radius, 0.004)
    if n == 0 and pattern in (Pattern.RASTER, Pattern.STRIPS):
        pattern = Pattern.EVEN
    if pattern is Pattern.UNEVEN:
        spacing = max(spacing / 3, 0.002)
    if pattern is Pattern.GRID:
        spacing = min(spacing, 0.01)
    side = unit(np.cross(direction, random_direction(rng)))
    third = np.cross(direction, side)
    stations = []
    for k in range(n):
        turn = 2 * np.pi * k / max(n, 2) + rng.normal(scale=0.2)
        around = np.cos(turn) * side + np.sin(turn) * third
        distance = radius + rng.uniform(2.0, 6.0) * max(0.5, min(reach, 2.0))
        stations.append(distance * around + rng.normal(scale=0.3) * reach * direction)
    return name, View(np.array(stations).reshape(-1, 3), pattern, spacing, along)


def lone(rng: Rng) -> WorldScene:
    """Draw one pipe or other body of the paper's kinds, and nothing beside it."""
    names = list(pipes.FEATURES)
    weights = np.array([pipes.FEATURES[n][1] for n in names])
    feature = str(rng.choice(names, p=weights / weights.sum()))
    radius = pipes.draw_radius(rng)
    if feature in ("plain", "oval", "rough", "dented", "capped") and rng.uniform() < 0.2:
        radius = pipes.draw_radius(rng, pipes.MAX_PIPE_RADIUS, pipes.MAX_RADIUS)
    if feature in ("spool", "cone", "sphere"):
        radius = pipes.draw_radius(rng, 0.04, 0.6)
    direction = random_direction(rng)
    assembly = Assembly()
    drawn = pipes.FEATURES[feature][0](assembly, rng, radius, direction)
    reach = max(e.axis.length for e in assembly.elements) / 2
    view_name, view = _lone_view(rng, radius, direction, reach)
    view = replace(view, spacing=min(view.spacing, drawn.pop("most_spacing", np.inf)))
    noise_name, noise = draw_noise(rng, radius, view.spacing)
    if noise_name == "duplicates":
        view = replace(view, spacing=max(view.spacing, 0.02 * radius))
    properties = {
        "feature": feature, "radius": radius, "view": view_name, "pattern": str(view.pattern),
        "fault": noise_name, **drawn,
    }  # fmt: skip
    return scanned(assembly, view, noise, rng, properties)


def _room(assembly: Assembly, size: float, rng: Rng) -> None:
    """A floor, and one or two walls."""
    half = size / 2
    x, y = size * np.eye(3)[0], size * np.eye(3)[1]
    corner = np.array([-half, -half, 0.0])
    patches = [quad(corner, x, y)]
    if rng.uniform() < 0.7:
        patches.append(quad(corner, 2.4 * UP, x))
    if rng.uniform() < 0.4:
        patches.append(quad(corner, y, 2.4 * UP))
    assembly.clutter("room", patches)


def _clutter(assembly: Assembly, rng: Rng, size: float, n: int, names: list[str]) -> None:
    """Things on a ring about the middle, so that they rarely stand in each other."""
    for k in range(n):
        name = str(rng.choice(names))
        turn = 2 * np.pi * (k + rng.uniform(-0.15, 0.15)) / n
        centre = 0.36 * size * np.array([np.cos(turn), np.sin(turn), 0.0])
        a = rng.uniform(0, 2 * np.pi)
        spin = np.array([[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1.0]])
        role = Role.CLUTTER if name in CLUTTER else Role.IGNORE
        made = CLUTTER[name](rng) if name in CLUTTER else hose_heap(rng)
        assembly.clutter(name, [p.moved(spin, centre) for p in made], role)


def _room_view(rng: Rng, size: float, radius: float) -> tuple[str, View]:
    """Stations at the height of a tripod between the things."""
    n = int(rng.integers(1, 5))
    pattern = Pattern(rng.choice(list(Pattern), p=[0.2, 0.4, 0.15, 0.1, 0.1, 0.05]))
    spacing = float(np.exp(rng.uniform(np.log(0.005), np.log(max(0.006, 0.2 * radius)))))
    along = 0.004
    if pattern in (Pattern.LINES, Pattern.STRIPS):
        spacing = rng.uniform(0.015, 0.02)
        n = 2 if pattern is Pattern.STRIPS else n
    turn = rng.uniform(0, 2 * np.pi) + 2 * np.pi * np.arange(n) / n
    out = rng.uniform(0.6, 0.75) * size
    heights = rng.uniform(1.2, 1.9, n)
    stations = np.column_stack([out * np.cos(turn), out * np.sin(turn), heights])
    return f"{n} station{'s' * (n > 1)}", View(stations, pattern, spacing, along)


def _finish(assembly: Assembly, rng: Rng, size: float, drawn: dict[str, Any]) -> WorldScene:
    radius = min((min(e.radius, e.radius_end) for e in assembly.elements), default=0.05)
    view_name, view = _room_view(rng, size, radius)
    noise_name, noise = draw_noise(rng, radius, view.spacing)
    if noise_name == "duplicates":
        noise = Noise(isotropic=noise.isotropic, rounding=noise.rounding, duplicates=2)
    properties = {
        "view": view_name, "pattern": str(view.pattern), "fault": noise_name, "radius": radius,
        **drawn,
    }  # fmt: skip
    return scanned(assembly, view, noise, rng, properties)


def several(rng: Rng) -> WorldScene:
    """Draw pipes of different size, direction and damage among things that are none."""
    size = rng.uniform(3.0, 4.5)
    assembly = Assembly()
    _room(assembly, size, rng)
    axes: list[tuple[Array, Array, float]] = []
    for _ in range(rng.integers(3, 7)):
        radius = pipes.draw_radius(rng, 0.04, 0.3)
        length = float(np.clip(radius * rng.uniform(8, 25), 0.5, 2.2))
        for _ in range(40):
            direction = UP if rng.uniform() < 0.3 else random_direction(rng)
            if rng.uniform() < 0.5 and direction is not UP:
                direction = unit(direction * [1, 1, 0])
            middle = np.r_[rng.uniform(-0.22, 0.22, 2) * size, rng.uniform(0.2, 2.2)]
            low = middle[2] - length / 2 * abs(direction[2]) - radius
            start = middle - length / 2 * direction
            if low > 0.02 and _is_free(start, direction * length, radius, axes):
                break
        else:
            continue
        axes.append((start, direction * length, radius))
        feature = str(rng.choice(["plain", "oval", "rough", "dented", "bowed"]))
        body = assembly.body(feature, Role.PIPE)
        line = Line(start, direction, length)
        if feature == "bowed":
            depth = min(0.03 * length, length**2 / (160 * radius))
            line = pipes.bowed(start, direction, length, depth, "sag")
            assembly.element(line, body, radius)
            continue
        shapes: dict[str, Callable[[], list[Any]]] = {
            "plain": list,
            "oval": lambda r=radius: [pipes.draw_oval(rng, r)],
            "rough": lambda r=radius: [pipes.draw_rough(rng, r)[2]],
            "dented": lambda r=radius, m=length: list(
                pipes.draw_dents(rng, r, m, int(rng.integers(1, 3)))
            ),
        }
        assembly.element(line, body, radius, shapes=shapes[feature]())
    names = [*CLUTTER, "hose heap"]
    _clutter(assembly, rng, size, int(rng.integers(2, 5)), names)
    return _finish(assembly, rng, size, {"n_pipes": len(axes)})


def _is_free(
    start: Array, extent: Array, radius: float, axes: list[tuple[Array, Array, float]]
) -> bool:
    """Whether a pipe keeps clear of others."""
    t = np.linspace(0, 1, 40)[:, None]
    points = start + t * extent
    for other, other_extent, other_radius in axes:
        gap = np.linalg.norm(points[:, None] - (other + t * other_extent), axis=2).min()
        if gap < 1.1 * (radius + other_radius) + 0.08:
            return False
    return True


def clutter(rng: Rng) -> WorldScene:
    """Draw things that are no pipes, and no pipe."""
    size = rng.uniform(3.5, 5.0)
    assembly = Assembly()
    _room(assembly, size, rng)
    _clutter(assembly, rng, size, int(rng.integers(3, 6)), list(CLUTTER))
    return _finish(assembly, rng, size, {})


def piping(rng: Rng) -> WorldScene:
    """Draw piping systems: bends, reducers, flanges, branches, caps, mitres."""
    size = rng.uniform(3.5, 5.0)
    assembly = Assembly()
    _room(assembly, size, rng)
    drawn = systems.build(assembly, rng, size)
    if rng.uniform() < 0.5:
        _clutter(assembly, rng, 1.25 * size, 2, list(CLUTTER))
    return _finish(assembly, rng, size, drawn)


FAMILIES: dict[str, Callable[[Rng], WorldScene]] = {
    "lone": lone,
    "several": several,
    "clutter": clutter,
    "piping": piping,
}


def scene(seed: int, family: str) -> WorldScene:
    """Return the scene of a family that a seed draws, always the same.

    Parameters
    ----------
    seed : int
    family : str
        A key of `FAMILIES`.
    """
    stream = [seed, list(FAMILIES).index(family)]
    return FAMILIES[family](np.random.default_rng(stream))
