"""Things that are no pipes, however round they look; each stands on z = 0 about the origin.

Each function draws one, of about a metre or two, and returns its patches.
"""

from collections.abc import Callable

import numpy as np

from tools.world.shapes import Oval, Waves
from tools.world.surfaces import (
    Array,
    Patch,
    extrusion,
    height_field,
    quad,
    random_direction,
    unit,
)
from tools.world.tubes import Line, dome, tube

Rng = np.random.Generator
X, Y, Z = np.eye(3)
FLAT = np.eye(3)
"""Takes z, along which outlines are swept and heights are counted, to -y."""
LYING = np.column_stack([Y, Z, X])
"""Takes z to x: what is swept along z lies on the floor."""


def _box(low: Array, high: Array) -> list[Patch]:
    edges = np.diag(high - low)
    faces = []
    for k in range(3):
        a, b = edges[(k + 1) % 3], edges[(k + 2) % 3]
        faces += [quad(high, -b, -a), quad(low, b, a)]
    return faces


def boxes(rng: Rng) -> list[Patch]:
    """Draw crates beside and on each other."""
    patches = []
    for _ in range(rng.integers(2, 6)):
        size = rng.uniform(0.15, 0.8, 3)
        corner = np.r_[rng.uniform(-0.8, 0.8, 2), 0.0]
        patches += _box(corner, corner + size)
    return patches


def stairs(rng: Rng) -> list[Patch]:
    """Draw a flight of steps."""
    rise, tread, width = rng.uniform(0.15, 0.2), rng.uniform(0.24, 0.3), rng.uniform(0.7, 1.1)
    patches = []
    for k in range(rng.integers(5, 9)):
        corner = np.array([k * tread - 0.8, -width / 2, k * rise])
        patches.append(quad(corner, width * Y, rise * Z, is_two_sided=True))
        patches.append(quad(corner + rise * Z, tread * X, width * Y, is_two_sided=True))
    return patches


def corrugated_sheet(rng: Rng) -> list[Patch]:
    """Draw a sine-shaped sheet, as a wall or as a roof."""
    pitch, height = [(0.076, 0.018), (0.13, 0.03), (0.177, 0.051), (0.2, 0.055)][rng.integers(4)]
    sheet = height_field(
        (rng.uniform(1.2, 2.0), rng.uniform(1.2, 2.0)),
        lambda x, _: height / 2 * np.cos(2 * np.pi * x / pitch),
        is_two_sided=True,
    )
    return [_stood(sheet, rng)]


def trapezoidal_sheet(rng: Rng) -> list[Patch]:
    """Draw a sheet of flat ribs with slanting sides."""
    pitch, height = rng.uniform(0.15, 0.3), rng.uniform(0.03, 0.1)
    slant = rng.uniform(0.1, 0.2) * pitch
    top = (pitch - 2 * slant) / 2
    rib = np.array([[0, 0], [top, 0], [top + slant, height], [pitch - slant, height]])
    n = int(1.6 / pitch)
    outline = np.concatenate([rib + np.array([k * pitch, 0]) for k in range(n)])
    sheet = extrusion(outline - outline.mean(axis=0), rng.uniform(1.2, 2.0), is_two_sided=True)
    return [_stood(sheet, rng)]


def _stood(sheet: Patch, rng: Rng) -> Patch:
    """The sheet upright (its ribs or heights either way), or tilted as a roof."""
    spin = _about(Z, rng.choice([0.0, np.pi / 2]))
    tilt = _about(X, np.pi / 2 if rng.uniform() < 0.7 else rng.uniform(0.1, 0.6))
    return sheet.moved(tilt @ spin, np.array([0.0, 0.0, 1.0]))


def _about(axis: Array, angle: float) -> Array:
    """Rotation by Rodrigues' formula."""
    k = np.cross(np.eye(3), axis)
    return np.eye(3) - np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


def _fractal(rng: Rng, size: float, roughness: float, fall: float) -> Callable[..., Array]:
    """A rough height field: waves whose height falls with their length."""
    length = np.exp(rng.uniform(np.log(0.06), np.log(size), 24))
    turn = rng.uniform(0, 2 * np.pi, 24)
    k = 2 * np.pi / length * np.array([np.cos(turn), np.sin(turn)])
    phase, height = rng.uniform(0, 2 * np.pi, 24), roughness * (length / size) ** fall

    def at(x: Array, y: Array) -> Array:
        waves = (
            a * np.cos(kx * x + ky * y + p) for kx, ky, p, a in zip(*k, phase, height, strict=True)
        )
        return np.asarray(sum(waves, np.zeros_like(x)))

    return at


def rock(rng: Rng) -> list[Patch]:
    """Draw an outcrop with folds."""
    rough = _fractal(rng, 2.0, rng.uniform(0.08, 0.2), rng.uniform(0.9, 1.3))
    turn, length = rng.uniform(0, np.pi), rng.uniform(0.4, 1.0)
    fold = rng.uniform(0.05, 0.2)

    def height(x: Array, y: Array) -> Array:
        along = np.cos(turn) * x + np.sin(turn) * y
        return rough(x, y) + fold * np.abs(np.cos(np.pi * along / length))

    tilt = _about(X, rng.uniform(0.2, 1.3))
    return [height_field((2.2, 2.2), height, is_two_sided=True).moved(tilt, 0.8 * Z)]


def cloth(rng: Rng) -> list[Patch]:
    """Draw a curtain whose folds meander as they fall."""
    pitch = rng.uniform(0.12, 0.35)
    amplitude = rng.uniform(0.15, 0.35) * pitch
    meander = _fractal(rng, 1.5, 0.25 * pitch, 1.0)

    def height(x: Array, y: Array) -> Array:
        open_out = 1 + 0.4 * y
        return open_out * amplitude * np.cos(2 * np.pi * (x + meander(x, y)) / pitch)

    sheet = height_field((1.6, 1.8), height, is_two_sided=True)
    return [sheet.moved(_about(X, np.pi / 2), 0.9 * Z)]


def tree_crown(rng: Rng) -> list[Patch]:
    """Draw a ball of leaves."""
    centre, reach = np.array([0.0, 0.0, 1.3]), rng.uniform(0.6, 0.9)
    patches = []
    for _ in range(40):
        # A cloud of leaves a twig: as one patch of many, each a small tilted square.
        twig = centre + reach * rng.uniform(0.4, 1.0) * random_direction(rng)
        n, size = 41, rng.uniform(0.04, 0.09)
        corners = twig + rng.normal(scale=0.12, size=(n, 3))
        first = unit(rng.normal(size=(n, 3)))
        second = unit(np.cross(first, rng.normal(size=(n, 3))))

        def at(u: Array, v: Array, c=corners, a=first, b=second, size=size, n=n) -> Array:
            leaf = np.clip((u * n).astype(int), 0, n - 1)
            across = (u * n - leaf)[:, None] * a[leaf] + v[:, None] * b[leaf]
            return c[leaf] + size * across

        patches.append(Patch(at, is_two_sided=True))
    return patches


def person(rng: Rng) -> list[Patch]:
    """Draw a standing person: tapering, oval limbs in folded clothes."""
    patches = []

    def limb(start: Array, end: Array, radius: float, taper: float, flat: float) -> None:
        length = float(np.linalg.norm(end - start))
        oval = Oval(radius, flat, 0.3, rng.uniform(0, np.pi))
        folds = Waves.draw(rng, 0.06 * radius, (1, 5), (0.08, 0.4))

        def radius_at(s: Array, theta: Array) -> Array:
            swell = 1 - taper * s / length - 0.12 * np.cos(2 * np.pi * s / length)
            return radius * swell + oval(s, theta) + folds(s, theta)

        line = Line(start, (end - start) / length, length)
        patches.append(Patch(tube(line, radius_at), is_inward=True))

    lean = rng.normal(scale=0.05, size=2)
    hip, chest = np.r_[0, 0, 0.9], np.r_[lean, 1.45]
    limb(hip - 0.05 * Z, chest, 0.17, 0.1, 0.35)
    for side in (-1, 1):
        foot = np.r_[rng.normal(scale=0.12), 0.14 * side, 0.02]
        limb(hip + 0.1 * side * Y, foot, 0.09, 0.4, 0.15)
        hand = np.r_[rng.normal(scale=0.2), 0.3 * side, 0.9]
        limb(chest + 0.2 * side * Y, hand, 0.055, 0.4, 0.15)
    patches.append(Patch(dome(chest + 0.22 * Z, unit(Z + 0.1 * X), 0.08, 0.12, np.pi)))
    return patches


def grating(rng: Rng) -> list[Patch]:
    """Draw a walkway of bars."""
    pitch, depth, z = rng.uniform(0.03, 0.06), rng.uniform(0.025, 0.04), rng.uniform(0.3, 1.8)
    patches = []
    for y in np.arange(-0.5, 0.5, pitch):
        low = np.array([-0.6, y, z])
        patches += _box(low, low + np.array([1.2, 0.005, depth]))[:4]
    for x in np.arange(-0.6, 0.6, 0.1):
        low = np.array([x, -0.5, z + depth - 0.006])
        patches.append(quad(low, 0.006 * X, 1.0 * Y, is_two_sided=True))
    return patches


def cable_bundle(rng: Rng) -> list[Patch]:
    """Draw cables side by side and on each other, that wander."""
    patches = []
    z0, radius = rng.uniform(0.3, 1.6), rng.uniform(0.004, 0.012)
    for k in range(rng.integers(8, 25)):
        wander = rng.uniform(0.5, 2) * radius
        wave, phase = rng.uniform(0.2, 0.7), rng.uniform(0, 2 * np.pi)
        start = np.array([-0.9, (k % 8 - 4) * 2.2 * radius, z0 + 2.1 * radius * (k // 8)])
        line = Line(
            start, X, 1.8, lambda s, w=wander, m=wave, p=phase: w * np.sin(2 * np.pi * s / m + p)
        )
        patches.append(Patch(tube(line, lambda s, theta, r=radius: r + 0 * s), is_inward=True))
    return patches


def hose_heap(rng: Rng) -> list[Patch]:
    """Draw loops of hose on a floor: pipes in shape."""
    patches = []
    radius = rng.uniform(0.015, 0.04)
    for k in range(rng.integers(3, 7)):
        loop, centre = rng.uniform(0.25, 0.5), rng.normal(scale=0.1, size=2)
        wobble = rng.uniform(0, 0.15, 3)
        phase = rng.uniform(0, 2 * np.pi, 3)

        def at(u: Array, v: Array, k=k, loop=loop, c=centre, w=wobble, p=phase) -> Array:
            turn, theta = 2 * np.pi * u, 2 * np.pi * v
            rho = loop * (1 + sum(w[i] * np.cos((i + 2) * turn + p[i]) for i in range(3)))
            out = rho + radius * np.cos(theta)
            z = radius * (1 + 2 * k) + radius * np.sin(theta)
            return np.column_stack([c[0] + out * np.cos(turn), c[1] + out * np.sin(turn), z])

        patches.append(Patch(at))
    return patches


def _swept(outline: Array, rng: Rng, *, is_two_sided: bool = True) -> list[Patch]:
    """A section of steel, standing or lying."""
    length = rng.uniform(1.2, 2.2)
    bar = extrusion(outline, length, is_two_sided=is_two_sided)
    if rng.uniform() < 0.5:
        return [bar.moved(_about(Z, rng.uniform(0, 2 * np.pi)), length / 2 * Z)]
    return [bar.moved(LYING, rng.uniform(0.2, 1.5) * Z)]


def i_beam(rng: Rng) -> list[Patch]:
    """Draw a rolled I-section with its fillets."""
    h, b = rng.uniform(0.1, 0.4), rng.uniform(0.06, 0.3)
    t, w, r = 0.05 * h + 0.004, 0.03 * h + 0.003, 0.04 * h + 0.005
    angle = np.linspace(0, np.pi / 2, 7)
    inner = np.array([w / 2 + r, h / 2 - t - r])
    fillet = inner + r * np.column_stack([-np.sin(angle), np.cos(angle)])
    quarter = np.array([[0, h / 2], [b / 2, h / 2], [b / 2, h / 2 - t], *fillet, [w / 2, 0]])
    lower = quarter[::-1] * [1, -1]
    right = np.concatenate([quarter, lower])
    return _swept(np.concatenate([right, right[::-1] * [-1, 1]]), rng)


def channel(rng: Rng) -> list[Patch]:
    """Draw a U-section with rounded corners."""
    h, b, r = rng.uniform(0.08, 0.3), rng.uniform(0.04, 0.12), rng.uniform(0.005, 0.02)
    outline = _rounded([(b, h / 2), (0, h / 2), (0, -h / 2), (b, -h / 2)], r)
    return _swept(outline, rng)


def hollow_section(rng: Rng) -> list[Patch]:
    """Draw a square or rectangular tube with rounded corners."""
    h = rng.uniform(0.06, 0.3)
    b = h if rng.uniform() < 0.5 else rng.uniform(0.5, 1.0) * h
    return _swept(_rectangle(b, h, rng.uniform(0.05, 0.12) * b), rng)


def duct(rng: Rng) -> list[Patch]:
    """Draw a rectangular duct with widely rounded corners."""
    h, b = rng.uniform(0.25, 0.6), rng.uniform(0.3, 0.8)
    return _swept(_rectangle(b, h, rng.uniform(0.12, 0.3) * min(b, h)), rng)


def _rectangle(b: float, h: float, r: float) -> Array:
    corners = [(b / 2, h / 2), (-b / 2, h / 2), (-b / 2, -h / 2), (b / 2, -h / 2)]
    return _rounded([(b / 2, 0), *corners, (b / 2, 0)], r)


def _rounded(corners: list[tuple[float, float]], radius: float) -> Array:
    """An open polyline whose inner corners are right angles rounded by `radius`."""
    points = np.array(corners, dtype=np.float64)
    outline = [points[0]]
    for before, corner, after in zip(points, points[1:], points[2:], strict=False):
        a, b = unit(before - corner), unit(after - corner)
        angle = np.linspace(0, np.pi / 2, 9)[:, None]
        centre = corner + radius * (a + b)
        outline += list(centre - radius * (np.cos(angle) * b + np.sin(angle) * a))
    return np.array([*outline, points[-1]])


CLUTTER: dict[str, Callable[[Rng], list[Patch]]] = {
    "boxes": boxes,
    "cable bundle": cable_bundle,
    "channel": channel,
    "cloth": cloth,
    "corrugated sheet": corrugated_sheet,
    "duct": duct,
    "grating": grating,
    "hollow section": hollow_section,
    "I-beam": i_beam,
    "person": person,
    "rock": rock,
    "stairs": stairs,
    "trapezoidal sheet": trapezoidal_sheet,
    "tree crown": tree_crown,
}
"""What no element of any kind may be found on."""
