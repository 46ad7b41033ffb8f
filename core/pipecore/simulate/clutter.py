"""Meshes of what stands around pipes and is none."""

from itertools import pairwise

import numpy as np

from pipecore.errors import SceneError
from pipecore.geometry import Array, LineAxis, twelve_o_clock, unit
from pipecore.simulate.materials import check_material
from pipecore.simulate.parts import (
    Part,
    block,
    merged,
    rod,
    tube,
    upright_axes,
    yaw_axes,
)
from pipecore.simulate.scene import (
    Beam,
    Box,
    Clutter,
    Person,
    Plate,
    Tray,
    TrayStyle,
    Valve,
    Wire,
)
from pipecore.simulate.surface import Mesh, grid_mesh

SHEET = 0.002


def clutter_parts(clutter: tuple[Clutter, ...]) -> list[Part]:
    """Parts of all clutter of a scene.

    Raises
    ------
    SceneError
        If a thing has no extent or an unknown material.
    """
    parts: list[Part] = []
    for i, thing in enumerate(clutter):
        where = f"clutter[{i}] ({type(thing).__name__.lower()})"
        check_material(thing.material, where)
        if isinstance(thing, Box):
            if min(thing.size) <= 0:
                raise SceneError(f"{where}: the size is not positive.")
            mesh = block(np.array(thing.centre), np.array(thing.size), yaw_axes(thing.yaw_deg))
            parts.append(Part(mesh, thing.material))
        elif isinstance(thing, Plate):
            parts.append(Part(_plate(thing, where), thing.material))
        elif isinstance(thing, Beam):
            parts.append(Part(_beam(thing, where), thing.material))
        elif isinstance(thing, Tray):
            parts += _tray(thing, where)
        elif isinstance(thing, Wire):
            parts.append(Part(_wire(thing, where), thing.material))
        elif isinstance(thing, Valve):
            parts += _valve(thing)
        else:
            parts += _person(thing)
    return parts


def _plate(plate: Plate, where: str) -> Mesh:
    edges = np.array([plate.along, plate.across])
    lengths = np.linalg.norm(edges, axis=1)
    normal = np.cross(edges[0], edges[1])
    if np.linalg.norm(normal) <= 1e-9 * lengths.prod():
        raise SceneError(f"{where}: its edges span no area.")
    axes = np.vstack([edges / lengths[:, None], unit(normal)])
    return block(np.array(plate.centre), np.array([*lengths, plate.thickness]), axes)


def _span(start: Array, end: Array, where: str) -> tuple[Array, float]:
    length = float(np.linalg.norm(end - start))
    if length <= 0:
        raise SceneError(f"{where}: start and end are the same point.")
    return upright_axes((end - start) / length), length


def _beam(beam: Beam, where: str) -> Mesh:
    start, end = np.array(beam.start), np.array(beam.end)
    axes, length = _span(start, end, where)
    middle, up = (start + end) / 2, axes[2]
    flange, web = 0.06 * beam.height, 0.05 * beam.height
    return merged(
        [
            block(middle - flange / 2 * up, np.array([length, beam.width, flange]), axes),
            block(middle - beam.height / 2 * up, np.array([length, web, beam.height]), axes),
            block(
                middle - (beam.height - flange / 2) * up,
                np.array([length, beam.width, flange]),
                axes,
            ),
        ]
    )


def _tray(tray: Tray, where: str) -> list[Part]:
    start, end = np.array(tray.start), np.array(tray.end)
    axes, length = _span(start, end, where)
    along, across, up = axes
    middle = (start + end) / 2
    meshes = [
        block(
            middle + side * tray.width / 2 * across + tray.height / 2 * up,
            np.array([length, SHEET, tray.height]),
            axes,
        )
        for side in (-1, 1)
    ]
    if tray.style is TrayStyle.LADDER:
        meshes += [
            block(start + s * along + 0.01 * up, np.array([0.03, tray.width, 0.02]), axes)
            for s in np.arange(0.15, length, 0.3)
        ]
    else:
        # Strips along and across leave rows of oblong holes.
        meshes += [
            block(middle + y * across, np.array([length, 0.025, SHEET]), axes)
            for y in np.linspace(-0.5, 0.5, 6) * (tray.width - 0.025)
        ]
        meshes += [
            block(start + s * along, np.array([0.03, tray.width, SHEET]), axes)
            for s in np.arange(0.05, length, 0.1)
        ]
    parts = [Part(merged(meshes), tray.material)]
    if tray.n_cables:
        offsets = np.linspace(-0.35, 0.35, tray.n_cables) * tray.width
        radii = 0.005 + 0.004 * np.abs(np.sin(1.7 * np.arange(tray.n_cables)))
        cables = [
            rod(p + start + (0.02 + r) * up, p + end + (0.02 + r) * up, r)
            for p, r in zip(offsets[:, None] * across, radii, strict=True)
        ]
        parts.append(Part(merged(cables), "rubber"))
    return parts


def _wire(wire: Wire, where: str) -> Mesh:
    points = np.array(wire.points)
    if len(points) < 2 or wire.radius <= 0:
        raise SceneError(f"{where}: it needs two points and a radius.")
    return merged([rod(a, b, wire.radius, 12) for a, b in pairwise(points)])


def _ring(centre: Array, axis: Array, radius: float, thickness: float) -> Mesh:
    up = twelve_o_clock(axis)
    right = np.cross(axis, up)
    u, v = np.meshgrid(
        np.linspace(0, 2 * np.pi, 49), np.linspace(0, 2 * np.pi, 12, endpoint=False), indexing="ij"
    )
    out = np.cos(u)[..., None] * up + np.sin(u)[..., None] * right
    points = centre + (radius + thickness * np.cos(v))[..., None] * out
    return grid_mesh(points + (thickness * np.sin(v))[..., None] * axis, closed=True)


def _valve(valve: Valve) -> list[Part]:
    """A body with two shoulders and a bonnet, none of them round about the pipe's axis."""
    along = unit(valve.pipe_direction)
    stem = np.array(valve.stem_direction, dtype=np.float64)
    stem = unit(stem - (stem @ along) * along)
    axes = np.stack([along, np.cross(stem, along), stem])
    r, centre = valve.pipe_radius, np.array(valve.centre)
    top = centre + 4.2 * r * stem
    body = [
        block(centre, r * np.array([2.6, 2.3, 2.3]), axes),
        block(centre + 1.5 * r * stem, r * np.array([1.6, 1.6, 1.2]), axes),
        block(centre + 2.1 * r * stem, r * np.array([2.2, 2.2, 0.3]), axes),
    ]
    yoke = [
        block(centre + 2.9 * r * stem + s * 0.5 * r * along, r * np.array([0.2, 0.3, 1.5]), axes)
        for s in (-1, 1)
    ]
    wheel = [
        rod(centre + 2 * r * stem, top + 0.3 * r * stem, max(0.12 * r, 0.006)),
        _ring(top, stem, 1.4 * r, max(0.09 * r, 0.006)),
        rod(top - 1.4 * r * along, top + 1.4 * r * along, max(0.07 * r, 0.005)),
        rod(top - 1.4 * r * axes[1], top + 1.4 * r * axes[1], max(0.07 * r, 0.005)),
    ]
    return [Part(merged(body + yoke), valve.material), Part(merged(wheel), "red")]


def _person(person: Person) -> list[Part]:
    """Legs, trunk, arms and head: oval, in clothes that fold, of no constant radius."""
    foot, h = np.array(person.foot), person.height
    aside = yaw_axes(person.yaw_deg)[0]
    axis = LineAxis(foot, np.array([0.0, 0.0, 1.0]), h)

    def limb(offset: Array, heights: list[float], radii: list[float]) -> Mesh:
        at = LineAxis(axis.start + offset, axis.direction, h)
        dense = np.linspace(heights[0], heights[-1], 60)
        clock = 2 * np.pi * np.arange(36) / 36
        oval = 1.0 + 0.12 * np.cos(2 * (clock - np.deg2rad(90.0 - person.yaw_deg)))
        folds = 0.07 * np.sin(3 * clock + 60.0 * dense[:, None]) * np.sin(25.0 * dense[:, None])
        radius = np.interp(dense, heights, np.array(radii) * h)
        return tube(at, dense * h, radius[:, None] * (oval + folds), 36)

    legs = [
        limb(s * 0.055 * h * aside, [0, 0.02, 0.25, 0.48], [0.05, 0.03, 0.036, 0.055])
        for s in (-1, 1)
    ]
    arms = [limb(s * 0.14 * h * aside, [0.4, 0.6, 0.8], [0.018, 0.026, 0.034]) for s in (-1, 1)]
    trunk = limb(0 * aside, [0.46, 0.6, 0.78, 0.83, 0.86], [0.1, 0.085, 0.11, 0.05, 0.03])
    head = limb(0 * aside, [0.86, 0.88, 0.93, 0.98, 1.0], [0.02, 0.04, 0.05, 0.035, 0.0])
    return [
        Part(merged([trunk, *arms]), person.material),
        Part(merged(legs), "blue"),
        Part(head, "cream"),
    ]
