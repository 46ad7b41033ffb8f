"""From a scene's runs to elements in space: every piece starts where the last one ended."""

from dataclasses import dataclass, field

import numpy as np

from pipecore.errors import SceneError
from pipecore.geometry import ArcAxis, Array, Axis, LineAxis, unit
from pipecore.simulate.materials import check_material
from pipecore.simulate.scene import (
    Bow,
    Branch,
    Bulge,
    Cap,
    DeformationSpec,
    Dent,
    Elbow,
    Flange,
    Kink,
    Ovality,
    Piece,
    Reducer,
    Run,
    Scene,
    Sphere,
    Straight,
    Tee,
)
from pipecore.simulate.surface import KIND_OF_SPEC, DeformedSurface, kink_height
from pipecore.simulate.truth import TrueDeformation, TrueElement
from pipecore.types import ElementKind

GASKET = 0.003


@dataclass(frozen=True, eq=False)
class PlacedElement:
    """An element with the surface that is scanned and what it is made of."""

    surface: DeformedSurface
    material: str
    n_bolts: int = 0

    @property
    def element(self) -> TrueElement:
        """The element without its deformations."""
        return self.surface.element


@dataclass(frozen=True, eq=False)
class End:
    """Where a run ends: flat or with a dome, looking `outward`."""

    position: Array
    outward: Array
    radius: float
    is_domed: bool
    material: str
    run_id: int


@dataclass(frozen=True, eq=False)
class Placement:
    """All runs of a scene in space."""

    elements: tuple[PlacedElement, ...]
    ends: tuple[End, ...]

    def deformations(self) -> tuple[TrueDeformation, ...]:
        """All deformations in the order of their elements."""
        found: list[TrueDeformation] = []
        for placed in self.elements:
            found.extend(
                _true_deformation(len(found) + 1 + i, placed.surface, spec)
                for i, spec in enumerate(placed.surface.deformations)
            )
        return tuple(found)


def place_runs(scene: Scene) -> Placement:
    """Return the elements of all runs; their ids count from 1 in the order of the scene.

    Raises
    ------
    SceneError
        If a piece is impossible where it stands.
    """
    elements: list[PlacedElement] = []
    ends: list[End] = []
    for i, run in enumerate(scene.runs):
        where = f"runs[{i}]" + (f" “{run.name}”" if run.name else "")
        _require(any(run.direction), f"{where}: the direction has no length.")
        check_material(run.material, where)
        chain = _Chain(
            np.array(run.start), unit(run.direction), run.radius, i + 1, run, where, elements, ends
        )
        chain.follow(run.pieces)
    return Placement(tuple(elements), tuple(ends))


def _require(condition: bool, message: str) -> None:
    if not condition:
        raise SceneError(message)


@dataclass
class _Chain:
    """The place a run has been built up to."""

    position: Array
    direction: Array
    radius: float
    run_id: int
    run: Run
    where: str
    elements: list[PlacedElement]
    ends: list[End] = field(repr=False)
    is_branch: bool = False

    def follow(self, pieces: tuple[Piece, ...]) -> None:
        starts_domed = bool(pieces) and isinstance(pieces[0], Cap)
        if not self.is_branch and self.radius > 0:
            self._end(-self.direction, starts_domed)
        for i, piece in enumerate(pieces):
            if isinstance(piece, Cap):
                _require(i in (0, len(pieces) - 1), f"{self.where}: a cap is not at an end.")
                continue
            self._place(piece, f"{self.where}: pieces[{i}]")
        if self.radius > 0:
            self._end(self.direction, len(pieces) > 1 and isinstance(pieces[-1], Cap))

    def _end(self, outward: Array, is_domed: bool) -> None:
        self.ends.append(
            End(self.position, outward, self.radius, is_domed, self.run.material, self.run_id)
        )

    def _place(self, piece: Piece, where: str) -> None:
        if isinstance(piece, Sphere):
            self._place_sphere(piece, where)
            return
        _require(self.radius > 0, f"{where}: the run has no radius here.")
        if isinstance(piece, Elbow):
            self._place_elbow(piece, where)
            return
        if isinstance(piece, Straight):
            axis = self._ahead(piece.length, where)
            self._append(ElementKind.CYLINDER, axis, where, deformations=piece.deformations)
        elif isinstance(piece, Reducer):
            axis = self._ahead(piece.length, where)
            _require(piece.radius_end > 0, f"{where}: the radius at the end is not positive.")
            self._append(
                ElementKind.CONE,
                axis,
                where,
                radius_end=piece.radius_end,
                deformations=piece.deformations,
            )
            self.radius = piece.radius_end
        elif isinstance(piece, Flange):
            _require(piece.thickness > 0, f"{where}: the thickness is not positive.")
            _require(piece.radius > self.radius, f"{where}: the flange is thinner than its pipe.")
            axis = self._ahead(2 * piece.thickness + GASKET, where)
            self._append(
                ElementKind.FLANGE, axis, where, radius=piece.radius, n_bolts=piece.n_bolts
            )
        elif isinstance(piece, Tee):
            axis = self._ahead(piece.length, where)
            self._append(ElementKind.TEE, axis, where)
            self._branch_off(piece.branch, axis.at(piece.length / 2), where)

    def _ahead(self, length: float, where: str) -> LineAxis:
        """Go straight on by `length`."""
        _require(length > 0, f"{where}: the length is not positive.")
        axis = LineAxis(self.position, self.direction, length)
        self.position = axis.end
        return axis

    def _place_elbow(self, piece: Elbow, where: str) -> None:
        _require(0 < piece.angle_deg < 360, f"{where}: the angle is not within 0 to 360°.")
        _require(
            piece.bend_radius > self.radius,
            f"{where}: the bend radius is not larger than the pipe's radius.",
        )
        wanted = np.array(piece.towards)
        towards = wanted - (wanted @ self.direction) * self.direction
        _require(
            bool(np.linalg.norm(towards) > 1e-6 * np.linalg.norm(wanted)),
            f"{where}: “towards” is along the pipe.",
        )
        towards = unit(towards)
        axis = ArcAxis(
            self.position + piece.bend_radius * towards,
            np.cross(-towards, self.direction),
            -towards,
            piece.bend_radius,
            float(np.deg2rad(piece.angle_deg)),
        )
        self._append(ElementKind.TORUS, axis, where, deformations=piece.deformations)
        self.position, self.direction = axis.end, unit(axis.tangent(axis.length))

    def _place_sphere(self, piece: Sphere, where: str) -> None:
        _require(piece.radius > self.radius, f"{where}: the sphere is not wider than its pipe.")
        axis = self._ahead(2 * float(np.sqrt(piece.radius**2 - self.radius**2)), where)
        self._append(ElementKind.SPHERE, axis, where, radius=piece.radius)

    def _append(
        self,
        kind: ElementKind,
        axis: LineAxis | ArcAxis,
        where: str,
        *,
        radius: float | None = None,
        radius_end: float | None = None,
        deformations: tuple[DeformationSpec, ...] = (),
        n_bolts: int = 0,
    ) -> None:
        radius = self.radius if radius is None else radius
        centre = np.full(3, np.nan)
        if isinstance(axis, ArcAxis):
            centre = axis.centre
        elif kind is ElementKind.SPHERE:
            centre = axis.at(axis.length / 2)
        for i, spec in enumerate(deformations):
            _check_deformation(spec, axis, radius, f"{where}: deformations[{i}]")
        element = TrueElement(
            len(self.elements) + 1,
            self.run_id,
            self.run.name,
            kind,
            axis,
            radius,
            radius if radius_end is None else radius_end,
            centre,
        )
        self.elements.append(
            PlacedElement(DeformedSurface(element, deformations), self.run.material, n_bolts)
        )

    def _branch_off(self, branch: Branch, middle: Array, where: str) -> None:
        _require(any(branch.direction), f"{where}: the branch's direction has no length.")
        _require(
            0 < branch.radius <= self.radius, f"{where}: the branch is wider than its run or empty."
        )
        _Chain(
            middle,
            unit(branch.direction),
            branch.radius,
            self.run_id,
            self.run,
            f"{where}: branch",
            self.elements,
            self.ends,
            is_branch=True,
        ).follow(branch.pieces)


def _check_deformation(spec: DeformationSpec, axis: Axis, radius: float, where: str) -> None:
    if isinstance(spec, Dent | Bulge):
        _require(spec.depth > 0, f"{where}: the depth is not positive.")
        _require(spec.depth < radius, f"{where}: the depth exceeds the pipe's radius.")
        _require(min(spec.length, spec.width) > 0, f"{where}: length or width is not positive.")
        _require(spec.width <= 2 * np.pi * radius, f"{where}: wider than the circumference.")
        start, end = spec.chainage - spec.length / 2, spec.chainage + spec.length / 2
    elif isinstance(spec, Ovality):
        _require(0 < spec.ratio < 0.5, f"{where}: the ratio is not within 0 to 0.5.")
        _require(spec.chainage_end > spec.chainage_start, f"{where}: the stretch has no length.")
        start, end = spec.chainage_start, spec.chainage_end
    elif isinstance(spec, Kink):
        _require(0 < spec.angle_deg < 30, f"{where}: the angle is not within 0 to 30°.")
        start = end = spec.chainage
    else:
        _require(spec.sag > 0, f"{where}: the sag is not positive.")
        start, end = 0.0, axis.length
    _require(
        start >= -1e-9 and end <= axis.length + 1e-9,
        f"{where}: it reaches over the ends of its piece (0 to {axis.length:.3f} m).",
    )


def _true_deformation(
    deformation_id: int, surface: DeformedSurface, spec: DeformationSpec
) -> TrueDeformation:
    element = surface.element
    length_of_axis, circumference = element.axis.length, 2 * np.pi * element.radius
    clock = float(np.mod(np.deg2rad(spec.clock_deg), 2 * np.pi))
    ovality = angle = np.nan
    start, end, width, shape = 0.0, length_of_axis, circumference, ""
    if isinstance(spec, Dent | Bulge):
        chainage, depth, width, shape = spec.chainage, spec.depth, spec.width, str(spec.shape)
        start, end = chainage - spec.length / 2, chainage + spec.length / 2
    elif isinstance(spec, Ovality):
        start, end, ovality = spec.chainage_start, spec.chainage_end, spec.ratio
        chainage = (start + end) / 2
        depth = float(spec.ratio / 2 * element.radius_at(chainage))
    elif isinstance(spec, Bow):
        chainage, depth = length_of_axis / 2, spec.sag
    else:
        chainage, depth = spec.chainage, kink_height(spec, length_of_axis)
        angle = float(np.deg2rad(spec.angle_deg))
    s, a = np.array([chainage]), np.array([clock])
    return TrueDeformation(
        deformation_id,
        element.element_id,
        KIND_OF_SPEC[type(spec)],
        chainage,
        start,
        end,
        clock,
        surface.points(s, a)[0],
        depth,
        end - start,
        width,
        ovality,
        angle,
        shape,
    )
