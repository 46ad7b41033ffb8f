"""The true surface of an element: its shape with its deformations, and a mesh of it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipecore.geometry import ArcAxis, Array, surface_points
from pipecore.simulate.scene import (
    Bow,
    Bulge,
    DeformationSpec,
    Dent,
    DentShape,
    Kink,
    Ovality,
)
from pipecore.simulate.truth import TrueElement
from pipecore.types import DeformationKind, ElementKind

CHORD_ERROR = 3e-5
"""Largest distance between a facet and the arc it stands for, before centring (metres)."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """Vertices (n, 3) and triangles (m, 3)."""

    vertices: Array
    triangles: NDArray[np.uint32]


def grid_mesh(vertices: Array, *, closed: bool) -> Mesh:
    """Mesh of a grid of vertices, shape (rows, columns, 3); `closed` joins its sides."""
    n_rows, n_columns = vertices.shape[:2]
    row, column = np.meshgrid(
        np.arange(n_rows - 1), np.arange(n_columns if closed else n_columns - 1), indexing="ij"
    )
    following = (column + 1) % n_columns
    a, b = row * n_columns + column, row * n_columns + following
    c, d = a + n_columns, b + n_columns
    triangles = np.concatenate(
        [np.stack([a, b, c], axis=-1).reshape(-1, 3), np.stack([b, d, c], axis=-1).reshape(-1, 3)]
    )
    return Mesh(vertices.reshape(-1, 3), triangles.astype(np.uint32))


def facets_around(radius: float) -> int:
    """Number of facets that keep a circle of `radius` within `CHORD_ERROR`."""
    return max(24, int(np.ceil(np.pi / np.sqrt(2 * CHORD_ERROR / max(radius, 1e-3)))))


def cells_across(spec: Dent | Bulge) -> int:
    """Number of facets across a dent; creases need more, as they do not follow the edges."""
    return 50 if spec.shape is DentShape.SMOOTH else 80


def _wrapped(angle: Array) -> Array:
    return np.mod(angle + np.pi, 2 * np.pi) - np.pi


def bump(spec: Dent | Bulge, chainage: Array, clock: Array, radius: Array) -> Array:
    """Depth of a dent or bulge at surface positions, between 0 and `spec.depth`."""
    along = 2 * (chainage - spec.chainage) / spec.length
    around = 2 * radius * _wrapped(clock - np.deg2rad(spec.clock_deg)) / spec.width
    rho = np.minimum(np.hypot(along, around), 1.0)
    if spec.shape is DentShape.SMOOTH:
        return np.asarray(spec.depth * np.cos(np.pi / 2 * rho) ** 2)
    if spec.shape is DentShape.FLAT:
        return np.asarray(spec.depth * np.minimum(2 * (1 - rho), 1.0))
    return np.asarray(spec.depth * (1 - rho))


def ovality_weight(spec: Ovality, chainage: Array) -> Array:
    """How much of the ovality is there at `chainage`, 0 to 1, with smooth ends."""
    inside = np.minimum(chainage - spec.chainage_start, spec.chainage_end - chainage)
    x = np.clip(inside / max(spec.taper, 1e-9), 0.0, 1.0)
    return x * x * (3 - 2 * x)


@dataclass(frozen=True, eq=False)
class DeformedSurface:
    """The lateral surface of an element with its deformations."""

    element: TrueElement
    deformations: tuple[DeformationSpec, ...] = ()

    def radius(self, chainage: Array, clock: Array) -> Array:
        """Distance of the surface from its (displaced) axis."""
        nominal = self.element.radius_at(chainage)
        result = nominal + 0.0 * clock
        for spec in self.deformations:
            if isinstance(spec, Dent):
                result = result - bump(spec, chainage, clock, nominal)
            elif isinstance(spec, Bulge):
                result = result + bump(spec, chainage, clock, nominal)
            elif isinstance(spec, Ovality):
                harmonic = np.cos(2 * (clock - np.deg2rad(spec.clock_deg)))
                result = result + (
                    spec.ratio / 2 * nominal * ovality_weight(spec, chainage) * harmonic
                )
        return result

    def displacement(self, chainage: Array) -> Array:
        """How far the axis has moved from the undeformed one, shape (n, 3)."""
        result = np.zeros((*np.shape(chainage), 3))
        for spec in self.deformations:
            if not isinstance(spec, Bow | Kink):
                continue
            up, right = self.element.axis.frame(chainage)
            clock = np.deg2rad(spec.clock_deg)
            towards = np.cos(clock) * up + np.sin(clock) * right
            result += self._sag(spec, chainage)[..., None] * towards
        return result

    def _sag(self, spec: Bow | Kink, chainage: Array) -> Array:
        length = self.element.axis.length
        if isinstance(spec, Bow):
            # As between two clamped ends: the neighbours go on without a kink.
            return np.asarray(spec.sag * (1 - np.cos(2 * np.pi * chainage / length)) / 2)
        height = kink_height(spec, length)
        return np.interp(chainage, [0.0, spec.chainage, length], [0.0, height, 0.0])

    def points(self, chainage: Array, clock: Array) -> Array:
        """Points of the surface, arguments broadcast against each other."""
        chainage, clock = np.broadcast_arrays(chainage, clock)
        return surface_points(
            self.element.axis, chainage, self.radius(chainage, clock), clock
        ) + self.displacement(chainage)

    def mesh(self) -> Mesh:
        """Facets within `CHORD_ERROR` of the surface, and on it in the mean."""
        chainage, clock = self._chainages(), self._clocks()
        s, a = np.meshgrid(chainage, clock, indexing="ij")
        axis = self.element.axis
        # A chord lies inside its arc by two thirds of its sagitta on average.
        radius = self.radius(s, a) * (1 + (1 - np.cos(np.pi / len(clock))) * 2 / 3)
        points = surface_points(axis, s.ravel(), radius.ravel(), a.ravel())
        points += self.displacement(s.ravel())
        return grid_mesh(points.reshape(*s.shape, 3), closed=True)

    def _clocks(self) -> Array:
        n_facets = facets_around(max(self.element.radius, self.element.radius_end))
        first: float = 0.0
        for spec in self.deformations:
            if isinstance(spec, Dent | Bulge):
                n_cells = cells_across(spec)
                n_facets = max(
                    n_facets, int(n_cells * 2 * np.pi * self.element.radius / spec.width)
                )
                first = np.deg2rad(spec.clock_deg)
        return first + 2 * np.pi * np.arange(n_facets) / n_facets

    def _chainages(self) -> Array:
        element, length = self.element, self.element.axis.length
        # Around and along add up, so chords along are held to a fifth of the error.
        if element.kind is ElementKind.SPHERE:
            half = np.arcsin(min(length / 2 / element.radius, 1.0))
            n_rows = int(np.ceil(facets_around(5 * element.radius) * half / np.pi))
            return length / 2 + element.radius * np.sin(np.linspace(-half, half, n_rows + 1))
        # Facets much longer than wide slow the ray casting down.
        stations = [np.linspace(0.0, length, int(np.ceil(length / 0.3)) + 1)]
        if isinstance(element.axis, ArcAxis):
            outer = element.axis.bend_radius + element.radius
            n_chords = facets_around(5 * outer) * element.axis.bend_angle / (2 * np.pi)
            stations.append(np.linspace(0.0, length, int(np.ceil(n_chords)) + 1))
        for spec in self.deformations:
            if isinstance(spec, Dent | Bulge):
                n_cells = cells_across(spec)
                half = spec.length / 2
                stations.append(spec.chainage + np.linspace(-half, half, n_cells + 1))
            elif isinstance(spec, Ovality):
                stations.append(np.arange(spec.chainage_start, spec.chainage_end, 0.005))
            elif isinstance(spec, Bow):
                stations.append(np.linspace(0.0, length, int(length / 0.02) + 2))
            else:
                stations.append(np.array([spec.chainage]))
        return np.unique(np.clip(np.concatenate(stations), 0.0, length).round(9))


def kink_height(spec: Kink, length: float) -> float:
    """Offset of the axis at a kink from the chord of its piece."""
    return float(
        np.tan(np.deg2rad(spec.angle_deg)) * spec.chainage * (length - spec.chainage) / length
    )


KIND_OF_SPEC = {
    Dent: DeformationKind.DENT,
    Bulge: DeformationKind.BULGE,
    Ovality: DeformationKind.OVALITY,
    Bow: DeformationKind.BOW,
    Kink: DeformationKind.KINK,
}
