"""Bodies put together to a scene, with the truth of its pipes."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum

import numpy as np

from pipecore.geometry import LineAxis
from pipecore.simulate import TrueDeformation, TrueElement
from pipecore.types import NO_ID, DeformationKind, ElementKind
from tools.world.shapes import Dent, Oval, Shape
from tools.world.surfaces import Array, Patch, across
from tools.world.tubes import Arc, Curve, Line, dome, ring_disc, tube


class Role(StrEnum):
    """What the detection should make of a body."""

    PIPE = "pipe"
    CLUTTER = "clutter"
    """Nothing."""
    CAP = "cap"
    """Nothing, or a sphere or a cap."""
    IGNORE = "ignore"
    """Anything: pipes in shape that nobody asks for."""


@dataclass(frozen=True)
class Body:
    """One thing in a scene."""

    name: str
    role: Role


NO_BODY = 0
"""Index of stray points' body."""


@dataclass(eq=False)
class Assembly:
    """Bodies, their patches, and the true elements and deformations so far."""

    bodies: list[Body] = field(default_factory=lambda: [Body("stray points", Role.CLUTTER)])
    patches: list[Patch] = field(default_factory=list)
    elements: list[TrueElement] = field(default_factory=list)
    deformations: list[TrueDeformation] = field(default_factory=list)
    branched: set[int] = field(default_factory=set)
    """Ids of elements that a branch divides."""

    def body(self, name: str, role: Role) -> int:
        """Add a body; return its index."""
        self.bodies.append(Body(name, role))
        return len(self.bodies) - 1

    def clutter(self, name: str, patches: Sequence[Patch], role: Role = Role.CLUTTER) -> None:
        """Add a body that is no pipe."""
        body = self.body(name, role)
        self.patches += [replace(p, body=body, element_id=NO_ID) for p in patches]

    def element(
        self,
        curve: Curve,
        body: int,
        radius: float,
        *,
        radius_end: float | None = None,
        kind: ElementKind = ElementKind.CYLINDER,
        shapes: Sequence[Shape] = (),
        bent: DeformationKind = DeformationKind.BOW,
        **patch: object,
    ) -> int:
        """Add the surface about a curve, with its truth; return the element's id.

        Parameters
        ----------
        curve : Curve
        body : int
        radius, radius_end : float
            At its start and end, metres.
        kind : ElementKind
        shapes : sequence of Shape
            Added to the radius; dents and ovals are deformations of the truth.
        bent : DeformationKind
            What it is if the curve leaves its chord.
        **patch
            As for `Patch`.
        """
        end = radius if radius_end is None else radius_end

        def surface_radius(s: Array, theta: Array) -> Array:
            r = radius + (end - radius) * s / curve.length
            return r + sum((shape(s, theta) for shape in shapes), np.zeros(1))

        surface = tube(curve, surface_radius)
        element_id = len(self.elements) + 1
        centre = np.full(3, np.nan) if kind is not ElementKind.TORUS else curve.axis.centre
        element = TrueElement(
            element_id, body, self.bodies[body].name, kind, curve.axis, radius, end, centre
        )
        self.elements.append(element)
        self.patches.append(Patch(surface, body, element_id, is_inward=True, **patch))
        for shape in shapes:
            if isinstance(shape, Dent):
                peak = surface(
                    np.array([shape.chainage / curve.length]),
                    np.array([shape.angle / (2 * np.pi)]),
                )
                self._deformed(element, DeformationKind.DENT, shape, peak[0], shape.depth)
            elif isinstance(shape, Oval):
                self._deformed(element, DeformationKind.OVALITY, shape, None, np.nan)
        if isinstance(curve, Line) and curve.sideways is not None and not curve.is_sheared:
            self._bent(element, curve, bent)
        return element_id

    def sphere(self, centre: Array, radius: float, body: int) -> int:
        """Add a whole sphere with its truth; return the element's id."""
        up = np.array([0.0, 0.0, 1.0])
        element_id = len(self.elements) + 1
        axis = LineAxis(centre - radius * up, up, 2 * radius)
        self.elements.append(
            TrueElement(
                element_id,
                body,
                self.bodies[body].name,
                ElementKind.SPHERE,
                axis,
                radius,
                radius,
                centre,
            )
        )
        surface = dome(centre, up, radius, radius, np.pi)
        self.patches.append(Patch(surface, body, element_id))
        return element_id

    def _deformed(
        self,
        element: TrueElement,
        kind: DeformationKind,
        shape: Dent | Oval,
        peak: Array | None,
        depth: float,
    ) -> None:
        length = element.axis.length
        start, end = max(shape.start, 0.0), min(shape.end, length)
        if isinstance(shape, Oval):
            middle, width, ovality = (start + end) / 2, 2 * np.pi * shape.radius, shape.ovality
            depth = ovality * shape.radius
            peak = element.axis.at(middle) + shape.radius * element.axis.frame(middle)[0]
        else:
            middle, width, ovality = shape.chainage, shape.width, np.nan
        assert peak is not None
        clock = float(element.axis.pipe_coordinates(peak[None])[2][0])
        self.deformations.append(
            TrueDeformation(
                len(self.deformations) + 1,
                element.element_id,
                kind,
                middle,
                start,
                end,
                clock,
                peak,
                depth,
                end - start,
                width,
                ovality,
                shape=shape.profile if isinstance(shape, Dent) else "",
            )
        )

    def _bent(self, element: TrueElement, curve: Line, kind: DeformationKind) -> None:
        """A bow or kink: the largest distance of the curve from its chord."""
        s = np.linspace(0.0, curve.length, 401)
        chainage, offset, _ = element.axis.pipe_coordinates(curve.at(s))
        i = int(np.argmax(offset))
        peak = curve.at(s[i])
        clock = float(element.axis.pipe_coordinates(peak[None])[2][0])
        self.deformations.append(
            TrueDeformation(
                len(self.deformations) + 1,
                element.element_id,
                kind,
                float(chainage[i]),
                0.0,
                element.axis.length,
                clock,
                peak,
                float(offset[i]),
                element.axis.length,
                2 * element.radius,
            )
        )


class Run:
    """Builds a line of pipes piece by piece, from where the last one ended."""

    def __init__(
        self,
        assembly: Assembly,
        name: str,
        start: Array,
        direction: Array,
        radius: float,
        role: Role = Role.PIPE,
    ):
        self.assembly = assembly
        self.body = assembly.body(name, role)
        self.position, self.direction, self.radius = start, direction, radius
        self.inward = across(direction)[0]

    def straight(self, length: float, **kwargs: object) -> int:
        """Add a straight pipe."""
        line = Line(self.position, self.direction, length)
        self.position = self.position + length * self.direction
        return self.assembly.element(line, self.body, self.radius, **kwargs)

    def bend(self, bend_radius: float, angle: float, roll: float, **kwargs: object) -> int:
        """Add a bend whose plane is turned by `roll` against that of the last one, radians."""
        normal = np.cross(self.direction, self.inward)
        inward = np.cos(roll) * self.inward + np.sin(roll) * normal
        arc = Arc(self.position, self.direction, inward, bend_radius, angle)
        end = np.array(arc.length)
        self.position, self.direction = arc.at(end), arc.tangent(end)
        self.inward = -(arc.at(end) - arc.centre) / bend_radius
        return self.assembly.element(arc, self.body, self.radius, kind=ElementKind.TORUS, **kwargs)

    def reducer(self, length: float, radius: float, eccentric: float) -> int:
        """Add a cone to another radius; `eccentric` 1 keeps one side straight, 0 the axis."""
        offset = eccentric * (self.radius - radius)
        line = Line(
            self.position, self.direction, length, lambda s: s / length * offset, is_sheared=True
        )
        start, self.radius = self.radius, radius
        self.position = line.at(np.array(length))
        return self.assembly.element(
            line, self.body, start, radius_end=radius, kind=ElementKind.CONE
        )

    def flange(self, radius: float, thickness: float, gap: float, *, is_blind: bool = False) -> int:
        """Add a pair of flanges with a gap, or one flange that is closed."""
        start, ahead = self.position, self.direction
        length = thickness if is_blind else 2 * thickness + gap
        element_id = self.assembly.element(
            Line(start, ahead, length),
            self.body,
            radius,
            kind=ElementKind.FLANGE,
            keep=None if is_blind else _outside_slab(start, ahead, thickness, gap),
        )
        self.position = start + length * ahead
        inner = 0.0 if is_blind else self.radius
        for centre, outward, hole in ((start, -ahead, self.radius), (self.position, ahead, inner)):
            surface = ring_disc(centre, outward, hole, radius)
            self.assembly.patches.append(Patch(surface, self.body))
        return element_id

    def cap(self, height: float) -> None:
        """Close the end by a dome."""
        body = self.assembly.body("cap", Role.CAP)
        surface = dome(self.position, self.direction, self.radius, height, np.pi / 2)
        self.assembly.patches.append(Patch(surface, body))


def _outside_slab(start: Array, ahead: Array, thickness: float, gap: float):
    def keep(points: Array) -> np.ndarray:
        along = (points - start) @ ahead
        return (along < thickness) | (along > thickness + gap)

    return keep
