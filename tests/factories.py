"""A small installation with its result, made by formula: for tests of what shows results.

Nothing is detected here. The shapes are known exactly, points and profiles are
drawn from them with noise, so that clouds, tables and deformations agree.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pipecore.deformation import relate_deformations
from pipecore.geometry import ArcAxis, Array, LineAxis, surface_points
from pipecore.reasons import Reason
from pipecore.settings import Settings
from pipecore.types import (
    OWN_STACK,
    Correction,
    Deformation,
    DeformationKind,
    Disagreement,
    Element,
    ElementKind,
    NominalSize,
    PointCloud,
    Profiles,
    Result,
    Stack,
    Station,
    StationCheck,
    StationPair,
    StationVerdict,
    Verdict,
)

ORIGIN = np.array([432_100.0, 6_201_870.0, 110.0])
NOISE = 0.002
PATCHES = (DeformationKind.DENT, DeformationKind.BULGE)
PROFILE_WIDTH = 0.02
NAN3 = np.full(3, np.nan)

DN200 = NominalSize("DN 200 / NPS 8", 0.2191)
DN150 = NominalSize("DN 150 / NPS 6", 0.1683)
DN100 = NominalSize("DN 100 / NPS 4", 0.1143)
DN80 = NominalSize("DN 80 / NPS 3", 0.0889)

Shape = Callable[[Array, Array], Array]
"""Radial deviation in metres at (chainage, clock angle), outward positive."""


def _round(chainage: Array, clock: Array) -> Array:
    return np.zeros(np.broadcast_shapes(np.shape(chainage), np.shape(clock)))


def bump(chainage: float, clock: float, height: float, length: float, width: float) -> Shape:
    """A smooth dent (negative height) or bulge; length and width where it has faded away."""

    def deviation(s: Array, theta: Array) -> Array:
        angle = np.mod(theta - clock + np.pi, 2 * np.pi) - np.pi
        along = np.clip(2 * (s - chainage) / length, -1, 1)
        around = np.clip(2 * angle / width, -1, 1)
        return height * np.cos(np.pi / 2 * along) ** 2 * np.cos(np.pi / 2 * around) ** 2

    return deviation


def oval(chainage: float, length: float, amplitude: float, clock: float) -> Shape:
    """A stretch whose section is r + amplitude · cos 2(θ - clock)."""

    def deviation(s: Array, theta: Array) -> Array:
        along = np.clip(2 * (s - chainage) / length, -1, 1)
        return amplitude * np.cos(np.pi / 2 * along) ** 2 * np.cos(2 * (theta - clock))

    return deviation


@dataclass(frozen=True)
class _Piece:
    """An element before it is scanned: its shape, and the clock angles that are seen."""

    run_id: int
    kind: ElementKind
    axis: LineAxis | ArcAxis
    radius: float
    radius_end: float = np.nan
    centre: Array | None = None
    nominal: NominalSize | None = None
    seen: tuple[float, float] = (0.0, 2 * np.pi)
    shape: Shape = _round

    @property
    def arc(self) -> float:
        return self.seen[1] - self.seen[0]

    def element(self, element_id: int, n_points: int) -> Element:
        carries_ovality = self.arc > np.deg2rad(200)
        return Element(
            element_id=element_id,
            run_id=self.run_id,
            kind=self.kind,
            axis=self.axis,
            radius=self.radius,
            radius_sd=_radius_factor(self.arc) * NOISE / np.sqrt(max(n_points, 4)),
            radius_end=self.radius if np.isnan(self.radius_end) else self.radius_end,
            centre=NAN3 if self.centre is None else self.centre,
            n_points=n_points,
            n_profiles=0,
            arc=self.arc,
            rms=NOISE,
            ovality=0.004 if carries_ovality else np.nan,
            ovality_sd=0.002 if carries_ovality else np.nan,
            straightness=0.0008 if self.kind is ElementKind.CYLINDER else np.nan,
            nominal=self.nominal,
            not_measurable={}
            if carries_ovality or self.kind is ElementKind.FLANGE
            else {
                "ovality": Reason(
                    "{seen}° of arc seen, {needed}° are needed",
                    seen=f"{np.rad2deg(self.arc):.0f}",
                    needed="200",
                )
            },
        )


def _radius_factor(arc: float) -> float:
    """Standard deviation of a circle's radius over σ/√n."""
    arcs = np.deg2rad([90, 120, 150, 180, 240, 360])
    return float(np.interp(arc, arcs, [10.3, 5.6, 3.4, 2.3, 1.33, 1.0]))


def _pieces() -> list[_Piece]:
    cylinder, flange = ElementKind.CYLINDER, ElementKind.FLANGE
    # Run 1: a flanged header along +X, an elbow, a riser, a reducer, a thinner riser.
    z, r = 0.6, DN150.outside_diameter / 2
    bend_radius, bend_start = 0.229, 2.1
    riser_x = bend_start + bend_radius
    bend = ArcAxis(
        centre=np.array([bend_start, 0.5, z + bend_radius]),
        normal=np.array([0.0, -1.0, 0.0]),
        towards_start=np.array([0.0, 0.0, -1.0]),
        bend_radius=bend_radius,
        bend_angle=np.pi / 2,
    )

    def riser(bottom: float, top: float) -> LineAxis:
        return LineAxis.between([riser_x, 0.5, bottom], [riser_x, 0.5, top])

    run1 = [
        _Piece(1, flange, LineAxis.between([0.3, 0.5, z], [0.325, 0.5, z]), 0.1425),
        _Piece(
            1,
            cylinder,
            LineAxis.between([0.325, 0.5, z], [bend_start, 0.5, z]),
            r,
            nominal=DN150,
            shape=bump(0.8, np.deg2rad(40), -0.012, 0.24, np.deg2rad(110)),
        ),
        _Piece(1, ElementKind.TORUS, bend, r, centre=bend.centre, nominal=DN150),
        _Piece(
            1,
            cylinder,
            riser(z + bend_radius, 1.5),
            r,
            nominal=DN150,
            shape=oval(0.36, 0.6, 0.0016, np.deg2rad(20)),
        ),
        _Piece(1, ElementKind.CONE, riser(1.5, 1.64), r, DN100.outside_diameter / 2),
        _Piece(1, cylinder, riser(1.64, 2.0), DN100.outside_diameter / 2, nominal=DN100),
    ]
    # Run 2: a long pipe with a slight fall, bulged.
    run2 = [
        _Piece(
            2,
            cylinder,
            LineAxis.between([0.2, 1.4, 0.90], [2.9, 1.6, 0.87]),
            DN200.outside_diameter / 2,
            nominal=DN200,
            shape=bump(1.9, np.deg2rad(330), 0.008, 0.30, np.deg2rad(100)),
        )
    ]
    # Run 3: a spherical vessel and a thin pipe that only one station saw.
    centre = np.array([0.6, 2.4, 0.8])
    run3 = [
        _Piece(
            3,
            ElementKind.SPHERE,
            LineAxis.between([0.35, 2.4, 0.8], [0.85, 2.4, 0.8]),
            0.30,
            centre=centre,
        ),
        _Piece(
            3,
            cylinder,
            LineAxis.between([0.9, 2.4, 0.8], [2.8, 2.7, 0.8]),
            DN80.outside_diameter / 2,
            nominal=DN80,
            seen=(np.deg2rad(35), np.deg2rad(175)),
            shape=bump(1.1, np.deg2rad(100), -0.0045, 0.16, np.deg2rad(90)),
        ),
    ]
    return run1 + run2 + run3


def _deformations(pieces: list[_Piece]) -> tuple[Deformation, ...]:
    def on_surface(element_id: int, chainage: float, clock: float) -> Array:
        piece = pieces[element_id - 1]
        radius = piece.radius + piece.shape(np.asarray(chainage), np.asarray(clock))
        return surface_points(piece.axis, chainage, radius, clock)

    def make(
        number: int,
        element_id: int,
        kind: DeformationKind,
        *,
        chainage: float,
        length: float,
        clock_deg: float,
        width_deg: float,
        depth: float,
        depth_sd: float,
        verdict: Verdict,
        ovality: float = np.nan,
    ) -> Deformation:
        clock = np.deg2rad(clock_deg)
        width = np.deg2rad(width_deg) * pieces[element_id - 1].radius
        return Deformation(
            deformation_id=number,
            element_id=element_id,
            kind=kind,
            chainage=chainage,
            chainage_start=chainage - length / 2,
            chainage_end=chainage + length / 2,
            clock=clock,
            peak=on_surface(element_id, chainage, clock),
            depth=depth,
            depth_sd=depth_sd,
            length=length,
            width=width,
            ovality=ovality,
            n_points=400 + 37 * number,
            rule="asme-6pct",
            verdict=verdict,
            significance=depth / depth_sd,
            area=np.pi / 4 * length * width if kind in PATCHES else np.nan,
            # Under a bell of height one over a disc of area one lies 1/2 - 2/π².
            volume=(0.5 - 2 / np.pi**2) * np.pi / 4 * length * width * depth
            if kind in PATCHES
            else np.nan,
            not_measurable={"strain": Reason("the wall thickness is not set")}
            if kind is DeformationKind.DENT
            else {},
        )

    return (
        make(
            1,
            2,
            DeformationKind.DENT,
            chainage=0.8,
            length=0.24,
            clock_deg=40,
            width_deg=110,
            depth=0.0121,
            depth_sd=0.0003,
            verdict=Verdict.REJECT,
        ),
        make(
            2,
            4,
            DeformationKind.OVALITY,
            chainage=0.36,
            length=0.6,
            clock_deg=20,
            width_deg=360,
            depth=0.0016,
            depth_sd=0.0002,
            verdict=Verdict.REVIEW,
            ovality=4 * 0.0016 / 0.1683,
        ),
        make(
            3,
            7,
            DeformationKind.BULGE,
            chainage=1.9,
            length=0.30,
            clock_deg=330,
            width_deg=100,
            depth=0.0080,
            depth_sd=0.0003,
            verdict=Verdict.REVIEW,
        ),
        make(
            4,
            9,
            DeformationKind.DENT,
            chainage=1.1,
            length=0.16,
            clock_deg=100,
            width_deg=90,
            depth=0.0045,
            depth_sd=0.0006,
            verdict=Verdict.REVIEW,
        ),
    )


def _stacks() -> tuple[Stack, ...]:
    return tuple(
        Stack(i + 1, direction, PROFILE_WIDTH, name=f"{'XYZ'[i]}")
        for i, direction in enumerate(np.eye(3))
    )


def _chainages(piece: _Piece, stack: Stack | None) -> tuple[Array, NDArray[np.int32]]:
    """Chainage and index of the profiles that a stack (None: the own one) cuts of a piece."""
    if stack is None:
        s = np.arange(PROFILE_WIDTH / 2, piece.axis.length, PROFILE_WIDTH)
        return s, np.arange(len(s), dtype=np.int32)
    s = np.arange(0, piece.axis.length, 0.0005)
    along = (piece.axis.at(s) @ stack.direction - stack.offset) / stack.width - 0.5
    crossing = np.flatnonzero(np.diff(np.floor(along)) != 0)
    index = np.floor(np.maximum(along[crossing], along[crossing + 1])).astype(np.int32)
    steep = np.abs(piece.axis.tangent(s[crossing]) @ stack.direction) > np.sqrt(0.5)
    return s[crossing][steep], index[steep]


def _profiles(element: Element, piece: _Piece, stack: Stack | None, seed: int) -> Profiles:
    s, index = _chainages(piece, stack)
    m = len(s)
    rng = np.random.default_rng([seed, element.element_id, stack.stack_id if stack else 0])
    tangent = np.array(piece.axis.tangent(s)).reshape(m, 3)
    normal = tangent if stack is None else np.broadcast_to(stack.direction, (m, 3))
    cos_tilt = np.abs(np.sum(tangent * normal, axis=1))
    up, right = piece.axis.frame(s)

    # Harmonics of the section: mean radius, shift of the centre, ovality.
    theta = np.linspace(0, 2 * np.pi, 180, endpoint=False)
    deviation = piece.shape(s[:, None], theta[None, :])
    n_points = np.full(m, max(12, element.n_points // max(m, 1)), np.int32)
    radius_sd = _radius_factor(piece.arc) * NOISE / np.sqrt(n_points)
    radius = element.radius_at(s) + deviation.mean(axis=1) + rng.normal(0, radius_sd, m)
    shift_up = 2 * (deviation * np.cos(theta)).mean(axis=1) + rng.normal(0, radius_sd, m)
    shift_right = 2 * (deviation * np.sin(theta)).mean(axis=1) + rng.normal(0, radius_sd, m)
    second = 2 * np.abs((deviation * np.exp(2j * theta)).mean(axis=1)) + rng.uniform(0, 1e-4, m)
    centre = piece.axis.at(s) + shift_up[:, None] * up + shift_right[:, None] * right

    in_plane = tangent - np.sum(tangent * normal, axis=1)[:, None] * normal
    norm = np.linalg.norm(in_plane, axis=1)
    # Where cut squarely the major axis has no direction of its own: take 12:00.
    major = np.where(norm[:, None] > 1e-6, in_plane / np.maximum(norm, 1e-6)[:, None], up)
    return Profiles(
        element_id=np.full(m, element.element_id, np.int32),
        stack_id=np.full(m, stack.stack_id if stack else OWN_STACK, np.int32),
        profile_index=index,
        chainage=s,
        centre=centre,
        normal=np.array(normal),
        major_direction=major,
        semi_minor=radius - second,
        semi_major=(radius + second) / cos_tilt,
        semi_minor_sd=radius_sd,
        radius=radius,
        radius_sd=radius_sd,
        ovality=4 * second / (2 * element.radius)
        if piece.arc > np.deg2rad(200)
        else np.full(m, np.nan),
        centre_deviation=np.hypot(shift_up, shift_right),
        radius_deviation=radius - element.radius_at(s),
        arc=np.full(m, piece.arc),
        n_points=n_points,
        rms=NOISE * np.sqrt(rng.chisquare(n_points) / n_points),
        aic_line=n_points * np.log(0.03**2) + 4.0,
        aic_ellipse=n_points * np.log(NOISE**2) + 10.0,
    )


def _scan_piece(
    element: Element, piece: _Piece, rng: np.random.Generator
) -> tuple[Array, NDArray[np.float32]]:
    """Points on a piece, and their radial deviation from the undeformed surface."""
    n = element.n_points
    low, high = piece.seen
    noise = rng.normal(0, NOISE, n)
    if element.kind is ElementKind.SPHERE:
        direction = rng.normal(size=(n, 3))
        direction /= np.linalg.norm(direction, axis=1)[:, None]
        points = element.centre + (element.radius + noise)[:, None] * direction
        return points, noise.astype(np.float32)
    chainage = rng.uniform(0, element.axis.length, n)
    clock = rng.uniform(low, high, n)
    deviation = piece.shape(chainage, clock) + noise
    radius = element.radius_at(chainage) + deviation
    return surface_points(element.axis, chainage, radius, clock), deviation.astype(np.float32)


def _area(piece: _Piece) -> float:
    if piece.kind is ElementKind.SPHERE:
        return 4 * np.pi * piece.radius**2
    return piece.arc * piece.radius * piece.axis.length


_COLOURS = np.array(
    [[150, 150, 155], [120, 130, 150], [60, 110, 80], [175, 140, 70]], dtype=np.float64
)


@cache
def make_scan(n_points: int = 20_000, seed: int = 1) -> tuple[PointCloud, Result]:
    """A cloud of about 3 × 3 × 2 m and its result; the same for the same arguments.

    Nine elements in three runs (flange, pipes, bend, reducer, sphere), a floor, and four
    deformations: a dent to reject, an ovality, a bulge, and a dent on a pipe that is
    seen from one side only. Treat both as read-only: they are shared between tests.
    """
    rng = np.random.default_rng(seed)
    pieces = _pieces()
    areas = np.array([_area(p) for p in pieces])
    n_floor = n_points // 5
    counts = np.floor((n_points - n_floor) * areas / areas.sum()).astype(int)
    counts[-1] += n_points - n_floor - counts.sum()

    stacks, deformations = _stacks(), _deformations(pieces)
    elements, tables, points, deviations, ids = [], [], [], [], []
    for number, (piece, count) in enumerate(zip(pieces, counts.tolist(), strict=True), start=1):
        element = piece.element(number, count)
        own = _profiles(element, piece, None, seed)
        tables += [own, *(_profiles(element, piece, stack, seed) for stack in stacks)]
        elements.append(replace(element, n_profiles=len(own)))
        xyz, deviation = _scan_piece(element, piece, rng)
        points.append(xyz)
        deviations.append(deviation)
        ids.append(np.full(count, number, np.int32))
    floor = rng.uniform([0, 0, 0], [3, 3, 0], (n_floor, 3)) + [0, 0, 1] * rng.normal(
        0, NOISE, (n_floor, 1)
    )
    points.append(floor)
    deviations.append(np.full(n_floor, np.nan, np.float32))
    ids.append(np.zeros(n_floor, np.int32))

    order = rng.permutation(n_points)  # as a scanner would: not sorted by element
    element_id = np.concatenate(ids)[order]
    run_of = np.array([0] + [p.run_id for p in pieces])
    colour = _COLOURS[run_of[element_id]] + rng.normal(0, 8, (n_points, 3))
    cloud = PointCloud(
        origin=ORIGIN,
        xyz=np.ascontiguousarray(np.concatenate(points)[order], dtype=np.float32),
        intensity=(rng.normal(0.5, 0.1, n_points) + 0.1 * (element_id > 0)).astype(np.float32),
        rgb=np.clip(colour, 0, 255).astype(np.uint8),
        stations=np.array([[1.5, -3.0, 1.6], [1.5, 6.0, 1.6]]),
        crs="ETRS89 / UTM zone 32N",
        source=Path("plant.laz"),
    )
    result = Result(
        settings=Settings(),
        origin=ORIGIN,
        source=Path("plant.laz"),
        n_cloud_points=n_points,
        stacks=stacks,
        elements=tuple(elements),
        profiles=Profiles.concatenate(tables),
        deformations=relate_deformations(deformations, elements),
        segment_id=element_id.copy(),
        element_id=element_id,
        deviation=np.concatenate(deviations)[order],
        seconds={"stacks": 0.4, "profiles": 0.9, "elements": 1.2},
    )
    return cloud, result


def make_cloud(n_points: int = 20_000, seed: int = 1) -> PointCloud:
    """The cloud of `make_scan`."""
    return make_scan(n_points, seed)[0]


def make_result(n_points: int = 20_000, seed: int = 1) -> Result:
    """The result of `make_scan`."""
    return make_scan(n_points, seed)[1]


def make_station_check() -> StationCheck:
    """Two stations: the second does not fit, and nothing can be told of it along x."""
    reason = Reason("It is off by {distance} ± {sd} mm.", distance="4.12", sd="0.10")
    held = Correction(
        np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(3), (),
        0.0, 0.0, 2, 0.002, StationVerdict.FITS, Reason("It is held."),
    )  # fmt: skip
    off = replace(
        held,
        pivot=np.array([1.0, 2.0, 0.5]),
        shift=np.array([np.nan, 4e-3, -1e-3]),
        shift_sd=np.array([np.nan, 1e-4, 1e-4]),
        untold=(np.array([1.0, 0.0, 0.0]),),
        distance=4.12e-3,
        distance_sd=1e-4,
        verdict=StationVerdict.DOES_NOT_FIT,
        reason=reason,
    )
    return StationCheck(
        (
            Station(1, "east.e57", 1200, np.array([0.0, -4.0, 1.5]), held),
            Station(2, "west.e57", 800, NAN3, off),
        ),
        (StationPair(1, 2, off, 1e-4),),
        (Disagreement(1, (1, 2), 4.1e-3, 2e-4), Disagreement(3, (1, 2), 15e-3, 1e-3)),
    )
