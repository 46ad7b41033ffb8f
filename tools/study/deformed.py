"""Deformed and clean pipes as they are scanned, detected whole, and what was read of them.

Ray-cast scans (with true occlusion) of single pipes of DN 80 to DN 400, and of plants
without deformations but with flanges, posts, elbows and everything else that stands about.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from pipecore import detect
from pipecore.geometry import Array
from pipecore.simulate import SimulatedScan, TrueDeformation, random_pipe, random_scene, scan
from pipecore.simulate.scoring import score
from pipecore.types import DeformationKind, ElementKind
from tools.study.store import measured

NOISE, SPACING, LENGTH = 0.002, 0.01, 2.0
ARCS = (140.0, 150.0, 165.0, 200.0, 240.0, 300.0, 360.0)
WIDE_ARCS = (240.0, 270.0, 300.0, 360.0)
EXTENT = 0.5
"""Of every other dent, in outside diameters; that of the others is drawn from 0.3 to 1."""

PATCHES = (DeformationKind.DENT, DeformationKind.BULGE)
SEARCHED = (ElementKind.CYLINDER, ElementKind.CONE, ElementKind.TORUS)
Row = dict[str, Any]


@dataclass(frozen=True)
class Pipe:
    """One pipe to be scanned: its seed and what is wrong with it."""

    seed: int
    kind: DeformationKind | None

    def scan(self) -> SimulatedScan:
        rng = np.random.default_rng([self.seed, 77])
        is_oval = self.kind is DeformationKind.OVALITY
        arc = float(rng.choice(WIDE_ARCS if is_oval else ARCS))
        extent = EXTENT if rng.uniform() < 0.5 else float(rng.uniform(0.3, 1.0))
        depth = float(rng.uniform(0.002, 0.016))
        if self.kind in (DeformationKind.BOW, DeformationKind.KINK):
            depth = float(rng.uniform(0.008, 0.02))
        scene = random_pipe(
            self.seed,
            kind=self.kind,
            arc_deg=arc,
            depth=depth,
            extent=extent,
            ovality=float(rng.uniform(0.02, 0.08)),
            length=LENGTH if self.kind in PATCHES else float(rng.uniform(2.0, 4.0)),
            spacing=SPACING,
            noise=NOISE,
        )
        return scan(scene)

    def row(self) -> Row:
        """What was found on it, measured now or before."""
        return measured(f"pipe-{self.kind or 'clean'}-{self.seed}", self._measure)

    def _measure(self) -> Row:
        scanned = self.scan()
        result = detect(scanned.cloud)
        s = score(result, scanned.truth, min_depth=0.0)
        row: Row = {
            "seed": self.seed,
            "radius": scanned.truth.elements[0].radius,
            "arc": float(np.median(scanned.truth.elements[0].arc_seen)),
            "clean_length": scanned.truth.elements[0].axis.length,
            "false": [_told(d) for d in (*s.false_deformations, *s.duplicate_deformations)],
        }
        if self.kind is None:
            return row
        (true,) = scanned.truth.deformations
        row |= {
            "kind": true.kind,
            "depth": true.depth,
            "extent": true.length / (2 * row["radius"]),
            "shape": true.shape,
            "ovality": true.ovality,
            "seen": true.seen,
        }
        if true.kind in PATCHES:
            row["plain"] = read_by_cylinder(scanned, true)
        right = [m for m in s.deformations if m.is_kind_right]
        if right:
            row["found"] = {
                "depth": right[0].reported.depth,
                "depth_sd": right[0].reported.depth_sd,
                "length_ratio": right[0].length_ratio,
                "width_ratio": right[0].width_ratio,
                "position_error": right[0].position_error,
                "ovality": right[0].reported.ovality,
                "significance": right[0].reported.significance,
            }
        elif s.deformations:
            row["taken_for"] = s.deformations[0].reported.kind
        return dict(_plain(row))


def clean_plant(seed: int) -> Row:
    """False alarms in a plant without deformations, seen by two stations."""
    return measured(f"clean-plant-{seed}", lambda: _measure_plant(seed))


def _measure_plant(seed: int) -> Row:
    scanned = scan(random_scene(seed, stations=2, deformed=False))
    result = detect(scanned.cloud)
    searched = [e for e in result.elements if e.kind in SEARCHED]
    return {
        "seed": seed,
        "clean_length": sum(
            e.axis.length - sum(end - start for start, end in e.gaps) for e in searched
        ),
        "n_elements": len(searched),
        "false": [
            f"{_told(d)} on {result.element(d.element_id).label}, "
            f"r {1e3 * result.element(d.element_id).radius:.0f} mm"
            for d in result.deformations
        ],
    }


def _told(d: Any) -> str:
    return f"{d.kind} {1e3 * d.depth:.1f} ± {1e3 * d.depth_sd:.1f} mm at {d.chainage:.2f} m"


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {k: _plain(v) for k, v in value.items()}
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return str(value) if isinstance(value, DeformationKind) else value


def read_by_cylinder(scanned: SimulatedScan, true: TrueDeformation) -> Row:
    """What a cylinder and the distances of the points from it tell of a dent.

    The way of other programs: a cylinder by consensus (least squares on the points within
    3 sigma, refitted till they stay), then the largest distance of a point, read where the
    dent is known to be. Its points are known from the truth to be the pipe's own, which
    flatters it. It counts as found if no point elsewhere lies further off on that side.
    """
    element = scanned.truth.elements[0]
    points = scanned.cloud.xyz[scanned.truth_element == 1].astype(np.float64)
    points += scanned.cloud.origin - scanned.truth.origin
    axis = element.axis
    up, right = axis.frame(0.0)
    x, y, z = np.array([up, right, axis.tangent(0.0)]) @ (points - axis.at(axis.length / 2)).T

    def distances(p: Array) -> Array:
        return np.asarray(np.hypot(x - p[0] - p[1] * z, y - p[2] - p[3] * z) - p[4])

    inside = np.ones(len(x), bool)
    p = np.array([0.0, 0.0, 0.0, 0.0, element.radius])
    for _ in range(5):
        p = least_squares(lambda q, use=inside: distances(q)[use], p).x
        off = distances(p)
        inside = np.abs(off) < 3 * float(np.std(off[inside]))
    signed = -off if true.kind is DeformationKind.DENT else off
    chainage, _, clock = axis.pipe_coordinates(points)
    turn = np.mod(clock - true.clock + np.pi, 2 * np.pi) - np.pi
    share = np.hypot(
        2 * (chainage - true.chainage) / true.length, 2 * turn * element.radius / true.width
    )
    there, elsewhere = share < 1.0, share > 1.2
    if not there.any():
        return {"depth": None, "is_found": False}
    depth = float(signed[there].max())
    return {"depth": depth, "is_found": depth > float(signed[elsewhere].max(initial=0.0))}
