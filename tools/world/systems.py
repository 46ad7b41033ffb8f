"""Piping systems: lines of straights and fittings, with branches."""

from typing import Any

import numpy as np

from tools.world.assembly import Assembly, Role, Run
from tools.world.pipes import draw_radius
from tools.world.shapes import Oval
from tools.world.surfaces import Array, Patch, unit
from tools.world.tubes import Line, tube

Rng = np.random.Generator
STANDARD = (2.0, 3.0, 3.0, 6.0, 10.0)
"""Bend radii over the pipe's radius: 1D, 1.5D (twice as often), 3D and 5D."""
FITTINGS = {
    "bend": 4.0,
    "reducer": 1.5,
    "flange pair": 2.0,
    "tee": 1.5,
    "mitre": 0.5,
    "return bend": 0.7,
    "back to back": 0.7,
    "capped stub": 0.7,
}


def build(assembly: Assembly, rng: Rng, size: float) -> dict[str, Any]:
    """Add one to three lines to a room of `size` metres; return how many fittings there are."""
    count: dict[str, int] = {}
    n_lines = int(rng.integers(1, 4))
    for k in range(n_lines):
        radius = draw_radius(rng, 0.04, 0.16)
        height = 0.5 + 1.4 * (k + rng.uniform(0.2, 0.8)) / n_lines
        start = np.array([-0.3 * size, 0.25 * size * (k - (n_lines - 1) / 2), height])
        run = Run(assembly, f"line {k + 1}", start, np.eye(3)[0], radius)
        for name in _line(run, rng, 0.33 * size):
            count[name] = count.get(name, 0) + 1
    return {f"n_{name.replace(' ', '_')}": n for name, n in sorted(count.items())}


def _line(run: Run, rng: Rng, reach: float) -> list[str]:
    """Add straights with fittings between them until the line leaves the room."""
    names = []
    if rng.uniform() < 0.3:
        run.flange(*_flange_size(run.radius), is_blind=True)
        names.append("blind flange")
    last = _straight(run, rng)
    p = np.array(list(FITTINGS.values()))
    for _ in range(rng.integers(2, 6)):
        name = str(rng.choice(list(FITTINGS), p=p / p.sum()))
        if name == "reducer" and not 0.04 < run.radius < 0.2:
            name = "bend"
        if name == "tee":
            _branch(run, last, rng)
        elif name == "capped stub":
            _stub(run, last, rng)
        else:
            _fitting(run, name, rng, reach)
            last = _straight(run, rng)
        names.append(name)
        if np.abs(run.position).max() > reach + 0.8 or run.position[2] < run.radius + 0.1:
            break
    end = rng.choice(["open", "cap", "blind flange"])
    if end == "cap":
        run.cap(run.radius / 2)
        names.append("cap")
    elif end == "blind flange":
        run.flange(*_flange_size(run.radius), is_blind=True)
        names.append("blind flange")
    return names


def _straight(run: Run, rng: Rng) -> int:
    shapes = []
    if rng.uniform() < 0.3:
        shapes.append(Oval(run.radius, rng.uniform(0.01, 0.04), 0, rng.uniform(0, np.pi)))
    return run.straight(max(run.radius * rng.uniform(5, 14), 0.25), shapes=shapes)


def _flange_size(radius: float) -> tuple[float, float, float]:
    """Outer radius, thickness and gap."""
    return 1.35 * radius + 0.03, 0.016 + 0.09 * radius, 0.003


def _inside(run: Run, rng: Rng, reach: float) -> float:
    """A roll of the next bend's plane that keeps a right angle's line within the room."""
    rolls = rng.uniform(0, 2 * np.pi) + np.arange(4) * np.pi / 2
    if rng.uniform() < 0.7:
        up = np.array([0.0, 0.0, 1.0])
        normal = np.cross(run.direction, run.inward)
        rolls = np.arctan2(up @ normal, up @ run.inward) + np.arange(4) * np.pi / 2

    def outside(roll: float) -> float:
        aim = np.cos(roll) * run.inward + np.sin(roll) * np.cross(run.direction, run.inward)
        end = run.position + 0.8 * aim + 0.3 * run.direction
        return float(np.abs(end[:2]).max() / reach + abs(end[2] - 1.2))

    rolls = sorted(rolls, key=outside)
    return float(rolls[0] if rng.uniform() < 0.7 else rolls[1])


def _fitting(run: Run, name: str, rng: Rng, reach: float) -> None:
    bend_radius = run.radius * float(rng.choice(STANDARD))
    roll = _inside(run, rng, reach)
    if name == "bend":
        angle = np.deg2rad(rng.choice([90.0, 90.0, 45.0, 60.0, rng.uniform(8, 120)]))
        run.bend(bend_radius, angle, roll, shapes=[Oval(run.radius, rng.uniform(0, 0.05))])
    elif name == "return bend":
        run.bend(bend_radius, np.pi, roll)
    elif name == "back to back":
        run.bend(bend_radius, np.pi / 2, roll)
        run.bend(bend_radius, np.pi / 2, float(rng.choice([0.0, np.pi / 2, np.pi])))
    elif name == "reducer":
        share = rng.uniform(0.5, 0.8) if run.radius > 0.06 else rng.uniform(1.3, 1.8)
        run.reducer(run.radius * rng.uniform(2, 8), run.radius * share, float(rng.integers(2)))
    elif name == "flange pair":
        run.flange(*_flange_size(run.radius))
    elif name == "mitre":
        _mitre(run, rng, roll)
    else:
        raise ValueError(name)


def _mitre(run: Run, rng: Rng, roll: float) -> None:
    """A bend of straight pieces, cut in the planes that halve their angles.

    Its pieces are too short to be told apart from a bend: nobody asks what they are called.
    """
    n, radius = int(rng.integers(2, 4)), run.radius
    step = np.deg2rad(rng.choice([45.0, 90.0])) / n
    piece = 2 * 3 * radius * np.tan(step / 2)
    body = run.assembly.body("mitre", Role.IGNORE)
    normal = np.cross(run.direction, run.inward)
    inward = np.cos(roll) * run.inward + np.sin(roll) * normal
    position, direction = run.position, run.direction
    for k in range(n):
        turned = unit(np.cos(step) * direction + np.sin(step) * inward)
        inward = np.cos(step) * inward - np.sin(step) * direction
        before = unit(direction + turned)
        after = None
        length = piece if k < n - 1 else 2 * radius
        if k < n - 1:
            ahead = unit(np.cos(step) * turned + np.sin(step) * inward)
            after = unit(turned + ahead)
        start = position - radius * turned
        line = Line(start, turned, length + 2 * radius)
        run.assembly.patches.append(
            Patch(
                tube(line, lambda s, theta: radius + 0 * s),
                body,
                is_inward=True,
                keep=_between(position, before, position + length * turned, after, turned),
            )
        )
        position, direction = position + length * turned, turned
    run.position, run.direction, run.inward = position, direction, inward


def _between(start: Array, before: Array, end: Array, after: Array | None, ahead: Array):
    after = ahead if after is None else after

    def keep(points: Array) -> np.ndarray:
        return ((points - start) @ before > 0) & ((points - end) @ after < 0)

    return keep


def _stub(run: Run, header_id: int, rng: Rng) -> None:
    """A capped pipe that ends just before the side of the last straight: no branch."""
    header = run.assembly.elements[header_id - 1]
    radius = header.radius * rng.uniform(0.4, 0.9)
    if radius < 0.017:
        return
    outward = header.axis.frame(0.0)[1]
    gap = rng.uniform(0.006, 0.17)
    length = max(radius * rng.uniform(5, 10), 0.2)
    foot = header.axis.at(header.axis.length / 2) + (header.radius + gap + radius / 2) * outward
    stub = Run(run.assembly, "capped stub", foot + length * outward, -outward, radius)
    stub.straight(length)
    stub.cap(radius / 2)


def _branch(run: Run, header_id: int, rng: Rng) -> None:
    """A smaller pipe at right angles from the middle of the last straight."""
    assembly = run.assembly
    header = assembly.elements[header_id - 1]
    middle = header.axis.at(header.axis.length / 2)
    radius = header.radius * rng.uniform(0.3, 0.9)
    if radius < 0.017:
        return
    assembly.branched.add(header_id)
    up, right = header.axis.frame(0.0)
    turn = rng.choice([0.0, 0.5, 1.0]) * np.pi
    outward = np.cos(turn) * up + np.sin(turn) * right
    along, ahead = header.radius, header.axis.tangent(0.0)

    def outside_header(points: Array) -> np.ndarray:
        across = np.cross(points - middle, ahead)
        return np.linalg.norm(across, axis=1) > along

    def outside_branch(points: Array) -> np.ndarray:
        offset = points - middle
        return (offset @ outward < 0) | (np.linalg.norm(np.cross(offset, outward), axis=1) > radius)

    length = header.radius + max(radius * rng.uniform(5, 10), 0.2)
    branch = Run(assembly, f"branch of {header.run_name}", middle, outward, radius)
    start = 0.9 * np.sqrt(header.radius**2 - radius**2)
    branch.position = middle + start * outward
    branch.straight(length - start, keep=outside_header)
    for k, patch in enumerate(assembly.patches):
        if patch.element_id == header_id:
            assembly.patches[k] = Patch(
                patch.at, patch.body, header_id, is_inward=True, keep=outside_branch
            )
